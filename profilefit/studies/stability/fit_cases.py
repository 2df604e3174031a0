"""Fits: from random starts, on other rings, of noisy data, near black and white, of nonsense; what the solver says.

All problems of a law have one shape, so that one compilation serves them all: `ALBEDOS` albedos, `RINGS` rings and as
many problems side by side as are requested. The truth is the exact half space, with the noise of so many photons added
if requested.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import jax
import numpy as np

from mcml_sim.media.arrays import Floats
from profilefit.fitting.estimate import ResidualFunction, Rings, judged, rings_of
from profilefit.fitting.profiles import Profiles
from profilefit.fitting.solver import Solution, solve_batch
from profilefit.fitting.staged import fit_per_albedo
from profilefit.laws.base import Constants, ProfileLaw
from profilefit.laws.liang import Liang
from profilefit.recipes.checks import spread_out

ALBEDOS, RINGS = 8, 40
ORDINARY = tuple(np.linspace(0.2, 0.95, ALBEDOS).tolist())
DARK = tuple(np.geomspace(1e-4, 0.02, ALBEDOS).tolist())
WHITE = tuple((1.0 - np.geomspace(1e-6, 1e-3, ALBEDOS)).tolist())
LAST = 8.0  # mfp, of ordinary rings
SEED = 20
SAME_COST = 1e-6  # relative: solutions that are one optimum
STARTS, BINS, NOISE = "random starts", "bin width", "noise"
ALBEDO, NONSENSE, TRIMMING = "albedos", "nonsense", "trimming"


@dataclass(frozen=True)
class FitCase:
    """Several fits of one kind.

    subject, case, value  the law and its objective, what was varied, and to what
    converged, best       shares of the fits [-] that converged, and that reached the least cost among them
    spread                of a constant over its size [-]: the standard deviation among those at the least cost, among
                          all where data differ; where rings do, the change from ordinary ones
    worst                 the constant of the largest spread; results what the solver said, with counts
    """

    subject: str
    case: str
    value: str
    converged: float
    best: float
    spread: float
    worst: str
    results: tuple[tuple[str, int], ...]

    @property
    def is_failure(self) -> bool:
        """Whether a fit ended without a word, or said that it converged to what is no number."""
        accepted = self.case == NONSENSE and self.converged > 0
        return accepted or any(not result for result, _ in self.results) or not np.isfinite(self.spread)


def fits_of(law: Constants, objective: str, name: str, lanes: int) -> Iterator[FitCase]:
    """Yield all cases of one law."""
    names = law.seen_by(objective)
    problem, own = ResidualFunction(objective, names), law.vector(names)
    label = f"{name}, {objective}"

    def solved(begins: Floats, data: list[Rings]) -> list[Solution]:
        laws = jax.tree.map(lambda leaf: np.broadcast_to(leaf, (len(data), *np.shape(leaf))), law)
        rings = jax.tree.map(lambda *leaves: np.stack(leaves), *data)
        return [judged(one, names) for one in solve_batch(problem, begins, (laws, rings))]

    def case_of(case: str, value: str, begins: Floats, data: list[Rings], start: Floats | None = None) -> FitCase:
        solutions = solved(begins, data)
        done = [one for one in solutions if one.converged]
        least = min((one.cost for one in done), default=np.inf)
        best = [one for one in done if one.cost <= least * (1.0 + SAME_COST) + 1e-20]
        spread, worst = _spread(np.array([one.parameters for one in (done if case == NOISE else best)]), names, start)
        results = Counter(re.split("[,:]", one.result)[0] for one in solutions)
        shares = len(done) / len(solutions), len(best) / len(solutions)
        return FitCase(label, case, value, *shares, spread, worst, tuple(results.most_common()))

    alone, usual = np.tile(own, (lanes, 1)), even_rings(ORDINARY, LAST)
    random = spread_out(own, lanes, SEED)
    yield case_of(STARTS, "× e^(0.69 normal)", random, [usual] * lanes)
    yield case_of(STARTS, "× e^(2.1 normal)", random * (random / own) ** 2, [usual] * lanes)
    if isinstance(law, ProfileLaw):
        best = solved(alone, [usual] * lanes)[0].parameters
        for merged in (2, 4, 8):
            data = merged_rings(usual, merged)
            yield case_of(BINS, f"dr {merged * LAST / RINGS:g} l", alone, [data] * lanes, best)
    for photons in (1e4, 1e6, 1e8):
        yield case_of(NOISE, f"{photons:.0e} photons", alone, [_noisy(usual, photons, lane) for lane in range(lanes)])
    yield case_of(ALBEDO, "α 1e-4 … 0.02", random, [even_rings(DARK, LAST)] * lanes)
    yield case_of(ALBEDO, "α 0.999 … 1 − 1e-6", random, [even_rings(WHITE, LAST)] * lanes)
    for value, change in NONSENSES.items():
        yield case_of(NONSENSE, value, alone, [change(usual)] * lanes)


def trimmed_fits(start: Liang) -> Iterator[FitCase]:
    """Yield fits of (7) at each albedo on the rings that (6) keeps, over the epsilon of the trimming."""
    reference: Floats | None = None
    for epsilon in (0.05, 0.005, 0.0005):
        profiles = Profiles.from_exact(ORDINARY, np.linspace(0.0, 20.0, 401))
        points = fit_per_albedo(profiles, start, 1.0, "r R_d", epsilon)
        reference = points.values if reference is None else reference
        change = np.max(np.abs(points.values / reference - 1.0), axis=0)
        worst = int(np.argmax(change))
        done = float(np.mean([one == "converged" for one in points.results]))
        spread, letter = float(change[worst]), "abc"[worst]
        results = tuple(Counter(points.results).most_common())
        yield FitCase("liang, (7) an albedo", TRIMMING, f"ε {epsilon:g}", done, done, spread, letter, results)


def even_rings(alpha: tuple[float, ...], last: float) -> Rings:
    """Return exact rings of equal width from 0 to last [mfp] at each albedo."""
    return rings_of(Profiles.from_exact(alpha, np.linspace(0.0, last, RINGS + 1)))


def merged_rings(rings: Rings, count: int) -> Rings:
    """Return rings so many times as wide up to the same last radius, each beside rings of no width that do not count.

    So their number, and with it the compiled fit, stays; and every edge weighs the same in what counts edges.
    """
    edges, energy = np.asarray(rings.r_edges), np.asarray(rings.energy)
    wide = np.zeros_like(energy)
    wide[:, ::count] = energy.reshape(len(energy), -1, count).sum(axis=-1)
    used = np.zeros_like(energy)
    used[:, ::count] = 1.0
    return replace(rings, r_edges=np.append(0.0, np.repeat(edges[count::count], count)), energy=wide, used=used)


def _noisy(rings: Rings, photons: float, lane: int) -> Rings:
    """Return every ring with the noise of so many photons, drawn anew in each lane."""
    normal = np.random.default_rng((SEED, lane)).standard_normal((2, *np.shape(rings.energy)))
    energy = np.abs(np.asarray(rings.energy) + normal[0] * np.sqrt(np.asarray(rings.energy) / photons))
    beyond = np.abs(np.asarray(rings.beyond) + normal[1, :, 0] * np.sqrt(np.asarray(rings.beyond) / photons))
    return replace(rings, energy=energy, beyond=beyond)


def _spread(parameters: Floats, names: tuple[str, ...], start: Floats | None) -> tuple[float, str]:
    """Return the largest relative spread among the rows, or from `start` to the first, and whose it is."""
    if len(parameters) < (2 if start is None else 1):
        return 0.0, ""
    if start is None:
        relative = np.std(parameters, axis=0) / np.maximum(np.abs(np.mean(parameters, axis=0)), 1e-12)
    else:
        relative = np.abs(parameters[0] - start) / np.maximum(np.abs(start), 1e-12)
    worst = int(np.argmax(relative))
    return float(relative[worst]), names[worst]


def _one_albedo(rings: Rings) -> Rings:
    changed: dict[str, Any] = {}
    for name in ("alpha", "energy", "beyond", "used", "weight"):
        changed[name] = np.repeat(np.asarray(getattr(rings, name))[-1:], ALBEDOS, axis=0)
    return replace(rings, **changed)


NONSENSES: dict[str, Callable[[Rings], Rings]] = {
    "NaN in the data": lambda rings: replace(rings, energy=np.full_like(rings.energy, np.nan)),
    "all zeros": lambda rings: replace(rings, energy=np.zeros_like(rings.energy), beyond=np.zeros_like(rings.beyond)),
    "one albedo only": _one_albedo,
}

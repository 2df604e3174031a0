"""Fits: seconds against how far photon noise moves the law of Liang et al. from where it would be without noise.

Three ways to its constants from the same rings and photons: least squares on all profiles at once; the paper's
two stages, its form at each albedo and then laws through the coefficients; emcee, whose answer is the posterior mean.
Each is compared with what the very same way makes of the exact profiles, since a law that is not the truth ends
elsewhere under another weighting: misfit is no error here. The error is the change of ring energies over the exact
ones, from 0.01 mfp to 99.5 % of the energy, at all albedos, as a root mean square and at worst; `standardised` is the
distance of the constants in their own standard errors, 1 if those are right. They do not where there are few
photons: rings that rest on too few are left out, the trimming (6) ends a stride sooner or later by the noise, and a law
that is not the truth moves with what it is fitted to. Every seed traces photons of its own, and seconds and errors have
the spread of the seeds.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from mcml_sim import Grid, exact, simulate_orders
from mcml_sim.media.arrays import Floats
from profilefit.fitting import staged
from profilefit.fitting.chains import posterior
from profilefit.fitting.estimate import Fit, fit
from profilefit.fitting.profiles import Profiles
from profilefit.fitting.quality import ENERGY_WITHIN, NEAREST
from profilefit.laws.base import ProfileLaw
from profilefit.recipes import catalogue
from profilefit.studies.tradeoff.laws import judged_albedos
from profilefit.studies.tradeoff.points import Panel, Point, TradeoffPart, WithSpread, photons_text
from profilefit.studies.tradeoff.stopwatch import Track, silent

ALPHAS = judged_albedos(12)
EDGES = np.linspace(0.0, 20.0, 101)  # of what is fitted, even, as in the paper [mfp]
RINGS = np.geomspace(NEAREST, 100.0, 81)  # of what is judged [mfp]
TRIMMED, EPSILON = "r R_d", 0.005  # (6), as in the recipe liang-as-published
HELD = ("a3", "c2")  # exponents that trade against their amplitudes; so held in the recipe too
ALL_AT_ONCE, TWO_STAGES, EMCEE = "least squares", "two stages", "emcee"
ERROR = "relative change of the annuli's energies by noise [-]"
# Name, title, and whose time is the cost.
PANELS = (
    ("fit", "the fit alone, simulation given", "the fit"),
    ("whole", "with the order-resolved run it is fitted to", "simulation and fit"),
)


@dataclass(frozen=True)
class FitSizes:
    """Photons of a run, those that emcee gets too, seeds, and the longest chain [steps]."""

    photons: tuple[int, ...] = (100_000, 1_000_000, 10_000_000)
    chained: tuple[int, ...] = (100_000, 10_000_000)
    seeds: int = 8
    max_chain: int = 16_000


FULL, QUICK = FitSizes(), FitSizes((100_000,), (), 3)


@dataclass(frozen=True)
class FittedConstants:
    """Result of a fit: constants by name, their standard errors where there are any, and the word of the solver."""

    constants: Mapping[str, float]
    errors: Mapping[str, float]
    result: str


@dataclass(frozen=True)
class Trial:
    """One fit to one run's photons: seconds of the fit and of its photons, errors, and whether it converged."""

    fit_seconds: float
    light_seconds: float
    rms: float
    worst: float
    standardised: float
    converged: bool


Way = Callable[[Profiles, int], FittedConstants]
"""Profiles, seed -> constants."""


def measure(sizes: FitSizes = FULL, track: Track = silent) -> TradeoffPart:
    """Fit every run in every way, and compare with the fits to the exact profiles."""
    start: Any = catalogue.load("liang", "corrected")
    ways = _ways(start, sizes.max_chain)
    limits = {name: way(Profiles.from_exact(ALPHAS, EDGES), 0) for name, way in ways.items() if name != EMCEE}
    limits[EMCEE] = limits[ALL_AT_ONCE]
    trials: dict[tuple[str, int], list[Trial]] = {}
    compiling: dict[str, float] = {}
    for seed in track(range(sizes.seeds + 1), "fits"):  # the first compiles
        for photons in sizes.photons:
            begin = time.perf_counter()
            run = simulate_orders(Grid.from_edges(r=EDGES), photons, 1000 * seed + 700, workers=1, progress=False)
            profiles = Profiles.from_orders(run, ALPHAS)
            light = time.perf_counter() - begin
            for name in [name for name in ways if name != EMCEE or photons in sizes.chained]:
                begin = time.perf_counter()
                result = ways[name](profiles, seed)
                seconds = time.perf_counter() - begin
                if seed == 0:
                    compiling[name] = max(compiling.get(name, 0.0), seconds)
                    continue
                fitted, limit = (replace(start, **each.constants) for each in (result, limits[name]))
                away, done = standardised(result, limits[name]), result.result == "converged"
                trial = Trial(seconds, light, *change(fitted, limit), away, done)
                trials.setdefault((name, photons), []).append(trial)
    panels = []
    for panel, heading, timed in PANELS:
        points = tuple(point_of(panel, *key, group) for key, group in trials.items())
        panels.append(Panel(panel, heading, f"time of {timed}, one core [s]", ERROR, points, joined=True))
    title, notes = "Fits: time against the law's error by noise", notes_of(trials, compiling)
    return TradeoffPart("fits", title, tuple(panels), notes)


def _ways(start: Any, max_chain: int) -> dict[str, Way]:
    free = tuple(name for name in start.seen_by("radial") if name not in HELD)

    def fitted(profiles: Profiles) -> Fit:
        used, _ = staged.trimmed(profiles, TRIMMED, EPSILON)
        return fit(profiles, start, "radial", free, used, jackknife=False)

    def all_at_once(profiles: Profiles, _: int) -> FittedConstants:
        result = fitted(profiles)
        errors = {} if result.statistical is None else _errors(free, result.statistical)
        return FittedConstants(result.constants, errors, result.result)

    def two_stages(profiles: Profiles, _: int) -> FittedConstants:
        points = staged.fit_per_albedo(profiles, start, 1.0, TRIMMED, EPSILON)
        constants: dict[str, float] = {}
        errors: dict[str, float] = {}
        results = set(points.results)
        for law in staged.fit_coefficient_laws(points, start, HELD).values():
            constants |= dict(zip(law.names, map(float, law.solution.parameters), strict=True))
            errors |= {} if law.covariance is None else _errors(law.names, law.covariance)
            results.add(law.solution.result)
        return FittedConstants(constants, errors, min(results - {"converged"}, default="converged"))

    def emcee(profiles: Profiles, seed: int) -> FittedConstants:
        chain = posterior(fitted(profiles), "statistical", seed, max_chain)
        mean = dict(zip(chain.names, map(float, chain.samples.mean(axis=0)), strict=True))
        spread = dict(zip(chain.names, map(float, chain.standard_deviation), strict=True))
        return FittedConstants(mean, spread, chain.result)

    return {ALL_AT_ONCE: all_at_once, TWO_STAGES: two_stages, EMCEE: emcee}


def _errors(names: Sequence[str], covariance: Floats) -> dict[str, float]:
    return dict(zip(names, np.sqrt(np.diag(covariance)).tolist(), strict=True))


def change(law: ProfileLaw, limit: ProfileLaw) -> tuple[float, float]:
    """Return root mean square and worst change of ring energies, not scaled to A, over the exact energies [-]."""
    energy, counts = judged()
    ours, theirs = (np.diff(energy_within(one), axis=1) for one in (law, limit))
    relative = np.abs(ours - theirs)[counts] / energy[counts]
    return float(np.sqrt(np.mean(relative**2))), float(relative.max())


@cache
def judged() -> tuple[Floats, NDArray[np.bool_]]:
    """Return exact energies of the rings (albedos, rings) [-], and the rings that count."""
    share = np.asarray(exact.cdf(RINGS, ALPHAS[:, None]))
    energy = np.diff(share, axis=1) * np.asarray(exact.reflectance(ALPHAS))[:, None]
    return energy, share[:, 1:] <= ENERGY_WITHIN


def energy_within(law: ProfileLaw) -> Floats:
    """Return energy within each edge of the rings (albedos, rings + 1) [-]."""
    with jax.enable_x64(True):
        return np.asarray(law.unscaled_energy(jnp.asarray(RINGS), jnp.asarray(ALPHAS)[:, None]))


def standardised(result: FittedConstants, limit: FittedConstants) -> float:
    """Return the root mean square distance of constants from their limits, in standard errors [-], or NaN."""
    if not result.errors:
        return float("nan")
    distances = [(result.constants[name] - limit.constants[name]) / error for name, error in result.errors.items()]
    return float(np.sqrt(np.mean(np.square(distances))))


def point_of(panel: str, name: str, photons: int, trials: Sequence[Trial]) -> Point:
    """Return the point of one fit method at a number of photons, over all its trials."""
    of_fit, light, rms, worst, away, done = np.array([astuple(one) for one in trials], float).T
    facts: dict[str, float | int | str] = {
        "photons": photons,
        "standardised": float(np.median(away)),
        "light_seconds": float(np.median(light)),
        "seeds": len(trials),
        "converged": int(done.sum()),
    }
    seconds = of_fit if panel == "fit" else of_fit + light
    known = WithSpread.of(seconds), WithSpread.of(rms), WithSpread.of(worst)
    return Point(panel, name, photons_text(photons), *known, facts)


def notes_of(trials: Mapping[tuple[str, int], Sequence[Trial]], compiling: Mapping[str, float]) -> tuple[str, ...]:
    """Return notes on fits that did not converge, and on the time of first fits."""
    failed = [
        f"{missed} of {len(group)} did not converge: {name}, {photons:.0e} photons"
        for (name, photons), group in trials.items()
        if (missed := sum(not one.converged for one in group))
    ]
    compiled = ", ".join(f"{name} {seconds:.1f}" for name, seconds in compiling.items())
    return (*failed, f"first fits, which compile, not in the times [s]: {compiled}")

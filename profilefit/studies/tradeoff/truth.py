"""Truths: seconds for the profiles of several albedos, against the error of their ring energies.

The scalar tracer and `simulate` run once an albedo, `simulate_orders` once for all, the exact solution is a matter of
the number of its nodes. All on one core, in turns, each turn with photons of its own: seconds and errors have the
spread of the turns. Errors are relative, over all albedos and the rings from 0.01 mfp to 99.5 % of the energy, against
the exact solution with three times its nodes; what compiles is not timed, but told.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import jax
import numpy as np
from numpy.typing import NDArray

from mcml_sim import Grid, exact, half_space, simulate, simulate_orders
from mcml_sim.exact import hankel
from mcml_sim.exact.by_albedo import by_alpha, forget
from mcml_sim.exact.transform import STANDARD, Rule, Transform
from profilefit.fitting.quality import ENERGY_WITHIN, NEAREST
from profilefit.studies.tradeoff import scalar, stopwatch
from profilefit.studies.tradeoff.points import Panel, Point, TradeoffPart, WithSpread
from profilefit.studies.tradeoff.stopwatch import Rates, Track

Floats = NDArray[np.float64]
ALPHAS = np.array([0.2, 0.5, 0.8, 0.95, 0.99])
# The scalar tracer's rings are even, so all rings are unions of those: thirty, near even in ln r to 10 mfp.
WIDTH, EVEN = 0.01, 1024
RINGS = np.append(0, np.unique(np.round(np.geomspace(1, EVEN, 31)).astype(int)))
EDGES = RINGS * WIDTH
AS_IS = "standard nodes"
RULES = {"half the nodes": 0.5, AS_IS: 1.0, "twice the nodes": 2.0}
FINEST = 3.0  # times the standard nodes: what all errors are against
SCALAR, SIMULATE, ORDERS, EXACT = "scalar tracer", "simulate", "simulate_orders", "exact"
AXES = f"time for all {ALPHAS.size} albedos, one core [s]", "relative error of the annuli's energies [-]"
MIDDLES = 0.5 * (EDGES[1:] + EDGES[:-1])


@dataclass(frozen=True)
class TruthSizes:
    """Photons of a run of the scalar tracer, of `simulate` and of `simulate_orders`; turns; numbers of nodes; and
    whether the exact solution's own estimate of its error is told, for which it compiles anew."""

    scalar: tuple[int, ...] = (10_000, 100_000, 300_000)
    simulate: tuple[int, ...] = (100_000, 1_000_000, 3_000_000)
    orders: tuple[int, ...] = (100_000, 1_000_000, 10_000_000)
    turns: int = 5
    rules: tuple[str, ...] = tuple(RULES)
    estimate: bool = True


FULL, QUICK = (
    TruthSizes(),
    TruthSizes((2_000, 20_000), (50_000, 500_000), (50_000, 500_000), 3, (AS_IS,), estimate=False),
)


@dataclass(frozen=True)
class RingEnergies:
    """Ring energies (albedos, rings) [-], and the relative error (albedos, rings) that the method states itself."""

    energy: Floats
    stated: Floats | None


Method = Callable[[int], RingEnergies]
"""Seed -> ring energies."""


@dataclass(frozen=True)
class Contestant:
    """A method with its effort."""

    method: str
    label: str
    run: Method
    photons: int

    @property
    def key(self) -> str:
        return f"{self.method}, {self.label}"


def measure(sizes: TruthSizes = FULL, track: Track = stopwatch.silent) -> TradeoffPart:
    """Run every truth in turns, and judge what it answers."""
    found, notes = contestants(sizes)
    energies: dict[str, list[RingEnergies]] = {one.key: [] for one in found}

    def work(one: Contestant) -> stopwatch.Work:
        def run(seed: int) -> int:
            energies[one.key].append(one.run(seed))
            return 1

        return run

    rates = stopwatch.take_turns({one.key: work(one) for one in found}, sizes.turns, track, "truths")
    points = tuple(_point(one, rates, energies[one.key][1:], sizes.estimate) for one in found)
    compiling = ", ".join(f"{name} {seconds:.1f}" for name, seconds in _compiling(found, rates).items())
    title = f"Energies of annuli at {ALPHAS.size} albedos: seconds against error"
    traced = tuple(replace(point, panel="tracers") for point in points if point.method != EXACT)
    panels = (
        Panel("rings", f"{len(RINGS) - 1} annuli of a half space with n = 1, g = 0", *AXES, points, joined=True),
        Panel(
            "tracers", "the same without the exact solution, which no other n and g have", *AXES, traced, joined=True
        ),
    )
    return TradeoffPart("truth", title, panels, (*notes, f"compiling, not in the times [s]: {compiling}"))


def contestants(sizes: TruthSizes) -> tuple[list[Contestant], list[str]]:
    """Every method at every effort; and a line for what is left out."""
    found, notes = [], []
    trace = scalar.compiled()
    if trace is None:
        notes.append(f"left out: the {SCALAR} {scalar.ABSENT}")
    else:
        found += [Contestant(SCALAR, _photons(n), scalar_tracer(trace, n), n * ALPHAS.size) for n in sizes.scalar]
    found += [Contestant(SIMULATE, _photons(n), _simulated(n), n * ALPHAS.size) for n in sizes.simulate]
    found += [Contestant(ORDERS, _photons(n), by_orders(n), n) for n in sizes.orders]
    found += [Contestant(EXACT, label, _exact(STANDARD.scaled(RULES[label])), 0) for label in sizes.rules]
    return found, notes


@cache
def reference() -> Floats:
    """Energy of each ring at each albedo (albedos, rings) [-]."""
    return _solved(STANDARD.scaled(FINEST))


@cache
def judged() -> NDArray[np.bool_]:
    """The rings that count, (albedos, rings)."""
    within = np.cumsum(reference(), axis=1) / np.asarray(exact.reflectance(ALPHAS))[:, None]
    return (EDGES[:-1] >= NEAREST) & (within <= ENERGY_WITHIN)


def errors(energy: Floats) -> tuple[float, float]:
    """Root mean square and worst relative error of ring energies (albedos, rings), over the rings that count."""
    relative = np.abs(energy / reference() - 1.0)[judged()]
    return float(np.sqrt(np.mean(relative**2))), float(relative.max())


def _point(one: Contestant, rates: Rates, energies: list[RingEnergies], estimate: bool) -> Point:
    middle, worst = zip(*(errors(each.energy) for each in energies), strict=True)
    stated = [each.stated[judged()] for each in energies if each.stated is not None]
    if estimate and (one.method, one.label) == (EXACT, AS_IS):
        stated = [np.asarray(exact.error_estimate(MIDDLES, ALPHAS[:, None]))[judged()]]
    facts: dict[str, float | int | str] = {
        "photons": one.photons,
        "first_call": rates.first[one.key],
        "stated": float(np.sqrt(np.mean(np.square(stated)))) if stated else "",
    }
    seconds = WithSpread.of(rates.seconds(one.key))
    return Point("rings", one.method, one.label, seconds, WithSpread.of(middle), WithSpread.of(worst), facts)


def _compiling(found: list[Contestant], rates: Rates) -> dict[str, float]:
    """By method, what its very first call took longer than a later one [s]: the first effort compiles for all."""
    first: dict[str, float] = {}
    for one in found:
        more = rates.first[one.key] - float(np.median(rates.seconds(one.key)))
        first[one.method] = first.get(one.method, 0.0) + max(more, 0.0)
    return first


def scalar_tracer(trace: Callable, photons: int) -> Method:
    def run(seed: int) -> RingEnergies:
        rows = []
        for i, alpha in enumerate(ALPHAS):
            reflected = np.zeros(EVEN + 1)
            trace(1000 * seed + i, photons, 1.0 - alpha, alpha, WIDTH, reflected)
            rows.append(np.add.reduceat(reflected[:-1], RINGS[:-1]) / photons)
        return RingEnergies(np.array(rows), None)

    return run


def _simulated(photons: int) -> Method:
    grid = Grid.from_edges(r=EDGES)

    def run(seed: int) -> RingEnergies:
        runs = [
            simulate(half_space(float(alpha)), grid, photons, 1000 * seed + i, workers=1, progress=False).reflectance_r
            for i, alpha in enumerate(ALPHAS)
        ]
        energy = np.array([np.asarray(one.value) for one in runs]) * grid.r_areas
        error = np.array([np.asarray(one.standard_error) for one in runs]) * grid.r_areas
        return RingEnergies(energy, error / reference())

    return run


def by_orders(photons: int) -> Method:
    grid = Grid.from_edges(r=EDGES)

    def run(seed: int) -> RingEnergies:
        found = simulate_orders(grid, photons, 1000 * seed + 500, workers=1, progress=False).energy(ALPHAS)
        return RingEnergies(np.asarray(found.value), np.asarray(found.standard_error) / reference())

    return run


def _exact(rule: Rule) -> Method:
    def run(_: int) -> RingEnergies:
        return RingEnergies(_solved(rule), None)

    return run


def _solved(rule: Rule) -> Floats:
    """Ring energies from nothing: no transform is kept from one call to the next."""
    forget()
    return np.diff(by_alpha(_energy_within, EDGES, ALPHAS[:, None], exact.SEARCHLIGHT, rule), axis=1)


def _energy_within(transform: Transform, alpha: jax.Array, x: jax.Array) -> jax.Array:
    return alpha * transform.reflectance * hankel.cdf(transform, x)


def _photons(number: int) -> str:
    """10^5 and the like, as people say it."""
    return f"{number:.0e}".replace("e+0", "e") + " photons"

"""Truths: seconds for the profiles of several albedos, or of a stack, against the error of their ring energies.

The scalar tracer and `simulate` run once an albedo, `simulate_orders` once for all, the exact solution is a matter of
the number of its nodes; where the surface refracts it needs a table of the index, which is kept. All on one core, in
turns, each turn with photons of its own: seconds and errors have the spread of the turns. Errors are relative, over all
albedos and the rings from 0.01 mfp to 99.5 % of the energy, against the exact solution with more nodes; what compiles
is not timed, but told.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mcml_sim import Grid, exact, simulate, simulate_orders
from mcml_sim.exact import refracting
from mcml_sim.exact.stack import solution
from mcml_sim.exact.transform import STANDARD, Rule
from profilefit.studies.tradeoff import annuli, scalar, stopwatch
from profilefit.studies.tradeoff.annuli import ALPHAS, BREAKS, EDGES, EVEN, MATCHED, REFRACTING, STACK, WIDTH, Annuli
from profilefit.studies.tradeoff.points import Panel, Point, TradeoffPart, WithSpread
from profilefit.studies.tradeoff.stopwatch import Rates, Track

Floats = NDArray[np.float64]
AS_IS = "standard nodes"
RULES = {"half the nodes": 0.5, AS_IS: 1.0, "twice the nodes": 2.0}
STACK_NODES = {"fewer nodes": solution.STANDARD.fewer, AS_IS: solution.STANDARD}
SCALAR, SIMULATE, ORDERS, EXACT = "scalar tracer", "simulate", "simulate_orders", "exact"
AXES = f"time for all {ALPHAS.size} albedos, one core [s]", "relative error of the annuli's energies [-]"
STACK_AXES = "time, one core [s]", AXES[1]


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
    """A method with its effort, and the rings that it is to know."""

    annuli: Annuli
    method: str
    label: str
    run: Method
    photons: int = 0

    @property
    def key(self) -> str:
        return f"{self.annuli.panel}: {self.method}, {self.label}"


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
    title = f"Energies of annuli at {ALPHAS.size} albedos, and of a stack: seconds against error"
    panels = [
        Panel(one.panel, one.title, *axes, tuple(p for p in points if p.panel == one.panel), joined=True)
        for one, axes in ((MATCHED, AXES), (REFRACTING, AXES), (STACK, STACK_AXES))
    ]
    traced = tuple(replace(point, panel="tracers") for point in panels[0].points if point.method != EXACT)
    panels.insert(1, Panel("tracers", "the same without the exact solution", *AXES, traced, joined=True))
    return TradeoffPart("truth", title, tuple(panels), (*notes, f"compiling, not in the times [s]: {compiling}"))


def contestants(sizes: TruthSizes) -> tuple[list[Contestant], list[str]]:
    """Every method at every effort; and a line for what is left out."""
    found, notes = [], []
    trace = scalar.compiled()
    if trace is None:
        notes.append(f"left out: the {SCALAR} {scalar.ABSENT}")
    else:
        for n in sizes.scalar:
            found.append(Contestant(MATCHED, SCALAR, _photons(n), scalar_tracer(trace, n), n * ALPHAS.size))
    for case in (MATCHED, REFRACTING, STACK):
        for n in sizes.simulate:
            found.append(Contestant(case, SIMULATE, _photons(n), _simulated(case, n), n * len(case.media)))
    for case in (MATCHED, REFRACTING):
        found += [Contestant(case, ORDERS, _photons(n), by_orders(case, n), n) for n in sizes.orders]
    for label in sizes.rules:
        found.append(Contestant(MATCHED, EXACT, label, _exact(MATCHED, STANDARD.scaled(RULES[label]))))
    found.append(Contestant(REFRACTING, EXACT, AS_IS, _exact(REFRACTING, STANDARD)))
    found.append(Contestant(REFRACTING, EXACT, "and the table of n", _exact(REFRACTING, STANDARD, anew=True)))
    found += [Contestant(STACK, EXACT, label, _exact_stack(nodes)) for label, nodes in STACK_NODES.items()]
    return found, notes


def _point(one: Contestant, rates: Rates, energies: list[RingEnergies], estimate: bool) -> Point:
    middle, worst = zip(*(one.annuli.errors(each.energy) for each in energies), strict=True)
    stated = [each.stated[one.annuli.judged] for each in energies if each.stated is not None]
    if estimate and (one.annuli, one.method, one.label) == (MATCHED, EXACT, AS_IS):
        stated = [np.asarray(exact.error_estimate(annuli.MIDDLES, ALPHAS[:, None]))[MATCHED.judged]]
    facts: dict[str, float | int | str] = {
        "photons": one.photons,
        "first_call": rates.first[one.key],
        "stated": float(np.sqrt(np.mean(np.square(stated)))) if stated else "",
    }
    seconds = WithSpread.of(rates.seconds(one.key))
    return Point(one.annuli.panel, one.method, one.label, seconds, WithSpread.of(middle), WithSpread.of(worst), facts)


def _compiling(found: list[Contestant], rates: Rates) -> dict[str, float]:
    """By method, what its very first call took longer than a later one [s]: the first effort compiles for all."""
    first: dict[str, float] = {}
    for one in found:
        more = rates.first[one.key] - float(np.median(rates.seconds(one.key)))
        name = f"{one.method} ({one.annuli.panel})"
        first[name] = first.get(name, 0.0) + max(more, 0.0)
    return first


def scalar_tracer(trace: Callable, photons: int) -> Method:
    def run(seed: int) -> RingEnergies:
        rows = []
        for i, alpha in enumerate(ALPHAS):
            reflected = np.zeros(EVEN + 1)
            trace(1000 * seed + i, photons, 1.0 - alpha, alpha, WIDTH, reflected)
            rows.append(np.add.reduceat(reflected[:-1], BREAKS[:-1]) / photons)
        return RingEnergies(np.array(rows), None)

    return run


def _simulated(case: Annuli, photons: int) -> Method:
    grid = Grid.from_edges(r=EDGES)

    def run(seed: int) -> RingEnergies:
        runs = [
            simulate(medium, grid, photons, 1000 * seed + i, workers=1, progress=False).reflectance_r
            for i, medium in enumerate(case.media)
        ]
        energy = np.array([np.asarray(one.value) for one in runs]) * grid.r_areas
        error = np.array([np.asarray(one.standard_error) for one in runs]) * grid.r_areas
        return RingEnergies(energy, error / case.reference)

    return run


def by_orders(case: Annuli, photons: int) -> Method:
    grid = Grid.from_edges(r=EDGES)

    def run(seed: int) -> RingEnergies:
        found = simulate_orders(grid, photons, 1000 * seed + 500, setting=case.setting, workers=1, progress=False)
        energy = found.energy(ALPHAS)
        return RingEnergies(np.asarray(energy.value), np.asarray(energy.standard_error) / case.reference)

    return run


def _exact(case: Annuli, rule: Rule, anew: bool = False) -> Method:
    """`anew` makes the table of n, too, that is otherwise kept."""

    def run(_: int) -> RingEnergies:
        if anew:
            refracting.new_table(float(case.setting.n), rule)
        return RingEnergies(np.diff(annuli.half_spaces(case.setting, rule), axis=1), None)

    return run


def _exact_stack(nodes: exact.Nodes) -> Method:
    return lambda _: RingEnergies(np.diff(annuli.stack(nodes), axis=1), None)


def _photons(number: int) -> str:
    """10^5 and the like, as people say it."""
    return f"{number:.0e}".replace("e+0", "e") + " photons"

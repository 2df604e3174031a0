"""Truths: seconds for the profiles of several albedos, or of a stack, against the error of their ring energies.

The scalar tracer and `simulate` run once an albedo, `simulate_orders` once for all, the exact solution is a matter of
the number of its nodes; where the surface refracts it needs a table of the index, which is kept. All on one core, in
turns, each turn with photons of its own: seconds and errors have the spread of the turns. Errors are relative, over all
albedos and the rings from 0.01 mfp to 99.5 % of the energy, against the exact solution with more nodes; what compiles
is not timed, but noted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

from mcml_sim import Grid, Layer, Medium, Setting, exact, half_space, simulate, simulate_orders
from mcml_sim.exact import by_albedo, refracting
from mcml_sim.exact.stack import solution
from mcml_sim.exact.stack.quadrature import Nodes
from mcml_sim.exact.transform import STANDARD, Rule, Transform
from mcml_sim.media.arrays import Floats
from profilefit.fitting.quality import ENERGY_WITHIN, NEAREST
from profilefit.studies.tradeoff import scalar, stopwatch
from profilefit.studies.tradeoff.points import Panel, Point, TradeoffPart, WithSpread, photons_text

RingEnergies = tuple[Floats, Floats | None]
"""Ring energies (albedos, rings) [-], and the relative error (albedos, rings) that the method states itself."""
Method = Callable[[int], RingEnergies]
"""Seed -> ring energies."""
ALPHAS = np.array([0.2, 0.5, 0.8, 0.95, 0.99])
# The scalar tracer's rings are even, so all rings are unions of those: thirty, near even in ln r to 10 mfp.
WIDTH, EVEN = 0.01, 1024
BREAKS = np.append(0, np.unique(np.round(np.geomspace(1, EVEN, 31)).astype(int)))
EDGES = BREAKS * WIDTH
MIDDLES = 0.5 * (EDGES[1:] + EDGES[:-1])
GRID = Grid.from_edges(r=EDGES)
FINEST = 3.0, 1.5  # times the standard nodes: what all errors are against, where n is 1 and else
LAYERS = Medium((Layer(1.4, 0.2, 1.8, 0.0, 0.3), Layer(1.4, 0.02, 0.98, 0.0, 1.0), Layer(1.4, 0.3, 1.2, 0.0)))


@dataclass(frozen=True)
class Annuli:
    """Annuli whose energies every method is asked for, at each albedo of a medium or of one stack.

    panel, title  of their chart;  media  a row each;  setting  light and n
    within        reference: energy within EDGES, (rows, rings + 1) [-];  whole  (rows, 1) [-]
    """

    panel: str
    title: str
    media: tuple[Medium, ...]
    setting: Setting
    within: Callable[[], Floats]
    whole: Callable[[], Floats]

    @cached_property
    def reference(self) -> Floats:
        """Energy of each ring (rows, rings) [-]."""
        return np.diff(self.within(), axis=1)

    @cached_property
    def judged(self) -> NDArray[np.bool_]:
        """Rings that count, (rows, rings)."""
        within = np.cumsum(self.reference, axis=1) / self.whole()
        return (EDGES[:-1] >= NEAREST) & (within <= ENERGY_WITHIN)

    def errors(self, energy: Floats) -> tuple[float, float]:
        """Return the root mean square and worst relative error of ring energies (rows, rings) that count."""
        relative = np.abs(energy / self.reference - 1.0)[self.judged]
        return float(np.sqrt(np.mean(relative**2))), float(relative.max())


def half_spaces(setting: Setting, rule: Rule, anew: bool = False) -> Floats:
    """Return the energy within EDGES at ALPHAS from the table of n alone, which is kept unless made `anew`."""
    if anew:
        refracting.new_table(float(setting.n), rule)
    by_albedo.forget()  # no transform is kept between calls
    return by_albedo.by_alpha(_energy_within, EDGES, ALPHAS[:, None], setting, rule)


def _energy_within(transform: Transform, alpha: jax.Array, x: jax.Array) -> jax.Array:
    return alpha * transform.reflectance * by_albedo.cdf(transform, alpha, x)


def stack(nodes: Nodes) -> Floats:
    """Return the energy within EDGES of LAYERS, (1, rings + 1), from nothing."""
    light = exact.solve(LAYERS, nodes=nodes)
    return np.asarray(light.cdf(EDGES))[None] * light.reflectance


def _of_half_space(panel: str, setting: Setting, finest: float) -> Annuli:
    title = f"{EDGES.size - 1} annuli of a half space with n = {setting.n:g}, g = 0"
    media = tuple(half_space(float(alpha), n=float(setting.n)) for alpha in ALPHAS)
    within = partial(half_spaces, setting, STANDARD.scaled(finest))
    return Annuli(panel, title, media, setting, within, lambda: np.asarray(exact.reflectance(ALPHAS, setting))[:, None])


MATCHED = _of_half_space("rings", exact.SEARCHLIGHT, FINEST[0])
REFRACTING = _of_half_space("refracting", Setting(n=1.4), FINEST[1])
STACK = Annuli(
    *("stack", f"{EDGES.size - 1} annuli of three layers with n = 1.4, g = 0", (LAYERS,), Setting(n=1.4)),
    partial(stack, solution.FINE),
    lambda: np.array([[exact.solve(LAYERS).reflectance]]),
)

AS_IS = "standard nodes"
RULES = {"half the nodes": 0.5, AS_IS: 1.0, "twice the nodes": 2.0}
STACK_NODES = {"fewer nodes": solution.STANDARD.fewer, AS_IS: solution.STANDARD}
SCALAR, SIMULATE, ORDERS, EXACT = "scalar tracer", "simulate", "simulate_orders", "exact"
AXES = f"time for all {ALPHAS.size} albedos, one core [s]", "relative error of the annuli's energies [-]"
STACK_AXES = "time, one core [s]", AXES[1]


@dataclass(frozen=True)
class TruthSizes:
    """Sizes of a comparison of ways to compute ring energies.

    scalar, simulate, orders  photons of the runs of each tracer;  turns  that are timed
    rules     names in `RULES` of the exact solution's numbers of nodes
    estimate  whether the exact solution's own estimate of its error is given, for which it compiles anew
    """

    scalar: tuple[int, ...] = (10_000, 100_000, 300_000)
    simulate: tuple[int, ...] = (100_000, 1_000_000, 3_000_000)
    orders: tuple[int, ...] = (100_000, 1_000_000, 10_000_000)
    turns: int = 5
    rules: tuple[str, ...] = tuple(RULES)
    estimate: bool = True


FULL = TruthSizes()
QUICK = TruthSizes((2_000, 20_000), (50_000, 500_000), (50_000, 500_000), 3, (AS_IS,), estimate=False)


@dataclass(frozen=True)
class Contestant:
    """Method with its effort, and the annuli that it is asked for."""

    annuli: Annuli
    method: str
    label: str
    run: Method
    photons: int = 0

    @property
    def key(self) -> str:
        return f"{self.annuli.panel}: {self.method}, {self.label}"


def measure(sizes: TruthSizes = FULL, track: stopwatch.Track = stopwatch.silent) -> TradeoffPart:
    """Run every method in turns, and judge its answers."""
    every, notes = contestants(sizes)
    energies: dict[str, list[RingEnergies]] = {one.key: [] for one in every}

    def run(contestant: Contestant, seed: int) -> int:
        energies[contestant.key].append(contestant.run(seed))
        return 1

    rates = stopwatch.take_turns({one.key: partial(run, one) for one in every}, sizes.turns, track, "truths")
    points = tuple(_point(one, rates, energies[one.key][1:], sizes.estimate) for one in every)
    first: dict[str, float] = {}  # what a method's very first call took longer than later ones: it compiles for all
    for one in every:
        more = rates.first[one.key] - float(np.median(rates.seconds(one.key)))
        name = f"{one.method} ({one.annuli.panel})"
        first[name] = first.get(name, 0.0) + max(more, 0.0)
    compiling = ", ".join(f"{name} {seconds:.1f}" for name, seconds in first.items())
    title = f"Energies of annuli at {ALPHAS.size} albedos, and of a stack: seconds against error"
    panels = [
        Panel(case.panel, case.title, *axes, tuple(p for p in points if p.panel == case.panel), joined=True)
        for case, axes in ((MATCHED, AXES), (REFRACTING, AXES), (STACK, STACK_AXES))
    ]
    traced = tuple(replace(point, panel="tracers") for point in panels[0].points if point.method != EXACT)
    panels.insert(1, Panel("tracers", "the same without the exact solution", *AXES, traced, joined=True))
    return TradeoffPart("truth", title, tuple(panels), (*notes, f"compiling, not in the times [s]: {compiling}"))


def contestants(sizes: TruthSizes) -> tuple[list[Contestant], list[str]]:
    """Return every method at every effort, and a line for what is left out."""
    each: list[tuple[Annuli, str, int | str, Method]] = []
    trace = scalar.compiled()
    if trace is not None:
        each += [(MATCHED, SCALAR, n, partial(scalar_tracer, trace, n)) for n in sizes.scalar]
    cases = (MATCHED, REFRACTING, STACK)
    each += [(case, SIMULATE, n, partial(_simulated, case, n)) for case in cases for n in sizes.simulate]
    each += [(case, ORDERS, n, partial(by_orders, case, n)) for case in cases[:2] for n in sizes.orders]
    rules = {rule: STANDARD.scaled(RULES[rule]) for rule in sizes.rules}
    each += [(MATCHED, EXACT, name, _exact(half_spaces, MATCHED.setting, rule)) for name, rule in rules.items()]
    each += [(REFRACTING, EXACT, AS_IS, _exact(half_spaces, REFRACTING.setting, STANDARD))]
    each += [(REFRACTING, EXACT, "and the table of n", _exact(half_spaces, REFRACTING.setting, STANDARD, True))]
    each += [(STACK, EXACT, label, _exact(stack, nodes)) for label, nodes in STACK_NODES.items()]
    found = []
    for case, method, effort, run in each:
        number = 0 if isinstance(effort, str) else effort * (1 if method == ORDERS else len(case.media))
        label = effort if isinstance(effort, str) else photons_text(effort)
        found.append(Contestant(case, method, label, run, number))
    return found, [] if trace else [f"left out: the {SCALAR} {scalar.ABSENT}"]


def _point(contestant: Contestant, rates: stopwatch.Rates, energies: list[RingEnergies], estimate: bool) -> Point:
    case, method, label = contestant.annuli, contestant.method, contestant.label
    middle, worst = zip(*(case.errors(energy) for energy, _ in energies), strict=True)
    stated = [each[case.judged] for _, each in energies if each is not None]
    if estimate and (case, method, label) == (MATCHED, EXACT, AS_IS):
        stated = [np.asarray(exact.error_estimate(MIDDLES, ALPHAS[:, None]))[MATCHED.judged]]
    facts: dict[str, float | int | str] = {
        "photons": contestant.photons,
        "first_call": rates.first[contestant.key],
        "stated": float(np.sqrt(np.mean(np.square(stated)))) if stated else "",
    }
    seconds = WithSpread.of(rates.seconds(contestant.key))
    return Point(case.panel, method, label, seconds, WithSpread.of(middle), WithSpread.of(worst), facts)


def scalar_tracer(trace: Callable, photons: int, seed: int) -> RingEnergies:
    """Run the scalar tracer at each albedo."""
    rows = []
    for i, alpha in enumerate(ALPHAS):
        reflected = np.zeros(EVEN + 1)
        trace(1000 * seed + i, photons, 1.0 - alpha, alpha, WIDTH, reflected)
        rows.append(np.add.reduceat(reflected[:-1], BREAKS[:-1]) / photons)
    return np.array(rows), None


def _simulated(case: Annuli, photons: int, seed: int) -> RingEnergies:
    energy, error = np.empty((2, len(case.media), EDGES.size - 1))
    for i, medium in enumerate(case.media):
        run = simulate(medium, GRID, photons, 1000 * seed + i, workers=1, progress=False).reflectance_r
        energy[i], error[i] = run.value * GRID.r_areas, run.standard_error * GRID.r_areas
    return energy, error / case.reference


def by_orders(case: Annuli, photons: int, seed: int) -> RingEnergies:
    """Trace photons by scattering order, and weight the orders for every albedo."""
    orders = simulate_orders(GRID, photons, 1000 * seed + 500, setting=case.setting, workers=1, progress=False)
    energy = orders.energy(ALPHAS)
    return np.asarray(energy.value), np.asarray(energy.standard_error) / case.reference


def _exact(within: Callable[..., Floats], *given: Any) -> Method:
    """Return the exact solution, by a function of the energy within EDGES: the same whatever the seed."""
    return lambda _: (np.diff(within(*given), axis=1), None)

"""Seconds against error of the exact half space, by number of nodes, beside those of the tracer, by number of photons.

    python -m benchmarks.exact                                      # a minute on two cores
    python -m benchmarks.exact --figure exact.png --photons 1e6 1e7

The same 256 radii and 32 albedos for all. The error of `exact` is relative to itself with twice the nodes of each
quadrature, which tests hold against two other routes; no transform is kept from one turn to the next. The tracer
answers for the mean of R_d over the rings between the radii, from one order-resolved run for all albedos; its error is
the deviation of those from `exact`. All in one process; the solutions take turns.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from matplotlib import pyplot
from numpy.typing import NDArray

from mcml_sim import Grid, exact, simulate_orders
from mcml_sim.exact.by_albedo import by_alpha, forget, profile
from mcml_sim.exact.transform import STANDARD, Rule

Floats = NDArray[np.float64]

RADII = np.geomspace(1e-3, 15.0, 256)
ALPHAS = 1 - np.linspace(np.sqrt(0.95), np.sqrt(0.001), 32) ** 2
LEAST_PROFILE = 1e-11  # what is darker does not count [1/mfp^2]
FACTORS = (0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.25)  # of the standard numbers of nodes
TURNS = 10


@dataclass(frozen=True)
class Point:
    """Cost and error of one choice."""

    label: str
    seconds: float
    errors: Floats
    """Relative errors of all that counts, (radii or rings and albedos that do,)."""

    @property
    def median(self) -> float:
        return float(np.median(self.errors))

    @property
    def largest(self) -> float:
        return float(np.max(self.errors))


def solved(rule: Rule) -> Floats:
    """Return R_d (albedos, radii), from nothing."""
    forget()
    return by_alpha(profile, RADII, ALPHAS[:, None], exact.SEARCHLIGHT, rule)


def fastest(works: dict[str, Callable[[], object]]) -> dict[str, float]:
    """Return the seconds of each work's fastest turn, after one that compiles it."""
    for work in works.values():
        work()
    seconds = dict.fromkeys(works, np.inf)
    for _ in range(TURNS):
        for name, work in works.items():
            begin = time.perf_counter()
            work()
            seconds[name] = min(seconds[name], time.perf_counter() - begin)
    return seconds


def of_exact() -> list[Point]:
    """Yield one point for each number of nodes, fewest first."""
    truth = solved(STANDARD.scaled(2.0))
    bright = truth >= LEAST_PROFILE
    rules = {f"{rule.k}, {rule.m}, {rule.x}": rule for rule in map(STANDARD.scaled, FACTORS)}
    seconds = fastest({label: lambda rule=rule: solved(rule) for label, rule in rules.items()})
    errors = {label: np.abs(solved(rule) / truth - 1)[bright] for label, rule in rules.items()}
    return [Point(label, seconds[label], errors[label]) for label in rules]


def of_tracer(photons: int) -> Point:
    """Return the point of the order-resolved run of that many photons."""
    edges = np.append(0.0, RADII)
    grid = Grid.from_edges(r=edges)
    begin = time.perf_counter()
    found = simulate_orders(grid, photons, seed=1).energy(ALPHAS).value[:, 1:]
    seconds = time.perf_counter() - begin
    within = exact.cdf(RADII, ALPHAS[:, None]) * np.asarray(exact.reflectance(ALPHAS))[:, None]
    truth = np.diff(within, axis=1)
    bright = truth >= LEAST_PROFILE * grid.r_areas[1:]
    return Point(f"{photons:.0e}".replace("e+0", "e") + " photons", seconds, np.abs(found / truth - 1)[bright])


def draw(points: dict[str, list[Point]], path: str) -> None:
    """Draw error over seconds, both logarithmic; the median filled, the largest open; by the ends, nodes or photons."""
    figure, axes = pyplot.subplots(figsize=(7.0, 4.6), layout="constrained")
    for (name, line), colour, marker in zip(points.items(), ("#0072B2", "#D55E00"), "os", strict=True):
        seconds = [point.seconds for point in line]
        style = {"color": colour, "marker": marker, "markersize": 5}
        axes.loglog(seconds, [point.median for point in line], "-", label=f"{name}, median", **style)
        axes.loglog(seconds, [point.largest for point in line], "--", mfc="white", label=f"{name}, largest", **style)
        for point in (line[0], line[-1]):
            at = (point.seconds, point.largest)
            axes.annotate(point.label, at, (0, 8), textcoords="offset points", ha="center", fontsize=8)
    axes.set_xlabel("time for 256 radii × 32 albedos [s]")
    axes.set_ylabel("relative error of $R_d$")
    axes.grid(alpha=0.3)
    axes.margins(x=0.15, y=0.1)
    axes.legend(frameon=False, loc="center right")
    figure.savefig(path, dpi=150)


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--photons", type=float, nargs="+", default=[1e6, 1e7, 1e8], help="of the tracer's runs")
    parser.add_argument("--figure", help="where to draw error over seconds, .png or .svg")
    options = parser.parse_args()

    begin = time.perf_counter()
    solved(STANDARD)
    print(f"compiling and solving once: {time.perf_counter() - begin:.1f} s")
    simulate_orders(Grid.from_edges(r=np.append(0.0, RADII)), 1000)  # compiles
    points = {"exact": of_exact(), "tracer": [of_tracer(int(photons)) for photons in options.photons]}
    print(f"{'nodes (k, m, x), photons':>26} {'seconds':>9} {'median error':>13} {'largest error':>14}")
    for point in (point for line in points.values() for point in line):
        print(f"{point.label:>26} {point.seconds:9.3f} {point.median:13.1e} {point.largest:14.1e}")
    if options.figure:
        draw(points, options.figure)


if __name__ == "__main__":
    main()

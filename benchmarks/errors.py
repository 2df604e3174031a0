"""Errors of constants side by side: `python -m benchmarks.errors` estimates the errors of one run in six ways.

photons         sandwich: the closed-form covariance of the photons through the derivative of the optimum
bootstrap       the same from outside: 64 batches drawn with replacement, fitted again; known to 9 %
emcee, photons  a chain whose curvature is adjusted to the sandwich: the same where the misfit is a parabola
misfit          s^2 (J^T J)^-1: another question, what the residuals leave open if they were independent noise
emcee, misfit   the same by a chain, which sees the misfit's own shape beyond a parabola
model           the residuals for what they are, one draw of a smooth process: they repeat each other
jackknife       what a sixth of the albedos moves: grows with how far a constant rests on a few of them
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import numpy as np
from rich.progress import Progress

from benchmarks.interval_coverage import fitted
from benchmarks.refits import bootstrap
from benchmarks.table import show
from mcml_sim import Grid, Orders, simulate_orders
from profilefit.fitting.chains import posterior
from profilefit.fitting.discrepancy import discrepancy
from profilefit.fitting.profiles import Profiles
from profilefit.recipes import catalogue, recipe
from profilefit.recipes.targets import albedo_values, ring_edges

LAWS = ("burley-whole", "liang-whole", "hazard")
SEED, BATCHES, BATCH_PHOTONS = 100, 64, 2**18
COLUMNS = ("photons", "bootstrap", "emcee, photons", "misfit", "emcee, misfit", "model", "jackknife")


def table(name: str, batches: int, photons: int, chain: int) -> list[tuple[str, ...]]:
    """Return a line per constant: its value and each of its errors."""
    chosen = recipe.find(name, catalogue.fits_folder())
    grid = Grid.from_edges(r=ring_edges(chosen.rings))
    runs = [simulate_orders(grid, photons, SEED + batch, chosen.setting, progress=False) for batch in range(batches)]
    profiles = Profiles.from_orders(whole(runs), albedo_values(chosen.albedos, chosen.setting))
    one = fitted(chosen, catalogue.find(name, catalogue.fits_folder()).law, profiles, jackknife=True)
    if one.statistical is None:
        raise RuntimeError("profiles of photons have a covariance")
    errors = {
        "photons": np.sqrt(np.diag(one.statistical)),
        "bootstrap": bootstrap(runs, one).standard_error,
        "misfit": np.sqrt(np.diag(one.misfit)),
        "model": np.sqrt(np.diag(discrepancy(one, profiles).covariance)),
        "jackknife": one.jackknife,
    }
    for kind, column in (("statistical", "emcee, photons"), ("misfit", "emcee, misfit")):
        errors[column] = posterior(one, kind, max_steps=chain).standard_deviation
    values = one.solution.parameters
    return [
        (free, f"{value:.5g}", *(f"{errors[column][i]:.2g}" for column in COLUMNS))
        for i, (free, value) in enumerate(zip(one.free, values, strict=True))
    ]


def whole(runs: Sequence[Orders]) -> Orders:
    """Return one run of all batches' photons; its seed is the first one's."""
    counts = sum((run.counts for run in runs[1:]), runs[0].counts)
    first = runs[0]
    return Orders(first.grid, sum(run.photons for run in runs), first.seed, first.setting, counts)


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", default=LAWS, help="records of laws")
    parser.add_argument("--batches", type=int, default=BATCHES)
    parser.add_argument("--photons", type=int, default=BATCH_PHOTONS, help="a batch")
    parser.add_argument("--chain", type=int, default=20_000, help="the longest that a chain may get [steps]")
    given = parser.parse_args(arguments)
    tables = {}
    with Progress(transient=True) as progress:
        task = progress.add_task("laws", total=len(given.names))
        for name in given.names:
            tables[name] = table(name, given.batches, given.photons, given.chain)
            progress.advance(task)
    for name, lines in tables.items():
        photons = given.batches * given.photons
        show(f"{name}: standard errors from {photons:.3g} photons", ("constant", "value", *COLUMNS), lines)
    print(__doc__.split("\n", 2)[2])


if __name__ == "__main__":
    main()

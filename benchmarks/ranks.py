"""How many directions the covariance of a ring needs: `python -m benchmarks.ranks`.

Albedos of one ring are reweightings of the same photons and nearly dependent. For each rank: the largest share of any
one ring's variance that it drops, and the errors of constants by the sandwich over those by the covariance of every
ring and scattering order, which knows no rank.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence

import numpy as np
from rich.progress import track

from benchmarks.interval_coverage import fitted
from benchmarks.table import show
from mcml_sim import Grid, Orders, simulate_orders
from profilefit.fitting.estimate import ResidualFunction, sensitivity
from profilefit.fitting.profiles import COVARIANCE_RANK, Covariance, Profiles
from profilefit.recipes import catalogue, recipe
from profilefit.recipes.targets import albedo_values, ring_edges

LAWS = ("albedo-rational", "burley-whole", "quantile")
SEED, PHOTONS, RANKS = 41, 4 * 2**20, (2, 4, 6, 8, 10, 12)


def whole_variance(light: Orders, alpha, gain):
    """Variances (p,) of constants that follow energies by `gain` (p, m, n + 1): each order of each ring is a cell."""
    weight = np.einsum("pai,ao->pio", gain, light.weights(alpha)[:, 1:])
    counts = light.counts.exits[:, 1:]
    mean = np.einsum("pio,io->p", weight, counts) / light.photons
    return (np.einsum("pio,io->p", weight**2, counts) / light.photons - mean**2) / (light.photons - 1)


def lines(name: str, photons: int) -> Iterator[tuple[str, ...]]:
    """A line a rank."""
    chosen = recipe.find(name, catalogue.fits_folder())
    light = simulate_orders(Grid.from_edges(r=ring_edges(chosen.rings)), photons, SEED, chosen.setting, progress=False)
    alpha = albedo_values(chosen.albedos, chosen.setting)
    profiles = Profiles.from_orders(light, alpha)
    one = fitted(chosen, catalogue.find(name, catalogue.fits_folder()).law, profiles)
    gain = sensitivity(ResidualFunction(one.objective, one.free), one.solution, one.law, one.rings)
    exact = np.sqrt(whole_variance(light, alpha, gain))
    if profiles.covariance is None:
        raise RuntimeError("profiles of photons have a covariance")
    for rank in RANKS:
        factor, dropped = light.covariance_factor(alpha, rank, overflow=True)
        closed = Covariance(factor, profiles.covariance.energy, light.photons, dropped).sandwich(gain)
        ratio = np.sqrt(np.maximum(np.diag(closed), 0.0)) / exact
        mark = " (used)" if rank == COVARIANCE_RANK else ""
        yield f"{rank}{mark}", f"{dropped:.1e}", f"{ratio.min():.4f}", f"{ratio.max():.4f}"


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", default=LAWS, help="records of laws")
    parser.add_argument("--photons", type=int, default=PHOTONS)
    given = parser.parse_args(arguments)
    found = {name: list(lines(name, given.photons)) for name in track(given.names, transient=True)}
    head = ("rank", "dropped of a ring's variance", "least error / exact", "largest error / exact")
    for name, made in found.items():
        show(f"{name}: rank of the covariance", head, made)


if __name__ == "__main__":
    main()

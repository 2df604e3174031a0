"""Exact light of half spaces that scatter forwards, against whole runs of photons; and what a finer solution changes.

    python -m benchmarks.half_spaces                 # a minute
    python -m benchmarks.half_spaces --finer         # four more harmonics at the nodes of g next to .5 and .9: an hour
    python -m benchmarks.half_spaces --photons 2e8   # trace half_space_reference.npz again; for a GPU

Photons by ring and order of scattering, at n = 1.4 and at g that are no nodes of the table. Printed by reduced albedo
alpha': chi-square over the rings from .05 to 15 l*, and over those nearer; the largest relative difference of rings
that the photons know to 1 %, and where; A. All albedos have the same photons, so their rows are not independent.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks import half_space_table, high_orders
from mcml_sim import Grid, Orders, Setting, exact, simulate_orders
from mcml_sim.exact import forwards
from mcml_sim.files.npz import read_npz
from mcml_sim.files.whole_file import read_whole, write_whole
from mcml_sim.tracing.order_bins import Counts

Floats = NDArray[np.float64]

REFERENCE = Path(__file__).with_name("half_space_reference.npz")
SETTINGS = (
    *(Setting(n=1.4, g=g) for g in (0.5, 0.8, 0.9, 0.95)),
    *(Setting("diffuse", 1.4, g) for g in (0.5, 0.9)),
)
SEED = 101
ALPHAS = (0.05, 0.2, 0.5, 0.8, 0.9, 0.97, 0.995, 0.999)  # reduced
NEAREST, MIDDLE, FARTHEST = 2e-3, 0.05, 15.0  # l*
WELL = 0.01  # relative standard error of a ring that is compared one by one
FEWEST = 0.2  # and of one that counts at all
NODES = np.polynomial.legendre.leggauss(5)


class Row(NamedTuple):
    """Errors at one albedo."""

    alpha: float
    middle: tuple[float, int]
    """Chi-square of the rings from MIDDLE to FARTHEST, and their number."""
    near: tuple[float, int]
    worst: tuple[float, float, float]
    """The largest relative difference, its standard error, and the ring's middle [l*]."""
    total: tuple[float, float]
    """Relative difference of A, and the same in standard errors."""


def reference(setting: Setting) -> Orders:
    """Return the photons of a half space."""
    arrays, name = read_npz(read_whole(REFERENCE, 1 << 26), 1 << 26), half_space_table.name_of(setting)
    exits, started = arrays[f"{name} exits"], int(arrays[f"{name} started"])
    if exits.shape[0] == arrays[f"{name} edges"].size - 1:
        raise ValueError(f"{REFERENCE} has no row beyond the last ring")
    return Orders(Grid.from_edges(r=arrays[f"{name} edges"]), started, SEED, setting, Counts(exits, 0, 0, started))


def rows(setting: Setting, found: Orders) -> list[Row]:
    """Yield the row of every albedo."""
    return [row(setting, found, alpha) for alpha in ALPHAS]


def row(setting: Setting, found: Orders, alpha: float) -> Row:
    """Return the row of one reduced albedo."""
    edges, mfp = found.grid.r_edges, float(found.mfp(alpha))
    width = np.diff(edges)[:, None]
    r = 0.5 * (edges[:-1, None] + edges[1:, None] + width * NODES[0])
    light = np.sum(2.0 * np.pi * r * exact.profile(r, alpha, mfp, setting) * 0.5 * width * NODES[1], axis=1)
    photons, whole = found.energy(alpha), found.reflectance(alpha)
    value, error = np.asarray(photons.value), np.asarray(photons.standard_error)
    x = np.sqrt(edges[1:] * np.maximum(edges[:-1], NEAREST / 10)) / mfp
    known = (error > 0) & (error < FEWEST * value)
    z = np.where(known, (light - value) / np.where(known, error, 1.0), 0.0)
    relative = np.where(error < WELL * value, np.abs(light / np.where(value > 0, value, 1.0) - 1.0), 0.0)
    middle, near = known & (x > MIDDLE) & (x < FARTHEST), known & (x > NEAREST) & (x <= MIDDLE)
    at = int(np.argmax(np.where(middle, relative, 0.0)))
    total = float(np.asarray(exact.reflectance(alpha, setting)))
    return Row(
        alpha,
        (float(np.sum(z[middle] ** 2)), int(middle.sum())),
        (float(np.sum(z[near] ** 2)), int(near.sum())),
        (float(relative[at]), float(error[at] / value[at]), float(x[at])),
        (total / float(whole.value) - 1.0, (total - float(whole.value)) / float(whole.standard_error)),
    )


def finer(n: float, g: float) -> float:
    """Return the largest relative change of light scattered more than once, .05 to 15 l*, with four more harmonics."""
    rule = high_orders.fine(g)
    settings = [Setting(name, n, g) for name in half_space_table.ILLUMINATIONS]
    low = [half_space_table.stored(one) for one in settings]
    coarse, fine = (
        half_space_table.joined(settings, low, one) for one in (rule, rule._replace(degree=rule.degree + 4))
    )
    inside = (forwards.KNOTS[3:-1] > np.log(MIDDLE)) & (forwards.KNOTS[3:-1] < np.log(FARTHEST))
    changes = [np.abs(one.rest - two.rest)[:, inside].max() for one, two in zip(coarse, fine, strict=True)]
    return float(max(changes))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--photons", type=float, help="trace so many of each half space again")
    parser.add_argument("--finer", action="store_true", help="solve with four more harmonics")
    given = parser.parse_args()
    if given.photons:
        arrays: dict[str, NDArray] = {}
        for setting in SETTINGS:
            last = 30.0 / (1.0 - setting.g)
            edges = np.concatenate([[0.0], np.geomspace(1e-3, last, 1 + round(np.log(last / 1e-3) / 0.115))])
            found = simulate_orders(Grid.from_edges(r=edges), int(given.photons), SEED, setting)
            name = half_space_table.name_of(setting)
            arrays |= {f"{name} exits": found.counts.exits, f"{name} started": np.int64(found.photons)}
            arrays[f"{name} edges"] = found.grid.r_edges
        write_whole(REFERENCE, half_space_table.content(arrays))
    for setting in SETTINGS:
        found = reference(setting)
        print(f"\n{setting}: {found.photons:.3g} photons")
        print("alpha'   chi-square of rings     nearer   worst ring (s.e., at x)      A (s.e.)")
        for one in rows(setting, found):
            (far, count), (close, inner), (worst, error, x), (total, z) = one[1:]
            print(
                f"{one.alpha:<6g} {far:9.1f} of {count:<3d} {close:9.1f} of {inner:<3d}"
                f" {worst:9.1e} ({error:.0e}, {x:5.2g}) {total:+9.1e} ({z:+.1f})"
            )
    if given.finer:
        for g in (forwards.COSINES[3], forwards.COSINES[4], forwards.COSINES[6]):
            print(f"n 1.39, g {g:.3f}: four more harmonics change light by {finer(1.39, float(g)):.1e}")


if __name__ == "__main__":
    main()

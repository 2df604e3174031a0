"""The table of half spaces that scatter forwards, which `mcml_sim.exact` reads: made anew.

    python -m benchmarks.half_space_table [--photons 2e9] [--out FILE]

Photons give the first orders of scattering on rings, as whole counts, which are kept beside this file and traced again
only where --photons says how many. The higher orders are solved: minutes on a GPU, an hour or two on two cores.
`half_space_reference.npz` has whole runs of 1e8 to 6e8 photons, by ring and bin of order, of half spaces that are no
nodes of the table (seed 101).
"""

from __future__ import annotations

import argparse
import io
from itertools import product
from pathlib import Path
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from mcml_sim import Setting, exact
from mcml_sim.exact import single_scattering
from mcml_sim.exact.anisotropic import high_orders, table
from mcml_sim.exact.anisotropic.table import COSINES, INDICES, KNOTS, S, SplinedLight
from mcml_sim.exact.light import coefficients, log_once
from mcml_sim.files.npz import read_npz
from mcml_sim.files.whole_file import read_whole, write_whole
from mcml_sim.media.setting import ILLUMINATIONS
from mcml_sim.tracing import half_space_event, orders_batch, rng
from mcml_sim.tracing.bins import rounded_up

Floats = NDArray[np.float64]

COUNTS = Path(__file__).with_name("half_space_counts.npz")
EDGES = np.append(0.0, np.geomspace(1e-3, 100.0, 193))  # of rings [mfp]
MIDDLES = np.sqrt(EDGES[1:-1] * EDGES[2:])
MOST_ORDERS, FIRST_SEED = 48, 1001
REACH = 9.0  # (kappa - b) x up to which what is solved keeps its digits
NOISY = 0.3  # relative error beyond which a ring says nothing
ROUNDING = 1e-5  # the least relative error
PENALTIES = 10.0 ** np.arange(-2.0, 9.0, 0.5)  # of third differences
FOUR = np.polynomial.legendre.leggauss(4)


class Low(NamedTuple):
    """Photons of a conservative half space that left after few scatterings."""

    exits: NDArray[np.int64]
    """By ring (the last: beyond) and order, (rings + 1, orders)."""
    started: int


def beyond(g: float) -> int:
    """How many orders are photons'. Light that turns slowly is narrow for longer."""
    return 24 if g < 0.92 else MOST_ORDERS


def traced(setting: Setting, photons: int, seed: int) -> Low:
    """At least so many photons, up to `beyond` scatterings."""
    orders = beyond(setting.g)
    columns = np.full(2 * MOST_ORDERS + 1, MOST_ORDERS, np.int32)
    columns[MOST_ORDERS + 1 :] = np.arange(MOST_ORDERS)
    stops, edges = jnp.asarray(np.array([orders], np.int32)), jnp.asarray(rounded_up(EDGES))
    where, batches = half_space_event.half_space(setting), -(-photons // orders_batch.BATCH_PHOTONS)
    exits = np.zeros((EDGES.size, MOST_ORDERS + 1), np.int64)
    for batch in range(batches):
        key = jnp.asarray(rng.batch_key(seed, batch))
        ends = orders_batch.trace(key, jnp.int32(orders_batch.BATCH_PHOTONS), stops, where)
        exits += np.asarray(orders_batch.histogram(ends, edges, jnp.asarray(columns), MOST_ORDERS + 1))
    return Low(exits[:, :orders], batches * orders_batch.BATCH_PHOTONS)


def solved(n: float, g: float, rule: high_orders.Fineness = high_orders.STANDARD) -> list[SplinedLight]:
    """Under either light, from stored photons."""
    settings = [Setting(name, n, g) for name in ILLUMINATIONS]
    return joined(settings, [stored(setting) for setting in settings], rule)


def joined(
    settings: list[Setting], low: list[Low], rule: high_orders.Fineness = high_orders.STANDARD
) -> list[SplinedLight]:
    """Of one n and g under both lights: the photons' orders and the rest."""
    n, g = settings[0].n, settings[0].g
    orders, reduced = beyond(g), 1.0 - S**2
    alpha = reduced / (reduced + (1.0 - g) * (1.0 - reduced))
    kappa = np.array([high_orders.decay_rate(one, g) for one in alpha])
    at_origin = high_orders.transforms(n, g, orders, np.array([1e-6 + 0j]), alpha, rule)[:, 0].real
    found, rest = [], np.full((2, S.size, KNOTS.size - 4), np.nan)
    scales = []
    for light, (setting, own) in enumerate(zip(settings, low, strict=True)):
        by_order = single_scattering.entered(setting) * own.exits.sum(axis=0) / own.started
        by_order[0] = single_scattering.reflected(setting)
        # What enters a white half space comes out again.
        white = at_white(at_origin[light] / alpha ** (orders + 1))
        scales.append((single_scattering.entered(setting) - by_order.sum()) / white)
        total = alpha[:, None] ** np.arange(1, orders + 1) @ by_order + scales[-1] * at_origin[light]
        found.append(total / reduced)
    for line, members in high_orders.lines(alpha, g):
        values = high_orders.transforms(n, g, orders, line.k, line.alpha, rule)
        x = np.append(MIDDLES, np.exp(np.arange(np.log(EDGES[-1]) + 0.03, np.log(table.LAST / (1.0 - g)), 0.06)))
        high = high_orders.ring_density(line, values, x) * np.array(scales)[:, None, None]
        for column, member in enumerate(members):
            for light, own in enumerate(low):
                kappas = kappa[member], line.k[0].imag
                entered = single_scattering.entered(settings[light])
                rest[light, member] = _rest(alpha[member], g, kappas, own, entered, x, high[light, :, column])
    return [SplinedLight(one, share, kappa / (1.0 - alpha * g)) for one, share in zip(rest, found, strict=True)]


def _rest(
    alpha: float, g: float, kappas: tuple[float, float], low: Low, entered: float, x: Floats, high: Floats
) -> Floats:
    """Splines of f at one albedo, from rings of photons and what is solved at x [mfp]."""
    kappa, start = kappas
    once_more = alpha ** np.arange(1, low.exits.shape[1] + 1)
    once_more[0] = 0.0
    nodes = 0.5 * (EDGES[1:-1] + EDGES[2:])[:, None] + 0.5 * np.diff(EDGES)[1:, None] * FOUR[0]
    within = np.sum(_decay(kappa * nodes) * 0.5 * np.diff(EDGES)[1:, None] * FOUR[1], axis=1)
    density = entered / low.started * _decay(kappa * MIDDLES) / within
    fill = np.zeros(x.size - MIDDLES.size)
    photons = np.append(low.exits[1:-1] @ once_more * density, fill)
    error = np.append(np.sqrt(low.exits[1:-1] @ once_more**2) * density, fill)
    rest, length, albedo = photons + high, 1.0 / (1.0 - alpha * g), alpha * (1.0 - g) / (1.0 - alpha * g)
    at = x / length
    known = (rest > 0.0) & (at > table.FIRST) & (at < table.LAST) & ((kappa - start) * x < REACH)
    known[known] = (error[known] / rest[known]) < NOISY
    f = np.log(rest[known] * length / albedo**2 / _decay(kappa * x[known]))
    return smoothed(np.log(at[known]), f, np.hypot(error[known] / rest[known], ROUNDING))


def _decay(x: Floats) -> Floats:
    return np.exp(-x) * (1.0 + x)


def isotropic(setting: Setting) -> SplinedLight:
    """Where g = 0, from the exact solution."""
    alpha, log = 1.0 - S**2, np.arange(np.log(table.FIRST), np.log(table.LAST), 0.06)
    kappa, rest = np.asarray(exact.decay_rate(alpha)), []
    for a, rate in zip(alpha, kappa, strict=True):
        x = np.exp(log[rate * np.exp(log) < (28.0 if rate > 0.06 else 12.0)])
        again = 2.0 * np.pi * x * exact.profile(x, a, setting=setting) - a * np.exp(log_once(x, setting))
        rest.append(smoothed(np.log(x), np.log(again / a**2 / _decay(rate * x)), np.full(x.size, ROUNDING)))
    return SplinedLight(np.array(rest), np.asarray(exact.reflectance(alpha, setting)) / alpha, kappa)


def smoothed(log: Floats, values: Floats, error: Floats) -> Floats:
    """B-splines on KNOTS: the smoothest whose misfit is no more than the errors."""
    basis = BSpline.design_matrix(log, KNOTS, 3).toarray() / error[:, None]
    bends = np.diff(np.eye(KNOTS.size - 4), 3, axis=0)
    allowed, found = values.size + np.sqrt(2.0 * values.size), None
    for penalty in PENALTIES:
        tried = np.linalg.solve(basis.T @ basis + penalty * bends.T @ bends, basis.T @ (values / error))
        if found is not None and np.sum((values / error - basis @ tried) ** 2) > allowed:
            break
        found = tried
    return np.asarray(found)


def at_white(values: Floats) -> float:
    """At s = 0, of the polynomial through values at the nodes S."""
    return float(np.polynomial.chebyshev.chebval(-1.0, coefficients(values)))


def stored(setting: Setting) -> Low:
    """Photons traced before."""
    arrays = read_npz(read_whole(COUNTS, 1 << 26), 1 << 26)
    name = _name(setting)
    return Low(arrays[f"{name} exits"].astype(np.int64), int(arrays[f"{name} started"]))


def _name(setting: Setting) -> str:
    return f"{setting.illumination} n {setting.n:g} g {setting.g:.4f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--photons", type=float, help="trace so many of each half space again")
    parser.add_argument("--out", type=Path, default=table.FILE, help="the table")
    given = parser.parse_args()
    if given.photons:
        found = {}
        for seed, (g, n, name) in enumerate(product(COSINES[:0:-1], INDICES, ILLUMINATIONS), FIRST_SEED):
            setting = Setting(name, float(n), float(g))
            low = traced(setting, int(given.photons), seed)
            found |= {f"{_name(setting)} exits": low.exits, f"{_name(setting)} started": np.int64(low.started)}
            print(f"{setting}: {low.started:.3g} photons", flush=True)
        write_whole(COUNTS, _bytes(found))
    whole = []
    for n in INDICES:
        zero = [isotropic(Setting(name, float(n))) for name in ILLUMINATIONS]
        rows = [zero]
        for g in COSINES[1:]:
            rows.append(solved(float(n), float(g)))
            print(f"n {n:g}, g {g:.4f} solved", flush=True)
        whole.append(rows)
    rest, share = (
        np.array([[[getattr(one, name) for one in row] for row in rows] for rows in whole])
        for name in SplinedLight._fields[:2]
    )
    kept = SplinedLight(
        np.moveaxis(rest, 2, 0).astype(np.float32).astype(float),
        np.moveaxis(share, 2, 0),
        np.array([row[0].kappa for row in whole[0]]),
    )
    write_whole(
        given.out,
        _bytes(
            {
                "rest": kept.rest.astype(np.float32),
                "share": kept.share,
                "kappa": kept.kappa,
                "sha256": table.digest(kept),
            }
        ),
    )


def _bytes(arrays: dict) -> bytes:
    file = io.BytesIO()
    np.savez_compressed(file, allow_pickle=False, **arrays)
    return file.getvalue()


if __name__ == "__main__":
    main()

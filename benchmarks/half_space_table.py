"""Table of half spaces that scatter forwards, which `mcml_sim.exact` reads: made anew.

    python -m benchmarks.half_space_table [--photons 2e9] [--out FILE]

Photons give the first orders of scattering on rings, as whole counts, which are kept beside this file and traced again
only where --photons says how many. The higher orders are solved: minutes on a GPU, an hour or two on two cores.
`half_spaces` holds the table against other photons.
"""

from __future__ import annotations

import argparse
import io
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from benchmarks import high_orders
from mcml_sim import Setting, exact
from mcml_sim.exact import forwards, single_scattering
from mcml_sim.exact.forwards import COSINES, INDICES, KNOTS, S, SplinedLight
from mcml_sim.exact.light import LEAST, coefficients, log_once, nodes, unreduced
from mcml_sim.files.npz import read_npz
from mcml_sim.files.whole_file import read_whole, write_whole
from mcml_sim.media.setting import ILLUMINATIONS
from mcml_sim.tracing import half_space_event, orders_batch, rng
from mcml_sim.tracing.deposits import rounded_up

Floats = NDArray[np.float64]

COUNTS = Path(__file__).with_name("half_space_counts.npz")
EDGES = np.append(0.0, np.geomspace(1e-3, 100.0, 193))  # of rings [mfp]
MIDDLES = np.sqrt(EDGES[1:-1] * EDGES[2:])
MOST_ORDERS, FIRST_SEED = 48, 1001
S_MOST = np.sqrt(1.0 - LEAST)
SOLVED = S_MOST * 0.5 * (1.0 + nodes(20))  # s at which high orders are solved
LOST = 1e-4, 2e-2  # share of the waves below which too few digits are left, at g up to SLOW and beyond
SLOW = 0.92
LAST_KNOWN = 10  # radii by which a row of logarithms is continued
CONTINUED = 0.03  # relative error beyond these
WELL = 0.1  # of a ring that the shape of light within rings is found from
NOISY = 0.3  # relative error beyond which a ring says nothing
ROUNDING = 1e-5  # the least relative error
PENALTIES = 10.0 ** np.arange(-2.0, 9.0, 0.5)  # of third differences
FOUR = np.polynomial.legendre.leggauss(4)
IN_RINGS = 0.5 * (EDGES[1:-1] + EDGES[2:])[:, None] + 0.5 * np.diff(EDGES)[1:, None] * FOUR[0]
RING_WEIGHTS = 0.5 * np.diff(EDGES)[1:, None] * FOUR[1]


class Low(NamedTuple):
    """Photons of a conservative half space that left after few scatterings."""

    exits: NDArray[np.int64]
    """Photons by ring (the last: beyond) and order, (rings + 1, orders)."""
    started: int


def beyond(g: float) -> int:
    """Return how many orders are photons'. Light that turns slowly is narrow for longer."""
    return 24 if g < SLOW else MOST_ORDERS


def traced(setting: Setting, photons: int, seed: int) -> Low:
    """Trace at least so many photons, up to `beyond` scatterings."""
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


def solved(n: float, g: float) -> list[SplinedLight]:
    """Solve under either light, from stored photons."""
    settings = [Setting(name, n, g) for name in ILLUMINATIONS]
    return joined(settings, [stored(setting) for setting in settings])


def joined(settings: list[Setting], low: list[Low], rule: high_orders.Fineness | None = None) -> list[SplinedLight]:
    """Join one n and g under both lights: the photons' orders, which are known at any albedo, and the rest."""
    n, g = settings[0].n, settings[0].g
    orders, rule = beyond(g), rule or high_orders.fine(g)
    alpha, kappa = unreduced(1.0 - S**2, g), forwards.decay_rates(1.0 - S**2, g)
    solved_at = unreduced(1.0 - SOLVED**2, g)
    whole = high_orders.totals(n, g, orders, solved_at, rule) / solved_at ** (orders + 1)
    at_origin = np.exp(np.log(whole) @ _locally()[0].T)  # over alpha^(orders + 1)
    found, scales = [], []
    for light, (setting, own) in enumerate(zip(settings, low, strict=True)):
        by_order = single_scattering.entered(setting) * own.exits.sum(axis=0) / own.started
        by_order[0] = single_scattering.reflected(setting)
        # What enters a white half space comes out again.
        white = at_white(at_origin[light])
        scales.append((single_scattering.entered(setting) - by_order.sum()) / white)
        total = alpha[:, None] ** np.arange(1, orders + 1) @ by_order
        total += scales[-1] * alpha ** (orders + 1) * at_origin[light]
        found.append(total / (1.0 - S**2))
    x = np.append(MIDDLES, np.exp(np.arange(np.log(EDGES[-1]) + 0.03, np.log(forwards.LAST / (1.0 - g)), 0.06)))
    high, doubt = _high(n, g, orders, x, rule)
    high *= np.array(scales)[:, None, None]
    rest = [
        [
            _rest(a, g, k, own, single_scattering.entered(setting), x, a ** (orders + 1) * one, doubt[light, at])
            for at, (a, k, one) in enumerate(zip(alpha, kappa * (1.0 - alpha * g), high[light], strict=True))
        ]
        for light, (setting, own) in enumerate(zip(settings, low, strict=True))
    ]
    return [SplinedLight(np.array(one), share) for one, share in zip(rest, found, strict=True)]


def _high(n: float, g: float, orders: int, x: Floats, rule: high_orders.Fineness) -> tuple[Floats, Floats]:
    """Solve both lights, at S, over alpha^(orders + 1), at fewer albedos; and their relative error.

    Where digits are lost it goes on as light far away does, x^-2 once its decay is taken out, which its slope
    approaches as 1 / x.
    """
    reduced = 1.0 - SOLVED**2
    alpha = unreduced(reduced, g)
    kappa = forwards.decay_rates(reduced, g) * (1.0 - alpha * g)
    logs = np.full((2, SOLVED.size, x.size), np.nan)
    for line, members in high_orders.lines(alpha, g):
        values = high_orders.transforms(n, g, orders, line.k, line.alpha, rule)
        density, share = (np.moveaxis(part, 2, 1) for part in high_orders.ring_density(line, values, x))
        past = np.arange(x.size) > np.argmax(share, axis=-1)[..., None]
        lost = past & (share < LOST[g > SLOW])
        usable = np.logical_and.accumulate(~lost & (density > 0), axis=-1)
        own = np.log(np.where(usable, density, 1.0)) - (orders + 1) * np.log(alpha[members, None])
        logs[:, members] = np.where(usable, own - np.log(_decay(kappa[members, None] * x)), np.nan)
    unknown = np.isnan(logs)
    for row in logs.reshape(-1, x.size):
        _continued(row, x, np.flatnonzero(~np.isnan(row))[-LAST_KNOWN:])
    way, next_ones = _locally()
    between = way @ logs
    doubt = np.where((next_ones @ unknown) > 0, CONTINUED, ROUNDING)
    fine = forwards.decay_rates(1.0 - S**2, g) * (1.0 - unreduced(1.0 - S**2, g) * g)
    return np.asarray(np.exp(between) * _decay(fine[:, None] * x)), doubt


def _continued(row: Floats, x: Floats, known: NDArray[np.intp]) -> None:
    """Fill in a row of logarithms of what goes as x^-2 in the end from its last known places on."""
    last = x[known[-1]]
    slope, _ = np.polyfit(np.log(x[known]), row[known], 1)
    beyond = x[known[-1] + 1 :]
    row[known[-1] + 1 :] = row[known[-1]] - 2.0 * np.log(beyond / last) + (slope + 2.0) * (1.0 - last / beyond)


def _locally() -> tuple[Floats, Floats]:
    """Interpolate values at SOLVED to S, (64, 20): polynomials through the eight next ones, in Chebyshev's angle.

    And how many of the four next ones each is. One polynomial through all of them would carry what happens next to
    black over all albedos.
    """
    angle, step = np.arccos(2.0 * S / S_MOST - 1.0), np.pi / SOLVED.size
    found, four = np.zeros((2, S.size, SOLVED.size))
    for row, next_ones, at in zip(found, four, angle / step - 0.5, strict=True):
        nearest = int(np.floor(at)) + np.arange(-3, 5)
        for one in nearest:
            others = nearest[nearest != one]
            weight = np.prod((at - others) / (one - others))
            place = min(one % (2 * SOLVED.size), -(one + 1) % (2 * SOLVED.size))  # even about either end
            row[place] += weight
            next_ones[place] += one in nearest[2:6]
    return found, four


def _rest(
    alpha: float, g: float, kappa: float, low: Low, entered: float, x: Floats, high: Floats, doubt: Floats
) -> Floats:
    """Return splines of f at one albedo, from rings of photons and what is solved at x [mfp]."""
    once_more = alpha ** np.arange(1, low.exits.shape[1] + 1)
    once_more[0] = 0.0
    length = 1.0 / (1.0 - alpha * g)
    albedo, at = alpha * (1.0 - g) * length, x / length
    inside = (at > forwards.FIRST) & (at < forwards.LAST)
    share = entered / low.started * (low.exits[1:-1] @ once_more)
    # One photon more of the last order: a far ring that none has reached yet is not known to be dark.
    spread = entered / low.started * np.sqrt(low.exits[1:-1] @ once_more**2 + once_more[-1] ** 2)
    shape = _flat
    for _ in range(2):  # a ring's mean becomes the value at its middle by the shape that the first round finds
        within = np.sum(_decay(kappa * IN_RINGS) * np.exp(shape(np.log(IN_RINGS / length))) * RING_WEIGHTS, axis=1)
        density = _decay(kappa * MIDDLES) * np.exp(shape(np.log(MIDDLES / length))) / within
        photons, error = share * density, spread * density
        seen = inside[: MIDDLES.size] & (error < WELL * photons)
        own, logs = photons[seen], np.log(at[: MIDDLES.size][seen])
        shape = _held(smoothed(logs, np.log(own / _decay(kappa * MIDDLES[seen])), error[seen] / own), logs)
    fill = np.zeros(x.size - MIDDLES.size)
    rest, error = np.append(photons, fill) + high, np.append(error, fill)
    error = np.hypot(error, doubt * high)
    known = inside & (rest > 0.0)
    known[known] = (error[known] / rest[known]) < NOISY
    f = np.log(rest[known] * length / albedo**2 / _decay(kappa * x[known]))
    return smoothed(np.log(at[known]), f, np.hypot(error[known] / rest[known], ROUNDING))


def _held(spline: Floats, logs: Floats) -> Callable[[Floats], Floats]:
    """Return a spline on KNOTS, straight on from its data's ends by the slope of the last half."""
    curve, first, last = BSpline(KNOTS, spline, 3), logs[0], logs[-1]
    slope = (curve(last) - curve(last - 0.5)) / 0.5

    def at(log: Floats) -> Floats:
        return np.asarray(curve(np.clip(log, first, last)) + slope * np.maximum(log - last, 0.0))

    return at


def _flat(log: Floats) -> Floats:
    return np.zeros_like(log)


def _decay(x: Floats) -> Floats:
    return np.exp(-x) * (1.0 + x)


def isotropic(setting: Setting) -> SplinedLight:
    """Return the splines where g = 0, from the exact solution."""
    alpha, log = 1.0 - S**2, np.arange(np.log(forwards.FIRST), np.log(forwards.LAST), 0.06)
    kappa, rest = np.asarray(exact.decay_rate(alpha)), []
    for a, rate in zip(alpha, kappa, strict=True):
        x = np.exp(log[rate * np.exp(log) < (28.0 if rate > 0.06 else 12.0)])
        again = 2.0 * np.pi * x * exact.profile(x, a, setting=setting) - a * np.exp(log_once(x, setting))
        rest.append(smoothed(np.log(x), np.log(again / a**2 / _decay(rate * x)), np.full(x.size, ROUNDING)))
    return SplinedLight(np.array(rest), np.asarray(exact.reflectance(alpha, setting)) / alpha)


def smoothed(log: Floats, values: Floats, error: Floats) -> Floats:
    """Return B-splines on KNOTS: the smoothest whose misfit is no more than the errors."""
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
    """Return the value at s = 0, of the polynomial through values at the nodes S."""
    return float(np.polynomial.chebyshev.chebval(-1.0, coefficients(values)))


def stored(setting: Setting) -> Low:
    """Return photons traced before."""
    arrays = read_npz(read_whole(COUNTS, 1 << 26), 1 << 26)
    name = name_of(setting)
    return Low(arrays[f"{name} exits"].astype(np.int64), int(arrays[f"{name} started"]))


def name_of(setting: Setting) -> str:
    """Return the name of arrays."""
    return f"{setting.illumination} n {setting.n:g} g {setting.g:.4f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--photons", type=float, help="trace so many of each half space again")
    parser.add_argument("--out", type=Path, default=forwards.FILE, help="the table")
    given = parser.parse_args()
    if given.photons:
        found = {}
        for seed, (g, n, name) in enumerate(product(COSINES[:0:-1], INDICES, ILLUMINATIONS), FIRST_SEED):
            setting = Setting(name, float(n), float(g))
            low = traced(setting, int(given.photons), seed)
            found |= {f"{name_of(setting)} exits": low.exits, f"{name_of(setting)} started": np.int64(low.started)}
            print(f"{setting}: {low.started:.3g} photons", flush=True)
        write_whole(COUNTS, content(found))
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
        for name in SplinedLight._fields
    )
    kept = SplinedLight(np.moveaxis(rest, 2, 0).astype(np.float32).astype(float), np.moveaxis(share, 2, 0))
    arrays = {"rest": kept.rest.astype(np.float32), "share": kept.share, "sha256": forwards.digest(kept)}
    write_whole(given.out, content(arrays))


def content(arrays: dict) -> bytes:
    """Return the content of a file that holds arrays."""
    file = io.BytesIO()
    np.savez_compressed(file, allow_pickle=False, **arrays)
    return file.getvalue()


if __name__ == "__main__":
    main()

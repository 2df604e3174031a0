"""Sums of Gaussians over a surface, at many points, in N log N.

At a point P each Gaussian of standard deviation sigma has the sum over elements i of the surface

    sum_i area_i (1, E_i) exp(-|P_i - P|^2 / 2 sigma^2) / (2 pi sigma^2)

A wide Gaussian takes elements merged in cubes whose side is a part of sigma, a narrow one Gauss points on each element,
and one far narrower than the elements leaves the light where it came in. Beyond `REACH` sigma nothing counts.

Any profile is a sum of such Gaussians (`gaussian_weights`), with widths that all albedos and channels share.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.spatial import cKDTree

from mcml_sim.media.arrays import Floats
from profilefit.recipes.stack.gaussians import ring_shares
from profilefit.scenes.stage.world import Singles

REACH = 4.3  # sigma: a ten-thousandth of a plane's light lies beyond
MERGED = 0.3  # side of the cubes in which elements are merged [sigma]
# Gauss points on a side of an element, for Gaussians up to so many of the elements' sides wide; wider ones take the
# middle, and narrower ones than `LOCAL` are local (than `POINT`, where elements have no sides).
LOCAL, POINT = 0.2, 0.6
RULE = ((0.35, 6), (0.6, 4), (1.5, 2))
# The same where elements are few: pixels are wide then, and narrow Gaussians have more of the light.
FEW, FINE_RULE, FINE_MERGED = 2**16, ((0.35, 8), (0.8, 6), (5.0, 2)), 0.1
LONGEST = 1.5  # side of an element, in the typical one: longer ones are cut
# Points that gather together, at least, and where elements are merged; most elements of a row; pairs of a call.
TOGETHER, MANY, LISTED, AT_ONCE = 16, 64, 256, 2**22
# Range of the light near some points, over its mean, below which a narrow Gaussian is local; but not near an outline,
# where a Gaussian of a width [spacing] has some of its light beside the surface.
SMOOTH, COMPLETE, SLACK = 0.02, 1.5, 2e-3
BLOCK, APART = 2**17, 64.0  # points whose elements are listed at once; width of a group, at most [sigma]
RINGS, FLOOR = 360, 1e-5  # of a profile that Gaussians are fitted to; least share that counts, of the largest


class Elements(NamedTuple):
    """Surface in parallelograms, or in triangles.

    Attributes:
        points: (n, 3) of their middles [length].
        areas: (n,) [length^2].
        irradiance: (n, c) [any unit].
        spacing: their typical side [length].
        sides: (2, n, 3), two sides of each [length]; None where they are not known.
        spread: (n,) variance of each along the surface [length^2]; 0 where it is a point.
        moment: (n, c, 3) first moment of area times irradiance about the middle, where elements were merged.
    """

    points: Floats
    areas: Floats
    irradiance: Floats
    spacing: float
    sides: Floats | None = None
    spread: Floats | float = 0.0
    moment: Floats | None = None
    are_triangles: bool = False

    @classmethod
    def of_triangles(cls, points: Floats, sides: Floats, irradiance: Floats) -> Elements:
        """Return triangles by their centroids and two sides that begin at one corner."""
        (a, b), areas = sides, 0.5 * np.linalg.norm(np.cross(*sides), axis=1)
        spread = (np.sum(a * a, axis=1) + np.sum(b * b, axis=1) - np.sum(a * b, axis=1)) / 36.0
        spacing = float(np.sqrt(np.average(areas, weights=areas)))  # few large ones are most of the surface
        return cls(points, areas, irradiance, spacing, sides, spread, None, True)

    @classmethod
    def of_sides(cls, points: Floats, sides: Floats, irradiance: Floats) -> Elements:
        """Return parallelograms; those with a long side are cut."""
        areas = np.linalg.norm(np.cross(*sides), axis=1)
        spacing = float(np.sqrt(np.median(areas)))
        counts = np.maximum(np.ceil(np.linalg.norm(sides, axis=2) / (LONGEST * spacing)), 1.0).astype(int)
        parts = counts.prod(axis=0)
        of = np.repeat(np.arange(len(points)), parts)
        number = np.arange(of.size) - np.repeat(np.cumsum(parts) - parts, parts)
        place = np.stack([number % counts[0, of], number // counts[0, of]])
        share = (place + 0.5) / counts[:, of] - 0.5
        cut = sides[:, of] / counts[:, of, None]
        moved = points[of] + np.sum(share[..., None] * sides[:, of], axis=0)
        each = (areas / parts)[of]
        return cls(moved, each, irradiance[of], spacing, cut, each / 12.0)

    def within(self, side: float) -> Elements:
        """Return the surface with elements in each cube of a side as one: area, light and the first moments stay."""
        if side <= self.spacing:
            return self
        cells = np.floor((self.points - self.points.min(axis=0)) / side).astype(np.int64)
        _, of = np.unique(cells @ (1, 2**21, 2**42), return_inverse=True)
        area = np.bincount(of, self.areas).astype(float)
        power = self.areas[:, None] * self.irradiance
        middle, light = (
            np.stack([np.bincount(of, column) for column in value.T], axis=1) / area[:, None]
            for value in (self.areas[:, None] * self.points, power)
        )
        away = self.points - middle[of]
        spread = np.bincount(of, self.areas * (self.spread + np.sum(away**2, axis=1) / 2.0)) / area
        moments = [[np.bincount(of, colour * axis) for axis in away.T] for colour in power.T]
        return Elements(middle, area, light, side, None, spread, np.moveaxis(np.array(moments), -1, 0))


def gaussian_sums(
    elements: Elements, at: Floats, own: Floats, sigmas: Floats, merged: float = MERGED
) -> Iterator[Floats]:
    """Yield the sums (m, 1 + c) of each Gaussian: of 1, and of the irradiance.

    Args:
        elements: of the surface.
        at: (m, 3) points that gather [length].
        own: (m, c) irradiance there, which local Gaussians leave there.
        sigmas: standard deviations [length].
        merged: side of the cubes in which elements are merged [sigma]; `FINE_MERGED` at most where they are few. On a
            sphere of radius R, merged elements lie inside, so that the sums are too large by (merged sigma / R)^2 / 12.
    """
    local = LOCAL if elements.sides is not None else POINT
    centre = elements.points.mean(axis=0)
    middle = 0.5 * (elements.irradiance.min(axis=0) + elements.irradiance.max(axis=0))
    near, places = elements._replace(points=elements.points - centre), at - centre
    groups = _groups(places)
    # Where a Gaussian of this width has all of its light on the surface, narrower ones have, too.
    complete = np.zeros((len(at), 1 + middle.size))
    if elements.sides is not None:
        _add_sums(complete, near, middle, places, groups, COMPLETE * elements.spacing, merged, None)
    is_whole = np.abs(complete[:, 0] - 1.0) < SLACK
    for sigma in sigmas:
        found = np.concatenate([np.ones((len(at), 1)), own - middle], axis=1)
        if sigma > local * elements.spacing:
            _add_sums(found, near, middle, places, groups, float(sigma), merged, is_whole)
        found[:, 1:] += middle * found[:, :1]
        yield found


def gaussian_weights(edges: Floats, shares: Floats, variances: Floats) -> Floats:
    """Return weights (N,) >= 0 of Gaussians that hold a profile's shares of energy in rings.

    Args:
        edges: (n + 1,) of the rings, from 0 to infinity [length].
        shares: (n,) of the energy [-].
        variances: (N,) of the Gaussians [length^2].
    """
    scale = 1.0 / (shares + FLOOR * shares.max())
    weights, _ = nnls(ring_shares(edges, variances) * scale[:, None], shares * scale, maxiter=100 * variances.size)
    return np.asarray(weights)


def _groups(points: Floats) -> NDArray[np.intp]:
    """Return (2^d, n) numbers of points, neighbours in a row and in rows next to each other; some stand twice."""
    depth = max(int(np.ceil(np.log2(len(points) / TOGETHER))), 0)
    groups = np.resize(np.arange(len(points)), (1, 2**depth * -(-len(points) // 2**depth)))
    for _ in range(depth):
        places = points[groups]
        widest = np.argmax(np.ptp(places, axis=1), axis=1)
        key = np.take_along_axis(places, widest[:, None, None], axis=2)[..., 0]
        half = groups.shape[1] // 2
        groups = np.take_along_axis(groups, np.argpartition(key, half, axis=1), axis=1).reshape(-1, half)
    return np.concatenate([groups, np.repeat(groups[:, -1:], TOGETHER - groups.shape[1], axis=1)], axis=1)


def _add_sums(
    sums: Floats,
    elements: Elements,
    middle: Floats,
    at: Floats,
    groups: NDArray[np.intp],
    sigma: float,
    merged: float,
    is_whole: NDArray[np.bool_] | None,
) -> None:
    """Write the sums of one Gaussian (m, 1 + c), of 1 and of irradiance - middle, where they are not local.

    is_whole  (m,) points at which it is local if the light around them is even; None where it is nowhere
    """
    rule, most_merged = (FINE_RULE, FINE_MERGED) if len(elements.points) < FEW else (RULE, merged)
    count = next((points for most, points in rule if sigma < most * elements.spacing), 1)
    count = 1 if elements.sides is None else count
    parts = elements if count > 1 else elements.within(min(merged, most_merged) * sigma)
    # As many groups as one as are no wider than the Gaussian.
    extent = float(np.median(np.linalg.norm(np.ptp(at[groups], axis=1), axis=1)))
    joined = int(np.clip(2.0 * np.log2(max(2.0 * sigma / max(extent, 1e-30), 1.0)), 0, 7))
    joined = max(joined, 0 if parts.moment is None else int(np.log2(MANY // TOGETHER)))
    wide = groups.reshape(-1, groups.shape[1] * 2 ** min(joined, int(np.log2(len(groups)))))
    # A group of points on both sides of a gap would lose the digits of small differences: each is one by itself.
    split = np.linalg.norm(np.ptp(at[wide], axis=1), axis=1) > APART * sigma
    if split.any():
        single = np.repeat(np.unique(wide[split])[:, None], wide.shape[1], axis=1)
        wide = np.concatenate([wide[~split], single])
    # Elements that are taken at their middle lack the variance that they have along the surface.
    variance = np.broadcast_to(sigma**2 + (parts.spread if count == 1 else 0.0), parts.areas.shape)
    scale = 1.0 / (2.0 * np.pi * variance)
    share = (parts.areas * scale)[:, None]
    # Differences from the middle, so that even light stays even whatever rounding does to the sums.
    power = np.concatenate([0.5 / variance[:, None], share, share * (parts.irradiance - middle)], axis=1)
    more: list[Floats] = []
    if count > 1 and parts.sides is not None:
        more = [*parts.sides]
    elif parts.moment is not None:
        more = [(parts.moment * (scale / variance)[:, None, None]).reshape(len(share), -1)]
    values = parts.points, power, *more
    surface = tuple(jnp.asarray(np.pad(value, ((0, 1), (0, 0))), jnp.float32) for value in values)
    tree = cKDTree(parts.points)
    for first in range(0, len(wide), max(BLOCK // wide.shape[1], 1)):
        block = wide[first : first + max(BLOCK // wide.shape[1], 1)]
        low, high = at[block].min(axis=1), at[block].max(axis=1)
        radius = 0.5 * np.linalg.norm(high - low, axis=1) + REACH * sigma + (parts.spacing if count > 1 else 0.0)
        near = tree.query_ball_point(0.5 * (low + high), radius, workers=-1)
        if count > 2 and is_whole is not None:
            block, near = _uneven(elements.irradiance, is_whole, block, near)
        if len(block):
            sums[block.ravel()] = _block_sums(surface, at[block], near, count, parts).reshape(-1, sums.shape[1])


def _block_sums(
    surface: tuple[Array, ...], places: Floats, near: NDArray[np.object_], count: int, elements: Elements
) -> Floats:
    """Return the sums (groups, points, 1 + c) of lists of elements at the points of each group (groups, points, 3)."""
    rows, listed = _rows(near, len(elements.points))
    found = np.empty((len(rows), places.shape[1], 1 + elements.irradiance.shape[1]), np.float32)
    step = max(AT_ONCE // (listed.shape[1] * places.shape[1]), 1)

    def some(first: int) -> None:
        of = slice(first, first + step)
        given, here = listed[of], places[rows[of]].astype(np.float32)
        spare = ((0, step - len(given)), (0, 0))
        full = np.pad(given, spare, constant_values=len(elements.points))
        lit = _pairs(surface, np.pad(here, (*spare, (0, 0))), full, count, elements.are_triangles)
        found[of] = np.asarray(lit)[: len(given)]

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(some, range(0, len(rows), step)))
    return np.asarray(np.add.reduceat(found, np.searchsorted(rows, np.arange(len(places))), axis=0))


def _uneven(
    light: Floats, is_whole: NDArray[np.bool_], groups: NDArray[np.intp], near: NDArray[np.object_]
) -> tuple[NDArray[np.intp], Any]:
    """Return groups, and their lists of elements, whose light is not the same all over, or which see an outline."""
    lengths = np.array([len(one) for one in near])
    listed = light[np.concatenate([np.asarray(one, np.int64) for one in near])]
    starts = np.cumsum(lengths) - lengths
    spread = np.maximum.reduceat(listed, starts) - np.minimum.reduceat(listed, starts)
    some = np.any(spread > SMOOTH * light.mean(axis=0), axis=1) | ~np.all(is_whole[groups], axis=1)
    return groups[some], near[some]


def _rows(near: NDArray[np.object_], nothing: int) -> tuple[NDArray[np.intp], NDArray[np.int32]]:
    """Return lists as rows of a length, filled with `nothing`: the list of each row (n,), and the rows (n, length)."""
    lengths = np.array([len(one) for one in near])
    length = int(min(2.0 ** np.ceil(np.log2(max(lengths.mean(), 32.0))), LISTED))
    counts = np.maximum(-(-lengths // length), 1)
    rows = np.full((counts.sum(), length), nothing, np.int32)
    starts = length * (np.cumsum(counts) - counts)
    place = np.arange(lengths.sum()) + np.repeat(starts - np.cumsum(lengths) + lengths, lengths)
    rows.ravel()[place] = np.concatenate([np.asarray(one, np.int32) for one in near])
    return np.repeat(np.arange(len(near)), counts), rows


@partial(jax.jit, static_argnames=("count", "are_triangles"))
def _pairs(
    surface: tuple[Array, ...], at: Singles, listed: NDArray[np.int32], count: int, are_triangles: bool = False
) -> Array:
    """Return sums (rows, points, 1 + c) of each row's elements at its points.

    Args:
        surface: middle (n, 3) of elements, 1 / 2 variance, power of 1 and of light less its middle (n, 1 + 1 + c), the
            last of no power. Then, where elements were merged, first moments of their light (n, 3 c); or their two
            sides (n, 3) where each has count x count Gauss points.
        at: points (rows, points, 3).
        listed: elements (rows, length).
        count: of Gauss points along a side.
        are_triangles: whether the sides are two of a triangle's.
    """
    rule = list(zip(*np.polynomial.legendre.leggauss(count), strict=True))
    grid = [(0.5 * a, 0.5 * b, 0.25 * u * v) for a, u in rule for b, v in rule]
    if are_triangles:  # the square is folded onto the triangle; both are about their middle
        corner = [(0.5 + a, (0.5 - a) * (0.5 + b), 2.0 * (0.5 - a) * share) for a, b, share in grid]
        grid = [(a - 1.0 / 3.0, b - 1.0 / 3.0, share) for a, b, share in corner]

    def row(given: tuple[Array, Array]) -> Array:
        places, of = given
        middle, power, *more = (value[of] for value in surface)
        rate, power = power[:, 0], power[:, 1:]
        # About one of the points, so that small differences keep their digits.
        here, middle = places - places[0], middle - places[0]
        from_here = jnp.sum(here**2, axis=1)[:, None]

        def light(place: Array) -> Array:
            square = 2.0 * here @ place.T - from_here - jnp.sum(place**2, axis=1)
            return jnp.exp(rate * jnp.minimum(square, 0.0))

        if count > 1:
            side, other = more
            return sum(share * light(middle + a * side + b * other) for a, b, share in grid) @ power
        whole = light(middle)
        if not more:
            return whole @ power
        moment = more[0].reshape(len(rate), -1, 3)
        first = whole @ more[0]
        tilted = jnp.sum(first.reshape(len(here), -1, 3) * here[:, None], axis=-1)
        tilted -= whole @ jnp.sum(moment * middle[:, None], axis=-1)
        return whole @ power + jnp.pad(tilted, ((0, 0), (1, 0)))

    return jax.lax.map(row, (at, listed))

"""Rays against fur: against cones, exactly; against their discs on shells; and against cones inside slabs.

Strands stand on a patch that repeats. A ray comes from an eye toward +x at an angle theta to the normal, and goes down
toward -x; what it finds is the height of its first hit, 0 where it meets the skin. Lengths are in one unit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mcml_sim.media.arrays import Floats, checked_whole, is_number, require
from profilefit.scenes.fur.law import MOST_LAYERS

MOST_STRANDS = 1 << 20


@dataclass(frozen=True, eq=False)
class Patch:
    """Equal cones, upright or leaning, feet (k, 2) within a square of this side, which repeats.

    radius, length  of a strand;  lean  of the tips along x and y, by the length [-]
    """

    feet: Floats
    side: float
    radius: float
    length: float
    lean: tuple[float, float] = (0.0, 0.0)

    @property
    def density(self) -> float:
        """Number of strands per unit of area."""
        return len(self.feet) / self.side**2


def random_patch(
    density: float, radius: float, length: float, side: float, seed: int = 0, lean: tuple[float, float] = (0.0, 0.0)
) -> Patch:
    """Return feet that are independent of each other; as many as the density says on average, 1 at least."""
    count, rng = strand_count(density, side), np.random.default_rng([seed, 0])
    return Patch(rng.random((count, 2)) * side, side, radius, length, lean)


def strand_count(density: float, side: float) -> int:
    """Return the number of strands on a square, 1 at least: density [1/area] times side [length] squared."""
    holds = is_number(density) and 0 < density < np.inf and 0 < density * side * side <= MOST_STRANDS
    require(holds, "density", f"a number > 0 of {MOST_STRANDS} strands at most", density)
    return max(round(density * side * side), 1)


def rays(patch: Patch, count: int, seed: int = 0) -> Floats:
    """Return where rays (count, 2) come through the level of the tips, all over the patch."""
    return np.random.default_rng([seed, 1]).random((checked_whole("count", count, 1), 2)) * patch.side


def cast(patch: Patch, theta: float, start: Floats) -> Floats:
    """Return heights of first hits (n,) of rays that start (n, 2) at the level of the tips, against cones."""
    return struck(patch, theta, start)[0]


def struck(patch: Patch, theta: float, start: Floats) -> tuple[Floats, NDArray[np.intp]]:
    """Return `cast`, and the strand that is met (n,), -1 where none is.

    A cone that is met is within its radius and half a step of one of the places along a ray that are tried, half the
    strands' mean distance apart, or a root; what is met above the lower end of a step needs no further one.
    """
    rate, tree = float(np.hypot(*_rate(patch, theta))), _tree(patch)
    steps = int(np.ceil(rate * patch.length / max(patch.radius, 0.5 * patch.density**-0.5))) + 1
    found, which = np.zeros(len(start)), np.full(len(start), -1)
    left = np.arange(len(start))
    for number in range(steps):
        z, half = patch.length * (1.0 - (number + 0.5) / steps), 0.5 * patch.length / steps
        place = _at(patch, theta, start[left], z)
        widest = patch.radius * (1.0 - (z - half) / patch.length) + half * rate
        tried = cKDTree(place, boxsize=patch.side)
        near = tried.sparse_distance_matrix(tree, 1.0001 * widest, output_type="ndarray")
        ray, strand = near["i"], near["j"]
        heights = _heights(patch, place[ray], strand, z, theta)
        order = np.argsort(heights)  # of those of one ray, the last to be written is the highest
        highest, own = np.zeros(len(left)), np.full(len(left), -1)
        highest[ray[order]], own[ray[order]] = heights[order], strand[order]
        better = highest > found[left]
        found[left[better]], which[left[better]] = highest[better], own[better]
        left = left[found[left] < z - half]
    return found, which


def by_shells(patch: Patch, theta: float, start: Floats, layers: int, exponent: float) -> Floats:
    """Return those heights against discs on N shells of radius r0 (1 - t^p)."""
    count, tree = checked_whole("layers", layers, 1, MOST_LAYERS), _tree(patch)

    def heights(t: float, place: Floats) -> Floats:
        radius = patch.radius * (1.0 - t**exponent)
        return np.where(tree.query(place, distance_upper_bound=radius)[0] < radius, t * patch.length, 0.0)

    return _from_above(patch, theta, start, [layer / count for layer in range(count)], heights)


def by_slabs(patch: Patch, theta: float, start: Floats, layers: int, tested: int = 1) -> Floats:
    """Return those heights against the cone nearest to the middle of a ray in each of N slabs, from the top.

    tested  strands, the nearest ones;  a cone counts wherever the ray comes into it, within the slab or not
    """
    count, near = checked_whole("layers", layers, 1, MOST_LAYERS), checked_whole("tested", tested, 1, len(patch.feet))
    tree = _tree(patch)

    def heights(t: float, place: Floats) -> Floats:
        nearest = tree.query(place, near)[1].ravel()
        z = _heights(patch, np.repeat(place, near, axis=0), nearest, t * patch.length, theta)
        return z.reshape(len(place), near).max(axis=1)

    return _from_above(patch, theta, start, [(layer + 0.5) / count for layer in range(count)], heights)


def _from_above(
    patch: Patch, theta: float, start: Floats, levels: list[float], heights: Callable[[float, Floats], Floats]
) -> Floats:
    """Return heights (n,) that rays first find, from the last level over the length down; 0 of none goes on."""
    found, left = np.zeros(len(start)), np.arange(len(start))
    for t in reversed(levels):
        found[left] = heights(t, _at(patch, theta, start[left], t * patch.length))
        left = left[found[left] == 0]
    return found


def _tree(patch: Patch) -> cKDTree:
    return cKDTree(_wrapped(patch, patch.feet), boxsize=patch.side)


def _wrapped(patch: Patch, place: Floats) -> Floats:
    found = np.mod(place, patch.side)
    return np.where(found < patch.side, found, 0.0)  # of a negative number that is next to 0, mod is the side itself


def _heights(patch: Patch, place: Floats, strand: NDArray[np.intp], z: float, theta: float) -> Floats:
    """Return heights (n,) where rays come into strands (n,), next to `_at`'s places (n, 2) at a height z; or 0."""
    away = place - patch.feet[strand]
    away -= patch.side * np.round(away / patch.side)
    rate = _rate(patch, theta)
    down = _first(patch, away - rate * (patch.length - z), rate)
    return np.where(np.isfinite(down), patch.length - down, 0.0)


def _rate(patch: Patch, theta: float) -> Floats:
    """Return how far a ray moves from the strands' axes a unit of height that it goes down (2,)."""
    return patch.lean - np.array([np.tan(theta), 0.0])


def _at(patch: Patch, theta: float, start: Floats, z: float) -> Floats:
    """Return where rays are at a height, from where the strands' axes have moved to: within the patch."""
    found = start - np.array(patch.lean) * patch.length + _rate(patch, theta) * (patch.length - z)
    return _wrapped(patch, found)


def _first(patch: Patch, away: Floats, rate: Floats) -> Floats:
    """Return how far down rays meet a cone (...), inf where they do not; away  (..., 2) from its tip, at its level.

    |g + m s| = k s, k = r0 / L: the first root in [0, L].
    """
    k = patch.radius / patch.length
    a, half, c = np.sum(rate**2, axis=-1) - k * k, np.sum(away * rate, axis=-1), np.sum(away**2, axis=-1)
    root = half**2 - a * c
    with np.errstate(divide="ignore", invalid="ignore"):
        # The stable form of both roots, of which one may be none.
        q = -(half + np.where(half >= 0, 1.0, -1.0) * np.sqrt(np.maximum(root, 0.0)))
        both = np.stack([q / a, c / q])
    good = (root >= 0) & np.isfinite(both) & (both >= 0) & (both <= patch.length)
    return np.asarray(np.min(np.where(good, both, np.inf), axis=0))

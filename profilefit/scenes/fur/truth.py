"""Fur by rays: against cones, exactly; against their discs on shells; and against cones inside slabs.

Strands stand on a patch that repeats. A ray comes from an eye toward +x at an angle theta to the normal, and goes down
toward -x; what it finds is the height of its first hit, 0 where it meets the skin. Lengths are in one unit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mcml_sim.media.checks import checked_whole, is_number, shown
from profilefit.errors import InputError
from profilefit.scenes.fur.law import MOST_LAYERS

Floats = NDArray[np.float64]
MOST_STRANDS = 1 << 20


@dataclass(frozen=True, eq=False)
class Patch:
    """Alike upright or leaning cones, feet (k, 2) within a square of this side, which repeats.

    radius, length  of a strand;  lean  of the tip along x and y, by the length [-]
    """

    feet: Floats
    side: float
    radius: float
    length: float
    lean: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("side", "radius", "length"):
            value = getattr(self, name)
            if not (is_number(value) and 0 < value < np.inf):
                raise InputError(f"{name} must be a finite length > 0, got {shown(value)}")
        if self.feet.ndim != 2 or self.feet.shape[1] != 2 or not 1 <= len(self.feet) <= MOST_STRANDS:
            raise InputError(f"feet must be 1 to {MOST_STRANDS} strands (k, 2), got shape {self.feet.shape}")

    @property
    def density(self) -> float:
        """Strands a unit of area."""
        return len(self.feet) / self.side**2


def random_patch(
    density: float, radius: float, length: float, side: float, seed: int = 0, lean: tuple[float, float] = (0.0, 0.0)
) -> Patch:
    """Feet that are independent of each other; as many as the density says on average, 1 at least."""
    if not (is_number(density) and 0 < density < np.inf and 0 < density * side * side <= MOST_STRANDS):
        raise InputError(f"density must be a number > 0 of {MOST_STRANDS} strands at most, got {shown(density)}")
    rng = np.random.default_rng([seed, 0])
    count = max(round(density * side * side), 1)
    return Patch(rng.random((count, 2)) * side, side, radius, length, lean)


def rays(patch: Patch, count: int, seed: int = 0) -> Floats:
    """Where rays (count, 2) come through the level of the tips, all over the patch."""
    return np.random.default_rng([seed, 1]).random((checked_whole("count", count, 1), 2)) * patch.side


def cast(patch: Patch, theta: float, start: Floats) -> Floats:
    """Height of the first hit (n,) of rays that start (n, 2) at the level of the tips, against the cones themselves.

    A cone that is met is within r0 and half a step of one of the places along a ray that are tried, a root apart.
    """
    rate, tree = _rate(patch, theta), _tree(patch)
    steps = int(np.ceil(float(np.hypot(*rate)) * patch.length / patch.radius)) + 1
    found = np.zeros(len(start))
    for number in range(steps):
        z = patch.length * (1.0 - (number + 0.5) / steps)
        place = _at(patch, theta, start, z)
        near = tree.query_ball_point(place, 1.5001 * patch.radius)
        ray = np.repeat(np.arange(len(start)), [len(one) for one in near])
        strand = np.fromiter((i for one in near for i in one), np.intp, ray.size)
        np.maximum.at(found, ray, _heights(patch, place[ray], strand, z, theta))
    return found


def by_shells(patch: Patch, theta: float, start: Floats, layers: int, exponent: float) -> Floats:
    """The same against discs on N shells of radius r0 (1 - t^p)."""
    count = checked_whole("layers", layers, 1, MOST_LAYERS)
    tree, found = _tree(patch), np.zeros(len(start))
    left = np.arange(len(start))
    for layer in reversed(range(count)):
        t = layer / count
        distance, _ = tree.query(_at(patch, theta, start[left], t * patch.length))
        hit = distance < patch.radius * (1.0 - t**exponent)
        found[left[hit]] = t * patch.length
        left = left[~hit]
    return found


def by_slabs(patch: Patch, theta: float, start: Floats, layers: int, tested: int = 1) -> Floats:
    """The same against the cone that is nearest to the middle of a ray's way through each of N slabs, from the top.

    tested  strands, the nearest ones;  a cone counts wherever the ray comes into it, within the slab or not
    """
    count, near = checked_whole("layers", layers, 1, MOST_LAYERS), checked_whole("tested", tested, 1, len(patch.feet))
    tree, found = _tree(patch), np.zeros(len(start))
    left = np.arange(len(start))
    for layer in reversed(range(count)):
        middle = (layer + 0.5) / count * patch.length
        place = _at(patch, theta, start[left], middle)
        _, nearest = tree.query(place, near)
        z = _heights(patch, np.repeat(place, near, axis=0), nearest.ravel(), middle, theta)
        best = z.reshape(len(left), near).max(axis=1)
        found[left] = best
        left = left[best == 0]
    return found


def _tree(patch: Patch) -> cKDTree:
    return cKDTree(np.mod(patch.feet, patch.side), boxsize=patch.side)


def _heights(patch: Patch, place: Floats, strand: NDArray[np.intp], z: float, theta: float) -> Floats:
    """Heights (n,) where rays come into strands (n,), the image nearest to places (n, 2) at a height z; or 0."""
    away = place - np.mod(patch.feet[strand], patch.side)
    away -= patch.side * np.round(away / patch.side)
    rate = _rate(patch, theta)
    down = _first(patch, away - rate * (patch.length - z), rate)
    return np.where(np.isfinite(down), patch.length - down, 0.0)


def _rate(patch: Patch, theta: float) -> Floats:
    """How far a ray moves from a strand's axis a unit of height that it goes down (2,)."""
    return np.array([patch.lean[0] - np.tan(theta), patch.lean[1]])


def _at(patch: Patch, theta: float, start: Floats, z: float) -> Floats:
    """Where rays are at a height, as seen from the foot of a strand whose axis is there: within the patch."""
    found = start - np.array(patch.lean) * patch.length + _rate(patch, theta) * (patch.length - z)
    return np.mod(found, patch.side)


def _first(patch: Patch, away: Floats, rate: Floats) -> Floats:
    """How far down rays come into a cone (...), inf where they do not; away  (..., 2) from its tip, at its level.

    |g + m s| = k s, k = r0 / L: the first root in [0, L].
    """
    k = patch.radius / patch.length
    a, half, c = float(rate @ rate) - k * k, away @ rate, np.sum(away**2, axis=-1)
    root = half**2 - a * c
    with np.errstate(divide="ignore", invalid="ignore"):
        # The stable form of both roots, of which one may be none.
        q = -(half + np.where(half >= 0, 1.0, -1.0) * np.sqrt(np.maximum(root, 0.0)))
        both = np.stack([q / a if a else np.full_like(q, np.inf), c / q])
    good = (root >= 0) & np.isfinite(both) & (both >= 0) & (both <= patch.length)
    return np.asarray(np.min(np.where(good, both, np.inf), axis=0))

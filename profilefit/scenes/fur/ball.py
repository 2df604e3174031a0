"""Strands on a ball, and rays against each of them: the reference of the picture.

A force leans the tips: a strand's axis goes from its foot R f to R f + L (f + F), as shells do that each move along the
normal and the force (Fang et al., section 2), so that the shell at t L is a ball of radius R + t L about t L F.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mcml_sim.media.arrays import Floats
from profilefit.scenes.stage.world import Camera, Singles, unit

SKIN, NOTHING = -1.0, -2.0  # in place of a height
CLUMP_TEXELS = 512
BLOCK, MOST_PAIRS = 4096, 1 << 21  # strands that are cast at once, and pixels that they are seen in together

Indices = NDArray[np.intp]


class FurView(NamedTuple):
    """Rays of a picture from the eye, through forward + x right + y up, x and y in -1 ... 1.

    If they are parallel, all run along forward, from eye + x right + y up.
    """

    eye: Floats
    forward: Floats
    right: Floats
    up: Floats
    parallel: bool = False

    @classmethod
    def of(cls, camera: Camera, size: tuple[int, int]) -> FurView:
        """Return rays in perspective; size  columns and rows."""
        right, up, back = camera.view()[:3, :3]
        half = 0.5 * camera.height / camera.distance
        return cls(np.array(camera.eye, float), -back, right * half * size[0] / size[1], up * half)

    def rays(self, size: tuple[int, int]) -> tuple[Floats, Floats]:
        """Return starts and unit directions (rows, columns, 3) through the middles of pixels, row 0 at the bottom."""
        x, y = ((2.0 * np.arange(count) + 1.0) / count - 1.0 for count in size)
        aside = x[None, :, None] * self.right + y[:, None, None] * self.up
        if self.parallel:
            return self.eye + aside, np.broadcast_to(self.forward, aside.shape)
        ways = self.forward + aside
        return np.broadcast_to(self.eye, ways.shape), ways / np.linalg.norm(ways, axis=-1, keepdims=True)

    def places(self, points: Floats) -> Floats:
        """Return x and y (n, 2) at which points (n, 3) are seen."""
        away = points - self.eye
        deep = np.ones(len(points)) if self.parallel else away @ self.forward
        return np.stack([away @ one / (one @ one) / deep for one in (self.right, self.up)], axis=-1)


class _Strips(NamedTuple):
    """Strips of a picture [pixels] that strands are seen in: hulls of a square around the root, and of the tip.

    Attributes:
        root: (k, 2) middles of the squares.
        move: (k, 2) from there to the tips.
        half: (k,) half the squares' sides.
    """

    root: Floats
    move: Floats
    half: Floats

    def parts(self, size: tuple[int, int]) -> Iterator[slice]:
        """Yield strands that together are seen in `MOST_PAIRS` pixels at most, or one by one."""
        sides = np.minimum(np.abs(self.move) + 2.0 * self.half[:, None] + 1.0, size)
        end = 0
        while end < len(sides):
            begin = end
            whole = np.cumsum(np.prod(sides[begin : begin + BLOCK], axis=1))
            end = begin + max(int(np.searchsorted(whole, MOST_PAIRS)), 1)
            yield slice(begin, end)

    def pairs(self, part: slice, size: tuple[int, int]) -> tuple[Indices, Indices]:
        """Return strands (n,) of a part, and rays (n,) that each may meet, row by row."""
        root, move, half = self.root[part], self.move[part], self.half[part]
        low = np.ceil(np.minimum(root[:, 1], root[:, 1] + move[:, 1]) - half).clip(0, size[1])
        high = np.floor(np.maximum(root[:, 1], root[:, 1] + move[:, 1]) + half).clip(-1, size[1] - 1)
        which, row = _ranges(low, high)
        # Shares of the way to the tip at which the strip is in the row, and the columns between.
        off, rise, wide = row - root[which, 1], move[which, 1], half[which]
        flat = np.abs(rise) < 1e-9
        slope = np.where(flat, 1.0, rise)
        ends = np.stack([np.where(flat, 0.0, (off - wide) / slope), np.where(flat, 1.0, (off + wide) / slope)])
        ends = np.sort(ends, axis=0).clip(0.0, 1.0)
        across = np.sort(root[which, 0] + ends * move[which, 0], axis=0)
        wide = wide * (1.0 - ends[0])
        first = np.ceil(across[0] - wide).clip(0, size[0])
        last = np.floor(across[1] + wide).clip(-1, size[0] - 1)
        strip, column = _ranges(first, last)
        return which[strip] + part.start, row[strip] * size[0] + column


@dataclass(frozen=True, eq=False)
class Ball:
    """Equal cones, feet (k, 3) in unit directions from the middle of a ball of radius `ball`.

    radius, length  of a strand;  force  by which the tips lean, by the length [-]
    centres         of clumps (m, 3), unit directions;  gather  share of the way to its centre that a tip is moved
    """

    feet: Floats
    ball: float
    radius: float
    length: float
    force: tuple[float, float, float] = (0.0, 0.0, 0.0)
    centres: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    gather: float = 0.0

    @property
    def gathered(self) -> float:
        """Displacement of a tip by its clump, over the length and the difference of centre and foot [-]."""
        return self.gather * (self.ball + self.length) / self.length if len(self.centres) else 0.0

    @cached_property
    def clumps(self) -> Singles:
        """Map (texels, texels, 4) of the centre of the clump that a direction belongs to."""
        return nearest_feet(self.centres, CLUMP_TEXELS)[0] if len(self.centres) else np.zeros((1, 1, 4), np.float32)

    @cached_property
    def axes(self) -> Floats:
        """Vectors (k, 3) from foot to tip, by the length."""
        upright = self.feet + np.array(self.force)
        if not len(self.centres):
            return upright
        row, column = _texel(self.feet, CLUMP_TEXELS)
        return upright + self.gathered * (self.clumps[row, column, :3] - self.feet)

    def cast(self, view: FurView, size: tuple[int, int]) -> Floats:
        """Return first hits (rows, columns, 4): foot and height over the length; of skin normal and `SKIN`; `NOTHING`.

        Each strand against every ray of the strip that it is seen in: |q + m s| = r0 (1 - t), in float64.
        """
        start, way = (np.broadcast_to(one, (size[1], size[0], 3)).reshape(-1, 3) for one in view.rays(size))
        found = np.full((len(way), 4), NOTHING)
        far = np.full(len(way), np.inf)
        # The skin, where a ray meets the ball itself.
        along = np.sum(start * way, axis=-1)
        half = self.ball**2 - np.sum((start - along[:, None] * way) ** 2, axis=-1)
        seen = half > 0
        far[seen] = -along[seen] - np.sqrt(half[seen])
        found[seen, :3] = (start[seen] + far[seen, None] * way[seen]) / self.ball
        found[seen, 3] = SKIN
        strips = self._strips(view, size)
        for part in strips.parts(size):
            strand, ray = strips.pairs(part, size)
            distance, t = self._met(strand, start[ray], way[ray])
            np.minimum.at(far, ray, distance)
            first = np.isfinite(distance) & (distance == far[ray])
            found[ray[first], :3], found[ray[first], 3] = self.feet[strand[first]], t[first]
        return found.reshape(size[1], size[0], 4)

    def _strips(self, view: FurView, size: tuple[int, int]) -> _Strips:
        corners = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), axis=-1).reshape(-1, 3) * self.radius
        roots = self.ball * self.feet
        around = self._pixels(view, size, (roots[:, None] + corners).reshape(-1, 3)).reshape(-1, 8, 2)
        root = 0.5 * (around.min(axis=1) + around.max(axis=1))
        half = 0.5 * np.max(np.ptp(around, axis=1), axis=1)
        return _Strips(root, self._pixels(view, size, roots + self.length * self.axes) - root, half)

    def _pixels(self, view: FurView, size: tuple[int, int], points: Floats) -> Floats:
        return 0.5 * (view.places(points) + 1.0) * np.array(size) - 0.5

    def _met(self, strand: Indices, start: Floats, way: Floats) -> tuple[Floats, Floats]:
        """Return distances (n,) along rays to strands, inf where one is not met, and heights there over the length."""
        foot, axis = self.feet[strand], self.length * self.axes[strand]
        tall = _dot(axis, foot)
        away = start - self.ball * foot
        # From where a ray is next to the middle of the strand, so that no digits are lost over the way to it.
        near = _dot(0.5 * axis - away, way)
        away = away + near[:, None] * way
        t, rate = _dot(away, foot) / tall, _dot(way, foot) / tall
        q, m = away - t[:, None] * axis, way - rate[:, None] * axis
        r, k = self.radius * (1.0 - t), -self.radius * rate
        a, b, c = _dot(m, m) - k * k, _dot(q, m) - r * k, _dot(q, q) - r * r
        under = b * b - a * c
        with np.errstate(divide="ignore", invalid="ignore"):
            half = -(b + np.where(b < 0, -1.0, 1.0) * np.sqrt(np.maximum(under, 0.0)))
            roots = np.stack([half / a, c / half])
            heights = t + roots * rate
        good = (under >= 0) & np.isfinite(roots) & (heights >= 0) & (heights <= 1)
        first = np.argmin(np.where(good, roots, np.inf), axis=0)[None]
        found = np.take_along_axis(np.where(good, roots, np.inf), first, axis=0)[0] + near
        return found, np.take_along_axis(heights, first, axis=0)[0]


def random_ball(
    count: int,
    ball: float,
    radius: float,
    length: float,
    force: tuple[float, float, float],
    seed: int,
    clumps: int = 0,
    gather: float = 0.0,
) -> Ball:
    """Return a ball with so many feet, independent of each other, evenly over it, and so many centres of clumps."""
    feet, centres = (unit(np.random.default_rng([seed, of]).normal(size=(n, 3))) for of, n in ((2, count), (3, clumps)))
    return Ball(feet, ball, radius, length, force, centres, gather)


def nearest_feet(feet: Floats, texels: int) -> list[Singles]:
    """Return maps (texels, texels, 4) of the nearest foot, and of the next, for each texel of an octahedron's net.

    Where x + y + z is 1 of magnitudes, the lower half folded outward; glsl/ball.glsl reads it.
    """
    x = (2.0 * np.arange(texels) + 1.0) / texels - 1.0
    u, v = np.meshgrid(x, x)
    z = 1.0 - np.abs(u) - np.abs(v)
    folded = _folded(u, v)
    directions = unit(np.stack([np.where(z < 0, folded[0], u), np.where(z < 0, folded[1], v), z], axis=-1))
    _, found = cKDTree(feet).query(directions, 2 if len(feet) > 1 else 1, workers=-1)
    index = found.reshape(texels, texels, -1)
    padding = np.zeros((texels, texels, 1))
    return [np.concatenate([feet[index[..., i]], padding], axis=-1).astype(np.float32) for i in (0, -1)]


def _texel(directions: Floats, texels: int) -> tuple[Indices, Indices]:
    """Return row and column (n,) of the net's texel that each direction (n, 3) is in."""
    u, v, z = (directions / np.sum(np.abs(directions), axis=1, keepdims=True)).T
    folded = _folded(u, v)
    net = np.where(z < 0, folded[1], v), np.where(z < 0, folded[0], u)
    row, column = ((0.5 * (one + 1.0) * texels).astype(np.intp).clip(0, texels - 1) for one in net)
    return row, column


def _folded(u: Floats, v: Floats) -> list[Floats]:
    return [(1.0 - np.abs(other)) * np.where(one < 0, -1.0, 1.0) for one, other in ((u, v), (v, u))]


def _ranges(low: Floats, high: Floats) -> tuple[Indices, Indices]:
    """Return numbers (n,) of ranges, and whole numbers (n,) from low to high of each."""
    count = np.maximum(high - low + 1.0, 0.0).astype(np.intp)
    which = np.repeat(np.arange(len(count)), count)
    return which, np.arange(len(which)) - (np.cumsum(count) - count - low.astype(np.intp))[which]


def _dot(a: Floats, b: Floats) -> Floats:
    return np.einsum("ij,ij->i", a, b)

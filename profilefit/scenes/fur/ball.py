"""Strands on a ball, and rays against each of them: the reference of the picture.

A force leans the tips: a strand's axis goes from its foot R f to R f + L (f + F), as shells do that each move along the
normal and the force (Fang et al., section 2), so that the shell at t L is a ball of radius R + t L about t L F.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mcml_sim.media.arrays import Floats
from profilefit.scenes.stage.world import Camera

SKIN, NOTHING = -1.0, -2.0  # in place of a height


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


@dataclass(frozen=True, eq=False)
class Ball:
    """Equal cones, feet (k, 3) in unit directions from the middle of a ball of radius `ball`.

    radius, length  of a strand;  force  by which the tips lean, by the length [-]
    """

    feet: Floats
    ball: float
    radius: float
    length: float
    force: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def axes(self) -> Floats:
        """Vectors (k, 3) from foot to tip, by the length."""
        return self.feet + np.array(self.force)

    def cast(self, view: FurView, size: tuple[int, int]) -> Floats:
        """Return first hits (rows, columns, 4): foot and height over the length; of skin normal and `SKIN`; `NOTHING`.

        Each strand against every ray of the rectangle that it is seen in: |q + m s| = r0 (1 - t), in float64.
        """
        start, way = view.rays(size)
        found = np.full((*start.shape[:2], 4), NOTHING)
        far = np.full(start.shape[:2], np.inf)
        # The skin, where a ray meets the ball itself.
        along = np.sum(start * way, axis=-1)
        half = self.ball**2 - np.sum((start - along[..., None] * way) ** 2, axis=-1)
        seen = half > 0
        far[seen] = (-along - np.sqrt(np.maximum(half, 0.0)))[seen]
        place = (start + np.where(seen, far, 0.0)[..., None] * way) / self.ball
        found[seen] = np.concatenate([place, np.full((*seen.shape, 1), SKIN)], axis=-1)[seen]
        for foot, box in zip(self.feet, self._boxes(view, size), strict=True):
            rows, columns = slice(*box[1]), slice(*box[0])
            if rows.start >= rows.stop or columns.start >= columns.stop:
                continue
            distance, t = self._met(foot, start[rows, columns], way[rows, columns])
            near = distance < far[rows, columns]
            far[rows, columns][near] = distance[near]
            found[rows, columns][near] = np.concatenate([np.tile(foot, (near.sum(), 1)), t[near, None]], axis=1)
        return found

    def _boxes(self, view: FurView, size: tuple[int, int]) -> NDArray[np.intp]:
        """Return columns and rows (k, 2, 2), from and to, where strands are seen: of cubes about roots, and of tips."""
        roots, tips = self.ball * self.feet, self.ball * self.feet + self.length * self.axes
        corners = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), axis=-1).reshape(-1, 3) * self.radius
        points = np.concatenate([roots[:, None] + corners, tips[:, None]], axis=1)
        seen = view.places(points.reshape(-1, 3)).reshape(len(roots), -1, 2)
        ends = np.stack([seen.min(axis=1), seen.max(axis=1)], axis=-1)
        pixels = 0.5 * (ends + 1.0) * np.array(size)[:, None] - 0.5
        whole = np.stack([np.floor(pixels[..., 0]), np.ceil(pixels[..., 1]) + 1.0], axis=-1)
        return np.clip(whole, 0, np.array(size)[:, None]).astype(np.intp)

    def _met(self, foot: Floats, start: Floats, way: Floats) -> tuple[Floats, Floats]:
        """Return distances (...) along rays to a strand, inf where it is not met, and heights there over the length."""
        axis = self.length * (foot + np.array(self.force))
        tall = axis @ foot
        away = start - self.ball * foot
        # From where a ray is next to the middle of the strand, so that no digits are lost over the way to it.
        near = np.sum((0.5 * axis - away) * way, axis=-1)
        away = away + near[..., None] * way
        t, rate = away @ foot / tall, way @ foot / tall
        q, m = away - t[..., None] * axis, way - rate[..., None] * axis
        r, k = self.radius * (1.0 - t), -self.radius * rate
        a, b = np.sum(m * m, axis=-1) - k * k, np.sum(q * m, axis=-1) - r * k
        c = np.sum(q * q, axis=-1) - r * r
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
    count: int, ball: float, radius: float, length: float, force: tuple[float, float, float], seed: int
) -> Ball:
    """Return a ball with so many feet, independent of each other, evenly over it."""
    feet = np.random.default_rng([seed, 2]).normal(size=(count, 3))
    return Ball(feet / np.linalg.norm(feet, axis=1, keepdims=True), ball, radius, length, force)


def nearest_feet(feet: Floats, texels: int) -> list[NDArray[np.float32]]:
    """Return maps (texels, texels, 4) of the nearest foot, and of the next, for each texel of an octahedron's net.

    Where x + y + z is 1 of magnitudes, the lower half folded outward; glsl/ball.glsl reads it.
    """
    x = (2.0 * np.arange(texels) + 1.0) / texels - 1.0
    u, v = np.meshgrid(x, x)
    z = 1.0 - np.abs(u) - np.abs(v)
    under = z < 0
    folded = [(1.0 - np.abs(other)) * np.where(one < 0, -1.0, 1.0) for one, other in ((u, v), (v, u))]
    directions = np.stack([np.where(under, folded[0], u), np.where(under, folded[1], v), z], axis=-1)
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    _, found = cKDTree(feet).query(directions, 2 if len(feet) > 1 else 1)
    index = found.reshape(texels, texels, -1)
    padding = np.zeros((texels, texels, 1))
    return [np.concatenate([feet[index[..., i]], padding], axis=-1).astype(np.float32) for i in (0, -1)]

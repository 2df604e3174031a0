"""Links beyond the edges of charts: for each texel of an atlas's margin the place inside where the surface goes on.

A chart ends where a seam was cut; the surface does not. From the edge outwards, texel by texel, a step goes on from the
last places: in space, and what of the surface lies nearest is where it ends, across a seam on its other side, over a
pole on the meridian opposite; from there on in the atlas, along the lines of that chart. Where nothing is within a
step, the surface ends as well.
Links are places in the atlas, so those of a surface at rest serve all its poses.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
STEPS = np.array([(0, 1), (0, -1), (1, 0), (-1, 0)])  # rows, columns
REACH = 0.75  # of a texel, along its row and its column, and off its plane: what is farther off is another surface


def links(position: Floats, inside: NDArray[np.bool_], margin: int) -> Singles:
    """Return (rows, columns, 3): column and row of the place whose light a texel has, fractional, and 1; 0 where none.

    position  (rows, columns, 3) [length], of the texels that are inside a chart;  margin  how far links go [texels]
    """
    rows, columns = inside.shape
    where = np.argwhere(inside)
    tree = cKDTree(position[inside])
    place = np.zeros((rows, columns, 2))  # row, column
    place[inside] = where
    point = np.where(inside[..., None], position, 0.0)
    known = inside.copy()
    frames = _frames(position, inside)
    for _ in range(margin):
        found = []
        for step in STEPS:
            at = np.argwhere(~known)
            one, two = at - step, at - 2 * step
            good = _has(known, one) & _has(known, two)
            at, one, two = at[good], tuple(one[good].T), tuple(two[good].T)
            if not len(at):
                continue
            three = at - 3 * step
            bent = _has(known, three)[:, None]  # a row may be a narrow circle: a parabola, where three places are known
            before = np.where(bent, point[tuple(np.clip(three, 0, np.array(inside.shape) - 1).T)], 0.0)
            to, there, good = _stepped(place[one], place[two], ~inside[one] & ~inside[two], inside, position, frames)
            ahead = np.where(bent, 3.0 * (point[one] - point[two]) + before, 2.0 * point[one] - point[two])
            distance, nearest = tree.query(ahead)
            texel = tuple(where[nearest].T)
            offset = ahead - position[texel]
            side, shift = np.linalg.norm(frames[texel], axis=-1).max(axis=-1), _coordinates(frames[texel], offset)
            close = (distance < 2.0 * side) & np.all(np.abs(shift) < REACH, axis=1)
            to = np.where(good[:, None], to, where[nearest] + shift)
            there = np.where(good[:, None], there, position[texel] + _along(frames[texel], offset))
            good |= close
            found.append((at[good], to[good], there[good]))
        fresh = np.zeros_like(known)
        for at, to, there in reversed(found):  # the first step wins where several reach a texel
            index = tuple(at.T)
            place[index], point[index], fresh[index] = to, there, True
        if not fresh.any():
            break
        known |= fresh
    return np.concatenate([place[..., ::-1], known[..., None]], axis=-1).astype(np.float32)


def _stepped(
    one: Floats,
    two: Floats,
    linked: NDArray[np.bool_],
    inside: NDArray[np.bool_],
    position: Floats,
    frames: Floats,
) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Return the next place in the atlas after two that are `linked`, its point, and whether it is inside a chart."""
    to = 2.0 * one - two
    nearest = np.rint(to).astype(int)
    good = linked & (np.max(np.abs(one - two), axis=1) < 2.0) & _has(inside, nearest)
    texel = tuple(np.where(good[:, None], nearest, 0).T)
    offset = np.where(good[:, None], to - nearest, 0.0)
    return to, position[texel] + np.einsum("na,nax->nx", offset, frames[texel]), good


def _has(known: NDArray[np.bool_], at: NDArray[np.int64]) -> NDArray[np.bool_]:
    within = np.all((at >= 0) & (at < known.shape), axis=1)
    clipped = np.clip(at, 0, np.array(known.shape) - 1)
    return within & known[tuple(clipped.T)]


def _frames(position: Floats, inside: NDArray[np.bool_]) -> Floats:
    """Return (rows, columns, 2, 3) steps of one row and one column [length]; central where both neighbours are in."""
    frames = np.zeros((*inside.shape, 2, 3))
    for axis in (0, 1):
        ahead, behind = (np.roll(position, -shift, axis) for shift in (1, -1))
        has_ahead, has_behind = (np.roll(inside, -shift, axis) for shift in (1, -1))
        last, first = [slice(None)] * 2, [slice(None)] * 2
        last[axis], first[axis] = -1, 0  # type: ignore[call-overload]
        has_ahead[tuple(last)], has_behind[tuple(first)] = False, False
        both, only = has_ahead & has_behind, has_ahead | has_behind
        difference = np.where(has_ahead[..., None], ahead, position) - np.where(has_behind[..., None], behind, position)
        frames[..., axis, :] = np.where(only[..., None], difference / np.where(both, 2.0, 1.0)[..., None], 0.0)
    return frames


def _coordinates(frames: Floats, offset: Floats) -> Floats:
    """Return rows and columns of an offset in the plane of a texel."""
    gram = frames @ np.swapaxes(frames, -1, -2)
    scale = np.trace(gram, axis1=-2, axis2=-1)
    safe = gram + 1e-9 * np.where(scale > 0, scale, 1.0)[:, None, None] * np.eye(2)
    return np.asarray(np.linalg.solve(safe, frames @ offset[..., None])[..., 0], float)


def _along(frames: Floats, offset: Floats) -> Floats:
    """Return the part of an offset in the plane of a texel, which its coordinates may not tell at a pole."""
    normal = np.cross(frames[:, 0], frames[:, 1])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = normal / np.where(length > 0, length, 1.0)
    return offset - np.sum(offset * normal, axis=1, keepdims=True) * normal

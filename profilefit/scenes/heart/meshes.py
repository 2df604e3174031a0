"""Surfaces with an atlas: a ball and a sheet of bumps of one chart, and a heart of six."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcml_sim.media.arrays import Floats
from profilefit.scenes.stage.world import Mesh, parameters, sheet, unit

KINDS = ("heart", "ball", "bumps")
PERIODS = 3.0  # of a sheet of bumps
EDGE, MOST_EDGE = 3.0, 0.3  # of a sheet, where nothing is judged: in sigma of the widest Gaussian, in its side at most
GAP = 1.0 / 6.0  # of an atlas between the charts of a heart
CHARTS_END = 72  # a number of columns or rows, multiples of which have charts end between two texels
STEP = 1e-4  # of the differences that are its normals [radius]
# Its charts, faces of a cube by their right, up and outward axes: three in a row, two rows.
FACES = (
    ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    ((0, 0, -1), (0, 1, 0), (1, 0, 0)),
    ((-1, 0, 0), (0, 1, 0), (0, 0, -1)),
    ((0, 0, 1), (0, 1, 0), (-1, 0, 0)),
    ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
)
# Vessels on the wall of a heart: from one direction to another, and how far they stand out [its radius].
VESSELS = (
    ((-0.25, 0.75, 0.6), (0.25, -0.75, 0.55), 0.045),
    ((-0.15, 0.45, 0.85), (0.75, -0.15, 0.6), 0.03),
    ((0.0, 0.05, 1.0), (-0.6, -0.45, 0.65), 0.028),
    ((0.3, 0.8, -0.5), (-0.35, -0.7, -0.6), 0.04),
)
VESSEL = 0.055  # their half width [radius]
WINDING = 0.05, 9.0  # how far they wind [radius], and how often [1/radius]


def surface(kind: str, size: float, steepness: float) -> Mesh:
    """Return the mesh of one of `KINDS`: size  radius or period [length];  steepness  amplitude over the period [-]."""
    if kind == "bumps":
        return bumps(size, steepness * size, PERIODS * size)
    return {"heart": heart, "ball": ball}[kind](size)


def off_edges(kind: str, size: float, points: Floats, sigma: float) -> NDArray[np.bool_]:
    """Return (...) whether points (..., 3) are so far from a sheet's edge that blurs know what comes from beyond."""
    if kind != "bumps":
        return np.ones(points.shape[:-1], bool)
    side = PERIODS * size
    return np.all(np.abs(points[..., :2]) < 0.5 * side - min(EDGE * sigma, MOST_EDGE * side), axis=-1)


def ball(radius: float, rows: int = 96, columns: int = 192) -> Mesh:
    """Return a sphere about the origin: u its longitude, v from its south pole up [length]."""
    u, v = parameters(rows, columns)
    turn, height = 2.0 * np.pi * u, np.pi * (v - 0.5)
    across = np.cos(height)
    points = radius * np.stack([across * np.sin(turn), np.sin(height), across * np.cos(turn)], axis=-1)
    return sheet(points, u, v, closed=True)


def bumps(period: float, amplitude: float, side: float, rows: int = 200) -> Mesh:
    """Return a square sheet that faces +z, z = amplitude cos(2 pi x / period) [length]."""
    u, v = parameters(rows, rows)
    x, y = side * (u - 0.5), side * (v - 0.5)
    return sheet(np.stack([x, y, amplitude * np.cos(2.0 * np.pi * x / period)], axis=-1), u, v)


def heart(radius: float, rows: int = 64) -> Mesh:
    """Return a closed surface like a heart, about so large from its middle: chambers, a groove between them, vessels.

    Six charts, three in a row, with gaps between them. Its shape is made up.
    """
    u, v = parameters(rows, rows)
    # Even angles: the cube's faces are then divided into patches of about one size.
    tan_u, tan_v = (np.tan(0.25 * np.pi * (2.0 * one - 1.0)) for one in (u, v))
    parts = []
    for number, (right, up, outward) in enumerate(FACES):
        towards = tan_u[..., None] * np.array(right) + tan_v[..., None] * np.array(up) + np.array(outward)
        column, row = number % 3, number // 3
        chart = (column + 0.5 + (1.0 - GAP) * (u - 0.5)) / 3.0, (row + 0.5 + (1.0 - GAP) * (v - 0.5)) / 2.0
        around = [_wall(unit(towards + way * np.array(axis))) for axis in (right, up) for way in (STEP, -STEP)]
        normal = unit(np.cross(around[0] - around[1], around[2] - around[3]))
        flat = sheet(radius * _wall(unit(towards)), *chart)
        parts.append(Mesh(flat.position, normal.reshape(-1, 3), flat.uv, flat.triangles))
    count = len(parts[0].position)
    position, normal, uv = (
        np.concatenate([getattr(one, key) for one in parts]) for key in ("position", "normal", "uv")
    )
    triangles = np.concatenate([one.triangles + number * count for number, one in enumerate(parts)])
    return Mesh(position, normal, uv, triangles)


def _wall(towards: Floats) -> Floats:
    """Return points (..., 3) of the wall in directions (..., 3), of about unit radius."""
    x, y = towards[..., 0], towards[..., 1]
    apex = np.clip(-y, 0.0, 1.0)
    out = 1.0 + 0.12 * _bump(towards, (-0.55, 0.55, 0.45), 0.5) + 0.16 * _bump(towards, (0.6, 0.5, 0.1), 0.45)
    out += 0.22 * _bump(towards, (-0.1, 0.95, 0.1), 0.28)  # the root of the great vessels
    out -= 0.07 * np.exp(-(((y - 0.35 + 0.25 * x) / 0.12) ** 2))  # the groove between atria and ventricles
    wound = unit(towards + WINDING[0] * np.sin(WINDING[1] * np.roll(towards, 1, axis=-1)))
    for start, end, height in VESSELS:
        out += height * np.exp(-((_from_arc(wound, start, end) / VESSEL) ** 2))
    shape = out[..., None] * towards * np.array([0.86, 1.05, 0.78])
    lean = np.stack([0.22 * apex**1.5, 0.0 * x, 0.10 * apex**1.5], axis=-1)  # the apex points left of its owner
    narrowed = 1.0 - 0.30 * apex**2
    return np.stack([shape[..., 0] * narrowed, shape[..., 1], shape[..., 2] * narrowed], axis=-1) + lean


def _bump(towards: Floats, at: tuple[float, float, float], width: float) -> Floats:
    return np.exp(-np.sum((towards - unit(at)) ** 2, axis=-1) / width**2)


def _from_arc(towards: Floats, start: tuple[float, float, float], end: tuple[float, float, float]) -> Floats:
    """Return chords from directions to the nearest of an arc's."""
    ways = unit(np.linspace(unit(start), unit(end), 60))
    tangents, ends = np.diff(ways, axis=0), ways[:-1]
    nearest = np.full(towards.shape[:-1], np.inf)
    for one, tangent in zip(ends, tangents, strict=True):
        share = np.clip((towards - one) @ tangent / (tangent @ tangent), 0.0, 1.0)
        nearest = np.minimum(nearest, np.linalg.norm(towards - one - share[..., None] * tangent, axis=-1))
    return nearest

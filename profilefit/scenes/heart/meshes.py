"""Surfaces with an atlas: a ball and a sheet of bumps of one chart, and a heart of six."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcml_sim.media.arrays import Floats
from profilefit.scenes.heart.anatomy import colours, wall
from profilefit.scenes.stage.world import Mesh, Singles, parameters, sheet, unit

KINDS = ("heart", "ball", "bumps")
PERIODS = 3.0  # of a sheet of bumps
EDGE, MOST_EDGE = 3.0, 0.3  # of a sheet, where nothing is judged: in sigma of the widest Gaussian, in its side at most
GAP = 1.0 / 6.0  # of an atlas between the charts of a heart
CHARTS_END = 72  # a number of columns or rows, multiples of which have charts end between two texels
# Axes of the anatomy in the scene: its front is turned by 60 degrees from z, away from the lamp.
TURN = np.radians(60.0)
FRONT = np.array([[np.cos(TURN), 0.0, np.sin(TURN)], [0.0, 1.0, 0.0], [-np.sin(TURN), 0.0, np.cos(TURN)]])
STEP = 1e-4  # of the differences that are its normals [radius]
# Its charts, faces of a cube by their right, up and outward axes: three in a row, two rows.
Face = tuple[tuple[int, int, int], tuple[int, int, int], tuple[int, int, int]]
FACES: tuple[Face, ...] = (
    ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    ((0, 0, -1), (0, 1, 0), (1, 0, 0)),
    ((-1, 0, 0), (0, 1, 0), (0, 0, -1)),
    ((0, 0, 1), (0, 1, 0), (-1, 0, 0)),
    ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
)
ROWS, COLUMNS = 128, 1024  # of a chart of the heart, and of its paint


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


def heart(radius: float, rows: int = ROWS) -> Mesh:
    """Return a closed surface like a heart, about so large from its middle, in six charts with gaps between them."""
    u, v = parameters(rows, rows)
    parts = []
    for number, face in enumerate(FACES):
        column, row = number % 3, number // 3
        chart = (column + 0.5 + (1.0 - GAP) * (u - 0.5)) / 3.0, (row + 0.5 + (1.0 - GAP) * (v - 0.5)) / 2.0
        towards = _towards(face, u, v)
        around = [_placed(towards + way * np.array(axis)) for axis in face[:2] for way in (STEP, -STEP)]
        normal = unit(np.cross(around[0] - around[1], around[2] - around[3]))
        flat = sheet(radius * _placed(towards), *chart)
        parts.append(Mesh(flat.position, normal.reshape(-1, 3), flat.uv, flat.triangles))
    count = len(parts[0].position)
    position, normal, uv = (
        np.concatenate([getattr(one, key) for one in parts]) for key in ("position", "normal", "uv")
    )
    triangles = np.concatenate([one.triangles + number * count for number, one in enumerate(parts)])
    return Mesh(position, normal, uv, triangles)


def paint(columns: int = COLUMNS) -> Singles:
    """Return the reflectance A (rows, columns, 3) of a heart over its six charts [-]."""
    rows = 2 * columns // 3
    u, v = (3.0 * (np.arange(columns) + 0.5) / columns), (2.0 * (np.arange(rows) + 0.5) / rows)
    found = np.empty((rows, columns, 3), np.float32)
    for number, face in enumerate(FACES):
        column, row = number % 3, number // 3
        at = np.ix_(v.astype(int) == row, u.astype(int) == column)
        # Texels of the gap have the colours of the chart's edge, which is read between texels.
        own = (way[way.astype(int) == of] - of - 0.5 for way, of in ((u, column), (v, row)))
        within = (np.clip(place / (1.0 - GAP) + 0.5, -0.05, 1.05) for place in own)
        found[at] = colours(unit(_towards(face, *np.meshgrid(*within))) @ FRONT)
    return found


def _placed(towards: Floats) -> Floats:
    """Return points of the wall in directions of any length."""
    return wall(unit(towards) @ FRONT) @ FRONT.T


def _towards(face: Face, u: Floats, v: Floats) -> Floats:
    """Return directions (..., 3), of any length, of a face of the cube; even angles give patches of about one size."""
    right, up, outward = face
    tan_u, tan_v = (np.tan(0.25 * np.pi * (2.0 * one - 1.0)) for one in (u, v))
    return tan_u[..., None] * np.array(right) + tan_v[..., None] * np.array(up) + np.array(outward)

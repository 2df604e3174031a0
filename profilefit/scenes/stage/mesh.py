"""Triangles from grids of points: positions, normals, texture coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from profilefit.scenes.stage.camera import unit

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Mesh:
    """position (n, 3) [mm], normal (n, 3), uv (n, 2) in [0, 1], triangles (m, 3) counter-clockwise from outside."""

    position: Floats
    normal: Floats
    uv: Floats
    triangles: NDArray[np.int32]

    def vertices(self) -> NDArray[np.float32]:
        """(n, 8) position, normal, uv, as a vertex buffer holds them."""
        return np.concatenate([self.position, self.normal, self.uv], axis=1).astype(np.float32)


def parameters(rows: int, columns: int) -> tuple[Floats, Floats]:
    """u and v (rows + 1, columns + 1), even over [0, 1]; u along a row."""
    v, u = np.meshgrid(np.linspace(0, 1, rows + 1), np.linspace(0, 1, columns + 1), indexing="ij")
    return u, v


def sheet(points: Floats, u: Floats, v: Floats, closed: bool = False) -> Mesh:
    """A grid of points (rows, columns, 3), outside where d/du x d/dv points; `closed`: its last column is its first."""
    rows, columns = u.shape
    index = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    uv = np.stack([u, v], -1).reshape(-1, 2)
    return Mesh(points.reshape(-1, 3), normals(points, closed).reshape(-1, 3), uv, triangles)


def normals(points: Floats, closed: bool = False) -> Floats:
    """(rows, columns, 3) unit normals of a grid: of each vertex, the mean of its faces by their area."""
    across, along = np.diff(points, axis=1), np.diff(points, axis=0)
    face = np.cross(across[:-1], along[:, 1:]) + np.cross(across[1:], along[:, :-1])
    padded = np.pad(face, ((1, 1), (1, 1), (0, 0)))
    if closed:
        padded[1:-1, 0], padded[1:-1, -1] = face[:, -1], face[:, 0]
    total = padded[:-1, :-1] + padded[:-1, 1:] + padded[1:, :-1] + padded[1:, 1:]
    if closed:  # at a pole all vertices are one
        for row in (0, -1):
            if np.ptp(points[row], axis=0).max() < 1e-9:
                total[row] = total[row].sum(axis=0)
    return unit(total + 1e-30)

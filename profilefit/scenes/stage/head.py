"""A head made of formulas: a displaced ellipsoid with a face, two thin ears, a neck, and a band that floats before it.

Millimetres; x to the head's left (the picture's right), y up, z out of the face; the origin in the middle of the skull.
"""

from __future__ import annotations

import numpy as np

from mcml_sim.media.arrays import Floats
from profilefit.scenes.stage.world import Mesh, parameters, sheet

SKULL = np.array([72.0, 104.0, 88.0])  # semi-axes
ROUNDNESS = 2.5  # power of the skull's superellipsoid: 2 is an egg, more a box
# Bumps of the face, pushed out along z: (x, y, half width, half height, amount), x < 0 mirrored by `TWICE`.
ONCE = (
    (0.0, 4.0, 6.0, 15.0, 9.0),  # bridge of the nose
    (0.0, -10.0, 7.5, 12.0, 14.0),  # its back
    (0.0, -20.0, 8.0, 6.5, 14.0),  # its tip
    (0.0, -43.0, 24.0, 16.0, 4.0),  # the mouth's mound
    (0.0, -42.5, 15.0, 3.6, 4.5),  # upper lip
    (0.0, -54.0, 13.0, 4.2, 6.0),  # lower lip
    (0.0, -48.2, 20.0, 1.7, -5.5),  # between them
    (0.0, -35.0, 2.6, 4.5, -1.8),  # philtrum
    (0.0, -63.0, 16.0, 4.0, -3.0),  # above the chin
    (0.0, -78.0, 17.0, 12.0, 10.0),  # chin
    (0.0, 20.0, 6.0, 6.0, -2.0),  # between the brows
)
TWICE = (
    (24.0, 23.0, 19.0, 6.5, 7.0),  # brow
    (29.0, 8.0, 13.0, 9.5, -12.0),  # eye socket
    (29.0, 6.5, 9.5, 7.0, 9.0),  # eye under its lid
    (29.0, 3.4, 11.0, 1.3, -2.2),  # where the lids meet
    (42.0, -12.0, 16.0, 13.0, 6.0),  # cheekbone
    (32.0, -42.0, 10.0, 14.0, -3.0),  # hollow of the cheek
    (10.5, -22.0, 5.0, 5.0, 8.0),  # nostril's wing
    (5.0, -27.5, 3.0, 2.4, -5.0),  # nostril
    (17.0, -32.0, 3.0, 9.0, -1.6),  # fold beside the mouth
)


def head(detail: int = 1) -> Mesh:
    """Return the skull and face; `detail` multiplies rows and columns."""
    u, v = parameters(256 * detail, 384 * detail)
    direction = ball(u, v)
    box = np.sum(np.abs(direction) ** ROUNDNESS, axis=-1, keepdims=True) ** (-1.0 / ROUNDNESS)
    points = direction * box * SKULL
    points[..., 0] *= 1.0 - 0.28 * _rise(-points[..., 1], -5.0, 90.0)  # towards the chin
    points[..., 2] *= 1.0 - 0.12 * _rise(-points[..., 1], 30.0, 100.0)
    x, y, z = np.moveaxis(points, -1, 0)
    push = np.zeros_like(x)  # of the face along z; the back of the head is left alone
    for bump in ONCE:
        push += _bump(x, y, *bump)
    for bump in TWICE:
        push += _bump(x, y, *bump) + _bump(-x, y, *bump)
    points[..., 2] += push * _rise(z, 5.0, 45.0)
    return sheet(points, u, v, closed=True)


def ear(side: int, detail: int = 1) -> Mesh:
    """Return a plate of 5 mm with a thicker rim, flared out; side -1 at the picture's left, 1 at its right."""
    u, v = parameters(64 * detail, 96 * detail)
    direction = ball(u, v)
    x, y, z = np.moveaxis(direction, -1, 0)
    radius = np.hypot(y, z)
    width = 1.0 + 0.28 * y  # narrower below
    thick = 2.4 * np.sign(x) * np.abs(x) ** 0.6 * (1.0 + 1.2 * np.exp(-(((radius - 0.86) / 0.12) ** 2)))
    bowl = -4.0 * (1.0 - radius**2) * _rise(1.0 - radius, 0.0, 0.5)
    plate = np.stack([thick + bowl, 31.0 * y, 19.0 * width * z], axis=-1)
    c, s = np.cos(np.radians(-48.0)), np.sin(np.radians(-48.0))
    points = plate @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]).T + np.array([75.0, 2.0, -16.0])
    points[..., 0] *= side
    mesh = sheet(points, u, v, closed=True)
    return mesh if side > 0 else Mesh(mesh.position, -mesh.normal, mesh.uv, mesh.triangles[:, ::-1])


def neck(detail: int = 1) -> Mesh:
    """Return a column from inside the jaw down, which widens towards the shoulders."""
    u, v = parameters(64 * detail, 128 * detail)
    angle, y = 2.0 * np.pi * u, -190.0 + 150.0 * v
    radius = 50.0 + 70.0 * _rise(-y, 130.0, 200.0) ** 2
    points = np.stack([radius * np.sin(angle), y, -22.0 + 0.95 * radius * np.cos(angle)], axis=-1)
    return sheet(points, u, v, closed=True)


def band(detail: int = 1, radius: float = 122.0, height: float = 11.0, thickness: float = 1.6) -> Mesh:
    """Return a strip that runs around the brow at a distance, aslant; light shines through it."""
    u, v = parameters(16 * detail, 384 * detail)
    angle, around = 2.0 * np.pi * u, 2.0 * np.pi * v
    out = 0.5 * thickness * _squared(np.cos(around), 0.35)
    up = 0.5 * height * _squared(np.sin(around), 0.35)
    ring = radius + out
    points = np.stack([ring * np.sin(angle), up, 0.95 * ring * np.cos(angle)], axis=-1)
    c, s = np.cos(np.radians(-14.0)), np.sin(np.radians(-14.0))
    turned = points @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T + np.array([0.0, 52.0, 2.0])
    return sheet(turned, u, v, closed=True)


def ball(u: Floats, v: Floats) -> Floats:
    """Return the unit vectors; u around y from the back, so that its seam is there, and v from the lowest point up."""
    around, up = 2.0 * np.pi * (u - 0.5), np.pi * (v - 0.5)
    return np.stack([np.cos(up) * np.sin(around), np.sin(up), np.cos(up) * np.cos(around)], axis=-1)


def _bump(x: Floats, y: Floats, at_x: float, at_y: float, width: float, height: float, amount: float) -> Floats:
    return amount * np.exp(-(((x - at_x) / width) ** 2) - ((y - at_y) / height) ** 2)


def _rise(value: Floats, low: float, high: float) -> Floats:
    """Return a smooth rise from 0 at low to 1 at high."""
    t = np.clip((value - low) / (high - low), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def _squared(value: Floats, power: float) -> Floats:
    """Return a circle's coordinate bent towards that of a square."""
    return np.sign(value) * np.abs(value) ** power

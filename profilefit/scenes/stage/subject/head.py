"""A head made of formulas: skull, face and neck as one solid, two thin ears, and a visor that stands off the brow.

Millimetres; x to the head's left (the picture's right), y up, z out of the face; the origin in the middle of the skull.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import map_coordinates

from mcml_sim.media.arrays import Floats
from profilefit.scenes.stage.subject.eye import CORNERS, EYE, EYEBALL, FISSURE, lids, rise
from profilefit.scenes.stage.subject.solid import carved, ellipsoid, ends, joined, rod
from profilefit.scenes.stage.world import Mesh, Part, parameters, sheet

ROWS, COLUMNS = 400, 480  # of the head's mesh
FARTHEST = 220.0  # of the head from its middle
MIDLINE = 1.5  # within which both halves are rounded into one
ROOT, FLARE, LEAN = (63.5, -3.0, 0.0), 36.0, 10.0  # front of the ear; its angles to the head and backward [degrees]
MIDDLE, THICK = (14.0, 1.0), 3.0  # of the ear: behind its front, and up; of its plate
OUTLINE = (
    *((35.0, 6.0), (33.5, 18.0), (27.0, 28.0), (17.0, 32.5), (8.0, 29.0), (2.5, 20.0), (0.0, 9.0)),
    *((-2.0, -4.0), (-0.5, -16.0), (3.0, -26.0), (10.0, -31.0), (17.5, -28.0), (24.0, -19.0), (31.0, -8.0)),
)
# Cropped hair begins above these heights, at depths [mm].
HAIRLINE = (
    (-80.0, -40.0, -14.0, 0.0, 14.0, 34.0, 50.0, 60.0, 72.0),
    (-52.0, -46.0, -30.0, -8.0, -2.0, 30.0, 60.0, 70.0, 74.0),
)
BROW = CubicSpline([8.0, 14.0, 22.0, 32.0, 42.0, 54.0], [24.0, 26.3, 28.3, 30.0, 28.8, 22.0])  # height over x [mm]
HAIR, DARK = 0.6, (0.06, 0.042, 0.03)  # thickness [mm] and A of hair
STRAP, BRIM = 50.0, 66.0  # height of the visor's brim [mm]; how far it goes round to either side [degrees]
MOUTH, LIP_END = 92.0, 29.0  # depth at which the lips are drawn, as seen from the middle, and x of their ends there
LID = 13.4  # radius of the eyes' lids
LEVEL, ROW = 4.5, 3.5  # middle of rows that follow the lids' edges, and how far those are from it


@cache
def head(detail: int = 1) -> Mesh:
    """Return skull, face and throat; `detail` multiplies rows and columns."""
    u, v = parameters(ROWS * detail, COLUMNS * detail)
    half = slice(COLUMNS * detail // 2, None)
    way = direction(u[:, half], v[:, half])
    right = way * ends(_head, way, FARTHEST)[..., None]
    left = right[:, :0:-1] * [-1.0, 1.0, 1.0]
    return sheet(np.concatenate([left, right], axis=1), u, v, closed=True)


def direction(u: Floats, v: Floats) -> Floats:
    """Return unit vectors from the middle of the head; u around from the back, v from below; the face takes most."""
    around = np.interp(u, *_spread(180.0, 0.0, 45.0, 2.2))
    up = np.interp(v, *_spread(90.0, -10.0, 42.0, 2.2))
    around, up = np.radians(around), np.radians(up)
    x, y, z = np.cos(up) * np.sin(around), np.sin(up), np.cos(up) * np.cos(around)
    before = z > 0.5
    y[before] += _along_lids(x[before], y[before], z[before])
    way = np.stack([x, y, z], axis=-1)
    return way / np.linalg.norm(way, axis=-1, keepdims=True)


def _along_lids(x: Floats, y: Floats, z: Floats) -> Floats:
    """Return how far up points move, so that a row follows the upper lid's edge, and one the lower's."""
    across, top, bottom = lids(x, y, z)
    height = y * FISSURE / z
    above, below = top + 0.4 - (LEVEL + ROW), bottom - 0.4 - (LEVEL - ROW)
    share = np.clip((height - LEVEL + ROW) / (2.0 * ROW), 0.0, 1.0)
    fade = np.exp(-((np.maximum(np.abs(height - LEVEL) - ROW, 0.0) / 15.0) ** 2))
    fade *= rise(across, 4.0, 17.0) * rise(-across, -68.0, -54.0)
    return fade * (below + (above - below) * share) * z / FISSURE


@cache
def _spread(most: float, middle: float, width: float, more: float) -> tuple[Floats, Floats]:
    """Return shares in [0, 1] and the angles from -most to most, closer together around the middle [degrees]."""
    angle = np.linspace(-most, most, 4001)
    density = 1.0 + more * np.exp(-(((angle - middle) / width) ** 4))
    share = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]))])
    return share / share[-1], angle


def hair(detail: int = 1) -> Part:
    """Return brows and cropped hair: a head that is a little larger where they are, and else inside the skin."""
    mesh = head(detail)
    x, y, z = points = mesh.position.T
    away, thick = brow(np.abs(x), y)
    share = (z > 30.0) * (thick > 0.0) * np.exp(-((away / np.maximum(thick, 0.5)) ** 4))
    strokes = np.sin(1.5 * np.abs(x) + 1.1 * away) * np.sin(0.7 * np.abs(x) - 1.3 * away + 1.0)
    grown = np.maximum(share - 0.3 * (0.7 + strokes), crop(points, 2.0 * np.sin(0.9 * y + 2.0 * np.sin(0.4 * z))))
    moved = points * (1.0 + (grown - 0.5) * HAIR / np.linalg.norm(points, axis=0))
    colour = np.random.default_rng(5).uniform(0.4, 1.6, (512, 1024, 1)) * DARK
    return Part(replace(mesh, position=moved.T), colour.astype(np.float32), roughness=0.7, is_translucent=False)


def crop(points: NDArray[Any], noise: NDArray[Any] | float = 0.0) -> Floats:
    """Return the share of cropped hair in [0, 1] at points (3, ...), whose line wanders by a noise [mm]."""
    _, y, z = points
    return rise(y - np.interp(z, *HAIRLINE) + noise, -3.0, 5.0)


@cache
def texels(columns: int) -> NDArray[np.float32]:
    """Return points (3, columns / 2, columns) at the middles of a texture's texels over the head [mm]."""
    grid = head().position.reshape(ROWS + 1, COLUMNS + 1, 3).astype(np.float32)
    rows = columns // 2
    at_v, at_u = ((np.arange(n) + 0.5) / n * size for n, size in ((rows, ROWS), (columns, COLUMNS)))
    at = np.meshgrid(at_v, at_u, indexing="ij")
    return np.stack([map_coordinates(grid[..., axis], at, order=1) for axis in range(3)])


def brow(out: NDArray[Any], y: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the height above the eyebrow's middle, so far out from the nose, and half its thickness, 0 beyond [mm]."""
    middle = BROW(np.clip(out, 8.0, 54.0))
    thick = np.interp(out, [8.9, 9.0, 11.0, 20.0, 36.0, 50.0, 53.0, 53.1], [0.0, 2.5, 3.8, 4.2, 3.4, 1.6, 0.8, 0.0])
    return y - middle, thick


def lips(points: NDArray[Any]) -> tuple[Floats, Floats]:
    """Return the share of the lips' red in [0, 1] at points (3, ...), and the height above the lips' line [mm]."""
    x, y, z = points
    deep = np.maximum(z, 1.0)
    across, height = np.abs(x) * MOUTH / deep, y * MOUTH / deep
    share = np.clip(across / LIP_END, 0.0, 1.0)
    thick = np.sqrt(np.maximum(1.0 - share**2.2, 0.0))
    middle = _between_lips(across)
    top = middle + 8.2 * thick**1.3 - 1.2 * np.exp(-((across / 3.5) ** 2))
    outside = np.maximum(np.maximum(height - top, middle - 10.2 * thick - height), across - LIP_END)
    return rise(z, 20.0, 50.0) * rise(-outside, -0.5, 1.0), height - middle


def _between_lips(across: Floats) -> Floats:
    return -64.0 - 0.8 * np.exp(-((across / 5.0) ** 2)) - 7.0 * np.clip(across / LIP_END, 0.0, 1.0) ** 2


def _head(points: Floats) -> Floats:
    points = mirrored(points)
    _, y, z = points
    solid = _skull(points)
    front = (z > -5.0) & (y < 70.0) & (y > -130.0)
    if front.any():
        solid[front] = _face(points[:, front], solid[front])
    return solid


def mirrored(points: Floats) -> Floats:
    """Return points (3, n) with x > 0 on both sides, smooth in the middle [mm]."""
    return np.stack([np.sqrt(points[0] ** 2 + MIDLINE**2), points[1], points[2]])


def _skull(p: Floats) -> Floats:
    """Return cranium, jaw and neck, without a face."""
    s = ellipsoid(p, (0, 36, -10), (74, 82, 98))
    s = joined(s, ellipsoid(p, (0, 42, 20), (65, 60, 70)), 20)  # forehead
    s = joined(s, ellipsoid(p, (0, -28, 24), (56, 78, 61)), 24)  # face
    s = joined(s, rod(p, (40, -66, 4), (15, -93, 62), (13, 14)), 18)  # jaw
    s = joined(s, rod(p, (50, -20, -2), (40, -66, 4), (14, 13)), 18)
    s = joined(s, _neck(p) + 0.2, 10)
    return carved(s, p[1] + 150.0, 8)  # below is the neck's mesh


def _neck(p: Floats) -> Floats:
    s = rod(p, (0, -60, -26), (0, -230, -34), (50, 55))
    s = joined(s, rod(p, (40, -50, -30), (12, -190, 18), (11, 9)), 18)
    s = joined(s, rod(p, (0, -150, -50), (120, -220, -45), (40, 34)), 40)  # towards the shoulder
    return joined(s, ellipsoid(p, (0, -142, 22), (9, 13, 9)), 16)


def _face(p: Floats, s: Floats) -> Floats:
    s = joined(s, ellipsoid(p, (0, -92, 71), (18, 13, 15)), 16)  # chin
    s = joined(s, ellipsoid(p, (47, -12, 48), (15, 13, 18), (0, 25, 0)), 26)  # cheekbone
    s = joined(s, ellipsoid(p, (33, -34, 58), (18, 22, 19)), 18)  # cheek
    s = joined(s, rod(p, (6, 24, 82), (30, 29, 76), (8, 7.5)), 14)  # brow
    s = joined(s, rod(p, (30, 29, 76), (52, 20, 54), (7.5, 5)), 16)
    s = carved(s, ellipsoid(p, (31, 4, 92), (17, 10, 12.5)), 10)  # eye socket
    s = carved(s, ellipsoid(p, (17.5, 5, 91), (5, 8, 9)), 9)  # its inner corner
    s = _nose(p, s)
    s = _mouth(p, s)
    return _eye(p, s)


def _nose(p: Floats, s: Floats) -> Floats:
    s = joined(s, ellipsoid(p, (0, -30, 80), (18, 17, 15)), 10)
    s = joined(s, rod(p, (0, 15, 82), (0, -26, 98), (7.0, 8.0)), 10)  # back
    s = joined(s, ellipsoid(p, (0, -31.5, 102), (9.5, 8.5, 10)), 7)  # tip
    s = joined(s, ellipsoid(p, (11.5, -35.5, 91), (6.2, 6.8, 10), (0, -20, 0)), 4)  # wing
    s = joined(s, rod(p, (0, -38.5, 104), (0, -44, 92), (2.8, 4)), 3)  # between the nostrils
    return carved(s, ellipsoid(p, (6.6, -43.5, 97), (3.2, 4.6, 6.5), (0, -15, 0)), 2)  # nostril


def _mouth(p: Floats, s: Floats) -> Floats:
    x, y, z = p
    s = joined(s, ellipsoid(p, (0, -60, 61), (30, 27, 31.0)), 14)
    s = carved(s, rod(p, (0, -45, 97), (0, -56, 97.5), (3.4, 3.4)), 3)  # philtrum
    s += 1.3 * _mark(p, ((17, -33), (28, -45), (35, -62)), 4.2)  # fold beside the mouth
    s = carved(s, rod(p, (0, -81, 97), (14, -82, 92), (7, 5)), 9)  # above the chin
    # Lips are drawn as seen from the middle of the head, so that each ray leaves them once.
    across, height = x * MOUTH / np.maximum(z, 1.0), y * MOUTH / np.maximum(z, 1.0)
    out = np.clip(across / LIP_END, 0.0, 1.0)
    depth = 89.8 - 11.0 * out**2
    middle = _between_lips(across)
    thick = np.sqrt(np.maximum(1.0 - out**2.2, 0.0))
    upper = np.hypot(height - middle - 4.0 * thick, 0.8 * (z - depth)) - 0.4 - 4.3 * thick
    lower = np.hypot(height - middle + 5.0 * thick, 0.8 * (z - depth + 0.8)) - 0.4 - 5.2 * thick
    s = joined(s, np.minimum(upper, lower) + np.maximum(across - LIP_END, 0.0), 4.0)
    line = np.maximum(np.abs(height - middle) - 0.4, depth - 1.5 - z)
    return carved(s, line + np.maximum(across - LIP_END + 1.0, 0.0), 1.2)


def _eye(p: Floats, s: Floats) -> Floats:
    x, y, z = p
    across, top, bottom = lids(x, y, z)
    height = y * FISSURE / np.maximum(z, 1.0)
    near = rise(across, 15.0, 28.0) * rise(-across, -62.0, -40.0)
    s = joined(s, ellipsoid(p, EYE, (LID, LID, LID)), 5)
    s -= near * 1.6 * np.exp(-(((height - top - 10.0) / 4.5) ** 2))  # above the lid
    s += near * 1.3 * np.exp(-(((height - top - 4.6) / 1.3) ** 2))  # its fold
    s += near * 0.7 * np.exp(-(((height - bottom + 7.0) / 2.0) ** 2))  # below the lower lid
    ball = np.sqrt(np.sum((p - np.reshape(EYE, (3, 1))) ** 2, axis=0))
    slit = np.maximum(np.maximum(height - top, bottom - height), np.maximum(CORNERS[0] - across, across - CORNERS[1]))
    s = carved(s, np.maximum(slit, ball - 20.0), 0.9)
    return joined(s, ball - (EYEBALL - 0.7), 0.3)


def _mark(p: Floats, line: tuple[tuple[float, float], ...], width: float) -> Floats:
    """Return 1 on a broken line over x and y, 0 far from it."""
    x, y, _ = p
    nearest = np.full_like(x, np.inf)
    for (a, b), (c, d) in pairwise(line):
        share = np.clip(((x - a) * (c - a) + (y - b) * (d - b)) / ((c - a) ** 2 + (d - b) ** 2), 0.0, 1.0)
        nearest = np.minimum(nearest, (x - a - share * (c - a)) ** 2 + (y - b - share * (d - b)) ** 2)
    return np.asarray(np.exp(-nearest / width**2))


def ear(side: int, detail: int = 1) -> Mesh:
    """Return a plate of 3 mm with a rolled rim, a bowl and a lobe, flared out; side -1 at the picture's left."""
    u, v = parameters(128 * detail, 192 * detail)
    turn, around = np.pi * v, 2.0 * np.pi * (u % 1.0)
    edge = _outline(around)
    share = np.sin(turn) ** 0.9
    back, up = MIDDLE[0] + edge * share * np.cos(around), MIDDLE[1] + edge * share * np.sin(around)
    before = 0.5 + 0.5 * np.sign(np.cos(turn)) * np.abs(np.cos(turn)) ** 0.5
    out = _bowl(back, up) + before * (THICK + _relief(back, up, (1.0 - share) * edge, around))
    c, s = np.cos(np.radians(LEAN)), np.sin(np.radians(LEAN))
    back, up = c * back + s * up, c * up - s * back
    c, s = np.cos(np.radians(FLARE)), np.sin(np.radians(FLARE))
    points = np.stack([c * out + s * back, up, s * out - c * back], axis=-1) + np.array(ROOT)
    points[..., 0] *= side
    mesh = sheet(points, u, v, closed=True)
    return mesh if side < 0 else Mesh(mesh.position, -mesh.normal, mesh.uv, mesh.triangles[:, ::-1])


def _outline(around: Floats) -> Floats:
    """Return the distance from the ear's middle to its edge, at angles from behind over the top [mm]."""
    back, up = np.array(OUTLINE).T - np.array(MIDDLE)[:, None]
    angle, far = np.unwrap(np.arctan2(up, back)), np.hypot(back, up)
    curve = CubicSpline(np.append(angle, angle[0] + 2.0 * np.pi), np.append(far, far[0]), bc_type="periodic")
    return np.asarray(curve(around))


def _bowl(back: Floats, up: Floats) -> Floats:
    """Return how far front and back of the plate stand out [mm]."""
    inside = np.hypot((back - 12.0) / 11.0, (up + 2.0) / 13.0)
    return np.asarray(-8.0 * np.exp(-(inside**4)) - 0.06 * np.maximum(9.0 - back, 0.0) ** 2)


def _relief(back: Floats, up: Floats, rim: Floats, around: Floats) -> Floats:
    """Return what stands out of the plate's front, at distances from its edge [mm]."""

    def hill(at: tuple[float, float], wide: float, tall: float) -> Floats:
        return np.asarray(np.exp(-(((back - at[0]) / wide) ** 2) - ((up - at[1]) / tall) ** 2))

    angle = np.degrees(around)
    rolled = rise(angle, -1.0, 0.0) * np.interp(angle, [0, 140, 205, 235, 300, 330, 360], [1, 1, 0, 0, 0.1, 0.9, 1])
    anti = np.interp(angle, [0, 60, 110, 130, 230, 270, 300, 360], [1, 0.9, 0.4, 0, 0, 0.5, 1, 1])
    total = rolled * (3.4 * np.exp(-(((rim - 2.2) / 1.9) ** 2)) - 1.6 * np.exp(-(((rim - 6.3) / 2.2) ** 2)))
    total += anti * 3.2 * np.exp(-(((rim - 11.0) / 2.6) ** 2))
    total *= rise(np.hypot(back - MIDDLE[0], up - MIDDLE[1]), 0.0, 4.0)  # in the middle all angles are one
    total += 4.6 * hill((0.5, -5.0), 3.6, 5.0)  # tragus
    total += 3.6 * hill((13.0, -15.5), 4.5, 3.0)  # antitragus
    total += 2.6 * hill((6.0, 6.0), 6.0, 2.4)  # foot of the helix
    return np.asarray(total + 1.6 * hill((12.0, -24.0), 8.0, 6.0))  # lobe


def neck(detail: int = 1) -> Mesh:
    """Return a column from inside the jaw down, which widens towards the shoulders."""
    u, v = parameters(64 * detail, 128 * detail)
    angle, y = 2.0 * np.pi * u, -230.0 + 112.0 * v
    way = np.stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)], axis=-1)
    origin = np.stack([np.zeros_like(y), y, np.full_like(y, -26.0)], axis=-1)
    radius = ends(lambda p: _neck(mirrored(p)), way, FARTHEST, origin)
    radius -= 2.0 * rise(y, -124.0, -118.0)  # its upper end is inside the head
    return sheet(origin + way * radius[..., None], u, v, closed=True)


def band(detail: int = 1, thickness: float = 1.6) -> Mesh:
    """Return the brim of a visor, which stands off the brow; light shines through it."""
    u, v = parameters(192 * detail, 48 * detail)
    angle, around = np.radians(BRIM) * (2.0 * v - 1.0), 2.0 * np.pi * (u % 1.0)
    width = 40.0 * np.cos(0.5 * np.pi * (2.0 * v - 1.0)) ** 0.6
    out = width * (0.5 - 0.5 * _squared(np.cos(around), 0.8))
    x, z = (75.0 + out) * np.sin(angle), (92.0 + out) * np.cos(angle) - 4.0
    arch = -0.0016 * x**2 - 0.06 * out - 0.00004 * x**2 * out
    y = STRAP + arch + 0.5 * thickness * _squared(np.sin(around), 0.5) * np.minimum(width, 1.0)
    return sheet(np.stack([x, y, z], axis=-1), u, v, closed=True)


def strap(detail: int = 1) -> Mesh:
    """Return the visor's strap around the skull."""
    u, v = parameters(32 * detail, 192 * detail)
    angle, around = 2.0 * np.pi * (u % 1.0), -2.0 * np.pi * (v % 1.0)
    way = np.stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)], axis=-1)
    up = STRAP + 10.0 + 12.0 * _squared(np.sin(around), 0.4)
    origin = np.stack([np.zeros_like(up), up, np.full_like(up, -10.0)], axis=-1)
    radius = ends(lambda p: _skull(mirrored(p)), way, FARTHEST, origin)
    radius += 1.0 - 1.6 * _squared(np.cos(around), 0.4)
    points = origin + way * radius[..., None]
    points[..., 1] += 0.1 * (points[..., 2] - 80.0)
    return sheet(points, u, v, closed=True)


def ball(u: Floats, v: Floats) -> Floats:
    """Return the unit vectors; u around y from the back, so that its seam is there, and v from the lowest point up."""
    around, up = 2.0 * np.pi * (u - 0.5), np.pi * (v - 0.5)
    return np.stack([np.cos(up) * np.sin(around), np.sin(up), np.cos(up) * np.cos(around)], axis=-1)


def _squared(value: Floats, power: float) -> Floats:
    """Return a circle's coordinate bent towards that of a square."""
    return np.sign(value) * np.abs(value) ** power

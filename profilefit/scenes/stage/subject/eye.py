"""Eyes of a head: balls that look at the camera, their texture, and the curves of their lids.

Millimetres on the head: x to its left, y up, z out of the face.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from mcml_sim.media.arrays import Floats
from profilefit.scenes.stage.world import Mesh, Part, parameters, sheet

EYE, EYEBALL = (31.5, 5.0, 73.0), 12.0  # middle of the left one, and its radius
FISSURE = 85.0  # depth at which the lids' curves are drawn, as seen from the middle of the head
CORNERS = 20.0, 51.0  # x of the lids' corners there
GAZE = np.radians(-9.0)  # to the picture's left
# Angles from the middle of the pupil [degrees]: ends of pupil and iris.
PUPIL, IRIS = 11.5, 29.0
WET = 0.12  # roughness


def eye(side: int, detail: int = 1) -> Mesh:
    """Return an eyeball, whose pole v = 1 looks ahead; side -1 at the picture's left, 1 at its right."""
    u, v = parameters(48 * detail, 64 * detail)
    polar, around = np.pi * (1.0 - v), -2.0 * np.pi * u  # u from the top
    x, y, z = np.sin(polar) * np.sin(around), np.sin(polar) * np.cos(around), np.cos(polar)
    radius = EYEBALL * (1.0 + 0.05 * rise(z, 0.86, 0.97))  # of the cornea more
    c, s = np.cos(GAZE), np.sin(GAZE)
    points = np.stack([c * x + s * z, y, c * z - s * x], axis=-1) * radius[..., None]
    return sheet(points + np.array(EYE) * [side, 1, 1], u, v, closed=True)


def eyes(detail: int = 1) -> tuple[Part, Part]:
    """Return both eyes, whose light is Lambert's."""
    left, right = (Part(eye(side, detail), iris(), WET, is_translucent=False) for side in (-1, 1))
    return left, right


@cache
def iris(columns: int = 256, seed: int = 3) -> NDArray[np.float32]:
    """Return (2 columns, columns, 3) A of an eyeball [-]."""
    random = np.random.default_rng(seed)
    v, u = np.meshgrid((np.arange(2 * columns) + 0.5) / (2 * columns), np.arange(columns) / columns, indexing="ij")
    polar = np.degrees(np.pi * (1.0 - v))

    def streaks(length: float, width: float) -> Floats:
        field = gaussian_filter(random.standard_normal(v.shape), (length, width), mode=("nearest", "wrap"))
        return np.asarray(field / field.std())

    def up_to(end: float) -> Floats:
        return np.asarray(1.0 - rise(polar, end - 1.5, end + 1.5))[..., None]

    vessels = rise(polar, 45.0, 100.0) * np.clip(streaks(24.0, 1.2), 0.0, 2.0)
    white = np.array([0.56, 0.49, 0.45]) - vessels[..., None] * [0.04, 0.12, 0.12]
    bright = (1.0 + 0.45 * streaks(14.0, 0.8)) * (0.85 + 0.4 * np.exp(-(((polar - 15.0) / 5.0) ** 2)))
    colour = white + (np.clip(bright[..., None] * [0.17, 0.13, 0.09], 0.02, 1.0) - white) * up_to(IRIS)
    ring = 1.0 - 0.75 * np.exp(-(((polar - IRIS + 0.5) / 2.2) ** 2))
    under_lid = 1.0 - 0.6 * rise(polar, 18.0, 60.0) * (0.5 + 0.5 * np.cos(2.0 * np.pi * u)) ** 2
    colour *= (ring * under_lid)[..., None] * (1.0 - 0.97 * up_to(PUPIL))
    return np.clip(colour, 0.004, 0.98).astype(np.float32)


def lids(x: NDArray[Any], y: NDArray[Any], z: NDArray[Any]) -> tuple[NDArray[Any], ...]:
    """Return, as seen from the middle of the head, x of a point before the eye, and y of the lids' edges there."""
    across = np.abs(x) * FISSURE / np.maximum(z, 1.0)
    share = np.clip((across - CORNERS[0]) / (CORNERS[1] - CORNERS[0]), 0.0, 1.0)  # from the inner corner to the outer
    arch = np.sqrt(np.maximum(share * (1.0 - share), 0.0)) * 2.0
    tilt = 2.6 + 2.6 * share
    return across, tilt + 5.7 * arch**1.15 * (1.12 - 0.24 * share), tilt - 4.2 * arch**1.2 * (0.8 + 0.4 * share)


def rise(value: NDArray[Any], low: float, high: float) -> NDArray[Any]:
    """Return a smooth rise from 0 at low to 1 at high."""
    t = np.clip((value - low) / (high - low), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)

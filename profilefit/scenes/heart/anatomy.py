"""Shape and colours of a heart, by formulas over directions from its middle. Both are made up after anatomy.

x to the right as one faces it, y up, z to the front; the apex points to the right and to the front.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from mcml_sim.media.arrays import Floats
from profilefit.scenes.stage.world import Singles, unit

Points = Sequence[Sequence[float]]
# Arteries on the wall, through directions; how far they stand out and their half width [radius].
ANTERIOR = (0.16, 0.55, 0.8), (0.22, 0.2, 0.97), (0.2, -0.2, 0.97), (0.32, -0.6, 0.75), (0.36, -0.92, 0.3)
RIGHT = (-0.02, 0.62, 0.75), (-0.3, 0.42, 0.85), (-0.62, 0.2, 0.75), (-0.9, -0.05, 0.4), (-0.85, -0.2, -0.4)
CIRCUMFLEX = (0.22, 0.55, 0.8), (0.6, 0.5, 0.6), (0.92, 0.3, 0.2), (0.85, 0.1, -0.5)
DIAGONAL = (0.23, 0.1, 0.97), (0.52, -0.15, 0.85), (0.62, -0.5, 0.6)
MARGINAL = (-0.72, 0.1, 0.68), (-0.5, -0.3, 0.81), (-0.15, -0.6, 0.78)
POSTERIOR = (0.1, 0.5, -0.85), (0.1, -0.2, -0.97), (0.3, -0.8, -0.5)
ARTERIES: tuple[tuple[Points, float, float], ...] = (
    (ANTERIOR, 0.030, 0.050),
    (RIGHT, 0.026, 0.055),
    (CIRCUMFLEX, 0.024, 0.050),
    (DIAGONAL, 0.020, 0.040),
    (((0.2, -0.2, 0.97), (0.45, -0.42, 0.8), (0.5, -0.7, 0.5)), 0.017, 0.035),
    (MARGINAL, 0.018, 0.038),
    (((0.2, 0.2, 0.97), (-0.1, 0.12, 0.98), (-0.32, -0.02, 0.94)), 0.014, 0.030),
    (POSTERIOR, 0.026, 0.050),
)
VEINS = ANTERIOR, DIAGONAL, MARGINAL, POSTERIOR  # beside arteries
# Pulmonary trunk, aorta and vena cava: direction, height and half width [radius], reflectance.
GREAT = (
    ((0.22, 0.88, 0.50), 0.42, 0.200, (0.72, 0.42, 0.36)),
    ((-0.12, 0.97, -0.10), 0.62, 0.230, (0.72, 0.42, 0.36)),
    ((-0.60, 0.80, -0.25), 0.40, 0.150, (0.40, 0.26, 0.38)),
)
# Atria and ventricles: direction, height and width [radius].
CHAMBERS = (
    ((-0.75, 0.42, 0.45), 0.10, 0.42),
    ((0.72, 0.5, 0.25), 0.12, 0.34),
    ((-0.2, -0.1, 0.95), 0.06, 0.6),
    ((0.75, -0.35, 0.4), 0.07, 0.6),
)
MUSCLE, FAT, ARTERY, VEIN = (0.46, 0.115, 0.085), (0.80, 0.60, 0.30), (0.52, 0.10, 0.09), (0.24, 0.10, 0.16)
BESIDE = 0.045, 0.02, 0.0  # from an artery to its vein [radius]
LEAST, MOST = 0.01, 0.92  # of a reflectance


def wall(towards: Floats) -> Floats:
    """Return points (..., 3) of the wall in unit directions (..., 3) [about 1, the great vessels reach 1.6]."""
    out = np.ones(towards.shape[:-1])
    for at, height, width in CHAMBERS:
        out += height * _bump(towards, at, width)
    around = np.minimum(_from_line(towards, RIGHT), _from_line(towards, CIRCUMFLEX))
    between = np.minimum(_from_line(towards, ANTERIOR), _from_line(towards, POSTERIOR))
    out -= 0.085 * np.exp(-((around / 0.13) ** 2)) + 0.05 * np.exp(-((between / 0.13) ** 2))
    wound = _wound(towards, 0.03, 11.0)
    x, y, z = np.moveaxis(wound, -1, 0)
    lobes = np.sin(31.0 * x + 2.0 * np.sin(17.0 * y)) * np.sin(29.0 * y + 2.0 * np.sin(19.0 * z))
    out += 0.04 * fat(towards) * (1.0 + 0.25 * lobes * np.sin(27.0 * z + 1.0))
    for line, height, width in ARTERIES:
        out += height * np.exp(-((_from_line(wound, line) / width) ** 2))
    for at, height, width, _ in GREAT:
        out += height * _disc(towards, at, width, 0.028)
    apex = np.clip(-towards[..., 1], 0.0, 1.0)
    across = 1.0 - 0.34 * apex**2
    shape = out[..., None] * towards * np.array([0.88, 1.0, 0.80])
    lean = np.stack([0.30 * apex**1.5, 0.0 * apex, 0.12 * apex**1.5], axis=-1)
    return np.asarray(shape * np.stack([across, np.ones_like(across), across], axis=-1) + lean)


def fat(towards: Floats) -> Floats:
    """Return how much fat lies on the wall in directions, from 0 to 1 (...): in grooves and about the great vessels."""
    wound = _wound(towards, 0.05, 7.0)
    around = np.minimum(_from_line(wound, RIGHT), _from_line(wound, CIRCUMFLEX))
    between = np.minimum(_from_line(wound, ANTERIOR), _from_line(wound, POSTERIOR))
    total = np.exp(-((around / 0.2) ** 4)) + 0.8 * np.exp(-((between / 0.11) ** 4))
    for line, width in ((MARGINAL, 0.07), (DIAGONAL, 0.06)):
        total += 0.5 * np.exp(-((_from_line(wound, line) / width) ** 4))
    return np.asarray(np.clip(total + 0.9 * _bump(towards, (0.0, 0.85, 0.35), 0.42) ** 2, 0.0, 1.0))


def colours(towards: Floats) -> Singles:
    """Return reflectances A (..., 3) in directions: muscle with fibres, fat, arteries, veins, and the great vessels."""
    spots, grains = _noise(towards, 14.0, 1), _noise(towards, 45.0, 2)
    fibres = np.sin(60.0 * (towards[..., 1] + 0.6 * towards[..., 0]) + 4.0 * _noise(towards, 6.0, 4))
    found = np.array(MUSCLE) * ((1.0 + 0.14 * spots + 0.10 * grains) * (1.0 + 0.07 * fibres))[..., None]
    share = 1.0 / (1.0 + np.exp(-(fat(towards) - 0.45 + 0.18 * spots + 0.12 * grains) / 0.08))
    found = _over(found, np.array(FAT) * (1.0 + 0.06 * grains)[..., None], share)
    wound = _wound(towards, 0.03, 11.0)
    for line, _, width in ARTERIES:
        found = _over(found, ARTERY, 0.85 * np.exp(-((_from_line(wound, line) / (0.75 * width)) ** 4)))
    beside = _wound(unit(towards + np.array(BESIDE)), 0.03, 11.0)
    for line in VEINS:
        found = _over(found, VEIN, 0.8 * np.exp(-((_from_line(beside, line) / 0.033) ** 4)))
    thin = np.exp(-((_noise(_wound(towards, 0.1, 5.0), 11.0, 7) / 0.055) ** 2))
    found = _over(found, ARTERY, 0.4 * thin * np.clip(0.6 - np.abs(_noise(towards, 5.0, 8)), 0.0, 1.0))
    for at, _, width, colour in GREAT:
        share = _disc(towards, at, width + 0.025, 0.02)
        found = _over(found, np.array(colour) * (1.0 + 0.07 * grains)[..., None], share)
    return np.clip(found, LEAST, MOST).astype(np.float32)


def _over(below: Floats, above: Floats | Sequence[float], share: Floats) -> Floats:
    return below + (np.asarray(above) - below) * share[..., None]


def _bump(towards: Floats, at: Sequence[float], width: float) -> Floats:
    return np.exp(-np.sum((towards - unit(at)) ** 2, axis=-1) / width**2)


def _disc(towards: Floats, at: Sequence[float], width: float, edge: float) -> Floats:
    """Return 1 in a disc about a direction and 0 outside, with a soft edge."""
    chord = np.linalg.norm(towards - unit(at), axis=-1)
    return 1.0 / (1.0 + np.exp(np.clip((chord - width) / edge, -60.0, 60.0)))


def _wound(towards: Floats, amount: float, often: float) -> Floats:
    """Return directions aside of these, so that lines wind."""
    return unit(towards + amount * np.sin(often * np.roll(towards, 1, axis=-1)))


def _noise(towards: Floats, often: float, seed: int) -> Floats:
    """Return a sum of ten waves of random directions, of about unit variance."""
    random = np.random.default_rng(seed)
    waves = often * random.uniform(0.6, 1.4, (10, 1)) * unit(random.standard_normal((10, 3)))
    return np.sin(towards @ waves.T + random.uniform(0.0, 2.0 * np.pi, 10)).sum(axis=-1) / np.sqrt(5.0)


def _from_line(towards: Floats, line: Points) -> Floats:
    """Return chords from directions to the nearest of a line of great circles' arcs, small ones exactly (...)."""
    points = unit(line)
    nearest = np.full(towards.shape[:-1], np.inf)
    for point in points:
        nearest = np.minimum(nearest, np.linalg.norm(towards - point, axis=-1))
    for start, end in itertools.pairwise(points):
        pole = unit(np.cross(start, end))
        ahead, behind = np.cross(pole, start), np.cross(end, pole)
        beside = (towards @ ahead > 0.0) & (towards @ behind > 0.0)
        nearest = np.where(beside, np.minimum(nearest, np.abs(towards @ pole)), nearest)
    return nearest

"""Materials of translucent parts: measured ones under the light of a setting; and their texture.

A reflectance texture of skin is drawn by formulas: blotches, freckles of a millimetre, finer stubble. A texture
(rows, columns, 3) lies over the head's u and v; row 0 is at v = 0. Fixed seeds: the same texture everywhere.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import gaussian_filter

from mcml_sim import Setting, exact
from mcml_sim.media.arrays import Floats, require
from profilefit.materials import BY_NAME
from profilefit.recipes.declared import Range
from profilefit.scenes.skin.truth import albedo_of
from profilefit.scenes.stage.exact_law import DIFFUSE
from profilefit.scenes.stage.world import Rgb, rgb

AROUND, UP = 500.0, 320.0  # lengths that u and v in [0, 1] span on the head [mm], near its middle
FRECKLES, HAIRS = 1500, 9000
# What is left of A in red, green and blue at the heart of a freckle, and under a hair.
FRECKLE = np.array([0.62, 0.46, 0.36])
HAIR = np.array([0.30, 0.28, 0.30])
LIPS = np.array([0.98, 0.62, 0.72])


@dataclass(frozen=True)
class Translucent:
    """Material of red, green, blue: alpha [-], transport mean free path [mm], reflectance A [-]."""

    name: str
    alpha: Rgb
    mfp: Rgb
    reflectance: Rgb


@dataclass(frozen=True)
class Painted:
    """Ranges of a painted material, least and most of red, green, blue.

    reflectance  A [-];  mfp  transport mean free path [mm]
    """

    reflectance: tuple[Range, Range, Range]
    mfp: tuple[Range, Range, Range]

    @classmethod
    def even(cls, reflectance: Iterable[float], mfp: Iterable[float]) -> Painted:
        """Return a material of one A and one mean free path a colour."""
        first, second = (rgb(np.fromiter(values, float)) for values in (reflectance, mfp))
        (a, b, c), (d, e, f) = (tuple((one, one) for one in values) for values in (first, second))
        return cls((a, b, c), (d, e, f))

    def middle(self, setting: Setting = DIFFUSE) -> Translucent:
        """Return the material in the middle of the ranges: mean A, geometric mean of the mean free paths."""
        reflectance = np.mean(self.reflectance, axis=1)
        alpha = [albedo_of(one, setting) for one in reflectance.tolist()]
        return Translucent("painted", rgb(alpha), rgb(np.prod(np.sqrt(self.mfp), axis=1)), rgb(reflectance))


def translucent(name: str = "skin1", setting: Setting = DIFFUSE) -> Translucent:
    """Return a material of Jensen et al. (2001), table 1; its A is that of the exact half space in a setting."""
    require(name in BY_NAME, "material", f"one of {', '.join(BY_NAME)}", name)
    alpha = np.array(BY_NAME[name].alpha)
    return Translucent(name, rgb(alpha), rgb(BY_NAME[name].mfp), rgb(np.asarray(exact.reflectance(alpha, setting))))


def skin(reflectance: ArrayLike, columns: int = 2048, seed: int = 7) -> NDArray[np.float32]:
    """Return (columns / 2, columns, 3) A in (0, 1) [-] around the given one of red, green and blue."""
    rng = np.random.default_rng(seed)
    rows, pixel = columns // 2, AROUND / columns
    blotches = _noise(rng, rows, columns, 9.0 / pixel)[..., None] * [0.05, 0.11, 0.12]  # large and reddish
    blotches += _noise(rng, rows, columns, 0.5 / pixel)[..., None] * [0.05, 0.06, 0.06]  # small and grey
    texture = np.asarray(reflectance, float) * (1.0 + blotches)
    v, u = np.meshgrid((np.arange(rows) + 0.5) / rows, (np.arange(columns) + 0.5) / columns, indexing="ij")
    lips = np.exp(-((((u - 0.5) / 0.038) ** 2 + ((v - 0.345) / 0.021) ** 2) ** 2))
    texture = _blend(texture, LIPS, lips)
    texture = _blend(texture, FRECKLE, _dots(rng, rows, columns, FRECKLES, _freckled, (0.5, 1.5)))
    texture = _blend(texture, HAIR, _dots(rng, rows, columns, HAIRS, _bearded, (0.16, 0.24)))
    return np.clip(texture, 0.005, 0.98).astype(np.float32)


def plain(reflectance: ArrayLike) -> NDArray[np.float32]:
    """Return (1, 1, 3) the same A everywhere."""
    return np.asarray(reflectance, np.float32).reshape(1, 1, 3)


def _blend(texture: Floats, left: Floats, share: Floats) -> Floats:
    """Multiply A by `left` where share is 1, by 1 where it is 0."""
    return texture * (1.0 + (left - 1.0) * share[..., None])


def _noise(rng: np.random.Generator, rows: int, columns: int, width: float) -> Floats:
    field = gaussian_filter(rng.standard_normal((rows, columns)), width, mode=("nearest", "wrap"))
    return field / field.std()


def _dots(rng: np.random.Generator, rows: int, columns: int, number: int, chance, radii: tuple[float, float]) -> Floats:
    """Return (rows, columns) in [0, 1]: soft discs, more where chance(u, v) is high; radii [mm] from ... to."""
    u, v, kept = rng.random((3, number * 3))
    chosen = np.flatnonzero(kept < chance(u, v))[:number]
    radius, depth = rng.uniform(*radii, chosen.size), rng.uniform(0.4, 1.0, chosen.size)
    left = np.ones((rows, columns))
    for i, r, strength in zip(chosen, radius, depth, strict=True):
        squeeze = max(np.sin(np.pi * v[i]), 0.2)  # a row of the texture is shorter near the poles
        tall, wide = r / UP * rows, r / (AROUND * squeeze) * columns
        y, x = v[i] * rows, u[i] * columns
        ys = np.arange(max(int(y - 3 * tall), 0), min(int(y + 3 * tall) + 2, rows))
        xs = np.arange(int(x - 3 * wide), int(x + 3 * wide) + 2)
        disc = np.exp(-((((ys + 0.5 - y) / tall) ** 2)[:, None] + ((xs + 0.5 - x) / wide) ** 2))
        left[np.ix_(ys, xs % columns)] *= 1.0 - strength * disc
    return 1.0 - left


def _freckled(u: Floats, v: Floats) -> Floats:
    """Return the chance of a freckle, on cheeks and nose."""
    return 0.06 + 0.94 * np.exp(-(((u - 0.5) / 0.13) ** 2) - ((v - 0.47) / 0.07) ** 2)


def _bearded(u: Floats, v: Floats) -> Floats:
    """Return the chance of stubble, on chin, jaw and upper lip, not the lips."""
    jaw = np.exp(-(((u - 0.5) / 0.22) ** 4) - ((v - 0.27) / 0.10) ** 4)
    return jaw * (np.hypot((u - 0.5) / 0.045, (v - 0.345) / 0.025) > 1.0)

"""Materials of translucent parts: measured ones under the light of a setting, and painted ones."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcml_sim import Setting, exact
from mcml_sim.media.arrays import require
from profilefit.materials import BY_NAME
from profilefit.recipes.declared import Range
from profilefit.scenes.skin.truth import albedo_of
from profilefit.scenes.stage.exact_law import DIFFUSE
from profilefit.scenes.stage.world import Rgb, rgb


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


def plain(reflectance: ArrayLike) -> NDArray[np.float32]:
    """Return (1, 1, 3) the same A everywhere."""
    return np.asarray(reflectance, np.float32).reshape(1, 1, 3)

"""What a translucent thing of the render is made of: a measured material, seen under the light of a setting."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mcml_sim import Setting, exact
from profilefit.errors import InputError
from profilefit.materials import BY_NAME
from profilefit.scenes.stage.exact_law import DIFFUSE
from profilefit.scenes.stage.world import Rgb


@dataclass(frozen=True)
class Translucent:
    """alpha single-scattering albedo [-], mfp transport mean free path [mm], reflectance A [-]: red, green, blue."""

    name: str
    alpha: Rgb
    mfp: Rgb
    reflectance: Rgb


def translucent(name: str = "skin1", setting: Setting = DIFFUSE) -> Translucent:
    """A material of Jensen et al. (2001), table 1; its A is that of the exact half space in a matched setting."""
    if name not in BY_NAME:
        raise InputError(f"material must be one of {', '.join(BY_NAME)}, got {name!r}")
    alpha = np.array(BY_NAME[name].alpha)
    return Translucent(name, _rgb(alpha), _rgb(BY_NAME[name].mfp), _rgb(exact.reflectance(alpha, setting)))


def _rgb(values) -> Rgb:
    red, green, blue = (float(value) for value in values)
    return red, green, blue

"""What filters make of the step edge: sums over their taps, which follow the surface as the stage's do."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from profilefit.choose.case import Case
from profilefit.choose.gaussian_filter import OneGaussian, fitted
from profilefit.choose.options import Option
from profilefit.choose.truth import Truth
from profilefit.shader.stage.scattering import FOLLOW
from profilefit.shader.stage.separable_kernel import Separable, kernel_quartile

Floats = NDArray[np.float64]


def passes(option: Option, case: Case, light: Truth) -> list[tuple[Floats, Separable, Floats]]:
    """Each filter of an option: its share of each channel (3,), itself, and its stretches (3,) in the case's unit."""
    shares = [light.beyond(a) for a in case.filter_reflectance]
    mfp = np.array(case.mfp)
    if option.kind == "separable":
        kernel = Separable(setting=light.setting)
        own = np.array([kernel_quartile(strength) for strength in kernel.strength])
        return [(np.ones(3), kernel, mfp * np.array([share.quartile for share in shares]) / own)]
    of_channels = [fitted(share, option.count) for share in shares]
    found: list[tuple[Floats, Separable, Floats]] = []
    for k in range(option.count):
        share = np.array([weight[k] for weight, _ in of_channels])
        sigma = np.array([s[k] for _, s in of_channels]) * mfp
        red, green, blue = sigma.tolist()
        found.append((share, OneGaussian(setting=light.setting, sigma=(red, green, blue)), sigma))
    return found


def filtered(option: Option, case: Case, light: Truth, channel: int, x: Floats) -> Floats:
    """L / A of a channel at places x (m,) on the lit side."""
    total = np.zeros(x.shape)
    for share, kernel, stretches in passes(option, case, light):
        taps = kernel.taps(option.number, stretches).astype(float)
        place = x[:, None] + taps[:, 3]
        lost = np.zeros(place.shape)
        if not case.is_flat:
            middle = (np.floor(place / case.pixel) + 0.5) * case.pixel  # what is seen is a pixel's middle
            seen = np.abs(middle) < case.radius
            depth = np.sqrt(np.maximum(case.radius**2 - middle**2, 0.0)) - np.sqrt(case.radius**2 - x[:, None] ** 2)
            lost = np.where(seen, np.minimum(FOLLOW / np.max(stretches) * np.abs(depth), 1.0), 1.0)
        lit = np.where(place > 0, 1.0, lost)
        total += share[channel] * (lit @ taps[:, channel])
    return total

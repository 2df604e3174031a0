"""What filters make of the step edge: sums over their taps, which follow the surface as the stage's do.

A few Gaussians, each blurred with on its own along rows and columns, are what a profile's step edge is nearest to:

    F(d) = sum_k w_k Q(d / sigma_k),    Q the upper tail of the normal distribution (d'Eon and Luebke, GPU Gems 3, 14)

Weights and widths are fitted to the light beyond a straight edge, within 6 mean free paths of it, for one albedo.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.special import ndtr

from profilefit.scenes.skin.law import FOLLOW, Separable, kernel_quartile
from profilefit.scenes.stage.world import Rgb
from profilefit.studies.choose.case import Case
from profilefit.studies.choose.options import Option
from profilefit.studies.choose.response import Beyond
from profilefit.studies.choose.truth import Truth

Floats = NDArray[np.float64]
FITTED = 6.0 * ((np.arange(60) + 0.5) / 60) ** 2  # distances [mfp], closer together at the edge
REACH = 3.0  # of the taps, in the widest sigma


@dataclass(frozen=True)
class OneGaussian(Separable):
    """A filter that is one Gaussian: sigma of red, green and blue [mm]."""

    sigma: Rgb = (1.0, 1.0, 1.0)

    def stretches(self, alpha: Floats, mfp: Floats) -> Floats:
        """The widths themselves: the fit knew albedo and mean free path."""
        return np.array(self.sigma)

    def taps(self, number: int, stretches: Floats) -> NDArray[np.float32]:
        """(taps, 4): what a channel's Gaussian holds nearest to each tap, and offset [mm]."""
        even = np.linspace(-1.0, 1.0, number | 1)
        offset = REACH * float(np.max(stretches)) * np.sign(even) * even**2
        between = np.concatenate([[-np.inf], 0.5 * (offset[1:] + offset[:-1]), [np.inf]])
        weight = np.diff(ndtr(between[:, None] / np.asarray(stretches)), axis=0)
        return np.column_stack([weight, offset]).astype(np.float32)


@lru_cache(maxsize=256)
def fitted(share: Beyond, count: int) -> tuple[Floats, Floats]:
    """Weights (count,) of sum 1 [-] and sigmas (count,) [mfp]."""
    wanted = share(FITTED)
    quartile = np.interp(-0.25, -wanted, FITTED)

    def split(free: Floats) -> tuple[Floats, Floats]:
        share = np.exp(np.append(0.0, free[count:]))
        return share / share.sum(), np.exp(free[:count])

    def missed(free: Floats) -> Floats:
        weight, sigma = split(free)
        return ndtr(-FITTED[:, None] / sigma) @ weight - wanted

    first = np.log(quartile * np.geomspace(0.3, 4.0, count)) if count > 1 else np.log([1.5 * quartile])
    found = least_squares(missed, np.append(first, np.zeros(count - 1)), method="lm")
    return split(found.x)


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

"""A few Gaussians, each blurred with on its own along rows and columns: what a profile's step edge is nearest to.

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

from profilefit.choose.response import Beyond
from profilefit.shader.stage.material import Rgb
from profilefit.shader.stage.separable_kernel import Separable

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

"""Human skin as sums of Gaussians, the two sets that games still blur with: data, in millimetres.

Sources: E. d'Eon and D. Luebke, Advanced techniques for realistic real-time skin rendering, GPU Gems 3, ch. 14, 2007,
figure 14-13; J. Jimenez et al., Separable subsurface scattering, Computer Graphics Forum 34, 2015, with the authors'
own code (iryoku/separable-sss, SeparableSSS.cpp), which rounds pi to 3.14.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
CHANNELS = ("red", "green", "blue")


@dataclass(frozen=True)
class SkinGaussians:
    """R(r) = sum_i w_i G(r / f; v_i), G(r; v) = e^{-r^2 / 2 v} / (2 pi v), in each channel.

    variances  v_i [mm^2]; weights  w_i of red, green, blue [-]; stretches  f of red, green, blue [-]
    """

    variances: tuple[float, ...]
    weights: tuple[tuple[float, float, float], ...]
    stretches: tuple[float, float, float] = (1.0, 1.0, 1.0)

    def profile(self, r: ArrayLike) -> Floats:
        """R(r) [1/mm^2] of red, green, blue along a last axis, at radii [mm] of any shape."""
        scaled = np.asarray(r, float)[..., None] / np.array(self.stretches)
        variance = np.array(self.variances)[:, None]
        gaussians = np.exp(-(scaled[..., None, :] ** 2) / (2.0 * variance)) / (2.0 * np.pi * variance)
        return np.sum(np.array(self.weights) * gaussians, axis=-2)

    @property
    def energy(self) -> Floats:
        """Integral of 2 pi r R over all r, of red, green, blue [-]."""
        return np.sum(self.weights, axis=0) * np.square(self.stretches)


# White light in, white light out: each channel's weights sum to one, and an albedo texture multiplies.
D_EON = SkinGaussians(
    variances=(0.0064, 0.0484, 0.187, 0.567, 1.99, 7.41),
    weights=(
        (0.233, 0.455, 0.649),
        (0.100, 0.336, 0.344),
        (0.118, 0.198, 0.0),
        (0.113, 0.007, 0.007),
        (0.358, 0.004, 0.0),
        (0.078, 0.0, 0.0),
    ),
)
FALLOFF = (1.0, 0.37, 0.3)
"""The default of the authors' code for red, green, blue."""


def separable(falloff: tuple[float, float, float] = FALLOFF) -> SkinGaussians:
    """Jimenez et al.: the red Gaussians but the narrowest, in all channels, r / (0.001 + falloff).

    The narrowest they take for light that comes straight back. Nothing is normalised here (0.767 of red is left): their
    filter divides by the sum of its own samples.
    """
    red, _, _ = (np.array(D_EON.weights[1:]).T).tolist()
    stretches = (0.001 + falloff[0], 0.001 + falloff[1], 0.001 + falloff[2])
    return SkinGaussians(D_EON.variances[1:], tuple((w, w, w) for w in red), stretches)

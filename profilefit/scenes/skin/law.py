"""Laws that draw the head: samples of any profile law, or the separable kernel, stretched to its material.

Sampled are the laws of `profilefit.laws` that have a shader source, as fitted or printed, each by its own source; their
light is diffuse, their albedo that of each pixel's A, and (22) of Z. Liang et al. weighs the samples (`Gather`).

What each tap of the separable filter weighs in each channel: J. Jimenez et al., Separable subsurface scattering,
Computer Graphics Forum 34, 2015, and the authors' own code (iryoku/separable-sss, SeparableSSS.cpp, calculateKernel;
SeparableSSS.h, SSSSBlurPS). A slice through the skin profile is blurred with along rows, then along columns.

Human skin as sums of Gaussians, the two sets that games still blur with [mm]: E. d'Eon and D. Luebke, Advanced
techniques for realistic real-time skin rendering, GPU Gems 3, ch. 14, 2007, figure 14-13; J. Jimenez et al., as above,
whose code rounds pi to 3.14.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq
from scipy.special import erf

from mcml_sim import Setting
from mcml_sim.media.arrays import Floats, require
from profilefit.scenes.skin.truth import exact_quartile
from profilefit.scenes.stage.exact_law import DIFFUSE, require_isotropic
from profilefit.scenes.stage.world import Rgb
from profilefit.shader.emit import literal


@dataclass(frozen=True)
class SkinGaussians:
    """R(r) = sum_i w_i G(r / f; v_i), G(r; v) = e^{-r^2 / 2 v} / (2 pi v), in each channel.

    variances  v_i [mm^2]; weights  w_i of red, green, blue [-]; stretches  f of red, green, blue [-]
    """

    variances: tuple[float, ...]
    weights: tuple[tuple[float, float, float], ...]
    stretches: tuple[float, float, float] = (1.0, 1.0, 1.0)

    def profile(self, r: ArrayLike) -> Floats:
        """Return R(r) [1/mm^2] of red, green, blue along a last axis, at radii [mm] of any shape."""
        scaled = np.asarray(r, float)[..., None] / np.array(self.stretches)
        variance = np.array(self.variances)[:, None]
        gaussians = np.exp(-(scaled[..., None, :] ** 2) / (2.0 * variance)) / (2.0 * np.pi * variance)
        return np.sum(np.array(self.weights) * gaussians, axis=-2)


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
FALLOFF = (1.0, 0.37, 0.3)  # default of the authors' code for red, green, blue


def separable(falloff: tuple[float, float, float] = FALLOFF) -> SkinGaussians:
    """Return the kernel of Jimenez et al.: the red Gaussians but the narrowest, in all channels, r / (0.001 + falloff).

    The narrowest they take for light that comes straight back. Nothing is normalised here (0.767 of red is left): their
    filter divides by the sum of its own samples.
    """
    red, _, _ = (np.array(D_EON.weights[1:]).T).tolist()
    stretches = (0.001 + falloff[0], 0.001 + falloff[1], 0.001 + falloff[2])
    return SkinGaussians(D_EON.variances[1:], tuple((w, w, w) for w in red), stretches)


EXPONENT = 2.0  # of the taps' spacing: closer in the middle
# Reach in units of the skin profile, r / stretch: the authors' for many taps and for few.
REACH, SHORT_REACH, MANY = 3.0, 2.0, 20
# What the five Gaussians of the kernel hold of the red skin profile; the sixth and narrowest is light that comes
# straight back.
STRENGTH = float(np.sum(D_EON.weights, axis=0)[0] - D_EON.weights[0][0])
DARKEST = 1e-4  # an albedo below has no light to blur; its width is that of this one
# Share of a tap that its depth takes, per depth in units of the kernel: the authors' 300 / tan(10 degrees) times a
# width of 0.0125 scene units, the middle of their slider, of which the kernel's unit is a third.
FOLLOW = 300.0 / np.tan(np.radians(10.0)) * 0.0125**2 / 3.0


@dataclass(frozen=True)
class Separable:
    """Kernel as wide as a profile of a setting; strength is the share of red, green, blue that is blurred [-]."""

    strength: Rgb = (STRENGTH, STRENGTH, STRENGTH)
    setting: Setting = DIFFUSE

    def __post_init__(self) -> None:
        are_shares = len(self.strength) == 3 and all(0 < share <= 1 for share in self.strength)
        require(are_shares, "strength", "three shares in (0, 1]", self.strength)
        require_isotropic(self.setting)

    def stretches(self, alpha: Floats, mfp: Floats) -> Floats:
        """Return the unit (3,) [mm] by which the kernel lets an edge rise to 3/4 where the exact profile does."""
        exact = [exact_quartile(max(a, DARKEST), self.setting) for a in np.asarray(alpha).tolist()]
        own = [kernel_quartile(share) for share in self.strength]
        return np.asarray(mfp, float) * np.array(exact) / np.array(own)

    def taps(self, number: int, stretches: Floats) -> NDArray[np.float32]:
        """Return (taps, 4) weights of red, green and blue, each of sum 1, and offset [mm]; an odd number of taps."""
        count = number | 1
        if count == 1:
            return np.array([[1.0, 1.0, 1.0, 0.0]], np.float32)
        reach = REACH if count > MANY else SHORT_REACH
        even = np.linspace(-1.0, 1.0, count)
        offset = reach * np.sign(even) * np.abs(even) ** EXPONENT
        widest = float(np.max(stretches))
        falloff = tuple(float(s / widest) - 0.001 for s in stretches)  # `separable` adds it
        area = 0.5 * (np.diff(offset, prepend=offset[0]) + np.diff(offset, append=offset[-1]))
        weight = area[:, None] * separable((falloff[0], falloff[1], falloff[2])).profile(np.abs(offset))
        weight *= np.array(self.strength) / weight.sum(axis=0)
        weight[count // 2] += 1.0 - np.array(self.strength)
        return np.column_stack([weight, offset * widest]).astype(np.float32)


def kernel_quartile(strength: float) -> float:
    """Return that distance of the kernel, in its unit: its line spread is its slice, 1 - strength stays in place."""
    require(strength > 0.5, "strength", "> 0.5: a kernel that blurs less is as wide as no material", strength)
    gaussians = separable((0.999, 0.999, 0.999))
    sigma = np.sqrt(gaussians.variances)
    share = np.array([w[0] for w in gaussians.weights]) / sigma
    share /= share.sum()

    def within(distance: float) -> float:
        return 1.0 - strength + strength * float(np.sum(share * erf(distance / (np.sqrt(2.0) * sigma)))) - 0.5

    return float(brentq(within, 0.0, 10.0))


def transmitted() -> str:
    """Return GLSL of the share of the light within x, in units of the stretch: cdf of the red skin profile."""
    gaussians = separable()
    weights = np.array([w[0] for w in gaussians.weights])
    terms = " + ".join(
        f"{literal(float(w))} * exp(-x * x * {literal(0.5 / v)})"
        for w, v in zip(weights / weights.sum(), gaussians.variances, strict=True)
    )
    return f"1.0 - ({terms})"

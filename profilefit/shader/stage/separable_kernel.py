"""The kernel of Jimenez et al.'s separable filter, as wide as a material: what each tap weighs in each channel.

Source: J. Jimenez et al., Separable subsurface scattering, Computer Graphics Forum 34, 2015, and the authors' own code
(iryoku/separable-sss, SeparableSSS.cpp, calculateKernel; SeparableSSS.h, SSSSBlurPS). A slice through the skin profile
is blurred with along rows, then along columns.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import erf

from mcml_sim import Setting, exact
from profilefit.errors import InputError
from profilefit.laws.skin_gaussians import D_EON, separable
from profilefit.shader.emit import literal
from profilefit.shader.stage.material import DIFFUSE, Rgb

Floats = NDArray[np.float64]
EXPONENT = 2.0  # of the taps' spacing: closer in the middle
# Reach in units of the skin profile, r / stretch: the authors' for many taps and for few.
REACH, SHORT_REACH, MANY = 3.0, 2.0, 20
# What the five Gaussians of the kernel hold of the red skin profile; the sixth and narrowest is light that comes
# straight back.
STRENGTH = float(np.sum(D_EON.weights, axis=0)[0] - D_EON.weights[0][0])
PUBLISHED_STRENGTH = (0.48, 0.41, 0.28)
"""The default of the authors' code for red, green, blue: an artist's choice, too weak for a width to be matched."""
DARKEST = 1e-4  # an albedo below has no light to blur; its width is that of this one
RADII = 4000


@dataclass(frozen=True)
class Separable:
    """As wide as a profile: strength, the share of the light that is blurred, of red, green, blue [-]; its setting."""

    strength: Rgb = (STRENGTH, STRENGTH, STRENGTH)
    setting: Setting = DIFFUSE

    def __post_init__(self) -> None:
        if len(self.strength) != 3 or not all(0 < share <= 1 for share in self.strength):
            raise InputError(f"strength must be three shares in (0, 1], got {self.strength!r}")

    def stretches(self, alpha: Floats, mfp: Floats) -> Floats:
        """(3,) lengths [mm] of the kernel's unit: a step edge rises to 3/4 where it does under the exact profile."""
        wanted = [exact_quartile(max(a, DARKEST), self.setting) for a in np.asarray(alpha).tolist()]
        own = [kernel_quartile(share) for share in self.strength]
        return np.asarray(mfp, float) * np.array(wanted) / np.array(own)

    def taps(self, number: int, stretches: Floats) -> NDArray[np.float32]:
        """(taps, 4): weights of red, green and blue, each of sum 1, and offset [mm]; an odd number of taps."""
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


@cache
def albedo_of(reflectance: float, setting: Setting) -> float:
    """alpha of the exact half space of reflectance A [-]."""
    share = min(max(reflectance, 0.0), 1.0)
    return float(brentq(lambda alpha: float(exact.reflectance(alpha, setting)) - share, 0.0, 1.0))


@cache
def exact_quartile(alpha: float, setting: Setting) -> float:
    """Distance [mfp] from a step edge at which the exact profile lets 3/4 of the light through.

    A radius r drawn by the profile, in a random direction, crosses an edge at distance q with the chance
    arccos(q / r) / pi; the mean over even shares of the energy is 1/4 there.
    """
    radius = np.asarray(exact.quantile((np.arange(RADII) + 0.5) / RADII, alpha, setting=setting))

    def crossed(distance: float) -> float:
        return float(np.mean(np.arccos(np.minimum(distance / radius, 1.0)))) / np.pi - 0.25

    return float(brentq(crossed, 0.0, radius[-1]))


def kernel_quartile(strength: float) -> float:
    """The same of the kernel, in its own unit: its line spread is its slice, and 1 - strength of it stays in place."""
    if not strength > 0.5:
        raise InputError(
            f"strength must be > 0.5: a kernel that blurs less is as wide as no material, got {strength!r}"
        )
    gaussians = separable((0.999, 0.999, 0.999))
    sigma = np.sqrt(gaussians.variances)
    share = np.array([w[0] for w in gaussians.weights]) / sigma
    share /= share.sum()

    def within(distance: float) -> float:
        return 1.0 - strength + strength * float(np.sum(share * erf(distance / (np.sqrt(2.0) * sigma)))) - 0.5

    return float(brentq(within, 0.0, 10.0))


def transmitted_text(name: str) -> str:
    """The shader text of the light left beyond x, in units of the stretch: 1 - cdf of the red skin profile."""
    gaussians = separable()
    weights = np.array([w[0] for w in gaussians.weights])
    terms = " + ".join(
        f"{literal(float(w))} * exp(-x * x * {literal(0.5 / v)})"
        for w, v in zip(weights / weights.sum(), gaussians.variances, strict=True)
    )
    return (
        f"struct {name}_Shape {{ float unused; }};\n"
        f"float {name}_alpha(float reflectance) {{ return reflectance; }}\n"
        f"{name}_Shape {name}_shape(float alpha) {{ {name}_Shape s; s.unused = alpha; return s; }}\n"
        f"float {name}_cumulated(float x, {name}_Shape s) {{ return 1.0 - ({terms}); }}\n"
    )

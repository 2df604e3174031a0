"""Layered media, and what their interfaces do to unpolarised light: Snell and Fresnel.

Functions of interfaces take numbers, numpy arrays or jax arrays, which broadcast, and keep their precision.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mcml_sim.errors import InputError
from mcml_sim.media import phase as phases
from mcml_sim.media.arrays import Floats, is_number, namespace, require, require_index, shown

MAX_LAYERS = 1000  # more than any published stack; a larger number is a slip of the pen


@dataclass(frozen=True)
class Layer:
    """Homogeneous plane layer. Any one unit of length; InputError on values that no physics allows.

    n          refractive index [-], > 0
    mu_a       absorption coefficient [1/length], >= 0
    mu_s       scattering coefficient [1/length], >= 0; 0 is clear glass
    g          mean cosine of the scattering angle [-], -1 < g < 1 (also 1 where nothing scatters)
    thickness  [length], > 0; infinite only for the last layer of a medium
    phase      a phase function of `mcml_sim.phase`, whose mean cosine g is then; None for Henyey and Greenstein's of g
    """

    n: float
    mu_a: float
    mu_s: float
    g: float
    thickness: float = math.inf
    phase: phases.Phase | None = None

    def __post_init__(self) -> None:
        if self.phase is not None:
            phases.settle(self)
        require_index("n", self.n)
        for name in ("mu_a", "mu_s"):
            value = getattr(self, name)
            require(is_number(value) and math.isfinite(value) and value >= 0, name, "a coefficient >= 0", value)
        if not math.isfinite(self.mu_t):
            raise InputError(f"mu_a + mu_s must be finite, got {shown(self.mu_a)} and {shown(self.mu_s)}")
        g, thick = self.g, self.thickness
        require(is_number(g) and (-1 < g < 1 or (g == 1 and self.mu_s == 0)), "g", "a mean cosine in (-1, 1)", g)
        require(is_number(thick) and thick > 0, "thickness", "> 0, or infinite in the last layer", thick)

    @property
    def mu_t(self) -> float:
        """Extinction coefficient mu_a + mu_s [1/length]."""
        return self.mu_a + self.mu_s

    @property
    def alpha(self) -> float:
        """Reduced albedo mu_s' / (mu_s' + mu_a), mu_s' = (1 - g) mu_s [-]; 0 in clear glass."""
        scattered = (1 - self.g) * self.mu_s
        return scattered / (scattered + self.mu_a) if self.mu_t else 0.0  # exactly 1 where nothing is absorbed

    @property
    def mfp(self) -> float:
        """Transport mean free path 1 / (mu_s' + mu_a) [length]; infinite in clear glass."""
        return 1 / ((1 - self.g) * self.mu_s + self.mu_a) if self.mu_t else math.inf

    @property
    def is_isotropic(self) -> bool:
        """Whether scattering has no preferred direction."""
        return self.g == 0 and self.phase is None

    @property
    def similar(self) -> Layer:
        """Isotropic layer of equal reduced scattering mu_s' = mu_s (1 - g), which looks the same from afar.

        Similarity is an approximation: it fails within a few mean free paths of the source.
        """
        return replace(self, mu_s=self.mu_s * (1 - self.g), g=0.0, phase=None)


@dataclass(frozen=True)
class Medium:
    """Layers from the surface down, and the refractive indices above and below them.

    Only the last layer may be infinitely thick; then there is no below, and n_below is not used.
    """

    layers: tuple[Layer, ...]
    n_above: float = 1.0
    n_below: float = 1.0

    def __post_init__(self) -> None:
        layers = tuple(self.layers) if isinstance(self.layers, (list, tuple)) else (self.layers,)
        object.__setattr__(self, "layers", layers)
        for layer in layers:
            require(isinstance(layer, Layer), "layers", "Layer objects", layer)
        if not 1 <= len(layers) <= MAX_LAYERS:
            raise InputError(f"a medium must have 1 to {MAX_LAYERS} layers, got {len(layers)}")
        require_index("n_above", self.n_above)
        require_index("n_below", self.n_below)
        for number, layer in enumerate(layers[:-1], start=1):
            if math.isinf(layer.thickness):
                raise InputError(f"thickness may be infinite in the last layer only, got it in layer {number}")
        if self.is_half_space and not layers[-1].mu_t:
            raise InputError("an infinitely thick layer must scatter or absorb, got mu_a = mu_s = 0")

    @property
    def is_half_space(self) -> bool:
        """Whether no light can come out below."""
        return math.isinf(self.layers[-1].thickness)

    @property
    def is_matched_isotropic_half_space(self) -> bool:
        """Whether the medium is one infinite layer that neither refracts at its surface nor prefers a direction."""
        (first, *others) = self.layers
        return not others and self.is_half_space and first.is_isotropic and first.n == self.n_above and first.mu_t > 0

    def with_first(self, thickness: float) -> Medium:
        """Return these layers under a first one of another thickness [length]."""
        first, *others = self.layers
        return replace(self, layers=(replace(first, thickness=thickness), *others))

    @property
    def z_edges(self) -> Floats:
        """Depths of the interfaces [length], (layers + 1,); the last may be infinite."""
        return np.concatenate([[0.0], np.cumsum([layer.thickness for layer in self.layers])])


def half_space(alpha: float, mfp: float = 1.0, n: float = 1.0, g: float = 0.0) -> Medium:
    """Return one infinite layer under air.

    Args:
        alpha: reduced albedo mu_s' / (mu_s' + mu_a), mu_s' = (1 - g) mu_s [-], 0 ... 1.
        mfp: transport mean free path 1 / (mu_s' + mu_a) [length].
        n: refractive index [-].
        g: mean cosine of the scattering angle [-].
    """
    require(is_number(alpha) and 0 <= alpha <= 1, "alpha", "a reduced albedo in [0, 1]", alpha)
    require(is_number(mfp) and math.isfinite(mfp) and mfp > 0, "mfp", "a transport mean free path > 0", mfp)
    require(is_number(g) and -1 < g < 1, "g", "a mean cosine in (-1, 1)", g)
    return Medium((Layer(n=n, mu_a=(1 - alpha) / mfp, mu_s=alpha / mfp / (1 - g), g=g),))


def fresnel(n1: Any, n2: Any, cos1: Any) -> tuple[Any, Any]:
    """Return the reflectance of an interface [-], and the cosine of the refracted ray to its normal [-].

    Args:
        n1: refractive index on the side the light comes from [-].
        n2: refractive index on the other side [-].
        cos1: cosine of the angle of incidence, 0 ... 1 [-].

    The mean of the two polarisations (Born & Wolf, Principles of Optics, sec. 1.5). Beyond the critical angle the
    reflectance is 1 and the refracted cosine 0; equal indices reflect nothing, at grazing incidence either.
    """
    xp = namespace(n1, n2, cos1)
    ratio = n1 / n2
    sine2_squared = ratio * ratio * ((1 - cos1) * (1 + cos1))
    cos2 = xp.sqrt(xp.maximum(1 - sine2_squared, 0))
    total, matched = cos2 == 0, n1 == n2
    # Both polarisations by products, so that nothing is divided by zero at grazing incidence.
    in1, in2, across1, across2 = n1 * cos1, n2 * cos2, n1 * cos2, n2 * cos1
    s_sum, p_sum = in1 + in2, across1 + across2
    s_part, p_part = (in1 - in2) * p_sum, (across1 - across2) * s_sum
    denominator = s_sum * p_sum
    amplitude = xp.where(total | matched, 1, denominator)
    reflectance = (s_part * s_part + p_part * p_part) / (2 * amplitude * amplitude)
    reflectance = xp.where(matched, 0, xp.where(total, 1, reflectance))
    return reflectance.astype(cos2.dtype), xp.where(matched, cos1 + 0 * cos2, cos2)


def specular_reflectance(medium: Medium) -> float:
    """Return the share of the beam that the surface throws back at once [-] (Wang & Jacques 1995, sec. 3.2).

    Below a first layer of clear glass the light that goes to and fro inside the glass is counted too, all orders of
    it: r1 + (1 - r1)^2 r2 / (1 - r1 r2).
    """
    first, *others = medium.layers
    surface = normal_reflectance(medium.n_above, first.n)
    if first.mu_t > 0:
        return surface
    below = others[0].n if others else first.n if medium.is_half_space else medium.n_below
    back = normal_reflectance(first.n, below)
    return surface + (1 - surface) ** 2 * back / (1 - surface * back)


def normal_reflectance(n1: float, n2: float) -> float:
    """Return Fresnel's reflectance at normal incidence, ((n1 - n2) / (n1 + n2))^2 [-]."""
    return ((n1 - n2) / (n1 + n2)) ** 2

"""Formulas that Zhao et al. print for layered objects, as printed and with each misprint corrected.

Zhao et al., Real-time subsurface scattering rendering method for dynamic objects, Journal of Software (Ruan Jian Xue
Bao), 2010: single scattering is summed along the refracted eye ray, (3) to (9), multiple scattering is the dipole of
the first layer only, (10), and five weights set by hand add them up, (2).

Lengths in the unit of the medium. Outside lies the medium's index above; eta is the first layer's over it.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcml_sim.media.arrays import checked_whole
from mcml_sim.media.medium import Layer, Medium, fresnel
from profilefit.errors import InputError
from profilefit.laws.diffusion import diffuse_fresnel

Floats = NDArray[np.float64]
MOST_SAMPLES = 4096
# (2): of light that goes to and fro between surfaces, of mirrored and refracted light, of light scattered once and many
# times; the only ones printed (figure 7). In one unit of radiance every one of them is 1.
WEIGHTS = (0.3, 0.3, 0.05, 0.05, 0.3)


@dataclass(frozen=True)
class Corrections:
    """Misprints to correct: all of them by default.

    phase_sign  (8) has 1 + g cos for the angle between two directions of propagation, which makes g > 0 scatter back
    schlick     (8) has g where Schlick's form has k = 1.55 g - 0.55 g^3
    step        (5) is a sum without its step
    middle      samples lie in the middle of their steps, not at the near ends
    extinction  (6) has absorption alone, (9) scattering alone, for what both take away
    surface     (9) has neither the cosine of the light, nor refraction, nor what the surface lets in and out
    dipole_sign (10) has F = +1.440 / eta^2 + ..., whose image lies inside the body
    """

    phase_sign: bool = True
    schlick: bool = True
    step: bool = True
    middle: bool = True
    extinction: bool = True
    surface: bool = True
    dipole_sign: bool = True

    @classmethod
    def switches(cls) -> tuple[str, ...]:
        """Return the names of the corrections."""
        return tuple(field.name for field in fields(cls))


CORRECTED = Corrections()
PRINTED = Corrections(*(False for _ in fields(Corrections)))


def phase(cosine: ArrayLike, g: ArrayLike, corrections: Corrections = CORRECTED) -> Floats:
    """(8), p [1/sr] at the cosine of the angle between two directions of propagation; integrates to 1 either way."""
    g = np.asarray(g, float)
    k = 1.55 * g - 0.55 * g**3 if corrections.schlick else g
    sign = -1.0 if corrections.phase_sign else 1.0
    return (1.0 - k**2) / (4.0 * np.pi * (1.0 + sign * k * np.asarray(cosine, float)) ** 2)


def single_sum(
    medium: Medium,
    cos_in: float,
    cos_out: float,
    azimuth: float,
    samples: int,
    deepest: float,
    corrections: Corrections = CORRECTED,
) -> float:
    """(3) to (9): radiance outside [1/sr] for unit irradiance across the beam, from samples along the refracted ray.

    samples  1 ... 4096;  deepest  D_max, depth of the last step [length], which the paper does not give
    other arguments as for `single_scattering`; one index in all layers, InputError else
    """
    number = checked_whole("samples", samples, 1, MOST_SAMPLES)
    if not 0 < deepest < np.inf:
        raise InputError(f"deepest must be a depth > 0, got {deepest!r}")
    indices = {layer.n for layer in medium.layers}
    if len(indices) > 1:
        raise InputError(f"the paper's sum has one index in all layers, got {sorted(indices)}")
    (n,) = indices
    mirror_in, into = map(float, fresnel(medium.n_above, n, cos_in))
    mirror_out, out = map(float, fresnel(medium.n_above, n, cos_out))
    if not corrections.surface:
        into = cos_in  # the light enters where a straight line from it to the sample does
    length = deepest / (number * out)  # (4) over N: a step along the ray
    z = (np.arange(number) + (0.5 if corrections.middle else 0.0)) * length * out
    here = [_at(medium, depth) for depth in z]
    turned = np.sqrt((1 - into**2) * (1 - out**2)) * np.cos(azimuth) - into * out
    total = 0.0
    for depth, layer in zip(z, here, strict=True):
        absorbed, scattered = _depths(medium, depth)
        on_ray = absorbed + scattered if corrections.extinction else absorbed  # (6)
        from_light = absorbed + scattered if corrections.extinction else scattered  # (9)
        kept = np.exp(-on_ray / out - from_light / into)
        total += float(layer.mu_s * phase(turned, layer.g, corrections) * kept)  # (7)
    if corrections.step:
        total *= length
    if corrections.surface:
        passed = (1 - mirror_in) * (1 - mirror_out) * cos_in / into
        total *= passed * (medium.n_above / n) ** 2
    return total


def dipole(medium: Medium, r: ArrayLike, corrections: Corrections = CORRECTED) -> Floats:
    """(10): the dipole of the first layer [1/length^2], per light that has entered, at radii r >= 0.

    With similar isotropic scattering, mu_s' = mu_s (1 - g). Whatever lies below the first layer is not in it.
    """
    first = medium.layers[0].similar
    z, image, rate = _dipole(first, medium.n_above, corrections)
    total: Floats = np.zeros(np.shape(r))
    for height in (z, image):
        distance = np.hypot(np.asarray(r, float), height)
        total = total + height * (rate + 1 / distance) * np.exp(-rate * distance) / distance**2
    return first.alpha / (4 * np.pi) * total


def dipole_heights(medium: Medium, corrections: Corrections = CORRECTED) -> tuple[float, float]:
    """z_r and z_v of (10): depth of the source, and height of its image above the surface [length]."""
    z, image, _ = _dipole(medium.layers[0].similar, medium.n_above, corrections)
    return z, image


def _dipole(layer: Layer, n_above: float, corrections: Corrections) -> tuple[float, float, float]:
    eta = layer.n / n_above
    reflected = diffuse_fresnel(eta) + (0.0 if corrections.dipole_sign else 2 * 1.440 / eta**2)
    image = layer.mfp * (1 + 4 / 3 * (1 + reflected) / (1 - reflected))
    return layer.mfp, image, float(np.sqrt(3 * layer.mu_a * layer.mu_t))


def _at(medium: Medium, depth: float) -> Layer:
    number = int(np.searchsorted(medium.z_edges[1:-1], depth, side="right"))
    return medium.layers[number]


def _depths(medium: Medium, depth: float) -> tuple[float, float]:
    """Absorption and scattering passed on the way straight down [-]."""
    edges = medium.z_edges
    inside = np.clip(depth - edges[:-1], 0.0, np.diff(edges))
    absorbed = sum(layer.mu_a * part for layer, part in zip(medium.layers, inside, strict=True))
    scattered = sum(layer.mu_s * part for layer, part in zip(medium.layers, inside, strict=True))
    return float(absorbed), float(scattered)

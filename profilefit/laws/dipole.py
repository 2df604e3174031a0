"""The standard dipole, on which a decade of translucent rendering ran.

Source: H. W. Jensen, S. R. Marschner, M. Levoy and P. Hanrahan, A practical model for subsurface light transport,
SIGGRAPH 2001; its total reflectance: H. W. Jensen and J. Buhler, A rapid hierarchical rendering technique for
translucent materials, SIGGRAPH 2002, eq. 5.
"""

from __future__ import annotations

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from mcml_sim.media.setting import Setting
from profilefit.laws.diffusion import TEXT_ENDS, TEXT_PARTS, DiffusionLaw, flux, flux_within
from profilefit.laws.entry import ANY_INDEX, CLAMPS, Entry, Text
from profilefit.laws.rational import Normalisation


class Dipole(DiffusionLaw):
    """R_d = t alpha / (4 pi) sum over z of z (1 + sigma d) e^{-sigma d} / d^3, d^2 = x^2 + z^2, z = 1 and 1 + 4 K / 3.

    sigma = sqrt(3 (1 - alpha)), K = (1 + F_dr) / (1 - F_dr) (the paper's A), and F_dr the diffuse Fresnel reflectance
    inside, F_dr = -1.440 / n^2 + 0.710 / n + 0.668 + 0.0636 n (paper, sec. 2.1; 0.0016 at n = 1, where none is meant),
    for n < 1 -0.4399 + 0.7099 / n - 0.3319 / n^2 + 0.0636 / n^3 (Jensen and Buhler, sec. 2); t the share of the light
    that enters. Integrates to t alpha/2 (1 + e^{-4/3 K sigma}) e^{-sigma}, not to the reflectance of the half space.
    Its share within x is closed. Meant for alpha near 1 and x beyond 1; finite at x = 0, where the half space is not.
    """

    setting: Setting = eqx.field(static=True)
    albedo: Normalisation | None = eqx.field(static=True, default=None)
    entry = Entry("dipole", "dipole", n=ANY_INDEX, text=Text("dipole", TEXT_PARTS, TEXT_ENDS, CLAMPS))

    def text_numbers(self) -> dict[str, float]:
        """Return the share of the light that enters [-], and the height of the image [mfp]."""
        return {"entered": self.entered, "image": self.image}

    @property
    def image(self) -> float:
        """Height of the image above the surface z_v [mfp]."""
        reflected = diffuse_fresnel(self.setting.n)
        return 1.0 + 4.0 / 3.0 * (1.0 + reflected) / (1.0 - reflected)

    def prefactor(self, alpha: Array) -> Array:
        return alpha

    def shape_profile(self, x: Array, alpha: Array) -> Array:
        sigma = transport_rate(alpha)
        return flux(x, 1.0, sigma) + flux(x, self.image, sigma)

    def shape_energy(self, x: Array, alpha: Array) -> Array:
        sigma = transport_rate(alpha)
        return flux_within(x, 1.0, sigma) + flux_within(x, self.image, sigma)

    def source_strength(self, alpha: Array) -> Array:
        return jnp.zeros_like(alpha)


def transport_rate(alpha: Array) -> Array:
    """sigma_tr = sqrt(3 sigma_a sigma_t') for sigma_t' = 1 [1/mfp]."""
    return jnp.sqrt(3.0 * (1.0 - alpha))


def diffuse_fresnel(n: float) -> float:
    """F_dr of a surface of relative index n [-], the paper's fit."""
    if n < 1.0:
        return -0.4399 + 0.7099 / n - 0.3319 / n**2 + 0.0636 / n**3
    return -1.440 / n**2 + 0.710 / n + 0.668 + 0.0636 * n

"""The better dipole: the standard one with Grosjean's diffusion and a consistent surface.

Source: E. d'Eon, A better dipole, technical report, 2012; its parts: E. d'Eon and G. Irving, A quantized-diffusion
model for rendering translucent materials, SIGGRAPH 2011; its total reflectance: C. Hery, Texture mapping for the better
dipole model, Pixar Technical Memo 12-11, 2012.
"""

from __future__ import annotations

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from mcml_sim.media.setting import Setting
from profilefit.laws.diffusion import (
    TEXT_ENDS,
    TEXT_PARTS,
    DiffusionLaw,
    exitance_factors,
    fluence,
    fluence_within,
    flux,
    flux_within,
    grosjean,
)
from profilefit.laws.entry import ANY_INDEX, CLAMPS, Entry, Text
from profilefit.laws.rational import Normalisation


class BetterDipole(DiffusionLaw):
    """R_d = t alpha^2 (C_phi phi + C_E E): fluence phi and flux E of a source at depth 1 less its image, mixed.

    phi = (e^{-sigma d_r} / d_r - e^{-sigma d_v} / d_v) / (4 pi D), d^2 = x^2 + z^2, z_r = 1, z_v = 1 + 4 A D
    E = (z_r (1 + sigma d_r) e^{-sigma d_r} / d_r^3 + z_v (1 + sigma d_v) e^{-sigma d_v} / d_v^3) / (4 pi)
    D = (2 - alpha) / 3, sigma = sqrt((1 - alpha) / D)
    C_phi = (1 - 2 C_1) / 4, C_E = (1 - 3 C_2) / 2, A = (1 + 3 C_2) / (1 - 2 C_1), C_i Fresnel's moments inside

    Light scattered once is not in it (alpha^2, not alpha): the report adds it on its own. t is the share of the light
    that enters. Integrates to t alpha^2/2 e^{-sigma} (C_E (1 + e^{-4 A D sigma}) + C_phi (1 - e^{-4 A D sigma}) /
    (sigma D)), which is t at alpha = 1. Its share within x is closed. Finite at x = 0, where the half space is not.
    """

    setting: Setting = eqx.field(static=True)
    albedo: Normalisation | None = eqx.field(static=True, default=None)
    entry = Entry(
        "better_dipole", "better dipole", n=ANY_INDEX, text=Text("better_dipole", TEXT_PARTS, TEXT_ENDS, CLAMPS)
    )

    def text_numbers(self) -> dict[str, float]:
        """Return the share of light that enters, both factors of exitance, and the image's height over D less 1 [-]."""
        c_phi, c_e, mismatch = exitance_factors(self.setting.n)
        return {"entered": self.entered, "c_phi": c_phi, "c_e": c_e, "lift": 4.0 * mismatch}

    def image(self, alpha: Array) -> Array:
        """Height of the image above the surface z_v [mfp]."""
        return 1.0 + 4.0 * exitance_factors(self.setting.n)[2] * grosjean(alpha)[0]

    def prefactor(self, alpha: Array) -> Array:
        return alpha**2

    def shape_profile(self, x: Array, alpha: Array) -> Array:
        c_phi, c_e, _ = exitance_factors(self.setting.n)
        (diffusion, sigma), image = grosjean(alpha), self.image(alpha)
        inside = fluence(x, 1.0, sigma) - fluence(x, image, sigma)
        return c_phi / diffusion * inside + c_e * (flux(x, 1.0, sigma) + flux(x, image, sigma))

    def shape_energy(self, x: Array, alpha: Array) -> Array:
        c_phi, c_e, _ = exitance_factors(self.setting.n)
        (diffusion, sigma), image = grosjean(alpha), self.image(alpha)
        through = flux_within(x, 1.0, sigma) + flux_within(x, image, sigma)
        return c_phi / diffusion * fluence_within(x, 1.0, image, sigma) + c_e * through

    def source_strength(self, alpha: Array) -> Array:
        return jnp.zeros_like(alpha)

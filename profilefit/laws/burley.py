"""Normalized diffusion, the sum of two exponentials that most engines run, in its three published forms.

Source: P. Christensen and B. Burley, Approximate reflectance profiles for efficient subsurface scattering, Pixar
Technical Memo 15-04, 2015; exact inverse: E. Golubev, Sampling Burley's normalized diffusion profiles, 2019;
approximate inverse: T. Xie, M. Olano, B. Karis and K. Narkowicz, Real-time subsurface scattering with single pass
variance-guided adaptive importance sampling, I3D 2020.
"""

from __future__ import annotations

import abc

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from profilefit.laws.base import NEAR_CLAMPS, Entry, Normalisation, ProfileLaw, Range, Sampler, Text, evaluated

XIE = 2.5715
"""The c of Xie et al. (2020)."""
UNREAL = 2.6
"""The c that Unreal Engine ships (BurleyNormalizedSSSCommon.ush, RadiusRootFindByApproximation)."""
# Newton from the left on a curve whose slope stays within [2, 3]: the third step reaches the last bit.
NEWTON_STEPS = 4
# In falloff lengths; at this radius every exponential is 0, and below it nothing overflows.
FARTHEST = 3000.0
ENDS = ("normalized_diffusion", "wrappers")  # of both texts


class BurleySampler(Sampler):
    """x = 3 ln((1 + G^{-1/3} + G^{1/3}) / (4 u)) / q,  u = 1 - xi,  G = 1 + 4 u (2 u + sqrt(1 + 4 u^2))   (Golubev)."""

    law: NormalizedDiffusion

    def scaled_sample(self, xi: Array, alpha: Array) -> Array:
        u = 1.0 - xi
        root = jnp.cbrt(1.0 + 4.0 * u * (2.0 * u + jnp.sqrt(1.0 + 4.0 * u**2)))
        t = 3.0 * jnp.log((1.0 + 1.0 / root + root) / (4.0 * u))
        return t / self.law.falloff_rate(alpha)

    def scaled_pdf(self, x: Array, alpha: Array) -> Array:
        rate = self.law.falloff_rate(alpha)
        return 0.25 * rate * (jnp.exp(-rate * x) + jnp.exp(-rate * x / 3.0))


class BurleyApproximateSampler(Sampler):
    """x = ((2 - c) xi - 2) ln(1 - xi) / q, close to the inverse of the cdf   (Xie et al. 2020).

    With tau = -ln(1 - xi) and k = c - 2 this is q x = (2 + k (1 - e^{-tau})) tau, which rises with tau; its density is
    d xi / dx = q e^{-tau} / (2 + k (1 - e^{-tau} + tau e^{-tau})). It is not the law's: at the source q/2 as the law's,
    far away q e^{-q x / c} / c against q e^{-q x / 3} / 4, so that an estimator of this law has weights that grow.

    c  Xie et al. 2.5715 [-]
    """

    law: NormalizedDiffusion
    c: float = eqx.field(static=True)

    def scaled_sample(self, xi: Array, alpha: Array) -> Array:
        return ((2.0 - self.c) * xi - 2.0) * jnp.log1p(-xi) / self.law.falloff_rate(alpha)

    def scaled_pdf(self, x: Array, alpha: Array) -> Array:
        rate = self.law.falloff_rate(alpha)
        target = jnp.minimum(rate * x, FARTHEST)
        tau = target / self.c
        for _ in range(NEWTON_STEPS):  # to (2 + k (1 - e^{-tau})) tau = target
            tau = tau - ((self.c - (self.c - 2.0) * jnp.exp(-tau)) * tau - target) / self._slope(tau)
        return rate * jnp.exp(-tau) / self._slope(tau)

    def _slope(self, tau: Array) -> Array:
        """d(q x) / d tau."""
        return 2.0 + (self.c - 2.0) * (1.0 - (1.0 - tau) * jnp.exp(-tau))


class NormalizedDiffusion(ProfileLaw):
    """R_d = A (e^{-q x} + e^{-q x / 3}) q / (8 pi x),  cdf = 1 - e^{-q x}/4 - 3 e^{-q x / 3}/4,  x = r/l.

    q is `falloff_rate(alpha)`, A the reflectance at alpha by `albedo` (held fixed). Infinite at r = 0.
    """

    albedo: Normalisation = eqx.field(static=True)
    sampler_class = BurleySampler

    @abc.abstractmethod
    def falloff_rate(self, alpha) -> Array:
        """q(alpha) [-]: the mean free path over the law's own falloff length."""

    def scaled_profile(self, x: Array, alpha: Array) -> Array:
        rate = self.falloff_rate(alpha)
        t = rate * x
        safe = jnp.where(x > 0, x, 1.0)
        value = self.albedo.reflectance(alpha) * rate * (jnp.exp(-t) + jnp.exp(-t / 3.0)) / (8.0 * jnp.pi * safe)
        return jnp.where(x > 0, value, jnp.inf)

    def scaled_cdf(self, x: Array, alpha: Array) -> Array:
        t = self.falloff_rate(alpha) * x
        return -0.25 * jnp.expm1(-t) - 0.75 * jnp.expm1(-t / 3.0)

    def source_strength(self, alpha: Array) -> Array:
        return 0.5 * self.albedo.reflectance(alpha) * self.falloff_rate(alpha)

    @property
    def samplers(self) -> dict[str, Sampler]:
        """Every published way to draw radii: "exact" inverts the cdf, "xie" and "unreal" are approximate inverses."""
        return {
            "exact": self.sampler,
            "xie": BurleyApproximateSampler(self, XIE),
            "unreal": BurleyApproximateSampler(self, UNREAL),
        }


class Burley(NormalizedDiffusion):
    """Normalized diffusion with q = s(A) = s0 - s1 A + s2 |A - s3|^p, in units of the transport mean free path.

    searchlight  p = 3   (memo, eq. 5: 1.85, 1, 7, 0.8; 5.5 % mean error reported)
    diffuse      p = 2   (memo, eq. 6: 1.9, 1, 3.5, 0.8; 3.9 %)

    Valid for alpha in (0, 1].
    """

    s0: float
    s1: float
    s2: float
    s3: float
    entry = Entry(
        "burley",
        "normalized diffusion",
        records=("burley-whole",),
        alpha=Range(open_low=True),
        text=Text("burley", ends=ENDS, clamps=NEAR_CLAMPS),
    )

    def text_numbers(self) -> dict[str, float]:
        """Return the exponent p [-]."""
        return {"power": self.power}

    @property
    def power(self) -> int:
        """The exponent p of the setting's form [-]."""
        return 2 if self.setting.illumination == "diffuse" else 3

    @evaluated
    def scale(self, reflectance) -> Array:
        """s(A) [-]."""
        return self.s0 - self.s1 * reflectance + self.s2 * jnp.abs(reflectance - self.s3) ** self.power

    @evaluated
    def falloff_rate(self, alpha) -> Array:
        return self.scale(self.albedo.reflectance(alpha))


class BurleyDiffuseMfp(NormalizedDiffusion):
    """Normalized diffusion with s(A) = s0 + s1 (A - s2)^4 per diffuse mean free path l_d: q = s(A) l / l_d.

    Memo, eq. 8: 3.5, 100, 0.33 (searchlight); 7.7 % mean error reported. The law takes and gives lengths in units of
    l all the same, by l / l_d = sigma_tr = sqrt(3 (1 - alpha) / (2 - alpha)): Grosjean's diffusion (d'Eon and Irving
    2011), as in the photon beam diffusion that the memo compares with. With it the law is 3 to 10 % off the exact
    profile for A in [0.05, 0.75], in keeping with the memo; with Jensen's sigma_tr = sqrt(3 (1 - alpha)) it would be
    22 % off at A = 0.05, not 5 %. Valid for alpha in (0, 1): at alpha = 1 l_d is infinite, and so is the law's width.
    """

    s0: float
    s1: float
    s2: float
    entry = Entry(
        "burley_diffuse_mfp",
        "normalized diffusion by diffuse mfp",
        alpha=Range(open_low=True, open_high=True),
        text=Text("burley_diffuse_mfp", ends=ENDS, clamps=f"{NEAR_CLAMPS}; falloff rate to 1e-7 / mfp"),
    )

    @evaluated
    def scale(self, reflectance) -> Array:
        """s(A) [-]: the diffuse mean free path over the law's own falloff length."""
        return self.s0 + self.s1 * (reflectance - self.s2) ** 4

    @evaluated
    def falloff_rate(self, alpha) -> Array:
        s = self.scale(self.albedo.reflectance(alpha))
        # Kept off zero, so that a share at infinity stays 1 where the law is infinitely wide.
        return jnp.maximum(s * jnp.sqrt(3.0 * (1.0 - alpha) / (2.0 - alpha)), jnp.finfo(s.dtype).tiny)

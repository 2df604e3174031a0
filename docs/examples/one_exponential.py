"""One exponential: 2 pi x R_d = A q e^{-q x}, x = r/l, q = q0 + q1 s + q2 s^2."""

import equinox as eqx
import jax.numpy as jnp

from mcml_sim import Setting
from profilefit.laws.base import EscapeLaw, Sampler
from profilefit.laws.rational import Rational


class OneExponential(EscapeLaw):
    setting: Setting = eqx.field(static=True)
    albedo: Rational = eqx.field(static=True)  # albedo inversion, fixed
    q0: float
    q1: float
    q2: float

    def rate(self, alpha):
        s = jnp.sqrt(1.0 - alpha)
        return self.q0 + s * (self.q1 + s * self.q2)

    def scaled_density(self, x, alpha):
        return self.rate(alpha) * jnp.exp(-self.rate(alpha) * x)

    def scaled_cdf(self, x, alpha):
        return -jnp.expm1(-self.rate(alpha) * x)

    def source_strength(self, alpha):  # this form lacks the exact one of EscapeLaw
        return self.albedo.reflectance(alpha) * self.rate(alpha)

    @property
    def sampler(self):
        return OneExponentialSampler(self)


class OneExponentialSampler(Sampler):
    law: OneExponential

    def scaled_sample(self, xi, alpha):
        return -jnp.log1p(-xi) / self.law.rate(alpha)

    def scaled_pdf(self, x, alpha):
        return self.law.scaled_density(x, alpha)

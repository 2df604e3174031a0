"""A law by its escape hazard: of the light that has come as far as r, the share that leaves in the next length dr."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array

from mcml_sim.media.setting import Setting
from profilefit.laws.base import Sampler
from profilefit.laws.entry import CLAMPS, Entry, Range, Text
from profilefit.laws.escape import EscapeLaw, decay_rate
from profilefit.laws.hazard_curve import FARTHEST, Shape, cumulative, density, growth, radius, radius_at
from profilefit.laws.rational import Rational

# Closer to the source than this many roots of a rounding [mfp] the map's density is the law's, to second order in x,
# where a slope of a slope would be rounding only; and where no light is left but a white medium's.
NEAR_SOURCE, NO_LIGHT = 10.0, 0.1 * FARTHEST
# 1 + a x + b x^2 must have no zero, which a parabola through small b would give it somewhere [1/mfp^2].
LEAST_B = 1e-4


class Hazard(EscapeLaw):
    """2 pi x R_d = A S lambda,   S = 1 - cdf = e^{-kappa x - w h V(x/h)} (1 + c x) / (1 + a x + b x^2),   x = r/l

    V(z) = z - z^2 ln(1 + 1/z)
    lambda = -S'/S = kappa + w V'(x/h) + (a + 2 b x) / (1 + a x + b x^2) - c / (1 + c x)
    V'(z) = 1 - 2 z ln(1 + 1/z) + z / (1 + z)

    Two exact limits are built in, neither of them fitted: at the source, lambda_0 = lim 2 pi x R_d / A, which sets w =
    lambda_0 - kappa - a + c, and far away the decay rate kappa(alpha). V is a spread of decay lengths from 0 to h: it
    has the x ln x that light leaves near the source, and no sum of exponentials has. The four other shapes are

    h = e^{h0 + h1 lambda_0 + h2 kappa}         a = a0 + a1 lambda_0 + a2 lambda_0^2
    c = (c0 + c1 lambda_0 + c2 kappa)^2         b = b0 + b1 lambda_0 + b2 lambda_0^2       [lambda_0, kappa in 1/mfp]

    lambda_0 runs from 1/2 (alpha = 1) to 3.3 or 2.4 (alpha = 0; searchlight or diffuse light, n = 1): it is smooth in
    sqrt(1 - alpha) and straightens the four shapes more than that or A does. Valid for alpha in [0, 1] and r in
    [0, inf]. `albedo` is the map to A (held fixed). One exponential and one logarithm a profile.
    """

    setting: Setting = eqx.field(static=True)
    albedo: Rational = eqx.field(static=True)
    h0: float
    h1: float
    h2: float
    a0: float
    a1: float
    a2: float
    b0: float
    b1: float
    b2: float
    c0: float
    c1: float
    c2: float
    entry = Entry(
        "hazard",
        "hazard",
        records=("hazard",),
        start={  # within a tenth of the exact profile
            **{"h0": 1.5, "h1": -0.2, "h2": -0.2, "c0": 0.5, "c1": 0.3, "c2": 0.2},
            **{"a0": 0.5, "a1": -0.25, "a2": 0.04, "b0": 0.17, "b1": -0.2, "b2": 0.06},
        },
        n=Range(1.0, 1.5),
        own=True,
        text=Text("hazard", ("rational", "decay"), clamps=CLAMPS),
    )

    def shape(self, alpha) -> Shape:
        """Everything that depends on alpha only: once a material, or once a pixel where A is a texture."""
        source = self.source_hazard(alpha)
        kappa = decay_rate(alpha)
        h = jnp.exp(self.h0 + self.h1 * source + self.h2 * kappa)
        a = self.a0 + source * (self.a1 + source * self.a2)
        b = jnp.maximum(self.b0 + source * (self.b1 + source * self.b2), LEAST_B)
        c = (self.c0 + self.c1 * source + self.c2 * kappa) ** 2
        return Shape(self.albedo.reflectance(alpha), kappa, source, source - kappa - a + c, h, a, b, c)

    def scaled_density(self, x: Array, alpha: Array) -> Array:
        return density(x, self.shape(alpha))

    def scaled_cdf(self, x: Array, alpha: Array) -> Array:
        share = jnp.maximum(-jnp.expm1(-cumulative(x, self.shape(alpha))), 0.0)  # rounding may take a tiny one below
        return jnp.where(x > 0, jnp.where(x < jnp.inf, share, 1.0), 0.0)

    @property
    def sampler(self) -> HazardSampler:
        """The inverse of the cdf, to 1e-4 in xi, in a fixed number of operations: one step where n = 1, else two."""
        return HazardSampler(self, 1 if self.setting.n == 1.0 else 2)

    @property
    def samplers(self) -> dict[str, Sampler]:
        """One step of the inversion, or two for an error below float32's."""
        return {"one step": HazardSampler(self, 1), "two steps": HazardSampler(self, 2)}


class HazardSampler(Sampler):
    """x with -ln S(x) = t = -ln(1 - xi): a first guess, and `steps` steps that follow the hazard.

    Guess: x = t / (kappa + (lambda_0 - kappa) / m),  m = 1 + p t + q (1 - kappa/lambda_0)^2 (xi / ((1 - xi) t) - 1)
    where p and q are `GUESS`: right to first order at xi = 0, and x = t/kappa far away, as it must be.
    Step: the hazard around x is taken for lambda / (1 + y), a straight line in 1/lambda, and its integral for a cubic.

    Error in xi at every alpha and xi, under both lights: one step 8e-5 where n = 1, 2e-3 where n = 1.5; two steps 2e-8.
    """

    law: Hazard
    steps: int = eqx.field(static=True, default=1)

    def scaled_sample(self, xi: Array, alpha: Array) -> Array:
        return radius(xi, self.law.shape(alpha), self.steps)

    def scaled_pdf(self, x: Array, alpha: Array) -> Array:
        """Density of this very map: its slope at the xi that it sends to x, which two steps of Newton's method find."""
        shape = self.law.shape(alpha)

        def mapped(t):
            return radius_at(t, growth(t), shape, self.steps)

        def slope(t):
            return jax.jvp(mapped, (t,), (jnp.ones_like(t),))

        nearest = NEAR_SOURCE * float(jnp.finfo(jnp.result_type(x, float)).eps) ** 0.5
        law = density(x, shape)
        inner = (x > nearest) & (x < NO_LIGHT)
        x = jnp.clip(x, nearest, NO_LIGHT)
        t = cumulative(x, shape)
        for _ in range(2):
            there, rate = slope(t)
            t = jnp.maximum(t + (x - there) / rate, 0.0)
        return jnp.where(inner, jnp.exp(-t) / slope(t)[1], law)

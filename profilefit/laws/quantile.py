"""An inverse cdf fitted on its own: the radius that a uniform number draws, without an integral of a profile.

The idea, to fit the inverse and not to invert a fit, is that of Liang et al., (19)-(21); this form has the limits at
both ends, and its density and cdf belong to it.
"""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jax import Array, lax

from profilefit.laws.base import CLAMPS, Entry, EscapeLaw, Range, Sampler, Text, evaluated
from profilefit.laws.liang import QUANTILES
from profilefit.laws.surface import decay_rate

# The scales of t of the two fractions in M: of the grid 2, 2.5, 3 and 0.3, 0.5, 0.7, 1 those of the least error that
# serve both lights.
NEAR, FAR = 2.5, 0.7
NEAREST, FARTHEST = 1e-25, 1e8  # x [mfp] that stand for 0 and for infinity: no light is left beyond
LEAST_C = 1e-12  # of c: none is so small but where it does not count
# Of Newton's method in ln t over ln x, a curve whose slope stays between 0.7 and 3: five reach rounding.
STEPS = 6


class Curve(NamedTuple):
    """Parameters of the law for one material; all of them depend on alpha only.

    kappa decay rate, source hazard at x = 0 [1/mfp]; a, b, c [-] the coefficients of M
    """

    kappa: Array
    source: Array
    a: Array
    b: Array
    c: Array


class QuantileSampler(Sampler):
    """x = t M / (kappa M + lambda_0 - kappa), t = -ln(1 - xi), with its exact density e^{-t} / (dx/dt)."""

    law: Quantile

    @evaluated
    def unclipped(self, xi, alpha) -> Array:
        """g(xi) in units of the mfp: the name that the inverse of Liang et al. has before its clip."""
        left = jnp.maximum(1.0 - xi, jnp.finfo(jnp.result_type(xi, float)).tiny)
        return jnp.where(xi < 1.0, radius(-jnp.log(left), self.law.curve(alpha))[0], jnp.inf)

    def scaled_sample(self, xi: Array, alpha: Array) -> Array:
        return self.unclipped(xi, alpha)

    def scaled_pdf(self, x: Array, alpha: Array) -> Array:
        x, alpha = jnp.broadcast_arrays(x, alpha)
        curve = self.law.curve(alpha)
        t = depth(x, curve)
        return jnp.exp(-t) / radius(t, curve)[1]


class Quantile(EscapeLaw):
    """Inverse cdf r/l at the share xi of the energy: a rational function of t = -ln(1 - xi).

    x = t M / (kappa M + lambda_0 - kappa),   M = 1 + a t + b t / (1 + 2.5 t) + c t^2 / (1 + 0.7 kappa t)

    Two exact limits are built in, neither of them fitted: x = t / lambda_0 at the source, lambda_0 = lim 2 pi x R_d / A
    there, and x = t / kappa far away, kappa(alpha) the decay rate. t/x, the mean hazard up to x, falls from the one to
    the other as M grows. With y = 1 / lambda_0 and w = (1 - kappa / lambda_0)^-2

    a = w (a0 + a1 y + a2 y^2)     b = b0 + b1 y + b2 w y^3     c = y^3 (c0 + c1 w) + c2 w^3 y^2     [y in mfp]

    Cdf and profile follow from the map: cdf = 1 - e^{-t(x)} by Newton's method, R_d = A e^{-t} / (2 pi x dx/dt). Only
    the map was fitted, so the profile is as good as its slope. Finite for alpha in [0, 1] and xi in [0, 1]. Error in
    xi up to 0.999: below 1e-3 for alpha from 0.05 to 0.995, nearer to white more, 2e-2 at 1. R_d is held for alpha up
    to 0.9999: nearer to white, and from 100 mfp on, it is too low, by half and more. `albedo` is the map to A (held
    fixed). One logarithm a radius.
    """

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
        "quantile",
        "quantile",
        records=("quantile",),
        start={  # within a hundredth of the exact share of energy
            **{"a0": 0.1, "a1": 0.3, "a2": -0.15, "b0": 0.9, "b1": -0.3, "b2": 0.2},
            **{"c0": 0.05, "c1": -0.01, "c2": -0.004},
        },
        profile=Range(high=0.9999),
        own=True,
        text=Text("quantile", ("rational", "decay", "near_zero"), clamps=CLAMPS),
    )
    sampler_class = QuantileSampler

    @classmethod
    def seen_by(cls, objective: str) -> tuple[str, ...]:
        return cls.constant_names() if objective in QUANTILES else ()

    def curve(self, alpha) -> Curve:
        """Everything that depends on alpha only: once a material, or once a pixel where A is a texture."""
        source = self.source_hazard(alpha)
        kappa = decay_rate(alpha)
        y = 1.0 / source
        w = (1.0 - kappa * y) ** -2
        return Curve(
            kappa,
            source,
            w * (self.a0 + y * (self.a1 + y * self.a2)),
            self.b0 + y * (self.b1 + y * y * w * self.b2),
            y * y * (y * (self.c0 + self.c1 * w) + self.c2 * w**3),
        )

    def scaled_density(self, x: Array, alpha: Array) -> Array:
        return self.sampler.scaled_pdf(x, alpha)

    def scaled_cdf(self, x: Array, alpha: Array) -> Array:
        x, alpha = jnp.broadcast_arrays(x, alpha)
        share = -jnp.expm1(-depth(x, self.curve(alpha)))
        return jnp.where(x > 0, jnp.where(x < jnp.inf, share, 1.0), 0.0)


def radius(t: Array, curve: Curve) -> tuple[Array, Array]:
    """Return x [mfp] at t, and dx/dt [mfp] there, at most that far away, 1 / kappa."""
    near, far = 1.0 / (1.0 + NEAR * t), 1.0 / (1.0 + FAR * curve.kappa * t)
    m = 1.0 + t * (curve.a + curve.b * near + curve.c * t * far)
    rise = curve.a + curve.b * near * near + curve.c * t * far * (1.0 + far)  # dM/dt
    spread = curve.source - curve.kappa
    inverse = 1.0 / (curve.kappa * m + spread)
    return t * m * inverse, (curve.kappa * m * m + spread * (m + t * rise)) * inverse * inverse


@eqx.filter_jit  # the steps are a loop, which would compile anew at each call
def depth(x: Array, curve: Curve) -> Array:
    """Return t [-] at x [mfp]: the inverse of `radius`."""
    x = jnp.clip(x, NEAREST, FARTHEST)
    # Where M is c t^2, next to white, x goes as t^3: from x lambda_0 alone the steps would not settle there.
    rising = x * (curve.source - curve.kappa)
    start = curve.kappa * x + jnp.minimum(rising, jnp.cbrt(rising / jnp.maximum(curve.c, LEAST_C)))

    def step(_, t):
        there, slope = radius(t, curve)
        return t * (x / there) ** (there / (t * slope))

    return lax.fori_loop(0, STEPS, step, start)

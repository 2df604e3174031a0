"""Sums of Gaussians, which blur separably: the profile of texture-space and screen-space skin.

Source of the form: E. d'Eon, D. Luebke and E. Enderton, Efficient rendering of human skin, EGSR 2007; E. d'Eon and D.
Luebke, Advanced techniques for realistic real-time skin rendering, GPU Gems 3, ch. 14, 2007, who fit one material at a
time (`scenes.skin.law`). The coefficient laws, which make it a law for every albedo, are this project's.
"""

from __future__ import annotations

import abc
import math
from functools import cache
from types import new_class
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from mcml_sim.media.arrays import require
from profilefit.laws.base import CLAMPS, Entry, Normalisation, ProfileLaw, Sampler, Text

MOST, DEFAULT = 8, 6
"""d'Eon and Luebke's skin has six."""
# Radii [mfp] of the narrowest and the widest Gaussian that other fits start from at alpha = 1, and f1, f2, which shrink
# both sevenfold towards alpha = 0.
START_SPAN = 0.05, 8.0
START_FALL = -6.0, 2.0
RECORDED = (2, 4, 6)  # numbers of Gaussians that this project fitted
# Where fits to the exact searchlight begin that would else creep to their end for 200 steps and more: constants in the
# order of the class, rounded.
STARTS = {
    2: (-6.2, 2.3, -1.5, 3.9, 0.5, 0.0),
    4: (-6.0, 2.4, -5.0, 3.4, 2.7, 2.1, 1.1, 0.4, 1.8, 0.2, 1.6, -0.1),
    6: (
        *(-3.94, 1.17, -6.92, 2.96, 2.55, 2.09, 1.68, 1.93),
        *(1.30, 0.09, 2.21, 0.03, 2.77, -0.28, 2.63, -0.95, 2.25, -10.67),
    ),
}
EXTRA_STEPS = 12
FARTHEST = 1e8  # x [mfp]: no light is left, and its square is finite in float32


class GaussiansSampler(Sampler):
    """x = sqrt(q) with ln sum_i w_i e^{-q / 2 v_i} = ln(1 - xi), by Newton's method from the left.

    The left side falls and is convex in q, so Newton started left of the root stays there and only goes up. It starts
    at max_i 2 v_i (ln w_i - ln(1 - xi)): no term exceeds the sum. N + 12 steps reach the last bits of xi for ratios of
    variances up to e^10, measured on random sums.
    """

    law: GaussianSum

    @eqx.filter_jit  # the steps are a loop, which would compile anew at each call
    def scaled_sample(self, xi: Array, alpha: Array) -> Array:
        rates, log_weights = 0.5 / self.law.variances(alpha), self.law.log_weights(alpha)
        target = jnp.log1p(-jnp.asarray(jnp.minimum(xi, 1.0 - jnp.finfo(jnp.result_type(xi, float)).epsneg)))

        def step(_, q):
            terms = log_weights - rates * q[..., None]
            total = jax.nn.logsumexp(terms, axis=-1)
            slope = jnp.sum(jnp.exp(terms - total[..., None]) * rates, axis=-1)
            return q + jnp.maximum((total - target) / slope, 0.0)

        start = jnp.max(jnp.maximum((log_weights - target[..., None]) / rates, 0.0), axis=-1)
        q = jax.lax.fori_loop(0, self.law.count() + EXTRA_STEPS, step, start)
        return jnp.where(xi < 1, jnp.sqrt(q), jnp.inf)

    def scaled_pdf(self, x: Array, alpha: Array) -> Array:
        variance = self.law.variances(alpha)
        r = jnp.minimum(jnp.asarray(x), FARTHEST)[..., None]
        return jnp.sum(jnp.exp(self.law.log_weights(alpha) - 0.5 * r**2 / variance) * r / variance, axis=-1)


class GaussianSum(ProfileLaw):
    """R_d = A sum_i w_i e^{-x^2 / 2 v_i} / (2 pi v_i),  cdf = 1 - sum_i w_i e^{-x^2 / 2 v_i},  x = r/l.

    Weights are positive and sum to one. Finite at x = 0, where no half space is, and far away below any.
    """

    sampler_class = GaussiansSampler

    @abc.abstractmethod
    def count(self) -> int:
        """Return the number N of Gaussians."""

    @abc.abstractmethod
    def variances(self, alpha) -> Array:
        """v_i(alpha) [mfp^2], rising, along a last axis."""

    @abc.abstractmethod
    def log_weights(self, alpha) -> Array:
        """Return ln w_i(alpha) [-] along a last axis."""

    def scaled_profile(self, x: Array, alpha: Array) -> Array:
        variance = self.variances(alpha)
        terms = jnp.exp(self.log_weights(alpha) - 0.5 * jnp.asarray(x)[..., None] ** 2 / variance) / variance
        return self.total(alpha) * jnp.sum(terms, axis=-1) / (2.0 * jnp.pi)

    def scaled_cdf(self, x: Array, alpha: Array) -> Array:
        share = -jnp.expm1(-0.5 * jnp.asarray(x)[..., None] ** 2 / self.variances(alpha))
        return jnp.sum(jnp.exp(self.log_weights(alpha)) * share, axis=-1)

    def source_strength(self, alpha: Array) -> Array:
        """0: no Gaussian rises as 1/x, so a limit at the source cannot be fitted."""
        return jnp.zeros_like(alpha)


class Gaussians(GaussianSum):
    """Sum of N Gaussians for every albedo.

    With s = sqrt(1 - alpha), i = 2 ... N:

    ln v_1 = v1 + f1 s + f2 s^2,  ln (v_i / v_{i-1}) = ln(1 + e^{vi})    variances rise with i, and with s by one factor
    w_i / w_1 = e^{wi0 + wi1 s}                                        weights are positive and sum to one

    3 N constants. (A quadratic of its own for each variance ratio and each weight, 6 N - 3 constants, lowers the misfit
    of four Gaussians by 0.4 %.) A is the reflectance at alpha by `albedo` (held fixed). Valid for alpha in [0, 1].
    """

    albedo: Normalisation = eqx.field(static=True)
    f1: eqx.AbstractVar[float]
    f2: eqx.AbstractVar[float]
    v1: eqx.AbstractVar[float]

    @classmethod
    def forms(cls) -> dict[str, type[Gaussians]]:
        """Return the sum of six, and sums of 1 ... 8."""
        return {"": law_class(), **{str(count): law_class(count) for count in range(1, MOST + 1)}}

    @classmethod
    @abc.abstractmethod
    def count(cls) -> int:
        """Return the number N of Gaussians."""

    @classmethod
    def start(cls) -> dict[str, float]:
        """Constants to fit from: those of `STARTS`, or equal weights and variances in equal ratios over START_SPAN."""
        if cls.count() in STARTS:
            return dict(zip(cls.constant_names(), STARTS[cls.count()], strict=True))
        low, high = (2.0 * np.log(radius) for radius in START_SPAN)
        ratio = (high - low) / max(cls.count() - 1, 1)
        values = dict.fromkeys(cls.constant_names(), 0.0)
        values |= {f"v{i}": float(np.log(np.expm1(ratio))) for i in range(2, cls.count() + 1)}
        values |= dict(zip(("f1", "f2"), START_FALL, strict=True))
        return values | {"v1": float(low if cls.count() > 1 else 0.5 * (low + high))}

    def text_numbers(self) -> dict[str, float]:
        """Return ln (v_i / v_{i-1}) [-]."""
        own = self.constants()
        return {f"rise{i}": math.log1p(math.exp(own[f"v{i}"])) for i in range(2, self.count() + 1)}

    def variances(self, alpha) -> Array:
        s = jnp.sqrt(1.0 - alpha)[..., None]
        ratios = [jax.nn.softplus(getattr(self, f"v{i}")) for i in range(2, self.count() + 1)]
        rising = jnp.cumsum(jnp.stack([jnp.asarray(self.v1, s.dtype), *(jnp.asarray(r, s.dtype) for r in ratios)]))
        return jnp.exp(rising + s * (self.f1 + s * self.f2))

    def log_weights(self, alpha) -> Array:
        s = jnp.sqrt(1.0 - alpha)
        pairs = [(getattr(self, f"w{i}0"), getattr(self, f"w{i}1")) for i in range(2, self.count() + 1)]
        logits = [jnp.zeros_like(s), *(level + slope * s for level, slope in pairs)]
        return jax.nn.log_softmax(jnp.stack(logits, axis=-1), axis=-1)


class MediumGaussians(GaussianSum):
    """A sum for one medium, a stack of layers under its own thicknesses, x in mean free paths of the first one.

    It has the medium's own A: arguments alpha are not looked at.
    """

    total_reflectance: float  # A [-]
    variance: tuple[float, ...]  # v_i [mfp^2], rising
    weight: tuple[float, ...]  # w_i [-]
    own_reflectance = True

    @property
    def entry(self) -> Entry:  # type: ignore[override]
        """Entry whose shader source repeats its blocks for each Gaussian."""
        return Entry("gaussians", text=Text("gaussians", count=self.count()))

    def count(self) -> int:
        return len(self.weight)

    def variances(self, alpha) -> Array:
        return jnp.stack([jnp.asarray(one, float) for one in self.variance]) + jnp.zeros_like(alpha)[..., None]

    def log_weights(self, alpha) -> Array:
        return jnp.log(jnp.stack([jnp.asarray(one, float) for one in self.weight])) + jnp.zeros_like(alpha)[..., None]

    def total(self, alpha) -> Array:
        return self.total_reflectance + jnp.zeros_like(alpha)

    def text_shape(self) -> dict[str, float]:
        """Return the constants of the shader source of `Gaussians`."""
        pairs = enumerate(zip(self.variance, self.weight, strict=True), start=1)
        each = {name: value for i, (v, w) in pairs for name, value in ((f"rate{i}", 0.5 / v), (f"weight{i}", w))}
        return {"reflectance": self.total_reflectance, **each}


def law_class(count: int = DEFAULT) -> type[Gaussians]:
    """Return the class of sums of `count` Gaussians, 1 to 8; InputError otherwise."""
    is_count = isinstance(count, int) and not isinstance(count, bool) and 1 <= count <= MOST
    require(is_count, "count", f"a number of Gaussians in 1 ... {MOST}", count)
    return _law_class(count)


@cache
def _law_class(count: int) -> type[Gaussians]:
    names = ["f1", "f2", *(f"v{i}" for i in range(1, count + 1))]
    names += [f"w{i}{power}" for i in range(2, count + 1) for power in range(2)]
    body: dict[str, Any] = {
        "__module__": __name__,
        "__qualname__": f"Gaussians{count}",
        "__doc__": f"A sum of {count} Gaussians, `Gaussians`.",
        "__annotations__": dict.fromkeys(names, float),
        "count": classmethod(lambda cls: count),
    }
    made: Any = new_class(f"Gaussians{count}", (Gaussians,), exec_body=lambda namespace: namespace.update(body))
    made.entry = Entry(
        f"gaussians:{count}",
        f"{count} Gaussians",
        records=(f"gaussians-{count}",) if count in RECORDED else (),
        start=made.start(),
        text=Text("gaussians", clamps=CLAMPS, count=count),
    )
    return made

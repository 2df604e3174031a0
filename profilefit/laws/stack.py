"""A law of a stack of layers: the half space of the first layer, and what those below it change."""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from profilefit.errors import InputError
from profilefit.laws.base import CLOSED, Constants, ProfileLaw, evaluated
from profilefit.laws.surface import decay_rate

THICKEST = 1e6  # mean free paths that stand for an infinite first layer
LEAST_DECAY = 1e-4  # over l: where nothing is absorbed A tends to A_1 all the same, within 1e-4
LEAST_RATE = 1e-9  # over the image's height: a rate of 0 has no logarithm
NEWTON_STEPS = 4  # of an image's radius: to rounding


class LayerLaw(Constants):
    """The half space of one layer, in its unit of length: a law R_d(r / l; alpha) at that layer's alpha [-] and l."""

    law: ProfileLaw = eqx.field(metadata=CLOSED)
    alpha: float = eqx.field(metadata=CLOSED)
    mfp: float = eqx.field(metadata=CLOSED)

    @evaluated
    def profile(self, r, thickness=None) -> Array:
        """R_d(r) [1/length^2]: 2 pi r R_d integrates to A. InputError on a thickness: it has none."""
        _require_none(thickness)
        return self.value(r)

    @evaluated
    def cdf(self, r, thickness=None) -> Array:
        """Share of the reflected light within radius r [-]."""
        _require_none(thickness)
        return self.law.scaled_cdf(r / self.mfp, jnp.asarray(self.alpha))

    @property
    def reflectance(self) -> float:
        """A [-]."""
        return float(self.law.total(self.alpha))

    @property
    def sampler(self) -> StackSampler:
        """Draws radii of the law, by its own sampler."""
        return StackSampler(self)

    @property
    def layers(self) -> tuple[LayerLaw, ...]:
        """Itself."""
        return (self,)

    def decay(self) -> Array:
        """Rate at which the light decays far off [1/length]."""
        return decay_rate(self.alpha) / self.mfp

    def whole(self) -> Array:
        """Return A [-]."""
        return self.law.total(self.alpha)

    def value(self, r: Array) -> Array:
        """R_d [1/length^2]."""
        return self.law.scaled_profile(r / self.mfp, jnp.asarray(self.alpha)) / self.mfp**2

    def within(self, r: Array) -> Array:
        """Light that leaves within r [-]."""
        return self.law.unscaled_energy(r / self.mfp, jnp.asarray(self.alpha))

    def drawn(self, xi: Array, thickness: Array | None = None, depth: Array | float = 0.0) -> Array:
        """Return a radius [length] for xi in [0, 1), of light seen from a depth [length]."""
        _require_none(thickness)
        return _moved(self.law.sampler.scaled_sample(xi, jnp.asarray(self.alpha)) * self.mfp, depth)

    def drawn_density(self, r: Array, thickness: Array | None = None, depth: Array | float = 0.0) -> Array:
        """Return the density of drawn radii [1/length]."""
        _require_none(thickness)
        s, slope = _unmoved(r, depth)
        return slope * self.law.sampler.scaled_pdf(s / self.mfp, jnp.asarray(self.alpha)) / self.mfp


class StackLaw(Constants):
    """Law of a layer of one thickness on a medium.

    R_d(r; d) = R_1(r) - c_1 R_1(s_1) + c_2 R_2(s_2) + m I(r),   s_i^2 = r^2 + (g_i d)^2,   c_i = e^{-b_i x},

    of a first layer of thickness d, x = d / l its mean free paths, over a half space or stack R_2: R_1 is the half
    space of the first layer, the second term what of it went deeper than d, seen from a depth of about d, the third
    what came back from below, seen likewise. The fourth is an image at height D = h_0 l + h_1 d,

    I = D (1 + k s) e^{-k (s - D)} / (2 pi s^3),   s^2 = r^2 + D^2,   k = min(kappa_1, kappa_2) + k_0 / l,

    whose integral is 1: m is what brings the reflectance to

    A(d) = A_1 + (A_2 - A_1) (1 - w) e / (1 - w e),   e = e^{-2 kappa_1 d - u (1 - e^{-x})}.

    Nine constants, for every d in [0, inf]. At d = 0 it is R_2, at infinity R_1, as exact as these are; the cdf is
    closed where theirs are; A lies between A_1 and A_2. A stack of more layers is a law over a law.

    top        the first layer's half space;  below  what lies under it
    thickness  of the first layer, where no other is given [length]

    In e kappa_1 is 1e-4 / l at least: A tends to A_1 where nothing is absorbed as well, within 1e-4.
    Where layers scatter forward, l, alpha and kappa are those of similar isotropic ones.
    """

    top: LayerLaw = eqx.field(metadata=CLOSED)
    below: LayerLaw | StackLaw = eqx.field(metadata=CLOSED)
    thickness: float = eqx.field(metadata=CLOSED)
    w: float
    u: float
    g1: float
    g2: float
    b1: float
    b2: float
    h0: float
    h1: float
    k0: float

    @evaluated
    def profile(self, r, thickness=None) -> Array:
        """R_d(r) [1/length^2], 2 pi r R_d integrates to A; thickness of the first layer [length]. All broadcast."""
        return self.value(r, thickness)

    @evaluated
    def cdf(self, r, thickness=None) -> Array:
        """Share of the reflected light within radius r [-]; 1 at infinity."""
        whole = self.whole(thickness)
        share = self.within(r, thickness) / jnp.where(whole > 0, whole, 1.0)
        return jnp.where(r < jnp.inf, jnp.clip(share, 0.0, 1.0), 1.0)

    @evaluated
    def total(self, thickness) -> Array:
        """Reflectance A [-] under a first layer of that thickness [length]."""
        return self.whole(thickness)

    @property
    def reflectance(self) -> float:
        """A [-], under its own thickness."""
        return float(self.total(self.thickness))

    @property
    def sampler(self) -> StackSampler:
        """Draws radii where this law has its light, with their own density."""
        return StackSampler(self)

    @property
    def layers(self) -> tuple[LayerLaw, ...]:
        """The half spaces of its layers, from the first down."""
        return (self.top, *self.below.layers)

    def decay(self) -> Array:
        """Rate at which the light decays far off [1/length]: the slowest of its layers'."""
        return jnp.minimum(self.top.decay(), self.below.decay())

    def fading(self) -> Array:
        """Rate at which what lies below is seen less under a thicker first layer [1/length]."""
        return jnp.maximum(self.top.decay(), LEAST_DECAY / self.top.mfp)

    def whole(self, thickness: Array | None = None) -> Array:
        """Return A [-]."""
        d = self._bounded(thickness)
        e = jnp.exp(-2.0 * self.fading() * d + self.u * jnp.expm1(-d / self.top.mfp))
        first, second = self.top.whole(), self.below.whole()
        return first + (second - first) * (1.0 - self.w) * e / (1.0 - self.w * e)

    def value(self, r: Array, thickness: Array | None = None) -> Array:
        """R_d [1/length^2]."""
        of = self.terms(thickness)
        gone, back = self.top.value(jnp.hypot(r, of.gone)), self.below.value(jnp.hypot(r, of.back))
        return self.top.value(r) - of.c1 * gone + of.c2 * back + of.image * _image(r, of)

    def within(self, r: Array, thickness: Array | None = None) -> Array:
        """Light that leaves within r [-]."""
        of = self.terms(thickness)
        gone = self.top.within(jnp.hypot(r, of.gone)) - self.top.within(of.gone)
        back = self.below.within(jnp.hypot(r, of.back)) - self.below.within(of.back)
        s = jnp.hypot(r, of.height)
        image = 1.0 - of.height / s * jnp.exp(-of.rate * (s - of.height))
        return self.top.within(r) - of.c1 * gone + of.c2 * back + of.image * image

    def drawn(self, xi: Array, thickness: Array | None = None, depth: Array | float = 0.0) -> Array:
        """Return a radius [length] for xi in [0, 1) of one of three terms that add light, from a depth [length]."""
        of = self.terms(thickness)
        first, second, third = self.shares(of)
        own = self.top.drawn(_stretched(xi, 0.0, first), None, depth)
        back = self.below.drawn(_stretched(xi, first, second), None, jnp.hypot(depth, of.back))
        image = _moved(_image_radius(_stretched(xi, first + second, third), of), depth)
        return jnp.where(xi < first, own, jnp.where(xi < first + second, back, image))

    def drawn_density(self, r: Array, thickness: Array | None = None, depth: Array | float = 0.0) -> Array:
        """Return the density of drawn radii [1/length]."""
        of = self.terms(thickness)
        first, second, third = self.shares(of)
        s, slope = _unmoved(r, depth)
        image = slope * 2.0 * jnp.pi * s * _image(s, of)
        back = self.below.drawn_density(r, None, jnp.hypot(depth, of.back))
        return first * self.top.drawn_density(r, None, depth) + second * back + third * image

    def terms(self, thickness: Array | None = None) -> StackTerms:
        """Compute what depends on the thickness only: once per point of a surface."""
        d = self._bounded(thickness)
        x = d / self.top.mfp
        gone, back, height = self.g1 * d, self.g2 * d, self.h0 * self.top.mfp + self.h1 * d
        rate = self.decay() + jnp.maximum(self.k0 / self.top.mfp, LEAST_RATE / height)
        c1, c2 = jnp.exp(-self.b1 * x), jnp.exp(-self.b2 * x)
        lost = c1 * (self.top.whole() - self.top.within(gone))
        came = c2 * (self.below.whole() - self.below.within(back))
        kept = self.top.whole() - lost
        return StackTerms(gone, back, c1, c2, height, rate, self.whole(d) - kept - came, kept, came)

    def _bounded(self, thickness: Array | None) -> Array:
        given = self.thickness if thickness is None else thickness
        return jnp.minimum(jnp.asarray(given), THICKEST * self.top.mfp)

    def shares(self, of: StackTerms) -> tuple[Array, Array, Array]:
        """Return the chance of each term's radii [-]: of light that is added, not taken away."""
        image = jnp.maximum(of.image, 0.0)
        total = of.kept + of.came + image
        whole = jnp.where(total > 0, total, 1.0)
        return 1.0 - (of.came + image) / whole, of.came / whole, image / whole  # a quotient is not rounded beyond 1


class StackTerms(NamedTuple):
    """Terms at one thickness: depths g_i d [length], c_i [-], the image's height [length] and rate [1/length].

    image, kept, came  energies [-]: m, of R_1 less what it lost, and of what came back from below
    """

    gone: Array
    back: Array
    c1: Array
    c2: Array
    height: Array
    rate: Array
    image: Array
    kept: Array
    came: Array


class StackSampler(eqx.Module):
    """Radii with a density of their own, near the law's: an estimate weighs each by 2 pi r R_d / (A pdf)."""

    law: LayerLaw | StackLaw

    @evaluated
    def sample(self, xi, thickness=None) -> Array:
        """Radius [length] for a uniform number xi in [0, 1); thickness of the first layer [length]. All broadcast."""
        return self.law.drawn(xi, thickness)

    @evaluated
    def pdf(self, r, thickness=None) -> Array:
        """Density in r of `sample` [1/length]; integrates to 1."""
        return self.law.drawn_density(r, thickness)


def _require_none(thickness: Array | None) -> None:
    if thickness is not None:
        raise InputError("thickness must be left out where there is but one layer, got one")


def _image(r: Array, of: StackTerms) -> Array:
    """I [1/length^2]."""
    s = jnp.hypot(r, of.height)
    far = jnp.where(s < jnp.inf, s, 1.0)
    value = of.height * (1.0 + of.rate * far) * jnp.exp(-of.rate * (far - of.height)) / (2.0 * jnp.pi * far**3)
    return jnp.where(s < jnp.inf, value, 0.0)


def _image_radius(xi: Array, of: StackTerms) -> Array:
    """Radius [length] beyond which the image has 1 - xi of its light: z + ln z = q, z = k s, by Newton's method."""
    nearest = of.rate * of.height
    q = nearest + jnp.log(nearest) - jnp.log1p(-xi)
    z = jnp.where(q > 1.0, q - jnp.log(jnp.maximum(q, 1.0)), jnp.exp(jnp.minimum(q, 1.0) - 0.5))
    for _ in range(NEWTON_STEPS):
        z = z * (1.0 + q - jnp.log(z)) / (1.0 + z)
    s = z / of.rate
    return jnp.sqrt(jnp.maximum((s - of.height) * (s + of.height), 0.0))


def _moved(s: Array, depth: Array | float) -> Array:
    """Return the radius at which what a law has beyond s is seen from a depth: hypot(r, depth) = s + depth."""
    return jnp.sqrt(s * (s + 2.0 * depth))


def _unmoved(r: Array, depth: Array | float) -> tuple[Array, Array]:
    """Return the inverse s [length] of `_moved`, and ds/dr [-]."""
    inside = (r > 0) & (r < jnp.inf)
    bounded = jnp.where(inside, r, 1.0)
    far = jnp.hypot(bounded, depth)
    slope = jnp.where(r > 0, jnp.where(inside, bounded / far, 1.0), jnp.where(depth > 0, 0.0, 1.0))
    return jnp.where(inside, bounded * (bounded / (far + depth)), r), slope


def _stretched(xi: Array, low: Array | float, width: Array) -> Array:
    """Map xi of a term from its part of [0, 1) to all of it; below 1."""
    inside = (xi - low) / jnp.where(width > 0, width, 1.0)
    return jnp.clip(inside, 0.0, 1.0 - jnp.finfo(jnp.result_type(xi, float)).epsneg)

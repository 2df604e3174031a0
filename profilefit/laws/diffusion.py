"""Base of the physically based diffusion laws: no constants to fit, their own reflectance, surface and image.

They are of a searchlight on a half space with reduced coefficients: by similarity g = 0 and l = 1 / (mu_s' + mu_a), any
n. A point source at depth z under the surface and its image z_v above it make up a dipole (Eason et al. 1978; Farrell
et al. 1992; Jensen et al. 2001).
"""

from __future__ import annotations

import abc
from functools import lru_cache

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from mcml_sim.exact import single_scattering
from mcml_sim.media import fresnel
from profilefit.errors import SettingError
from profilefit.laws.base import ProfileLaw, Sampler
from profilefit.laws.evaluate import evaluated
from profilefit.laws.rational import Normalisation

NODES, WEIGHTS = np.polynomial.legendre.leggauss(64)
# ln x [mfp] that bracket every radius of use: nearer than 1e-11 or farther than 1e17 mfp nothing is drawn.
NEAREST, FARTHEST = -25.0, 40.0
# A bracket of 65 halved so often is 6e-5 wide, and Newton squares what is left.
HALVINGS, NEWTON_STEPS = 20, 3
# What the texts of dipoles rest on, and what completes them.
TEXT_PARTS, TEXT_ENDS = ("near_zero", "diffusion"), ("numeric_inverse", "wrappers")


class DiffusionLaw(ProfileLaw):
    """A law without constants, whose energy is its own and not A(alpha): R_d = t c(alpha) `shape_profile`.

    t is the share of the light that enters a surface of that n, so that reflectances are per light that arrived, as the
    simulator's. `cdf` is a share of the law's own reflectance; `albedo` is not used.
    """

    albedo: eqx.AbstractVar[Normalisation | None]
    own_reflectance = True

    def __check_init__(self) -> None:
        if self.setting.illumination != "searchlight" or self.setting.g != 0.0:
            raise SettingError(f"setting must be a searchlight with g = 0 (use reduced lengths), got {self.setting}")

    @abc.abstractmethod
    def prefactor(self, alpha: Array) -> Array:
        """c(alpha) [-], which vanishes where alpha does."""

    @abc.abstractmethod
    def shape_profile(self, x: Array, alpha: Array) -> Array:
        """R_d / (t c) at x = r/l [1/mfp^2]."""

    @abc.abstractmethod
    def shape_energy(self, x: Array, alpha: Array) -> Array:
        """Integral of 2 pi x `shape_profile` up to x = r/l [-]."""

    @evaluated
    def reflectance(self, alpha) -> Array:
        """Total reflectance of the law itself at single-scattering albedo alpha [-]."""
        return self.unscaled_energy(jnp.asarray(jnp.inf), alpha)

    def total(self, alpha) -> Array:
        return self.reflectance(alpha)

    @property
    def entered(self) -> float:
        """t, the share of the light that enters the surface [-]."""
        return single_scattering.entered(self.setting)

    @eqx.filter_jit  # a sum over nodes is fused, not stored
    def scaled_profile(self, x: Array, alpha: Array) -> Array:
        x, alpha = _arrays(x, alpha)
        strength = self.entered * self.prefactor(alpha)
        return jnp.where(strength > 0, strength * self.shape_profile(x, alpha), 0.0)

    @eqx.filter_jit
    def scaled_cdf(self, x: Array, alpha: Array) -> Array:
        x, alpha = _arrays(x, alpha)
        return self.shape_energy(x, alpha) / self.shape_energy(jnp.full_like(alpha, jnp.inf), alpha)

    @eqx.filter_jit
    def unscaled_energy(self, x: Array, alpha: Array) -> Array:
        x, alpha = _arrays(x, alpha)
        return self.entered * self.prefactor(alpha) * self.shape_energy(x, alpha)

    @property
    def sampler(self) -> DiffusionSampler:
        """The cdf inverted numerically."""
        return DiffusionSampler(self)


class DiffusionSampler(Sampler):
    """x with cdf(x) = xi, by halving a bracket of ln x and then Newton's method inside it; draws the law itself.

    To 1e-14 in xi in float64 between the nearest radius and the farthest: no closed inverse is known.
    """

    law: DiffusionLaw

    @eqx.filter_jit  # the halvings are a loop, which would compile anew at each call
    def scaled_sample(self, xi: Array, alpha: Array) -> Array:
        xi, alpha = _arrays(xi, alpha)
        target = xi * self.law.shape_energy(jnp.full_like(alpha, jnp.inf), alpha)

        def step(i, state):
            low, high, y = state
            x = jnp.exp(y)
            excess = self.law.shape_energy(x, alpha) - target
            slope = 2.0 * jnp.pi * x**2 * self.law.shape_profile(x, alpha)
            low, high = jnp.where(excess < 0, y, low), jnp.where(excess < 0, high, y)
            newton = jnp.clip(y - excess / jnp.maximum(slope, jnp.finfo(y.dtype).tiny), low, high)
            return low, high, jnp.where(i < HALVINGS, 0.5 * (low + high), newton)

        zero = jnp.zeros_like(target)
        start = zero + NEAREST, zero + FARTHEST, zero + 0.5 * (NEAREST + FARTHEST)
        x = jnp.exp(lax.fori_loop(0, HALVINGS + NEWTON_STEPS, step, start)[2])
        return jnp.where(xi > 0, jnp.where(xi < 1, x, jnp.inf), 0.0)

    @eqx.filter_jit
    def scaled_pdf(self, x: Array, alpha: Array) -> Array:
        x, alpha = _arrays(x, alpha)
        x = jnp.maximum(_finite(x), jnp.finfo(x.dtype).tiny ** 0.5)  # the limits at both ends are reached there
        radial = 2.0 * jnp.pi * x * self.law.shape_profile(x, alpha)
        return radial / self.law.shape_energy(jnp.full_like(alpha, jnp.inf), alpha)


def _arrays(x, alpha) -> tuple[Array, Array]:
    """Both as arrays of one precision."""
    kind = jnp.result_type(x, alpha, float)
    return jnp.asarray(x, kind), jnp.asarray(alpha, kind)


def distance(x: Array, z: Array | float) -> Array:
    """Return the distance from radius x on the surface to a source at depth z; finite where x is not [mfp]."""
    return jnp.sqrt(_finite(x) ** 2 + z**2)


def flux(x: Array, z: Array | float, sigma: Array) -> Array:
    """Flux z (1 + sigma d) e^{-sigma d} / (4 pi d^3) through the surface from a unit source at depth z [1/mfp^2]."""
    d = distance(x, z)
    return (z / d) * (1.0 / d + sigma) * jnp.exp(-sigma * d) / (4.0 * jnp.pi * d)


def fluence(x: Array, z: Array | float, sigma: Array) -> Array:
    """e^{-sigma d} / (4 pi d): D times the fluence on the surface from a unit source at depth z [1/mfp]."""
    d = distance(x, z)
    return jnp.exp(-sigma * d) / (4.0 * jnp.pi * d)


def flux_within(x: Array, z: Array | float, sigma: Array) -> Array:
    """Integral of 2 pi x `flux` up to x: (e^{-sigma z} - z e^{-sigma d} / d) / 2 [-], without cancellation at x = 0."""
    d, beyond = distance(x, z), _beyond(x, z)
    return 0.5 * jnp.exp(-sigma * z) * (jnp.exp(-sigma * beyond) * beyond / d - jnp.expm1(-sigma * beyond))


def fluence_within(x: Array, z: Array | float, image: Array, sigma: Array) -> Array:
    """Integral up to x of 2 pi x times the `fluence` from depth z less that from `image` > z [mfp]."""
    near = decayed(sigma, z, _beyond(x, z)) - decayed(sigma, image, _beyond(x, image))
    # Far away the two grow without bound where sigma = 0: the same, sorted to be a difference of small numbers.
    real, virtual = distance(x, z), distance(x, image)
    far = decayed(sigma, z, image - z) - decayed(sigma, real, (image - z) * ((image + z) / (real + virtual)))
    return 0.5 * jnp.where(x < 1.0, near, far)


def decayed(sigma: Array, start: Array | float, length: Array) -> Array:
    """Integral of e^{-sigma t} from `start` over `length` [mfp], finite and smooth at sigma = 0."""
    t = sigma * length
    small = t < jnp.finfo(t.dtype).eps
    safe = jnp.where(small, 1.0, t)
    return jnp.exp(-sigma * start) * length * jnp.where(small, 1.0 - 0.5 * t, -jnp.expm1(-safe) / safe)


def _finite(x: Array) -> Array:
    """x, or a radius so large that nothing is left, whose square still is a number."""
    return jnp.minimum(x, 0.1 * jnp.finfo(x.dtype).max ** 0.5)


def _beyond(x: Array, z: Array | float) -> Array:
    """Return d - z [mfp]."""
    x = _finite(x)
    return x * (x / jnp.maximum(distance(x, z) + z, jnp.finfo(x.dtype).tiny))


def grosjean(alpha: Array) -> tuple[Array, Array]:
    """D = (2 - alpha) / 3 and sigma_tr = sqrt((1 - alpha) / D), for l = 1   (Grosjean 1956; d'Eon and Irving 2011)."""
    diffusion = (2.0 - alpha) / 3.0
    return diffusion, jnp.sqrt((1.0 - alpha) / diffusion)


@lru_cache(maxsize=64)
def fresnel_moments(n: float) -> tuple[float, float]:
    """2 C_1 = 2 int mu F dmu and 3 C_2 = 3 int mu^2 F dmu over cosines mu in [0, 1] inside a surface of index n [-].

    By quadrature, to 1e-12: d'Eon and Irving (2011) print fits of them, within 0.008 for n in [0.5, 2.5].
    """
    critical = np.sqrt(max(1.0 - 1.0 / n**2, 0.0))  # F = 1 below this cosine, and has the slope of a root above it
    u = 0.5 * (NODES + 1.0)
    mu = critical + (1.0 - critical) * u**2
    passed = (1.0 - critical) * u * WEIGHTS * (1.0 - fresnel.fresnel(n, 1.0, mu)[0])
    return float(1.0 - 2.0 * np.sum(mu * passed)), float(1.0 - 3.0 * np.sum(mu**2 * passed))


def exitance_factors(n: float) -> tuple[float, float, float]:
    """C_phi = (1 - 2 C_1) / 4, C_E = (1 - 3 C_2) / 2 and A = (1 + 3 C_2) / (1 - 2 C_1)   (d'Eon and Irving 2011)."""
    first, second = fresnel_moments(n)
    return 0.25 * (1.0 - first), 0.5 * (1.0 - second), (1.0 + second) / (1.0 - first)

"""Physically based diffusion laws: no constants to fit, their own reflectance, surface and image.

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
from mcml_sim.media.arrays import Floats
from mcml_sim.media.medium import fresnel
from profilefit.errors import SettingError
from profilefit.laws.base import ANY_INDEX, CLAMPS, Entry, Normalisation, ProfileLaw, Sampler, Text, evaluated

NODES, WEIGHTS = np.polynomial.legendre.leggauss(64)
# ln x [mfp] that bracket every radius of use: nearer than 1e-11 or farther than 1e17 mfp nothing is drawn.
NEAREST, FARTHEST = -25.0, 40.0
# A bracket of 65 halved so often is 6e-5 wide, and Newton squares what is left.
HALVINGS, NEWTON_STEPS = 20, 3
# What the texts of dipoles rest on, and what completes them.
PARTS, ENDS = ("near_zero", "diffusion"), ("numeric_inverse", "wrappers")


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


class DiffusionLaw(ProfileLaw):
    """A law without constants, whose energy is its own and not A(alpha): R_d = t c(alpha) `shape_profile`.

    t is the share of the light that enters a surface of that n, so that reflectances are per light that arrived, as the
    simulator's. `cdf` is a share of the law's own reflectance; `albedo` is not used.
    """

    albedo: Normalisation | None = eqx.field(static=True, default=None)
    own_reflectance = True
    sampler_class = DiffusionSampler

    def __check_init__(self) -> None:
        if self.setting.illumination != "searchlight" or self.setting.g != 0.0:
            raise SettingError(f"setting must be a searchlight with g = 0 (use reduced lengths), got {self.setting}")

    def prefactor(self, alpha: Array) -> Array:
        """c(alpha) [-], which vanishes where alpha does."""
        return alpha

    @abc.abstractmethod
    def shape_profile(self, x: Array, alpha: Array) -> Array:
        """R_d / (t c) at x = r/l [1/mfp^2]."""

    @abc.abstractmethod
    def shape_energy(self, x: Array, alpha: Array) -> Array:
        """Integral of 2 pi x `shape_profile` up to x = r/l [-]."""

    @evaluated
    def reflectance(self, alpha) -> Array:
        """Total reflectance of the law itself at reduced albedo alpha [-]."""
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

    def source_strength(self, alpha: Array) -> Array:
        return jnp.zeros_like(alpha)


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
    passed = (1.0 - critical) * u * WEIGHTS * (1.0 - fresnel(n, 1.0, mu)[0])
    return float(1.0 - 2.0 * np.sum(mu * passed)), float(1.0 - 3.0 * np.sum(mu**2 * passed))


def exitance_factors(n: float) -> tuple[float, float, float]:
    """C_phi = (1 - 2 C_1) / 4, C_E = (1 - 3 C_2) / 2 and A = (1 + 3 C_2) / (1 - 2 C_1)   (d'Eon and Irving 2011)."""
    first, second = fresnel_moments(n)
    return 0.25 * (1.0 - first), 0.5 * (1.0 - second), (1.0 + second) / (1.0 - first)


def exitance(x: Array, depth: Array | float, alpha: Array, n: float) -> Array:
    """Return C_phi phi + C_E E of a source at a depth less its image, by Grosjean's diffusion [1/mfp^2]."""
    c_phi, c_e, mismatch = exitance_factors(n)
    diffusion, sigma = grosjean(alpha)
    image = depth + 4.0 * mismatch * diffusion
    inside = fluence(x, depth, sigma) - fluence(x, image, sigma)
    return c_phi / diffusion * inside + c_e * (flux(x, depth, sigma) + flux(x, image, sigma))


def exitance_within(x: Array, depth: Array | float, alpha: Array, n: float) -> Array:
    """Integral of 2 pi x `exitance` up to x [-]."""
    c_phi, c_e, mismatch = exitance_factors(n)
    diffusion, sigma = grosjean(alpha)
    image = depth + 4.0 * mismatch * diffusion
    through = flux_within(x, depth, sigma) + flux_within(x, image, sigma)
    return c_phi / diffusion * fluence_within(x, depth, image, sigma) + c_e * through


class Dipole(DiffusionLaw):
    """R_d = t alpha / (4 pi) sum over z of z (1 + sigma d) e^{-sigma d} / d^3, d^2 = x^2 + z^2, z = 1 and 1 + 4 K / 3.

    sigma = sqrt(3 (1 - alpha)), K = (1 + F_dr) / (1 - F_dr) (the paper's A), and F_dr the diffuse Fresnel reflectance
    inside, F_dr = -1.440 / n^2 + 0.710 / n + 0.668 + 0.0636 n (paper, sec. 2.1; 0.0016 at n = 1, where none is meant),
    for n < 1 -0.4399 + 0.7099 / n - 0.3319 / n^2 + 0.0636 / n^3 (Jensen and Buhler, sec. 2); t the share of the light
    that enters. Integrates to t alpha/2 (1 + e^{-4/3 K sigma}) e^{-sigma}, not to the reflectance of the half space.
    Its share within x is closed. Meant for alpha near 1 and x beyond 1; finite at x = 0, where the half space is not.

    Source: H. W. Jensen, S. R. Marschner, M. Levoy and P. Hanrahan, A practical model for subsurface light transport,
    SIGGRAPH 2001; its total reflectance: H. W. Jensen and J. Buhler, A rapid hierarchical rendering technique for
    translucent materials, SIGGRAPH 2002, eq. 5.
    """

    entry = Entry("dipole", "dipole", n=ANY_INDEX, text=Text("dipole", PARTS, ENDS, CLAMPS))

    def text_numbers(self) -> dict[str, float]:
        """Return the share of the light that enters [-], and the height of the image [mfp]."""
        return {"entered": self.entered, "image": self.image}

    @property
    def image(self) -> float:
        """Height of the image above the surface z_v [mfp]."""
        reflected = diffuse_fresnel(self.setting.n)
        return 1.0 + 4.0 / 3.0 * (1.0 + reflected) / (1.0 - reflected)

    def shape_profile(self, x: Array, alpha: Array) -> Array:
        sigma = jnp.sqrt(3.0 * (1.0 - alpha))  # sqrt(3 sigma_a sigma_t') for sigma_t' = 1 [1/mfp]
        return flux(x, 1.0, sigma) + flux(x, self.image, sigma)

    def shape_energy(self, x: Array, alpha: Array) -> Array:
        sigma = jnp.sqrt(3.0 * (1.0 - alpha))
        return flux_within(x, 1.0, sigma) + flux_within(x, self.image, sigma)


def diffuse_fresnel(n: float) -> float:
    """F_dr of a surface of relative index n [-], the paper's fit."""
    if n < 1.0:
        return -0.4399 + 0.7099 / n - 0.3319 / n**2 + 0.0636 / n**3
    return -1.440 / n**2 + 0.710 / n + 0.668 + 0.0636 * n


class BetterDipole(DiffusionLaw):
    """R_d = t alpha^2 (C_phi phi + C_E E): fluence phi and flux E of a source at depth 1 less its image, mixed.

    phi = (e^{-sigma d_r} / d_r - e^{-sigma d_v} / d_v) / (4 pi D), d^2 = x^2 + z^2, z_r = 1, z_v = 1 + 4 A D
    E = (z_r (1 + sigma d_r) e^{-sigma d_r} / d_r^3 + z_v (1 + sigma d_v) e^{-sigma d_v} / d_v^3) / (4 pi)
    D = (2 - alpha) / 3, sigma = sqrt((1 - alpha) / D)
    C_phi = (1 - 2 C_1) / 4, C_E = (1 - 3 C_2) / 2, A = (1 + 3 C_2) / (1 - 2 C_1), C_i Fresnel's moments inside

    Light scattered once is not in it (alpha^2, not alpha): the report adds it on its own. t is the share of the light
    that enters. Integrates to t alpha^2/2 e^{-sigma} (C_E (1 + e^{-4 A D sigma}) + C_phi (1 - e^{-4 A D sigma}) /
    (sigma D)), which is t at alpha = 1. Its share within x is closed. Finite at x = 0, where the half space is not.

    Source: E. d'Eon, A better dipole, technical report, 2012; its parts: E. d'Eon and G. Irving, A quantized-diffusion
    model for rendering translucent materials, SIGGRAPH 2011; its total reflectance: C. Hery, Texture mapping for the
    better dipole model, Pixar Technical Memo 12-11, 2012.
    """

    entry = Entry("better_dipole", "better dipole", n=ANY_INDEX, text=Text("better_dipole", PARTS, ENDS, CLAMPS))

    def text_numbers(self) -> dict[str, float]:
        """Return the share of light that enters, both factors of exitance, and the image's height over D less 1 [-]."""
        c_phi, c_e, mismatch = exitance_factors(self.setting.n)
        return {"entered": self.entered, "c_phi": c_phi, "c_e": c_e, "lift": 4.0 * mismatch}

    def prefactor(self, alpha: Array) -> Array:
        return alpha**2

    def shape_profile(self, x: Array, alpha: Array) -> Array:
        return exitance(x, 1.0, alpha, self.setting.n)

    def shape_energy(self, x: Array, alpha: Array) -> Array:
        return exitance_within(x, 1.0, alpha, self.setting.n)


# Depth t = min(x, 1) sinh(v) resolves both t ~ x, where the distance turns, and t ~ 1; e^{-t} ends at e^{-40}.
DEPTH_NODES = 48
DEEPEST = 40.0
NEAREST_EXIT = 1e-6
# What kappa takes away has e^{-2 d} in it: beyond 12 mfp nothing is left. Radii x u^3 resolve the r ln r at 0: to 5e-9.
RADIUS_NODES = 20
LAST_TAKEN = 12.0
# As mcml_sim.exact.single_scattering: a trapezoid in ln(k - k_c), whose error is e^{-pi^2 / step}.
K_STEP = 0.35
CRITICAL_NEAREST, CRITICAL_FARTHEST = -22.0, 30.0


class BeamDiffusion(DiffusionLaw):
    """R_d = t (R_1 + alpha^2 int_0^inf e^{-z} kappa (C_phi phi + C_E E) dz): single scattering, and a beam of dipoles.

    phi, E, D, sigma, C_phi, C_E, A  as in the better dipole, with z_r = z and z_v = z + 4 A D   (15.24)-(15.32)
    kappa = 1 - e^{-2 (d_r + z)}     takes from diffusion where source and exit are near
    R_1 = alpha / (4 pi) int_0^inf e^{-(z + d)} cos T(cos) / d^2 dz, cos = z / d   light scattered once, exactly, with T
                                     Fresnel's transmittance from inside

    t is the share of the light that enters. 2 pi x R_d tends to alpha/2 at x = 0 and n = 1, as in the half space. Its
    reflectance is its own: where nothing is absorbed a beam of better dipoles gives back all light, light scattered
    once comes on top and kappa takes away only part of that, so that alpha = 1 reflects 1.093 at n = 1.

    Source: R. Habel, P. Christensen and W. Jarosz, Photon beam diffusion, EGSR 2013, as M. Pharr, W. Jakob and G.
    Humphreys, Physically Based Rendering, 3rd edition, 2016, sec. 15.5, transcribe it (equation numbers are theirs).
    Both integrate over a few sampled depths; here quadrature does: profiles to 1e-12, shares to 1e-8.
    """

    halves: int = eqx.field(static=True, default=2)
    entry = Entry(
        "beam_diffusion",
        "photon beam diffusion",
        n=ANY_INDEX,
        text="law must have a closed form to become a shader, got beam_diffusion: its share within r is a quadrature "
        "of 20 by 48 nodes; better_dipole is its near relative",
    )

    def shape_profile(self, x: Array, alpha: Array) -> Array:
        safe = jnp.where(x > 0, x, 1.0)
        once = once_scattered(safe, self.setting.n, self.halves) / (2.0 * jnp.pi * safe)
        many = alpha * self._beam(safe, alpha, lambda depth, d: -jnp.expm1(-2.0 * (d + depth)))
        return jnp.where(x > 0, once + many, jnp.inf)

    def shape_energy(self, x: Array, alpha: Array) -> Array:
        # The beam's energy in closed form at each depth, less what kappa takes away.
        depth, weight = depths(x, self.halves)
        energy = exitance_within(x[..., None], depth, alpha[..., None], self.setting.n)
        many = jnp.sum(weight * energy, axis=-1) - self._taken(x, alpha)
        return once_scattered_within(x, self.setting.n, self.halves) + alpha * many

    def source_strength(self, alpha: Array) -> Array:
        return self.entered * alpha * once_scattered(jnp.zeros_like(alpha), self.setting.n, self.halves)

    def _beam(self, x: Array, alpha: Array, kappa) -> Array:
        """Return int e^{-z} kappa(z, d_r) (C_phi phi + C_E E) dz [1/mfp^2]."""
        depth, weight = depths(x, self.halves)
        x, alpha = x[..., None], alpha[..., None]
        light = exitance(x, depth, alpha, self.setting.n)
        return jnp.sum(weight * kappa(depth, jnp.sqrt(x**2 + depth**2)) * light, axis=-1)

    def _taken(self, x: Array, alpha: Array) -> Array:
        """Energy within x that kappa takes away [-]."""
        nodes, weights = np.polynomial.legendre.leggauss(RADIUS_NODES * self.halves // 2)
        u = jnp.asarray(0.5 * (nodes + 1.0), x.dtype)
        last = jnp.minimum(x, LAST_TAKEN)[..., None]
        r, dr = last * u**3, 1.5 * last * u**2 * jnp.asarray(weights, x.dtype)
        lost = self._beam(r, alpha[..., None], lambda depth, d: jnp.exp(-2.0 * (d + depth)))
        return jnp.sum(2.0 * jnp.pi * r * dr * lost, axis=-1)


def depths(x: Array, halves: int = 2) -> tuple[Array, Array]:
    """Depths of sources and their weights e^{-z} dz, along a last axis, for exits at radii x [mfp]."""
    nodes, weights = np.polynomial.legendre.leggauss(DEPTH_NODES * halves // 2)
    unit = jnp.clip(x, NEAREST_EXIT, 1.0)[..., None]
    half = 0.5 * jnp.arcsinh(DEEPEST / unit)
    v = half * (1.0 + jnp.asarray(nodes, x.dtype))
    depth = unit * jnp.sinh(v)
    return depth, jnp.exp(-depth) * unit * jnp.cosh(v) * half * jnp.asarray(weights, x.dtype)


def once_scattered(x: Array, n: float, halves: int = 2) -> Array:
    """2 pi x R_1 / alpha [1/mfp]: int k f(k) e^{-k x} dk."""
    k, weight = _once_scattered_nodes(n, halves)
    return jnp.exp(-x[..., None] * jnp.asarray(k, x.dtype)) @ jnp.asarray(k * weight, x.dtype)


def once_scattered_within(x: Array, n: float, halves: int = 2) -> Array:
    """Share of the light that entered and leaves within x after one scattering, over alpha [-]."""
    k, weight = _once_scattered_nodes(n, halves)
    return -jnp.expm1(-x[..., None] * jnp.asarray(k, x.dtype)) @ jnp.asarray(weight, x.dtype)


@lru_cache(maxsize=64)
def _once_scattered_nodes(n: float, halves: int) -> tuple[Floats, Floats]:
    """Nodes k = (z + d) / x and f(k) dk: light leaving at a cosine mu to the normal has k = cot(theta/2) at any depth.

    f = T(mu) (k^2 - 1) / (k (k^2 + 1)^2), mu = (k^2 - 1) / (k^2 + 1), from k_c, where total reflection ends.
    """
    sine = min(1.0 / n, 1.0)
    critical = (1.0 + np.sqrt((1.0 - sine) * (1.0 + sine))) / sine if n > 1.0 else 1.0
    step = 2.0 * K_STEP / halves
    beyond = np.exp(np.arange(CRITICAL_NEAREST, CRITICAL_FARTHEST, step))
    k = critical + beyond
    above = (beyond + (critical - 1.0)) * (k + 1.0)
    passed = 1.0 - fresnel(n, 1.0, above / (k * k + 1.0))[0]
    return k, passed * above / (k * (k * k + 1.0) ** 2) * step * beyond

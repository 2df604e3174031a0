"""Photon beam diffusion: dipoles all along the beam, corrected near it, and single scattering exact.

Source: R. Habel, P. Christensen and W. Jarosz, Photon beam diffusion: a hybrid Monte Carlo method for subsurface
scattering, EGSR 2013, as M. Pharr, W. Jakob and G. Humphreys, Physically Based Rendering, 3rd edition, 2016, sec. 15.5,
transcribe it (equation numbers are theirs). Both integrate over a few sampled depths; here quadrature does: profiles to
1e-12, shares to 1e-8, which `BeamDiffusion.finer` shows.
"""

from __future__ import annotations

from functools import lru_cache

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from mcml_sim.media import fresnel
from mcml_sim.media.setting import Setting
from profilefit.laws.diffusion import (
    DiffusionLaw,
    exitance_factors,
    fluence,
    fluence_within,
    flux,
    flux_within,
    grosjean,
)
from profilefit.laws.entry import ANY_INDEX, Entry
from profilefit.laws.rational import Normalisation

Floats = NDArray[np.float64]
# Depth t = min(x, 1) sinh(v) resolves both t ~ x, where the distance turns, and t ~ 1; e^{-t} ends at e^{-40}.
DEPTH_NODES = 48
DEEPEST = 40.0
NEAREST = 1e-6
# What kappa takes away has e^{-2 d} in it: beyond 12 mfp nothing is left. Radii x u^3 resolve the r ln r at 0: to 5e-9.
RADIUS_NODES = 20
LAST_TAKEN = 12.0
# As mcml_sim.exact.single_scattering: a trapezoid in ln(k - k_c), whose error is e^{-pi^2 / step}.
K_STEP = 0.35
CRITICAL_NEAREST, CRITICAL_FARTHEST = -22.0, 30.0
FINER = 3  # halves of the nodes that `finer` takes: none in common with the law's own


class BeamDiffusion(DiffusionLaw):
    """R_d = t (R_1 + alpha^2 int_0^inf e^{-z} kappa (C_phi phi + C_E E) dz): single scattering, and a beam of dipoles.

    phi, E, D, sigma, C_phi, C_E, A  as in the better dipole, with z_r = z and z_v = z + 4 A D   (15.24)-(15.32)
    kappa = 1 - e^{-2 (d_r + z)}     takes from diffusion where source and exit are near
    R_1 = alpha / (4 pi) int_0^inf e^{-(z + d)} cos T(cos) / d^2 dz, cos = z / d   light scattered once, exactly, with T
                                     Fresnel's transmittance from inside

    t is the share of the light that enters. 2 pi x R_d tends to alpha/2 at x = 0 and n = 1, as in the half space. Its
    reflectance is its own: where nothing is absorbed a beam of better dipoles gives back all light, light scattered
    once comes on top and kappa takes away only part of that, so that alpha = 1 reflects 1.093 at n = 1.
    """

    setting: Setting = eqx.field(static=True)
    albedo: Normalisation | None = eqx.field(static=True, default=None)
    halves: int = eqx.field(static=True, default=2)
    entry = Entry(
        "beam_diffusion",
        "photon beam diffusion",
        n=ANY_INDEX,
        text="law must have a closed form to become a shader, got beam_diffusion: its share within r is a quadrature "
        "of 20 by 48 nodes; better_dipole is its near relative",
    )

    @property
    def finer(self) -> BeamDiffusion:
        """Law with half as many nodes again in each quadrature: the change is the error of the quadratures."""
        return BeamDiffusion(self.setting, self.albedo, FINER)

    def prefactor(self, alpha: Array) -> Array:
        return alpha

    def shape_profile(self, x: Array, alpha: Array) -> Array:
        safe = jnp.where(x > 0, x, 1.0)
        once = once_scattered(safe, self.setting.n, self.halves) / (2.0 * jnp.pi * safe)
        many = alpha * self._beam(safe, alpha, lambda depth, d: -jnp.expm1(-2.0 * (d + depth)))
        return jnp.where(x > 0, once + many, jnp.inf)

    def shape_energy(self, x: Array, alpha: Array) -> Array:
        return once_scattered_within(x, self.setting.n, self.halves) + alpha * self._beam_within(x, alpha)

    def source_strength(self, alpha: Array) -> Array:
        return self.entered * alpha * once_scattered(jnp.zeros_like(alpha), self.setting.n, self.halves)

    def _beam(self, x: Array, alpha: Array, kappa) -> Array:
        """Return int e^{-z} kappa(z, d_r) (C_phi phi + C_E E) dz [1/mfp^2]."""
        depth, weight = depths(x, self.halves)
        x, alpha = x[..., None], alpha[..., None]
        c_phi, c_e, a = exitance_factors(self.setting.n)
        diffusion, sigma = grosjean(alpha)
        image = depth + 4.0 * a * diffusion
        inside = fluence(x, depth, sigma) - fluence(x, image, sigma)
        exitance = c_phi / diffusion * inside + c_e * (flux(x, depth, sigma) + flux(x, image, sigma))
        return jnp.sum(weight * kappa(depth, jnp.sqrt(x**2 + depth**2)) * exitance, axis=-1)

    def _beam_within(self, x: Array, alpha: Array) -> Array:
        """Return the beam's energy within x [-]: in closed form at each depth, less what kappa takes away."""
        depth, weight = depths(x, self.halves)
        c_phi, c_e, a = exitance_factors(self.setting.n)
        diffusion, sigma = grosjean(alpha[..., None])
        image = depth + 4.0 * a * diffusion
        r = x[..., None]
        through = flux_within(r, depth, sigma) + flux_within(r, image, sigma)
        energy = c_phi / diffusion * fluence_within(r, depth, image, sigma) + c_e * through
        return jnp.sum(weight * energy, axis=-1) - self._taken(x, alpha)

    def _taken(self, x: Array, alpha: Array) -> Array:
        """Energy within x that kappa takes away [-]."""
        nodes, weights = _gauss(RADIUS_NODES * self.halves // 2)
        u = jnp.asarray(0.5 * (nodes + 1.0), x.dtype)
        last = jnp.minimum(x, LAST_TAKEN)[..., None]
        r, dr = last * u**3, 1.5 * last * u**2 * jnp.asarray(weights, x.dtype)
        lost = self._beam(r, alpha[..., None], lambda depth, d: jnp.exp(-2.0 * (d + depth)))
        return jnp.sum(2.0 * jnp.pi * r * dr * lost, axis=-1)


@lru_cache(maxsize=8)
def _gauss(count: int) -> tuple[Floats, Floats]:
    return np.polynomial.legendre.leggauss(count)


def depths(x: Array, halves: int = 2) -> tuple[Array, Array]:
    """Depths of sources and their weights e^{-z} dz, along a last axis, for exits at radii x [mfp]."""
    nodes, weights = _gauss(DEPTH_NODES * halves // 2)
    unit = jnp.clip(x, NEAREST, 1.0)[..., None]
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
    passed = 1.0 - fresnel.fresnel(n, 1.0, above / (k * k + 1.0))[0]
    return k, passed * above / (k * (k * k + 1.0) ** 2) * step * beyond

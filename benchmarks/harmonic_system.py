"""Half space whose scattering has a direction, at one transverse wave number: mirror, escape cone and harmonics.

As in `cone`, the surface is a mirror, which makes the half space an infinite medium, less the light that leaves through
the escape cone. The radiance that light scattered into direction Omega makes at wave vector K = (k, 0, x) has moments

    psi_lm(x) = int Z_lm I dOmega,        Q_lm = alpha g_l psi_lm,       g_l = int p P_l

and with tau = 1 + i k sin(theta) cos(phi), T Fresnel's transmittance from inside, and w the weights of x and of Omega,

    psi = psi_0 + F Q - sum_Omega w mu T C J,        J(Omega) = sum_x (w / 2 pi) C Q        what arrives at the surface
    C(Omega; x, lm) = Z_lm(Omega) a,        a = 2 tau / (tau^2 + x^2 mu^2) if l + m is even, -2 i x mu / (...) if odd
    psi_0 = Z_l0(1) a (mu = 1, k = 0) under a searchlight,   sum_Omega w mu (n^2 T / pi) C   under diffuse light
    R^(k) = entered sum_Omega w mu T J

F being `harmonics.flights`, x > 0 (the rest follows by parity). In the unknowns sqrt(w g_l / 2 pi) psi the operator is
symmetric and knows nothing of alpha: order n of R^ is alpha^n b . M^(n-1) s. Only the phase function is truncated, at
`degree`; its highest moments fade, since what is cut off at once comes back as ripples at all angles.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from benchmarks import harmonics
from mcml_sim.exact.special_functions import panels
from mcml_sim.media.arrays import Floats
from mcml_sim.media.medium import fresnel

Complexes = NDArray[np.complex128]
FADES = 0.5  # of the degree: where moments begin to fade
# x runs on a ray, away from K = 0, about which the frame along K turns for ever. Light of order n grows by
# cos(TILT)^-n on it.
TILT = np.pi / 8
# In x. Light of order n goes as e^{-i n arctan x} (1 + x^2)^{-n/2}.
PANELS, MIDDLE, FARTHEST = 5, (0.3, 0.6, 0.9, 1.2, 1.8, 3.0, 5.5, 9.0), 120.0
OUTSIDE, AROUND = 8, 4  # directions of the cone, by polar angle, and by azimuth beside the degree: 1e-8


class HarmonicSystem(NamedTuple):
    """Matrix M and vectors b and s at one k. Unknowns (x, degree + 1, degree + 1)."""

    rotation: Array
    flight: Array
    root: Array
    """Roots sqrt(g_l), (degree + 1, 1)."""
    scale: Array
    """Scales sqrt(w g_l / 2 pi), (x, degree + 1, 1)."""
    even: Array
    """Part of a where l + m is even, (Omega, x)."""
    odd: Array
    even_waves: Array
    """Harmonics Z_lm where l + m is even and m <= l, (Omega, pairs)."""
    odd_waves: Array
    weight: Array
    """Weights w mu T, (Omega,)."""
    source: Array
    """Source s under a searchlight."""
    leaving: Array
    """Vector b; under diffuse light s is n^2 / pi of it."""


class Directions(NamedTuple):
    """Directions of the escape cone, arrays (Omega,)."""

    mu: Floats
    along: Floats
    """Component sin(theta) cos(phi)."""
    even: Floats
    """Harmonics as in `HarmonicSystem.even_waves`."""
    odd: Floats
    weight: Floats


def moments(g: float, degree: int) -> Floats:
    """Return g_l of Henyey and Greenstein's phase function, faded to 0 beyond the degree, (degree + 1,)."""
    ell = np.arange(degree + 1)
    fading = np.clip((ell - FADES * degree) / (degree + 1 - FADES * degree), 0.0, 1.0)
    return g**ell * np.cos(0.5 * np.pi * fading) ** 2


def directions(n: float, degree: int) -> Directions:
    """Return Gauss nodes by the cosine outside, in which Fresnel's transmittance is smooth; midpoints in azimuth."""
    t, weight = np.polynomial.legendre.leggauss(OUTSIDE)
    outside, count = 0.5 * (t + 1.0), AROUND + degree
    mu, sine = np.sqrt(1.0 - (1.0 - outside**2) / n**2), np.sqrt(1.0 - outside**2) / n
    passed = (1.0 - fresnel(n, 1.0, mu)[0]) * outside / n**2 * 0.5 * weight  # mu T dmu
    phi = np.tile(np.pi * (np.arange(count) + 0.5) / count, OUTSIDE)
    mu, sine, passed = (np.repeat(part, count) for part in (mu, sine, passed * 2.0 * np.pi / count))
    waves = harmonics.harmonics(degree, mu, phi).reshape(mu.size, -1)
    even, odd = _pairs(degree)
    return Directions(mu, sine * np.cos(phi), waves[:, even], waves[:, odd], passed)


def depth_nodes(k: complex, per_panel: int) -> tuple[Complexes, Complexes]:
    """Return x and weights: panels from the scale of k, the last to infinity in 1 / x."""
    first = min(0.02, max(abs(k) / 4.0, 1e-5))
    near = np.append(0.0, np.geomspace(first, MIDDLE[0], PANELS))
    edges = np.concatenate([near, MIDDLE[1:], np.geomspace(MIDDLE[-1], FARTHEST, 4)[1:]])
    t, weight = np.polynomial.legendre.leggauss(per_panel)
    u, du = 0.5 * (t + 1.0) / edges[-1], 0.5 * weight / edges[-1]
    x, dx = panels(edges, per_panel)
    turn = np.exp(1j * TILT)
    return turn * np.append(x, 1.0 / u), turn * np.append(dx, du / u**2)


def system(g: Array, k: Array, x: Array, dx: Array, of: Directions) -> HarmonicSystem:
    """Return the system at k, complex128 () with an imaginary part below 1; `g` are the moments."""
    degree = g.size - 1
    ell, m = np.arange(degree + 1)[:, None], np.arange(degree + 1)[None]
    wave = jnp.sqrt(k * k + x * x)
    root = jnp.sqrt(g)[:, None]
    scale = jnp.sqrt(dx / (2.0 * np.pi))[:, None, None] * root
    tau = (1.0 + 1j * k * of.along)[:, None]
    across = x * of.mu[:, None]
    even, odd = 2.0 * tau / (tau**2 + across**2), -2j * across / (tau**2 + across**2)
    down = jnp.sqrt((2 * ell + 1) / (4.0 * np.pi)) * (m == 0)
    below = jnp.where(ell % 2 == 0, (2.0 / (1.0 + x * x))[:, None, None], (-2j * x / (1.0 + x * x))[:, None, None])
    empty = HarmonicSystem(
        harmonics.rotations(degree, 1j * jnp.log((x + 1j * k) / wave)),
        harmonics.flights(degree, wave),
        root,
        scale,
        even,
        odd,
        jnp.asarray(of.even),
        jnp.asarray(of.odd),
        jnp.asarray(of.weight),
        scale * down * below,
        jnp.zeros((x.size, degree + 1, degree + 1), complex),
    )
    return empty._replace(leaving=returned(empty, jnp.ones_like(empty.weight)))


def applied(of: HarmonicSystem, v: Array) -> Array:
    """Return M v."""
    return of.root * in_own_frames(of, of.flight, of.root * v) - returned(of, arriving(of, v))


def in_own_frames(of: HarmonicSystem, blocks: Array, v: Array) -> Array:
    """Return blocks (x, m, l, l') that act where K is the axis."""
    turned = jnp.einsum("xlMm,xlm->xlM", of.rotation, v)
    turned = jnp.einsum("xMlk,xkM->xlM", blocks, turned)
    return jnp.einsum("xlMm,xlM->xlm", of.rotation, turned)


def inverse_of_flights(of: HarmonicSystem, alpha: Array) -> Array:
    """Return blocks of the inverse of 1 - alpha F, the infinite medium's."""
    return jnp.linalg.inv(jnp.eye(of.root.size) - alpha * of.root * of.flight * of.root[:, 0])


def arriving(of: HarmonicSystem, v: Array) -> Array:
    """Return the light that arrives at the surface, (Omega,), of unknowns."""
    q = (of.scale * v).reshape(v.shape[0], -1)
    even, odd = _pairs(of.root.size - 1)
    return jnp.sum(of.even * _times(of.even_waves, q[:, even].T) + of.odd * _times(of.odd_waves, q[:, odd].T), axis=1)


def returned(of: HarmonicSystem, j: Array) -> Array:
    """Return what is missing behind the surface, in unknowns, where j (Omega,) arrives and leaves."""
    even, odd = _pairs(of.root.size - 1)
    leaving, shape = (of.weight * j)[:, None], of.leaving.shape
    missing = jnp.zeros((shape[0], shape[1] * shape[2]), complex)
    missing = missing.at[:, even].set(_times(of.even_waves.T, of.even * leaving).T)
    missing = missing.at[:, odd].set(_times(of.odd_waves.T, of.odd * leaving).T)
    return of.scale * missing.reshape(shape)


def _times(matrix: Array, values: Array) -> Array:
    """Multiply real by complex."""
    return jax.lax.complex(matrix @ values.real, matrix @ values.imag)


@lru_cache(maxsize=8)
def _pairs(degree: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return places of (l, m) with m <= l in a flattened square, where l + m is even, and odd."""
    ell, m = np.indices((degree + 1, degree + 1)).reshape(2, -1)
    even = (ell + m) % 2 == 0
    return np.flatnonzero((m <= ell) & even), np.flatnonzero((m <= ell) & ~even)

"""Spherical harmonics that are even in azimuth, their rotation about y, and free flight among them, over jax.numpy.

Z_lm = P_lm(mu) cos(m phi) / sqrt(pi (1 + [m = 0])) with int P_lm^2 dmu = 1 is normalised to int Z_lm^2 dOmega = 1.
Arrays over (l, m) are squares (degree + 1, degree + 1) that hold 0 where m > l.

Light that flies freely from a source Z_l'm' e^{i K . x} has the moments int Z_lm Z_l'm' / (1 + i K . Omega) dOmega. In
a frame along K = (k, 0, x) they do not mix different m; so they are a rotation, blocks, and the rotation back.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

NODES = 80  # of Gauss and Legendre, along K


def legendre(degree: int, mu: Any) -> Array:
    """Return P_lm at cosines mu (...), (degree + 1, degree + 1, ...)."""
    sine, zero = jnp.sqrt((1.0 - mu) * (1.0 + mu)), jnp.zeros_like(mu)
    columns, first = [], jnp.full_like(mu, np.sqrt(0.5))
    for m in range(degree + 1):
        if m:
            first = first * sine * np.sqrt((2 * m + 1) / (2 * m))
        rows = [zero] * m + [first]
        for ell in range(m + 1, degree + 1):
            a = np.sqrt((4 * ell**2 - 1) / (ell**2 - m * m))
            b = np.sqrt(((ell - 1) ** 2 - m * m) / (4 * (ell - 1) ** 2 - 1))
            rows.append(a * (mu * rows[ell - 1] - (b * rows[ell - 2] if ell - 2 >= m else 0.0)))
        columns.append(jnp.stack(rows))
    return jnp.stack(columns, axis=1)


def harmonics(degree: int, mu: NDArray, phi: NDArray) -> NDArray:
    """Return Z_lm in directions (...), (..., degree + 1, degree + 1)."""
    m = np.arange(degree + 1)
    waves = np.cos(np.multiply.outer(phi, m)) / np.sqrt(np.pi * (1 + (m == 0)))
    return np.moveaxis(np.asarray(legendre(degree, jnp.asarray(mu))), (0, 1), (-2, -1)) * waves[..., None, :]


def rotations(degree: int, beta: Array) -> Array:
    """Return rotations by complex angles beta (x,), which bring K from (sin, 0, cos) to the pole: (x, l, m, m)."""
    turns, vectors = _generators(degree)
    return jnp.einsum("lmj,xlj,lnj->xlmn", vectors, jnp.exp(-1j * beta[:, None, None] * turns), vectors.conj())


@lru_cache(maxsize=8)
def _generators(degree: int) -> tuple[NDArray, NDArray]:
    """Return eigenvalues over -i, (l, j), and eigenvectors, (l, m, j), of the rotation about y."""
    size = degree + 1
    turns, vectors = np.zeros((size, size)), np.zeros((size, size, size), complex)
    for ell in range(size):
        m = np.arange(ell)
        step = 0.5 * np.sqrt((ell - m) * (ell + m + 1)) * np.where(m == 0, np.sqrt(2.0), 1.0)
        pair = np.linalg.eigh(1j * (np.diag(step, -1) - np.diag(step, 1)))
        turns[ell, : ell + 1], vectors[ell, : ell + 1, : ell + 1] = pair
    return turns, vectors


def flights(degree: int, wave: Array) -> Array:
    """Return int P_lm P_l'm / (1 + i K mu) dmu at K = `wave` (x,), not i times more than 1: (x, m, l, l')."""
    t, weight = np.polynomial.legendre.leggauss(NODES)
    size = jnp.maximum(jnp.abs(wave), 1e-6)[:, None]
    reach = jnp.arcsinh(size)
    mu, dmu = jnp.sinh(t * reach) / size, jnp.cosh(t * reach) * reach / size * weight
    p = legendre(degree, mu)
    return jnp.einsum("lmxj,xj,kmxj->xmlk", p, dmu / (1.0 + 1j * wave[:, None] * mu), p)

"""Light scattered more often than a given number of times, in a half space whose scattering has a direction.

The first orders, near the source, need every detail of the phase function; photons have them. What remains is wide and
needs few harmonics and few wave numbers: its transform has fallen by 1e-6 at k = 1.6 / mfp.

R^ is wanted on lines that start below i kappa (`by_albedo`), for groups of albedos of nearly one kappa.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial
from itertools import pairwise
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray
from scipy.special import hankel1

from benchmarks import harmonic_system as systems
from mcml_sim.exact.compiled import jit
from mcml_sim.exact.forwards import decay_rate
from mcml_sim.exact.single_scattering import entered
from mcml_sim.exact.special_functions import panels
from mcml_sim.media.arrays import Floats
from mcml_sim.media.setting import Setting

Complexes = NDArray[np.complex128]

KAPPAS = (1.01, 0.5, 0.22, 0.09, 0.035, 0.0)  # between groups
START = 0.88  # of a group's least kappa: where its line starts on the imaginary axis,
TILT, TOP = np.pi / 8, 0.92  # at this angle to the real axis, up to this imaginary part, and level from there
LAST_WAVE = 1.6
NODES, GROWTH, WIDEST = 7, 2.5, 0.3  # of a panel, from one to the next, and at most
LEAST_WAVE = 1e-5
CHUNK = 16  # wave numbers at once


class Fineness(NamedTuple):
    """Fineness of a solution."""

    degree: int
    per_panel: int = 7
    steps: int = 6
    """Size of the Krylov space: 4 leave 1e-12."""


DEGREES = ((0.25, 8), (0.45, 10), (0.65, 12), (0.85, 14), (1.0, 16))
"""Degree by g up to: four more change light from .05 to 15 l* by 4e-6, 9e-4 at g = .58, .9 (`half_spaces --finer`)."""


def fine(g: float) -> Fineness:
    """Return the fineness of the table."""
    return Fineness(next(degree for most, degree in DEGREES if g <= most))


class Contour(NamedTuple):
    """Line of wave numbers on which R^ is needed for some albedos."""

    k: Complexes
    dk: Complexes
    alpha: Floats


def lines(alphas: Floats, g: float) -> list[tuple[Contour, NDArray[np.intp]]]:
    """Return the lines of all albedos (m,) below 1, each with the indices of its own."""
    kappas = np.array([decay_rate(alpha, g) for alpha in alphas])
    groups = []
    for high, low in pairwise(KAPPAS):
        own = np.flatnonzero((kappas <= high) & (kappas > low))
        if own.size:
            groups.append((Contour(*_contour(kappas[own].min()), alphas[own]), own))
    return groups


def _contour(kappa: float) -> tuple[Complexes, Complexes]:
    start, rise = START * kappa, np.tan(TILT)
    edges = [0.0, max(0.1 * kappa, LEAST_WAVE)]
    while edges[-1] < LAST_WAVE:
        edges.append(min(edges[-1] * GROWTH, edges[-1] + WIDEST, LAST_WAVE))
    corner = (TOP - start) / rise
    edges = sorted({*edges, corner} if 0.0 < corner < LAST_WAVE else edges)
    s, ds = panels(np.array(edges), NODES)
    climbs = start + s * rise < TOP
    return s + 1j * np.where(climbs, start + s * rise, TOP), ds * (1.0 + 1j * rise * climbs)


def transforms(n: float, g: float, beyond: int, k: Complexes, alpha: Floats, rule: Fineness) -> Complexes:
    """Return R^ of the orders beyond so many, at wave numbers (k,) and albedos (m,), of both lights: (2, k, m)."""
    with jax.enable_x64(True):
        of = directions(n, rule.degree)
        moments = jnp.asarray(systems.moments(g, rule.degree))
        parts = []
        at_once = min(CHUNK, k.size)
        full = np.pad(k, (0, -k.size % at_once), mode="edge").reshape(-1, at_once)
        for part in full:
            nodes = np.array([systems.depth_nodes(wave, rule.per_panel) for wave in part])
            solved = _solved(
                moments, jnp.asarray(part), nodes[:, 0], nodes[:, 1], jnp.asarray(alpha), of, beyond, rule.steps
            )
            parts.append(np.asarray(solved))
        both = np.concatenate(parts, axis=1)[:, : k.size]
    return both * np.array([entered(Setting(n=n)), n**2 / np.pi])[:, None, None]


def totals(n: float, g: float, beyond: int, alpha: Floats, rule: Fineness) -> Floats:
    """Return the share of these orders in the light that arrives, of searchlight and diffuse: (2, m)."""
    k = np.array([LEAST_WAVE / 10.0 + 0j])
    return transforms(n, g, beyond, k, alpha, rule._replace(per_panel=2 * rule.per_panel))[:, 0].real


directions = lru_cache(maxsize=8)(systems.directions)


@partial(jit, static_argnums=(6, 7))
def _solved(
    g: Array, k: Array, x: Array, dx: Array, alpha: Array, of: systems.Directions, beyond: int, steps: int
) -> Array:
    def at(k: Array, x: Array, dx: Array) -> Array:
        return _resolved(systems.system(g, k, x, dx, of), alpha, beyond, steps)

    return jnp.moveaxis(jax.vmap(at)(k, x, dx), 1, 0)


def _resolved(of: systems.HarmonicSystem, alpha: Array, beyond: int, steps: int) -> Array:
    """Return alpha^(N+1) s . (1 - alpha M)^-1 M^N b for s of a searchlight and b itself: (2, m).

    Without the surface the inverse is one of small blocks; what the surface does is an equation for the light that
    arrives at it, whose Krylov space is small for any alpha.
    """
    late = jax.lax.fori_loop(0, beyond, lambda _, v: systems.applied(of, v), of.leaving)

    def at_albedo(alpha: Array) -> Array:
        inverse = systems.inverse_of_flights(of, alpha)

        def spread(v: Array) -> Array:
            return systems.in_own_frames(of, inverse, v)

        def surface(y: Array) -> Array:
            return y + alpha * systems.arriving(of, spread(systems.returned(of, y)))

        y = _solution(surface, systems.arriving(of, spread(late)), steps)
        u = spread(late - alpha * systems.returned(of, y))
        return alpha ** (beyond + 1) * jnp.stack([jnp.sum(of.source * u), jnp.sum(of.leaving * u)])

    return jax.lax.map(at_albedo, alpha).T


def _solution(operator: Callable[[Array], Array], source: Array, steps: int) -> Array:
    """Solve operator y = source by Arnoldi's method (full orthogonalisation, Saad 1981)."""
    size = jnp.linalg.norm(source)
    basis = jnp.zeros((steps + 1, source.size), complex).at[0].set(source / size)
    small = jnp.zeros((steps + 1, steps), complex)

    def step(j: Array, state: tuple[Array, Array]) -> tuple[Array, Array]:
        basis, small = state
        w = operator(basis[j])
        once = basis.conj() @ w
        w = w - once @ basis
        correction = basis.conj() @ w  # what rounding left
        w = w - correction @ basis
        rest = jnp.linalg.norm(w)
        small = small.at[:, j].set((once + correction).at[j + 1].set(rest))
        return basis.at[j + 1].set(w / jnp.maximum(rest, 1e-200)), small

    basis, small = jax.lax.fori_loop(0, steps, step, (basis, small))
    return size * jnp.linalg.solve(small[:steps], jnp.eye(steps)[0]) @ basis[:steps]


def ring_density(line: Contour, values: Complexes, x: Floats) -> tuple[Floats, Floats]:
    """Return 2 pi x R_d [1/mfp] at radii (x,) from R^ on a line, (..., k, m): (..., x, m).

    And its share in the sizes of the waves that it is the sum of: what cancels takes digits.
    """
    k, dk, finer = _refined(line, values)
    waves = hankel1(0, np.multiply.outer(x, k)) * (k * dk)
    sums: Floats = (waves @ finer).real
    return x[:, None] * sums, np.abs(sums) / (np.abs(waves) @ np.abs(finer))


def _refined(line: Contour, values: Complexes) -> tuple[Complexes, Complexes, Complexes]:
    """Return k, dk and R^ at four times as many nodes a panel: R^ is a polynomial there, waves of far radii are not."""
    coarse, weight = np.polynomial.legendre.leggauss(NODES)
    fine, fine_weight = np.polynomial.legendre.leggauss(4 * NODES)
    way = np.stack([np.prod((fine[:, None] - (rest := np.delete(coarse, at))) / (t - rest), axis=1)
                    for at, t in enumerate(coarse)], axis=1)  # fmt: skip
    dk = (line.dk.reshape(-1, NODES) / weight)[:, :1] * fine_weight
    panels = values.reshape(*values.shape[:-2], -1, NODES, values.shape[-1])
    finer = (way @ panels).reshape(*values.shape[:-2], -1, values.shape[-1])
    return (line.k.reshape(-1, NODES) @ way.T).ravel(), dk.ravel(), finer

"""Transform of the half space under a refracting surface, n > 1, for every albedo.

`cone` has it at one wave number k, from one matrix for all albedos. On the way back to r a contour must start below
i kappa, the closer the farther r is, and kappa is the albedo's own. So albedos go by groups of kappa, each with a line
from i b to 8 e^{i pi/4}, in panels that grow, of Gauss's nodes. From there one ray serves all, where R^ is its first
orders of scattering, a polynomial in alpha. On a line R^(k) / alpha is a polynomial in w = sqrt(1 - alpha arctan(k)/k):
the singularity where k = i kappa is where w = 0, in which alpha is analytic. `new_table` finds the polynomials, once
for an n, from albedos that put w on Chebyshev's nodes, and `transform` reads them off at an albedo. A table takes
seconds and is a megabyte: it is kept in memory and in the user's cache folder, where the next process finds it.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import astuple
from functools import lru_cache, partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from mcml_sim.exact import cone
from mcml_sim.exact.compiled import jit
from mcml_sim.exact.light import nodes as chebyshev_nodes
from mcml_sim.exact.single_scattering import entered
from mcml_sim.exact.special_functions import dispersion, panels, square_root
from mcml_sim.exact.transform import NO_LIGHT, Rule, Transform
from mcml_sim.files.npz import kept
from mcml_sim.media.arrays import Floats
from mcml_sim.media.setting import ILLUMINATIONS, Setting

Complexes = NDArray[Any]

KAPPAS = np.array([1.0, 0.88, 0.72, 0.55, 0.4, 0.28, 0.19, 0.12, 0.06, 0.0])  # decay rates between the groups
ALPHAS = np.append(0.0, np.append(KAPPAS[1:-1] / np.arctanh(KAPPAS[1:-1]), 1.0))  # the same as albedos
START = 0.88  # b, of a group's least kappa
FIRST_PANEL = 0.1  # of that kappa; and of the last group, where it is 0:
FIRST_WAVE = 1e-5  # [1/mfp]
FARTHEST = 1e3  # mfp: at alpha = 1, R_d is taken for its power, r^-3, from here on
GROWTH, LAST_GROWTH = 3.5, 4.5  # of panels, at most, before and beyond the ray's middle
DIRECTION = complex(np.exp(0.25j * np.pi))
CORNER, MIDDLE, LAST_WAVE = 8.0, 300.0, 3.5e7  # of the ray [1/mfp]
# Nodes of `cone` beyond the corner and beyond the middle, where edges of the cone lie far apart: of those before it.
MIDDLE_NODES, LAST_NODES = (5 / 3, 4 / 3), (5 / 2, 16 / 9)
ORDERS = 18  # of scattering along the ray: the next has (pi / 16)^18 of the light
ORIGIN = 1e-6 * DIRECTION  # stands for k = 0
CHUNK = 16  # wave numbers at once
LEAST = 1.0 + 1e-9  # n of the least surface that refracts
VERSION = 2  # of what `new_table` puts into a table; a file of another version, or number of nodes, has another name


class Table(NamedTuple):
    """Arrays that albedos share under one surface."""

    lines: Complexes  # Chebyshev coefficients of R^(k) / alpha on the lines, and at 0: (2 lights, groups, k, degree)
    ray: Complexes  # transform of each order of scattering, on the ray: (2 lights, k, orders)


class _Contour(NamedTuple):
    k: Complexes
    dk: Complexes


def transform(table: Table, alpha: jax.Array, light: int, rule: Rule) -> Transform:
    """Return the transform of one albedo, a float64 scalar in [0, 1]; `light`: 0 searchlight, 1 diffuse."""
    group = _group(alpha)
    lines, ray = _lines(rule.line), _ray(rule.line)
    k, dk = (
        jnp.append(jnp.stack([getattr(line, name) for line in lines])[group], getattr(ray, name))
        for name in _Contour._fields
    )
    own = jnp.asarray(table.lines)[light, group]
    near = k[: own.shape[0] - 1]
    first, last = (_root(jnp.asarray(ALPHAS)[group + end], near) for end in (0, 1))
    values = _sum(own[:-1], (2.0 * _root(alpha, near) - first - last) / (first - last))  # -1 to 1 in w, in the group
    beyond = jnp.asarray(table.ray)[light] @ (alpha ** np.arange(ORDERS))
    pole = jnp.where(group == KAPPAS.size - 2, 0.5, 0.0)  # the last line starts at the origin, H1's pole
    farthest = jnp.where(alpha == 1.0, FARTHEST, NO_LIGHT)
    return Transform(k, dk, jnp.append(values, beyond), total(table, alpha, light), pole, farthest)


def total(table: Table, alpha: jax.Array, light: int) -> jax.Array:
    """Return A / alpha of one albedo."""
    group = _group(alpha)
    return _total(alpha, jnp.asarray(table.lines)[light, group, -1], group)


def _group(alpha: jax.Array) -> jax.Array:
    return jnp.searchsorted(ALPHAS[1:-1], jax.lax.stop_gradient(alpha))


def _root(alpha: jax.Array, k: Any) -> jax.Array:
    return square_root(dispersion(alpha, k * k))


def _sum(coefficients: jax.Array, z: jax.Array) -> jax.Array:
    """Sum Chebyshev polynomials by Clenshaw's recurrence: (..., degree) and (...)."""
    last, two = jnp.zeros_like(z), jnp.zeros_like(z)
    for index in range(coefficients.shape[-1] - 1, 0, -1):
        last, two = 2.0 * z * last - two + coefficients[..., index], last
    return z * last - two + coefficients[..., 0]


@jax.custom_jvp
def _total(alpha: jax.Array, coefficients: jax.Array, group: jax.Array) -> jax.Array:
    """Return A / alpha, at k = 0."""
    return _total_of(jnp.sqrt(1.0 - alpha), coefficients, group)


@_total.defjvp
def _total_jvp(primals: tuple, tangents: tuple) -> tuple[jax.Array, jax.Array]:
    """Differentiate A / alpha: infinite at alpha = 1."""
    alpha, coefficients, group = primals
    w = jnp.sqrt(1.0 - alpha)
    value, slope = jax.jvp(lambda root: _total_of(root, coefficients, group), (w,), (jnp.ones_like(w),))
    return value, slope * (-0.5 / w) * tangents[0] + _total_of(w, tangents[1], group)


def _total_of(w: jax.Array, coefficients: jax.Array, group: jax.Array) -> jax.Array:
    first, last = (jnp.sqrt(1.0 - jnp.asarray(ALPHAS)[group + end]) for end in (0, 1))
    return _sum(coefficients, ((2.0 * w - first - last) / (first - last)).astype(complex)).real


def new_table(n: float, rule: Rule, slope: bool = False) -> Table:
    """Return the table of one n > 1, or its derivative by n, in seconds."""
    ray = _ray(rule.line).k
    beyond = np.abs(ray) > MIDDLE
    sizes = _sizes(rule, MIDDLE_NODES), _sizes(rule, LAST_NODES)
    parts = [partial(_line, n, group, line, rule, slope) for group, line in enumerate(_lines(rule.line))]
    parts += [partial(_origins, n, rule, slope)]
    parts += [
        partial(_in_chunks, partial(_series, n, x_nodes=x_nodes, angles=angles, slope=slope), part)
        for part, (x_nodes, angles) in zip((ray[~beyond], ray[beyond]), sizes, strict=True)
    ]
    with threadpool_limits(1, "blas"), ThreadPoolExecutor(os.cpu_count()) as pool:  # the longest of them are last
        *of_lines, totals, near, far = list(pool.map(_in_double, reversed(parts)))[::-1]
    lines = np.concatenate([np.stack(of_lines, axis=1), totals[:, :, None]], axis=2)
    if not slope:  # what enters comes out again where nothing is absorbed, z = -1
        for light, name in enumerate(ILLUMINATIONS):
            white = lines[light, -1, -1]
            white[0] += entered(Setting(name, n)) - white @ (-1.0) ** np.arange(rule.degree)
    return Table(lines, np.concatenate([near, far], axis=1))


def _in_double(part: Callable[[], Complexes]) -> Complexes:
    """Call a function in double precision."""
    with jax.enable_x64(True), jax.core.eval_context():  # which holds for a thread
        return part()


def _origins(n: float, rule: Rule, slope: bool) -> Complexes:
    """Return the polynomials of every group at k = 0: (2, groups, degree)."""
    first, last = np.sqrt(1.0 - ALPHAS[:-1, None]), np.sqrt(1.0 - ALPHAS[1:, None])
    alpha = 1.0 - (0.5 * (first + last) + 0.5 * (first - last) * chebyshev_nodes(rule.degree)) ** 2
    origins = np.full(CHUNK, ORIGIN)  # as many as wave numbers go together: one program serves both
    return _polynomials(_resolvents(n, origins, alpha, *_sizes(rule, MIDDLE_NODES), slope))


def shapes(rule: Rule) -> Table:
    """Return the shapes of a table's arrays, as jax.ShapeDtypeStruct."""
    lines, ray = _lines(rule.line), _ray(rule.line)
    shape = (2, len(lines), lines[0].k.size + 1, rule.degree), (2, ray.k.size, ORDERS)
    made_of: Any = [jax.ShapeDtypeStruct(size, np.complex128) for size in shape]
    return Table(*made_of)


def _line(n: float, group: int, line: _Contour, rule: Rule, slope: bool) -> Complexes:
    """Return the polynomials of a group: (2, k, degree)."""
    z, own = chebyshev_nodes(rule.degree), line.k[line.dk != 0]

    def values(part: Complexes) -> Complexes:
        first, last = (np.asarray(_root(jnp.asarray(ALPHAS[group + end]), part)) for end in (0, 1))
        w = 0.5 * (first + last)[:, None] + 0.5 * (first - last)[:, None] * z
        alpha = (1.0 - w * w) / (1.0 - np.asarray(_root(jnp.ones(()), part))[:, None] ** 2)
        return _resolvents(n, part, alpha, rule.depth, rule.angles, slope)

    coefficients = _polynomials(_in_chunks(values, own))
    return np.pad(coefficients, ((0, 0), (0, line.k.size - own.size), (0, 0)), mode="edge")


def _polynomials(values: Complexes) -> Complexes:
    """Return coefficients of Chebyshev polynomials from values on their nodes, the last axis of both."""
    degree = values.shape[-1]
    angles = np.arccos(chebyshev_nodes(degree))
    coefficients: Complexes = 2.0 / degree * values @ np.cos(np.outer(angles, np.arange(degree)))
    coefficients[..., 0] *= 0.5
    return coefficients


def _resolvents(n: float, k: Complexes, alpha: Complexes, x_nodes: int, angles: int, slope: bool) -> Complexes:
    """Return R^(k) / alpha for albedos (k, m), complex by the nodes in w, or its derivative by n: (2, k, m).

    There may be more wave numbers than rows of albedos.
    """
    here, change = ([np.asarray(part) for part in system] for system in _systems(n, k, x_nodes, angles, slope))
    transforms = []
    for albedo, matrix, leaving, source, *by_n in zip(
        alpha, *(part[: len(alpha)] for part in (*here, *change)), strict=True
    ):
        resolvents = np.eye(x_nodes) - albedo[:, None, None] * matrix
        adjoint = np.linalg.solve(resolvents, leaving[None, :, None])[..., 0]
        if not slope:
            transforms.append(source @ adjoint.T)
            continue
        matrix_by_n, leaving_by_n, source_by_n = by_n
        solution = np.linalg.solve(resolvents, source.T[None])  # (m, x, 2)
        within = albedo * np.einsum("mx,mxl->lm", adjoint @ matrix_by_n, solution)
        transforms.append(source_by_n @ adjoint.T + np.einsum("x,mxl->lm", leaving_by_n, solution) + within)
    return np.stack(transforms, axis=1) / np.pi


def _in_chunks(function: Callable[[Complexes], Complexes], k: Complexes) -> Complexes:
    """Compute at all k, few at once: (2, k, ...)."""
    parts = np.array_split(np.pad(k, (0, -k.size % CHUNK), mode="edge"), -(-k.size // CHUNK))
    return np.concatenate([function(part) for part in parts], axis=1)[:, : k.size]


@partial(jit, static_argnums=(2, 3, 4))
def _systems(
    n: Any, k: jax.Array, x_nodes: int, angles: int, slope: bool
) -> tuple[cone.System, cone.System | tuple[()]]:
    """Return systems and, if asked for, their derivatives by n."""

    def at(n: jax.Array) -> cone.System:
        return jax.vmap(lambda wave: cone.system(n, wave, x_nodes, angles))(k)

    return jax.jvp(at, (n,), (1.0,)) if slope else (at(n), ())


def _series(n: float, k: Complexes, x_nodes: int, angles: int, slope: bool) -> Complexes:
    """Return the transform of each order of scattering, or its derivative by n: (2, k, orders)."""
    here, change = _systems(n, k, x_nodes, angles, slope)
    return np.asarray(_in_orders(here, change) if slope else _in_orders(here))


@jit
def _in_orders(here: cone.System, change: cone.System | None = None) -> jax.Array:
    """Return the transform of each order, or how it changes with the systems."""
    at = jax.vmap(partial(cone.series, orders=ORDERS), out_axes=1)
    return at(here) if change is None else jax.jvp(at, (here,), (change,))[1]


def _sizes(rule: Rule, factors: tuple[float, float]) -> tuple[int, int]:
    return round(factors[0] * rule.depth), round(factors[1] * rule.angles)


@lru_cache(maxsize=8)
def _lines(nodes: int) -> tuple[_Contour, ...]:
    """Return the line of each group, of one length: the shorter ones end with nodes that have no weight."""
    lines = []
    for kappa in KAPPAS[1:]:
        start = 1j * START * kappa
        way = CORNER * DIRECTION - start
        first = FIRST_PANEL * kappa if kappa else FIRST_WAVE
        s, ds = panels(np.append(0.0, _grown(first, abs(way))), nodes)
        lines.append(_Contour(start + way / abs(way) * s, way / abs(way) * ds))
    longest = max(line.k.size for line in lines)
    return tuple(
        _Contour(np.pad(k, (0, longest - k.size), mode="edge"), np.pad(dk, (0, longest - k.size))) for k, dk in lines
    )


@lru_cache(maxsize=8)
def _ray(nodes: int) -> _Contour:
    rho, drho = panels(np.append(_grown(CORNER, MIDDLE), _grown(MIDDLE, LAST_WAVE, LAST_GROWTH)[1:]), nodes)
    return _Contour(DIRECTION * rho, DIRECTION * drho)


def _grown(first: float, last: float, growth: float = GROWTH) -> Floats:
    return np.geomspace(first, last, int(np.ceil(np.log(last / first) / np.log(growth))) + 1)


@lru_cache(maxsize=16)
def kept_table(n: float, rule: Rule, slope: bool = False) -> Table:
    """Return the table of one n > 1, or its derivative by n, from where it is kept."""

    def make() -> dict[str, Floats]:
        parts = new_table(n, rule, slope)._asdict().items()
        return {name: np.ascontiguousarray(part, dtype=complex)[..., None].view(float) for name, part in parts}

    nodes, kind = "-".join(map(str, astuple(rule)[3:])), "-slope" if slope else ""
    arrays = kept(f"half-space-n{n!r}-{nodes}{kind}-v{VERSION}", Table._fields, make)
    return Table(*(arrays[name].view(complex)[..., 0] for name in Table._fields))


@partial(jax.custom_jvp, nondiff_argnums=(1,))
def traced_table(n: jax.Array, rule: Rule) -> Table:
    """Return the table of an n that may be traced, n >= 1; nan below. At n = 1 it is that of LEAST."""
    return _called(n, rule, False)


@traced_table.defjvp
def _traced_table_jvp(rule: Rule, primals: tuple, tangents: tuple) -> tuple[Table, Table]:
    slopes = _called(primals[0], rule, True)
    return traced_table(primals[0], rule), jax.tree.map(lambda slope: slope * tangents[0], slopes)


def _called(n: jax.Array, rule: Rule, slope: bool) -> Table:
    def look_up(n: Any) -> Table:
        whole = kept_table(max(float(n), LEAST), rule, slope)
        return whole if n >= 1 else jax.tree.map(lambda part: np.full_like(part, np.nan), whole)

    if isinstance(n, jax.core.Tracer):
        return jax.pure_callback(look_up, shapes(rule), n, vmap_method="sequential")
    return jax.tree.map(jnp.asarray, look_up(n))

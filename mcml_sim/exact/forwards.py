"""Functions of `mcml_sim.exact` for half spaces that scatter forwards, from a table by index and mean cosine.

Lengths of the table are in l* = 1 / (mu_a + mu_s (1 - g)), albedos alpha' = mu_s (1 - g) l*: in these light changes
little with g (similarity), and smoothly up to g = 1. Light scattered once is closed (`single_scattering`). The rest is

    2 pi x R_d = ... + alpha'^2 e^{f(s, ln x) - kappa x} (1 + kappa x),        s = sqrt(1 - alpha')

f a cubic spline in ln x at Chebyshev's nodes of s, for Chebyshev's extreme points of g and of n. Between those it is
the polynomial through them; kappa is found anew. `benchmarks/half_space_table.py` makes the file: low orders of
photons, the higher ones solved (`benchmarks/high_orders.py`).

`reflectance`, `profile`, `cdf` and `quantile` take reduced albedos and radii in l*: float64 arrays of one shape after
broadcasting, of numpy or of jax, as are the answers.
"""

from __future__ import annotations

import hashlib
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg
from jax import Array
from scipy.interpolate import BSpline

from mcml_sim.errors import InputError
from mcml_sim.exact.by_albedo import blocks
from mcml_sim.exact.compiled import filter_jit
from mcml_sim.exact.light import LEAST, ExactLight, coefficients, nodes, tabulated, unreduced
from mcml_sim.files.npz import read_npz
from mcml_sim.files.whole_file import read_whole
from mcml_sim.media.arrays import Floats
from mcml_sim.media.setting import FORWARD_G, FORWARD_N, ILLUMINATIONS, Setting

COSINES = 0.5 * FORWARD_G * (1.0 - np.cos(np.pi * np.arange(8) / 7.0))
INDICES = np.linspace(*FORWARD_N, 3)
S = np.sqrt(1.0 - LEAST) * 0.5 * (1.0 + nodes(64))
FIRST, LAST, STEP = 1e-3, 40.0, 0.12  # l*, and of ln x between knots
KNOTS = np.log(FIRST) + STEP * np.arange(-3, int(np.ceil(np.log(LAST / FIRST) / STEP)) + 4)
FILE = Path(__file__).with_name("half_space.npz")
MOST_BYTES = 1 << 23

# In l*: nearer than the first, 2 pi r R_d has its limit; the ends between which a share's radius lies.
NEAREST, FARTHEST = 1e-7, 1e30
SHORTEST, LONGEST, HALVINGS = 1e-12, 1e12, 64
FAR = 1e4
DEGREE = 400  # of the harmonics that a decay rate is found with
DARKEST, FAINTEST = 1e-200, 1e-300  # an albedo that stands for 0, whose shares are those next to it; a density


class SplinedLight(NamedTuple):
    """Light of one half space."""

    rest: Floats  # coefficients of f in B-splines on KNOTS, by node of s, (s, splines)
    share: Floats  # ratio A / alpha', (s,)


@lru_cache(maxsize=32)
def light(setting: Setting, coarse: bool = False) -> ExactLight:
    """Return the light of a half space that the table has (`Setting.is_solved`).

    coarse  whether to leave out the g of the table that is farthest from the setting's
    """
    table, whole = _table(), 0.5 * (1.0 + nodes(S.size))
    of = ILLUMINATIONS.index(setting.illumination)
    by_n, kept = _polynomial(INDICES, setting.n), np.full(COSINES.size, True)
    kept[np.argmax(np.abs(COSINES - setting.g))] = not coarse
    by_g = np.zeros(COSINES.size)
    by_g[kept] = _polynomial(COSINES[kept], setting.g)
    rest = np.einsum("n,g,ngsb->sb", by_n, by_g, table.rest[of])
    share = np.einsum("n,g,ngs->s", by_n, by_g, table.share[of])
    share = np.polynomial.chebyshev.chebval(2.0 * whole / np.sqrt(1.0 - LEAST) - 1.0, coefficients(share))
    # f as cubics in ln x from one knot to the next, (s, intervals, 4), powers falling, from FIRST on
    cubics = np.tensordot(rest, _cubics(), 1)
    return tabulated(setting, FIRST, STEP, *map(coefficients, (cubics, decay_rates(1.0 - S**2, setting.g), share)))


@lru_cache(maxsize=1)
def _cubics() -> Floats:
    """Return the cubics of every B-spline, (splines, intervals, 4)."""
    t = np.arange(4) * STEP / 3.0
    starts = KNOTS[3:-4]
    basis = BSpline.design_matrix((starts[:, None] + t * (1 - 1e-12)).ravel(), KNOTS, 3).toarray()
    cubics: Floats = basis.T.reshape(-1, starts.size, 4) @ np.linalg.inv(np.vander(t, 4)).T
    return cubics


def _polynomial(nodes: Floats, at: float) -> Floats:
    """Return weights of the values at the nodes, of the polynomial through them."""
    apart = np.where(np.eye(nodes.size, dtype=bool), 1.0, nodes[:, None] - nodes)
    away = np.where(np.eye(nodes.size, dtype=bool), 1.0, at - nodes[None])
    return np.prod(away / apart, axis=1)


@lru_cache(maxsize=1)
def _table() -> SplinedLight:
    """Return the table of all lights, n and g: (2, n, g, ...)."""
    arrays = read_npz(read_whole(FILE, MOST_BYTES), MOST_BYTES, text=("sha256",))
    lights = SplinedLight(*(arrays[name].astype(float) for name in SplinedLight._fields))
    if str(arrays["sha256"]) != digest(lights):
        raise InputError(f"{FILE} is damaged: its numbers are not those that were written; install mcml_sim again")
    return lights


def digest(table: SplinedLight) -> str:
    """Return the SHA-256 of the table."""
    return hashlib.sha256(b"".join(np.ascontiguousarray(part, "<f8").tobytes() for part in table)).hexdigest()


@lru_cache(maxsize=2048)
def decay_rate(alpha: float, g: float) -> float:
    """Return kappa of Henyey and Greenstein's scattering: R_d falls off as e^{-kappa r} r^-2 [mu_s + mu_a].

    Here alpha is mu_s / (mu_s + mu_a), not the reduced one.
    1 over the largest eigenvalue of the tridiagonal matrix of l / sqrt(h_l-1 h_l), h_l = (2 l + 1)(1 - alpha g^l).
    """
    ell = np.arange(DEGREE + 1)
    h = (2 * ell + 1) * (1.0 - alpha * float(g) ** ell)
    beside = ell[1:] / np.sqrt(h[:-1] * h[1:])
    last = scipy.linalg.eigh_tridiagonal(np.zeros(DEGREE + 1), beside, True, select="i", select_range=(DEGREE, DEGREE))
    return float(1.0 / last[0])


def decay_rates(reduced: Floats, g: float) -> Floats:
    """Return kappa of reduced albedos [1/l*]."""
    alpha = unreduced(reduced, g)
    return np.array([decay_rate(albedo, g) for albedo in alpha]) / (1.0 - alpha * g)


def reflectance(alpha: Any, setting: Setting) -> Any:
    """Return A [-]."""
    return _called(_reflectance, light(setting), alpha, alpha)


def profile(x: Any, alpha: Any, setting: Setting, coarse: bool = False) -> Any:
    """Return R_d [1/l*^2]; `coarse` as in `light`."""
    return _called(_profile, light(setting, coarse), x, alpha)


def cdf(x: Any, alpha: Any, setting: Setting) -> Any:
    """Return the share of the reflected energy within x [-]."""
    return _called(_cdf, light(setting), x, alpha)


def quantile(xi: Any, alpha: Any, setting: Setting) -> Any:
    """Return the radius within which that share leaves [l*]."""
    return _called(_quantile, light(setting), xi, alpha)


def _called(function: Any, own: ExactLight, x: Any, alpha: Any) -> Any:
    """Call a function of jax arrays at once; of numpy's a block at a time, so that no shape of them compiles anew."""
    own = own.unlabelled
    if any(isinstance(value, jax.Array) for value in (x, alpha)):
        x, alpha = jnp.broadcast_arrays(x, alpha)
        values = _each(function, own, x.ravel(), alpha.ravel())
        return jnp.where(jnp.isnan(x + alpha), jnp.nan, values.reshape(x.shape))
    is_one = np.ndim(alpha) == 0
    x, albedos = np.broadcast_arrays(x, alpha)
    with jax.enable_x64(True), jax.core.eval_context():
        pairs = zip(blocks(x.ravel()), blocks(albedos.ravel()), strict=True)
        parts = [_each(function, own, jnp.asarray(some), jnp.asarray(alpha if is_one else of)) for some, of in pairs]
    return np.concatenate([np.empty(0), *parts])[: x.size].reshape(x.shape)


@filter_jit
def _each(function: Any, own: ExactLight, x: Array, alpha: Array) -> Array:
    """Call a function at each radius; what depends on the albedo alone is computed once where there is but one."""
    return jax.vmap(partial(function, own), in_axes=(0, None if alpha.ndim == 0 else 0))(x, alpha)


def _reflectance(own: ExactLight, _: Array, alpha: Array) -> Array:
    return own.total(alpha)


def _profile(own: ExactLight, x: Array, alpha: Array) -> Array:
    around = 2.0 * jnp.pi * jnp.where((x == 0.0) & (alpha == 0.0), 1.0, x)  # no light is none at the source
    return own.ring_density(jnp.clip(x, NEAREST, FARTHEST), alpha) / around


def _cdf(own: ExactLight, x: Array, alpha: Array) -> Array:
    return _within(own, x, alpha, _whole(own, alpha))


def _within(own: ExactLight, x: Array, alpha: Array, of: tuple[Array, Array, Array]) -> Array:
    """Return the share within x [l*]; `of` as in `_whole`.

    It is the share in all light of their profile, from which A differs by the error of the table. Beyond FAR light
    falls off as that of a white medium, if there is any.
    """
    (far, whole, tail), alpha = of, jnp.maximum(alpha, DARKEST)
    return jnp.minimum((own.energy(jnp.minimum(x, far), alpha) + tail * (1.0 - far / jnp.maximum(x, far))) / whole, 1.0)


def _whole(own: ExactLight, alpha: Array) -> tuple[Array, Array, Array]:
    """Return how far there is light, or else FAR; all light of a profile, and that beyond."""
    alpha = jnp.maximum(alpha, DARKEST)
    far = jnp.minimum(FAR, jax.lax.stop_gradient(own.reach(alpha)))
    tail = far * own.ring_density(far, alpha)
    return far, own.energy(far, alpha) + tail, tail


def _quantile(own: ExactLight, xi: Array, alpha: Array) -> Array:
    low, high, of = jnp.log(SHORTEST), jnp.log(LONGEST), _whole(own, alpha)

    def halved(_: int, ends: tuple[Array, Array]) -> tuple[Array, Array]:
        low, high = ends
        middle = 0.5 * (low + high)
        beyond = _within(own, jnp.exp(middle), alpha, of) < xi
        return jnp.where(beyond, middle, low), jnp.where(beyond, high, middle)

    ends = jax.lax.fori_loop(0, HALVINGS, halved, (low, high))
    x = jax.lax.stop_gradient(jnp.where(xi == 1.0, 1.0, jnp.exp(0.5 * (ends[0] + ends[1]))))
    # One step of Newton's without its value, for the derivatives of the implicit function.
    density = own.ring_density(x, jnp.maximum(alpha, DARKEST)) / of[1]
    step = xi - _within(own, x, alpha, of)
    step = (step - jax.lax.stop_gradient(step)) / jax.lax.stop_gradient(jnp.maximum(density, FAINTEST))
    return jnp.where(xi == 1.0, jnp.inf, jnp.where(xi == 0.0, 0.0, x) + step)

"""Table of half spaces that scatter forwards, by refractive index and mean cosine; and what lies between.

Lengths are in l* = 1 / (mu_a + mu_s (1 - g)), albedos alpha' = mu_s (1 - g) l*: in these light changes little with g
(similarity), and smoothly up to g = 1. Light scattered once is closed (`single_scattering`). The rest is kept as

    2 pi x R_d = ... + alpha'^2 e^{f(s, ln x) - kappa x} (1 + kappa x),        s = sqrt(1 - alpha')

f a cubic spline in ln x at Chebyshev's nodes of s, for Chebyshev's extreme points of g and of n. Between those it is
the polynomial through them; kappa is found anew. `benchmarks/half_space_table.py` makes the file: low orders of
photons, the higher ones solved (`high_orders`).
"""

from __future__ import annotations

import hashlib
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline

from mcml_sim.errors import InputError
from mcml_sim.exact.anisotropic import high_orders
from mcml_sim.exact.light import LEAST, ExactLight, coefficients, nodes, tabulated
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


class SplinedLight(NamedTuple):
    """Light of one half space."""

    rest: Floats
    """Coefficients of f in B-splines on KNOTS, by node of s, (s, splines)."""
    share: Floats
    """Ratio A / alpha', (s,)."""


@lru_cache(maxsize=32)
def light(setting: Setting, coarse: bool = False) -> ExactLight:
    """Return the light of a half space that the table has (`Setting.is_solved`); `coarse` as in `curves`."""
    own, whole = curves(setting, coarse), 0.5 * (1.0 + nodes(S.size))
    share = np.polynomial.chebyshev.chebval(2.0 * whole / np.sqrt(1.0 - LEAST) - 1.0, coefficients(own.share))
    tables = map(coefficients, (pieces(own.rest), _decay_rates(setting.g), share))
    return tabulated(setting, FIRST, STEP, *tables)


@lru_cache(maxsize=32)
def _decay_rates(g: float) -> Floats:
    """Return kappa at the nodes of s, which no surface changes."""
    return high_orders.decay_rates(1.0 - S**2, g)


def curves(setting: Setting, coarse: bool = False) -> SplinedLight:
    """Return curves at the nodes of s; where `coarse`, without the g of the table that is farthest from g."""
    rest, share = _table()
    of = ILLUMINATIONS.index(setting.illumination)
    by_n, kept = _polynomial(INDICES, setting.n), np.full(COSINES.size, True)
    kept[np.argmax(np.abs(COSINES - setting.g))] = not coarse
    by_g = np.zeros(COSINES.size)
    by_g[kept] = _polynomial(COSINES[kept], setting.g)
    return SplinedLight(
        np.einsum("n,g,ngsb->sb", by_n, by_g, rest[of]),
        np.einsum("n,g,ngs->s", by_n, by_g, share[of]),
    )


def pieces(rest: Floats) -> Floats:
    """Return f as cubics in ln x from one knot to the next, (s, intervals, 4), powers falling, from FIRST on."""
    cubics: Floats = np.tensordot(rest, _cubics(), 1)
    return cubics


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

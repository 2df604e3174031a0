"""Fournier and Forand's phase function, the one of sea water."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import jax
import numpy as np

from mcml_sim.media.arrays import is_number, namespace, require
from mcml_sim.media.phase.phase import Phase
from mcml_sim.media.phase.tabulated import STRAIGHT, Pieces, Tabulated

INDICES, SLOPES = (1.0, 2.0), (3.0, 5.0)
SMALL = 0.05  # ln delta below which a difference of second order is a series
TERMS = 8
ROWS, LEAST = 1024, 1e-14  # of the table that draws; 1 - c


@dataclass(frozen=True)
class FournierForand(Phase):
    """Anomalous diffraction by spheres whose sizes follow a power law (Fournier & Forand, SPIE 2258, 194, 1994).

    n   refractive index of the particles over that of the water [-], 1 < n < 2
    mu  exponent of their size distribution, r^-mu [-], 3 < mu < 5

    p and its share in closed form as in Fournier & Jonasz, SPIE 3761, 62, 1999, with delta = 2 (1 - c) / (3 (n - 1)^2)
    and nu = (3 - mu) / 2; written so that nothing cancels where delta is 1. Samples come from a table of 1024 powers of
    1 - c with exact shares, 3e-7 off between its rows.
    """

    n: Any
    mu: Any

    def __post_init__(self) -> None:
        for name, (low, high) in (("n", INDICES), ("mu", SLOPES)):
            value = getattr(self, name)
            is_inside = isinstance(value, jax.Array) or (is_number(value) and low < value < high)
            require(is_inside, name, f"in ({low:g}, {high:g})", value)

    def pdf(self, cosine: Any) -> Any:
        return self._density(namespace(self.n, self.mu, cosine).maximum(1 - cosine, STRAIGHT))

    def invert(self, cosine: Any) -> Any:
        return 1 - self._below(1 - cosine)

    def deflection(self, v: Any) -> tuple[Any, Any]:
        """Return 1 - c and 1 + c [-] for the sample of xi = (1 + v) / 2, from the table."""
        return _table(self).deflection(v)

    def moment(self, l: int) -> float:  # noqa: E741 - the field's letter
        return _table(self).moment(l)

    def for_kernel(self) -> Tabulated:
        """Return the table in float32."""
        return _table(self).for_kernel()

    @property
    def _nu(self) -> Any:
        return (3 - self.mu) / 2

    @property
    def _largest(self) -> Any:
        """Parameter delta of the light that turns back [-]."""
        return 4 / (3 * (self.n - 1) ** 2)

    @property
    def _back(self) -> Any:
        """Value of (1 - delta^nu) / ((delta - 1) delta^nu) for the light that turns back [-]."""
        xp = namespace(self.n, self.mu)
        log = xp.log(self._largest)
        return -xp.expm1(self._nu * log) / (xp.expm1(log) * xp.exp(self._nu * log))

    def _density(self, u: Any) -> Any:
        """Return p at u = 1 - c [1/sr]."""
        xp, nu = namespace(self.n, self.mu, u), self._nu
        half = 0.5 * u  # sin^2(theta / 2)
        log = xp.log(half * self._largest)
        first = _second_order(xp, nu, log)
        ratio = xp.where(log == 0, nu, xp.expm1(nu * log) / xp.where(log == 0, 1.0, xp.expm1(log)))
        main = (first - (first + ratio) / half) * xp.exp(-nu * log) / (4 * np.pi)
        return main + self._back * (3 * (1 - u) ** 2 - 1) / (16 * np.pi)

    def _below(self, u: Any) -> Any:
        """Return the share of all scatterings with 1 - c < u [-]."""
        xp, nu = namespace(self.n, self.mu, u), self._nu
        half = 0.5 * u
        log = xp.log(xp.where(u > 0, half * self._largest, 1.0))
        rise = xp.where(log == 0, 1.0, xp.expm1(log))
        main = xp.where(log == 0, 1 + nu - half * nu, (xp.expm1((nu + 1) * log) - xp.expm1(nu * log) * half) / rise)
        return xp.where(u > 0, main * xp.exp(-nu * log), 0.0) + self._back * (1 - u) * u * (2 - u) / 8


def _second_order(xp: Any, nu: Any, log: Any) -> Any:
    """Return (delta^nu - 1 - nu (delta - 1)) / (delta - 1)^2 [-]."""
    is_small = xp.abs(log) < SMALL
    near, far = xp.where(is_small, log, 0.0), xp.where(is_small, 1.0, log)
    series, term, power = 0.0, 0.5, nu
    for order in range(2, TERMS + 2):
        power = power * nu
        series = series + term * (power - nu)
        term = term * near / (order + 1)
    grown = xp.where(near == 0, 1.0, xp.expm1(near) / xp.where(near == 0, 1.0, near))
    whole = xp.expm1(far)
    return xp.where(is_small, series / grown**2, (xp.expm1(nu * far) - nu * whole) / whole**2)


@lru_cache(maxsize=64)
def _table(phase: FournierForand) -> Tabulated:
    u = np.geomspace(LEAST, 2.0, ROWS)
    u[-1] = 2.0
    pieces = Pieces.of(u, 2 * np.pi * phase._density(u), phase._below(u))
    return Tabulated.of(angles=(), values=(), pieces=pieces, integral=())

"""Density along 1 - cosine in pieces that integrate and invert in closed form."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from mcml_sim.media.arrays import Floats, namespace

FLAT = 1e-4  # exponents of a share below which its power is a logarithm
NODES = 24  # of Gauss and Legendre's rule in a piece, besides those that a polynomial needs


class Pieces(NamedTuple):
    """Density f(u) of u = 1 - c on [0, 2], piece by piece a power of u or a straight line; arrays (pieces,).

    The densities of measured phase functions rise over many powers of ten toward u = 0 and are straight in logarithms;
    where a row is zero no power goes through it, and a line does.
    """

    end: Any
    """End of each piece [-], rising to 2."""
    at: Any
    """Point of reference u of a piece [-]: its beginning; of a first power law its end, which alone is positive."""
    share: Any
    """Share of all scatterings with a smaller u than that point [-]."""
    before: Any
    """Share of all scatterings before the beginning of each piece [-], rising from 0."""
    density: Any
    """Density f at that point [-]."""
    slope: Any
    """Exponent s of a power f ~ u^s, or df/du of a line."""
    is_power: Any

    @classmethod
    def of(cls, u: Floats, f: Floats, shares: Floats | None = None) -> Pieces:
        """Lay pieces through f (rows,) at u (rows,), which rises to 2, with these shares below each row, or f's own.

        A first u > 0 is reached from 0 by the power law of the first two rows. Not normalised.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            powers = np.diff(np.log(f)) / np.diff(np.log(u))
        is_power = (u[:-1] > 0) & (f[:-1] > 0) & (f[1:] > 0)
        slope = np.where(is_power, powers, np.diff(f) / np.diff(u))
        mass = np.where(is_power, _of_power(u[:-1], u[1:], f[:-1], slope), np.diff(u) * (f[:-1] + f[1:]) / 2)
        at, end, density = u[:-1], u[1:], f[:-1]
        if u[0] > 0:
            first = slope[0] if is_power[0] else 0.0
            at, end, density = (np.concatenate([[old[0]], new]) for old, new in ((u, at), (u, end), (f, density)))
            slope, is_power = np.concatenate([[first], slope]), np.concatenate([[True], is_power])
            mass = np.concatenate([[u[0] * f[0] / (1 + first)], mass])
        if shares is not None:
            own = np.diff(shares, prepend=0.0) if u[0] > 0 else np.diff(shares)
            density, mass = density * own / mass, own
        before = np.concatenate([[0.0], np.cumsum(mass)[:-1]])
        share = before.copy()
        if u[0] > 0:
            share[0] = mass[0]
        return cls(end, at, share, before, density, slope, is_power)

    @property
    def total(self) -> float:
        """Integral of the density [-]."""
        return float(self.below(self.end[-1]))

    def normalised(self) -> Pieces:
        """Return these pieces with an integral of 1."""
        total = self.total
        lines = np.where(self.is_power, self.slope, self.slope / total)
        return self._replace(
            share=self.share / total, before=self.before / total, density=self.density / total, slope=lines
        )

    def value(self, u: Any) -> Any:
        """Return f(u) [-]; infinite at 0 where its power law says so."""
        xp = namespace(u, self.end)
        number = self._piece(self.end, u)
        at, density, slope = self.at[number], self.density[number], self.slope[number]
        is_power = self.is_power[number]
        ratio = u / xp.where(is_power, at, 1.0)
        return xp.where(is_power, density * ratio ** xp.where(is_power, slope, 0.0), density + slope * (u - at))

    def below(self, u: Any) -> Any:
        """Return the share of all scatterings with a smaller one than u [-]."""
        number = self._piece(self.end, u)
        return self.share[number] + self._within(u, number)

    def quantile(self, share: Any) -> Any:
        """Return the u below which lies that share."""
        xp = namespace(share, self.end)
        number = self._piece(self.before[1:], share)
        at, density, slope = self.at[number], self.density[number], self.slope[number]
        is_power, more = self.is_power[number], share - self.share[number]
        e = xp.where(is_power, slope + 1, 1.0)
        t = more / xp.where(is_power, density * at, 1.0)
        is_flat = xp.abs(e) < FLAT
        grown = xp.where(is_flat, t * (1 - e * t / 2), xp.log1p(xp.maximum(e * t, -1.0)) / xp.where(is_flat, 1.0, e))
        root = xp.sqrt(xp.maximum(density * density + 2 * slope * more, 0.0))
        both = density + root
        line = at + 2 * more / xp.where(both > 0, both, 1.0)
        return xp.clip(xp.where(is_power, at * xp.exp(grown), line), 0.0, self.end[number])

    def moment(self, l: int) -> float:  # noqa: E741 - the field's letter
        """Return the mean of P_l(1 - u) [-], by quadrature over shares: there the density is even."""
        x, w = np.polynomial.legendre.leggauss(NODES + l)
        edges = np.append(self.before, 1.0)
        width = np.diff(edges)[:, None]
        cosines = 1 - self.quantile(edges[:-1, None] + width * (x + 1) / 2)
        return float(np.sum(width / 2 * w * np.polynomial.legendre.Legendre.basis(l)(cosines)))

    def _piece(self, ends: Any, value: Any) -> Any:
        xp = namespace(value, ends)
        if xp is np:
            return np.minimum(np.searchsorted(ends, value), len(self.end) - 1)
        number = jnp.searchsorted(ends, value, method="scan_unrolled")
        return jnp.minimum(number, len(self.end) - 1)

    def _within(self, u: Any, number: Any) -> Any:
        """Return the integral of the density from a piece's point of reference to u."""
        xp = namespace(u, self.end)
        at, density, slope = self.at[number], self.density[number], self.slope[number]
        is_power, step = self.is_power[number], u - self.at[number]
        power = _of_power(xp.where(is_power, at, 1.0), xp.where(is_power, u, 1.0), density, slope)
        return xp.where(is_power, power, step * (density + slope * step / 2))


def _of_power(begin: Any, end: Any, density: Any, slope: Any) -> Any:
    """Return the integral of density (u / begin)^slope over u = begin ... end; infinite or NaN where there is none."""
    xp = namespace(begin, end, density, slope)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        e, log = slope + 1, xp.log(end / begin)
        is_flat = xp.abs(e) < FLAT
        grown = xp.where(is_flat, log * (1 + e * log / 2), xp.expm1(e * log) / xp.where(is_flat, 1.0, e))
        return density * begin * grown

"""Phase functions that were measured or computed elsewhere: numbers at angles, and pieces between them.

A density along 1 - cosine goes in pieces that integrate and invert in closed form.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from mcml_sim.errors import InputError
from mcml_sim.media.arrays import Floats, checked_numbers, namespace, shown
from mcml_sim.media.phase.phase import Phase

MOST_ROWS = 2**16
TOLERANCE = 0.02  # by which an integral may miss 1: a table's own interpolation does
ROUNDING = 1e-6  # of pi, in tables with few digits [rad]
DIGITS = 16  # of a digest
STRAIGHT = 2.0**-54  # 1 - c: of cosines nearer to 1 float64 makes 1
FLAT = 1e-4  # exponents of a share below which its power is a logarithm
NODES = 24  # of Gauss and Legendre's rule in a piece, besides those that a polynomial needs


class Pieces(NamedTuple):
    """Density f(u) of u = 1 - c on [0, 2], piece by piece a power of u or a straight line; arrays (pieces,).

    The densities of measured phase functions rise over many powers of ten toward u = 0 and are straight in logarithms;
    where a row is zero no power goes through it, and a line does.
    """

    end: Any  # end of each piece [-], rising to 2
    at: Any  # point of reference u of a piece [-]: its beginning; of a first power law its end, which alone is positive
    share: Any  # share of all scatterings with a smaller u than that point [-]
    before: Any  # share of all scatterings before the beginning of each piece [-], rising from 0
    density: Any  # density f at that point [-]
    slope: Any  # exponent s of a power f ~ u^s, or df/du of a line
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


@dataclass(frozen=True, repr=False)
class Tabulated(Phase):
    """Values p [1/sr] at angles, straight in the logarithms of p and 1 - c between them.

    angles  [rad], rising, within 0 ... pi, at least two; degrees times pi / 180
    values  density of the direction there [1/sr], >= 0, whose integral over all directions is 1 within 2 %: with the
            pieces between the rows it is brought to 1

    Where a value, or a first angle, is zero the piece is straight in p and 1 - c itself. Below a first angle > 0 the
    first two rows' power law goes on, beyond the last angle the last value. Moments and shares belong to these pieces.
    """

    angles: Any
    values: Any
    pieces: Pieces = field(init=False, compare=False)
    integral: float = field(init=False, compare=False)  # integral of the rows as they were given [-]

    def __post_init__(self) -> None:
        angles = _checked("angles", self.angles, "angles in radians, rising from >= 0 to <= pi")
        values = _checked("values", self.values, "densities >= 0 [1/sr], one for each angle")
        if angles[-1] > np.pi + ROUNDING:
            raise InputError(f"angles must be in radians, at most pi, got {angles[-1]:g}: degrees times pi / 180")
        if angles[0] < 0 or np.any(np.diff(angles) <= 0):
            raise InputError("angles must rise from >= 0, got some that do not")
        if values.shape != angles.shape:
            raise InputError(f"values must be as many as angles, got {values.size} and {angles.size}")
        if np.any(values < 0):
            raise InputError(f"values must be densities >= 0, got {values.min():g}")
        pieces = self.through(angles, values)
        total = pieces.total
        if not abs(total - 1) <= TOLERANCE:  # infinite, or NaN, where the first power law has no integral
            accepted = "densities per steradian, whose integral over all directions is 1"
            raise InputError(f"values must be {accepted}, got {total:.4g}")
        object.__setattr__(self, "angles", tuple(angles.tolist()))
        object.__setattr__(self, "values", tuple(values.tolist()))
        object.__setattr__(self, "pieces", pieces.normalised())
        object.__setattr__(self, "integral", total)

    @staticmethod
    def through(angles: Floats, values: Floats) -> Pieces:
        """Return the pieces through rows of angles [rad] and values [1/sr], both (rows,), not normalised."""
        u = 2 * np.sin(np.minimum(angles, np.pi) / 2) ** 2
        if u[-1] < 2:
            u, values = np.append(u, 2.0), np.append(values, values[-1])
        return Pieces.of(u, 2 * np.pi * values)

    def __repr__(self) -> str:
        """Return a short text, another one for other numbers: it says what a run was made with."""
        digest = hashlib.sha256(np.array([self.angles, self.values]).tobytes()).hexdigest()
        return f"Tabulated({len(self.angles)} angles, {digest[:DIGITS]})"

    def pdf(self, cosine: Any) -> Any:
        xp = namespace(cosine, self.pieces.end)
        return self.pieces.value(xp.maximum(1 - cosine, STRAIGHT)) / (2 * np.pi)

    def invert(self, cosine: Any) -> Any:
        return 1 - self.pieces.below(1 - cosine)

    def deflection(self, v: Any) -> tuple[Any, Any]:
        """Return 1 - c and 1 + c [-] for the sample of xi = (1 + v) / 2; the second with an absolute error near 0."""
        below_one = self.pieces.quantile(0.5 * (1 - v))
        return below_one, 2 - below_one

    def moment(self, l: int) -> float:  # noqa: E741 - the field's letter
        return self.pieces.moment(l)

    def for_kernel(self) -> Tabulated:
        """Return the pieces in float32, without the rows."""
        arrays = (jnp.asarray(part, bool if np.asarray(part).dtype == bool else jnp.float32) for part in self.pieces)
        return type(self).of(angles=(), values=(), pieces=Pieces(*arrays), integral=())


def _checked(name: str, values: ArrayLike, accepted: str) -> np.ndarray:
    if isinstance(values, jax.Array):
        values = np.asarray(values)
    numbers = checked_numbers(name, values, accepted)
    if numbers.ndim != 1 or not 2 <= numbers.size <= MOST_ROWS:
        raise InputError(f"{name} must be a list of 2 to {MOST_ROWS} numbers, got the shape {numbers.shape}")
    if not np.all(np.isfinite(numbers)):
        row = int(np.argmin(np.isfinite(numbers)))
        raise InputError(f"{name} must be finite, got {shown(float(numbers[row]))} in row {row + 1}")
    return numbers

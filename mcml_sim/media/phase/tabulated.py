"""Phase functions that were measured or computed elsewhere: numbers at angles."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from mcml_sim.errors import InputError
from mcml_sim.media.arrays import Floats, namespace
from mcml_sim.media.checks import checked_numbers, shown
from mcml_sim.media.phase.phase import Phase
from mcml_sim.media.phase.pieces import Pieces

MOST_ROWS = 2**16
TOLERANCE = 0.02  # by which an integral may miss 1: a table's own interpolation does
ROUNDING = 1e-6  # of pi, in tables with few digits [rad]
DIGITS = 16  # of a digest
STRAIGHT = 2.0**-54  # 1 - c: of cosines nearer to 1 float64 makes 1


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
    integral: float = field(init=False, compare=False)
    """Integral of the rows as they were given [-]."""

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
            raise InputError(
                f"values must be densities per steradian, whose integral over all directions is 1, got {total:.4g}"
            )
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
        """Return the density of the direction [1/sr]; straight on, that of the nearest cosine below 1."""
        xp = namespace(cosine, self.pieces.end)
        return self.pieces.value(xp.maximum(1 - cosine, STRAIGHT)) / (2 * np.pi)

    def invert(self, cosine: Any) -> Any:
        """Return the `xi` whose sample is `cosine` [-]."""
        return 1 - self.pieces.below(1 - cosine)

    def deflection(self, v: Any) -> tuple[Any, Any]:
        """Return 1 - c and 1 + c [-] for the sample of xi = (1 + v) / 2; the second with an absolute error near 0."""
        below_one = self.pieces.quantile(0.5 * (1 - v))
        return below_one, 2 - below_one

    def moment(self, l: int) -> float:  # noqa: E741 - the field's letter
        """Return the Legendre moment of order l [-], by quadrature."""
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

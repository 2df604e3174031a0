"""What is right: a law's text in extended precision, at the very arguments that a narrower format was given."""

from __future__ import annotations

from copy import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from profilefit.laws.base import ProfileLaw
from profilefit.laws.quantile import FARTHEST, NEAREST, Quantile
from profilefit.shader.check import dense_grid
from profilefit.studies.stability.cells import DIMMEST, EXTENDED, Mask, RoundedText
from profilefit.studies.stability.layout import CDF, PDF, PROFILE, SAMPLE, ArgumentGrid

Floats = NDArray[np.float64]
HALVINGS = 70  # of a bracket of 90 in ln t
NOWHERE = np.finfo(EXTENDED).tiny ** EXTENDED(0.4)  # r/l that stands for 0 in a quotient


class Right:
    """What is right on a grid.

    albedo   alphas (m, 1, 1) in place of the grid's, where these are kept in some other form
    nearest  r/l at which R_d is taken where r/l is less, as shader sources do; 0 if it is not
    """

    def __init__(self, law: ProfileLaw, at: ArgumentGrid, albedo: Floats | None = None, nearest: float = 0.0) -> None:
        self.at, self._nearest = at, nearest
        self._finite_source = law.is_finite_at_source
        self._text = RoundedText(law, EXTENDED)
        if isinstance(law, Quantile):  # its few steps do not settle for albedos that only float64 has
            self._text.replace("depth", self._depth)
        r, xi, alpha, mfp = (each.astype(EXTENDED) for each in at.arguments)
        self._x, self._mfp, self._xi = r / mfp, mfp, xi
        self._shape = self._text.call("shape", alpha if albedo is None else albedo.astype(EXTENDED))

    def of(self, name: str) -> Floats:
        """The quantity, in its own unit, as a float64: infinite where it is beyond that."""
        with np.errstate(all="ignore"):
            if name == PROFILE:
                return np.asarray(self._known_at(self._scaled_profile()) / self._mfp**2, float)
            if name == CDF:
                return np.asarray(self._text.call("cumulated", self._x, self._shape), float)
            if name == SAMPLE:
                return np.asarray(self._radius() * self._mfp, float)
            density = self._text.call("radius_density", self._x, self._shape)
            return np.asarray(self._known_at(density) / self._mfp, float)

    def dim(self, name: str, reference: Floats) -> Mask:
        """Where a number in units of the mean free path has left the format before the unit of length enters."""
        if name not in (PROFILE, PDF):
            return np.zeros((1, 1, 1), bool)
        least = DIMMEST[self.at.dtype]
        with np.errstate(all="ignore"):
            scaled = reference * self.at.mfp.values ** (2 if name == PROFILE else 1)
        # A is a factor, and may be too small itself; a denormal r/l is 0 where denormals are.
        tiny = float(np.finfo(self.at.dtype).tiny)
        if name == PDF:  # next to the source laws take it at the root of the least number
            return (np.abs(scaled) < least) & (reference != 0) | (self._x < 4.0 * tiny**0.5)
        lost = (self.at.arguments[2] < least) | ((self._x > 0) & (self._x < 4.0 * tiny))
        return ((np.abs(scaled) < least) | lost) & (reference != 0)

    @property
    def jump(self) -> Floats:
        """xi (m, 1, 1) below which one part of the light is drawn, and above it another; 1 where there is one part."""
        share = getattr(self._shape, "share", None)
        return np.ones((1, 1, 1)) if share is None else np.asarray(share, float)

    def misplaced(self, value: Floats) -> Floats:
        """Share of the energy between a drawn radius and the right one [-], of the part that both are of."""
        with np.errstate(all="ignore"):
            x = np.where(value >= 0, value, np.inf).astype(EXTENDED) / self._mfp
            here, there = (self._undone(each) for each in (x, self._radius()))
            return np.asarray(np.abs(here - there), float)

    def _undone(self, x: NDArray) -> NDArray:
        """The uniform number that draws x, of two the nearer."""
        shape = self._shape
        if not hasattr(shape, "share"):
            return np.asarray(self._text.call("cumulated", x, shape))
        once, again = (self._text.call("cumulated", x, _of_part(shape, part)) for part in (1.0, 0.0))
        first, second = shape.share * once, shape.share + shape.rest * again
        return np.where(np.abs(first - self._xi) < np.abs(second - self._xi), first, second)

    def _known_at(self, value: NDArray) -> NDArray:
        """NaN beyond the radius at which texts stop, where no light is left."""
        return np.where((self._x > FARTHEST) & (value != 0), np.nan, value)

    def _scaled_profile(self) -> NDArray:
        x = np.maximum(self._x, EXTENDED(self._nearest))
        near = np.maximum(x, NOWHERE)
        density = self._text.call("density", near, self._shape)
        found = self._text.call("reflectance", self._shape) * density / (2.0 * EXTENDED(np.pi) * near)
        return found if self._finite_source else np.where((x > 0) | (found == 0), found, np.inf)

    def _depth(self, radius: NDArray, shape: Any) -> NDArray:
        """t at x of the quantile law: a bracket halved, in ln t."""
        x = np.clip(radius, EXTENDED(NEAREST), EXTENDED(FARTHEST))
        low, high = np.full_like(x, -65.0), np.full_like(x, 25.0) + 0.0 * shape.kappa
        low = low + 0.0 * high
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            below = self._text.call("local", np.exp(middle), shape).radius < x
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        return np.exp(0.5 * (low + high))

    def _radius(self) -> NDArray:
        return np.asarray(self._text.call("radius", self._xi, self._shape))


def _of_part(shape: Any, share: float) -> Any:
    """The shape of a law whose light is all of its first part, or of its second."""
    part = copy(shape)
    part.share, part.rest = EXTENDED(share), EXTENDED(1.0 - share)
    return part


LEAST_X = dense_grid.LEAST_X

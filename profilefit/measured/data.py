"""A measured profile: reflectance at radii or averaged over annuli, with its errors and source; what a fit accepts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcml_sim.media.medium import Layer, Medium
from profilefit.errors import InputError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Fact:
    """Fact that a comment of a table states, as text, and the line where it stands."""

    text: str
    line: int


@dataclass(frozen=True, eq=False)
class Measured:
    """Reflected light per area at n radii, or averaged over n annuli (rings).

    source     where it comes from, for messages; digest the SHA-256 of that file
    inner      (n,) inner radii of the rings [unit]; outer (n,) outer ones. A point is a ring without width
    value      (n,) reflected light per area and per incident light [1/unit^2]; in any other measure with a free scale
    sigma      (n,) standard errors of `value`
    freedom    (n,) degrees of freedom that each sigma rests on; infinite where it is known. pooled those of what all
               sigmas share, the trend of replicates
    errors     what the sigmas are, in words
    unit       of length; "" where nobody named one
    counted    True of photon counts: the variance of a ring is proportional to the light expected there, for which the
               model is a better estimate than the ring's own count. bounded: True if the sigmas are upper bounds
    photons    of the run that the rings come from, which correlates them (see `noise`); infinite if rows are
               independent
    medium     what a simulation was of, lengths in `unit`; None of what was measured
    illumination  under which light it was; None of what was measured
    notes      what was left out or merged, for the reader
    stated     what a table's comments state of light, n, g, beam and fibre
    """

    source: str
    digest: str
    inner: Floats
    outer: Floats
    value: Floats
    sigma: Floats
    freedom: Floats
    errors: str
    unit: str
    counted: bool = False
    bounded: bool = False
    pooled: float = np.inf
    photons: float = np.inf
    medium: Medium | None = None
    illumination: str | None = None
    notes: tuple[str, ...] = ()
    stated: Mapping[str, Fact] = field(default_factory=dict)

    @property
    def rings(self) -> bool:
        """True of averages over rings, False of values at radii."""
        return bool(np.all(self.outer > self.inner))

    @property
    def r(self) -> Floats:
        """(n,) radii, of rings the middles [unit]."""
        return 0.5 * (self.inner + self.outer)

    @property
    def relative_error(self) -> float:
        """Median of |sigma / value| [-]."""
        return float(np.median(np.abs(self.sigma) / np.maximum(np.abs(self.value), np.finfo(float).tiny)))

    @property
    def layer(self) -> Layer | None:
        """Layer of a simulated medium that scatters most, not the glass on top; None of what was measured."""
        return None if self.medium is None else max(self.medium.layers, key=lambda layer: layer.similar.mu_s)

    @property
    def n(self) -> float | None:
        """Refractive index of that layer over that above the medium [-]; None of what was measured."""
        return None if self.medium is None or self.layer is None else self.layer.n / self.medium.n_above

    @property
    def g(self) -> float | None:
        """Mean cosine of the scattering of that layer [-]; None of what was measured."""
        return None if self.layer is None or self.layer.phase else self.layer.g

    def within(self, r_min: float | None, r_max: float | None) -> Measured:
        """Only the rows that lie wholly between two radii [unit]; InputError if none does."""
        keep = np.ones(self.value.size, bool)
        if r_min is not None:
            keep &= self.inner >= r_min
        if r_max is not None:
            keep &= self.outer <= r_max
        if np.all(keep):
            return self
        if not np.any(keep):
            low, high = self.inner[0], self.outer[-1]
            raise InputError(
                f"{self.source}: no row is left between `r_min` and `r_max`: r goes from {low:g} to {high:g}"
            )
        note = f"{np.sum(~keep)} of {keep.size} rows left out, by `r_min` and `r_max`"
        return self.chosen(keep, note)

    def chosen(self, keep: NDArray[np.bool_], note: str = "") -> Measured:
        """The rows where `keep` (n,) is true."""
        fields = ("inner", "outer", "value", "sigma", "freedom")
        rows: dict[str, Any] = {name: getattr(self, name)[keep] for name in fields}
        return replace(self, **rows, notes=(*self.notes, *([note] if note else [])))

    def with_row(self, inner: float, outer: float, value: float, sigma: float) -> Measured:
        """One point or ring more, of a known error, put where it belongs."""
        at = int(np.searchsorted(self.inner, inner))
        new: dict[str, float] = {"inner": inner, "outer": outer, "value": value, "sigma": sigma, "freedom": np.inf}
        rows: dict[str, Any] = {name: np.insert(getattr(self, name), at, one) for name, one in new.items()}
        return replace(self, **rows)


# The judgement of a misfit decomposes matrices of rows by rows: seconds at this many, minutes at four times as many.
MOST_ROWS = 500
# Products of four numbers in these bounds, as in a fourth moment, are floats; no unit of length or light is near them.
SMALLEST, LARGEST = 1e-40, 1e40
FINEST = 1e-12  # relative error; a law in double precision is rounded near it


def require_workable(data: Measured) -> None:
    """InputError, in one line, for data that no fit in double precision and in memory can work with."""
    if data.value.size > MOST_ROWS:
        raise InputError(
            f"{data.source}: expected at most {MOST_ROWS} rows, got {data.value.size}: average neighbours over annuli "
            "(r_in, r_out), or choose a range by `r_min` and `r_max`"
        )
    lit = np.where(data.value == 0, 1.0, data.value)  # no light is a value like any other
    for name, column in (("r", data.r), ("value", lit), ("sigma", data.sigma)):
        size = np.abs(column)
        wrong = ~((size >= SMALLEST) & (size <= LARGEST))
        if np.any(wrong):
            at = int(np.argmax(wrong))
            raise InputError(
                f"{data.source}: expected {name} between {SMALLEST:g} and {LARGEST:g} in size, got {column[at]:g} in "
                f"the row of r = {data.r[at]:g}; choose another unit"
            )
    fine = data.sigma < FINEST * np.abs(data.value)
    if np.any(fine):
        at = int(np.argmax(fine))
        raise InputError(
            f"{data.source}: expected sigma of at least {FINEST:g} of the value, got {data.sigma[at]:g} for "
            f"{data.value[at]:g} in the row of r = {data.r[at]:g}"
        )

"""What a fit can work with: so many rows, and numbers whose squares and their ratios are floats."""

from __future__ import annotations

import numpy as np

from profilefit.errors import InputError
from profilefit.measured.data import Measured

# The judgement of a misfit decomposes matrices of rows by rows: seconds at this many, minutes at four times as many.
MOST_ROWS = 500
# Products of four numbers in these bounds, as in a fourth moment, are floats; no unit of length or light is near them.
SMALLEST, LARGEST = 1e-40, 1e40
FINEST = 1e-12  # relative error; a law in double precision is rounded near it


def require_workable(data: Measured) -> None:
    """InputError, in one line, for data that no fit in double precision and in memory can work with."""
    if data.value.size > MOST_ROWS:
        raise InputError(
            f"{data.source}: expected at most {MOST_ROWS} rows, got {data.value.size}: average neighbours over rings "
            "(r_in, r_out), or choose a range by --r-min and --r-max"
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

"""A file of any kind that holds a profile."""

from __future__ import annotations

from pathlib import Path

from profilefit.errors import InputError
from profilefit.measured.data import Measured
from profilefit.measured.simulated import UNIT, read_mco_profile, read_npz_profile
from profilefit.measured.table_file import read_table

SIMULATED = {".mco": read_mco_profile, ".npz": read_npz_profile}


def read(path: Path, unit: str | None = None, scaled: bool = False) -> Measured:
    """A profile by the ending of its file: .mco and .npz are simulated, everything else is a table.

    unit    of length, where the file names none; scaled whether the scale of the values is unknown
    InputError in one line names the file, and the row and column of what is wrong with it.
    """
    if path.suffix.lower() not in SIMULATED:
        return read_table(path, unit, scaled)
    if unit not in (None, UNIT):
        raise InputError(
            f"--unit must be {UNIT} or left out for {path.suffix}, whose lengths are in {UNIT}, got {unit!r}"
        )
    return SIMULATED[path.suffix.lower()](path)

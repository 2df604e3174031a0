"""MCML's output files read back: what `write_mco` writes, and V1 itself.

Only what a reflectance profile needs is read: parameters, totals (RAT) and Rd_r; the tables after it are not looked at.
"""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcml_sim.errors import InputError
from mcml_sim.mci import DECIMAL, Lines, Run, read_run
from mcml_sim.whole_file import read_whole

Floats = NDArray[np.float64]
MAX_BYTES = 2**27  # tables of 2^21 cells take 30 MB each
HEAD_BYTES = 2**16  # hold what comes before the parameters
LARGEST = 1e30  # of a printed number


@dataclass(frozen=True, eq=False)
class Output:
    """What an .mco says of a run and of the light that it reflected. Lengths in cm.

    run                   parameters: photons, bins, medium
    specular_reflectance  light that never entered [-]
    diffuse_reflectance   light that entered and left through the top [-]
    reflectance_r         (nr,) Rd_r, averages over the rings [1/cm^2]; the last one holds all light beyond it too
    """

    run: Run
    specular_reflectance: float
    diffuse_reflectance: float
    reflectance_r: Floats


def read_mco(path: str | os.PathLike[str]) -> Output:
    """Parameters, totals and Rd_r of a V1 .mco file. InputError in one line, `FILE:LINE: expected ..., got ...`."""
    return parse_mco(read_whole(path, MAX_BYTES), str(path))


def parse_mco(content: bytes, name: str) -> Output:
    """What `read_mco` gives for a file of this name and content."""
    if len(content) > MAX_BYTES:
        raise InputError(f"{name}: expected an .mco file of at most {MAX_BYTES} bytes, got a longer one")
    lines = Lines(name, content.replace(b"\x00", b"\xff"))
    _beginning(lines)
    run = read_run(lines, set())
    _keyword(lines, "RAT")
    specular, diffuse, _, _ = _column(lines, "RAT", 4)
    for key, size in (("A_l", len(run.medium.layers)), ("A_z", run.nz)):
        _keyword(lines, key)
        _column(lines, key, size)
    _keyword(lines, "Rd_r")
    return Output(run, specular, diffuse, np.array(_column(lines, "Rd_r", run.nr)))


def begins_mco(path: str | os.PathLike[str]) -> bool:
    """Whether a file begins as an .mco does, down to its parameters."""
    try:
        _beginning(Lines(str(path), read_whole(path, HEAD_BYTES)))
    except InputError:
        return False
    return True


def _beginning(lines: Lines) -> None:
    (version,) = lines.take(1, "the file version, A1")
    if version != "A1":
        raise lines.error("the file version, A1", repr(version[:8]))
    _keyword(lines, "InParm")


def _keyword(lines: Lines, key: str) -> None:
    (word,) = lines.take(1, f"the section {key}")
    if word != key:
        raise lines.error(f"the section {key}", repr(word[:20]))


def _column(lines: Lines, key: str, size: int) -> list[float]:
    numbers = []
    for at in range(size):
        what = f"number {at + 1} of {size} of {key}"
        (word,) = lines.take(1, what)
        if not DECIMAL.fullmatch(word):
            raise lines.error(what, repr(word[:20]))
        numbers.append(lines.decimal(what, word, (0.0, LARGEST)))
    return numbers

"""A measured phase function as text: angle and value, a row each; errors name file and line.

    angle [deg], value [1/sr], sigma [1/sr]      sigma, a standard error, may be left out

Cells are separated by commas; a # starts a comment. Values are densities per steradian whose integral over all
directions is near 1; they are brought to 1, since a table has neither all angles nor a scale without error.
"""

from __future__ import annotations

import hashlib
import math
import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcml_sim.files.whole_file import read_whole
from mcml_sim.media.phase import Tabulated
from profilefit.errors import InputError

Floats = NDArray[np.float64]
MAX_BYTES = 2**20
MOST_ROWS, FEWEST_ROWS = 5000, 8
COLUMNS = {"angle": ("", "deg", "degrees"), "value": ("", "1/sr"), "sigma": ("", "1/sr")}
HEADING = re.compile(r"(?P<name>[^\[\]]*?)\s*(?:\[(?P<unit>[^\[\]]*)\])?")
ACCEPTED = "angle [deg], value [1/sr] and, if known, sigma [1/sr]"
LONGEST_SHOWN = 40
LEAST_DEGREES = 7.0  # more than 2 pi: a table that ends before is one in radians


@dataclass(frozen=True)
class PhaseData:
    """source  of the numbers, in words;  digest  of their file

    angles  (n,) [rad], rising, > 0;  values  (n,) [1/sr], > 0, brought to an integral of 1
    sigma   (n,) relative standard errors [-], or None;  integral  that the values had [-]
    """

    source: str
    digest: str
    angles: Floats
    values: Floats
    sigma: Floats | None
    integral: float

    @cached_property
    def table(self) -> Tabulated:
        """The phase function of the rows themselves."""
        return Tabulated(self.angles, self.values)

    @property
    def mean_cosine(self) -> float:
        """[-]"""
        return float(self.table.mean_cosine)

    @property
    def backscattered(self) -> float:
        """Share that is turned by more than 90 degrees [-]."""
        return float(self.table.invert(0.0))

    def within(self, low: float, high: float) -> NDArray[np.bool_]:
        """Which rows lie at angles low ... high [degrees]."""
        degrees = np.degrees(self.angles)
        return (degrees >= low - 1e-9) & (degrees <= high + 1e-9)


def read_phase(path: Path) -> PhaseData:
    """A table; InputError in one line, FILE:LINE: expected ..., got ..."""
    content = read_whole(path, MAX_BYTES)
    if len(content) > MAX_BYTES:
        raise InputError(f"{path}: expected a phase function of at most {MAX_BYTES} bytes, got a longer file")
    try:
        lines = content.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise InputError(f"{path}:{line}: expected text in UTF-8, got the byte {content[error.start]:#04x}") from None
    kept = [(at, line.partition("#")[0].strip()) for at, line in enumerate(lines, start=1)]
    kept = [(at, line) for at, line in kept if line]
    if not kept:
        raise InputError(f"{path}: expected a header of {ACCEPTED}, got an empty file")
    names = _header(path, *kept[0])
    if not FEWEST_ROWS <= len(kept) - 1 <= MOST_ROWS:
        raise InputError(f"{path}: expected {FEWEST_ROWS} to {MOST_ROWS} rows under the header, got {len(kept) - 1}")
    rows = np.array([_row(path, at, line, names) for at, line in kept[1:]])
    column = dict(zip(names, rows.T, strict=True))
    degrees, values = column["angle"], column["value"]
    for (at, _), before, angle, value in zip(kept[1:], [-1.0, *degrees[:-1]], degrees, values, strict=True):
        if not 0 < angle <= 180 or angle <= before:
            raise InputError(f"{path}:{at}: expected an angle in (0, 180] degrees that rises, got {angle:g}")
        if not value > 0:
            raise InputError(f"{path}:{at}: expected a value > 0, got {value:g}")
    if degrees[-1] < LEAST_DEGREES:
        raise InputError(
            f"{path}: expected angles in degrees up to 180, got {degrees[-1]:g} at most: radians times 180 / pi"
        )
    sigma = column.get("sigma")
    if sigma is not None and not np.all(sigma > 0):
        raise InputError(f"{path}:{kept[1 + int(np.argmin(sigma > 0))][0]}: expected a sigma > 0, got {sigma.min():g}")
    try:
        integral = Tabulated(np.radians(degrees), values).integral
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return PhaseData(
        str(path),
        hashlib.sha256(content).hexdigest(),
        np.radians(degrees),
        values / integral,
        None if sigma is None else sigma / values,
        integral,
    )


def _header(path: Path, at: int, line: str) -> tuple[str, ...]:
    names = []
    for cell in line.split(","):
        match = HEADING.fullmatch(cell.strip())
        name = match["name"].strip().lower() if match else ""
        if match is None or name not in COLUMNS or name in names:
            raise InputError(f"{path}:{at}: expected a header of {ACCEPTED}, got {_shown(cell)}")
        unit = (match["unit"] or "").strip()
        if unit not in COLUMNS[name]:
            raise InputError(f"{path}:{at}: expected {name} in {COLUMNS[name][1]}, got [{unit[:LONGEST_SHOWN]}]")
        names.append(name)
    if "angle" not in names or "value" not in names:
        raise InputError(f"{path}:{at}: expected a header of {ACCEPTED}, got {_shown(line)}")
    return tuple(names)


def _row(path: Path, at: int, line: str, names: tuple[str, ...]) -> list[float]:
    cells = [cell.strip() for cell in line.split(",")]
    if len(cells) != len(names):
        raise InputError(f"{path}:{at}: expected {len(names)} cells, as the header has, got {len(cells)}")
    return [_number(path, at, name, cell) for name, cell in zip(names, cells, strict=True)]


def _number(path: Path, at: int, name: str, cell: str) -> float:
    try:
        number = float(cell)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise InputError(f"{path}:{at}: column {name}: expected a finite number, got {_shown(cell)}")
    return number


def _shown(cell: str) -> str:
    text = cell.strip()
    return repr(text if len(text) <= LONGEST_SHOWN else f"{text[: LONGEST_SHOWN - 3]}...")

"""Measured profiles as text: a header, then a row a radius or a ring; what is wrong is named by file, line and column.

    r [mm], value [1/mm^2], sigma        a value and its standard error at a radius
    r, value1, value2, value3            three replicates or more: mean and standard error are made from them
    r_in, r_out, value, sigma            averages over rings

Cells are separated by tabs, else semicolons, else commas, by what the header has. A # starts a comment. The value's
unit, if it is not the one of r, is converted; [a.u.] or any other word needs an unknown scale.
"""

from __future__ import annotations

import csv
import hashlib
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mcml_sim.whole_file import read_whole
from profilefit.errors import InputError
from profilefit.measured.data import Floats, Measured
from profilefit.measured.lengths import UNITS, area_unit, checked_unit, factor
from profilefit.measured.replicates import FEWEST, Steadied, steadied

MAX_BYTES = 2**26  # far beyond any profile, near enough that a wrong file fails at once
FEWEST_ROWS = 3
DELIMITERS = {"\t": "tab", ";": "semicolon", ",": "comma"}
HEADING = re.compile(r"(?P<name>[^\[\]]*?)\s*(?:\[(?P<unit>[^\[\]]*)\])?")
REPLICATE = re.compile(r"value_?\d+")
ACCEPTED = "r (or r_in and r_out) with value and sigma, or with value1, value2, value3, ..."
LONGEST_SHOWN = 40  # characters of a cell in a message


def read_table(path: Path, unit: str | None = None, scaled: bool = False) -> Measured:
    """Read a table; `unit` is that of r if the header has none, `scaled` whether the scale of the values is unknown."""
    content = read_bytes(path)
    lines = _text(path, content).replace("\r\n", "\n").replace("\r", "\n").split("\n")
    header, rows = _cells(path, lines)
    numbers = _numbers(path, header, rows)
    inner, outer = _radii(path, header, rows, numbers)
    length = _length_unit(path, header, unit)
    found, errors = _values(path, header, rows, numbers)
    _require_one_measure(path, header)
    times = 1.0 if scaled else _value_factor(path, header, length)
    return Measured(
        str(path),
        hashlib.sha256(content).hexdigest(),
        inner,
        outer,
        found.value * times,
        found.sigma * times,
        found.freedom,
        errors,
        length,
        pooled=found.pooled,
    )


def read_bytes(path: Path) -> bytes:
    """A file's bytes; InputError if it cannot be read or is too long for a profile."""
    content = read_whole(path, MAX_BYTES)
    if len(content) > MAX_BYTES:
        raise InputError(f"{path}: expected a profile of at most {MAX_BYTES} bytes, got a longer file")
    return content


@dataclass(frozen=True)
class _Header:
    """names, units  of the columns in their order; "" where a unit is not given. line where it stands in the file."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    line: int
    delimiter: str

    @property
    def replicates(self) -> tuple[str, ...]:
        return tuple(name for name in self.names if REPLICATE.fullmatch(name))

    @property
    def rings(self) -> bool:
        return "r_in" in self.names

    def unit(self, name: str) -> str:
        return self.units[self.names.index(name)]


@dataclass(frozen=True)
class _Row:
    line: int
    cells: tuple[str, ...]


def _text(path: Path, content: bytes) -> str:
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise InputError(f"{path}:{line}: expected text in UTF-8, got the byte {content[error.start]:#04x}") from None
    if "\x00" in text:
        line = text[: text.index("\x00")].count("\n") + 1
        raise InputError(f"{path}:{line}: expected text in UTF-8, got the byte 0x00")
    return text


def _cells(path: Path, lines: list[str]) -> tuple[_Header, list[_Row]]:
    kept = [(at, line.partition("#")[0]) for at, line in enumerate(lines, start=1)]
    kept = [(at, line) for at, line in kept if line.strip()]
    if not kept:
        raise InputError(f"{path}: expected a header and rows ({ACCEPTED}), got an empty file")
    at, first = kept[0]
    delimiter = next((one for one in DELIMITERS if one in first), ",")
    header = _header(path, at, _split(path, at, first, delimiter), delimiter)
    rows = [_Row(line, _split(path, line, text, delimiter)) for line, text in kept[1:]]
    for row in rows:
        if len(row.cells) != len(header.names):
            expected = f"{len(header.names)} cells between {DELIMITERS[delimiter]}s, as the header has"
            raise InputError(f"{path}:{row.line}: expected {expected}, got {len(row.cells)}")
    if len(rows) < FEWEST_ROWS:
        raise InputError(f"{path}: expected at least {FEWEST_ROWS} rows under the header, got {len(rows)}")
    return header, rows


def _split(path: Path, at: int, line: str, delimiter: str) -> tuple[str, ...]:
    try:
        return tuple(cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, strict=True)))
    except csv.Error as error:
        raise InputError(f"{path}:{at}: expected cells between {DELIMITERS[delimiter]}s, got: {error}") from None


def _header(path: Path, at: int, cells: tuple[str, ...], delimiter: str) -> _Header:
    matches = [HEADING.fullmatch(cell) for cell in cells]
    names = tuple(match["name"].strip().lower() if match else cell for match, cell in zip(matches, cells, strict=True))
    units = tuple((match["unit"] or "").strip() if match else "" for match in matches)
    header = _Header(names, units, at, delimiter)
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{path}:{at}: expected each column once, got {name!r} {names.count(name)} times")
        if name not in ("r", "r_in", "r_out", "value", "sigma") and not REPLICATE.fullmatch(name):
            raise InputError(f"{path}:{at}: expected a header of {ACCEPTED}, got the column {_shown(name)}")
    missing = next(_missing(header), None)
    if missing:
        raise InputError(f"{path}:{at}: expected a header of {ACCEPTED}, got {missing}")
    return header


def _missing(header: _Header) -> Iterator[str]:
    """What a header lacks, or has too much of."""
    names, replicates = header.names, header.replicates
    if ("r_in" in names) != ("r_out" in names):
        yield "one of r_in and r_out without the other"
    if ("r" in names) == header.rings:
        yield "both r and r_in" if header.rings else "no column r"
    if replicates and ("value" in names or "sigma" in names):
        yield "replicates beside value or sigma"
    if replicates and len(replicates) < FEWEST:
        yield f"{len(replicates)} replicates: fewer than {FEWEST} have no standard error to speak of"
    if not replicates and "value" not in names:
        yield "no column value"
    if not replicates and "sigma" not in names:
        yield "no column sigma: without errors nothing says how far to trust a fit"


def _numbers(path: Path, header: _Header, rows: list[_Row]) -> dict[str, Floats]:
    """Every column as numbers (n,), all of them finite."""
    table = np.empty((len(rows), len(header.names)))
    for i, row in enumerate(rows):
        for j, (name, cell) in enumerate(zip(header.names, row.cells, strict=True)):
            table[i, j] = _number(path, row.line, name, cell)
    return dict(zip(header.names, table.T, strict=True))


def _number(path: Path, line: int, name: str, cell: str) -> float:
    try:
        number = float(cell)
    except ValueError:
        number = math.nan
    if not math.isfinite(number) or "_" in cell:
        raise InputError(f"{path}:{line}: column {name}: expected a finite number, got {_shown(cell)}")
    return number


def _radii(path: Path, header: _Header, rows: list[_Row], numbers: dict[str, Floats]) -> tuple[Floats, Floats]:
    """Inner and outer radii (n,), rising."""
    inner = numbers["r_in"] if header.rings else numbers["r"]
    outer = numbers["r_out"] if header.rings else numbers["r"]
    first = "r_in" if header.rings else "r"
    for i, row in enumerate(rows):
        place = f"{path}:{row.line}: column {first}"
        if inner[i] < 0 or (inner[i] == 0 and not header.rings):
            least = ">= 0" if header.rings else "> 0, since the profile is infinite at 0"
            raise InputError(f"{place}: expected a radius {least}, got {inner[i]:g}")
        if outer[i] <= inner[i] and header.rings:
            raise InputError(f"{path}:{row.line}: column r_out: expected more than r_in {inner[i]:g}, got {outer[i]:g}")
        if i and (inner[i] < outer[i - 1] or (inner[i] == outer[i - 1] and not header.rings)):
            expected = (
                f"at least the r_out {outer[i - 1]:g} before" if header.rings else f"r to rise above {outer[i - 1]:g}"
            )
            raise InputError(f"{place}: expected {expected}, got {inner[i]:g}")
    return inner, outer


def _values(path: Path, header: _Header, rows: list[_Row], numbers: dict[str, Floats]) -> tuple[Steadied, str]:
    """Values with their standard errors, and in words what the errors are."""
    if header.replicates:
        samples = np.stack([numbers[name] for name in header.replicates], axis=1)
        found = steadied(samples)
        errors = f"standard errors of the means of {samples.shape[1]} replicates, steadied by their trend"
        named = header.replicates[0]
    else:
        found = Steadied(numbers["value"], numbers["sigma"], np.full(len(rows), np.inf), np.inf)
        named, errors = "sigma", "as given"
    for row, one in zip(rows, found.sigma, strict=True):
        if not one > 0:
            expected = "replicates that differ" if header.replicates else "a standard error > 0"
            raise InputError(f"{path}:{row.line}: column {named}: expected {expected}, got {one:g}")
    if not np.any(found.value > 0):
        raise InputError(f"{path}: expected some light, got no value above 0")
    return found, errors


def _length_unit(path: Path, header: _Header, unit: str | None) -> str:
    names = ("r_in", "r_out") if header.rings else ("r",)
    found = {header.unit(name) for name in names} - {""}
    for one in found:
        if one not in UNITS:
            raise InputError(
                f"{path}:{header.line}: column {names[0]}: expected a unit of {', '.join(UNITS)}, got {one!r}"
            )
    if len(found | ({unit} if unit else set())) > 1:
        told = ", ".join(sorted(found | ({unit} if unit else set())))
        raise InputError(f"{path}:{header.line}: column {names[0]}: expected one unit, here and in --unit, got {told}")
    return found.pop() if found else checked_unit("--unit", unit) if unit else ""


def _require_one_measure(path: Path, header: _Header) -> None:
    """InputError where an error, or another replicate, has a unit that is not the first value's."""
    first, *others = header.replicates or ("value", "sigma")
    for name in others:
        if header.unit(name) not in ("", header.unit(first)):
            expected = f"the unit of {first}, [{header.unit(first)}], or none"
            raise InputError(f"{path}:{header.line}: column {name}: expected {expected}, got [{header.unit(name)}]")


def _value_factor(path: Path, header: _Header, length: str) -> float:
    """What makes the values per area in the unit of r."""
    name = header.replicates[0] if header.replicates else "value"
    text = header.unit(name)
    if not text:
        return 1.0
    unit = area_unit(text)
    if unit is None:
        raise InputError(
            f"{path}:{header.line}: column {name}: expected light per area such as [1/mm^2], or --scale free for any "
            f"other measure, got [{text}]"
        )
    if not length:
        raise InputError(f"{path}:{header.line}: column r: expected a unit, as {name} has one ([{text}]), got none")
    return factor(unit, length) ** -2


def _shown(cell: str) -> str:
    return repr(cell if len(cell) <= LONGEST_SHOWN else f"{cell[: LONGEST_SHOWN - 3]}...")

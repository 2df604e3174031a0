"""Files of measured profiles: a header, then one row for each radius or annulus; errors name file, line and column.

    r [mm], value [1/mm^2], sigma        a value and its standard error at a radius
    r, value1, value2, value3            three replicates or more, whose mean and standard error are used
    r_in, r_out, value, sigma            averages over annuli

Cells are separated by tabs, else semicolons, else commas, else spaces, by what the header has. Units stand in brackets,
in parentheses or after a slash: r [mm], r (mm), r/mm. A # starts a comment; a line such as # n = 1.4 states a fact
(light, n, g, beam, fibre or unit, or a name of `FACTS`), and a note names what else comments state. The value's unit,
if it is not the one of r, is converted; [a.u.] or any other word needs an unknown scale. Numbers have decimal points: a
comma may part thousands as well, so it is an error and no guess.

Text files of Dia-Stron's translucency meter TLS850 have record, pixel and value in a row, 512 pixels a record. Records
go red, green, blue, red, ...; those of one colour are replicates. Pixels are along a line of 20 mm that begins at the
spot; values are in a measure of the instrument's own. Between records there may be lines of words. Pixels before the
brightest one see the spot and are left out; of the others, neighbours are averaged.

Simulated profiles are read by `simulated_file`.
"""

from __future__ import annotations

import contextlib
import csv
import hashlib
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mcml_sim.files.whole_file import read_whole
from profilefit.errors import InputError
from profilefit.measured.data import (
    FEWEST,
    UNITS,
    Fact,
    Floats,
    Measured,
    ModeratedVariance,
    area_unit,
    checked_unit,
    factor,
    moderated_variances,
)
from profilefit.measured.simulated_file import SIMULATED, UNIT

MAX_BYTES = 2**22  # far beyond any profile, near enough that a wrong file fails at once
MOST_LINES = 20_000  # a fit takes five hundred rows of them
MOST_COLUMNS = 1000  # replicates, nearly all
FEWEST_ROWS = 3
DELIMITERS = {"\t": "tab", ";": "semicolon", ",": "comma", " ": "space"}
HEADING = re.compile(
    r"(?P<name>[^\[\]()/]*?)\s*(?:\[(?P<square>[^\[\]]*)\]|\((?P<round>.*)\)|/\s*(?P<over>[^\[\]]+))?", re.DOTALL
)
WORD = re.compile(r"[^\s\[\](]+(?:\s*\[[^\[\]]*\]|\s*\([^()]*\))?|\S")  # of a header between spaces, with its unit
LONGEST_HEADING = 100  # characters
# Accepted names of the columns.
NAMES = {
    **dict.fromkeys(("r", "rho", "ρ", "radius", "distance"), "r"),
    **dict.fromkeys(("value", "reflectance", "rd", "r_d"), "value"),
    **dict.fromkeys(("sigma", "σ", "error", "standard_error", "standard error"), "sigma"),
    **{name: name for name in ("r_in", "r_out")},
}
REPLICATE = re.compile(r"value[_ ]?\d+")
DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?")
# Accepted names of facts, in lower case and with spaces for _ and -.
FACTS = {
    "light": ("light", "lighting", "illumination", "incident light"),
    "n": ("n", "refractive index", "refractive index n", "index of refraction", "refraction index", "ior"),
    "g": ("g", "anisotropy", "anisotropy g", "anisotropy factor", "anisotropy factor g", "mean cosine", "asymmetry"),
    "beam": ("beam", "beam radius", "spot radius", "1/e^2 radius", "1/e2 radius", "1/e² radius"),
    "fibre": (
        "fibre",
        "fiber",
        "fibre radius",
        "fiber radius",
        "fibre core radius",
        "fiber core radius",
        "core radius",
    ),
    "unit": ("unit", "units", "unit of r", "units of r", "unit of length", "length unit"),
}
FACT = {spelling: name for name, spellings in FACTS.items() for spelling in spellings}
BRACKETED = re.compile(r"\[(?P<square>[^\[\]]*)\]|\((?P<round>[^()]*)\)")
LONGEST_NAME = 6  # words; more are a sentence
MOST_SHOWN = 5  # statements that a note names
ACCEPTED = "r (or r_in and r_out) with value and sigma, or with value1, value2, value3, ..."
ANGLES = ("angle", "theta", "scattering angle")  # columns of a phase function
SMALLEST, LARGEST = 1e-100, 1e100  # of a number, whose squares and units are floats then
LONGEST_SHOWN = 40  # characters of a cell in a message
TLS_BYTES = 2**24  # of a TLS850's file
HEAD_BYTES = 4096  # hold its first line of words
COLOURS = ("red", "green", "blue")
LENGTH = 20.0  # mm
AVERAGED = 4  # pixels
CELLS = re.compile(r"[\s,;]+")
LARGEST_VALUE = 1e12
MOST_RECORDS = 3000
MOST_PIXELS = 4096


def read(path: Path, unit: str | None = None, scaled: bool = False, colour: str | None = None) -> Measured:
    """Read a profile by the ending of its file: .mco and .npz are simulated, everything else is a table.

    InputError in one line names the file, and the row and column of what is wrong with it.

    Args:
        path: the file.
        unit: of length, where the file names none.
        scaled: whether the scale of the values is unknown.
        colour: red, green or blue, of the records to use of a TLS850's.
    """
    kind = path.suffix.lower()
    content = b"" if kind in SIMULATED else read_whole(path, TLS_BYTES)  # once: a pipe has no second reading
    if is_tls(content):
        return read_tls(path, content, colour, scaled)
    if colour is not None:
        raise InputError(f"colour must be left out but for records of a TLS850, got {colour!r}")
    if kind not in SIMULATED:
        return read_table(path, content, unit, scaled)
    if unit not in (None, UNIT):
        raise InputError(
            f"unit must be {UNIT} or left out for {path.suffix}, whose lengths are in {UNIT}, got {unit!r}"
        )
    return SIMULATED[kind](path)


def read_table(path: Path, content: bytes, unit: str | None = None, scaled: bool = False) -> Measured:
    """Read a table from a file's first MAX_BYTES + 1 bytes or more.

    unit    of r if the header has none; scaled whether the scale of the values is unknown, and they in any measure
    """
    if len(content) > MAX_BYTES:
        raise InputError(f"{path}: expected a profile of at most {MAX_BYTES} bytes, got a longer file")
    lines = _text(path, content).replace("\r\n", "\n").replace("\r", "\n").split("\n")
    header, rows = _cells(path, lines)
    stated, others = _stated(path, lines)
    named = stated.pop("unit", None)
    notes = _notes(others, named, unit)
    unit = named.text if named is not None and unit is None else unit
    numbers = _numbers(path, header, rows)
    inner, outer = _radii(path, header, rows, numbers)
    length = _length_unit(path, header, unit)
    means, errors = _values(path, header, rows, numbers)
    _require_one_measure(path, header)
    times = _value_factor(path, header, length, scaled)
    return Measured(
        str(path),
        hashlib.sha256(content).hexdigest(),
        inner,
        outer,
        means.value * times,
        means.sigma * times,
        means.freedom,
        errors,
        length,
        pooled=means.pooled,
        notes=notes,
        stated=stated,
    )


@dataclass(frozen=True)
class _Header:
    """Header of a table.

    names, units  of the columns in their order; "" where a unit is not given. line where it stands in the file.
    """

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


def _stated(path: Path, lines: list[str]) -> tuple[dict[str, Fact], list[Fact]]:
    """Return the facts that comments state, such as # n = 1.4, by name, and the statements that are none of these."""
    facts: dict[str, Fact] = {}
    others: list[Fact] = []
    for at, line in enumerate(lines, start=1):
        if not line.lstrip().startswith("#"):
            continue
        spelled, value = (part.strip() for part in (*re.split("[=:]", line.strip().lstrip("# "), maxsplit=1), "")[:2])
        words = re.sub(r"[\s_-]+", " ", BRACKETED.sub(" ", spelled)).strip().lower()
        name = FACT.get(words)
        if name is None:
            is_sentence = (
                len(words.split()) > LONGEST_NAME or value.startswith("//") or not re.search(r"[^\W\d]", words)
            )
            others += [] if is_sentence or not value else [Fact(spelled, at)]
            continue
        if name in facts:
            raise InputError(f"{path}:{at}: expected {name} once, got it again")
        if not value:
            raise InputError(f"{path}:{at}: expected a value of {name}, got none")
        unit = next((word for word in BRACKETED.findall(spelled) for word in word if word in UNITS), "")
        facts[name] = Fact(f"{value} {unit}" if unit and value[-1:].isdigit() else value, at)
    return facts, others


def _notes(others: list[Fact], named: Fact | None, unit: str | None) -> tuple[str, ...]:
    """Return notes on statements that are not understood, and on a unit that another one replaces."""
    notes = []
    if others:
        shown = ", ".join(f"{_shown(one.text)} (line {one.line})" for one in others[:MOST_SHOWN])
        more = f" and {len(others) - MOST_SHOWN} more" if len(others) > MOST_SHOWN else ""
        notes.append(f"comments state what is not understood: {shown}{more}; known are {', '.join(FACTS)}")
    if named is not None and unit is not None and UNITS.get(named.text) != UNITS.get(unit):
        notes.append(f"the file's unit is {_shown(named.text)} (line {named.line}), read with `unit` {unit}")
    return tuple(notes)


def _cells(path: Path, lines: list[str]) -> tuple[_Header, list[_Row]]:
    if len(lines) > MOST_LINES:
        raise InputError(f"{path}: expected a profile of at most {MOST_LINES} lines, got {len(lines)}")
    kept = [(at, line.partition("#")[0]) for at, line in enumerate(lines, start=1)]
    kept = [(at, line) for at, line in kept if line.strip()]
    if not kept:
        raise InputError(f"{path}: expected a header and rows ({ACCEPTED}), got an empty file")
    at, first = kept[0]
    delimiter = next((one for one in DELIMITERS if one in first.strip()), ",")
    names = tuple(WORD.findall(first)) if delimiter == " " else _split(path, at, first, delimiter)
    # The columns after the last one with a name are those that spreadsheets leave empty.
    header = _header(path, at, names[: max((i for i, name in enumerate(names, 1) if name), default=0)], delimiter)
    rows = [_row(path, header, line, text) for line, text in kept[1:]]
    if len(rows) < FEWEST_ROWS:
        raise InputError(f"{path}: expected at least {FEWEST_ROWS} rows under the header, got {len(rows)}")
    return header, rows


def _row(path: Path, header: _Header, at: int, line: str) -> _Row:
    cells = _split(path, at, line, header.delimiter)
    wanted = len(header.names)
    if not any(cells[wanted:]):
        cells = cells[:wanted]
    if len(cells) != wanted:
        expected = f"{wanted} cells between {DELIMITERS[header.delimiter]}s, as the header has"
        pairs = (
            header.delimiter == "," and wanted < len(cells) <= 2 * wanted and all(_is_number(cell) for cell in cells)
        )
        hint = ": if its numbers have decimal commas, write 0.5 for 0,5" if pairs else ""
        raise InputError(f"{path}:{at}: expected {expected}, got {len(cells)}{hint}")
    return _Row(at, cells)


def _split(path: Path, at: int, line: str, delimiter: str) -> tuple[str, ...]:
    if delimiter == " ":
        return tuple(line.split())
    try:
        return tuple(cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, strict=True)))
    except csv.Error as error:
        raise InputError(f"{path}:{at}: expected cells between {DELIMITERS[delimiter]}s, got: {error}") from None


def _header(path: Path, at: int, cells: tuple[str, ...], delimiter: str) -> _Header:
    if len(cells) > MOST_COLUMNS:
        raise InputError(f"{path}:{at}: expected at most {MOST_COLUMNS} columns, got {len(cells)}")
    cells = tuple(" ".join(cell.split()) for cell in cells)
    are_shown = [len(cell) <= LONGEST_HEADING and cell.isprintable() for cell in cells]  # as they are, in messages
    matches = [HEADING.fullmatch(cell) if shown else None for cell, shown in zip(cells, are_shown, strict=True)]
    words = [match["name"].strip().lower() if match else cell for match, cell in zip(matches, cells, strict=True)]
    names = tuple(NAMES.get(word, word) for word in words)
    units = tuple(_unit(match) for match in matches)
    header = _Header(names, units, at, delimiter)
    for word, name in zip(words, names, strict=True):
        if names.count(name) > 1:
            raise InputError(f"{path}:{at}: expected each column once, got {_shown(name)} {names.count(name)} times")
        if name not in NAMES and not REPLICATE.fullmatch(name):
            hint = "; a phase function is fitted with `--kind phase`" if word in ANGLES else ""
            raise InputError(f"{path}:{at}: expected a header of {ACCEPTED}, got the column {_shown(word)}{hint}")
    missing = next(_missing(header), None)
    if missing:
        raise InputError(f"{path}:{at}: expected a header of {ACCEPTED}, got {missing}")
    return header


def _unit(match: re.Match[str] | None) -> str:
    unit = next(filter(None, match.groups()[1:]), "").strip() if match else ""
    return unit[1:-1].strip() if unit[:1] == "(" and unit[-1:] == ")" else unit  # value / (1/mm^2)


def _missing(header: _Header) -> Iterator[str]:
    """Yield what a header lacks, or has too much of."""
    names, replicates = header.names, header.replicates
    if ("r_in" in names) != ("r_out" in names):
        yield "one of r_in and r_out without the other"
    if ("r" in names) == header.rings:
        yield "both r and r_in" if header.rings else "no column r"
    if replicates and ("value" in names or "sigma" in names):
        yield "replicates beside value or sigma"
    if replicates and len(replicates) < FEWEST:
        yield f"{len(replicates)} replicates: fewer than {FEWEST} give no useful standard error"
    if not replicates and "value" not in names:
        yield "no column value"
    if not replicates and "sigma" not in names:
        yield "no column sigma: a fit needs the standard errors of its data"


def _numbers(path: Path, header: _Header, rows: list[_Row]) -> dict[str, Floats]:
    """Return every column as numbers (n,), all of them finite."""
    table = np.empty((len(rows), len(header.names)))
    for i, row in enumerate(rows):
        for j, (name, cell) in enumerate(zip(header.names, row.cells, strict=True)):
            table[i, j] = _number(path, row.line, name, cell)
    return dict(zip(header.names, table.T, strict=True))


def _number(path: Path, line: int, name: str, cell: str) -> float:
    if _is_number(cell):
        return float(cell)
    place, expected = f"{path}:{line}: column {name}", "a finite number"
    if DECIMAL_COMMA.fullmatch(cell):
        raise InputError(f"{place}: expected a decimal point, as in 0.5 for 0,5, got the decimal comma {_shown(cell)}")
    with contextlib.suppress(ValueError):
        if math.isfinite(float(cell)) and "_" not in cell:
            expected = f"a number between {SMALLEST:g} and {LARGEST:g} in size, or 0"
    if not cell and REPLICATE.fullmatch(name):
        expected += ", since every row has all replicates"
    raise InputError(f"{place}: expected {expected}, got {_shown(cell)}")


def _is_number(cell: str) -> bool:
    try:
        size = abs(float(cell))
    except ValueError:
        return False
    return (size == 0 or SMALLEST <= size <= LARGEST) and "_" not in cell


def _radii(path: Path, header: _Header, rows: list[_Row], numbers: dict[str, Floats]) -> tuple[Floats, Floats]:
    """Return inner and outer radii (n,), rising."""
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
            again = ": replicates stand in one row, as value1, value2, value3" if inner[i] == inner[i - 1] else ""
            raise InputError(f"{place}: expected {expected}, got {inner[i]:g}{again}")
    return inner, outer


def _values(path: Path, header: _Header, rows: list[_Row], numbers: dict[str, Floats]) -> tuple[ModeratedVariance, str]:
    """Return values with their standard errors, and the kind of the errors in words."""
    if header.replicates:
        samples = np.stack([numbers[name] for name in header.replicates], axis=1)
        _require_light(path, samples.mean(axis=1))
        means = moderated_variances(samples)
        errors = f"standard errors of the means of {samples.shape[1]} replicates, variances moderated by their trend"
        named = header.replicates[0]
    else:
        _require_light(path, numbers["value"])
        means = ModeratedVariance(numbers["value"], numbers["sigma"], np.full(len(rows), np.inf), np.inf)
        named, errors = "sigma", "as given"
    for row, one in zip(rows, means.sigma, strict=True):
        if not 0 < one < np.inf and header.replicates:
            expected = f"replicates that differ, here or in {FEWEST} other rows, to know their standard error"
            raise InputError(f"{path}:{row.line}: column {named}: expected {expected}, got the same value in all")
        if not one > 0:
            raise InputError(f"{path}:{row.line}: column {named}: expected a standard error > 0, got {one:g}")
    return means, errors


def _require_light(path: Path, value: Floats) -> None:
    if not np.any(value > 0):
        raise InputError(f"{path}: expected a value above 0, got none")


def _length_unit(path: Path, header: _Header, unit: str | None) -> str:
    names = ("r_in", "r_out") if header.rings else ("r",)
    written = {header.unit(name) for name in names} - {""}
    for one in written:
        if one not in UNITS:
            raise InputError(
                f"{path}:{header.line}: column {names[0]}: expected a unit of {', '.join(UNITS)}, got {_shown(one)}"
            )
    if len({UNITS.get(one) for one in written | ({unit} if unit else set())}) > 1:
        units = ", ".join(sorted(written | ({unit} if unit else set())))
        raise InputError(f"{path}:{header.line}: column {names[0]}: expected one unit, here and in `unit`, got {units}")
    return written.pop() if written else checked_unit("unit", unit) if unit else ""


def _require_one_measure(path: Path, header: _Header) -> None:
    """InputError where an error, or another replicate, has a unit that is not the first value's."""
    first, *others = header.replicates or ("value", "sigma")
    for name in others:
        if not _equal_measures(header.unit(name) or header.unit(first), header.unit(first)):
            expected = f"the unit of {first}, [{header.unit(first)}], or none"
            raise InputError(f"{path}:{header.line}: column {name}: expected {expected}, got [{header.unit(name)}]")


def _equal_measures(one: str, other: str) -> bool:
    """Return whether two texts are one measure, however spelled."""
    areas = area_unit(one), area_unit(other)
    return one == other or (None not in areas and UNITS[str(areas[0])] == UNITS[str(areas[1])])


def _value_factor(path: Path, header: _Header, length: str, scaled: bool) -> float:
    """Return the factor to values per area in the unit of r; 1 where they are in any other measure."""
    name = header.replicates[0] if header.replicates else "value"
    text = header.unit(name)
    if not text:
        return 1.0
    unit = area_unit(text)
    if scaled and (unit is None or not length):
        return 1.0
    if unit is None:
        raise InputError(
            f"{path}:{header.line}: column {name}: expected light per area such as [1/mm^2], or `scaled` for any "
            f"other measure, got [{text}]"
        )
    if not length:
        raise InputError(f"{path}:{header.line}: column r: expected a unit, as {name} has one ([{text}]), got none")
    return factor(unit, length) ** -2


def _shown(cell: str) -> str:
    return repr(cell if len(cell) <= LONGEST_SHOWN else f"{cell[: LONGEST_SHOWN - 3]}...")


def is_tls(content: bytes) -> bool:
    """Return whether the first words of a text file are those of a TLS850."""
    words = content[:HEAD_BYTES].decode("utf-8", "replace").lower()
    first = next((line for line in words.splitlines() if line.strip()), "")
    return [word for word in CELLS.split(first.strip(" \ufeff")) if word][:3] == ["record", "pixel", "value"]


def read_tls(path: Path, content: bytes, colour: str | None, scaled: bool) -> Measured:
    """Read the records of one colour from a file's first TLS_BYTES + 1; InputError names the line of what is wrong."""
    if colour not in COLOURS:
        raise InputError(f"{path}: `colour` must be one of {', '.join(COLOURS)}, got {colour!r}")
    if not scaled:
        raise InputError(f"{path}: expected `scaled`, since the instrument's values are in a measure of its own")
    if len(content) > TLS_BYTES:
        raise InputError(f"{path}: expected records of at most {TLS_BYTES} bytes, got a longer file")
    whole = _records(path, content.decode("utf-8", "replace"))
    samples = whole[COLOURS.index(colour) :: len(COLOURS)]
    if len(samples) < FEWEST:
        raise InputError(f"{path}: expected {FEWEST} records of a colour or more, got {len(samples)}")
    r = np.linspace(0.0, LENGTH, samples.shape[1])
    start = int(np.argmax(samples.mean(axis=0))) + 1
    groups = (r.size - start) // AVERAGED
    if groups < FEWEST:
        raise InputError(f"{path}: expected the brightest pixel near the first one, got pixel {start}")
    kept = slice(start, start + groups * AVERAGED)
    means = samples[:, kept].reshape(len(samples), groups, AVERAGED).mean(axis=2)
    middle = r[kept].reshape(groups, AVERAGED).mean(axis=1)
    moderated = moderated_variances(means.T)
    notes = (
        f"{colour}: {len(samples)} records; {start} pixels up to the brightest one left out, the others "
        f"averaged by {AVERAGED}",
    )
    errors = f"standard errors of the means of {len(samples)} records, variances moderated by their trend"
    return Measured(
        str(path), hashlib.sha256(content).hexdigest(), middle, middle, moderated.value, moderated.sigma,
        moderated.freedom, errors, "mm", pooled=moderated.pooled, notes=notes,
    )  # fmt: skip


def _records(path: Path, text: str) -> Floats:
    """Return values (records, pixels)."""
    records: list[list[float]] = []
    for at, line in enumerate(text.splitlines(), start=1):
        cells = [cell for cell in CELLS.split(line.strip(" \ufeff\t")) if cell]
        if not cells or not cells[0].isdigit():
            continue  # words between records
        record, pixel, value = _tls_row(path, at, cells)
        if record == len(records) + 1 and pixel == 1 and record <= MOST_RECORDS:
            records.append([])
        if record != len(records) or pixel != len(records[-1]) + 1 or pixel > MOST_PIXELS:
            raise InputError(f"{path}:{at}: expected records and pixels that count from 1, got {record} and {pixel}")
        records[-1].append(value)
    if not records or len({len(one) for one in records}) != 1:
        raise InputError(f"{path}: expected records of as many pixels each, got {len(records)} that differ, or none")
    return np.array(records)


def _tls_row(path: Path, at: int, cells: list[str]) -> tuple[int, int, float]:
    try:
        record, pixel, value = int(cells[0]), int(cells[1]), float(cells[2])
    except (ValueError, IndexError):
        raise InputError(f"{path}:{at}: expected a record, a pixel and a value, got {' '.join(cells)[:40]!r}") from None
    if len(cells) != 3 or not abs(value) < LARGEST_VALUE:
        raise InputError(f"{path}:{at}: expected a record, a pixel and a value, got {' '.join(cells)[:40]!r}")
    return record, pixel, value

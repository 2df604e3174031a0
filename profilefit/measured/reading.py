"""Files of profiles: measured ones are tables, simulated ones .mco and .npz; errors name file, line and column.

    r [mm], value [1/mm^2], sigma        a value and its standard error at a radius
    r, value1, value2, value3            three replicates or more, whose mean and standard error are used
    r_in, r_out, value, sigma            averages over annuli

Cells are separated by tabs, else semicolons, else commas, else spaces, by what the header has. Units stand in brackets,
in parentheses or after a slash: r [mm], r (mm), r/mm. A # starts a comment; a line such as # n = 1.4 states one of
`Facts`, and a note names what else comments state. The value's unit, if it is not the one of r, is converted; [a.u.] or
any other word needs an unknown scale. Numbers have decimal points: a comma is an error, since it may part thousands.

Text files of Dia-Stron's translucency meter TLS850 have record, pixel and value in a row, 512 pixels a record. Records
go red, green, blue, red, ...; those of one colour are replicates. Pixels are along a line of 20 mm that begins at the
spot; values are in a measure of the instrument's own. Between records there may be lines of words. Pixels before the
brightest one see the spot and are left out; of the others, neighbours are averaged.

MCML's .mco holds no errors. A photon's weight w is at most that with which it entered, 1 - R_specular, so the mean of
w^2 over a ring of energy E is at most E (1 - R_specular): the fit uses that bound, its errors are bounds too, and its
chi-square is at most what it should be. The .npz that `mcml-sim run` writes has the errors. The last ring of an .mco,
which holds all light beyond it, is left out. Rings share the photons of their run, which correlates them (see `noise`):
their covariance -E_i E_j / (N - 1) is exact where a photon leaves once and as a whole. Leaving out far rings of few
photons would leave out the absence of light: neighbours are merged until each holds enough, the empty tail included.
"""

from __future__ import annotations

import csv
import hashlib
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mcml_sim.files.whole_file import read_whole, text_of
from mcml_sim.media.arrays import as_number, require
from mcml_sim.media.medium import Medium
from mcml_sim.results import mco, tally
from mcml_sim.results.mci import quoted
from profilefit.errors import InputError
from profilefit.materials import CHANNELS
from profilefit.measured.data import (
    FEWEST,
    HEADER,
    REPLICATE,
    UNITS,
    Fact,
    Facts,
    Floats,
    Measured,
    ModeratedVariance,
    ProfileColumns,
    area_unit,
    factor,
    moderated_variances,
)

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
COLUMNS = {key: one for key, one in ProfileColumns.model_json_schema()["properties"].items() if key != "replicates"}
NAMES = {spelling: name for name, column in COLUMNS.items() for spelling in column["spellings"].split(", ")}
DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?")
FACTS = Facts.model_json_schema()["properties"]
FACT = {spelling: name for name, fact in FACTS.items() for spelling in fact["spellings"].split(", ")}
BRACKETED = re.compile(r"\[(?P<square>[^\[\]]*)\]|\((?P<round>[^()]*)\)")
LONGEST_NAME = 6  # words; more are a sentence
MOST_SHOWN = 5  # statements that a note names
ANGLES = ("angle", "theta", "scattering angle")  # columns of a phase function
SMALLEST, LARGEST = 1e-100, 1e100  # of a number, whose squares and units are floats then
TLS_BYTES = 2**24  # of a TLS850's file
HEAD_BYTES = 4096  # hold its first line of words
LENGTH = 20.0  # mm
AVERAGED = 4  # pixels
CELLS = re.compile(r"[\s,;]+")
LARGEST_VALUE = 1e12
MOST_RECORDS = 3000
MOST_PIXELS = 4096
UNIT = "cm"  # of simulated profiles
FEWEST_PHOTONS = 100.0  # of a ring, whose standard error is then known to 10 %, and near enough to a normal one
NARROWEST = 0.03  # of a ring, relative to its radius: narrower ones add no information about a smooth profile
FEWEST_RINGS = 3
MOST_LAYERS = 6  # that a note names
ENDLESS = 1e4  # cm: what users of MCML write for a half space is 1e8
ALL_LIGHT = 1.0 + 1e-3  # files are rounded
MODERATED = "standard errors of the means of {}, variances moderated by their trend"


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
    words = content[:HEAD_BYTES].decode("utf-8", "replace").lower()
    first = next((line for line in words.splitlines() if line.strip()), "")
    if [word for word in CELLS.split(first.strip(" \ufeff")) if word][:3] == ["record", "pixel", "value"]:
        return _read_tls(path, content, colour, scaled)
    require(colour is None, "colour", "left out but for records of a TLS850", colour)
    if kind not in SIMULATED:
        return _read_table(path, content, unit, scaled)
    require(unit in (None, UNIT), "unit", f"{UNIT} or left out for {path.suffix}, whose lengths are in {UNIT}", unit)
    return SIMULATED[kind](path)


def _read_table(path: Path, content: bytes, unit: str | None, scaled: bool) -> Measured:
    """Read a table from a file's first MAX_BYTES + 1 bytes or more."""
    text = text_of(path, content, MAX_BYTES, "a profile")
    if "\0" in text:
        raise _bad(path, content[: content.index(0)].count(b"\n") + 1, "expected text in UTF-8", "the byte 0x00")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    table = _table(path, lines)
    stated, others = _stated(path, lines)
    named = stated.pop("unit", None)
    notes = _notes(others, named, unit)
    unit, label = (named.text, f"{path}:{named.line}: unit") if named and unit is None else (unit, "unit")
    cells = [[_number(table, line, *each) for each in zip(table.units, row, strict=True)] for line, row in table.rows]
    numbers = dict(zip(table.units, np.array(cells).T, strict=True))
    inner, outer = _radii(table, numbers)
    length = _length_unit(table, Facts.parsed("unit", unit, label) if unit else None)
    means, errors = _values(table, numbers)
    times = _value_factor(table, length, scaled)
    return Measured(
        str(path), hashlib.sha256(content).hexdigest(), inner, outer, means.value * times, means.sigma * times,
        means.freedom, errors, length, pooled=means.pooled, notes=notes, stated=stated,
    )  # fmt: skip


@dataclass(frozen=True)
class _Table:
    """Table as text.

    units  of the columns by name, in their order; "" where none is given. line where the header stands
    rows   the line and the cells of each
    """

    path: Path
    units: dict[str, str]
    line: int
    rows: list[tuple[int, tuple[str, ...]]]

    @property
    def replicates(self) -> tuple[str, ...]:
        return tuple(name for name in self.units if REPLICATE.fullmatch(name))

    @property
    def rings(self) -> bool:
        return "r_in" in self.units

    def bad(self, line: int, name: str, expected: str, got: str) -> InputError:
        """Return the error of a cell, or of a column's head."""
        return _bad(self.path, line, f"column {name}: expected {expected}", got)


def _bad(path: Path, line: int, expected: str, got: object) -> InputError:
    return InputError(f"{path}:{line}: {expected}, got {got}")


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
            is_long = len(words.split()) > LONGEST_NAME
            is_sentence = is_long or value.startswith("//") or not re.search(r"[^\W\d]", words)
            others += [] if is_sentence or not value else [Fact(spelled, at)]
            continue
        if name in facts:
            raise _bad(path, at, f"expected {name} once", "it again")
        if not value:
            raise _bad(path, at, f"expected a value of {name}", "none")
        unit = next((word for word in BRACKETED.findall(spelled) for word in word if word in UNITS), "")
        facts[name] = Fact(f"{value} {unit}" if unit and value[-1:].isdigit() else value, at)
    return facts, others


def _notes(others: list[Fact], named: Fact | None, unit: str | None) -> tuple[str, ...]:
    """Return notes on statements that are not understood, and on a unit that another one replaces."""
    notes = []
    if others:
        shown = ", ".join(f"{quoted(one.text)} (line {one.line})" for one in others[:MOST_SHOWN])
        more = f" and {len(others) - MOST_SHOWN} more" if len(others) > MOST_SHOWN else ""
        notes.append(f"comments state what is not understood: {shown}{more}; known are {', '.join(FACTS)}")
    if named is not None and unit is not None and UNITS.get(named.text) != UNITS.get(unit):
        notes.append(f"the file's unit is {quoted(named.text)} (line {named.line}), read with `unit` {unit}")
    return tuple(notes)


def _table(path: Path, lines: list[str]) -> _Table:
    if len(lines) > MOST_LINES:
        raise InputError(f"{path}: expected a profile of at most {MOST_LINES} lines, got {len(lines)}")
    kept = [(at, line.partition("#")[0]) for at, line in enumerate(lines, start=1)]
    kept = [(at, line) for at, line in kept if line.strip()]
    if not kept:
        raise InputError(f"{path}: expected a header and rows ({HEADER}), got an empty file")
    at, first = kept[0]
    delimiter = next((one for one in DELIMITERS if one in first.strip()), ",")
    heads = tuple(WORD.findall(first)) if delimiter == " " else _split(path, at, first, delimiter)
    # The columns after the last one with a name are those that spreadsheets leave empty.
    units = _header(path, at, heads[: max((i for i, head in enumerate(heads, 1) if head), default=0)])
    rows = [(line, _row(path, len(units), delimiter, line, text)) for line, text in kept[1:]]
    if len(rows) < FEWEST_ROWS:
        raise InputError(f"{path}: expected at least {FEWEST_ROWS} rows under the header, got {len(rows)}")
    return _Table(path, units, at, rows)


def _row(path: Path, count: int, delimiter: str, at: int, line: str) -> tuple[str, ...]:
    cells = _split(path, at, line, delimiter)
    if not any(cells[count:]):
        cells = cells[:count]
    if len(cells) != count:
        pairs = delimiter == "," and count < len(cells) <= 2 * count and all(_is_number(cell) for cell in cells)
        hint = ": if its numbers have decimal commas, write 0.5 for 0,5" if pairs else ""
        expected = f"expected {count} cells between {DELIMITERS[delimiter]}s, as the header has"
        raise _bad(path, at, expected, f"{len(cells)}{hint}")
    return cells


def _split(path: Path, at: int, line: str, delimiter: str) -> tuple[str, ...]:
    if delimiter == " ":
        return tuple(line.split())
    try:
        return tuple(cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, strict=True)))
    except csv.Error as error:
        raise InputError(f"{path}:{at}: expected cells between {DELIMITERS[delimiter]}s, got: {error}") from None


def _header(path: Path, at: int, cells: tuple[str, ...]) -> dict[str, str]:
    """Return the units of the columns by name, checked by `ProfileColumns`."""
    if len(cells) > MOST_COLUMNS:
        raise _bad(path, at, f"expected at most {MOST_COLUMNS} columns", len(cells))
    cells = tuple(" ".join(cell.split()) for cell in cells)
    are_shown = (len(cell) <= LONGEST_HEADING and cell.isprintable() for cell in cells)  # as they are, in messages
    matches = [HEADING.fullmatch(cell) if shown else None for cell, shown in zip(cells, are_shown, strict=True)]
    words = [match["name"].strip().lower() if match else cell for match, cell in zip(matches, cells, strict=True)]
    names = tuple(NAMES.get(word, word) for word in words)
    for word, name in zip(words, names, strict=True):
        if names.count(name) > 1:
            raise _bad(path, at, "expected each column once", f"{quoted(name)} {names.count(name)} times")
        if name not in NAMES and not REPLICATE.fullmatch(name):
            hint = "; a phase function is fitted with `--kind phase`" if word in ANGLES else ""
            raise _bad(path, at, f"expected a header of {HEADER}", f"the column {quoted(word)}{hint}")
    units = [next(filter(None, match.groups()[1:]), "").strip() if match else "" for match in matches]
    units = [unit[1:-1].strip() if unit[:1] == "(" and unit[-1:] == ")" else unit for unit in units]  # value / (1/mm^2)
    columns = dict(zip(names, units, strict=True))
    replicates = {name: unit for name, unit in columns.items() if name not in COLUMNS}
    others = {name: columns[name] for name in columns.keys() - replicates}
    ProfileColumns.of(f"{path}:{at}", {**others, "replicates": replicates})
    return columns


def _number(table: _Table, line: int, name: str, cell: str) -> float:
    if _is_number(cell):
        return float(cell)
    if DECIMAL_COMMA.fullmatch(cell):
        raise table.bad(line, name, "a decimal point, as in 0.5 for 0,5", f"the decimal comma {quoted(cell)}")
    expected = "a finite number"
    if math.isfinite(as_number(cell)) and "_" not in cell:
        expected = f"a number between {SMALLEST:g} and {LARGEST:g} in size, or 0"
    if not cell and REPLICATE.fullmatch(name):
        expected += ", since every row has all replicates"
    raise table.bad(line, name, expected, quoted(cell))


def _is_number(cell: str) -> bool:
    size = abs(as_number(cell))
    return (size == 0 or SMALLEST <= size <= LARGEST) and "_" not in cell


def _radii(table: _Table, numbers: dict[str, Floats]) -> tuple[Floats, Floats]:
    """Return inner and outer radii (n,), rising."""
    first, last = ("r_in", "r_out") if table.rings else ("r", "r")
    inner, outer = numbers[first], numbers[last]
    for i, (line, _) in enumerate(table.rows):
        if inner[i] < 0 or (inner[i] == 0 and not table.rings):
            raise table.bad(line, first, COLUMNS[first]["cells"], f"{inner[i]:g}")
        if outer[i] <= inner[i] and table.rings:
            raise table.bad(line, last, f"{COLUMNS[last]['cells']} {inner[i]:g}", f"{outer[i]:g}")
        if i and (inner[i] < outer[i - 1] or (inner[i] == outer[i - 1] and not table.rings)):
            before = f"{outer[i - 1]:g}"
            expected = f"at least the r_out {before} before" if table.rings else f"r to rise above {before}"
            again = ": replicates stand in one row, as value1, value2, value3" if inner[i] == inner[i - 1] else ""
            raise table.bad(line, first, expected, f"{inner[i]:g}{again}")
    return inner, outer


def _values(table: _Table, numbers: dict[str, Floats]) -> tuple[ModeratedVariance, str]:
    """Return values with their standard errors, and the kind of the errors in words."""
    replicates = table.replicates
    samples = np.stack([numbers[name] for name in replicates or ("value",)], axis=1)
    value = samples.mean(axis=1)
    if not np.any(value > 0):
        raise InputError(f"{table.path}: expected a value above 0, got none")
    if replicates:
        means, errors = moderated_variances(samples), MODERATED.format(f"{len(replicates)} replicates")
    else:
        means, errors = ModeratedVariance(value, numbers["sigma"], np.full(value.size, np.inf), np.inf), "as given"
    for (line, _), one in zip(table.rows, means.sigma, strict=True):
        if replicates and not 0 < one < np.inf:
            expected = f"replicates that differ, here or in {FEWEST} other rows, to know their standard error"
            raise table.bad(line, replicates[0], expected, "the same value in all")
        if not one > 0:
            raise table.bad(line, "sigma", COLUMNS["sigma"]["cells"], f"{one:g}")
    return means, errors


def _length_unit(table: _Table, unit: str | None) -> str:
    names = ("r_in", "r_out") if table.rings else ("r",)
    written = {table.units[name] for name in names} - {""}
    units = written | ({unit} if unit else set())
    if len({UNITS.get(one) for one in units}) > 1:
        raise table.bad(table.line, names[0], "one unit, here and in `unit`", ", ".join(sorted(units)))
    return next(iter(written), unit or "")


def _value_factor(table: _Table, length: str, scaled: bool) -> float:
    """Return the factor to values per area in the unit of r; 1 where they are in any other measure."""
    name = table.replicates[0] if table.replicates else "value"
    text = table.units[name]
    unit = area_unit(text)
    if not text or (scaled and (unit is None or not length)):
        return 1.0
    if unit is None:
        raise table.bad(table.line, name, COLUMNS["value"]["accepted"], f"[{text}]")
    if not length:
        raise table.bad(table.line, "r", f"a unit, as {name} has one ([{text}])", "none")
    return factor(unit, length) ** -2


def _read_tls(path: Path, content: bytes, colour: str | None, scaled: bool) -> Measured:
    """Read the records of one colour from a file's first TLS_BYTES + 1; InputError names the line of what is wrong."""
    require(colour in CHANNELS, f"{path}: `colour`", f"one of {', '.join(CHANNELS)}", colour)
    if not scaled:
        raise InputError(f"{path}: expected `scaled`, since the instrument's values are in a measure of its own")
    if len(content) > TLS_BYTES:
        raise InputError(f"{path}: expected records of at most {TLS_BYTES} bytes, got a longer file")
    samples = _records(path, content.decode("utf-8", "replace"))[CHANNELS.index(colour) :: len(CHANNELS)]
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
    left = f"{start} pixels up to the brightest one left out, the others averaged by {AVERAGED}"
    return Measured(
        str(path), hashlib.sha256(content).hexdigest(), middle, middle, moderated.value, moderated.sigma,
        moderated.freedom, MODERATED.format(f"{len(samples)} records"), "mm", pooled=moderated.pooled,
        notes=(f"{colour}: {len(samples)} records; {left}",),
    )  # fmt: skip


def _records(path: Path, text: str) -> Floats:
    """Return values (records, pixels)."""
    records: list[list[float]] = []
    for at, line in enumerate(text.splitlines(), start=1):
        cells = [cell for cell in CELLS.split(line.strip(" \ufeff\t")) if cell]
        if not cells or not cells[0].isdigit():
            continue  # words between records
        try:
            record, pixel, value = int(cells[0]), int(cells[1]), float(cells[2])
        except (ValueError, IndexError):
            value = math.nan
        if len(cells) != 3 or not abs(value) < LARGEST_VALUE:
            raise _bad(path, at, "expected a record, a pixel and a value", repr(" ".join(cells)[:40]))
        if record == len(records) + 1 and pixel == 1 and record <= MOST_RECORDS:
            records.append([])
        if record != len(records) or pixel != len(records[-1]) + 1 or pixel > MOST_PIXELS:
            raise _bad(path, at, "expected records and pixels that count from 1", f"{record} and {pixel}")
        records[-1].append(value)
    if not records or len({len(one) for one in records}) != 1:
        raise InputError(f"{path}: expected records of as many pixels each, got {len(records)} that differ, or none")
    return np.array(records)


def _read_mco(path: Path) -> Measured:
    """Read Rd_r of an .mco file, lengths in cm."""
    content = read_whole(path, mco.MAX_BYTES)
    result = mco.parse_mco(content, str(path))
    grid, photons = result.run.grid, result.run.photons
    entered = 1.0 - result.specular_reflectance
    if not entered > 0:
        raise InputError(f"{path}: expected a specular reflectance below 1, got {result.specular_reflectance:g}")
    energy = (result.reflectance_r * grid.r_areas)[:-1]
    each = entered / photons
    return _counted(
        path, content, grid.r_edges[:-1], energy, energy * each, energy / each, float(photons),
        errors="bounds: no photon weighs more than it entered with", bounded=True, medium=result.run.medium,
        illumination="searchlight",
        notes=(f"the last of {grid.rings} annuli, which holds all light beyond it, is left out",),
    )  # fmt: skip


def _read_npz(path: Path) -> Measured:
    """Read reflectance_r of the results of `mcml-sim run`, with its own errors, lengths in cm."""
    content = read_whole(path, tally.MAX_BYTES)
    result = tally.parse_results(content, str(path))
    if result.photons < 2:
        raise InputError(f"{path}: expected two photons or more, since one has no standard error, got 1")
    estimate, areas = result.estimates["reflectance_r"], result.grid.r_areas
    with np.errstate(over="ignore"):  # impossible reflectances are refused below
        energy, error = np.asarray(estimate.value) * areas, np.asarray(estimate.standard_error) * areas
        squares = error**2 + energy**2 / (result.photons - 1.0)
    if not np.all(error <= ALL_LIGHT):
        raise InputError(f"{path}: expected standard errors of no more than all of the light")
    return _counted(
        path, content, result.grid.r_edges, energy, squares, np.asarray(estimate.effective_samples),
        float(result.photons), errors="standard errors of the simulation", medium=result.medium,
        illumination=result.illumination, notes=(),
    )  # fmt: skip


def _counted(
    path: Path, content: bytes, edges: Floats, energy: Floats, squares: Floats, seen: Floats, photons: float, **run: Any
) -> Measured:
    """Return rings merged until each holds enough of the run's N photons, from (n,) rings; `run` as of `Measured`.

    energy  E of each; squares the sum of w^2 of its photons over N (N - 1), whose excess over E^2 / (N - 1) is the
            variance of E; seen the photons that it is estimated from
    """
    if not (np.all(energy >= 0) and np.all(energy <= ALL_LIGHT) and energy.sum() <= ALL_LIGHT):
        raise InputError(f"{path}: expected annuli of reflectance >= 0 that add up to at most 1")
    starts = merged(edges, seen)
    if starts.size < FEWEST_RINGS:
        expected = f"at least {FEWEST_RINGS} annuli of {FEWEST_PHOTONS:.0f} photons each"
        raise InputError(f"{path}: expected {expected}, got {float(seen.sum()):.0f} in all")
    inner, outer = edges[starts], np.append(edges[starts[1:]], edges[-1])
    areas = np.pi * (outer - inner) * (outer + inner)
    whole = np.add.reduceat(energy, starts)
    variance = np.add.reduceat(squares, starts) - whole**2 / (photons - 1.0)
    if not np.all(variance > 0):
        at = int(np.argmin(variance > 0))
        raise InputError(f"{path}: expected a standard error > 0 of the light from r = {inner[at]:g} to {outer[at]:g}")
    notes = [*run.pop("notes"), *_layers(run["medium"])]
    if starts.size < energy.size:
        notes.append(f"{energy.size} annuli merged into {starts.size}, of at least {FEWEST_PHOTONS:.0f} photons each")
    return Measured(
        str(path), hashlib.sha256(content).hexdigest(), inner, outer, whole / areas, np.sqrt(variance) / areas,
        np.full(whole.size, np.inf), unit=UNIT, counted=True, photons=photons, notes=tuple(notes), **run,
    )  # fmt: skip


def _layers(medium: Medium) -> Iterator[str]:
    """Yield notes on what a medium has that no half space has."""
    if len(medium.layers) > 1:
        each = (
            f"n {one.n:g}, mu_a {one.mu_a:g}, mu_s' {one.similar.mu_s:g} 1/cm, "
            + ("endless" if math.isinf(one.thickness) else f"{one.thickness:g} cm")
            for one in medium.layers[:MOST_LAYERS]
        )
        more = f"; and {len(medium.layers) - MOST_LAYERS} more" if len(medium.layers) > MOST_LAYERS else ""
        yield f"the file's {len(medium.layers)} layers, from above: {'; '.join(each)}{more}"
    if not (medium.is_half_space or medium.z_edges[-1] > ENDLESS):
        yield (
            f"the file's medium is a slab {medium.z_edges[-1]:g} cm thick, fitted as a half space: light that leaves "
            "below reads as absorbed"
        )


def merged(edges: Floats, photons: Floats) -> np.ndarray:
    """Return where the merged rings start (m,), from the innermost out; what is left at the end joins the last one."""
    starts, held, begin = [], 0.0, 0
    for at, one in enumerate(photons):
        held += one
        if held >= FEWEST_PHOTONS and edges[at + 1] - edges[begin] >= NARROWEST * edges[at + 1]:
            starts.append(begin)
            held, begin = 0.0, at + 1
    return np.array(starts, int)


SIMULATED = {".mco": _read_mco, ".npz": _read_npz}

"""Text files of Dia-Stron's translucency meter TLS850: record, pixel and value in a row, 512 pixels a record.

Records go red, green, blue, red, ...; those of one colour are replicates. Pixels are along a line of 20 mm that begins
at the spot; values are in a measure of the instrument's own. Between records there may be lines of words.

Pixels before the brightest one see the spot and are left out; of the others, neighbours are averaged.
"""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

import numpy as np

from profilefit.errors import InputError
from profilefit.measured.data import Floats, Measured
from profilefit.measured.replicates import FEWEST, moderated_variances

MAX_BYTES = 2**24
HEAD_BYTES = 4096  # hold the first line of words
COLOURS = ("red", "green", "blue")
LENGTH = 20.0  # mm
AVERAGED = 4  # pixels
CELLS = re.compile(r"[\s,;]+")
LARGEST = 1e12
MOST_RECORDS = 3000
MOST_PIXELS = 4096


def is_tls(content: bytes) -> bool:
    """Whether the first words of a text file are those of such a file."""
    words = content[:HEAD_BYTES].decode("utf-8", "replace").lower()
    first = next((line for line in words.splitlines() if line.strip()), "")
    return [word for word in CELLS.split(first.strip(" \ufeff")) if word][:3] == ["record", "pixel", "value"]


def read_tls(path: Path, content: bytes, colour: str | None, scaled: bool) -> Measured:
    """The records of one colour, of a file's first MAX_BYTES + 1; InputError names the line of what is wrong."""
    if colour not in COLOURS:
        raise InputError(f"{path}: `colour` must be one of {', '.join(COLOURS)}, got {colour!r}")
    if not scaled:
        raise InputError(f"{path}: expected `scaled`, since the instrument's values are in a measure of its own")
    if len(content) > MAX_BYTES:
        raise InputError(f"{path}: expected records of at most {MAX_BYTES} bytes, got a longer file")
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
    found = moderated_variances(means.T)
    notes = (
        f"{colour}: {len(samples)} records; {start} pixels up to the brightest one left out, the others "
        f"averaged by {AVERAGED}",
    )
    errors = f"standard errors of the means of {len(samples)} records, variances moderated by their trend"
    return Measured(
        str(path), hashlib.sha256(content).hexdigest(), middle, middle, found.value, found.sigma, found.freedom,
        errors, "mm", pooled=found.pooled, notes=notes,
    )  # fmt: skip


def _records(path: Path, text: str) -> Floats:
    """Values, (records, pixels)."""
    found: list[list[float]] = []
    for at, line in enumerate(text.splitlines(), start=1):
        cells = [cell for cell in CELLS.split(line.strip(" \ufeff\t")) if cell]
        if not cells or not cells[0].isdigit():
            continue  # words between records
        record, pixel, value = _row(path, at, cells)
        if record == len(found) + 1 and pixel == 1 and record <= MOST_RECORDS:
            found.append([])
        if record != len(found) or pixel != len(found[-1]) + 1 or pixel > MOST_PIXELS:
            raise InputError(f"{path}:{at}: expected records and pixels that count from 1, got {record} and {pixel}")
        found[-1].append(value)
    if not found or len({len(one) for one in found}) != 1:
        raise InputError(f"{path}: expected records of as many pixels each, got {len(found)} that differ, or none")
    return np.array(found)


def _row(path: Path, at: int, cells: list[str]) -> tuple[int, int, float]:
    try:
        record, pixel, value = int(cells[0]), int(cells[1]), float(cells[2])
    except (ValueError, IndexError):
        raise InputError(f"{path}:{at}: expected a record, a pixel and a value, got {' '.join(cells)[:40]!r}") from None
    if len(cells) != 3 or not abs(value) < LARGEST:
        raise InputError(f"{path}:{at}: expected a record, a pixel and a value, got {' '.join(cells)[:40]!r}")
    return record, pixel, value

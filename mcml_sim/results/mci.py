r"""Input files of MCML: a .mci names runs, each with an output file, photons, bins and layers. Lengths in cm.

The first format is that of MCML V1 (Wang, Jacques & Zheng 1995, and the function ReadParm of its mcmlio.c): a version,
the number of runs, and for each run

    NAME.mco A              output file, and A or B
    1000000                 photons
    0.01 0.01               dz dr
    40 50 1                 nz nr na
    3                       layers
    1.0                     n above
    1.37 1 100 0.9 0.1      n mu_a mu_s g thickness, a line for each layer
    1.0                     n below

A # starts a comment, blank lines may stand anywhere, and words after the values of a line are not read, as in V1; nor
is what follows the last run. Comments may have any bytes. Unlike V1, a number too many is an error, a sign of
a line too many, and so is a word that is not quite a number, of which V1 reads what it can: 1 photon of 1e6. V1 wrote
text for B as for A, so B is read and makes no difference. Beyond V1, g may be negative, and the last thickness may be
`inf`; the 1E8 that V1's users write for that stays a length.

The second is that of MCML 2 (Wang & Jacques 1996, ReadMediumListQ and ReadParam of its mcmlio.c): media by name, then
runs until `end`.

    mcmli2.0                file version
    air   1.0 0 0 0         media by name: n mu_a mu_s g
    skin  1.37 1 100 0.9
    end
    NAME.mco A              output file, and A or B
    air                     layers from the top: the medium above, each layer with its thickness, the medium below
    skin 0.1
    air
    end
    pencil                  source, and the depth that it starts from
    0
    0.01 0.01 0.1           dz dr dt
    40 50 1 1               nz nr nt na
    Rd_r A_rz               what is scored; a line that ends in \ goes on in the next
    1000000 10:00           photons, and a time limit
    1E-4                    threshold weight of the roulette
    1                       seed
    end                     of all runs

What is simulated here is a pencil beam onto the surface without times: an isotropic or a buried source, a quantity
resolved in time and a number of photons that only a time limits are refused. Everything else that can be scored is, in
the format of V1. The roulette has no bias, so its threshold makes no difference, and no time limit ends a run.
"""

from __future__ import annotations

import io
import itertools
import os
import posixpath
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

from mcml_sim.errors import InputError
from mcml_sim.files.whole_file import read_whole
from mcml_sim.media.arrays import MAX_PHOTONS
from mcml_sim.media.grid import MAX_BINS, MAX_CELLS, Grid
from mcml_sim.media.medium import MAX_LAYERS, Layer, Medium

# Bounds of a file and of what it requests: far beyond any use, near enough that a slip of the pen fails at once and
# not after hours or gigabytes.
MAX_BYTES = 2**21
MAX_LINES = 2**20
MAX_RUNS = 10_000
MAX_NAME = 255  # characters; what V1 and most file systems hold
LENGTHS = (1e-12, 1e12)  # [cm]
COEFFICIENTS = (1e-12, 1e12)  # [1/cm]; or 0
INDICES = (0.01, 100.0)

VERSION_2 = "mcmli2."
PENCIL = "pencil"
MOST_MEDIA = 1000
MOST_SEED = 2**31 - 1
SCORED = ("Rd_r", "Rd_a", "Rd_ra", "Td_r", "Td_a", "Td_ra", "A_z", "A_rz")
PICOSECONDS = (1e-12, 1e12)
LARGEST = 1e30  # of a number that makes no difference

WHOLE = re.compile(r"[+-]?[0-9]{1,30}")
DECIMAL = re.compile(r"[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]{1,4})?")
INFINITE = re.compile(r"\+?inf(inity)?", re.IGNORECASE)
FORMAT = re.compile(r"[ab][^.]*", re.IGNORECASE)
# What bytes that are no UTF-8 become; in comments they may stand.
STRAY = re.compile(r"[\udc80-\udcff]")
# What V1 drops from a line: control characters that are no white space (old DOS files end in one).
CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f\x7f]")
LONGEST_SHOWN = 40  # characters of a word in a message
OUTPUT = "the name of an output file, and A or B"
V = TypeVar("V", int, float)


@dataclass(frozen=True)
class Run:
    """Run of a .mci file. Lengths in cm."""

    output: str
    """Name of the output file, as it stands in the input."""
    format: str
    """Letter "A" or "B", as it stands in the input; the output is text in both cases, as V1's is."""
    photons: int
    dz: float
    """Width of the depth bins [cm]."""
    dr: float
    """Width of the rings [cm]."""
    nz: int
    nr: int
    na: int
    """Numbers of depths, rings and exit angles."""
    medium: Medium
    seed: int | None = None
    """Seed in an input of MCML 2, else None."""
    limit: str = ""
    """Time limit of an input of MCML 2, which ends no run here."""

    @property
    def grid(self) -> Grid:
        """Grid in cm. Made on first use: thousands of runs with fine grids would fill the memory."""
        return Grid(self.dr, self.nr, self.dz, self.nz, na=self.na)

    @property
    def cells(self) -> int:
        """Number of values that its results hold, about."""
        return (self.nr + 1) * (self.nz + 1) + 2 * (self.nr + 1) * (self.na + 1) + len(self.medium.layers)


def read_mci(path: str | os.PathLike[str]) -> tuple[Run, ...]:
    """Return the runs of a .mci file of MCML V1 or 2, in their order. Lengths in cm, coefficients in 1/cm.

    InputError in one line, `FILE:LINE: expected ..., got ...`, for everything that is not such a file, and for runs
    beyond the bounds above: 1e13 photons, 65536 bins an axis, 2^21 cells a table, 1000 layers, 10000 runs, 2 MiB.
    """
    return parse_mci(read_whole(path, MAX_BYTES), str(path))


def parse_mci(content: bytes, name: str) -> tuple[Run, ...]:
    """Return what `read_mci` gives for a file of this name and content."""
    if len(content) > MAX_BYTES:
        raise InputError(f"{name}: expected a .mci file of at most {MAX_BYTES} bytes, got a longer one")
    before, null, _ = content.partition(b"\x00")
    if null:
        line = before.replace(b"\r\n", b"\n").replace(b"\r", b"\n").count(b"\n") + 1
        raise InputError(f"{name}:{line}: expected text in UTF-8, got the byte 0x00")
    lines = Lines(name, content)
    (version,) = lines.take(1, "the file version, 1.0 or mcmli2.0")
    if version.startswith(VERSION_2):
        return tuple(_runs_of_2(lines, read_media(lines)))
    if not (DECIMAL.fullmatch(version) and 1 <= float(version) < 2):
        raise lines.error("the file version, 1.0 or mcmli2.0", quoted(version))
    outputs: set[str] = set()
    return tuple(read_run(lines, outputs) for _ in range(_alone(lines, lines.whole, "the number of runs", MAX_RUNS)))


class Lines:
    """Data lines of a file, one after the other, and their places."""

    def __init__(self, name: str, content: bytes) -> None:
        self._name = name
        # Not splitlines(): it breaks lines where no editor does, and their numbers would be off. One after the other,
        # since a list of empty lines takes eight times their bytes. A mark that some editors put first is no text.
        self._lines = io.TextIOWrapper(io.BytesIO(content + b"\n"), "utf-8-sig", errors="surrogateescape")
        self._number = 0

    def take(self, count: int, expected: str, optional: int = 0) -> list[str]:
        """Return the first `count` words of the next line with any, and up to `optional` more; no number may follow."""
        most = count + optional
        for line in self._without_comments(expected):
            words = CONTROL.sub("", line).split(maxsplit=most + 1)
            if len(words) > most and _is_number(words[most]):
                numbers = itertools.takewhile(_is_number, " ".join(words[most:]).split())
                raise self.error(f"{expected} alone", f"{most + sum(1 for _ in numbers)} values")
            if len(words) >= count:
                if stray := STRAY.search(" ".join(words[:most])):
                    raise self.error("text in UTF-8", f"the byte {ord(stray[0]) - 0xDC00:#04x}")
                return words[:most]
            if words:
                raise self.error(f"{count} values, {expected}", f"{len(words)}: {quoted(' '.join(words))}")
        raise self.error(expected, "the end of the file")

    def find(self, key: str) -> None:
        """Go on to the line that begins with the word `key`."""
        expected = f"the section {key}"
        if not any(line.split(maxsplit=1)[:1] == [key] for line in self._without_comments(expected)):
            raise self.error(expected, "the end of the file")

    def _without_comments(self, expected: str) -> Iterator[str]:
        """Yield the lines that follow, as they are counted, up to their comments."""
        for line in self._lines:
            self._number += 1
            if self._number > MAX_LINES:
                raise self.error(expected, f"more than {MAX_LINES} lines before it")
            yield line.partition("#")[0]

    def error(self, expected: str, got: str) -> InputError:
        """Return the error to raise about the line that was read last."""
        return InputError(f"{self._name}:{self._number}: expected {expected}, got {got}")

    def whole(self, name: str, word: str, most: int, least: int = 1, decimal: bool = False) -> int:
        """Return a whole number from `least` to `most`; `decimal` takes 1e6, too."""
        if decimal and DECIMAL.fullmatch(word) and float(word).is_integer() and least <= float(word) <= most:
            return int(float(word))
        if WHOLE.fullmatch(word) and least <= int(word) <= most:
            return int(word)
        raise self.error(f"{name}, a whole number from {least} to {most}", quoted(word))

    def decimal(self, name: str, word: str, bounds: tuple[float, float], or_else: str = "") -> float:
        """Return a number within bounds, both included."""
        if DECIMAL.fullmatch(word) and bounds[0] <= float(word) <= bounds[1]:
            return float(word) + 0.0  # no -0
        raise self.error(f"{name}, {or_else}a number from {bounds[0]:g} to {bounds[1]:g}", quoted(word))

    def coefficient(self, name: str, word: str) -> float:
        """Return a coefficient: 0, or large enough that a float32 holds the mean free path."""
        if DECIMAL.fullmatch(word) and float(word) == 0:
            return 0.0
        return self.decimal(name, word, COEFFICIENTS, or_else="0 or ")


def read_run(lines: Lines, outputs: set[str]) -> Run:
    """Return the run of the next lines; `outputs` are the output files of those before it."""
    output, form = _output(lines, outputs, *lines.take(1, OUTPUT, optional=1))
    photons = _alone(lines, lines.whole, "the number of photons", MAX_PHOTONS)
    words = lines.take(2, "dz and dr")
    dz, dr = (lines.decimal(f"{name} in cm", word, LENGTHS) for name, word in zip(("dz", "dr"), words, strict=True))
    words = lines.take(3, "nz, nr and na")
    nz, nr, na = _bins(lines, dict(zip(("nz", "nr", "na"), words, strict=True)))
    number = _alone(lines, lines.whole, "the number of layers", MAX_LAYERS)
    n_above = _alone(lines, lines.decimal, "n above the layers", INDICES)
    layers = []
    for at in range(1, number + 1):
        of = f"of layer {at} of {number}"
        *words, thickness = lines.take(5, f"n, mu_a, mu_s, g and thickness {of}")
        optics, got = _optics(lines, of, *words), f"{quoted(words[1])} and {quoted(words[2])}"
        layers.append(_settled(lines, of, optics, thickness, at == number, got))
    medium = Medium(tuple(layers), n_above, _alone(lines, lines.decimal, "n below the layers", INDICES))
    return Run(output, form, photons, dz, dr, nz, nr, na, medium)


def _bins(lines: Lines, words: dict[str, str], decimal: bool = False) -> tuple[int, int, int]:
    of = {name: lines.whole(f"{name}, a number of bins", word, MAX_BINS, 1, decimal) for name, word in words.items()}
    for other in ("nz", "na"):
        if (cells := of["nr"] * of[other]) > MAX_CELLS:
            raise lines.error(f"nr {other}, the cells of a table, to be at most {MAX_CELLS}", str(cells))
    return of["nz"], of["nr"], of["na"]


class Optics(NamedTuple):
    """Optical properties of a medium of MCML 2 [-, 1/cm]."""

    n: float
    mu_a: float
    mu_s: float
    g: float


def _optics(lines: Lines, of: str, n: str, mu_a: str, mu_s: str, g: str) -> Optics:
    """Return optical properties; a mean cosine of 1 only where nothing scatters."""
    index = lines.decimal(f"n {of}", n, INDICES)
    absorbs, scatters = lines.coefficient(f"mu_a {of} in 1/cm", mu_a), lines.coefficient(f"mu_s {of} in 1/cm", mu_s)
    cosine = lines.decimal(f"g {of}", g, (-1.0, 1.0))
    if abs(cosine) == 1 and (scatters > 0 or cosine < 0):
        raise lines.error(f"g {of} between -1 and 1, or 1 where nothing scatters", quoted(g))
    return Optics(index, absorbs, scatters, cosine)


def _settled(lines: Lines, of: str, optics: Optics, word: str, is_last: bool, got: str) -> Layer:
    """Return a layer of a thickness, infinite only where it is the last and not clear; `got` its mu_a and mu_s."""
    if not (is_last and INFINITE.fullmatch(word)):
        return Layer(*optics, thickness=lines.decimal(f"thickness {of} in cm", word, LENGTHS))
    if optics.mu_a == optics.mu_s == 0:
        raise lines.error(f"mu_a or mu_s {of} above 0 where it has no end", got)
    return Layer(*optics)


def read_media(lines: Lines) -> dict[str, Optics]:
    """Return the media that the next lines of a file of MCML 2 define, up to `end`."""
    media: dict[str, Optics] = {}
    while True:
        name, *words = lines.take(1, "a medium, its n, mu_a, mu_s and g, or end", optional=4)
        if name == "end":
            return media
        if len(words) < 4 or len(media) == MOST_MEDIA:
            raise lines.error(f"a medium's name, n, mu_a, mu_s and g, {MOST_MEDIA} media at most", quoted(name))
        if name in media:
            raise lines.error("each medium once", f"{quoted(name)} again")
        if len(name) > MAX_NAME:
            raise lines.error(f"a medium's name of at most {MAX_NAME} characters", quoted(name))
        media[name] = _optics(lines, f"of {quoted(name)}", *words[:4])


def _runs_of_2(lines: Lines, media: dict[str, Optics]) -> Iterator[Run]:
    outputs: set[str] = set()
    while True:
        name, *form = lines.take(1, f"{OUTPUT}, or end", optional=1)
        if name == "end":
            if not outputs:
                raise lines.error(OUTPUT, "'end'")
            return
        if len(outputs) == MAX_RUNS:
            raise lines.error("end", f"more than {MAX_RUNS} runs")
        yield read_run_2(lines, media, *_output(lines, outputs, name, *form), scored=())


def read_run_2(lines: Lines, media: dict[str, Optics], output: str, form: str, scored: tuple[str, ...]) -> Run:
    """Return the run of a file of MCML 2 whose layers come next.

    scored  quantities that an output file must have; () of an input file, whose quantities must be of `SCORED`
    """
    medium = _medium_of_2(lines, media)
    (source,) = lines.take(1, "the source, pencil")
    if source != PENCIL:
        raise lines.error("a pencil beam, pencil", quoted(source))
    depth, *_ = lines.take(1, "the depth that light starts from", optional=1)
    if lines.decimal("the depth that light starts from, 0", depth, (0.0, LARGEST)) != 0:
        raise lines.error("light that starts at the surface, 0", quoted(depth))
    words = lines.take(3, "dz, dr and dt")
    dz, dr = (lines.decimal(f"{name} in cm", word, LENGTHS) for name, word in zip(("dz", "dr"), words[:2], strict=True))
    lines.decimal("dt in ps", words[2], PICOSECONDS)
    words = lines.take(4, "nz, nr, nt and na")
    lines.whole("nt, a number of bins", words[2], MAX_BINS, decimal=True)
    nz, nr, na = _bins(lines, {"nz": words[0], "nr": words[1], "na": words[3]}, decimal=True)
    _require_scored(lines, scored)
    word, *rest = lines.take(1, "the number of photons", optional=1)
    photons = lines.whole("the number of photons", word, MAX_PHOTONS, decimal=True)
    _alone(lines, lines.decimal, "the threshold weight", (0.0, 1.0))
    seed = _alone(lines, lines.whole, "the seed", MOST_SEED, 0)
    return Run(output, form, photons, dz, dr, nz, nr, na, medium, seed, rest[0] if rest else "")


def _require_scored(lines: Lines, needed: tuple[str, ...]) -> None:
    words = lines.take(1, "what is scored", optional=20)
    while words[-1] == "\\":
        words[-1:] = lines.take(1, "what is scored", optional=20)
    names = {word.upper() for word in words}
    for name in needed:
        if name.upper() not in names:
            raise lines.error(f"{name} among what was scored", quoted(" ".join(words)))
    known = {name.upper() for name in SCORED}
    for word in () if needed else words:
        if word.upper() not in known:
            raise lines.error(f"quantities of {', '.join(SCORED)}, none resolved in time", quoted(word))


def _medium_of_2(lines: Lines, media: dict[str, Optics]) -> Medium:
    rows: list[tuple[Optics, str]] = []
    while True:
        name, *thickness = lines.take(1, "a layer's medium and thickness, or end", optional=1)
        if name == "end":
            break
        if name not in media or len(rows) == MAX_LAYERS + 2:
            raise lines.error(f"one of the media {', '.join(media)[:MAX_NAME]}", quoted(name))
        rows.append((media[name], thickness[0] if thickness else ""))
    if len(rows) < 3 or not all(word for _, word in rows[1:-1]):
        raise lines.error("a medium above, layers with their thickness, and a medium below", f"{len(rows)} lines")
    last = len(rows) - 2
    layers = tuple(
        _settled(lines, f"of layer {at} of {last}", optics, word, at == last, "0 and 0")
        for at, (optics, word) in enumerate(rows[1:-1], start=1)
    )
    return Medium(layers, rows[0][0].n, rows[-1][0].n)


def _output(lines: Lines, outputs: set[str], name: str, *form: str) -> tuple[str, str]:
    """Return name and format. As in V1, no format is A, and of a longer word such as ASCII the first letter counts."""
    if len(name) > MAX_NAME or not name.isprintable():
        raise lines.error(f"the name of an output file, at most {MAX_NAME} printable characters", quoted(name))
    if form and not FORMAT.fullmatch(form[0]):
        raise lines.error("A or B after the name (a name holds no spaces)", quoted(form[0]))
    same = posixpath.normpath(name)
    if same in outputs:
        raise lines.error("an output file that no other run has", quoted(name))
    outputs.add(same)
    return name, "B" if form and form[0][0] in "bB" else "A"


def _alone(lines: Lines, read: Callable[..., V], name: str, *bounds: object) -> V:
    """Read the only value of the next line, a whole or a decimal number within bounds."""
    (word,) = lines.take(1, name)
    return read(name, word, *bounds)


def _is_number(word: str) -> bool:
    return bool(DECIMAL.fullmatch(word) or INFINITE.fullmatch(word))


def quoted(word: str) -> str:
    """Return a word for a message, shortened."""
    return repr(word if len(word) <= LONGEST_SHOWN else f"{word[: LONGEST_SHOWN - 3]}...")

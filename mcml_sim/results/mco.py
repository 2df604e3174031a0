"""Output files of MCML: written as MCML 1.2.2 does, and read back as far as a reflectance profile needs.

Files of MCML 2 (Wang and Jacques) are read, too: the version mcmloA2.0, then the input file with one run (`mci`), RAT
(specular reflectance first), and a section for each quantity that was scored. Lengths in cm.
"""

from __future__ import annotations

import math
import os
import reprlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mcml_sim.errors import InputError
from mcml_sim.files.version import __version__
from mcml_sim.files.whole_file import checked_path, read_whole, write_whole
from mcml_sim.media.arrays import Floats
from mcml_sim.results.mci import DECIMAL, OUTPUT, VERSION_2, Lines, Run, quoted, read_media, read_run, read_run_2
from mcml_sim.results.tally import Tally

Name = str | os.PathLike[str]

OUTPUT_2 = "mcmloA2.0"  # version of MCML 2's output files
ENDLESS = 1e8  # the thickness that V1's users write for infinite [cm]
EVEN = 1e-9  # relative error of edges that are even but for rounding
NUMBERS_A_LINE = 5

HEAD = (
    "A1 \t# Version number of the file format.\n\n"
    "####\n"
    "# Data categories include: \n"
    "# InParm, RAT, \n"
    "# A_l, A_z, Rd_r, Rd_a, Tt_r, Tt_a, \n"
    "# A_rz, Rd_ra, Tt_ra \n"
    "####\n\n"
)


def write_mco(tally: Tally | Name, path: Name | Tally) -> None:
    """Write what `simulate` found as a V1 .mco file, whole or not at all. Lengths of the tally must be in cm.

    The grid must have even rings and depths, as an .mco has; where it does not resolve angles, there is one bin of
    them. An infinite thickness becomes 1E+08 cm. Two arguments in the other order are taken as well. InputError on
    anything else; OutputError if the file cannot be written.
    """
    given, name = (path, tally) if isinstance(path, Tally) else (tally, path)
    if not isinstance(given, Tally):
        raise InputError(f"tally must be what simulate gave, got {reprlib.repr(given)}")
    file = checked_path(name)
    write_whole(file, mco_text(given, file.name))


def mco_text(tally: Tally, name: str) -> str:
    """Return the text that `write_mco` writes into a file of that name."""
    if tally.illumination != "searchlight":
        raise InputError(f"an .mco is of a searchlight, got a tally of {tally.illumination} light")
    for number, layer in enumerate(tally.medium.layers, start=1):
        if layer.phase is not None:
            raise InputError(f"an .mco has g alone for a phase function, got {layer.phase!r} in layer {number}")
    return "".join(_sections(tally, name))


def made_by(seed: int) -> str:
    """Return the line of an .mco in the place of V1's report of its time, which would make equal runs differ."""
    return f"# Made by mcml-sim {__version__}, seed {seed}.\n"


def _sections(tally: Tally, name: str) -> Iterator[str]:
    grid, da = tally.grid, math.pi / 2 / max(tally.grid.angles, 1)
    if grid.z_edges is None:
        raise InputError(f"grid must resolve depths for an .mco, give it dz and nz, got {grid!r}")
    dz, dr = _even_width("depths", grid.z_edges), _even_width("rings", grid.r_edges)
    angles = (np.arange(max(grid.angles, 1)) + 0.5) * da
    areas = 2 * math.pi * (np.arange(grid.rings) + 0.5) * dr**2  # [cm^2]
    # Solid angles as V1 has them, width times middle; and exact ones times the cosine of their middles [sr].
    solid_angles = 2 * math.pi * np.sin(angles) * da
    exits = areas[:, None] * (2 * math.pi * np.sin(2 * angles) * math.sin(da / 2))
    specular = float(tally.specular_reflectance)
    share = (1 - specular) / tally.deposits.started
    reflected = share * _folded(tally.deposits.reflected, 0)
    transmitted = share * _folded(tally.deposits.transmitted, 0)
    transmitted[0, 0] += share * float(tally.deposits.ballistic)
    absorbed = share * _folded(_folded(tally.deposits.absorbed_rz, 0), 1)
    layers = share * tally.deposits.absorbed
    yield HEAD
    yield f"{made_by(tally.seed)}\n"
    yield _parameters(tally, dz, dr, name)
    yield (
        "RAT #Reflectance, absorption, transmission. \n"
        f"{specular:<14.6G} \t#Specular reflectance [-]\n"
        f"{reflected.sum():<14.6G} \t#Diffuse reflectance [-]\n"
        f"{layers[-1]:<14.6G} \t#Absorbed fraction [-]\n"
        f"{transmitted.sum():<14.6G} \t#Transmittance [-]\n\n"
    )
    yield _column("A_l #Absorption as a function of layer. [-]", layers[:-1], "%12.4G\n")
    yield _column("A_z #A[0], [1],..A[nz-1]. [1/cm]", share * _folded(tally.deposits.absorbed_z, 0) / dz)
    yield _column("Rd_r #Rd[0], [1],..Rd[nr-1]. [1/cm2]", reflected.sum(axis=1) / areas)
    yield _column("Rd_a #Rd[0], [1],..Rd[na-1]. [sr-1]", reflected.sum(axis=0) / solid_angles)
    yield _column("Tt_r #Tt[0], [1],..Tt[nr-1]. [1/cm2]", transmitted.sum(axis=1) / areas)
    yield _column("Tt_a #Tt[0], [1],..Tt[na-1]. [sr-1]", transmitted.sum(axis=0) / solid_angles)
    yield _table("A_rz", "A[r][z]. [1/cm3]", "nz", absorbed / (areas[:, None] * dz))
    yield _table("Rd_ra", "Rd[r][angle]. [1/(cm2sr)].", "na", reflected / exits)
    yield _table("Tt_ra", "Tt[r][angle]. [1/(cm2sr)].", "na", transmitted / exits)


def _parameters(tally: Tally, dz: float, dr: float, name: str) -> str:
    layers = ""
    for at, layer in enumerate(tally.medium.layers, start=1):
        thickness = ENDLESS if math.isinf(layer.thickness) else layer.thickness
        layers += "\t".join(map(_number, (layer.n, layer.mu_a, layer.mu_s, layer.g, thickness))) + f"\t# layer {at}\n"
    word = "".join(letter if letter.isprintable() and letter not in " #" else "_" for letter in name)
    return (
        "InParm \t\t\t# Input parameters. cm is used.\n"
        f"{word} \tA\t\t# output file name, ASCII.\n"
        f"{tally.photons} \t\t\t# No. of photons\n"
        f"{_number(dz)}\t{_number(dr)}\t\t# dz, dr [cm]\n"
        f"{tally.grid.depths}\t{tally.grid.rings}\t{max(tally.grid.angles, 1)}\t# No. of dz, dr, da.\n\n"
        f"{len(tally.medium.layers)}\t\t\t\t\t# Number of layers\n"
        "#n\tmua\tmus\tg\td\t# One line for each layer\n"
        f"{_number(tally.medium.n_above)}\t\t\t\t\t# n for medium above\n"
        f"{layers}"
        f"{_number(tally.medium.n_below)}\t\t\t\t\t# n for medium below\n\n"
    )


def _column(title: str, values: Floats, form: str = "%12.4E\n") -> str:
    return f"{title}\n{form * len(values) % tuple(values.tolist())}\n"


def _table(key: str, title: str, last: str, values: Floats) -> str:
    what = title.partition("[")[0]
    lines = (
        f"# {title}",
        f"# {what}[0][0], [0][1],..[0][{last}-1]",
        f"# {what}[1][0], [1][1],..[1][{last}-1]",
        "# ...",
        f"# {what}[nr-1][0], [nr-1][1],..[nr-1][{last}-1]",
        key,
    )
    rows, rest = divmod(values.size, NUMBERS_A_LINE)
    form = ("%12.4E " * NUMBERS_A_LINE + "\n") * rows + "%12.4E " * rest
    return "\n".join(lines) + "\n" + form % tuple(values.ravel().tolist()) + "\n"


def _folded(weights: Floats, axis: int) -> Floats:
    """Return bins along an axis, the last of which, an overflow, is added to the one before it."""
    last = weights.shape[axis] - 1
    folded = np.delete(weights, last, axis)
    index = [slice(None)] * weights.ndim
    index[axis] = slice(last - 1, last)
    folded[tuple(index)] += np.take(weights, [last], axis)
    return folded


def _even_width(name: str, edges: Floats) -> float:
    """Return the width of the bins; InputError if they differ by more than rounding."""
    width = float(edges[1])
    widths = np.diff(edges)
    if not np.allclose(edges, width * np.arange(len(edges)), rtol=EVEN, atol=0):
        got = f"widths from {widths.min():g} to {widths.max():g}"
        raise InputError(f"grid must have {name} of equal width for an .mco, got {got}")
    return width


def _number(value: float) -> str:
    """Return a number as V1 prints it, six digits, unless it has more."""
    short = f"{value:.6G}"
    return short if float(short) == value else repr(float(value))


MAX_BYTES = 2**27  # tables of 2^21 cells take 30 MB each
HEAD_BYTES = 2**16  # hold what comes before the parameters
LARGEST = 1e30  # of a printed number


@dataclass(frozen=True, eq=False)
class Output:
    """Content of an .mco: its run, and the light that it reflected. Lengths in cm.

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
    """Read parameters, totals and Rd_r of an .mco of V1 or 2; InputError, `FILE:LINE: expected ..., got ...`."""
    return parse_mco(read_whole(path, MAX_BYTES), str(path))


def parse_mco(content: bytes, name: str) -> Output:
    """Return what `read_mco` gives for a file of this name and content."""
    if len(content) > MAX_BYTES:
        raise InputError(f"{name}: expected an .mco file of at most {MAX_BYTES} bytes, got a longer one")
    lines = Lines(name, content.replace(b"\x00", b"\xff"))
    if _beginning(lines) == OUTPUT_2:
        return _parse_2(lines)
    run = read_run(lines, set())
    sizes = {"RAT": 4, "A_l": len(run.medium.layers), "A_z": run.nz, "Rd_r": run.nr}
    columns = {key: _read_column(lines, key, size) for key, size in sizes.items()}
    specular, diffuse, *_ = columns["RAT"]
    return Output(run, specular, diffuse, np.array(columns["Rd_r"]))


def _parse_2(lines: Lines) -> Output:
    """Read what follows the version of a file of MCML 2; InputError names the line if it has no Rd_r."""
    (word,) = lines.take(1, "the input's version, mcmli2.0")
    if not word.startswith(VERSION_2):
        raise lines.error("the input's version, mcmli2.0", quoted(word))
    media = read_media(lines)
    output, *form = lines.take(1, OUTPUT, optional=1)
    run = read_run_2(lines, media, output, form[0] if form else "A", scored=("Rd_r",))
    lines.find("RAT")
    specular, _, diffuse, *_ = (_first(lines, f"number {at} of 6 of RAT") for at in range(1, 7))
    lines.find("Rd_r")
    column = [_first(lines, f"number {at} of {run.nr} of Rd_r") for at in range(1, run.nr + 1)]
    return Output(run, specular, diffuse, np.array(column))


def _first(lines: Lines, what: str) -> float:
    """Return the first number of a line, whatever follows."""
    word, *_ = lines.take(1, what, optional=9)
    return lines.decimal(what, word, (0.0, LARGEST))


def begins_mco(path: str | os.PathLike[str]) -> bool:
    """Return whether a file begins as an .mco of V1 does, down to its parameters."""
    try:
        return _beginning(Lines(str(path), read_whole(path, HEAD_BYTES))) == "A1"
    except InputError:
        return False


def _beginning(lines: Lines) -> str:
    (version,) = lines.take(1, "the file version, A1")
    if version not in ("A1", OUTPUT_2):
        raise lines.error(f"the file version, A1 or {OUTPUT_2}", repr(version[:10]))
    if version == "A1":
        _keyword(lines, "InParm")
    return version


def _keyword(lines: Lines, key: str) -> None:
    (word,) = lines.take(1, f"the section {key}")
    if word != key:
        raise lines.error(f"the section {key}", repr(word[:20]))


def _read_column(lines: Lines, key: str, size: int) -> list[float]:
    _keyword(lines, key)
    numbers = []
    for at in range(size):
        what = f"number {at + 1} of {size} of {key}"
        (word,) = lines.take(1, what)
        if not DECIMAL.fullmatch(word):
            raise lines.error(what, repr(word[:20]))
        numbers.append(lines.decimal(what, word, (0.0, LARGEST)))
    return numbers

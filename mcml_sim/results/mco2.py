"""Output files of MCML 2 (Wang and Jacques), read as far as a profile needs. Lengths in cm.

mcmloA2.0                        version, then the input file with one run (`mci`)
...
RAT                              the specular reflectance first, then a section for each that was scored
"""

from __future__ import annotations

import numpy as np

from mcml_sim.results.mci import LARGEST, OUTPUT, VERSION_2, Lines, Run, read_media, read_run_2, shown

VERSION = "mcmloA2.0"


def parse(lines: Lines) -> tuple[Run, float, float, np.ndarray]:
    """What follows the version, in the order of `mco.Output`.

    InputError names the line of what is not such a file, or has no Rd_r.
    """
    (word,) = lines.take(1, "the input's version, mcmli2.0")
    if not word.startswith(VERSION_2):
        raise lines.error("the input's version, mcmli2.0", shown(word))
    media = read_media(lines)
    output, *form = lines.take(1, OUTPUT, optional=1)
    run = read_run_2(lines, media, output, form[0] if form else "A", scored=("Rd_r",))
    lines.find("RAT")
    specular, _, diffuse, *_ = (_first(lines, f"number {at} of 6 of RAT") for at in range(1, 7))
    lines.find("Rd_r")
    column = [_first(lines, f"number {at} of {run.nr} of Rd_r") for at in range(1, run.nr + 1)]
    return run, specular, diffuse, np.array(column)


def _first(lines: Lines, what: str) -> float:
    """The first number of a line, whatever follows."""
    word, *_ = lines.take(1, what, optional=9)
    return lines.decimal(what, word, (0.0, LARGEST))

"""Output files of MCML 2 (Wang and Jacques), read as far as a profile needs. Lengths in cm.

mcmloA2.0                        version, then the run as in the input file:
mcmli2.0
skin  1.37 1 100 0.9             media by name: n mu_a mu_s g, down to the line end
end
NAME.mco A
air                              layers from the top: a medium above, each with its thickness, a medium below
skin 0.1
air
end
pencil                           light, and the depth that it starts from
0
0.01 0.01 0.1                    dz dr dt
40 50 100 1                      nz nr nt na
Rd_r A_rz                        what was scored
1000000 1:54                     photons, and time
...
RAT                              the specular reflectance first, then a section for each that was scored
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mcml_sim.media.checks import MAX_PHOTONS
from mcml_sim.media.grid import MAX_BINS
from mcml_sim.media.medium import MAX_LAYERS, Layer, Medium
from mcml_sim.results.mci import INDICES, INFINITE, LENGTHS, Lines, Run, require_g, shown

VERSION = "mcmloA2.0"
LARGEST = 1e30  # of a printed number
MOST_MEDIA = 1000


class Optics(NamedTuple):
    """Of a medium [-, 1/cm]."""

    n: float
    mu_a: float
    mu_s: float
    g: float


def parse(lines: Lines) -> tuple[Run, float, float, np.ndarray]:
    """What follows the version, in the order of `mco.Output`.

    InputError names the line of what is not such a file, or has no Rd_r.
    """
    (word,) = lines.take(1, "the input's version, mcmli2.0")
    if not word.startswith("mcmli2."):
        raise lines.error("the input's version, mcmli2.0", shown(word))
    run = _run(lines, _media(lines))
    lines.find("RAT")
    specular, _, diffuse, *_ = (_first(lines, f"number {at} of 6 of RAT") for at in range(1, 7))
    lines.find("Rd_r")
    column = [_first(lines, f"number {at} of {run.nr} of Rd_r") for at in range(1, run.nr + 1)]
    return run, specular, diffuse, np.array(column)


def _media(lines: Lines) -> dict[str, Optics]:
    found: dict[str, Optics] = {}
    while True:
        name, *words = lines.take(1, "a medium, its n, mu_a, mu_s and g, or end", optional=4)
        if name == "end":
            return found
        if len(words) < 4 or len(found) == MOST_MEDIA:
            raise lines.error(f"a medium's name, n, mu_a, mu_s and g, {MOST_MEDIA} media at most", shown(name))
        of = f"of {shown(name)}"
        mu_s = lines.coefficient(f"mu_s {of} in 1/cm", words[2])
        n, g = lines.decimal(f"n {of}", words[0], INDICES), require_g(lines, of, words[3], mu_s)
        found[name] = Optics(n, lines.coefficient(f"mu_a {of} in 1/cm", words[1]), mu_s, g)


def _run(lines: Lines, media: dict[str, Optics]) -> Run:
    output, *letter = lines.take(1, "the name of an output file", optional=1)
    medium = _medium(lines, media)
    (light,) = lines.take(1, "the light, pencil")
    if light != "pencil":
        raise lines.error("a pencil beam, pencil", shown(light))
    depth, *_ = lines.take(1, "the depth that light starts from", optional=1)
    if lines.decimal("the depth that light starts from, 0", depth, (0.0, LARGEST)) != 0:
        raise lines.error("light that starts at the surface, 0", shown(depth))
    words = lines.take(3, "dz, dr and dt")
    dz, dr = (lines.decimal(f"{name} in cm", word, LENGTHS) for name, word in zip(("dz", "dr"), words[:2], strict=True))
    words = lines.take(4, "nz, nr, nt and na")
    bins = {"nz": words[0], "nr": words[1], "na": words[3]}
    nz, nr, na = (lines.whole(f"{name}, a number of bins", word, MAX_BINS) for name, word in bins.items())
    scored = lines.take(1, "what was scored, Rd_r among it", optional=20)
    if "Rd_r" not in scored:
        raise lines.error("Rd_r among what was scored", shown(" ".join(scored)))
    word, *_ = lines.take(1, "the number of photons", optional=1)
    photons = lines.whole("the number of photons", word, MAX_PHOTONS)
    return Run(output, letter[0] if letter else "A", photons, dz, dr, nz, nr, na, medium)


def _medium(lines: Lines, media: dict[str, Optics]) -> Medium:
    found: list[tuple[Optics, str]] = []
    while True:
        name, *thickness = lines.take(1, "a layer's medium and thickness, or end", optional=1)
        if name == "end":
            break
        if name not in media or len(found) == MAX_LAYERS + 2:
            raise lines.error(f"one of the media {', '.join(list(media)[:8])}", shown(name))
        found.append((media[name], thickness[0] if thickness else ""))
    if len(found) < 3 or not all(word for _, word in found[1:-1]):
        raise lines.error("a medium above, layers with their thickness, and a medium below", f"{len(found)} lines")
    layers: list[Layer] = []
    for optics, word in found[1:-1]:
        endless = INFINITE.fullmatch(word) and len(layers) == len(found) - 3
        thick = float("inf") if endless else lines.decimal("a thickness in cm", word, LENGTHS)
        layers.append(Layer(*optics, thickness=thick))
    return Medium(tuple(layers), found[0][0].n, found[-1][0].n)


def _first(lines: Lines, what: str) -> float:
    """The first number of a line, whatever follows."""
    word, *_ = lines.take(1, what, optional=9)
    return lines.decimal(what, word, (0.0, LARGEST))

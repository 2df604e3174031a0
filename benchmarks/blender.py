"""Colour and length that Blender Cycles' subsurface methods render of a flat, semi-infinite medium.

    python3.13 -m venv bpy && bpy/bin/pip install bpy==5.3.0     # bpy 4.2 to 5.0: Python 3.11
    python -m benchmarks.blender --python bpy/bin/python         # two minutes on two cores; --quick: one

PROFILEFIT_BPY_PYTHON may name the interpreters instead, with the path separator between them. Each method of the node
Subsurface Scattering is rendered by an orthographic camera that looks down: under uniform light for the total
reflectance A, and under a vertical sun behind a straight edge for the length. Lengths are fitted to exact edges with
the albedo and the entry that the source of Cycles states; those of a pencil beam and of diffuse light stand beside. The
length of Christensen-Burley is the d of normalized diffusion, which Cycles cuts at 16 d: the fit finds 1 % less. Errors
are standard errors over independent seeds.

A walk starts in the direction of the eye, refracted by a rough surface (see `entering.refracted`), returns to an
index-matched one and leaves like a white Lambertian surface. So by reciprocity A is the reflectance for light that
enters in these directions, while maps from the colour to the albedo hold for diffuse light. Paths end at 255
scatterings: A has that by the source, the exact edges do not, so that lengths at colour 0.8 are found 1 % short.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares

import profilefit
from benchmarks import entering
from benchmarks.entering import Entry
from benchmarks.table import show
from mcml_sim import Setting
from mcml_sim.files.whole_file import as_json, write_whole
from profilefit import convert
from profilefit.convert.colour import wrenninge_alpha
from profilefit.convert.engine import skin_alpha
from profilefit.scenes.stage.reference.step_edge import step_response

Floats = NDArray[np.float64]
Edge = Callable[[Floats], Floats]  # share of its light that a point gathers from beyond the edge, by its distance

VARIABLE = "PROFILEFIT_BPY_PYTHON"
SCRIPT = Path(__file__).with_name("blender_render.py")
MARK = "profilefit: "
METHODS = ("BURLEY", "RANDOM_WALK", "RANDOM_WALK_LEGACY", "RANDOM_WALK_SKIN")
COLOURS = (0.2, 0.5, 0.8)
ILLUMINATIONS = ("searchlight", "diffuse")
MOST = 255  # scatterings: BSSRDF_MAX_BOUNCES - 1 of src/kernel/types.h
SHRINK = 0.25 / np.pi
# The first release whose random walk takes its radius for a mean free path, and van de Hulst's map: blender/cycles
# e5f416414 and 695bae346.
UNSCALED = (5, 2)
PIXELS, WHITE_PIXELS = 240, 32
REACH = 8.0  # half of the width of a picture, over the length that the source has


@dataclass(frozen=True)
class Surface:
    """Inputs of the node, and the entry of each method but BURLEY."""

    ior: float = 1.4
    roughness: float = 1.0

    @property
    def inputs(self) -> dict[str, float]:
        """Inputs as the node names them."""
        return {"IOR": self.ior, "Roughness": self.roughness, "Anisotropy": 0.0}

    def entry(self, method: str) -> Entry:
        """Return the directions in which a method's walk starts."""
        if method == "RANDOM_WALK_SKIN":
            return entering.refracted(self.ior, 1.0) + entering.cosine_weighted()
        return entering.refracted(self.ior, self.roughness)


@dataclass(frozen=True)
class Row:
    """Method at one colour: pairs are a value and its standard error, lengths are over the typed radius.

    reflectance  A under uniform light [-]; reflectance_source what it should be by the source
    length       fitted with the entry of the source; length_source what it should be; pencil, diffuse: with other edges
    misfit       root mean square difference of the edge from the fit, over A, and the part of it that is noise
    printed      length over radius that `profilefit convert` prints
    """

    method: str
    colour: float
    reflectance: tuple[float, float]
    reflectance_source: float
    length: tuple[float, float]
    length_source: float
    pencil: float | None
    diffuse: float | None
    misfit: tuple[float, float]
    printed: float


def published(name: str) -> Callable[[float], float]:
    """Return a map from the colour to the albedo by its printed constants."""
    law = profilefit.albedo_law(name, "published", Setting("diffuse"))
    return lambda colour: float(law.alpha(colour))


MAPS: dict[str, Callable[[float], float]] = {
    "van de Hulst": published("van_de_hulst"),
    "Wrenninge": wrenninge_alpha,
    "Chiang": published("chiang"),
}


DISTANCES = np.geomspace(entering.NEAREST, entering.FARTHEST, 100)


def edge_of(table: CubicSpline) -> Edge:
    """Return an edge by its table over ln distance."""

    def dark(distance: Floats) -> Floats:
        inside = np.clip(distance, entering.NEAREST, entering.FARTHEST)
        values = np.where(distance < entering.NEAREST, 0.5, table(np.log(inside)))
        return np.where(distance > entering.FARTHEST, 0.0, values)

    return dark


@lru_cache(maxsize=64)
def exact_edge(alpha: float, illumination: str) -> Edge:
    """Return the exact edge under one of the two illuminations of a Setting, over distance in mfp."""
    return edge_of(CubicSpline(np.log(DISTANCES), step_response(-DISTANCES, alpha, setting=Setting(illumination))))


@lru_cache(maxsize=64)
def entered_edge(alpha: float, method: str, surface: Surface) -> Edge:
    """Return the exact edge of a method's entry, over distance in mfp."""
    return edge_of(entering.dark_edge(alpha, surface.entry(method)))


@lru_cache(maxsize=1)
def burley_edge() -> Edge:
    """Return the edge of normalized diffusion, over distance in d."""
    law = profilefit.load("burley", "published:diffuse", Setting("diffuse"))
    mfp = 1.0 / convert.Optical(0.5, 1.0).length("falloff_diffuse")
    return edge_of(CubicSpline(np.log(DISTANCES), step_response(-DISTANCES, 0.5, mfp, law=law)))


def fitted(picture: Floats, half_width: float, edge: Edge) -> tuple[float, float, Floats]:
    """Return A, the length and the residuals over A of one channel (pixels,) that is dark to the left of its middle."""
    nodes, weights = entering.unit_nodes(4)
    width = 2.0 * half_width / picture.size
    x = -half_width + width * (np.arange(picture.size)[:, None] + nodes)

    def model(parameters: Floats) -> Floats:
        dark = edge(np.abs(x) / np.exp(parameters[1]))
        return parameters[0] * np.where(x > 0, 1.0 - dark, dark) @ weights

    begin = np.array([float(np.mean(picture + picture[::-1])), 0.0])
    solution = least_squares(lambda parameters: model(parameters) - picture, begin, x_scale=(0.01, 0.01))
    a, log_length = solution.x
    return float(a), float(np.exp(log_length)), -solution.fun / float(a)


@dataclass(frozen=True)
class Blender:
    """Python with bpy.

    Attributes:
        python: path of the interpreter.
        version: as Blender prints it.
        surface: inputs of the node.
        samples: samples a pixel.
        seeds: number of independent pictures.
        threads: number of threads that render.
    """

    python: str
    version: str
    surface: Surface
    samples: int
    seeds: int
    threads: int

    @property
    def release(self) -> tuple[int, ...]:
        """Version as numbers."""
        return tuple(int(part) for part in self.version.split()[0].split("."))

    def request(self, method: str, edge: bool, seed: int) -> dict[str, Any]:
        """Return the request of a picture whose lengths are 1 by the source: of an edge, or of uniform light."""
        pixels = PIXELS if edge else WHITE_PIXELS
        return {
            "method": method,
            "colour": COLOURS,
            "radius": [1.0 / self.length(method, colour) for colour in COLOURS],
            "inputs": self.surface.inputs,
            "edge": edge,
            "half_width": REACH,
            "pixels": pixels,
            "samples": self.samples * PIXELS // pixels,
            "seed": seed,
            "threads": self.threads,
        }

    def length(self, method: str, colour: float) -> float:
        """Return the length over the typed radius that the source has: l of a walk, d of BURLEY."""
        if method == "RANDOM_WALK_SKIN":
            return float(np.sqrt(3.0 * (1.0 - skin_alpha(colour, self.surface.ior))))
        return 1.0 if method == "RANDOM_WALK" and self.release >= UNSCALED else SHRINK

    def alpha(self, method: str, colour: float) -> float:
        """Return the albedo that the source has for a walk [-]."""
        newest = method == "RANDOM_WALK" and self.release >= UNSCALED
        return MAPS["van de Hulst" if newest else "Wrenninge"](colour)

    def printed(self, method: str, colour: float) -> float:
        """Return l, or d of BURLEY, over the radius that `profilefit convert` prints beside this colour."""
        if method == "BURLEY":
            medium = convert.Optical(convert.alpha_of(colour, "diffuse"), 1.0)
            return float(medium.length("falloff_diffuse") / medium.length("cycles_burley_radius"))
        newest = method == "RANDOM_WALK" and self.release >= UNSCALED
        name = "cycles_radius" if newest else "cycles_legacy_radius"
        if method == "RANDOM_WALK_SKIN":
            name = "cycles_skin_radius"
        return float(1.0 / convert.Optical(self.alpha(method, colour), 1.0).length(name))

    def reflectance(self, method: str, colour: float) -> float:
        """Return A by the source [-]."""
        if method == "BURLEY":
            return colour
        return entering.reflectance(self.alpha(method, colour), self.surface.entry(method), MOST)

    def edge(self, method: str, colour: float) -> Edge:
        """Return the exact edge by the source."""
        return burley_edge() if method == "BURLEY" else entered_edge(self.alpha(method, colour), method, self.surface)


def asked(python: str, requests: Sequence[dict[str, Any]]) -> list[Any]:
    """Return the output of `blender_render.py`: the version, and a reply to each request.

    Raises RuntimeError with the last line of its errors.
    """
    command = [python, "-c", SCRIPT.read_text(encoding="utf-8"), json.dumps(requests)]
    try:
        ended = subprocess.run(command, capture_output=True, text=True)
    except OSError as error:
        raise RuntimeError(error.strerror) from None
    lines = [line for line in ended.stdout.splitlines() if line.startswith(MARK)]
    if ended.returncode or len(lines) != len(requests) + 1:
        raise RuntimeError((ended.stderr.strip() or f"ended with status {ended.returncode}").splitlines()[-1])
    return [json.loads(line.removeprefix(MARK)) for line in lines]


def measured(blender: Blender, methods: Sequence[str]) -> list[Row]:
    """Return a row for each colour of those methods that this Blender has."""
    seeds = range(1, blender.seeds + 1)
    requests = [blender.request(method, edge, seed) for method in methods for edge in (True, False) for seed in seeds]
    pictures = iter(asked(blender.python, requests)[1:])
    rows = []
    for method in methods:
        edges, white = ([next(pictures) for _ in seeds] for _ in range(2))
        if edges[0] is not None:
            channels = zip(COLOURS, np.array(edges).swapaxes(0, 1), np.mean(white, axis=2).T, strict=True)
            rows += [row(blender, method, *channel) for channel in channels]
    return rows


def row(blender: Blender, method: str, colour: float, edges: Floats, white: Floats) -> Row:
    """Return the row of a method at a colour, of edges (seeds, pixels) and reflectances (seeds,)."""
    edge, scale = blender.edge(method, colour), blender.length(method, colour)
    level, length, residuals = fitted(edges.mean(axis=0), REACH, edge)
    noise = float(np.sqrt(np.mean(edges.var(axis=0, ddof=1)) / len(edges))) / level
    alone = np.array([fitted(picture, REACH, edge)[1] for picture in edges])
    other: list[float | None] = [None, None]
    if method != "BURLEY":
        alpha = blender.alpha(method, colour)
        other = [scale * fitted(edges.mean(axis=0), REACH, exact_edge(alpha, name))[1] for name in ILLUMINATIONS]
    return Row(
        method,
        colour,
        with_error(white),
        blender.reflectance(method, colour),
        (scale * length, scale * with_error(alone)[1]),
        scale,
        *other,
        (float(np.sqrt(np.mean(residuals**2))), noise),
        blender.printed(method, colour),
    )


def with_error(values: Floats) -> tuple[float, float]:
    """Return the mean over seeds and its standard error."""
    return float(values.mean()), float(values.std(ddof=1) / np.sqrt(values.size))


def report(blender: Blender, rows: Sequence[Row]) -> None:
    """Print the rows of a Blender, and A of walks with other maps and entries."""
    surface = blender.surface
    show(
        f"Blender {blender.version}, IOR {surface.ior:g}, roughness {surface.roughness:g}: total reflectance A, and "
        "length over radius (d for BURLEY, else l)",
        (
            *("method", "colour", "A", "by source", "A / colour", "length", "by source", "misfit (noise), % of A"),
            *("pencil edge", "diffuse edge", "`convert`"),
        ),
        [
            (
                *(row.method, f"{row.colour:g}", f"{row.reflectance[0]:.4f} ± {row.reflectance[1]:.4f}"),
                *(f"{row.reflectance_source:.4f}", f"{row.reflectance[0] / row.colour:.3f}"),
                *(f"{row.length[0]:.4f} ± {row.length[1]:.4f}", f"{row.length_source:.4f}"),
                f"{100 * row.misfit[0]:.2f} ({100 * row.misfit[1]:.2f})",
                *("-" if one is None else f"{one:.4f}" for one in (row.pencil, row.diffuse)),
                f"{row.printed:.4f}",
            )
            for row in rows
        ],
    )
    walks = [method for method in METHODS[1:] if any(row.method == method for row in rows)]
    if not walks:
        return
    entries = {
        "refracted": entering.refracted(surface.ior, surface.roughness),
        "half refracted, half diffuse": entering.refracted(surface.ior, 1.0) + entering.cosine_weighted(),
        "diffuse": entering.cosine_weighted(),
        "normal": entering.refracted(surface.ior, 0.0),
    }
    show(
        f"Blender {blender.version}: A by a map from colour to albedo and an entry, over A rendered, less 1 [%], at "
        f"colours {', '.join(f'{colour:g}' for colour in COLOURS)}",
        ("map, entry", *walks),
        [
            (f"{name}, {kind}", *(deviations(rows, walk, alpha_of, entry) for walk in walks))
            for name, alpha_of in MAPS.items()
            for kind, entry in entries.items()
        ],
    )


def deviations(rows: Sequence[Row], method: str, alpha_of: Callable[[float], float], entry: Entry) -> str:
    """Return the differences of a map and an entry from the rows of a method, in percent."""
    return "  ".join(
        f"{100 * (entering.reflectance(alpha_of(row.colour), entry, MOST) / row.reflectance[0] - 1):+5.1f}"
        for row in rows
        if row.method == method
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--python", nargs="+", metavar="PATH", help=f"Python with bpy; default: ${VARIABLE}")
    parser.add_argument("--only", nargs="+", choices=METHODS, default=METHODS, help="methods")
    parser.add_argument("--ior", type=float, default=1.4)
    parser.add_argument("--roughness", type=float, default=1.0)
    parser.add_argument("--samples", type=int, default=256, help="a pixel and seed; default: %(default)s")
    parser.add_argument("--seeds", type=int, default=8, help="independent pictures; default: %(default)s")
    parser.add_argument("--threads", type=int, default=2, help="that render; default: %(default)s")
    parser.add_argument("--quick", action="store_true", help="an eighth of the samples")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers there too")
    given = parser.parse_args(arguments)
    accepted = (
        ("samples", 16, 2**20),
        ("seeds", 2, 1000),
        ("threads", 1, 1024),
        ("ior", 1.01, 3.8),
        ("roughness", 0, 1),
    )
    for name, low, high in accepted:
        if not low <= getattr(given, name) <= high:
            parser.error(f"--{name} must be from {low} to {high}, got {getattr(given, name)}")
    pythons = given.python or [path for path in os.environ.get(VARIABLE, "").split(os.pathsep) if path]
    if not pythons and find_spec("bpy") is not None:
        pythons = [sys.executable]
    if not pythons:
        print(f"skipped: no Python with Blender's package bpy; name one with --python or {VARIABLE}")
        return
    samples = max(given.samples // 8, 16) if given.quick else given.samples
    blenders = []
    for python in pythons:
        try:
            version = asked(python, [])[0]
        except RuntimeError as error:
            parser.error(f"--python or {VARIABLE} must name Pythons that import bpy, got {python}: {error}")
        surface = Surface(given.ior, given.roughness)
        blenders.append(Blender(python, version, surface, samples, given.seeds, given.threads))
    numbers = {}
    for blender in blenders:
        rows = measured(blender, given.only)
        report(blender, rows)
        numbers[blender.version] = rows
    if given.json:
        write_whole(given.json, as_json(numbers))


if __name__ == "__main__":
    main()

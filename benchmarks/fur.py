"""Fur in layers: random cones in closed form against rays, and what shells and swept slabs make of them.

    python -m benchmarks.fur                             # all tables: ten minutes on one core
    python -m benchmarks.fur --only closed third         # some of them, by their names
    python -m benchmarks.fur --pictures fits/evidence    # the figures, only: a minute

Heights and errors of heights are over a strand's length, n strands a unit of area, theta from the normal; standard
errors are over patches that are drawn anew. Patches are so wide that no ray comes by a strand twice.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from benchmarks import fur_exponent as exponent
from benchmarks import fur_feet as feet
from benchmarks import fur_layers as layers
from benchmarks import fur_scene as drawn
from benchmarks.table import Listed, Rows, parser_of, show_all
from profilefit.scenes.fur import law
from profilefit.scenes.fur.truth import Patch, random_patch
from profilefit.shader import opened
from profilefit.shader.context import renderer
from profilefit.studies.tradeoff import scenes as tradeoff

DEGREES, DENSITIES, HEIGHTS = (0.0, 30.0, 60.0, 75.0, 85.0), (4.0, 16.0, 64.0), (0.0, 0.3, 0.6, 0.9)
LEANS = ((0.0, 0.0), (0.4, -0.3))
PATCHES, SIDE = 64, 8.0  # as many strands as the density says, not on average, is 0.0003 at this side
XS = (0.7, 1.0, 2.0, 4.0, 6.4)


def closed() -> Rows:
    """Return `visibility` less what rays see, worst of four heights, its standard error, and the largest ratio."""
    found: Rows = []
    for lean in LEANS:
        for density in DENSITIES:
            for degrees in DEGREES:
                theta = float(np.radians(degrees))
                share, error = feet.seen(partial(_random, density, lean), theta, HEIGHTS, PATCHES, SIDE)
                off = law.visibility(density, feet.RADIUS, 1.0, theta, np.array(HEIGHTS), lean) - share
                worst = int(np.argmax(np.abs(off)))
                # Where nothing is seen of any patch, no error is known: 1e-4 is a hundred thousand rays' last digit.
                sigmas = float(np.max(np.abs(off) / np.maximum(error, 1e-4)))
                name = "upright" if lean == (0.0, 0.0) else f"lean {lean[0]:g}, {lean[1]:g}"
                found.append((name, density, degrees, HEIGHTS[worst], float(off[worst]), float(error[worst]), sigmas))
    return found


def _random(density: float, lean: tuple[float, float], side: float, seed: int) -> Patch:
    return random_patch(density, feet.RADIUS, 1.0, side, seed, lean)


def exponents() -> Rows:
    """Return p by its law and the best of each L / r0, between whole numbers of layers; their range over p."""
    found: Rows = []
    for x in XS:
        each = [_best(x * slender, slender) for slender in exponent.SLENDER]
        p = float(law.best_exponent(x))
        found.append((x, p, *each, (max(each) - min(each)) / p, max(abs(one / p - 1.0) for one in each)))
    return found


def _best(number: float, slender: float) -> float:
    """Return the best N: between whole numbers of layers ln(p - 1) is a straight line of ln N."""
    low, high = int(np.floor(number + 1e-9)), int(np.ceil(number - 1e-9))
    ends = [np.log(exponent.best_of(n, slender) - 1.0) for n in (low, high)]
    at = np.log(number / low) / np.log(high / low) if high > low else 0.0
    return 1.0 + float(np.exp(ends[0] + at * (ends[1] - ends[0])))


def constants() -> Rows:
    """Return the constants of the exponent, fitted now, with their errors, and as they are kept."""
    found, error = exponent.fitted()
    return [
        (name, *(float(getattr(one, name)) for one in (found, error, law.FITTED, law.FITTED_ERRORS)))
        for name in law.Exponent._fields
    ]


_FURS = (
    f"{len(layers.THICK) * len(layers.SLENDER) * len(layers.ASLANT)} furs and angles: r0 sqrt(n) "
    f"{', '.join(f'{one:g}' for one in layers.THICK)}, L / r0 {', '.join(f'{one:g}' for one in layers.SLENDER)}, "
    f"theta {layers.ASLANT[0]:g} to {layers.ASLANT[-1]:g} degrees"
)
TABLES = {
    "closed": Listed(
        f"Visibility, law less rays, worst of heights {', '.join(f'{z:g}' for z in HEIGHTS)}; r0 {feet.RADIUS:g}, L 1, "
        f"{PATCHES * feet.RAYS} rays of {PATCHES} patches",
        {
            **{"strands": "", "n": "g", "theta": "g", "z": "g", "difference": "+.4f", "standard error": ".4f"},
            "most, in standard errors": ".1f",
        },
        closed,
    ),
    "third": Listed(
        "Linear shells that are as wrong as N quadratic ones, over N: by rms of heights or by the missing share of a "
        "strand's shadow;\nmean of the logarithms, its 95 % interval by furs drawn anew, 5 % and 95 % of single ones, "
        f"{_FURS}.\nAt the floor twice as many quadratic shells are better by less than {layers.FLATTENED:.0%}; those "
        f"of no factor are worse than one linear shell, or better than {layers.LINEAR[-1]}",
        {
            **{"error, truth": "", "N": "", "of": "d", "factor": ".2f", "low": ".2f", "high": ".2f", "+-": ".1%"},
            **{"5 %": ".2f", "95 %": ".2f", "at the floor": ".0%", "< 1": ".0%", "none": ".0%"},
        },
        layers.third,
    ),
    "exponent": Listed(
        "The best exponent p over x = N r0 / L, by its law and at each L / r0; range and worst over the law's p",
        {
            **{"x": "g", "law": ".3f", **{f"L / r0 = {one:g}": ".3f" for one in exponent.SLENDER}},
            **{"range": ".1%", "worst": ".1%"},
        },
        exponents,
    ),
    "constants": Listed(
        "p = 1 + size x^power",
        {"constant": "", "fitted": ".3f", "error": ".3f", "kept": ".3f", "its error": ".3f"},
        constants,
    ),
    "ways": Listed(
        f"Error of heights over N; n {layers.DENSITY:g}, r0 {layers.RADIUS:g}, L 1, {layers.PATCHES} patches",
        {"way": "", "theta": "g", **{str(n): ".4f" for n in layers.LAYERS}, "standard error at 16": ".4f"},
        layers.ways,
    ),
    "least": Listed(
        f"Least N for an error of {layers.TOLERANCE:g}, by theta; furs of the last table",
        {"way": "", **{f"{one:g}": "d" for one in layers.LEAST_AT}},
        layers.least,
    ),
    "cost": Listed(
        "Time of a layer over that of a shell, by this machine's OpenGL, and where the middle 68 % of turns lie",
        {"way": "", "cost": ".2f", "low": ".2f", "high": ".2f"},
        layers.cost,
    ),
    "swept": Listed(
        f"Swept slabs: rms = c y^a (r0 sqrt(n))^b (L tan / r0)^e, y = L tan sqrt(n) / N, where it is "
        f"{layers.WITHIN[0]:g} to {layers.WITHIN[1]:g}; what is left in logarithms; {_FURS}",
        {
            **{"of": "", "strands": "d"},
            **{name: ".3f" if one == "c" else ".2f" for one in "cabe" for name in (one, f"+- {one}")},
            **{"scatter": ".2f", "worst": ".2f", "points": "d", "y from": ".2f", "to": ".2f"},
        },
        layers.swept,
    ),
    "feet": Listed(
        "kappa where feet are not independent, what is seen being exp(-kappa n (1 - z / L)^2 A), and standard errors",
        {
            **{"feet": "", "r0 sqrt(n)": ".1f", "theta": "g", **{f"z = {z:g}": ".3f" for z in feet.HEIGHTS}},
            **{f"+- {z:g}": ".3f" for z in feet.HEIGHTS},
        },
        feet.feet,
    ),
    "feet-laws": Listed(
        "kappa over q = r0 sqrt(n) (1 - z / L), 30 degrees and more: its law, rms and worst, and head on; one constant",
        {
            **{"feet": "", "law": "", "a": ".2f", "+- a": ".2f", "b": ".2f", "+- b": ".2f"},
            **{"rms": ".1%", "worst": ".1%", "head on": ".0%", "constant": ".2f", "std": ".2f"},
        },
        feet.feet_laws,
    ),
    "lamp": Listed(
        "Light on what an eye sees, over visibility toward the lamp, and over it without the shadows' shared part",
        {
            **{"n": "g", "eye": "g", "lamp from eye": ""},
            **{"skin": ".2f", "skin, shared": ".3f", "+- skin": ".3f"},
            **{"strands": ".3f", "strands, shared": ".3f", "+- strands": ".3f"},
        },
        feet.lamps,
    ),
    "union": Listed(
        f"Discs of one strand as drawn, {drawn.RAYS} x {drawn.RAYS} rays, and their union, over the cone's shadow",
        {"shells": "", "theta": "g", "N": "d", "drawn": ".4f", "union": ".4f", "off": "+.2%"},
        drawn.unions,
    ),
    "scene": Listed(
        "examples/fur.toml, rms error over the mean of its light, by layers",
        {"way": "", **{str(n): ".3f" for n in drawn.LAYERS}},
        drawn.pictures,
    ),
    "gamma": Listed(
        "examples/fur.toml: rays encoded, then averaged, less the average encoded [8-bit steps]; 99 % are less darker",
        {"rays of a pixel": "d", "mean": "+.1f", "rms": ".1f", "99 %": ".1f"},
        drawn.gamma,
    ),
    "lobes": Listed(
        "Mean of a lobe of Kajiya and Kay's over all directions, by its exponent",
        {"exponent": "g", "as published": ".3f", "normalised": ".6f"},
        drawn.lobes,
    ),
}


def main(arguments: list[str] | None = None) -> None:
    parser = parser_of(__doc__, TABLES)
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="the figure of its cost, only")
    given = parser.parse_args(arguments)
    if given.pictures is not None:
        with opened() as context:
            panels = [tradeoff.angle(context, one) for one in tradeoff.DEGREES]
            drawn.cost_figure(panels, renderer(context), given.pictures / "render-fur-cost.png")
        return
    show_all({name: TABLES[name] for name in given.only or TABLES}, given.json)


if __name__ == "__main__":
    main()

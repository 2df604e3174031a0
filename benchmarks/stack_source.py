"""Shader source of the recorded stacks on the OpenGL at hand: what float32 loses, and what a stack costs.

    python -m benchmarks.stack_source        # a minute on two cores, with Mesa's rasteriser

Errors are those of float32 against the same text in float64, the largest over red, green and blue, over radii from a
thousandth of a mean free path to a hundred, and over first layers of none to ten mean free paths: relative, but for the
cdf's, which is a share. Profile and density are judged where 99.5 % of the light lies.

Costs are over the text of the hazard law, for the same light and index, as `profilefit.shader.check.law_cost` times
them: what depends on thickness only is computed once before the loop, as a renderer does per pixel.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from benchmarks.table import show
from mcml_sim import Medium
from profilefit.laws.stack import StackLaw
from profilefit.materials import CHANNELS
from profilefit.recipes import record
from profilefit.recipes.folder import STACKS, fits_folder
from profilefit.recipes.kinds.stack import StackRecord, load
from profilefit.shader.check.law_cost import Cost, TimedText, text_costs, timed_text
from profilefit.shader.check.shader_law import PROFILE, _Pass
from profilefit.shader.context import opened, renderer
from profilefit.shader.emit import literal
from profilefit.shader.stack_text import single_text, stack_text

Floats = NDArray[np.float64]
NAME, YARDSTICK = "stack", "hazard"
RADII, SEEN = np.geomspace(1e-3, 100.0, 200), 0.995  # [mfp of the first layer], share of the light
THICKNESSES = np.array([0.0, 1e-3, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0])  # [mfp of the first layer]
DIRECTIONS, SEED = 2000, 7
WORKS = ("profile", "sample", "both", "estimate")
ONCE = """#version 330
{text}
uniform sampler2D arguments; // thickness, cosines of beam, of eye, and of the angle between
layout(location = 0) out vec4 found;
void main() {{
    vec4 q = texelFetch(arguments, ivec2(gl_FragCoord.xy), 0);
    found = vec4({calls}, 0.0);
}}
"""


class Rounding(NamedTuple):
    """Largest errors of float32: relative, of the cdf as a share [-]; `once` is that of light scattered once."""

    profile: float
    cdf: float
    pdf: float
    once: float


def rounding(context: moderngl.Context, laws: Sequence[StackLaw], media: Sequence[Medium]) -> Rounding:
    """Return the errors of both texts of a stack, over its channels."""
    source = PROFILE.format(head="", text=stack_text(laws, name=NAME), name=NAME, type="float")
    shader, twin = _Pass(context, NAME, source, "f4"), _twin(stack_text(laws, "python", NAME))
    found = [_of_law(shader, twin, channel, law.top.mfp) for channel, law in enumerate(laws)]
    profile, cdf, pdf = (max(column) for column in zip(*found, strict=True))
    return Rounding(profile, cdf, pdf, _once(context, media))


def _of_law(shader: _Pass, twin: dict[str, Any], channel: int, mfp: float) -> tuple[float, float, float]:
    r, d = _held(RADII[:, None] * mfp), _held(THICKNESSES * mfp)
    profile, cdf, _, pdf = shader(r, 0.5, channel, d)
    right = {what: twin[f"{NAME}_{what}"](r, float(channel), d) for what in ("profile", "cdf", "pdf")}
    seen = right["cdf"] < SEEN
    share = float(np.max(np.abs(cdf - right["cdf"])))
    return _worst(profile[seen], right["profile"][seen]), share, _worst(pdf[seen], right["pdf"][seen])


def _once(context: moderngl.Context, media: Sequence[Medium]) -> float:
    random, channels = np.random.default_rng(SEED), range(len(CHANNELS))
    cos_in, cos_out = (_held(1.0 - random.random(DIRECTIONS)) for _ in range(2))
    turned = _held(np.cos(random.uniform(0.0, 2.0 * np.pi, DIRECTIONS)))
    calls = ", ".join(f"{NAME}_radiance({channel}.0, q.x, q.y, q.z, q.w)" for channel in channels)
    shader = _Pass(context, "once", ONCE.format(text=single_text(media, name=NAME), calls=calls), "f4")
    twin = _twin(single_text(media, "python", NAME))
    worst = []
    for channel in channels:
        d = _held(THICKNESSES * media[channel].layers[0].mfp)[:, None]
        right = twin[f"{NAME}_radiance"](float(channel), d, cos_in, cos_out, turned)
        worst.append(_worst(shader(d, cos_in, cos_out, turned)[channel], right))
    return max(worst)


def cost(context: moderngl.Context, laws: Sequence[StackLaw], works: Sequence[str] = WORKS) -> Cost:
    """Return the time of the text of a stack over that of its own half space."""
    thickest = literal(float(THICKNESSES[-1]) * max(law.top.mfp for law in laws))
    # A channel that no compiler knows, or the numbers of one would be constants.
    shape = f"{NAME}_shape(floor(3.0 * fract(16.0 * start)), {thickest} * start)"
    texts = {YARDSTICK: timed_text(laws[0].top.law), NAME: TimedText(stack_text(laws, name=NAME), NAME, shape)}
    return text_costs(context, texts, YARDSTICK, works)[NAME]


def rows(context: moderngl.Context, records: Sequence[StackRecord]) -> tuple[list[list[str]], list[list[str]]]:
    """Yield the rows of both tables, one per record."""
    errors, costs = [], []
    for one in records:
        label = f"{one.name}, {len(one.stack.names)} layers, {one.setting}"
        errors.append([label, *(f"{value:.1e}" for value in rounding(context, one.laws, one.stack.media))])
        found = cost(context, one.laws)
        costs.append([label, *(f"{found.ratio[work]:.2f}" for work in WORKS), f"{found.ns['both']:.2g}"])
    return errors, costs


def _held(values: Floats) -> Floats:
    """Return numbers as a float32 holds them."""
    return values.astype(np.float32).astype(np.float64)


def _worst(found: Floats, right: Floats) -> float:
    return float(np.max(np.abs(found / right - 1.0)))


def _twin(text: str) -> dict[str, Any]:
    """Return the functions of a text in float64."""
    names: dict[str, Any] = {}
    exec(compile(text, "stack.py", "exec"), names)
    return names


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fits", type=Path, default=fits_folder(), metavar="FOLDER", help="of the records")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there too")
    given = parser.parse_args(arguments)
    folder = given.fits / STACKS
    records = [load(path) for path in record.available(folder).values()]
    if not records:
        print(f"{folder} has no record of a stack: `profilefit regenerate STACK.toml` makes one")
        return
    with opened() as context:
        print(f"on {renderer(context)}")
        errors, costs = rows(context, records)
    show("float32 against float64, at worst", ("stack", *Rounding._fields), errors)
    show("Cost over hazard, ratio of medians in turns", ("stack", *WORKS, "both, ns"), costs)
    if given.json is not None:
        found = {
            one.name: {
                "rounding": dict(zip(Rounding._fields, map(float, error[1:]), strict=True)),
                "cost": dict(zip(WORKS, map(float, cost[1:-1]), strict=True)),
            }
            for one, error, cost in zip(records, errors, costs, strict=True)
        }
        given.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

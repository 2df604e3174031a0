"""Renders judged: error over samples and time, the paper's Table 2 and Figure 14, bias and noise, pictures.

    python -m benchmarks.render errors|table2|fig14|variance|pictures|choices|refracting|reference
                                [--quick] [--size WxH] [--figure FILE] [--json FILE]

Needs the extra `benchmark` and an OpenGL without a window; the first line names the device. All but `refracting` and
`reference` are of n = 1, as published.
README.md beside this file says what the numbers mean.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import moderngl

from benchmarks import (
    render_errors,
    render_pictures,
    render_reference,
    render_refracting,
    render_table2,
    render_variance,
)
from benchmarks.render_laws import contenders, variants
from benchmarks.render_view import judged
from profilefit.errors import ShaderError
from profilefit.scenes.skin.scene import head_scene
from profilefit.shader.context import open_context, renderer
from profilefit.studies.choose.cost import YARDSTICK_TAPS

SAMPLES, QUICK_SAMPLES = (1, 4, 16, 64, 256), (1, 4, 16)
SEEDS, QUICK_SEEDS = 4, 2
TURNS, QUICK_TURNS = 5, 1
VIEW, SCREEN = (192, 192), (1920, 1080)
SIDES = re.compile(r"([1-9]\d{0,4})x([1-9]\d{0,4})")


def errors(context: moderngl.Context, options: argparse.Namespace) -> dict:
    """Judge every law over samples and over time, and two laws with every way to draw radii."""
    works, varied = contenders(), variants()
    samples = QUICK_SAMPLES if options.quick else SAMPLES
    seeds, turns = (QUICK_SEEDS, QUICK_TURNS) if options.quick else (SEEDS, TURNS)
    with _judged(context, options) as judge:
        found = render_errors.measured(judge, works, samples, seeds, turns)
        render_errors.report("Laws", works, found, "separable")
        other = render_errors.measured(judge, varied, samples, seeds, turns)
        render_errors.report("Radii", varied, other, "burley, importance blue, longest")
        own = judge.own_error
        if own:
            print("the reference's own error, median, 90 %, RMS:", *(f"{value:.1e}" for value in own))
    if options.figure:
        render_errors.draw(works, found, options.figure, _device(context))
    return {"reference_error": own, "laws": render_errors.as_json(found), "radii": render_errors.as_json(other)}


def table2(context: moderngl.Context, options: argparse.Namespace) -> dict:
    """Measure the paper's Table 2."""
    laws, size = contenders(), options.size or SCREEN
    works = {key: laws[key] for key in render_table2.KEYS}
    scene = replace(head_scene(), has_occlusion=False)
    found = render_table2.timed(context, scene, works, size, QUICK_TURNS if options.quick else 3)
    title = f"{size[0]} x {size[1]}, {YARDSTICK_TAPS} samples, over separable"
    render_table2.report(title, works, found)
    return {"size": size, "samples": YARDSTICK_TAPS, "shares": render_table2.as_json(found)}


def variance(context: moderngl.Context, options: argparse.Namespace) -> dict:
    """Measure squared bias and variance of the estimator at a step edge."""
    found = render_variance.measured(context, QUICK_SAMPLES if options.quick else SAMPLES, 2 if options.quick else 24)
    render_variance.report(found)
    return render_variance.as_json(found)


def pictures(context: moderngl.Context, options: argparse.Namespace) -> dict:
    """Draw laws with equal samples and in equal time."""
    titles = (
        f"{render_pictures.EQUAL} samples\neach\n\nbelow: their\ndifference from\nthe exact picture",
        f"in the time of\nhazard with\n{render_pictures.RICH} samples",
    )
    return _drawn(context, options, render_pictures.laws, titles)


def fig14(context: moderngl.Context, options: argparse.Namespace) -> dict:
    """Draw 17 samples, uniform against importance."""
    return _drawn(context, options, render_pictures.seventeen, ("the hazard law,\n17 samples",))


def choices(context: moderngl.Context, options: argparse.Namespace) -> dict:
    """Compare a law for diffuse light with one for searchlights, one channel's radii with a mixture's."""
    return _drawn(context, options, render_pictures.choices, ("the hazard law",))


def refracting(context: moderngl.Context, options: argparse.Namespace) -> dict:
    """Draw three laws of a surface that refracts: profiles, a head by each, and its error."""
    size = options.size or render_refracting.SIZE
    with render_refracting.judged_head(context, size) as judge:
        found = render_refracting.shots(judge, 1 if options.quick else render_refracting.SEEDS)
        render_refracting.report(found)
        if options.figure:
            render_refracting.draw(judge, found, options.figure)
        return render_refracting.as_json(found)


def reference(context: moderngl.Context, options: argparse.Namespace) -> dict:
    """Time the reference, and compare it with a double sum over pixels."""
    found = render_reference.measured(context, options.size or render_reference.SIZE)
    render_reference.report(found)
    return found


WHAT: dict[str, Callable[[moderngl.Context, argparse.Namespace], dict]] = {
    one.__name__: one for one in (errors, table2, fig14, variance, pictures, choices, refracting, reference)
}


def _judged(context: moderngl.Context, options: argparse.Namespace):
    return judged(context, options.size or VIEW, options.quick)


def _drawn(
    context: moderngl.Context,
    options: argparse.Namespace,
    taken: Callable[..., list[list[render_pictures.Shot]]],
    titles: Sequence[str],
) -> dict:
    with _judged(context, options) as judge:
        rows = taken(judge, contenders(), QUICK_TURNS if options.quick else TURNS)
        render_pictures.report(judge, rows)
        if options.figure:
            render_pictures.draw(judge, rows, options.figure, titles, _device(context))
        return {"reference_error": judge.own_error, "pictures": render_pictures.as_json(judge, rows)}


def _device(context: moderngl.Context) -> str:
    return str(context.info["GL_RENDERER"])


def _size(text: str) -> tuple[int, int]:
    match = SIDES.fullmatch(text)
    if not match:
        raise argparse.ArgumentTypeError(f"size must be WxH in pixels, as 320x256, got {text!r}")
    return int(match.group(1)), int(match.group(2))


def _png(text: str) -> Path:
    if not text.endswith(".png"):
        raise argparse.ArgumentTypeError(f"figure must be a .png file, got {text!r}")
    return Path(text)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=tuple(WHAT))
    parser.add_argument("--quick", action="store_true", help="fewer samples, seeds and turns: a first look")
    parser.add_argument("--size", type=_size, metavar="WxH", help="of the picture [pixels]")
    parser.add_argument("--figure", type=_png, metavar="FILE", help="draw a chart or picture there, .png")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers there too")
    options = parser.parse_args(arguments)
    try:
        context = open_context()
    except ShaderError as error:
        sys.exit(str(error))
    try:
        print(f"on {renderer(context)}")
        numbers = {"device": renderer(context), **WHAT[options.what](context, options)}
    finally:
        context.release()
    if options.json:
        options.json.write_text(json.dumps(numbers, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

"""Balance of texture and screen, fitted to sixty random scenes and judged on sixty others; and the heart's scene.

    python -m benchmarks.heart            # half an hour on two cores
    python -m benchmarks.heart --count 6  # fewer scenes
    python -m benchmarks.heart --scene    # error and cost of the heart, way by way: twelve minutes
    python -m benchmarks.heart --pictures fits/evidence   # the same as figures, with the heart beside its truth

Kernels are six Gaussians of heart and of skin. Errors of random scenes are root mean squares of light against the sum
over the whole surface with the same kernel, white 1; ratios are scene by scene, their means geometric. Those of the
heart are over the mean light, against exact light; times are of this machine's OpenGL, the least of three turns.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from moderngl import Context
from scipy.ndimage import gaussian_filter

import profilefit
from benchmarks import heart_trials as trials
from benchmarks.heart_figure import cost_figure, map_figure
from benchmarks.heart_fit import GRID, Errors, SplitLight, errors, fitted
from benchmarks.table import show
from mcml_sim.files.whole_file import read_toml
from profilefit.recipes.folder import shipped
from profilefit.recipes.kinds import stack
from profilefit.recipes.stack.gaussians import shared_gaussians
from profilefit.scenes.heart import chart, scene
from profilefit.scenes.heart.law import Kernel, crossover_of
from profilefit.scenes.heart.passes import kernel_of
from profilefit.scenes.stage.judge import ChartPoint
from profilefit.scenes.stage.pattern import Sampling
from profilefit.scenes.stage.world import INSIDE, unit
from profilefit.shader import opened, renderer
from profilefit.studies.choose.scenes import AtlasNeed

FILE = "heart.toml"
STACKS, COUNT = ("heart", "skin"), 6
SEEDS = (11, 12)  # of the scenes that are fitted, and of those that judge
TOLERANCE, NEAR = 0.03, 4.0  # of what the screen may be wrong by [white]; mean sigmas within which light is hidden
SIZES = ((512, 512), (768, 768), (1024, 1024), (1280, 1280))
WAYS = {"split": (4, 16, 64), "texture": (1,), "screen": (4, 16, 64), "none": (1,)}
JUDGED, TURNS = 2000, 3  # pixels; of times
TEXELS, VIEWS = (0.1, 0.2, 0.4, 0.7), (0.0, 60.0, 120.0)  # [mm], degrees from the front
MAPPED = (scene.SPLIT, scene.TEXTURE, scene.SCREEN)
SUPER, JITTERS = 8, (0.3, 0.5, 1.0)  # samples of a side; sigma [pixels]
FINER = (0.7, 0.4, 0.2, 0.1)
# A sheet that hides light: period 10, amplitude 2, eye at 50 degrees, lamp at 40, in mean free paths of alpha = 0.9.
SHEET, ALPHA, EYE, LAMP, STRIPES = (10.0, 0.2), 0.9, 50.0, 40.0, 4.0
PIXEL, OF_SHEET, MOST = 0.1, (0.5, 1.0), 800


def kernels() -> list[Kernel]:
    """Return kernels of the stacks, in diffuse light."""
    found = []
    for name in STACKS:
        media = stack.request(name).stack.media
        units = [medium.layers[0].mfp for medium in media]
        found.append(kernel_of(shared_gaussians(media, "diffuse", COUNT), units))
    return found


def rows(own: Errors, judged: Errors) -> list[tuple[str, ...]]:
    """Yield what is fitted, and its errors."""
    best, refits = fitted(own)
    row, column = (int(np.argmin(np.abs(grid - one))) for grid, one in zip(GRID, best, strict=True))
    found = judged.balanced[:, row, column]
    ratio, searched = found / judged.better, judged.balanced.min(axis=(1, 2))
    low, high = np.quantile(refits, [0.16, 0.84], axis=0)

    def mean(values: np.ndarray) -> str:
        return f"{np.exp(np.log(values).mean()):.3f}"

    return [
        ("constant of the crossover", f"{best.constant:.2f}", f"{low[0]:.2f} to {high[0]:.2f}"),
        ("threshold of the share", f"{best.threshold:g}", f"{low[1]:g} to {high[1]:g}"),
        ("over the better of texture and screen: median", f"{np.median(ratio):.3f}", ""),
        ("90th percentile", f"{np.quantile(ratio, 0.9):.3f}", ""),
        ("worst", f"{ratio.max():.3f}", ""),
        ("mean", mean(ratio), ""),
        ("over the best balance of each scene: mean", mean(found / searched), ""),
        *((f"over {name}: mean", mean(found / of), "") for name, of in judged.ways.items()),
    ]


def choices(lights: list[SplitLight], units: list[float]) -> list[tuple[str, ...]]:
    """Count how often what the screen misses says rightly whether an atlas is needed: numbers of scenes."""
    needs = [
        AtlasNeed(light.rms(light.screen), light.rms(light.truth + light.occlusion), TOLERANCE) for light in lights
    ]
    said, broken = np.array([(one.verdict == "atlas", one.is_broken) for one in needs]).T
    clear = np.array([light.hidden > NEAR * one for light, one in zip(lights, units, strict=True)])
    hidden = broken & ~clear
    return [
        ("nothing lit is hidden nearby", str(clear.sum()), f"no atlas: {np.count_nonzero(clear & ~said)}"),
        ("the screen breaks the tolerance", str(broken.sum()), f"atlas: {np.count_nonzero(broken & said)}"),
        ("and something lit is hidden nearby", str(hidden.sum()), f"atlas: {np.count_nonzero(hidden & said)}"),
        ("all", str(len(lights)), f"atlas: {said.sum()}"),
    ]


def sheets() -> list[tuple[str, ...]]:
    """Return errors on a sheet that hides light, of white, by texels [mean free paths]."""
    law = profilefit.load("gaussians")
    weights = np.exp(np.asarray(law.log_weights(ALPHA)))
    kernel = Kernel(np.asarray(law.variances(ALPHA)), np.repeat(weights[:, None], 3, axis=1))
    eye, lamp = (unit((np.sin(one), 0.0, np.cos(one))) for one in np.radians((EYE, LAMP)))
    found = []
    with opened() as context:
        for texel in OF_SHEET:
            trial = trials.RandomScene(
                "bumps", *SHEET, tuple(eye.tolist()), tuple(lamp.tolist()), STRIPES, texel, PIXEL, kernel
            )
            light = trials.measured(context, trial, MOST)
            split = light.rms(light.light(crossover_of(light.texel, light.pixel), np.inf))
            of = light.ways()
            blend = of["constant blend, best in hindsight"]
            cells = (of["no blur"], of["texture alone"], of["screen alone"], blend, split, blend / split)
            found.append((f"{texel:g}", *(f"{cell:.3g}" for cell in cells)))
    return found


def request(size: tuple[int, int] = (160, 120)) -> scene.HeartRequest:
    """Return the example, at that many pixels."""
    path = shipped("examples") / FILE
    return scene.read(str(path), read_toml(Path(path))).changed(camera_table={"resolution": size})


def frames(drawn: scene.HeartRender, kinds: Sequence[str], turns: int, sampling: Sampling) -> dict[str, float]:
    """Return the least milliseconds of a whole frame by each kind, taken in turns."""
    techniques = [drawn.named(kind) for kind in kinds]
    times = [[drawn.stage.time(one.by, one.mfp, sampling, 1, "frame")[0] for one in techniques] for _ in range(turns)]
    return dict(zip(kinds, np.min(times, axis=0).tolist(), strict=True))


def costs() -> tuple[dict[tuple[int, int], dict[str, list[ChartPoint]]], list[tuple[str, ...]], str]:
    """Return error and cost of each way at each size; rows of them and of frames; the device."""
    light, found, told = scene.light_of(request(), COUNT), {}, []
    with opened() as context:
        for size in SIZES:
            with scene.reference_render(context, request(size), light, JUDGED) as own:
                found[size] = chart.ways(own, request(size), WAYS, TURNS)
                least = frames(own, ("split", "texture"), TURNS, request().sampling)
            name = f"{size[0]} x {size[1]}"
            for kind, points in found[size].items():
                cells = ((str(one.samples), f"{one.rmse:.3g}", f"{min(one.milliseconds):.3g}") for one in points)
                told += [(name, kind, *cell) for cell in cells]
            more = least["split"] / least["texture"] - 1.0
            told.append((name, "frame, split over texture", "16", "", f"{100 * more:+.0f} %"))
        device = renderer(context)
    return found, told, device


def finer() -> list[tuple[str, ...]]:
    """Return errors as the atlas is refined."""
    found = []
    light = scene.light_of(request(), COUNT)
    with opened() as context, scene.reference_render(context, request(), light, JUDGED) as own:
        for texel in FINER:
            with own.with_texels(texel) as of:
                cells = (f"{chart.error(of, kind):.3g}" for kind in ("texture", "split"))
                found.append((f"{of.atlas.texel:.2g}", *cells))
    return found


def edges() -> list[tuple[str, ...]]:
    """Return errors of radiance next to outlines, over the mean of what is seen, against 8 x 8 samples a pixel.

    Jitter is the mean over many frames of a pixel's place moved by a Gaussian: a blur, by its variance.
    """
    light, columns, rows = scene.light_of(request(), COUNT), *request().size
    size = (SUPER * columns, SUPER * rows)
    with opened() as context, scene.reference_render(context, request(size), light, 1) as own:
        stage, mfp = own.stage, own.light.mfp
        fine = stage.render(own.technique("split"), mfp, request().sampling).astype(float)
        inside = stage.buffers().mask > INSIDE
    covered = inside.reshape(rows, SUPER, columns, SUPER).mean(axis=(1, 3))
    outline = (covered > 0) & (covered < 1)
    mean = fine.reshape(rows, SUPER, columns, SUPER, 3).mean(axis=(1, 3))
    middle, found = slice(SUPER // 2, None, SUPER), []
    ways = {"one sample": fine[middle, middle]}
    for number in (2, 4):
        places = (np.arange(number) + 0.5) / number * SUPER
        at = (np.arange(0, size[1], SUPER)[:, None] + places).astype(int).ravel()
        across = (np.arange(0, size[0], SUPER)[:, None] + places).astype(int).ravel()
        picked = fine[at][:, across].reshape(rows, number, columns, number, 3)
        ways[f"{number} x {number} samples"] = picked.mean(axis=(1, 3))
    for sigma in JITTERS:
        blurred = gaussian_filter(fine, (sigma * SUPER, sigma * SUPER, 0.0))
        ways[f"jitter of {sigma:g} pixels"] = blurred[middle, middle]
    for name, picture in ways.items():
        off = [
            np.sqrt(np.mean((picture - mean)[one] ** 2)) / mean[covered == 1].mean() for one in (outline, covered == 1)
        ]
        found.append((name, *(f"{one:.3g}" for one in off)))
    return found


def over_texel_and_view(
    context: Context, request: scene.HeartRequest, texels: Sequence[float], degrees: Sequence[float]
) -> dict[str, np.ndarray]:
    """Return errors (texels, views) of texture, screen and their split, by mean sides [mm] and turns of the view."""
    errors = {kind: np.empty((len(texels), len(degrees))) for kind in MAPPED}
    light = scene.light_of(request, COUNT)
    for column, one in enumerate(degrees):
        with scene.reference_render(context, turned(request, one), light, JUDGED) as seen:
            for row, texel in enumerate(texels):
                with seen.with_texels(texel) as own:
                    for kind in MAPPED:
                        errors[kind][row, column] = chart.error(own, kind)
    return errors


def turned(request: scene.HeartRequest, degrees: float) -> scene.HeartRequest:
    """Return the request seen from the front, turned by an angle about the upright."""
    angle, distance = np.radians(degrees), request.camera.distance
    return request.changed(camera_table={"direction": (np.sin(angle), 0.0, np.cos(angle)), "distance": distance})


def mapped() -> dict[str, np.ndarray]:
    """Return errors by texel and view."""
    with opened() as context:
        return over_texel_and_view(context, request(), TEXELS, VIEWS)


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--scene", action="store_true", help="error and cost of the heart, only")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="figures of the heart, only")
    given = parser.parse_args(arguments)
    if given.scene or given.pictures is not None:
        of_size, told, device = costs()
        show(f"The heart on {device}", ("pixels", "way", "samples", "error", "ms"), told)
        show("As the atlas is refined", ("texel [mm]", "texture", "split"), finer())
        columns = ("frames", "at the outline", "inside")
        show(f"Edges, against {SUPER} x {SUPER} samples a pixel", columns, edges())
        by_view = mapped()
        for kind, found in by_view.items():
            cells = [(f"{texel:g}", *(f"{one:.3g}" for one in row)) for texel, row in zip(TEXELS, found, strict=True)]
            show(f"Error by {kind}, over texel and view", ("mm", *(f"{one:g} degrees" for one in VIEWS)), cells)
        if given.pictures is not None:
            cost_figure(of_size, device, given.pictures / "render-heart-cost.png")
            map_figure(by_view, TEXELS, VIEWS, given.pictures / "render-heart-map.png")
        return
    if given.count < 1:
        parser.error(f"--count must be a number of scenes > 0, got {given.count}")
    known, count = kernels(), given.count
    with opened() as context:
        drawn = {seed: trials.drawn(known, count, seed) for seed in SEEDS}
        lights = {seed: [trials.measured(context, one) for one in some] for seed, some in drawn.items()}
    own, judged = (errors(lights[seed]) for seed in SEEDS)
    columns = ("", "value", "1 sigma")
    show(f"{count} scenes are fitted, {count} others judge", columns, rows(own, judged))
    units = [trials.mean_sigma(one.kernel) for some in drawn.values() for one in some]
    every = [light for some in lights.values() for light in some]
    show(f"Is an atlas needed? Tolerance {TOLERANCE:g}", ("scenes", "number", "said"), choices(every, units))
    columns = ("texel", "no blur", "texture", "screen", "best constant blend", "split", "blend / split")
    show("A sheet that hides light, eye at 50 degrees", columns, sheets())


if __name__ == "__main__":
    main()

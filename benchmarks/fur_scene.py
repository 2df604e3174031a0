"""Fur as OpenGL draws it: discs against their union, the example by each way, where gamma belongs; and its figure."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.render_figure import save
from profilefit.report.figures.canvas import BLUE, GREEN, GREY, ORANGE, VERMILION, canvas, plain_log, styled
from profilefit.scenes.fur import law, scene
from profilefit.scenes.fur.chart import patch_view
from profilefit.scenes.fur.passes import FurSurface
from profilefit.scenes.fur.truth import Patch
from profilefit.scenes.fur.ways import FITTED, LINEAR, OF_PICTURES, QUADRATIC, SWEPT, SWEPT_TWO, WAYS
from profilefit.scenes.stage.judge import srgb_codes
from profilefit.scenes.stage.renderer import Renderer
from profilefit.shader import opened
from profilefit.studies.tradeoff import scenes as tradeoff
from profilefit.studies.tradeoff.points import Panel

Rows = list[tuple[str | float, ...]]
RAYS, ROOT, SIDE = 2048, 0.1, 2.0  # of a strand alone, of length 1
UNIONS = ((20.0, 8), (45.0, 8), (45.0, 24), (58.0, 16))
LAYERS = (16, 32, 64, 128)
FINER = (1, 2, 4, 8)
EXPONENTS = (0.0, 4.0, 12.0, 60.0, 240.0)
COLOURS = {LINEAR.name: GREY, QUADRATIC.name: VERMILION, FITTED.name: ORANGE, SWEPT.name: GREEN, SWEPT_TWO.name: BLUE}


def unions() -> Rows:
    """Return the share of rays that meet a strand's discs, over the cone's shadow; its closed form, and error."""
    patch, found = Patch(np.array([[1.0, 1.0]]), SIDE, ROOT, 1.0), Rows()
    surface = FurSurface.of_patch(patch)
    with opened() as context, Renderer(context, (RAYS, RAYS)) as renderer:
        for way in (LINEAR, QUADRATIC):
            for degrees, layers in UNIONS:
                theta = float(np.radians(degrees))
                view, _ = patch_view(patch, theta, (RAYS, RAYS))
                share = float(np.mean(renderer.image(surface.layered(view, way, layers))[..., 3] >= 0.0))
                drawn = share * SIDE**2 / float(law.shadow(ROOT, 1.0, theta))
                expected = law.shell_shadow(layers, float(way.exponent or 1.0), ROOT, 1.0, theta)
                found.append((way.name, degrees, layers, drawn, expected, drawn / expected - 1.0))
    return found


def pictures() -> Rows:
    """Return errors of the example by each way, over the mean of its light."""
    with opened() as context:
        panel = tradeoff.picture(context, tradeoff.FurSizes(layers=LAYERS))
    errors = {(one.method, one.label): one.error.value for one in panel.points}
    return [(way.name, *(errors[way.name, str(n)] for n in LAYERS)) for way in OF_PICTURES]


def gamma() -> Rows:
    """Return the example's truth, its rays encoded and then averaged, less the average encoded, in steps of 8 bits."""
    found: Rows = []
    with opened() as context:
        for fine in FINER:
            with scene.reference_render(
                context, tradeoff.example("fur").changed(technique={"supersampling": fine})
            ) as drawn:
                white, judge = drawn.judge.exposure, drawn.judge
                encoded = scene.averaged(srgb_codes(white * drawn.fine), fine)
                off = (encoded - srgb_codes(white * judge.reference))[judge.mask]
                most = float(np.percentile(-off, 99.0))
                found.append((fine**2, float(off.mean()), float(np.sqrt(np.mean(off**2))), most))
    return found


def lobes() -> Rows:
    """Return the mean of a lobe over all directions by quadrature over the cosine, as published and normalised."""
    cosine, weight = np.polynomial.legendre.leggauss(256)
    means = [(p, float(0.5 * weight @ (1.0 - cosine**2) ** (0.5 * p))) for p in EXPONENTS]
    return [(p, mean, mean / float(law.lobe_mean(p))) for p, mean in means]


@styled
def cost_figure(panels: Sequence[Panel], device: str, path: Path) -> None:
    """Draw error over time toward six angles."""
    figure = canvas(5.0, 8.0)
    axes = figure.subplots(2, 3, sharex=True, sharey=True)
    for ax, panel in zip(axes.flat, panels, strict=True):
        for way in WAYS:
            points = [one for one in panel.points if one.method == way.name]
            time, low, high = (np.array([getattr(one.cost, at) for one in points]) for at in ("value", "low", "high"))
            error = [one.error.value for one in points]
            style = {"color": COLOURS[way.name], "marker": "o", "markersize": 3.0, "elinewidth": 0.6, "linewidth": 1.0}
            ax.errorbar(time, error, xerr=(time - low, high - time), label=way.name, **style)
            for one, x, y in zip(points, time, error, strict=True):
                if way in (LINEAR, SWEPT_TWO):
                    ax.annotate(one.label, (x, y), (0, 3), textcoords="offset points", fontsize=6.0)
        ax.set(xscale="log", yscale="log", title=panel.title.partition(",")[0])
        plain_log(ax.xaxis)
    for ax in axes[1]:
        ax.set_xlabel(panels[0].cost)
    for ax in axes[:, 0]:
        ax.set_ylabel("rms error of heights / length [-]")
    axes[1, 2].legend(fontsize=7.0, loc="lower left")
    figure.suptitle(f"Fur by each way, layers beside points, on {device.partition(' (')[0]}", fontsize=9.0)
    save(figure, path, 64)

"""Blurs of a heart: poles, seams and stretch of an atlas, and a screen seen aslant. It needs OpenGL.

Light is blurred by one Gaussian at a time, and held against what is known: a ball lit from one side, and an edge of
light on a plane. Errors are of white.
"""

from __future__ import annotations

from collections.abc import Iterator

import moderngl
import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

from profilefit.scenes.heart.atlas import BLURRED, Atlas
from profilefit.scenes.heart.law import Kernel
from profilefit.scenes.heart.meshes import ball, bumps
from profilefit.scenes.heart.passes import gather_of
from profilefit.scenes.heart.truth import sphere_blur
from profilefit.scenes.stage.pattern import Sampling
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.world import Camera, Mesh, Part, Scene, unit
from profilefit.shader import opened
from profilefit.studies.stability.cells import Cells, absolute, judged_cells
from profilefit.studies.stability.layout import TEXT32, ArgumentAxis

Floats = NDArray[np.float64]
WITHIN = 2.0  # sigma from a pole that are not promised: lines of the atlas turn there
FINE = 1.5  # texels of a sigma that are promised: of less, the edge is as wide as a texel
AT_POLES = "use charts without poles, such as the faces of a cube, or blur on the screen"
COARSE = "use a finer atlas, or blur that Gaussian on the screen"
BOUND = 0.02  # of white: what shows
RADIUS, TEXELS, MARGIN = 8.0, (192, 96), 24  # of the ball [mm], its atlas, columns and rows
SIGMAS = (0.02, 0.05, 0.1, 0.2, 0.4)  # [radius]; a texel of the equator is 0.033
LATITUDES = (0.0, 30.0, 60.0, 75.0, 83.0, 89.0)
FROM_SEAM = (0, 2, 10, 60)  # columns
LAMP = (0.6, 0.64, 0.48)
ROWS, RATIOS = 128, (1, 2, 4, 8, 16)  # of a plane's atlas, and rows over columns
WIDTHS = (2.0, 6.0, 18.0)  # sigma of a plane's light, in rows
ANGLES = (0.0, 30.0, 60.0, 75.0, 80.0, 85.0, 87.0, 88.0, 89.0)  # of the eye from the normal
PLACES = (-2.0, -1.0, -0.5, 0.5, 1.0, 2.0)  # from the edge [sigma]
VIEW, SIGMA, SAMPLES = (192, 64), 6.0, 256  # pixels; sigma [pixels, of a plane that faces the eye]


def cells_of() -> Iterator[Cells]:
    """Yield a ball's atlas over sigma, latitude and place, a plane's over stretch, and a screen over angles."""
    with opened() as context:
        yield of_ball(context)
        yield of_stretch(context)
        yield of_view(context)


def of_ball(context: moderngl.Context) -> Cells:
    """Return the atlas of a ball under a lamp."""
    part = _part(ball(RADIUS))
    size = (TEXELS[0] + 2 * MARGIN, TEXELS[1] + 2 * MARGIN)
    rows = [MARGIN + int((0.5 + one / 180.0) * TEXELS[1]) for one in LATITUDES]
    columns = [MARGIN + one for one in FROM_SEAM]
    pairs = []
    with Stage(context, (16, 16), 16) as stage, Atlas(context, size, MARGIN) as atlas:
        stage.draw(Scene((part,)))
        atlas.draw(stage, part)
        towards = atlas.read("normal_map")[..., :3].astype(float) @ np.array(LAMP)
        for sigma in SIGMAS:
            light = _blurred(atlas, 1.0 + towards, sigma * RADIUS)
            exactly = sphere_blur(RADIUS, towards, [(sigma * RADIUS) ** 2], [1.0])
            pairs.append([one[np.ix_(rows, columns)] for one in (light, exactly)])
    value, reference = np.stack(pairs, axis=1)
    axes = (
        ArgumentAxis("σ/R", "-", np.array(SIGMAS)),
        ArgumentAxis("latitude", "degrees", np.array(LATITUDES)),
        ArgumentAxis("from the seam", "texels", np.array(FROM_SEAM, float)),
    )
    away = np.radians(90.0 - np.array(LATITUDES))[:, None] >= WITHIN * np.array(SIGMAS)[:, None, None]
    return _cells("atlas of a ball", axes, value, reference, away, AT_POLES)


def of_stretch(context: moderngl.Context) -> Cells:
    """Return an edge of light on a plane whose columns are wider than its rows: the worst texel of each."""
    value, reference = np.empty((2, len(RATIOS), len(WIDTHS), 2))
    part = _part(bumps(ROWS / 3.0, 0.0, float(ROWS), 8))
    with Stage(context, (16, 16), 16) as stage:
        stage.draw(Scene((part,)))
        for i, ratio in enumerate(RATIOS):
            inner, margin = ROWS // ratio, min(24, max(2, ROWS // ratio // 4))
            with Atlas(context, (inner + 2 * margin, ROWS + 2 * margin), margin) as atlas:
                atlas.draw(stage, part)
                place = atlas.read("position_map")
                for j, sigma in enumerate(WIDTHS):
                    for axis in (0, 1):
                        along = place[..., axis].astype(float)
                        light = _blurred(atlas, (along > 0).astype(float), sigma)
                        exactly = 0.5 + 0.5 * erf(along / (np.sqrt(2.0) * sigma))
                        here = np.argwhere((place[..., 3] > 0.5) & (np.abs(along) < 0.25 * ROWS))
                        error = np.abs(light - exactly)[tuple(here.T)]
                        at = tuple(here[int(np.argmax(error))])
                        value[i, j, axis], reference[i, j, axis] = light[at], exactly[at]
    axes = (
        ArgumentAxis("column / row", "-", np.array(RATIOS, float)),
        ArgumentAxis("σ", "rows", np.array(WIDTHS)),
        ArgumentAxis("edge", "-", np.arange(2.0), ("across columns", "across rows")),
    )
    texel = np.array(RATIOS)[:, None, None] * np.array([1.0, 0.0])
    fine = np.array(WIDTHS)[:, None] >= FINE * texel
    return _cells("atlas that is stretched", axes, value, reference, fine, COARSE)


def of_view(context: moderngl.Context) -> Cells:
    """Return an edge of light on a plane seen aslant, blurred on the screen."""
    value, reference = np.empty((2, len(ANGLES), len(PLACES)))
    kernel = Kernel(np.array([SIGMA**2]), np.ones((1, 3)))
    part = _part(bumps(1e4, 0.0, 3e4, 8))
    with Stage(context, VIEW, 16) as stage:
        for i, angle in enumerate(np.radians(ANGLES).tolist()):
            eye = 1e5 * unit((np.sin(angle), 0.0, np.cos(angle)))
            camera = Camera((float(eye[0]), 0.0, float(eye[2])), height=float(VIEW[1]), kind="orthographic")
            stage.draw(Scene((part,), camera=camera))
            buffers = stage.buffers()
            across = (np.arange(VIEW[0]) + 0.5 - 0.5 * VIEW[0]) / np.cos(angle)
            buffers.irradiance[:] = (across > 0)[None, :, None]
            stage.upload(buffers)
            mean = stage.scatter(gather_of(kernel, (1.0,) * 3), 1.0, Sampling(SAMPLES))[..., 0].mean(axis=0)
            for j, place in enumerate(PLACES):
                at = int(np.argmin(np.abs(across - place * SIGMA)))
                value[i, j], reference[i, j] = mean[at], 0.5 + 0.5 * erf(across[at] / (np.sqrt(2.0) * SIGMA))
    axes = ArgumentAxis("angle", "degrees", np.array(ANGLES)), ArgumentAxis("from the edge", "σ", np.array(PLACES))
    return _cells("screen seen aslant", axes, value, reference, True)


def _part(mesh: Mesh) -> Part:
    return Part(mesh, np.ones((1, 1, 3), np.float32))


def _blurred(atlas: Atlas, light: Floats, sigma: float) -> Floats:
    """Return an irradiance (rows, columns) blurred by one Gaussian [mm]."""
    texels = np.repeat(light[..., None], 4, axis=-1).astype(np.float32)
    atlas.renderer.write("irradiance_map", texels)
    atlas.blur(Kernel(np.array([sigma**2]), np.ones(1)))
    return atlas.read(BLURRED)[..., 0].astype(float)


def _cells(
    subject: str,
    axes: tuple[ArgumentAxis, ...],
    value: Floats,
    reference: Floats,
    inside: NDArray[np.bool_] | bool,
    advice: str = COARSE,
) -> Cells:
    error = absolute(value, reference)
    return judged_cells(
        subject, True, "light, blurred", TEXT32, axes, value, reference, error, BOUND, inside, advice=advice
    )

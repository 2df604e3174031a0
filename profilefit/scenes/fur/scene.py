"""Furred ball: FUR.toml, its strands, shading and camera, drawn in layers beside rays against each strand."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from mcml_sim.media.checks import is_number
from profilefit.recipes.toml_tables import Table, Tables
from profilefit.scenes.fur.ball import NOTHING, FurView, random_ball
from profilefit.scenes.fur.passes import EXPONENTS, HITS, RIM, SHIFTS, STRENGTHS, Coat, FurSurface, Shading
from profilefit.scenes.fur.ways import FITTED, SWEPT, SWEPT_TWO, LayerTechnique
from profilefit.scenes.stage import request
from profilefit.scenes.stage.judge import TURNS, Judge
from profilefit.scenes.stage.picture import UNKNOWN, ChartPoint, RenderResult, TruthError
from profilefit.scenes.stage.renderer import Pass, Renderer
from profilefit.scenes.stage.request import Defaults, Viewpoint, ViewRequest
from profilefit.scenes.stage.world import Rgb

Floats = NDArray[np.float64]
TABLES = {
    "": ("title", "scene", "unit", "fur", "shading", *request.TABLES),
    "fur": ("density", "radius", "length", "force", "ball", "colour", "skin", "seed"),
    "shading": ("exponents", "shifts", "strengths", "normalised", "rim"),
    **request.TABLES,
    "technique": ("kind", "strands", "exponent", "tolerance", "supersampling", *request.TABLES["technique"]),
}
DENSITY, RADIUS, LENGTH, BALL = 0.64, 0.5, 10.0, 30.0
FORCE, COLOUR, SKIN, SEED = (0.0, -0.4, 0.0), (0.55, 0.38, 0.22), (0.35, 0.22, 0.16), 1
KINDS = ("swept", "shells")
TOLERANCE = 0.05
STRANDS = 2
SUPERSAMPLING = 4
VIEW, DEFAULTS = Viewpoint((0.0, 0.0, 0.0), 650.0, (0.0, 0.0, 1.0), 95.0), Defaults(samples=22)
LARGEST = 150.0  # of the ball, and of strands [mm]
SLENDEREST = 140.0  # the ball's radius over a strand's: what a map of them resolves
MOST_STRANDS = 1 << 16
MOST_FORCE = 0.9
WHITE = 0.99  # of the ball's pixels, the brightest of which becomes white


@dataclass(frozen=True)
class FurRequest(ViewRequest):
    """Picture of a furred ball that a file requests; its samples are layers.

    density        strands of the skin [1/mm^2];  radius, length  of a strand [mm], along the skin's normal
    force          of the tips, by the length [-];  ball  its radius [mm];  colour, skin  reflectances
    way            of drawing;  tolerance  of `choose`: rms error of the heights of hits over the length [-]
    supersampling  rays of a pixel along a side, averaged
    """

    density: float
    radius: float
    length: float
    force: Rgb
    ball: float
    colour: Rgb
    skin: Rgb
    seed: int
    way: LayerTechnique
    tolerance: float
    shading: Shading
    supersampling: int

    @property
    def count(self) -> int:
        """Number of strands."""
        return max(round(self.density * 4.0 * np.pi * self.ball**2), 1)


def read(file: str, content: Table) -> FurRequest:
    """Return the request of a file; InputError with file, table and key, what was got and what is accepted."""
    tables = Tables(file, TABLES)
    tables.known("", content)
    for key in ("title", "unit"):
        tables.text("", key, content, "mm")
    fur, named, shaded = (tables.table(content, name, {}) for name in ("fur", "technique", "shading"))
    found = FurRequest(
        **request.view(tables, content, VIEW.camera, DEFAULTS),
        density=tables.number("fur", "density", fur, DENSITY),
        radius=tables.number("fur", "radius", fur, RADIUS, LARGEST),
        length=tables.number("fur", "length", fur, LENGTH, LARGEST),
        force=tables.three("fur", "force", fur, FORCE, -MOST_FORCE, MOST_FORCE),
        ball=tables.number("fur", "ball", fur, BALL, LARGEST),
        colour=tables.three("fur", "colour", fur, COLOUR, 0.0, 1.0),
        skin=tables.three("fur", "skin", fur, SKIN, 0.0, 1.0),
        seed=tables.whole("fur", "seed", fur, SEED, 0, 2**31),
        way=_way(tables, named),
        tolerance=tables.number("technique", "tolerance", named, TOLERANCE, 1.0),
        shading=_shading(tables, shaded),
        supersampling=tables.whole("technique", "supersampling", named, SUPERSAMPLING, 1, 8),
    )
    _require_fur(tables, found)
    return found


def _way(tables: Tables, named: Table) -> LayerTechnique:
    kind = tables.text("technique", "kind", named, KINDS[0], KINDS)
    swept = kind == KINDS[0]
    if (other := "exponent" if swept else "strands") in named:
        raise tables.bad("technique", other, f"left out where kind is {kind}", named[other])
    if swept:
        return (SWEPT, SWEPT_TWO)[tables.whole("technique", "strands", named, STRANDS, 1, 2) - 1]
    exponent: Any = named.get("exponent", FITTED.name)
    if exponent == FITTED.name:
        return FITTED
    if not (is_number(exponent) and 0 < exponent <= 100):
        raise tables.bad("technique", "exponent", f'a number > 0 and <= 100, or "{FITTED.name}"', exponent)
    return LayerTechnique(f"shells, p = {exponent:g}", float(exponent))


def _shading(tables: Tables, shaded: Table) -> Shading:
    normalised = shaded.get("normalised", True)
    if type(normalised) is not bool:
        raise tables.bad("shading", "normalised", "true or false", normalised)
    return Shading(
        _two(tables, "exponents", shaded, EXPONENTS, 0.0, 1e4),
        _two(tables, "shifts", shaded, SHIFTS, -1.0, 1.0),
        _two(tables, "strengths", shaded, STRENGTHS, 0.0, request.MOST_LIGHT),
        normalised,
        tables.three("shading", "rim", shaded, RIM, 0.0, 100.0),
    )


def _two(
    tables: Tables, key: str, table: Table, default: tuple[float, float], least: float, most: float
) -> tuple[float, float]:
    value: Any = table.get(key, list(default))
    numbers = value if isinstance(value, list) else []
    if len(numbers) != 2 or not all(is_number(one) and least <= one <= most for one in numbers):
        raise tables.bad(
            "shading", key, f"two numbers in {least:g} ... {most:g}, of the first lobe and the other", value
        )
    return float(numbers[0]), float(numbers[1])


def _require_fur(tables: Tables, of: FurRequest) -> None:
    spacing = of.density**-0.5
    if of.radius > spacing:
        accepted = f"at most the strands' mean distance, 1 / sqrt(density) = {spacing:.4g} mm"
        raise tables.bad("fur", "radius", accepted, of.radius)
    if of.ball > SLENDEREST * of.radius:
        raise tables.bad("fur", "ball", f"at most {SLENDEREST:g} times the strands' radius", of.ball)
    if not of.density * 4.0 * np.pi * of.ball**2 <= MOST_STRANDS:
        most = MOST_STRANDS / (4.0 * np.pi * of.ball**2)
        raise tables.bad(
            "fur",
            "density",
            f"so many strands [1/mm^2] that the ball has {MOST_STRANDS} at most, {most:.4g}",
            of.density,
        )
    if not np.linalg.norm(of.force) <= MOST_FORCE:
        raise tables.bad(
            "fur", "force", f"three numbers whose root of squares is {MOST_FORCE:g} at most", list(of.force)
        )
    reach = of.ball + of.length * (1.0 + float(np.linalg.norm(of.force)))
    if np.linalg.norm(of.camera.eye) < 1.1 * reach:
        raise tables.bad(
            "camera",
            "distance",
            f"so long that the eye is {1.1 * reach:.4g} mm from the ball's middle",
            of.camera.distance,
        )
    of.require_light()


class FurRender(NamedTuple):
    """Furred ball with its passes and its reference.

    Attributes:
        request: of the file.
        renderer: with a pixel a ray.
        surface: of the ball.
        shade: pass from hits to radiance.
        view: of the camera.
        fine: (rows, columns, 3) radiance of the reference at each ray, row 0 at the bottom.
        judge: of pixels that see the ball or its fur.
    """

    request: FurRequest
    renderer: Renderer
    surface: FurSurface
    shade: Pass
    view: FurView
    fine: Floats
    judge: Judge

    def picture(self, by: LayerTechnique, layers: int) -> Floats:
        """Return the radiance (h, w, 3) of pixels by a technique."""
        rays = self.renderer.image(*self._passes(by, layers))
        return averaged(rays[..., :3].astype(float), self.request.supersampling)

    def points(self, by: LayerTechnique, layers: Sequence[int], turns: int = TURNS) -> list[ChartPoint]:
        """Return error and cost of each number of layers; time is of both passes."""
        draw, time = (
            (lambda count: self.picture(by, count)),
            (lambda count: self.renderer.time(*self._passes(by, count))),
        )
        return self.judge.points(by.name, layers, draw, time, turns)

    def _passes(self, by: LayerTechnique, layers: int) -> tuple[Pass, Pass]:
        return self.surface.layered(self.view, by, layers), self.shade


def averaged(fine: Floats, each: int) -> Floats:
    """Return the means (rows, columns, c) of pixels with so many rays along a side, in linear light."""
    rows, columns, channels = fine.shape
    return np.asarray(fine.reshape(rows // each, each, columns // each, each, channels).mean(axis=(1, 3)))


@contextmanager
def reference_render(context: moderngl.Context, of: FurRequest) -> Iterator[FurRender]:
    """Open the passes and the reference image of a request."""
    ball, each = random_ball(of.count, of.ball, of.radius, of.length, of.force, of.seed), of.supersampling
    size, view = (of.size[0] * each, of.size[1] * each), FurView.of(of.camera, of.size)
    shade = Coat(ball, of.density, of.colour, of.skin, of.light, of.ambient, of.shading).shade(view)
    with Renderer(context, size) as renderer:
        hits = ball.cast(view, size)
        renderer.write(HITS, hits)
        fine = renderer.image(shade)[..., :3].astype(float)
        mask = averaged((hits[..., 3:] > NOTHING).astype(float), each)[..., 0] > 0
        reference = averaged(fine, each)
        exposure = float(1.0 / max(np.quantile(reference[mask].max(axis=-1), WHITE), 1e-30))
        error = _standard_error(fine, each, mask) if each > 1 else UNKNOWN
        judge = Judge(reference, mask, error, exposure)
        yield FurRender(of, renderer, FurSurface.of_ball(ball), shade, view, fine, judge)


def _standard_error(fine: Floats, each: int, mask: NDArray[np.bool_]) -> TruthError:
    """Return the standard errors of pixels by those of their rays: two halves, as on a chess board."""
    rows, columns, _ = fine.shape
    board = (np.add.outer(np.arange(rows), np.arange(columns)) % 2).astype(float)[..., None]
    count = averaged(board, each)
    halves = averaged(fine * board, each) / count - averaged(fine * (1.0 - board), each) / (1.0 - count)
    mean = np.mean(averaged(fine, each)[mask])
    return TruthError.of(0.5 * np.sqrt(np.mean(halves**2, axis=-1))[mask] / mean)


def draw(context: moderngl.Context, of: FurRequest) -> RenderResult:
    """Draw the picture beside its reference, with error and cost: half a minute."""
    with reference_render(context, of) as drawn:
        chart, samples = drawn.points(of.way, of.numbers), of.sampling.samples
        frame = next(point.milliseconds for point in chart if point.samples == samples)
        return drawn.judge.result(drawn.picture(of.way, samples), chart, samples, frame, of="the fur's light")

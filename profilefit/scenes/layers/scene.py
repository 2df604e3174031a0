"""A head of layers: STACK.toml with a light and a camera, drawn in any pose with nothing worked out before for it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from mcml_sim import Medium, Setting
from profilefit.errors import InputError
from profilefit.laws.stack import StackLaw
from profilefit.materials import CHANNELS
from profilefit.recipes import catalogue
from profilefit.recipes.folder import LOCAL, fits_folder
from profilefit.recipes.stack import fit
from profilefit.recipes.stack.record import StackRequest, matching, requested
from profilefit.recipes.toml_tables import Table, Tables
from profilefit.scenes.layers import passes
from profilefit.scenes.layers.law import OneHalfSpace, one_half_space, plate_of
from profilefit.scenes.layers.truth import StackTable, stack_table
from profilefit.scenes.stage import head
from profilefit.scenes.stage.buffers import INSIDE, Buffers
from profilefit.scenes.stage.judge import TURNS, Judge, points
from profilefit.scenes.stage.pattern import MOST_SAMPLES, Sampling
from profilefit.scenes.stage.picture import Drawn, to_srgb
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.surface_integral import exitance_of, own_error
from profilefit.scenes.stage.technique import Technique
from profilefit.scenes.stage.world import Camera, Light, Part, Rgb, Scene, deformed, unit

Floats = NDArray[np.float64]
TABLES = {
    "": ("title", "scene", "unit", "illumination", "layers", "uneven", "pose", "technique", "camera", "light"),
    "technique": ("kind", "samples", "chart", "single"),
    "camera": ("resolution", "distance", "height", "target"),
    "light": ("direction", "irradiance", "ambient"),
}
KINDS = ("stack", "dipole", "half space", "none")
POSES = ("rest", "turn", "nod")
MOST_CHART = 8  # numbers of samples
MOST_PIXELS = 2**16  # the truth sums over all pairs of them
NEAREST, FARTHEST = 300.0, 1e4  # of the camera [mm]
LARGEST_VIEW, MOST_LIGHT = 1000.0, 1000.0
TARGET, DISTANCE, FROM, HEIGHT = (4.0, -6.0, 60.0), 650.0, (-109.0, -4.0, 640.0), 130.0
EXPOSURE = 1.1
NEGLIGIBLE = 0.01  # share of white that directions may be wrong by before light scattered once is drawn by itself
NO_LENGTH = 1e-6  # mean free path of light that does not leave its pixel [mm]
COLUMNS, BLOTCHES, SEED = 256, 40, 5  # of the thickness over the head, if it is no image


@dataclass(frozen=True)
class LayersRequest:
    """What a file requests.

    least, most  thickness of the first layer where values (rows, columns) are 0 and 1 [mm];  row 0 at the top
    chart        other numbers of samples, whose error and cost are measured;  size  [pixels]
    single       whether light scattered once leaves in its own directions
    """

    file: str
    stack: StackRequest
    least: float
    most: float
    values: NDArray[np.float32]
    pose: str
    kind: str
    sampling: Sampling
    chart: tuple[int, ...]
    single: bool
    camera: Camera
    light: Light
    ambient: Rgb
    size: tuple[int, int]


def read(file: str, content: Table) -> LayersRequest:
    """A scene of a file's content; InputError that names file, table and key, what was got and what is accepted."""
    tables = Tables(file, TABLES)
    tables.known("", content)
    stack = requested(file, content)
    for medium in stack.stack.media:
        tables.made("layers", lambda medium=medium: fit.require(medium))  # type: ignore[misc]
        if any(layer.g > 0 for layer in medium.layers):
            raise tables.bad("layers", "g", "0, and mu_s reduced: the exact truth is of isotropic scattering", "more")
    if stack.stack.unit != "mm":
        raise tables.bad("", "unit", "mm, which the head is in", stack.stack.unit)
    named, view, lit = (tables.table(content, name, {}) for name in ("technique", "camera", "light"))
    least, most, values = _thickness(tables, content, stack)
    direction = tables.three("light", "direction", lit, Light().direction, -1e6, 1e6)
    if not np.linalg.norm(direction) > 1e-6:
        raise tables.bad("light", "direction", "a direction, not 0", list(direction))
    size = tables.sides("camera", "resolution", view, (160, 120), 1024)
    if size[0] * size[1] > MOST_PIXELS:
        raise tables.bad("camera", "resolution", f"{MOST_PIXELS} pixels at most, which the truth sums over", list(size))
    return LayersRequest(
        file=file,
        stack=stack,
        least=least,
        most=most,
        values=values,
        pose=tables.text("", "pose", content, POSES[0], POSES),
        kind=tables.text("technique", "kind", named, KINDS[0], KINDS),
        sampling=tables.made("technique", lambda: Sampling(named.get("samples", 16))),
        chart=_chart(tables, named),
        single=_single(tables, named, stack),
        camera=_camera(tables, view),
        light=Light(direction, tables.three("light", "irradiance", lit, Light().irradiance, 0.0, MOST_LIGHT)),
        ambient=tables.three("light", "ambient", lit, Scene(()).ambient, 0.0, MOST_LIGHT),
        size=size,
    )


def draw(context: moderngl.Context, request: LayersRequest) -> Drawn:
    """The picture, its truth, error and cost: some minutes, most of them for exact light at nine thicknesses."""
    media, light = request.stack.stack.media, request.stack.illumination
    scene = scene_of(request)
    with Stage(context, (2 * request.size[0], 2 * request.size[1])) as stage:
        stage.draw(scene)
        fine = stage.buffers()
    _require_lit(request.file, fine)  # before the minutes that exact light takes
    table = stack_table(media, request.least, request.most, light)
    way = technique(request, laws_of(request.stack) if request.kind in ("stack", "none") else None)
    with Stage(context, request.size) as stage:
        stage.draw(scene)
        buffers = stage.buffers()
        _require_lit(request.file, buffers)
        judge = Judge(stage, way.mfp, truth_of(buffers, media, table), buffers.mask > INSIDE, alpha=way.alpha)
        numbers = tuple(dict.fromkeys((request.sampling.samples, *request.chart)))
        point, *others = points(judge, way.label, way.by, request.sampling, numbers)
        exitance = stage.scatter(way.by, way.mfp, request.sampling, way.alpha)
        seen = way.shown(request, media)
        radiance = stage.render(seen, way.mfp, request.sampling, way.alpha)
        frame = tuple(stage.time(seen, way.mfp, request.sampling, TURNS, "frame", way.alpha))
    true = radiance + (judge.truth - exitance) / np.pi
    return Drawn(
        picture=to_srgb(radiance[::-1], EXPOSURE),
        truth=to_srgb(true[::-1], EXPOSURE),
        error=judge.relative_error(exitance)[::-1],
        point=point,
        chart=tuple(sorted((point, *others), key=lambda one: one.samples)),
        frame=frame,
        truth_error=own_error(fine, mfp_of(media), table),
    )


@dataclass(frozen=True)
class Way:
    """A technique, and what the stage is told besides: lengths [mm] and, of half spaces, albedos of the three."""

    label: str
    by: Technique
    mfp: Rgb
    alpha: Rgb | None = None

    def shown(self, request: LayersRequest, media: tuple[Medium, Medium, Medium]) -> Technique:
        """With light scattered once in its own directions, where that is requested."""
        if not request.single or not isinstance(self.by, passes.Gather):
            return self.by
        return passes.WithSingle.of(self.by, media, request.least, request.most)


def technique(request: LayersRequest, laws: tuple[StackLaw, ...] | None) -> Way:
    """By `kind`: the stack's law, the first layer's dipole (Zhao et al., (10)), the nearest half space, or none."""
    media = request.stack.stack.media
    setting = Setting(request.stack.illumination, n=media[0].layers[0].n)
    if request.kind in ("stack", "none"):  # of which the last one's light does not leave its pixel
        assert laws is not None
        plates = [plate_of(medium, request.stack.illumination) for medium in media]
        lengths = mfp_of(media) if request.kind == "stack" else (NO_LENGTH,) * 3
        return Way(request.kind, passes.of_stack(laws, request.least, request.most, plates), lengths)
    if request.kind == "dipole":
        alpha = passes.channels_of([medium.layers[0].alpha for medium in media])
        dipole = catalogue.load("dipole", setting=Setting(n=setting.n))
        return Way("dipole of the first layer", passes.of_half_space(dipole), mfp_of(media), alpha)
    near = nearest(media, request.stack.illumination)
    return Way(
        "half space",
        passes.of_half_space(catalogue.load("hazard", setting=setting)),
        passes.channels_of([one.mfp for one in near]),
        passes.channels_of([one.alpha for one in near]),
    )


def nearest(media: tuple[Medium, Medium, Medium], illumination: str) -> list[OneHalfSpace]:
    """The half space nearest to each colour's stack."""
    return [one_half_space(medium, illumination) for medium in media]


def laws_of(stack: StackRequest) -> tuple[StackLaw, StackLaw, StackLaw]:
    """Those of a record of these very layers, in ./fits or that is shipped; fitted now where there is none."""
    for folder in (LOCAL, fits_folder()):
        if (record := matching(stack, folder)) is not None:
            return record.laws
    found = [fit.stack_law(medium, stack.illumination) for medium in stack.stack.media]
    red, green, blue = (one for one in found if isinstance(one, StackLaw))  # a file has two layers or more
    return red, green, blue


def truth_of(buffers: Buffers, media: tuple[Medium, Medium, Medium], table: StackTable) -> Floats:
    """(h, w, 3) radiant exitance by the stack at each point: the surface integral; Lambert's where nothing scatters."""
    return exitance_of(buffers, mfp_of(media), table)


def mfp_of(media: tuple[Medium, Medium, Medium]) -> Rgb:
    """Of the first layer, red, green, blue [mm]."""
    return passes.channels_of([medium.layers[0].mfp for medium in media])


def scene_of(request: LayersRequest) -> Scene:
    """The head in its pose; what its texture holds is the share of the way from the least thickness to the most."""
    values = np.repeat(request.values[::-1, :, None], len(CHANNELS), axis=-1)
    meshes = (head.head(), head.ear(-1), head.ear(1), head.neck())
    parts = tuple(Part(deformed(mesh, lambda points: posed(points, request.pose)), values) for mesh in meshes)
    return Scene(parts, request.light, request.ambient, request.camera, _mirrored(request))


def posed(points: Floats, pose: str) -> Floats:
    """Points of the head at rest, moved: the neck stays, the head turns about it or nods, smoothly between."""
    share = np.clip((points[:, 1] + 170.0) / 130.0, 0.0, 1.0)
    angle = {"rest": 0.0, "turn": np.radians(25.0), "nod": np.radians(12.0)}[pose] * share**2 * (3.0 - 2.0 * share)
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = points.T
    if pose == "nod":
        up, out = y + 110.0, z + 22.0
        return np.stack([x, c * up - s * out - 110.0, s * up + c * out - 22.0], axis=1)
    out = z + 22.0
    return np.stack([c * x + s * out, y, c * out - s * x - 22.0], axis=1)


def _mirrored(request: LayersRequest) -> float:
    """What the surface mirrors head-on [-]."""
    n = request.stack.stack.media[0].layers[0].n
    return ((n - 1.0) / (n + 1.0)) ** 2


def _thickness(tables: Tables, content: Table, stack: StackRequest) -> tuple[float, float, NDArray[np.float32]]:
    """Least and most of the first layer [mm], and where between it is over u and v, row 0 at the top."""
    given = stack.stack.map
    if given is not None:
        if "uneven" in content:
            raise tables.bad("", "uneven", "left out where the thickness is an image", content["uneven"])
        return given.least, given.most, given.values
    uneven = content.get("uneven", 0.5)
    if not isinstance(uneven, int | float) or isinstance(uneven, bool) or not 0 <= uneven < 1:
        raise tables.bad("", "uneven", "a share in [0, 1)", uneven)
    d, apart = stack.stack.media[0].layers[0].thickness, max(float(uneven), 1e-3)
    values = mottled() if uneven > 0 else np.full((1, 1), 0.5, np.float32)
    return d * (1.0 - apart), d * (1.0 + apart), values


def mottled() -> NDArray[np.float32]:
    """(rows, columns) in [0, 1]: soft blotches of several sizes over the head, the same each time."""
    random = np.random.default_rng(SEED)
    v, u = np.meshgrid(np.linspace(0, 1, COLUMNS // 2), np.linspace(0, 1, COLUMNS), indexing="ij")
    total = np.zeros_like(u)
    for _ in range(BLOTCHES):
        at_u, at_v, size, sign = random.random(), random.random(), random.uniform(0.01, 0.08), random.choice((-1, 1))
        across = np.abs(u - at_u)
        across = np.minimum(across, 1.0 - across)  # u runs around
        total += sign * np.exp(-((across / size) ** 2) - ((v - at_v) / (1.4 * size)) ** 2)
    return (0.5 + 0.5 * np.tanh(1.5 * total)).astype(np.float32)


def _single(tables: Tables, named: Table, stack: StackRequest) -> bool:
    """Whether light scattered once is drawn by itself: as the file says, else where it is more than negligible."""
    value: Any = named.get("single", "auto")
    if isinstance(value, bool):
        return value
    if value != "auto":
        raise tables.bad("technique", "single", "true, false or auto", value)
    return max(map(passes.alike_error, stack.stack.media)) > NEGLIGIBLE


def _chart(tables: Tables, named: Table) -> tuple[int, ...]:
    numbers: Any = named.get("chart", [])
    whole = isinstance(numbers, list) and all(type(one) is int and 1 <= one <= MOST_SAMPLES for one in numbers)
    if not whole or len(numbers) > MOST_CHART:
        accepted = f"at most {MOST_CHART} numbers of samples in 1 ... {MOST_SAMPLES}"
        raise tables.bad("technique", "chart", accepted, numbers)
    return tuple(numbers)


def _camera(tables: Tables, view: Table) -> Camera:
    """Looks from the front; without a height its lens stays the same at every distance."""
    target = tables.three("camera", "target", view, TARGET, -150.0, 150.0)
    distance = tables.number("camera", "distance", view, DISTANCE, FARTHEST)
    if distance < NEAREST:
        raise tables.bad("camera", "distance", f"a length in {NEAREST:g} ... {FARTHEST:g} mm", view["distance"])
    height = tables.number("camera", "height", view, HEIGHT * distance / DISTANCE, LARGEST_VIEW)
    x, y, z = (np.array(target) + distance * unit(FROM)).tolist()
    return Camera((x, y, z), target, height)


def _require_lit(file: str, buffers: Buffers) -> None:
    inside = buffers.mask > INSIDE
    if not np.any(buffers.irradiance[inside] > 0):
        raise InputError(f"{file}: the view must show something that light scatters in, and light must reach it")

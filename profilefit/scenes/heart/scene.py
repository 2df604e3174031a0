"""Heart of layers under one lamp: HEART.toml, drawn in texture space, on the screen, or by a split of both."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, NamedTuple, Self

import moderngl
import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from mcml_sim import Setting
from mcml_sim.exact.single_scattering import entered
from mcml_sim.media.arrays import Floats
from mcml_sim.media.medium import normal_reflectance
from profilefit.errors import InputError
from profilefit.laws.gaussians import MOST
from profilefit.recipes.declared import OneOf, Refused, Tolerance, at
from profilefit.recipes.folder import LOCAL, fits_folder
from profilefit.recipes.kinds import gaussians
from profilefit.recipes.kinds.stack import StackRequest, matching
from profilefit.recipes.stack import fit
from profilefit.recipes.stack.gaussians import SumLight, dense, joint, lights_of
from profilefit.scenes.heart import meshes
from profilefit.scenes.heart.atlas import Atlas, atlas_size, require_charts
from profilefit.scenes.heart.law import Kernel, crossover_of
from profilefit.scenes.heart.passes import ATLAS, Balanced, kernel_of
from profilefit.scenes.heart.truth import summed
from profilefit.scenes.stage.drawing import Drawer, StageDrawing
from profilefit.scenes.stage.judge import Judge
from profilefit.scenes.stage.reference.surface import UNKNOWN, TruthError, evenly, world
from profilefit.scenes.stage.reference.whole import whole_elements
from profilefit.scenes.stage.request import (
    MOST_PIXELS,
    Irradiances,
    LightTable,
    Samples,
    TechniqueTable,
    Viewpoint,
    ViewRequest,
    draw_lit,
    require_outside,
    seen_whole,
)
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.subject.mesh_file import MeshTable
from profilefit.scenes.stage.technique import Lambert, NamedTechnique, Technique
from profilefit.scenes.stage.world import INSIDE, Mesh, Part, Rgb, Scene, rgb

SPLIT, TEXTURE, SCREEN, NONE = KINDS = ("split", "texture", "screen", "none")
LARGEST = 150.0  # of a surface [mm], as far as cameras look from it
MOST_TEXELS = 2048  # of a side, margins left out
ELEMENT, FINEST = 0.5, 400  # side of an element of the reference [pixels], and so many of the surface's size at least
SEEN = 3.0  # height of a view, in the size of what is seen


class SurfaceTable(MeshTable):
    """Table [surface]: kind, or a mesh of a file, whose charts must not overlap.

    kind  size  radius, or period of bumps [mm];  steepness  amplitude of those, in their period.

    paint  whether a heart has colours of muscle, fat and vessels as A, in place of the A of the layers
    roughness  of the one lobe that is mirrored, GGX [-]
    """

    kind: Annotated[str, OneOf(*meshes.KINDS)] = meshes.KINDS[0]
    size: Annotated[float, Field(gt=0.0, le=LARGEST)] = 30.0
    steepness: Tolerance = 0.15
    paint: bool = True
    roughness: Tolerance = 0.2

    @model_validator(mode="after")
    def _of_bumps(self) -> Self:
        for key in ("kind", "size") if self.parts else ():
            if key in self.model_fields_set:
                raise Refused("left out where there is a mesh", getattr(self, key), key)
        if self.parts and len(self.parts) > 1:
            raise Refused("a file of one part", f"{len(self.parts)} parts", "mesh")
        if self.kind != "bumps" and "steepness" in self.model_fields_set:
            raise Refused("left out where kind is not bumps", self.steepness, "steepness")
        if (self.parts or self.kind != "heart") and "paint" in self.model_fields_set:
            raise Refused("left out where kind is not heart", self.paint, "paint")
        return self

    @property
    def is_painted(self) -> bool:
        """Whether a heart has colours of its own."""
        return self.paint and self.kind == "heart" and not self.parts


class HeartLight(LightTable):
    """Table [light]: direction toward the lamp, irradiance of a surface that faces it, and ambient irradiance."""

    irradiance: Irradiances = (5.0, 4.7, 4.3)
    ambient: Irradiances = (0.4, 0.4, 0.42)


class HeartTechnique(TechniqueTable):
    """Table [technique]: kind;  gaussians  of its kernel;  texel  mean side of the atlas's [mm].

    tolerance  largest error of screen space alone, over the mean of the light [-]
    """

    kind: Annotated[str, OneOf(*KINDS)] = SPLIT
    samples: Samples = 64
    gaussians: Annotated[int, Field(ge=1, le=MOST)] = 6
    texel: Annotated[float, Field(gt=0.0, le=LARGEST)] = 0.6
    tolerance: Tolerance = 0.02


class HeartRequest(ViewRequest, StackRequest):
    """Picture of a heart that a file requests."""

    scene: Annotated[str, OneOf("heart")] = "heart"
    surface: SurfaceTable = SurfaceTable()
    technique: HeartTechnique = HeartTechnique()
    light_table: HeartLight = Field(HeartLight(), alias="light")

    @property
    def viewpoint(self) -> Viewpoint:
        """Camera of a file that says nothing."""
        if self.surface.parts:
            return seen_whole(self.surface.extent)
        size = self.surface.size
        if self.surface.kind == "heart":
            return Viewpoint((0.0, 0.25 * size, 0.0), 650.0, (0.866, 0.1, 0.5), 3.4 * size)
        return Viewpoint((0.0, 0.0, 0.0), 650.0, (0.0, 0.0, 1.0), SEEN * size)

    @cached_property
    def mesh(self) -> Mesh:
        """Surface."""
        if self.surface.parts:
            return self.surface.parts[0].mesh
        return meshes.surface(self.surface.kind, self.surface.size, self.surface.steepness)

    @property
    def pixel(self) -> float:
        """Side of a pixel at the target [mm]."""
        return self.camera.height / self.size[1]

    @model_validator(mode="after")
    def _drawable(self) -> Self:
        fit.require_exact(self.stack)
        if self.stack.map is not None:
            raise Refused("one number: light is blurred alike all over", "an image", "layers", "thickness")
        if self.surface.parts:
            with at("surface"):
                require_charts(self.mesh)
            require_outside(self, self.surface)
        (columns, rows), margin = atlas_size(self.mesh, self.technique.texel, 10 * MOST_TEXELS)
        if max(columns, rows) - 2 * margin > MOST_TEXELS:
            accepted = f"a length [mm] of which {MOST_TEXELS} at most make a side of the atlas"
            raise Refused(accepted, self.technique.texel, "technique", "texel")
        return self


class Scattering(NamedTuple):
    """Light of a stack, red, green and blue: that of the picture, and that of its reference.

    kernel  of as many Gaussians as a technique has;  exact  of so many that they are the exact light [mm^2]
    colour  A [-]
    """

    kernel: Kernel
    exact: Kernel
    colour: Rgb

    @property
    def mfp(self) -> Rgb:
        """Lengths (3,) that the stage takes, so that no Gaussian's light counts as too short to see [mm]."""
        return (float(np.sqrt(self.kernel.variances[-1])),) * 3


read = HeartRequest.of


@contextmanager
def opened(context: moderngl.Context, of: HeartRequest, has_reference: bool) -> Iterator[StageDrawing]:
    """Open the drawing of a request; exact light takes half a minute if no record has these layers."""
    light = light_of(of, of.technique.gaussians)
    with reference_render(context, of, light, has_reference=has_reference) as drawn:

        def technique_of(given: HeartRequest) -> tuple[NamedTechnique, Technique]:
            named = drawn.named(given.technique.kind)
            return named, named.by

        yield StageDrawing(drawn.stage, technique_of, drawn.judge if has_reference else None)


drawer = Drawer(opened, ({"kind": TEXTURE}, {"kind": SCREEN}, {"kind": SPLIT}))
draw, picture = drawer.draw, drawer.picture


@dataclass(frozen=True)
class HeartRender:
    """Scene that is drawn, with its judge, its atlas and its light; pixel  side of one at the target [mm]."""

    stage: Stage
    judge: Judge
    atlas: Atlas
    part: Part
    light: Scattering
    pixel: float

    def technique(self, kind: str) -> Technique:
        """Return the technique of one of `KINDS`."""
        if kind == NONE:
            return Lambert()
        at = {TEXTURE: 0.0, SCREEN: np.inf}.get(kind, crossover_of(self.atlas.texel, self.pixel))
        return Balanced.of(self.atlas, self.part, self.light.kernel, at, ATLAS, self.light.mfp)

    def named(self, kind: str) -> NamedTechnique:
        """Return that technique with what the stage takes."""
        return NamedTechnique(kind, self.technique(kind), self.light.mfp)

    @contextmanager
    def with_texels(self, texel: float) -> Iterator[HeartRender]:
        """Open the same with an atlas of another mean side of texels [mm]."""
        size, margin = atlas_size(self.part.mesh, texel, MOST_TEXELS)
        with Atlas(self.stage.context, size, margin) as atlas:
            atlas.draw(self.stage, self.part)
            yield replace(self, atlas=atlas)


@contextmanager
def staged(context: moderngl.Context, of: HeartRequest, light: Scattering) -> Iterator[tuple[Stage, Scene]]:
    """Open a stage that has drawn what is requested, and the scene, of one part."""
    n = of.media[0].layers[0].n
    even, most = np.full((1, 1, 3), light.colour, np.float32), float(entered(Setting("diffuse", n=n)))
    if of.surface.parts:
        part = of.surface.parts[0].part(even, of.surface.roughness, most)
    else:
        part = Part(of.mesh, meshes.paint() if of.surface.is_painted else even, of.surface.roughness)
    f0 = normal_reflectance(1.0, n)
    with Stage(context, of.size) as stage:
        scene = of.under_light(Scene((part,), camera=of.camera, f0=f0))
        draw_lit(stage, scene, of.file)
        yield stage, scene


@contextmanager
def reference_render(
    context: moderngl.Context,
    of: HeartRequest,
    light: Scattering,
    most: int = MOST_PIXELS,
    has_reference: bool = True,
) -> Iterator[HeartRender]:
    """Open the passes and the reference image of a request, judged at so many pixels at most, or with no reference."""
    size, margin = atlas_size(of.mesh, of.technique.texel, MOST_TEXELS)
    with staged(context, of, light) as (stage, scene), Atlas(context, size, margin) as atlas:
        [part] = scene.parts
        buffers = stage.buffers()
        atlas.draw(stage, part)
        places, inside = world(buffers, of.camera), buffers.mask > INSIDE
        judged = inside & meshes.off_edges(of.surface.kind, of.surface.size, places, light.mfp[0])
        if not judged.any():
            raise InputError(f"{of.file}: the view must show some of the sheet that is not next to its edge")
        if np.count_nonzero(judged) > most:
            chosen = evenly(judged, most)
            judged = np.zeros_like(judged)
            judged[chosen] = True
            inside = judged
        reference, error = buffers.irradiance.astype(float), UNKNOWN
        if has_reference:
            side = min(ELEMENT * of.pixel, float(np.ptp(of.mesh.position, axis=0).max()) / FINEST)
            reference, error = _reference(stage, scene, inside, light, side)
        judge = Judge(reference, judged, error)
        yield HeartRender(stage, judge, atlas, part, light, of.pixel)


def _reference(
    stage: Stage, scene: Scene, inside: NDArray[np.bool_], light: Scattering, side: float
) -> tuple[Floats, TruthError]:
    """Return radiant exitance (h, w, 3) from the whole surface, and what elements of twice the side change.

    Args:
        stage: that has drawn the scene.
        scene: of the surface.
        inside: (h, w), where light is summed: elsewhere it is Lambert's.
        light: of the stack.
        side: of an element [mm].
    """
    buffers = stage.true_buffers()
    places, own = (value[inside].astype(float) for value in (buffers.position, buffers.irradiance))
    elements = whole_elements(stage, scene, side, 2.0 * side)
    sums = [
        buffers.reflectance[inside] * summed(one, light.exact.variances, light.exact.weights, places, own)
        for one in elements
    ]
    reference = np.multiply(buffers.irradiance, buffers.reflectance, dtype=float)
    reference[inside] = sums[0]
    return reference, TruthError.of(np.abs(sums[1] - sums[0]) / np.mean(sums[0]))


def light_of(of: StackRequest, count: int) -> Scattering:
    """Return the light of a record of these very layers, in ./fits or shipped; solved and fitted now where none is."""
    for folder in (LOCAL, fits_folder()):
        if (found := matching(of, folder)) is not None and (record := gaussians.find(found.name, folder)) is not None:
            units = [medium.layers[0].mfp for medium in of.media]
            kernel = kernel_of(record.laws(of.illumination, count), units)
            return _light(kernel, record.lights(of.illumination))
    lights = lights_of(of.media, of.illumination)
    best = joint(lights, count)
    return _light(Kernel(best.variances, best.weights.T), lights)


def _light(kernel: Kernel, lights: tuple[SumLight, ...]) -> Scattering:
    variances, weights = dense(lights)
    return Scattering(kernel, Kernel(variances, weights.T), rgb(light.whole for light in lights))

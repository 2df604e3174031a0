"""Head of layers, way by way: error and cost in three poses, shares of its light, where layers matter.

    python -m benchmarks.layers            # six minutes on two cores, of which the exact light takes two
    python -m benchmarks.layers --frames   # time of a frame over resolution and number of faces
    python -m benchmarks.layers --pictures fits/evidence   # render-ear.png

Of examples/layers-head.toml. Errors are root mean squares of scattered light over its mean, against the surface
integral with the exact stack at each point; times are of this machine's OpenGL, the least of five turns.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from statistics import median

import numpy as np
from matplotlib import image

from benchmarks.stacks import forward, stacks
from benchmarks.table import show
from mcml_sim import Layer, Medium, exact
from mcml_sim.files.whole_file import read_toml
from mcml_sim.media.medium import fresnel
from profilefit.laws.gaussians import MediumGaussians
from profilefit.materials import CHANNELS
from profilefit.recipes.folder import shipped
from profilefit.recipes.stack.gaussians import shared_gaussians
from profilefit.scenes.layers import chart, scene
from profilefit.scenes.layers.half_space import one_half_space
from profilefit.scenes.layers.law import Plate, plate_of
from profilefit.scenes.layers.passes import StackGather, diffusely_once, of_table, once
from profilefit.scenes.layers.truth import table_of
from profilefit.scenes.stage.judge import to_srgb
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.subject import head
from profilefit.scenes.stage.technique import LAW, LawText, NamedTechnique
from profilefit.scenes.stage.world import Camera, Light, Part
from profilefit.shader import opened, renderer
from profilefit.shader.stack_text import gaussians_text

FILE = "layers-head.toml"
TABLE = "exact tables"
WAYS = {
    "stack": (4, 16, 64),
    TABLE: (4, 16, 64),
    "gaussians:4": (64,),
    "gaussians:6": (64,),
    "dipole": (64,),
    "half space": (64,),
    "none": (1,),
}
SIZES, DETAILS = ((128, 128), (256, 256), (512, 512), (1024, 1024)), (1, 2)
PICTURED = ("stack", "dipole", "half space")
BEHIND, PARTS = Camera((250.0, 10.0, 600.0), (78.0, 2.0, -10.0), 110.0), (2.0, 5.0)  # of the ear; parts [mm]
THICKNESSES, MFPS = (0.1, 0.3, 1.0, 3.0, 10.0), (0.1, 0.3, 1.0, 3.0, 10.0)


def of_gaussians(sums: Sequence[MediumGaussians], plates: Sequence[Plate]) -> StackGather:
    """Return samples of sums of Gaussians, of red, green and blue, which are of one thickness everywhere."""
    text = gaussians_text(sums, name=LAW)
    law = LawText("gaussians", text, {}, f"{LAW}_shape(float(c))", f"{LAW}_reflectance(shape)")
    return StackGather(law, tuple(plates))


def request_of(size: tuple[int, int] = (128, 96)) -> scene.LayersRequest:
    """Return the example, at that many pixels."""
    path = shipped("examples") / FILE
    return scene.read(str(path), read_toml(Path(path))).changed(camera_table={"resolution": size})


def poses(request: scene.LayersRequest) -> list[tuple[str, ...]]:
    """Yield error and milliseconds of each way in each pose; one table of exact light serves all."""
    table = table_of(request.media, request.map, request.illumination)
    rows = []
    media, light = request.media, request.illumination
    plates = [plate_of(medium, light) for medium in media]
    others = {TABLE: NamedTechnique(TABLE, of_table(table, plates), request.mfp)}
    for count in (4, 6):
        sums = [shared_gaussians((medium,), light, count)[0] for medium in media]
        others[f"gaussians:{count}"] = NamedTechnique(f"{count} Gaussians", of_gaussians(sums, plates), request.mfp)
    with opened() as context, Stage(context, request.size) as stage:
        for pose in scene.POSES:
            for kind, found in chart.ways(stage, request.changed(pose=pose), table, WAYS, others).items():
                for one in found:
                    rows.append((pose, kind, str(one.samples), f"{one.rmse:.3g}", f"{min(one.milliseconds):.3g}"))
        device = renderer(context)
    rows.append(("", device.partition(",")[0], "", "", ""))
    return rows


def split(medium: Medium, illumination: str) -> tuple[float, float, float]:
    """Return shares of light that comes back scattered once, scattered more often, and mirrored by the surface [-].

    Exact, of a stack of one index, along the normal or diffuse; of g > 0 the similar stack's whole.
    """
    similar = Medium(tuple(layer.similar for layer in medium.layers), medium.n_above)
    light = exact.solve(similar, illumination)
    if illumination == "diffuse":
        first, mirror = diffusely_once(medium), light.specular
    else:
        first = float(once(medium, np.array([1.0]))[0])
        mirror = float(fresnel(medium.n_above, medium.layers[0].n, 1.0)[0])
    return first, max(light.reflectance - first, 0.0), mirror


def shares() -> list[tuple[str, ...]]:
    """Yield single : multiple : specular light of the stacks, by colour, isotropic and with g = 0.9."""
    rows = []
    for channel in range(3):
        for name, medium in stacks(channel).items():
            for g in (0.0, 0.9):
                own = medium if g == 0 else forward(medium, g)
                found = [split(own, light) for light in ("searchlight", "diffuse")]
                cells = (f"{100 * value:.2g}" for one in found for value in one)
                rows.append((f"{name}, {CHANNELS[channel]}", f"{g:g}", *cells))
    return rows


def matter() -> list[tuple[str, ...]]:
    """Return the error of the half space nearest to two layers over the first one's thickness and the mfp below.

    As a share of white, albedos of .95 and .98 and n = 1.4; root mean square near a step edge of diffuse light; exact.
    """

    def layer(alpha: float, mfp: float, thickness: float) -> Layer:
        return Layer(1.4, (1.0 - alpha) / mfp, alpha / mfp, 0.0, thickness)

    media = [[Medium((layer(0.95, 1.0, d), layer(0.98, mfp, np.inf))) for mfp in MFPS] for d in THICKNESSES]
    errors = [[100 * one_half_space(medium).error for medium in row] for row in media]
    return [(f"{d:g}", *(f"{value:.2g}" for value in row)) for d, row in zip(THICKNESSES, errors, strict=True)]


def frames(request: scene.LayersRequest) -> list[tuple[str, ...]]:
    """Return milliseconds of a whole frame over resolution and faces: figure 11 a of Zhao et al."""
    laws, rows = scene.laws_of(request), []
    with opened() as context:
        for size in SIZES:
            with Stage(context, size) as stage:
                for detail in DETAILS:
                    drawn = scene.scene_of(request)
                    finer = (head.head(detail), head.ear(-1, detail), head.ear(1, detail), head.neck(detail))
                    skin = (Part(mesh, part.reflectance) for mesh, part in zip(finer, drawn.parts, strict=False))
                    stage.draw(replace(drawn, parts=(*skin, *drawn.parts[len(finer) :])))
                    way = scene.technique(request, laws)
                    times = stage.time(way.by, way.mfp, request.sampling, 3, "frame")
                    faces = sum(len(mesh.triangles) for mesh in finer)
                    rows.append((f"{size[0]} x {size[1]}", str(faces), f"{median(times):.3g}"))
    return rows


def ear(file: Path) -> list[tuple[str, ...]]:
    """Draw an ear by each way, side by side.

    Returns rows of the light through a part with the layers on both sides, over what arrives: exact plates, the scene's
    closed form, and what a half space's law has left beyond the thickness.
    """
    request = request_of((320, 320))
    behind = replace(
        scene.scene_of(request), camera=BEHIND, light=Light((0.4, 0.25, -0.9)), ambient=(0.05, 0.055, 0.06)
    )
    laws, pictures, rows = scene.laws_of(request), [], []
    with opened() as context, Stage(context, request.size) as stage:
        stage.draw(behind)
        for kind in PICTURED:
            way = scene.technique(request.changed(technique={"kind": kind}), laws)
            pictures.append(to_srgb(stage.render(way.by, way.mfp, request.sampling, way.alpha)[::-1], 1.5))
    image.imsave(file, np.concatenate(pictures, axis=1))
    for channel, medium, law in zip(CHANNELS, request.media, laws, strict=True):
        plate, (*upper, core) = plate_of(medium), medium.layers
        for thickness in PARTS:
            middle = replace(core, thickness=thickness - plate.skins)
            layers = Medium((*upper, middle, *reversed(upper)), medium.n_above, medium.n_above)
            true = exact.solve(layers, "diffuse").transmittance
            left = law.reflectance * (1.0 - float(law.cdf(thickness)))
            cells = (f"{value:.3g}" for value in (thickness, true, float(plate.transmitted(thickness)), left))
            rows.append((channel, *cells))
    return rows


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", action="store_true", help="time of a frame over resolution and faces, only")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the errors by pose and way there too")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="the picture of an ear, only")
    request, given = request_of(), parser.parse_args(arguments)
    if given.pictures is not None:
        columns = ("light through skin", "mm", "exact", "closed form", "half space's rest")
        show("Of light that arrives [-]", columns, ear(given.pictures / "render-ear.png"))
        return
    if given.frames:
        show("A frame of 16 samples a pixel", ("pixels", "faces", "ms"), frames(request))
        return
    found = poses(request)
    show("Error and cost by pose", ("pose", "way", "samples", "error", "ms"), found)
    if given.json is not None:
        kept = [dict(zip(("pose", "way", "samples", "error", "ms"), one, strict=True)) for one in found[:-1]]
        given.json.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
    lights = [f"{part}, {light}" for light in ("pencil", "diffuse") for part in ("single", "multiple", "mirror")]
    show("Of light that arrives [%]", ("stack", "g", *lights), shares())
    title = "One half space: error [% of white] by thickness of layer 1 and mean free path below, in that of layer 1"
    show(title, ("", *(f"{mfp:g}" for mfp in MFPS)), matter())


if __name__ == "__main__":
    main()

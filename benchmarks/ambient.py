"""Error of the sky's light on the head where no lamp shines: without occlusion, and with that of the screen.

    python -m benchmarks.ambient              # a minute on two cores; --size 480 540 for another picture

Errors are root mean squares over pixels that scatter and that the lamp does not reach, over the mean of the reference,
whose sky is seen through a shadow map a patch (`profilefit/scenes/stage/light/occlusion.py`).
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from statistics import median

import numpy as np

import profilefit
from mcml_sim import Setting
from mcml_sim.media.arrays import Floats
from profilefit.scenes.skin.scene import head_scene
from profilefit.scenes.stage.light.lighting import IRRADIANCE
from profilefit.scenes.stage.light.occlusion import PATCHES
from profilefit.scenes.stage.pattern import Sampling
from profilefit.scenes.stage.reference.surface import exitance_of
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.world import INSIDE, Light
from profilefit.shader.context import opened, renderer

SKIN = Setting("diffuse", n=1.4)
DIM = 0.1  # of the lamp's irradiance: most of the light is the sky's
SURE = Sampling(256)


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--size", type=int, nargs=2, default=(360, 360), help="columns and rows [pixels]")
    size = tuple(arguments.parse_args().size)
    head, law = head_scene("skin1", setting=SKIN), profilefit.load("hazard", setting=SKIN)
    lamp = Light(irradiance=tuple(DIM * value for value in head.light.irradiance))
    scene = replace(head, light=lamp)
    with opened() as context, Stage(context, size) as stage:
        stage.draw(replace(scene, ambient=(0.0, 0.0, 0.0)))
        by_lamp = stage.renderer.read(IRRADIANCE)[..., :3]
        pictures, frames = {}, {}
        for name, has_occlusion in (("without occlusion", False), ("occlusion on the screen", True)):
            drawn = replace(scene, has_occlusion=has_occlusion)
            stage.draw(drawn)
            frames[name] = median(stage.time(law, head.material.mfp, repeats=9, passes="frame"))
            pictures[name] = stage.buffers().irradiance, stage.scatter(law, head.material.mfp, SURE)
        stage.draw(scene)
        true = stage.true_buffers()
        exitance = exitance_of(true, head.material.mfp, SKIN)
        shaded = (true.mask > INSIDE) & ~by_lamp.any(axis=-1)
        view = scene.camera.view()
        points = (true.position[shaded].astype(float) - view[:3, 3]) @ view[:3, :3]
        twice = stage.sky(points, true.normal[shaded].astype(float) @ view[:3, :3], 2 * PATCHES)
        device = renderer(context)
    print(f"the shadow side of a head, {np.count_nonzero(shaded)} of {size[0]} x {size[1]} pixels")
    for name, (irradiance, scattered) in pictures.items():
        light, out = error(irradiance, true.irradiance, shaded), error(scattered, exitance, shaded)
        print(f"{name}: irradiance {light:.2%}, scattered light {out:.2%}, a frame {frames[name]:.0f} ms")
    apart = np.sqrt(np.mean((twice - true.irradiance[shaded]) ** 2)) / np.mean(twice)
    print(f"the reference with {2 * PATCHES} patches of the sky in place of {PATCHES}: irradiance {apart:.2%}")
    print(f"times are of {device}")


def error(picture: Floats, reference: Floats, where: Floats) -> float:
    """Return the root mean square difference of two pictures (h, w, 3) at pixels (h, w), over the second's mean."""
    return float(np.sqrt(np.mean((picture[where] - reference[where]) ** 2)) / np.mean(reference[where]))


if __name__ == "__main__":
    main()

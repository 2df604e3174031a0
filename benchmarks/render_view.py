"""Picture that a render is judged by: a view of the head, the exact answer, two measures of error."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import flip_evaluator
import moderngl
import numpy as np
from numpy.typing import NDArray

from mcml_sim import Setting
from profilefit.scenes.skin.scene import FACE, Head, head_scene
from profilefit.scenes.stage.exact_law import DIFFUSE
from profilefit.scenes.stage.judge import EXPOSURE, Judge, surface_judge
from profilefit.scenes.stage.reference.surface import UNKNOWN, TruthError
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.world import Rgb

Floats = NDArray[np.float64]
# Nose, its shadow, freckles and eyes: 60 mm of the head, so that of 192 rows one shows 0.29 mm, and the shortest mean
# free path is 2.2 pixels: below two the stage fades to Lambert, which the truth does not.
CLOSE = replace(FACE, target=(4.0, -14.0, 60.0), height=60.0)


@dataclass(frozen=True, kw_only=True)
class Judged(Judge):
    """Stage that has drawn the view, mean free paths [mm], and the exact answer."""

    stage: Stage
    mfp: Rgb

    @property
    def own_error(self) -> TruthError | None:
        """Error of the exact answer, None if not measured."""
        return None if self.truth_error is UNKNOWN else self.truth_error

    def flip(self, exitance: NDArray[np.floating]) -> float:
        """Return the mean of FLIP over the translucent pixels (Andersson et al. 2020) [0, 1], at 67 pixels a degree."""
        pair = (np.ascontiguousarray(shown(image), np.float32) for image in (self.reference, exitance))
        difference, _, _ = flip_evaluator.evaluate(*pair, "LDR", applyMagma=False)
        return float(np.mean(difference[::-1][self.mask]))  # `shown` has row 0 at the top


@contextmanager
def judged(
    context: moderngl.Context,
    size: tuple[int, int],
    quick: bool,
    scene: Head | None = None,
    scale: float = 1.0,
    setting: Setting = DIFFUSE,
) -> Iterator[Judged]:
    """Return a view at a size [pixels], in whose way of the sky's light nothing is: errors are of scattering alone.

    quick  leaves out the error of the reference itself;  scene  the close view, if none
    scale  mean free paths over those of the material, for a head of 1 / scale its size [-]
    setting  of the exact answer
    """
    scene = replace(scene or head_scene(camera=CLOSE), has_occlusion=False)
    red, green, blue = scene.material.mfp
    mfp = scale * red, scale * green, scale * blue
    with Stage(context, size) as stage:
        stage.draw(scene)
        known = surface_judge(stage, scene, mfp, setting, not quick)
        yield Judged(known.reference, known.mask, known.truth_error, stage=stage, mfp=mfp)


def shown(exitance: NDArray[np.floating]) -> Floats:
    """Return sRGB in [0, 1] of the radiance, row 0 at the top."""
    linear = np.clip(EXPOSURE / np.pi * np.asarray(exitance, float)[::-1], 0.0, 1.0)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)  # IEC 61966-2-1

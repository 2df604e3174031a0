"""Does a scene need an atlas? What a gather on the screen by itself misses: light under what the view does not see."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np

from profilefit.scenes.heart.atlas import Atlas, atlas_size
from profilefit.scenes.heart.law import missed
from profilefit.scenes.heart.meshes import CHARTS_END
from profilefit.scenes.heart.scene import HeartRequest, light_of, staged
from profilefit.scenes.heart.truth import summed
from profilefit.scenes.stage.buffers import INSIDE
from profilefit.scenes.stage.surface import evenly, sees, world

CHOSEN = 400  # pixels
FINE = 6 * CHARTS_END  # texels of a side, of what light goes in


@dataclass(frozen=True)
class AtlasNeed:
    """error  root mean square of what the screen is wrong by for what it does not see, over the mean light [-]"""

    error: float
    tolerance: float

    @property
    def verdict(self) -> str:
        return "atlas" if self.error > self.tolerance else "no atlas"


def atlas_need(context: moderngl.Context, of: HeartRequest) -> AtlasNeed:
    """Of a heart's scene: sums at some hundred pixels, with its kernel; a minute where no record has its layers."""
    light = light_of(of.stack, of.gaussians)
    size, margin = atlas_size(of.mesh, 0.0, FINE, CHARTS_END)
    with staged(context, of, light) as (stage, part), Atlas(context, size, margin) as fine:
        fine.draw(stage, part)
        elements, buffers = fine.elements(), stage.buffers()
    at = evenly(buffers.mask > INSIDE, CHOSEN)
    places, own = world(buffers, of.camera)[at], buffers.irradiance[at].astype(float)
    off = missed(elements, sees(buffers, of.camera, elements.points), light.kernel, places, own)
    whole = summed(elements, light.kernel.variances, light.kernel.weights, places, own)
    colour = np.array(light.colour)
    return AtlasNeed(float(np.sqrt(np.mean((colour * off) ** 2)) / np.mean(colour * whole)), of.tolerance)

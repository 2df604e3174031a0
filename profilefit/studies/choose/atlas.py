"""Need of an atlas: the error of a gather on the screen alone, and the part of it that hidden surface causes."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np

from profilefit.scenes.heart.atlas import Atlas, atlas_size
from profilefit.scenes.heart.chart import SURE
from profilefit.scenes.heart.law import occlusion_error
from profilefit.scenes.heart.meshes import CHARTS_END, off_edges
from profilefit.scenes.heart.passes import ATLAS, Balanced
from profilefit.scenes.heart.scene import HeartRequest, light_of, staged
from profilefit.scenes.heart.truth import summed
from profilefit.scenes.stage.buffers import INSIDE
from profilefit.scenes.stage.surface import evenly, sees, world

CHOSEN = 400  # pixels
# What is hidden has a part in an error from this share of the tolerance on: in random scenes (`python -m
# benchmarks.heart`) where the screen breaks it and less is hidden, coarse pixels do.
PART = 0.25
FINE = 6 * CHARTS_END  # texels of a side, of what light goes in


@dataclass(frozen=True)
class AtlasNeed:
    """Root mean squares over the mean light [-].

    error   of the screen by itself, with many samples;  hidden  of what it is wrong by for what it does not see
    """

    error: float
    hidden: float
    tolerance: float

    @property
    def is_broken(self) -> bool:
        """Whether the screen by itself breaks the tolerance."""
        return self.error > self.tolerance

    @property
    def verdict(self) -> str:
        return "atlas" if self.is_broken and self.hidden > PART * self.tolerance else "no atlas"


def atlas_need(context: moderngl.Context, of: HeartRequest) -> AtlasNeed:
    """Return what a heart's scene needs, by sums at some hundred pixels; a minute where no record has its layers."""
    light = light_of(of, of.technique.gaussians)
    size, margin = atlas_size(of.mesh, 0.0, FINE, CHARTS_END)
    with staged(context, of, light) as (stage, part), Atlas(context, size, margin) as fine:
        fine.draw(stage, part)
        elements, buffers = fine.elements(), stage.buffers()
        by = Balanced.of(fine, part, light.kernel, np.inf, ATLAS, light.mfp)
        gathered = stage.scatter(by, light.mfp, SURE)
    places = world(buffers, of.camera)
    inside = buffers.mask > INSIDE
    judged = inside & off_edges(of.surface.kind, of.surface.size, places, light.mfp[0])
    at = evenly(judged if judged.any() else inside, CHOSEN)
    places, own = places[at], buffers.irradiance[at].astype(float)
    off = occlusion_error(elements, sees(buffers, of.camera, elements.points), light.kernel, places, own)
    whole = summed(elements, light.kernel.variances, light.kernel.weights, places, own)
    colour = np.array(light.colour)
    error, hidden = (np.sqrt(np.mean(one**2)) for one in (gathered[at] - colour * whole, colour * off))
    mean = np.mean(colour * whole)
    return AtlasNeed(float(error / mean), float(hidden / mean), of.technique.tolerance)

"""The passes of a heart: both parts of a kernel on the screen, the far one in the atlas, and their balance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mcml_sim import Setting
from profilefit.laws.gaussians import MediumGaussians
from profilefit.scenes.heart.atlas import Atlas
from profilefit.scenes.heart.law import Kernel, split
from profilefit.scenes.stage.gather import Gather
from profilefit.scenes.stage.technique import EXITANCE, LAW, Frame, LawText, Pass, Technique, maps, through_text
from profilefit.shader.emit import text_beside
from profilefit.shader.stack_text import gaussians_text

Floats = NDArray[np.float64]
NEAR, FAR = "near_map", "far_map"
ATLAS, SCREEN = 1e30, -1.0  # thresholds: no share is above the one, all are above the other


def kernel_of(sums: Sequence[MediumGaussians], units: Sequence[float]) -> Kernel:
    """Of sums that share their variances, over the light that comes back; units of their x [mm]."""
    variances = np.array(sums[0].variance) * units[0] ** 2
    return Kernel(variances, np.array([one.weight for one in sums]).T)


def gather_of(part: Kernel, mfp: Sequence[float]) -> Gather:
    """Samples of a part of a kernel, its weights scaled to sum to 1; mfp  of red, green and blue [mm]."""
    total = part.energy
    shares = part.weights / np.where(total > 0, total, 1.0) + np.where(total > 0, 0.0, 1.0 / len(part.variances))
    sums = [
        MediumGaussians(Setting(), 1.0, tuple((part.variances / unit**2).tolist()), tuple(share.tolist()))
        for unit, share in zip(mfp, shares.T, strict=True)
    ]
    return Gather(LawText("gaussians", gaussians_text(sums, name=LAW), {}, f"{LAW}_shape(float(c))", "1.0"))


@dataclass(frozen=True, eq=False)
class Balanced(Technique):
    """A kernel split at a crossover [mm]: near on the screen, far in the atlas but where the screen sees enough.

    atlas  that has light of this frame (`Atlas.draw`);  threshold  share from which on the screen has the far part, too
    With crossover 0 and a threshold of `ATLAS` all is texture space, with an endless one all is the screen's.
    """

    atlas: Atlas
    kernel: Kernel
    crossover: float
    threshold: float

    def passes(self, frame: Frame) -> Sequence[Pass]:
        parts = split(self.kernel, self.crossover)
        reads = maps("place_map", "position_map", "irradiance_map", "reflectance_map")
        found: list[Pass] = []
        for part, into in zip(parts, (NEAR, FAR), strict=True):
            if part.variances.size and (into == NEAR or self.threshold < ATLAS):
                (one,) = gather_of(part, frame.mfp.tolist()).passes(frame)
                found.append(replace(one, writes=into))
                reads[into] = into
            else:
                reads[into] = "irradiance_map"
        has_far = parts.far.variances.size > 0  # else the far light is 0 times the screen's
        light = self.atlas.targets.map(self.atlas.blur(parts.far) if has_far else "irradiance_map")
        uniforms = {
            "near_energy": tuple(np.broadcast_to(parts.near.energy, 3).tolist()),
            "far_energy": tuple(np.broadcast_to(parts.far.energy, 3).tolist()),
            "inset": self.atlas.inset,
            "threshold": self.threshold if has_far else SCREEN,
        }
        textures = {**reads, "atlas_map": light, "atlas_link_map": self.atlas.links}
        return [*found, Pass("balance", textures, EXITANCE, text_beside(__name__, "glsl/balance.frag"), uniforms)]

    def through(self) -> LawText:
        return LawText("heart", through_text("1.0"))

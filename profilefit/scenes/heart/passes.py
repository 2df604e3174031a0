"""Passes of a heart: both parts of a kernel on the screen, the far one in the atlas, and their balance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mcml_sim import Setting
from mcml_sim.media.arrays import Floats
from profilefit.laws.gaussians import MediumGaussians
from profilefit.scenes.heart.atlas import BLURRED, Atlas
from profilefit.scenes.heart.law import Kernel, split
from profilefit.scenes.stage.renderer import Pass, Read
from profilefit.scenes.stage.technique import EXITANCE, LAW, Frame, Gather, LawText, Technique, Unwraps, maps
from profilefit.scenes.stage.world import Part
from profilefit.shader.emit import text_beside
from profilefit.shader.stack_text import gaussians_text

NEAR, FAR = "near_map", "far_map"
ATLAS, SCREEN = 1e30, -1.0  # thresholds: no share is above the one, all are above the other


def kernel_of(sums: Sequence[MediumGaussians], units: Sequence[float]) -> Kernel:
    """Return the kernel of sums that share their variances, over the light that comes back; units of their x [mm]."""
    variances = np.array(sums[0].variance) * units[0] ** 2
    return Kernel(variances, np.array([one.weight for one in sums]).T)


def gather_of(part: Kernel, mfp: Sequence[float]) -> Gather:
    """Return samples of a part of a kernel, its weights scaled to sum to 1; mfp  of red, green and blue [mm]."""
    total = part.energy
    shares = part.weights / np.where(total > 0, total, 1.0) + np.where(total > 0, 0.0, 1.0 / len(part.variances))
    sums = [
        MediumGaussians(Setting(), 1.0, tuple((part.variances / unit**2).tolist()), tuple(share.tolist()))
        for unit, share in zip(mfp, shares.T, strict=True)
    ]
    return Gather(LawText("gaussians", gaussians_text(sums, name=LAW), {}, f"{LAW}_shape(float(c))", "1.0"))


@dataclass(frozen=True, eq=False)
class Balanced(Technique):
    """Kernel in two parts: near on the screen, far in texture space but where the screen sees enough of it.

    near, far  samples of either, None where there is none or it is not asked for;  energies  of both (2, 3) [-]
    atlas      whose light is blurred by the far part each time, after `part` was drawn into it; without a part it keeps
               the light that it has
    kernel     the far part;  threshold  share from which on the screen has it, too
    """

    near: Gather | None
    far: Gather | None
    energies: Floats
    atlas: Atlas
    part: Part | None
    kernel: Kernel
    threshold: float

    @classmethod
    def of(
        cls,
        atlas: Atlas,
        part: Part | None,
        kernel: Kernel,
        crossover: float,
        threshold: float,
        mfp: Sequence[float] = (1.0,) * 3,
    ) -> Balanced:
        """Return a kernel split at a crossover [mm]; mfp  what `scatter` takes, the unit of the samples' sources [mm].

        With crossover 0 and a threshold of `ATLAS` all is texture space, with an endless one all is the screen's.
        """
        parts = split(kernel, crossover)
        near, far = (gather_of(part, mfp) if part.variances.size else None for part in parts)
        seen = SCREEN if far is None else threshold  # no light is 0 times the screen's
        energies = np.array([np.broadcast_to(part.energy, 3) for part in parts])
        return cls(near, far if threshold < ATLAS else None, energies, atlas, part, parts.far, seen)

    def before(self, stage: Unwraps) -> None:
        if self.kernel.variances.size and self.threshold > SCREEN:
            if self.part is not None:
                self.atlas.draw(stage, self.part)
            self.atlas.blur(self.kernel)

    def passes(self, frame: Frame) -> Sequence[Pass]:
        surface = maps("place_map", "position_map", "irradiance_map", "reflectance_map")
        reads: dict[str, Read] = {**surface, "atlas_map": self.atlas.renderer.map(BLURRED)}
        found: list[Pass] = []
        for part, into in ((self.near, NEAR), (self.far, FAR)):
            reads[into] = "irradiance_map" if part is None else into
            found += [] if part is None else [replace(one, writes=into) for one in part.passes(frame)]
        near, far = (tuple(one) for one in self.energies.tolist())
        uniforms = {"near_energy": near, "far_energy": far, "inset": self.atlas.inset, "threshold": self.threshold}
        return [*found, Pass("balance", reads, EXITANCE, text_beside(__name__, "glsl/balance.frag"), uniforms)]

    def through(self) -> LawText:
        return LawText.of_share("heart", "1.0")

"""Technique of the head: Jimenez et al.'s separable filter, which blurs along rows and then along columns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from mcml_sim.media.arrays import Floats
from profilefit.scenes.skin.law import FOLLOW, Separable, transmitted
from profilefit.scenes.skin.truth import albedo_of
from profilefit.scenes.stage.renderer import Pass
from profilefit.scenes.stage.technique import EXITANCE, Frame, LawText, Technique, maps
from profilefit.shader.emit import text_beside

HALFWAY = "halfway_map"


@dataclass(frozen=True)
class SeparableFilter(Technique):
    """Filter by one kernel all over the picture: that of its mean A, where no alpha is fixed. A sample is a tap."""

    kernel: Separable = field(default_factory=Separable)

    def passes(self, frame: Frame) -> Sequence[Pass]:
        stretches = self.lengths(frame)
        source = text_beside(__name__, "separable.frag")
        common = {**frame.camera, "follow": float(FOLLOW / np.max(stretches))}
        reads = {
            **maps("reflectance_map", "position_map"),
            "kernel_map": self.kernel.taps(frame.sampling.samples, stretches)[None],
        }
        return [
            Pass("separable", {"light_map": light, **reads}, into, source, {**common, "direction": along, "last": last})
            for light, into, along, last in (
                ("irradiance_map", HALFWAY, (1.0, 0.0), 0.0),
                (HALFWAY, EXITANCE, (0.0, 1.0), 1.0),
            )
        ]

    def through(self) -> LawText:
        return LawText.of_share("separable", transmitted())

    def lengths(self, frame: Frame) -> Floats:
        """Return the stretches of the kernel (3,) [mm]."""
        alpha = frame.fixed_alpha
        if alpha is None:
            alpha = np.array([albedo_of(a, self.kernel.setting) for a in frame.mean_reflectance().tolist()])
        return self.kernel.stretches(alpha, frame.mfp)

"""Scattered light by samples of a law: technique of Liang et al., (22)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from profilefit.errors import InputError
from profilefit.laws.base import ProfileLaw
from profilefit.scenes.stage import pattern
from profilefit.scenes.stage.exact_law import NAME, ExactLaw
from profilefit.scenes.stage.renderer import Pass
from profilefit.scenes.stage.technique import EXITANCE, LAW, Frame, LawText, Technique, maps
from profilefit.shader.emit import law_text, prefix, text_beside

Law = ProfileLaw | ExactLaw


@dataclass(frozen=True, eq=False)
class Gather(Technique):
    """Technique by which each pixel samples radii of a law, whose source is compiled in."""

    law: LawText

    @classmethod
    def of(cls, law: Law) -> Gather:
        """Return samples of a law with a shader source, or of the exact half space."""
        if isinstance(law, ExactLaw):
            return cls(LawText(NAME, law.text(LAW), law.textures(LAW)))
        return cls(LawText(prefix(law), law_text(law, name=LAW)))

    def passes(self, frame: Frame) -> Sequence[Pass]:
        sampling = frame.sampling
        lattice = pattern.best(sampling.samples)
        uniforms = {
            **frame.camera,
            "mfp": tuple(frame.mfp),
            "fixed_alpha": frame.alpha_uniform,
            "samples": sampling.samples,
            "longest": max(range(3), key=lambda channel: (frame.mfp[channel], frame.alpha_uniform[channel])),
            "seed": sampling.seed,
            "generator": lattice.generator,
            # A channel's third of the points is no lattice: to be right in the mean, its shifts must go everywhere.
            "cell": (1.0, 0.0, 0.0, 1.0) if sampling.channels == "mixture" else tuple(lattice.cell.ravel()),
        }
        surface = maps("irradiance_map", "reflectance_map", "position_map", "normal_map")
        reads = {**surface, "noise_map": pattern.shifts(), **self.law.tables}
        switches = {
            "UNIFORM": sampling.kind == "uniform",
            "BLUE": sampling.kind == "importance blue",
            "MIXTURE": sampling.channels == "mixture",
            "AREA": sampling.area,
        }
        source = "".join(f"#define {name} {int(is_on)}\n" for name, is_on in switches.items())
        source += self.law.before(text_beside(__name__, "glsl/scatter.frag"))
        return [Pass(f"scatter {self.law.name}", reads, EXITANCE, source, uniforms)]

    def through(self) -> LawText:
        return self.law


def technique(by: Law | Technique) -> Technique:
    """Return a technique itself, or samples of a law; InputError on anything else."""
    if isinstance(by, Technique):
        return by
    if isinstance(by, Law):
        return Gather.of(by)
    raise InputError(f"law must be a profile law, an ExactLaw or a technique, got {by!r}")

"""Techniques: how light scatters in a picture, as passes over the screen between the G-buffer and the radiance.

Samples of a law are the technique of Liang et al., (22).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

from mcml_sim.media.arrays import Floats
from profilefit.errors import InputError
from profilefit.laws.base import ProfileLaw
from profilefit.scenes.stage import pattern
from profilefit.scenes.stage.exact_law import NAME, ExactLaw
from profilefit.scenes.stage.light.lighting import OtherLamp
from profilefit.scenes.stage.pattern import Sampling
from profilefit.scenes.stage.renderer import SUM, Pass, Read, text
from profilefit.scenes.stage.world import Part, Rgb, Scene, Singles, unit
from profilefit.shader.emit import law_text, prefix, text_beside

Law = ProfileLaw | ExactLaw
LAW = "law"  # the prefix of the law in every shader of the stage
EXITANCE, RADIANCE = "exitance_map", "radiance_map"
LAMP = "shadow.glsl", "lamp_combine.frag"
# How a pixel of the one half space takes its law: by its own A, or by a fixed albedo.
SHAPE = f"{LAW}_shape(fixed_alpha[c] < 0.0 ? {LAW}_alpha(surface[c]) : fixed_alpha[c])"
COLOUR = "surface[c]"


@dataclass(frozen=True)
class Frame:
    """Picture as far as it is known when its passes are made.

    size   columns and rows [pixels];  pixel  its side [mm], in perspective at a depth of 1 mm
    mfp    transport mean free path of red, green, blue (3,) [mm]
    fixed_alpha  reduced albedo (3,) [-]; None where a pixel's own A gives it
    mean_reflectance  function that returns the mean A (3,) where light scatters [-]
    scene  that is seen; None where buffers were uploaded
    lamps  beside the first
    """

    size: tuple[int, int]
    pixel: float
    is_perspective: bool
    sampling: Sampling
    mfp: Floats
    fixed_alpha: Floats | None
    mean_reflectance: Callable[[], Floats]
    scene: Scene | None = None
    lamps: tuple[OtherLamp, ...] = ()

    @property
    def alpha_uniform(self) -> tuple[float, ...]:
        """Value of `fixed_alpha` as shaders take it, in which a number below 0 stands for None."""
        return (-1.0,) * 3 if self.fixed_alpha is None else tuple(self.fixed_alpha)

    @property
    def camera(self) -> dict[str, Any]:
        """Uniforms of shaders that look for another place on the screen."""
        columns, rows = self.size
        return {"size": (float(columns), float(rows)), "pixel": self.pixel, "perspective": float(self.is_perspective)}

    @property
    def light(self) -> dict[str, Any]:
        """Uniforms of shaders that see the first lamp: none shines where there is no scene."""
        if self.scene is None:
            return {"toward_light": (0.0, 0.0, 1.0), "light": (0.0, 0.0, 0.0)}
        toward = self.scene.camera.view()[:3, :3] @ unit(self.scene.light.direction)
        return {"toward_light": tuple(toward), "light": self.scene.light.irradiance}


@dataclass(frozen=True)
class LawText:
    """Shader source of a law with the prefix `LAW`.

    text    GLSL;  tables  arrays that its samplers read, by their names
    shape   GLSL of the LAW_Shape of a pixel's channel, an expression of `surface`, the texel of reflectance_map (vec3),
            and of `c`, the channel (int)
    colour  GLSL of A there [-], an expression of both and of `shape`, the LAW_Shape

    `shape` and `colour` may also read the uniforms `fixed_alpha` and `mfp` (vec3), and are asked only where light
    scatters inside.
    """

    name: str
    text: str
    tables: Mapping[str, Singles] = field(default_factory=dict)
    shape: str = SHAPE
    colour: str = COLOUR

    @classmethod
    def of_share(cls, name: str, cumulated: str) -> LawText:
        """Return the source that `Technique.through` needs, of a share within x that no albedo changes: GLSL of x."""
        text = (
            f"struct {LAW}_Shape {{ float unused; }};\n"
            f"float {LAW}_alpha(float reflectance) {{ return reflectance; }}\n"
            f"{LAW}_Shape {LAW}_shape(float alpha) {{ {LAW}_Shape s; s.unused = alpha; return s; }}\n"
            f"float {LAW}_cumulated(float x, {LAW}_Shape s) {{ return {cumulated}; }}\n"
        )
        return cls(name, text)

    def before(self, shader: str) -> str:
        """Return a shader's source with the law before it, and SHAPE and COLOUR, by which it asks for both."""
        shape, colour = (" ".join(one.split()) for one in (self.shape, self.colour))  # a macro is one line
        macros = f"#define SHAPE(surface, c) ({shape})\n#define COLOUR(surface, c, shape) ({colour})\n"
        return f"{self.text}\n{macros}{shader}"


class Unwraps(Protocol):
    """Stage, as far as `Technique.before` needs it."""

    def unwrapping(self, part: Part, inset: tuple[float, float], has_sky: bool) -> Sequence[Pass]: ...


class Technique(ABC):
    """Way to scatter light, as passes."""

    def before(self, stage: Unwraps) -> None:  # noqa: B027, most draw nowhere else
        """Draw elsewhere, each time ahead of the passes."""

    @abstractmethod
    def passes(self, frame: Frame) -> Sequence[Pass]:
        """Return passes from the maps of the G-buffer to `EXITANCE`, which the last one writes."""

    @abstractmethod
    def through(self) -> LawText:
        """Return LAW_cumulated, the share of the light that a thin part keeps, and what its shape and colour call."""

    def lengths(self, frame: Frame) -> Floats:
        """Return the unit of LAW_cumulated's x, of red, green, blue (3,) [mm]."""
        return frame.mfp


class Lambert(Technique):
    """Light that comes out where it went in, and shines through nothing."""

    def passes(self, frame: Frame) -> Sequence[Pass]:
        reads = maps("irradiance_map", "reflectance_map", "position_map")
        return [Pass("lambert", reads, EXITANCE, text_beside(__name__, "glsl/lambert.frag"))]

    def through(self) -> LawText:
        return LawText.of_share("lambert", "1.0")


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


class NamedTechnique(NamedTuple):
    """Technique whose scattered light is judged, and what a stage takes with it.

    mfp  of red, green, blue [mm];  alpha  reduced albedos of the three [-]; None where each pixel's A gives them
    """

    label: str
    by: Technique
    mfp: Rgb
    alpha: Rgb | None = None


def combination(by: Technique, frame: Frame) -> list[Pass]:
    """Return passes from `EXITANCE` to `RADIANCE`; without a scene no light is mirrored or shines through."""
    law = by.through()
    uniforms = {
        "perspective": float(frame.is_perspective),
        "mfp": tuple(by.lengths(frame)),
        "fixed_alpha": frame.alpha_uniform,
        "f0": 0.0 if frame.scene is None else frame.scene.f0,
    }
    surface = {**maps("reflectance_map", "position_map", "normal_map"), **law.tables}
    first = {**surface, **maps("irradiance_map", EXITANCE)}
    source, other = (law.before(text("mirror.glsl", *one)) for one in (("combine.frag",), LAMP))
    passes = [Pass(f"combine {law.name}", first, RADIANCE, source, {**uniforms, **frame.light})]
    for lamp in frame.lamps:
        reads = {**surface, "shadow_map": lamp.shadow}
        passes.append(
            Pass(f"lamp {law.name}", reads, RADIANCE, other, {**uniforms, **lamp.uniforms}, kept=SUM),
        )
    return passes


def maps(*names: str) -> dict[str, Read]:
    """Return the reads of maps by samplers of their own names."""
    return {name: name for name in names}

"""Techniques: how light scatters in a picture, as passes over the screen between the G-buffer and the radiance."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

from mcml_sim.media.arrays import Floats
from profilefit.scenes.stage.buffers import Singles
from profilefit.scenes.stage.pattern import Sampling
from profilefit.scenes.stage.renderer import Pass, Read
from profilefit.scenes.stage.world import Part, Rgb, Scene, unit
from profilefit.shader.emit import text_beside

LAW = "law"  # the prefix of the law in every shader of the stage
EXITANCE, RADIANCE = "exitance_map", "radiance_map"
# How a pixel of the one half space takes its law: by its own A, or by a fixed albedo.
SHAPE = f"{LAW}_shape(fixed_alpha[c] < 0.0 ? {LAW}_alpha(surface[c]) : fixed_alpha[c])"
COLOUR = "surface[c]"


@dataclass(frozen=True)
class Frame:
    """Picture as far as it is known when its passes are made.

    size   columns and rows [pixels];  pixel  its side [mm], in perspective at a depth of 1 mm
    mfp    transport mean free path of red, green, blue (3,) [mm]
    fixed_alpha  reduced single-scattering albedo (3,) [-]; None where a pixel's own A gives it
    mean_reflectance  function that returns the mean A (3,) where light scatters [-]
    scene  that is seen; None where buffers were uploaded
    """

    size: tuple[int, int]
    pixel: float
    is_perspective: bool
    sampling: Sampling
    mfp: Floats
    fixed_alpha: Floats | None
    mean_reflectance: Callable[[], Floats]
    scene: Scene | None = None

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
        """Uniforms of shaders that see the light: none shines where there is no scene."""
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

    def before(self, shader: str) -> str:
        """Return a shader's source with the law before it, and SHAPE and COLOUR, by which it asks for both."""
        shape, colour = (" ".join(one.split()) for one in (self.shape, self.colour))  # a macro is one line
        macros = f"#define SHAPE(surface, c) ({shape})\n#define COLOUR(surface, c, shape) ({colour})\n"
        return f"{self.text}\n{macros}{shader}"


class Unwraps(Protocol):
    """Stage, as far as `Technique.before` needs it."""

    def unwrapping(self, part: Part, inset: tuple[float, float]) -> Pass: ...


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
        return LawText("lambert", through_text("1.0"))


class TechniquePair(NamedTuple):
    """Technique that is judged, the one that is shown, and what a stage takes with both.

    by     whose scattered light is held against the reference;  seen  that of the picture: `by`, or more than that
    mfp    of red, green, blue [mm];  alpha  reduced albedos of the three [-]; None where each pixel's A gives them
    """

    label: str
    by: Technique
    seen: Technique
    mfp: Rgb
    alpha: Rgb | None = None


def alone(label: str, by: Technique, mfp: Rgb, alpha: Rgb | None = None) -> TechniquePair:
    """Return the pair of a technique that is judged and shown."""
    return TechniquePair(label, by, by, mfp, alpha)


def combination(by: Technique, frame: Frame) -> Pass:
    """Return the pass from `EXITANCE` to `RADIANCE`; without a scene no light is mirrored or shines through."""
    law = by.through()
    uniforms = {
        "perspective": float(frame.is_perspective),
        "mfp": tuple(by.lengths(frame)),
        "fixed_alpha": frame.alpha_uniform,
        "f0": 0.0 if frame.scene is None else frame.scene.f0,
        **frame.light,
    }
    surface = maps("irradiance_map", "reflectance_map", "position_map", "normal_map", EXITANCE)
    source = law.before(text_beside(__name__, "glsl/combine.frag"))
    return Pass(f"combine {law.name}", {**surface, **law.tables}, RADIANCE, source, uniforms)


def maps(*names: str) -> dict[str, Read]:
    """Return the reads of maps by samplers of their own names."""
    return {name: name for name in names}


def through_text(cumulated: str) -> str:
    """Return the source that `Technique.through` needs, of a share within x that no albedo changes: GLSL of x."""
    return (
        f"struct {LAW}_Shape {{ float unused; }};\n"
        f"float {LAW}_alpha(float reflectance) {{ return reflectance; }}\n"
        f"{LAW}_Shape {LAW}_shape(float alpha) {{ {LAW}_Shape s; s.unused = alpha; return s; }}\n"
        f"float {LAW}_cumulated(float x, {LAW}_Shape s) {{ return {cumulated}; }}\n"
    )

"""Techniques: how light scatters in a picture, as passes over the screen between the G-buffer and the radiance.

A pass is a value: which maps it reads and writes, its shader and its uniforms. The stage compiles and runs it.
"""

from __future__ import annotations

import re
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import moderngl
import numpy as np
from numpy.typing import NDArray

from profilefit.errors import ShaderError
from profilefit.scenes.stage.buffers import Maps, Singles, float_texture
from profilefit.scenes.stage.pattern import Sampling
from profilefit.scenes.stage.world import Part, Scene, unit
from profilefit.shader.context import check_errors, full_screen, program
from profilefit.shader.emit import text_beside

Floats = NDArray[np.float64]
LAW = "law"  # the prefix of the law in every shader of the stage
EXITANCE, RADIANCE = "exitance_map", "radiance_map"
# How a pixel of the one half space takes its law: by its own A, or by a fixed albedo.
SHAPE = f"{LAW}_shape(fixed_alpha[c] < 0.0 ? {LAW}_alpha(surface[c]) : fixed_alpha[c])"
COLOUR = "surface[c]"
COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
UNIFORM = re.compile(r"\buniform\s+(?:(?:low|medium|high)p\s+)?\w+\s+([^;]+);")


@dataclass(frozen=True)
class Pass:
    """A fragment shader over the whole screen.

    reads     sampler -> the map of that name, an array (rows, columns, channels), or a texture of other targets
    writes    the map that it fills
    source    GLSL after its version line;  uniforms  values by name; every one of the source, and no other
    """

    name: str
    reads: Mapping[str, str | Singles | moderngl.Texture]
    writes: str
    source: str
    uniforms: Mapping[str, Any]


@dataclass(frozen=True)
class Frame:
    """What is known of a picture when its passes are made.

    size  [pixels];  pixel  its side [mm], in perspective at a depth of 1 mm
    mfp  of red, green, blue (3,) [mm];  fixed_alpha  (3,) [-]; None where a pixel's own A gives it
    mean_reflectance  () -> (3,) mean A where light scatters [-];  scene  what is seen; None where buffers were uploaded
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
        """`fixed_alpha` as shaders take it, in which a number below 0 stands for None."""
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
    """A law with the prefix `LAW`: its name, its GLSL, and the arrays that its samplers read, by their names.

    shape   GLSL of the LAW_Shape of a pixel's channel, an expression of `surface`, the texel of reflectance_map (vec3),
            and of `c`, the channel (int)
    colour  GLSL of A there [-], an expression of both and of `shape`, the LAW_Shape
    Both may also read the uniforms `fixed_alpha` and `mfp` (vec3), and are asked only where light scatters inside.
    """

    name: str
    text: str
    tables: Mapping[str, Singles] = field(default_factory=dict)
    shape: str = SHAPE
    colour: str = COLOUR

    def before(self, shader: str) -> str:
        """A shader's text with the law before it, and SHAPE and COLOUR, by which it asks for both."""
        shape, colour = (" ".join(one.split()) for one in (self.shape, self.colour))  # a macro is one line
        macros = f"#define SHAPE(surface, c) ({shape})\n#define COLOUR(surface, c, shape) ({colour})\n"
        return f"{self.text}\n{macros}{shader}"


class Unwraps(Protocol):
    """A stage, as far as `Technique.before` needs it."""

    def unwrap(self, part: Part, target: moderngl.Framebuffer, inset: tuple[float, float]) -> None: ...


class Technique(ABC):
    """A way to scatter light."""

    def before(self, stage: Unwraps) -> None:  # noqa: B027, most draw nowhere else
        """What it draws elsewhere, each time ahead of its passes."""

    @abstractmethod
    def passes(self, frame: Frame) -> Sequence[Pass]:
        """From the maps of the G-buffer to `EXITANCE`, which the last one writes."""

    @abstractmethod
    def through(self) -> LawText:
        """LAW_cumulated, the share of the light that a thin part keeps, and what its shape and colour call."""

    def lengths(self, frame: Frame) -> Floats:
        """The unit of LAW_cumulated's x, of red, green, blue (3,) [mm]."""
        return frame.mfp


class Lambert(Technique):
    """Light comes out where it went in, and shines through nothing."""

    def passes(self, frame: Frame) -> Sequence[Pass]:
        reads = maps("irradiance_map", "reflectance_map", "position_map")
        return [Pass("lambert", reads, EXITANCE, text_beside(__name__, "glsl/lambert.frag"), {})]

    def through(self) -> LawText:
        return LawText("lambert", through_text("1.0"))


def combination(by: Technique, frame: Frame) -> Pass:
    """From `EXITANCE` to `RADIANCE`. Without a scene there is no light to mirror or to shine through."""
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


def maps(*names: str) -> dict[str, str | Singles]:
    """Maps that are read by samplers of their own names."""
    return {name: name for name in names}


def through_text(cumulated: str) -> str:
    """What `Technique.through` needs, of a share within x that no albedo changes: an expression of x."""
    return (
        f"struct {LAW}_Shape {{ float unused; }};\n"
        f"float {LAW}_alpha(float reflectance) {{ return reflectance; }}\n"
        f"{LAW}_Shape {LAW}_shape(float alpha) {{ {LAW}_Shape s; s.unused = alpha; return s; }}\n"
        f"float {LAW}_cumulated(float x, {LAW}_Shape s) {{ return {cumulated}; }}\n"
    )


class ShaderProgram:
    """A compiled shader; `milliseconds` is how long that took."""

    def __init__(self, context: moderngl.Context, name: str, fragment: str, vertex: str | None = None):
        self.name, self._stands = name, uniforms_of(fragment + (vertex or ""))
        start = time.perf_counter()
        self.compiled = program(context, name, fragment, vertex)
        self.milliseconds = 1e3 * (time.perf_counter() - start)

    def assign(self, textures: Mapping[str, moderngl.Texture], values: Mapping[str, Any]) -> None:
        """Textures to units of their own, and uniforms by name; matrices are (4, 4) arrays, rows first.

        ShaderError, with its name, on a uniform of the source that gets no value, and on a value for none of them.
        """
        self._require_each({*textures, *values})
        for place, (name, texture) in enumerate(textures.items()):
            texture.use(place)
            self._write(name, place)
        for name, value in values.items():
            self._write(name, value)

    def release(self) -> None:
        self.compiled.release()

    def _require_each(self, given: set[str]) -> None:
        for names, what in (
            (given - self._stands, "is set, but stands nowhere in its source"),
            (self._stands - given, "stands in its source, but is never set"),
        ):
            if names:
                raise ShaderError(f"shader {self.name!r}: uniform {min(names)} {what}")

    def _write(self, name: str, value: Any) -> None:
        uniform = self.compiled.get(name, None)
        if not isinstance(uniform, moderngl.Uniform):
            return  # compiled away
        if isinstance(value, np.ndarray):
            uniform.write(np.ascontiguousarray(value.T, np.float32).tobytes())
        else:
            uniform.value = value


class FullScreen:
    """A pass, compiled. It is run with the values of each frame's own pass of the same source."""

    def __init__(self, context: moderngl.Context, one: Pass):
        self.context = context
        self.program = ShaderProgram(context, one.name, f"#version 330\n{one.source}")
        self._triangle = full_screen(context, self.program.compiled)
        self._tables: dict[str, tuple[Singles, moderngl.Texture]] = {}

    def run(self, one: Pass, targets: Maps) -> None:
        """Fill the map that the pass writes."""
        textures = {}
        for sampler, read in one.reads.items():
            if isinstance(read, np.ndarray):
                textures[sampler] = self._table(sampler, read)
            else:
                textures[sampler] = targets.map(read) if isinstance(read, str) else read
        self.program.assign(textures, one.uniforms)
        with self.context.scope(targets.into(one.writes), enable_only=moderngl.NOTHING):
            self._triangle.render(moderngl.TRIANGLES, vertices=3)
        check_errors(self.context, one.name)

    def release(self) -> None:
        self._triangle.release()
        self.program.release()
        for _, texture in self._tables.values():
            texture.release()

    def _table(self, sampler: str, array: Singles) -> moderngl.Texture:
        """The array as a texture, which is sent once for as long as it is the same array."""
        known = self._tables.get(sampler)
        if known is not None and known[0] is array:
            return known[1]
        if known is not None:
            known[1].release()
        rows, columns, channels = array.shape
        self._tables[sampler] = array, float_texture(self.context, (columns, rows), channels, array)
        return self._tables[sampler][1]


def uniforms_of(source: str) -> frozenset[str]:
    """The names of all uniforms that a shader's source declares, those in parts that are switched off included."""
    found = UNIFORM.findall(COMMENT.sub(" ", source))
    return frozenset(name.partition("[")[0].strip() for names in found for name in names.split(","))

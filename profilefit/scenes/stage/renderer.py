"""Passes as values, and the one renderer that compiles them and runs them over named maps."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Self

import moderngl
import numpy as np

from profilefit.errors import ShaderError
from profilefit.scenes.stage.world import Mesh, Singles
from profilefit.shader.context import check_errors, fragments, program, seconds
from profilefit.shader.emit import text_beside

VERSION = "#version 330\n"
POINTS, LINES, TRIANGLES = moderngl.POINTS, moderngl.LINES, moderngl.TRIANGLES
COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
UNIFORM = re.compile(r"\buniform\s+(?:(?:low|medium|high)p\s+)?\w+\s+([^;]+);")
# What a fragment does to those before it in its place: it replaces them, only if it is nearer, or is added to them.
REPLACE, NEAREST, SUM = "replace", "nearest", "sum"
FLAGS = {REPLACE: moderngl.NOTHING, NEAREST: moderngl.DEPTH_TEST, SUM: moderngl.BLEND}
# Numbers of a vertex, in the order of `Mesh.vertices`.
ATTRIBUTES = {"position": 3, "normal": 3, "uv": 2, "tangent": 4, "tint": 3}
ANISOTROPY = 8.0
MOST_SENT = 64  # arrays and meshes that stay on the GPU: of more, those are released that were used longest ago


class Smooth(NamedTuple):
    """Image (rows, columns, 3 or 4) that is read between its texels and at all levels of detail; u repeats, v may."""

    image: Singles
    repeats_v: bool = False


Read = str | Singles | Smooth | moderngl.Texture


@dataclass(frozen=True)
class Pass:
    """Draw of one shader into maps; by default of a fragment shader over all of them.

    name     of the shader, in messages and in `Renderer.compiled`
    reads    by sampler the name of a map, an array (rows, columns, channels), an image, or another renderer's map
    writes   the map that is filled, or several of one size
    source   GLSL of the fragments, without a version line
    uniforms values by name: every uniform of both sources, and no other. Matrices are (4, 4), rows first
    vertex   GLSL of the vertices, without a version line; by default a triangle that covers the maps, with `where` in
             [-1, 1]^2
    drawn    a mesh, whose vertices are attributes, or a number of vertices without attributes
    shape    `POINTS`, `LINES` or `TRIANGLES`;  kept  `REPLACE`, `NEAREST` or `SUM`
    clear    first channel of what the maps are filled with before, the others being 0; None keeps what they hold
    rows     the first row that is drawn, and the first one beyond; None draws all
    mipmaps  whether levels of detail are computed afterwards
    """

    name: str
    reads: Mapping[str, Read]
    writes: str | tuple[str, ...]
    source: str
    uniforms: Mapping[str, Any] = field(default_factory=dict)
    vertex: str | None = None
    drawn: Mesh | int = 3
    shape: int = TRIANGLES
    kept: str = REPLACE
    clear: float | None = None
    rows: tuple[int, int] | None = None
    mipmaps: bool = False


class GpuOwner(ABC):
    """Owner of things on the GPU, which it releases at the end of a `with`."""

    @abstractmethod
    def release(self) -> None:
        """Free all that it has on the GPU; the context is its owner's."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.release()


class Renderer(GpuOwner):
    """Float maps by name, and the shaders that fill them. Release it, or use it in a `with`."""

    def __init__(self, context: moderngl.Context, size: tuple[int, int]):
        """Take a context and the columns and rows of every map that `declare` does not state otherwise."""
        self.context, self.size = context, size
        self.compiled: list[str] = []  # names of shaders
        self._formats: dict[str, tuple[tuple[int, int], int]] = {}
        self._maps: dict[str, moderngl.Texture] = {}
        self._targets: dict[tuple[tuple[str, ...], bool], moderngl.Framebuffer] = {}
        self._shaders: dict[tuple[str, str | None], _Shader] = {}
        self._sent: dict[int, tuple[object, Any]] = {}  # the last is the one that was used last

    def declare(self, name: str, size: tuple[int, int], channels: int = 4) -> None:
        """State columns, rows and channels of a map; one that has other ones is made anew."""
        if self._formats.get(name) != (size, channels):
            self._formats[name] = size, channels
            for key in [key for key in self._targets if name in key[0]]:
                _release_target(self._targets.pop(key))
            if name in self._maps:
                self._maps.pop(name).release()

    def map(self, name: str) -> moderngl.Texture:
        """Return the texture of a name, made on first use."""
        if name not in self._maps:
            size, channels = self._formats.get(name, (self.size, 4))
            self._maps[name] = float_texture(self.context, size, channels)
        return self._maps[name]

    def read(self, name: str) -> Singles:
        """Return a copy (rows, columns, channels) of a map, row 0 at the bottom."""
        texture = self.map(name)
        columns, rows = texture.size
        return np.frombuffer(texture.read(), np.float32).reshape(rows, columns, texture.components).copy()

    def write(self, name: str, array: Any) -> None:
        """Fill a map with an array (rows, columns, channels), row 0 at the bottom."""
        self.map(name).write(np.ascontiguousarray(array, np.float32).tobytes())

    def clear(self, name: str) -> None:
        """Fill a map with 0."""
        self._target((name,), False).clear()

    def run(self, *passes: Pass) -> None:
        """Run passes, one after the other; each shader is compiled once, at its first pass."""
        for one in passes:
            self._run(one)

    def image(self, *passes: Pass) -> Singles:
        """Run passes, and return the map that the last one fills."""
        self.run(*passes)
        last = passes[-1].writes
        return self.read(last if isinstance(last, str) else last[0])

    def fragments(self, shader_pass: Pass) -> int:
        """Run a pass, and return the number of fragments that it draws."""
        return fragments(self.context, lambda: self._run(shader_pass))

    def time(self, *passes: Pass) -> float:
        """Run passes, and return their milliseconds."""
        return 1e3 * seconds(self.context, lambda: self.run(*passes))

    def release(self) -> None:
        for target in self._targets.values():
            _release_target(target)
        for one in (*self._maps.values(), *self._shaders.values(), *(sent for _, sent in self._sent.values())):
            one.release()
        for known in (self._targets, self._maps, self._shaders, self._sent):
            known.clear()

    def _run(self, one: Pass) -> None:
        shader = self._shader(one)
        target = self._target((one.writes,) if isinstance(one.writes, str) else one.writes, one.kept == NEAREST)
        if isinstance(one.drawn, int):
            array, count = shader.bare, one.drawn
        else:
            array, count = self._vertices(one.drawn).array(shader.program), -1
        shader.assign({sampler: self._texture(read) for sampler, read in one.reads.items()}, one.uniforms)
        first, last = one.rows or (0, target.height)
        target.scissor = 0, first, target.width, last - first
        with self.context.scope(target, enable_only=FLAGS[one.kept]):
            if one.kept == SUM:
                self.context.blend_func = moderngl.ONE, moderngl.ONE
            if one.clear is not None:
                target.clear(one.clear, depth=1.0)
            array.render(one.shape, vertices=count)
        if one.kept == SUM:
            self.context.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA  # moderngl's own
        if one.mipmaps and isinstance(one.writes, str):
            self.map(one.writes).build_mipmaps()
            self.map(one.writes).filter = moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR
        check_errors(self.context, one.name)

    def _shader(self, one: Pass) -> _Shader:
        key = one.source, one.vertex
        if key not in self._shaders:
            self._shaders[key] = _Shader(self.context, one)
            self.compiled.append(one.name)
        return self._shaders[key]

    def _target(self, names: tuple[str, ...], has_depth: bool) -> moderngl.Framebuffer:
        key = names, has_depth
        if key not in self._targets:
            textures = [self.map(name) for name in names]
            depth = self.context.depth_renderbuffer(textures[0].size) if has_depth else None
            self._targets[key] = self.context.framebuffer(textures, depth)
        return self._targets[key]

    def _texture(self, read: Read) -> moderngl.Texture:
        if isinstance(read, str):
            return self.map(read)
        if isinstance(read, moderngl.Texture):
            return read
        if isinstance(read, Smooth):
            return self._kept(read.image, lambda: _smooth_texture(self.context, read))
        rows, columns, channels = read.shape
        return self._kept(read, lambda: float_texture(self.context, (columns, rows), channels, read))

    def _vertices(self, mesh: Mesh) -> _Vertices:
        return self._kept(mesh, lambda: _Vertices(self.context, mesh))

    def _kept(self, key: object, make: Callable[[], Any]) -> Any:
        """Return what is on the GPU for an array or a mesh, which is sent once for as long as it is the same object."""
        known = self._sent.pop(id(key), None) or (key, make())
        self._sent[id(key)] = known
        if len(self._sent) > MOST_SENT:
            _, oldest = self._sent.pop(next(iter(self._sent)))
            oldest.release()
        return known[1]


class _Shader:
    """Compiled program of a pass, to be run with the values of each pass of the same sources."""

    def __init__(self, context: moderngl.Context, one: Pass):
        self.name, self._declared = one.name, uniforms_of(one.source + (one.vertex or ""))
        vertex = None if one.vertex is None else VERSION + one.vertex
        self.program = program(context, one.name, VERSION + one.source, vertex)
        self.bare = context.vertex_array(self.program, [])

    def assign(self, textures: Mapping[str, moderngl.Texture], values: Mapping[str, Any]) -> None:
        """Set textures, in units of their own, and uniforms; ShaderError where a value or a uniform lacks the other."""
        given = {*textures, *values}
        for names, what in (
            (given - self._declared, "is set, but stands nowhere in its source"),
            (self._declared - given, "stands in its source, but is never set"),
        ):
            if names:
                raise ShaderError(f"shader {self.name!r}: uniform {min(names)} {what}")
        for place, (name, texture) in enumerate(textures.items()):
            texture.use(place)
            self._write(name, place)
        for name, value in values.items():
            self._write(name, value)

    def release(self) -> None:
        self.bare.release()
        self.program.release()

    def _write(self, name: str, value: Any) -> None:
        uniform = self.program.get(name, None)
        if not isinstance(uniform, moderngl.Uniform):
            return  # compiled away
        if isinstance(value, np.ndarray):
            uniform.write(np.ascontiguousarray(value.T, np.float32).tobytes())
        else:
            uniform.value = value


class _Vertices:
    """Vertices and triangles of a mesh, and their binding to each shader that has drawn them."""

    def __init__(self, context: moderngl.Context, mesh: Mesh):
        self.context = context
        self._vertices = context.buffer(mesh.vertices().tobytes())
        self._triangles = context.buffer(mesh.triangles.astype("i4").tobytes())
        self._arrays: dict[moderngl.Program, moderngl.VertexArray] = {}

    def array(self, by: moderngl.Program) -> moderngl.VertexArray:
        if by not in self._arrays:
            used = [name for name in ATTRIBUTES if isinstance(by.get(name, None), moderngl.Attribute)]
            layout = " ".join(f"{count}{'f' if name in used else 'x4'}" for name, count in ATTRIBUTES.items())
            self._arrays[by] = self.context.vertex_array(by, [(self._vertices, layout, *used)], self._triangles)
        return self._arrays[by]

    def release(self) -> None:
        for array in self._arrays.values():
            array.release()
        self._vertices.release()
        self._triangles.release()


def float_texture(
    context: moderngl.Context, size: tuple[int, int], channels: int, array: Singles | None = None
) -> moderngl.Texture:
    """Return a float32 texture without a filter, of an array (rows, columns, channels) if one is given."""
    data = None if array is None else np.ascontiguousarray(array, np.float32).tobytes()
    texture = context.texture(size, channels, data, dtype="f4")
    texture.filter = moderngl.NEAREST, moderngl.NEAREST
    return texture


def _smooth_texture(context: moderngl.Context, read: Smooth) -> moderngl.Texture:
    rows, columns, channels = read.image.shape
    texture = float_texture(context, (columns, rows), channels, read.image)
    texture.repeat_y = read.repeats_v
    texture.build_mipmaps()
    texture.filter = moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR
    texture.anisotropy = ANISOTROPY
    return texture


def _release_target(target: moderngl.Framebuffer) -> None:
    if target.depth_attachment is not None:
        target.depth_attachment.release()
    target.release()


def uniforms_of(source: str) -> frozenset[str]:
    """Return the names of all uniforms that a shader declares, those in parts that are switched off included."""
    found = UNIFORM.findall(COMMENT.sub(" ", source))
    return frozenset(name.partition("[")[0].strip() for names in found for name in names.split(","))


def text(*files: str) -> str:
    """Return the sources of GLSL files of the stage, one after the other."""
    return "".join(text_beside(__name__, f"glsl/{file}") for file in files)

"""A law as its text runs on the GPU: many arguments at once, one a pixel, results as numbers.

Nothing of the law is computed here: fragment shaders call the text's own functions and write into float textures. What
they hold on the GPU is freed when nobody has them any more; what was bound before is bound again after each use.
"""

from __future__ import annotations

import re
import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcml_sim.media.arrays import Floats
from profilefit.laws.base import AlbedoLaw, ProfileLaw
from profilefit.shader import emit
from profilefit.shader.context import check_errors, full_screen, program, renderer

WIDTH, ROWS = 1024, 64  # of the textures; every OpenGL has more
# Extensions that let GLSL compute in half precision, each with the name that it gives the type.
HALF_TYPE = "float16_t"
HALF = ("GL_EXT_shader_explicit_arithmetic_types_float16", "GL_AMD_gpu_shader_half_float", "GL_NV_gpu_shader5")
NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d*(?:[eE][+-]?\d+)?|[eE][+-]?\d+)")
PROFILE = """#version 330
{head}
{text}
uniform sampler2D arguments; // r, xi, alpha, mfp
layout(location = 0) out vec4 found;
void main() {{
    vec4 q = texelFetch(arguments, ivec2(gl_FragCoord.xy), 0);
    {type} r = {type}(q.x); {type} xi = {type}(q.y); {type} alpha = {type}(q.z); {type} mfp = {type}(q.w);
    found = vec4({name}_profile(r, alpha, mfp), {name}_cdf(r, alpha, mfp),
        {name}_sample(xi, alpha, mfp), {name}_pdf(r, alpha, mfp));
}}
"""
MAP = """#version 330
{text}
uniform sampler2D arguments; // A, alpha, unused
layout(location = 0) out vec4 found;
void main() {{
    vec4 q = texelFetch(arguments, ivec2(gl_FragCoord.xy), 0);
    found = vec4({name}_alpha(q.x), {name}_map_reflectance(q.y), 0.0, 0.0);
}}
"""


@dataclass(frozen=True)
class Values:
    """Values of a law at broadcast arguments: profile [1/length^2], cdf [-], sample [length], pdf [1/length]."""

    profile: Floats
    cdf: Floats
    sample: Floats
    pdf: Floats


class ShaderLaw:
    """A profile law by its text, with the methods of `ProfileLaw` that measures of quality call.

    text     the law's own unless another one is given, with the names of the same prefix
    results  the type they are stored in, "f4" or "f2"; half whether to compute in half precision too
    ShaderError names the law, the line and what the driver says of it.
    """

    def __init__(
        self, context: moderngl.Context, law: ProfileLaw, text: str = "", results: str = "f4", half: bool = False
    ) -> None:
        self.law, self.setting, self.name = law, law.setting, emit.prefix(law)
        self.text = text or emit.law_text(law)
        given = in_half(self.text) if half else self.text
        head = f"#extension {half_extension(context)} : require" if half else ""
        kind = HALF_TYPE if half else "float"
        source = PROFILE.format(head=head, text=given, name=self.name, type=kind)
        self._pass = _Pass(context, self.name, source, results)

    @property
    def sampler(self) -> ShaderLaw:
        """Itself: `sample` is there."""
        return self

    def values(self, r: ArrayLike, xi: ArrayLike, alpha: ArrayLike, mfp: ArrayLike = 1.0) -> Values:
        """Evaluate all four functions at arguments that broadcast, each rounded to float32 first."""
        return Values(*self._pass(r, xi, alpha, mfp))

    def profile(self, r: ArrayLike, alpha: ArrayLike, mfp: ArrayLike = 1.0) -> Floats:
        """R_d(r) [1/length^2]."""
        return self.values(r, 0.5, alpha, mfp).profile

    def cdf(self, r: ArrayLike, alpha: ArrayLike, mfp: ArrayLike = 1.0) -> Floats:
        """Share of the reflected energy within r [-]."""
        return self.values(r, 0.5, alpha, mfp).cdf

    def sample(self, xi: ArrayLike, alpha: ArrayLike, mfp: ArrayLike = 1.0) -> Floats:
        """Radius [length] at xi."""
        return self.values(1.0, xi, alpha, mfp).sample


class ShaderMap:
    """A map between A and alpha by its text; `text` as for `ShaderLaw`."""

    def __init__(self, context: moderngl.Context, law: AlbedoLaw, text: str = "") -> None:
        self.law, self.setting, self.name = law, law.setting, emit.prefix(law)
        source = MAP.format(text=text or emit.map_text(law), name=self.name)
        self._pass = _Pass(context, f"{self.name} map", source, "f4")

    def alpha(self, reflectance: ArrayLike) -> Floats:
        """Reduced albedo alpha [-] at total reflectance A [-]."""
        return self._pass(reflectance, 0.5, 0.0, 0.0)[0]

    def reflectance(self, alpha: ArrayLike) -> Floats:
        """Total reflectance A [-] at alpha [-]."""
        return self._pass(0.5, alpha, 0.0, 0.0)[1]


class Board:
    """A float texture of four channels that shaders draw into; release it."""

    def __init__(self, context: moderngl.Context, size: tuple[int, int], dtype: str = "f4") -> None:
        self._context = context
        self._texture = context.texture(size, 4, dtype=dtype)
        self.frame = context.framebuffer(color_attachments=[self._texture])

    @contextmanager
    def bound(self) -> Iterator[None]:
        """Draw into it, and bind again what was. moderngl can make no framebuffer while a deleted one is bound."""
        scope = self._context.scope(self.frame, enable_only=moderngl.NOTHING)  # binds again what is bound now
        try:
            with scope:
                yield
        finally:
            scope.release()

    def release(self) -> None:
        self.frame.release()
        self._texture.release()


class _Pass:
    """One fragment shader over a texture of arguments, WIDTH x ROWS of them at a time."""

    def __init__(self, context: moderngl.Context, name: str, source: str, results: str) -> None:
        self._context, self._name, self._results = context, name, results
        self._program = program(context, name, source)
        self._triangle = full_screen(context, self._program)
        self._given = context.texture((WIDTH, ROWS), 4, dtype="f4")
        self._board = Board(context, (WIDTH, ROWS), results)
        for held in (self._board, self._given, self._program, self._triangle):  # the last of these is released first
            weakref.finalize(self, held.release).atexit = False  # then the context is gone, and all with it

    def __call__(self, *arguments: ArrayLike) -> list[Floats]:
        """Four results of four arguments that broadcast."""
        columns = np.broadcast_arrays(*(np.asarray(one, np.float32) for one in arguments))
        table = np.stack([column.ravel() for column in columns], axis=1)
        tiles = [table[first : first + WIDTH * ROWS] for first in range(0, table.shape[0], WIDTH * ROWS)]
        found = np.concatenate([self._drawn(tile) for tile in tiles]).astype(np.float64)
        return [found[:, i].reshape(columns[0].shape) for i in range(4)]

    def _drawn(self, arguments: NDArray[np.float32]) -> NDArray:
        count = arguments.shape[0]
        rows = -(-count // WIDTH)
        whole = np.pad(arguments, ((0, rows * WIDTH - count), (0, 0)), mode="edge")
        self._given.write(whole.tobytes(), viewport=(0, 0, WIDTH, rows))
        self._board.frame.viewport = (0, 0, WIDTH, rows)
        self._given.use(0)
        self._program["arguments"] = 0
        with self._board.bound():
            self._triangle.render(moderngl.TRIANGLES, vertices=3)
        raw = self._board.frame.read(viewport=(0, 0, WIDTH, rows), components=4, dtype=self._results)
        check_errors(self._context, f"shader {self._name!r}")
        return np.frombuffer(raw, self._results).reshape(-1, 4)[:count]


def half_extension(context: moderngl.Context) -> str:
    """Return the extension by which this driver computes in half precision, "" if it has none."""
    return next((name for name in HALF if name in context.extensions), "")


def no_half(context: moderngl.Context) -> str:
    """Return the line that reports that there is no arithmetic in half precision."""
    return f"float16 arithmetic: not offered by {renderer(context)}"


def in_half(text: str) -> str:
    """Return a shader source with every float and every number in half precision."""
    return re.sub(r"\bfloat\b", HALF_TYPE, NUMBER.sub(lambda found: f"{HALF_TYPE}({found.group()})", text))

"""A pass over every pixel of a target: textures and numbers in, one shader, an error if OpenGL has one."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import moderngl
import numpy as np

from profilefit.shader.context import check_errors, full_screen, program


class FullScreen:
    """A fragment shader with its program; `milliseconds` is how long it took to compile."""

    def __init__(self, context: moderngl.Context, name: str, fragment: str):
        self.context, self.name = context, name
        start = time.perf_counter()
        self.program = program(context, name, fragment)
        self.milliseconds = 1e3 * (time.perf_counter() - start)
        self._triangle = full_screen(context, self.program)

    def run(
        self, target: moderngl.Framebuffer, textures: Mapping[str, moderngl.Texture], values: Mapping[str, Any]
    ) -> None:
        """Fills the target; what the shader does not use of the values, by the names of its uniforms, is left out."""
        bind(self.program, textures)
        assign(self.program, values)
        with self.context.scope(target, enable_only=moderngl.NOTHING):
            self._triangle.render(moderngl.TRIANGLES, vertices=3)
        check_errors(self.context, self.name)

    def release(self) -> None:
        self._triangle.release()
        self.program.release()


def bind(shader: moderngl.Program, textures: Mapping[str, moderngl.Texture]) -> None:
    """Each texture to a unit of its own, and its number to the sampler of that name."""
    for unit, (name, texture) in enumerate(textures.items()):
        texture.use(unit)
        assign(shader, {name: unit})


def assign(shader: moderngl.Program, values: Mapping[str, Any]) -> None:
    """Uniforms by name; matrices are (4, 4) arrays as one writes them, rows first."""
    for name, value in values.items():
        uniform = shader.get(name, None)
        if not isinstance(uniform, moderngl.Uniform):
            continue  # compiled away
        if isinstance(value, np.ndarray):
            uniform.write(np.ascontiguousarray(value.T, np.float32).tobytes())
        else:
            uniform.value = value

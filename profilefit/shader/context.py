"""Headless OpenGL: a context without a window, programs whose errors can be read, and no silent OpenGL error."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import moderngl

from profilefit.errors import ShaderError

OPENGL = 330  # 3.3 core, of 2010: float targets, many of them at once, and nothing more is needed
# Through a window-less EGL on Linux; elsewhere what the system itself offers without a window.
BACKEND: dict[str, Any] = {"backend": "egl"} if sys.platform == "linux" else {}
PACKAGES = "libegl1 libgl1 libgl1-mesa-dri"  # Debian's: the libraries, and a software rasteriser behind them
FULL_SCREEN = """
out vec2 where;
void main() {
    where = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
    gl_Position = vec4(where, 0.0, 1.0);
}
"""
# Of the time that passed until OpenGL had finished. A driver that says less put work off beyond the query's end, as
# Mesa's llvmpipe does, and the clock on the wall is right.
TRUSTED = 0.5
LONGEST_QUERY = 4.0  # seconds: the query counts nanoseconds in 32 bits
# Where a driver names a line: "0:12(5): error" (Mesa), "0(12) : error" (NVIDIA), "ERROR: 0:12:" (Apple, ANGLE).
PLACE = re.compile(r"\b0[:(](\d+)")


def open_context() -> moderngl.Context:
    """Open a context that draws into textures. ShaderError, one line, where a library or a driver is missing."""
    try:
        return moderngl.create_context(standalone=True, require=OPENGL, **BACKEND)
    except Exception as error:  # glcontext and moderngl raise bare Exceptions
        library = re.search(r"lib[\w-]+\.so[.\d]*", str(error))
        what = f"{library.group()} is missing" if library else "no driver answers"
        needed = f"no OpenGL {OPENGL // 100}.{OPENGL // 10 % 10} without a window"
        raise ShaderError(f"{needed}: {what} ({str(error).strip()}); on Debian apt-get install {PACKAGES}") from None


@contextmanager
def opened() -> Iterator[moderngl.Context]:
    """Open a context for the length of a `with`. OpenGL draws into the context that was opened last: one at a time."""
    context = open_context()
    try:
        yield context
    finally:
        context.release()


def program(
    context: moderngl.Context, name: str, fragment: str, vertex: str | None = None, **more: Any
) -> moderngl.Program:
    """Compile a program; ShaderError with the shader's name, the offending line and the driver's message.

    vertex  by default a triangle over the whole target, with `where` in [-1, 1]^2, in the fragment's own version
    """
    vertex = vertex or fragment.partition("\n")[0] + FULL_SCREEN
    try:
        return context.program(vertex_shader=vertex, fragment_shader=fragment, **more)
    except moderngl.Error as error:
        message = str(error)
        source = vertex if "vertex_shader" in message else fragment
        raise ShaderError(_located(name, source, message)) from None


def full_screen(context: moderngl.Context, program: moderngl.Program) -> moderngl.VertexArray:
    """Return one triangle over the whole target: `.render(moderngl.TRIANGLES, vertices=3)`."""
    return context.vertex_array(program, [])


def check_errors(context: moderngl.Context, where: str) -> None:
    """Raise ShaderError if OpenGL has recorded an error; reading it clears it."""
    error = context.error
    if error != "GL_NO_ERROR":
        raise ShaderError(f"OpenGL error {error} in {where} ({renderer(context)})")


def seconds(context: moderngl.Context, work: Callable[[], object]) -> float:
    """Return the time of some work [s], by the driver's clock where it agrees with the one on the wall."""
    query = context.query(time=True)
    context.finish()
    start = time.perf_counter()
    with query:
        work()
    context.finish()
    wall = time.perf_counter() - start
    by_driver = float(query.elapsed) / 1e9
    return by_driver if by_driver > TRUSTED * wall and wall < LONGEST_QUERY else wall


def fragments(context: moderngl.Context, work: Callable[[], object]) -> int:
    """Return the number of fragments that some work draws."""
    query = context.query(samples=True)
    with query:
        work()
    return int(query.samples)


def renderer(context: moderngl.Context) -> str:
    """Return the device and its driver, in words."""
    return f"{context.info['GL_RENDERER']}, OpenGL {context.info['GL_VERSION']}"


def _located(name: str, source: str, message: str) -> str:
    said = message.strip().splitlines()
    located = next((line.strip() for line in said if PLACE.search(line)), said[-1])
    lines, number = source.splitlines(), PLACE.search(located)
    if number is None or not 0 < (line := int(number.group(1))) <= len(lines):
        return f"shader {name!r} does not compile: {located}"
    return f"shader {name!r} does not compile, line {line}, `{lines[line - 1].strip()}`: {located}"

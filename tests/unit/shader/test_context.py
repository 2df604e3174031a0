"""OpenGL without a window, and errors that can be read."""

import os
import subprocess
import sys

import moderngl
import numpy as np
import pytest

from profilefit.errors import ShaderError
from profilefit.shader.context import check_errors, full_screen, program, renderer

HALF = """#version 330
in vec2 where;
out vec4 colour;
void main() {
    colour = vec4(0.5 * where + 0.5, 0.25, 1.0);
}
"""


def test_one_triangle_covers_the_whole_target(context):
    drawn = program(context, "half", HALF)
    target = context.simple_framebuffer((4, 2), components=4, dtype="f4")
    target.use()
    full_screen(context, drawn).render(moderngl.TRIANGLES, vertices=3)
    pixels = np.frombuffer(target.read(components=4, dtype="f4"), np.float32).reshape(2, 4, 4)
    np.testing.assert_allclose(pixels[..., 0], [[0.125, 0.375, 0.625, 0.875]] * 2, rtol=1e-6)
    np.testing.assert_allclose(pixels[..., 1].T, [[0.25, 0.75]] * 4, rtol=1e-6)
    check_errors(context, "a test")


def test_a_broken_shader_is_told_by_name_line_and_message(context):
    with pytest.raises(ShaderError, match=r"shader 'half' does not compile, line 5, `colour = .*missing.*`: .*missing"):
        program(context, "half", HALF.replace("0.25", "missing"))
    with pytest.raises(ShaderError, match=r"shader 'half' does not compile, line 1, `#version 330 nonsense`"):
        program(context, "half", HALF, vertex="#version 330 nonsense\nvoid main() {}\n")


def test_an_opengl_error_is_told_once(context):
    texture = context.texture((2, 2), 1, dtype="f4")
    texture.bind_to_image(10_000)  # there are never so many units
    with pytest.raises(ShaderError, match=r"OpenGL error GL_INVALID_VALUE in a pass \(.+OpenGL \d"):
        check_errors(context, "a pass")
    check_errors(context, "the next one")
    texture.release()
    assert "OpenGL" in renderer(context)


@pytest.mark.skipif(sys.platform != "linux", reason="EGL is what Linux has")
@pytest.mark.parametrize(
    ("hide", "named"),
    [
        ({"__EGL_VENDOR_LIBRARY_DIRS": "/nonexistent"}, "no driver answers"),
        ({"GLCONTEXT_LINUX_LIBEGL": "libEGL-none.so"}, "libEGL-none.so is missing"),
    ],
)
def test_without_a_driver_or_a_library_one_line_says_so(hide, named):
    code = "from profilefit.shader.context import open_context\nopen_context()\n"
    ran = subprocess.run([sys.executable, "-c", code], env={**os.environ, **hide}, capture_output=True, text=True)
    told = ran.stderr.strip().splitlines()[-1]
    assert told.startswith("profilefit.errors.ShaderError: no OpenGL 3.3 without a window: ")
    assert named in told
    assert told.endswith("on Debian apt-get install libegl1 libgl1 libgl1-mesa-dri")

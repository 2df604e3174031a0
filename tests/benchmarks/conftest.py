"""What benchmarks that render need: an OpenGL context, or a skip that says why there is none."""

from collections.abc import Iterator

import moderngl
import pytest

from profilefit.errors import ShaderError
from profilefit.shader.context import open_context


@pytest.fixture
def opened() -> Iterator[moderngl.Context]:
    try:
        context = open_context()
    except ShaderError as error:
        pytest.skip(str(error))
    yield context
    context.release()

"""One headless OpenGL context for all tests of a process; an OpenGL error fails the test that made it."""

import pytest

from profilefit.errors import ShaderError
from profilefit.shader import context as opened


@pytest.fixture(scope="session")
def shared_context():
    try:
        context = opened.open_context()
    except ShaderError as error:
        pytest.skip(str(error))
    yield context
    context.release()


@pytest.fixture
def context(shared_context):
    with shared_context:  # another test of this process may have opened one of its own
        yield shared_context
        assert shared_context.error == "GL_NO_ERROR"

"""A command as a user gives it, and the OpenGL that some need."""

import sys

import pytest

from profilefit.cli import main
from profilefit.errors import ShaderError
from profilefit.shader.context import open_context


@pytest.fixture(scope="module")
def opengl():
    """Skips where there is none, by the name of what is missing."""
    try:
        open_context().release()
    except ShaderError as error:
        pytest.skip(str(error))


@pytest.fixture
def command(monkeypatch, capsys, tmp_path):
    """Run `profilefit WORDS` in an empty folder; the exit status and what it printed on stdout and stderr."""
    monkeypatch.chdir(tmp_path)

    def run(*words: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["profilefit", *words])
        with pytest.raises(SystemExit) as stop:
            main()
        printed = capsys.readouterr()
        return int(stop.value.code or 0), printed.out, printed.err

    return run

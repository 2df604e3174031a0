"""A command as a user gives it, what it refuses in one line, Ctrl-C, and the OpenGL that some need."""

import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest

import mcml_sim.cli.app
import profilefit.cli
from profilefit.errors import ShaderError
from profilefit.shader.context import open_context
from tests.fixtures import EXAMPLES

MAINS = {"profilefit": profilefit.cli.main, "mcml-sim": mcml_sim.cli.app.main}


@pytest.fixture(scope="module")
def opengl():
    """Skips where there is none, by the name of what is missing."""
    try:
        open_context().release()
    except ShaderError as error:
        pytest.skip(str(error))


@pytest.fixture
def program(monkeypatch, capsys, tmp_path):
    """Run `PROGRAM WORDS` in an empty folder; the exit status and what it printed on stdout and stderr."""
    monkeypatch.chdir(tmp_path)

    def run(name: str, *words: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", [name, *map(str, words)])
        with pytest.raises(SystemExit) as stop:
            MAINS[name]()
        return int(stop.value.code or 0), *capsys.readouterr()

    return run


@pytest.fixture
def command(program):
    return partial(program, "profilefit")


@pytest.fixture
def done(command):
    """Run WORDS, which must end with status 0 and `said` on stderr (None: anything); what is printed."""

    def run(*words: object, said: str | None = "") -> str:
        status, out, err = command(*words)
        assert (status, err if said is None else said) == (0, err), err
        return out

    return run


@pytest.fixture
def refused(command):
    """Run WORDS, between spaces; they must be refused in one line that has `said` in it, which is returned.

    A word that is the name of an example is that file, unless there is one here.
    """

    def run(words: str | tuple[str, ...], said: str) -> str:
        words = words.split(" ") if isinstance(words, str) else words
        status, out, err = command(*(word if os.path.lexists(word) else EXAMPLES.get(word, word) for word in words))
        assert (status, out, err.count("\n")) == (2, "", 1), err
        assert said in err
        return err

    return run


def started(package: str, *words: object, cwd: Path, **streams) -> subprocess.Popen:
    """The command in a process of its own, with the handler of Ctrl-C that a shell's background jobs lack."""
    code = "import runpy, signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    code += f"runpy.run_module({package!r}, run_name='__main__', alter_sys=True)"
    return subprocess.Popen([sys.executable, "-c", code, *map(str, words)], cwd=cwd, text=True, **streams)


def interrupted(package: str, *words: object, cwd: Path, once: str) -> tuple[int, str, str]:
    """Press Ctrl-C once there is a file of this pattern; the exit status and what was printed on stdout and stderr."""
    with started(package, *words, cwd=cwd, stdout=-1, stderr=-1) as run:
        end = time.monotonic() + 120
        while not list(cwd.glob(once)) and run.poll() is None and time.monotonic() < end:
            time.sleep(0.1)
        run.send_signal(signal.SIGINT)
        try:
            out, err = run.communicate(timeout=120)
        finally:
            run.kill()
    return run.returncode, out, err

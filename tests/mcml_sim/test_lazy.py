"""Names that are imported when they are asked for are the ones that are promised."""

import ast
import importlib
import subprocess
import sys
from pathlib import Path

import pytest

import mcml_sim
import profilefit
from mcml_sim.cli.lazy import attributes, carried_out


@pytest.mark.parametrize("package", [mcml_sim, profilefit])
def test_every_name_is_there_and_is_the_one_that_is_typed(package):
    """What type checkers are told is what `__getattr__` gives."""
    (branch,) = [one for one in ast.parse(Path(package.__file__).read_text()).body if isinstance(one, ast.If)]
    homes = {alias.name: one.module for one in branch.body for alias in one.names}
    assert set(homes) <= set(package.__all__) <= set(dir(package))
    for name in package.__all__:
        assert getattr(package, name) is not None
    for name, home in homes.items():
        there = importlib.import_module(home)
        assert getattr(package, name) is getattr(there, name)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match=r"module 'profilefit' has no attribute 'nothing'"):
        profilefit.nothing  # noqa: B018
    with pytest.raises(AttributeError, match=r"module 'a' has no attribute 'b'"):
        attributes("a", {})("b")


def test_a_subcommand_is_done_by_the_function_of_its_name():
    def sqrt(x: float) -> None:
        """Of x."""

    done = carried_out("math")(sqrt)
    assert (done.__name__, done.__doc__) == ("sqrt", "Of x.")
    with pytest.raises(TypeError, match="keyword"):
        done(x=4.0)  # math.sqrt itself is asked, which takes no keywords


INTERRUPTED = """
import runpy, signal, sys

_, imported, package, *words = sys.argv

class Interrupting:
    def find_spec(self, name, path=None, target=None):
        if name == imported:
            sys.meta_path.remove(self)
            signal.raise_signal(signal.SIGINT)

signal.signal(signal.SIGINT, signal.default_int_handler)
sys.meta_path.insert(0, Interrupting())
sys.argv[1:] = words
runpy.run_module(package, run_name="__main__")
"""


@pytest.mark.parametrize(
    ("imported", "package", "words"),
    [
        ("typer", "profilefit", ("--help",)),
        ("typer", "mcml_sim", ("--help",)),
        ("profilefit.convert", "profilefit", ("convert", "--alpha", ".5", "--mfp", "1")),
    ],
)
def test_ctrl_c_among_the_imports_of_a_command_is_one_line(imported, package, words, tmp_path):
    """The first of a command's imports, and one of what a subcommand does."""
    run = subprocess.run(
        [sys.executable, "-c", INTERRUPTED, imported, package, *words],
        cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip
    assert (run.returncode, run.stdout, run.stderr) == (130, "", f"{package.replace('_', '-')}: stopped\n")

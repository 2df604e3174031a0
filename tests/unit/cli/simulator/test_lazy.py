"""Names that are imported when they are asked for are the ones that are promised."""

import ast
import importlib
import subprocess
import sys
from pathlib import Path

import pytest

import mcml_sim
import profilefit
import profilefit.fitting
import profilefit.measured
import profilefit.report
import profilefit.scenes
import profilefit.scenes.layers
import profilefit.shader
import profilefit.studies
from mcml_sim.cli.lazy import attributes

FACES = (
    mcml_sim,
    profilefit,
    profilefit.fitting,
    profilefit.measured,
    profilefit.report,
    profilefit.scenes,
    profilefit.scenes.layers,
    profilefit.shader,
    profilefit.studies,
)


@pytest.mark.parametrize("package", FACES, ids=lambda package: package.__name__)
def test_every_name_is_there_and_is_the_one_that_is_typed(package):
    """What type checkers are told is what `__getattr__` gives."""
    (branch,) = [one for one in ast.parse(Path(package.__file__).read_text()).body if isinstance(one, ast.If)]
    homes = {alias.name: one.module for one in branch.body for alias in one.names}
    assert set(homes) <= set(package.__all__)
    for name in package.__all__:
        assert getattr(package, name) is not None
    for name, home in homes.items():
        there = importlib.import_module(home)
        assert getattr(package, name) is getattr(there, name)


@pytest.mark.parametrize("package", [mcml_sim, profilefit])
def test_an_interactive_shell_completes_names_that_nobody_has_asked_for(package):
    assert set(package.__all__) <= set(dir(package))


@pytest.mark.parametrize("package", FACES, ids=lambda package: package.__name__)
def test_no_module_has_the_name_of_what_is_exported_beside_it(package):
    """It would stand in the place of the function as soon as anybody imports it."""
    beside = {path.stem for path in Path(package.__file__).parent.iterdir()}
    assert beside & set(package.__all__) <= {"exact", "fur", "heart", "layers", "scenes", "sea"}, (
        "which are modules themselves"
    )


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match=r"module 'profilefit' has no attribute 'nothing'"):
        profilefit.nothing  # noqa: B018
    with pytest.raises(AttributeError, match=r"module 'a' has no attribute 'b'"):
        attributes("a", {})("b")


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


@pytest.mark.slow
@pytest.mark.parametrize(
    ("imported", "package", "words"),
    [
        ("typer", "profilefit", ("--help",)),
        ("typer", "mcml_sim", ("--help",)),
        ("numpy", "profilefit", ("convert", "--alpha", ".5", "--mfp", "1")),
        ("profilefit.convert", "profilefit", ("convert", "--alpha", ".5", "--mfp", "1")),
        ("profilefit.shader.emit", "profilefit", ("export", "hazard")),
        ("mcml_sim.tracing", "mcml_sim", ("run", "none.mci")),
    ],
)
def test_ctrl_c_among_the_imports_of_a_command_is_one_line(imported, package, words, tmp_path):
    """The first of a command's imports, and one of what a subcommand does."""
    run = subprocess.run(
        [sys.executable, "-c", INTERRUPTED, imported, package, *words],
        cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip
    assert (run.returncode, run.stdout, run.stderr) == (130, "", f"{package.replace('_', '-')}: stopped\n")

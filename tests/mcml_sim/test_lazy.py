"""Names that are imported when they are asked for are the ones that are promised."""

import ast
import importlib
from pathlib import Path

import pytest

import mcml_sim
import profilefit
from mcml_sim.lazy import attributes, carried_out


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

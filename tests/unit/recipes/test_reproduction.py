"""A record made again beside the shipped one: equal within its own errors, and told where it is not."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from profilefit.recipes.folder import fits_folder
from profilefit.recipes.regenerate import compared, reproduction, stated_error
from tests.fixtures import slow

NAMES = {"burley-whole": 4, "albedo-liang": 3}  # constants; the second is of traced light


@pytest.fixture(scope="module", params=["burley-whole", *slow("albedo-liang")])
def made(tmp_path_factory, request):
    """A small record made again, by the command, optimised as for users: others' arithmetic takes twice as long."""
    folder = tmp_path_factory.mktemp("made")
    words = [sys.executable, "-m", "profilefit", "regenerate", request.param, "--out", str(folder)]
    done = subprocess.run(words, capture_output=True, text=True, check=True, env={**os.environ, "XLA_FLAGS": ""})
    assert "1 of 1 records reproduced; largest move" in done.stderr
    return folder / f"{request.param}.json"


def test_a_small_record_is_reproduced(made):
    found = reproduction(made, made.stem)
    assert found.is_reproduced
    assert found.constants == NAMES[made.stem]
    # Processors and the order of sums move a constant by 1e-5 of itself at most: its error is a hundredth of it.
    assert found.moved < 1e-3
    assert found.relative < 1e-5
    assert found.intervals < 1.0


@pytest.mark.parametrize(("share", "passes"), [(0.04, True), (0.06, False)])
def test_a_constant_that_moves_by_a_twentieth_of_its_error_is_not_reproduced(made, tmp_path, share, passes):
    """The negative control: the record that was made, one constant moved."""
    for ending in ("json", "npz"):
        shutil.copy(made.with_suffix(f".{ending}"), tmp_path)
    path = tmp_path / made.name
    content = json.loads(path.read_text())
    name, one = next((name, one) for name, one in content["constants"].items() if one["free"])
    one["regenerated"] += share * stated_error(one)
    path.write_text(json.dumps(content))
    found = reproduction(path, made.stem)
    assert found.is_reproduced is passes
    assert found.moved == pytest.approx(share, abs=0.005)
    assert passes or f"{name} moved by 0.06 of its stated error" in found.problem


def content(value=1.0, error=0.1, **more):
    return {"constants": {"a": {"regenerated": value, "model_error": error, **more}}, "fit": {"result": "converged"}}


def test_a_constant_that_was_not_fitted_must_be_equal():
    same = compared("one", content(error=None), content(error=None), {}, {})
    assert same.is_reproduced
    moved = compared("one", content(error=None), content(1 + 1e-10, error=None), {}, {})
    assert "a was not fitted and is" in moved.problem


def test_a_fit_that_fails_is_not_reproduced():
    other = {**content(), "fit": {"result": "degenerate"}}
    assert "'degenerate' in place of 'converged'" in compared("one", content(), other, {}, {}).problem


def of_chain(draws):
    levels = {"68%": np.quantile(draws, (0.16, 0.84)).tolist(), "95%": np.quantile(draws, (0.025, 0.975)).tolist()}
    return content(intervals={"misfit": levels}), {"misfit": draws[:, None]}


def test_intervals_of_two_right_chains_agree_and_of_a_shifted_one_do_not():
    """A thousand independent draws each: the allowance holds four ends at once, so 1 pair in 1000 may fail."""
    random = np.random.default_rng(5)
    found = []
    for _ in range(200):
        (one, draws), (other, again) = (of_chain(random.standard_normal(1000)) for _ in range(2))
        found.append(compared("one", one, other, draws, again).intervals)
    assert np.mean(np.array(found) > 1.0) <= 0.01
    assert np.median(found) > 0.2  # the allowance is no wider than the noise asks for
    (one, draws), (other, again) = of_chain(random.standard_normal(1000)), of_chain(random.standard_normal(1000) + 0.4)
    assert "the interval of a, misfit" in compared("one", one, other, draws, again).problem


def test_a_chain_that_is_missing_is_named():
    one, draws = of_chain(np.random.default_rng(5).standard_normal(1000))
    assert "the chain of misfit is in one record only" in compared("one", one, content(), draws, {}).problem


def test_records_of_other_photons_are_not_compared(made, tmp_path):
    path, name = Path(shutil.copy(made, tmp_path)), made.stem
    content = json.loads(path.read_text())
    content["seed"] += 1
    path.write_text(json.dumps(content))
    assert reproduction(path, name) is None
    assert reproduction(path, "nothing-of-this-name") is None
    assert reproduction(fits_folder() / made.name, name) is None

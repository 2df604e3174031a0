"""Running recipes: checks before, what is traced, the order of records; and records made again, compared."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mcml_sim import Setting
from profilefit.errors import RecipeError
from profilefit.recipes import recipe
from profilefit.recipes.folder import fits_folder
from profilefit.recipes.kinds import KINDS, albedo_map, law
from profilefit.recipes.regenerate import compared, regenerate, reproduction, requests_of, stated_error
from profilefit.recipes.run import PHOTONS, REFRACTED_PHOTONS, RecipeRun
from tests.fixtures import slow

FITS = fits_folder()


def test_recipes_are_checked_before_any_photon_is_traced(tmp_path):
    bad = tmp_path / "bad.toml"
    bad.write_text((FITS / "liang-whole.toml").read_text().replace('"corrected"', '"improved"'))
    said: list[str] = []
    run = RecipeRun("quick", 0, tmp_path / "out", tmp_path / "store", 1000, said.append, False)
    with pytest.raises(RecipeError, match="start must be one of published, corrected, got 'improved'"):
        regenerate(requests_of(["albedo-liang", str(bad)]), run)
    assert not said
    assert not Path(tmp_path / "store").exists()


def of_recipes(*recipes):
    by_key = {kind.key: kind for kind in KINDS}
    return [(by_key["albedo_map" if one.pipeline == "albedo" else "law"], one) for one in recipes]


def test_each_setting_is_traced_once_and_only_if_a_recipe_needs_it(monkeypatch, tmp_path):
    made = []

    def pipeline(chosen, run, light):
        made.append((chosen.name, light and light.setting))
        return {"constants": {}}, {}

    said: list[str] = []
    run = RecipeRun("quick", 0, tmp_path / "out", None, 1000, said.append, False)
    refracted, diffuse = Setting(n=1.4), Setting("diffuse")
    profile = recipe.find("burley-whole", FITS)
    exactly = recipe.find("albedo-rational", FITS).changed(check="")
    recipes = (
        profile.changed("profile-n1.4.toml", setting_table={"n": 1.4}),
        profile.changed("profile-diffuse.toml", truth="exact", setting_table={"illumination": "diffuse"}),
        exactly.changed("albedo-n1.4.toml", truth="orders", setting_table={"n": 1.4}),
        exactly,
        exactly.changed("checked.toml", setting_table={"illumination": "diffuse"}, check="orders"),
    )
    monkeypatch.setitem(albedo_map.PIPELINES, "albedo", pipeline)
    monkeypatch.setitem(law.PIPELINES, "profile", pipeline)
    written = regenerate(of_recipes(*recipes), run)
    assert [line for line in said if "photons:" in line] == [f"1e+03 photons: {one}" for one in (refracted, diffuse)]
    maps = [("albedo-n1.4", refracted), ("albedo-rational", None), ("checked", diffuse)]
    assert made == [*maps, ("profile-n1.4", refracted), ("profile-diffuse", None)]
    names = [name for name, _ in made]
    assert [step.name for step in written] == [f"photons: {refracted}", f"photons: {diffuse}", *names]
    assert [step.path.stem for step in written[2:]] == names
    assert [line.split(":")[0] for line in said[2:]] == names


@pytest.mark.slow
def test_records_are_the_same_bytes_whatever_the_processes(tmp_path):
    """Maps, a fit to photons, and what compares the records of all."""
    names = ("albedo-liang", "albedo-rational", "burley-whole", "reproduction")
    requests = requests_of(names)
    for processes in (1, 2, 3):
        run = RecipeRun("quick", 5, tmp_path / str(processes), tmp_path / "store", 200_000, lambda _: None, False)
        steps = regenerate(requests, run, processes=processes)
        assert all(step.seconds > 0 for step in steps)
        assert {step.path.stem for step in steps if step.path} == set(names)
    one, *others = [{p.name: p.read_bytes() for p in tmp_path.glob(f"{processes}/*.*")} for processes in (1, 2, 3)]
    assert len(one) == 7  # what compares records has no arrays
    assert others == [one, one]


# Photons of each setting

SETTINGS = {Setting(): "", Setting("diffuse"): "diffuse"}
SETTINGS |= {Setting(n=1.4): "n1.4", Setting("diffuse", n=1.4): "diffuse-n1.4"}


@pytest.mark.slow
def test_every_setting_has_its_own_store_and_resumes(tmp_path):
    run = RecipeRun("quick", 3, tmp_path / "out", tmp_path / "photons", 2000, progress=False)
    for setting, folder in SETTINGS.items():
        light = run.light(setting)
        assert (light.setting, light.photons, light.seed) == (setting, 2000, 3)
        batches = sorted((run.store / folder).glob("batch-*"))
        assert len(batches) == 1
        before = batches[0].stat().st_mtime_ns
        assert np.array_equal(run.part().light(setting).counts.exits, light.counts.exits)
        assert batches[0].stat().st_mtime_ns == before
    assert len(list(run.store.rglob("batch-*"))) == len(SETTINGS)


def test_presets_give_surfaces_that_refract_fewer_photons(tmp_path):
    for preset in ("quick", "full"):
        traced = [RecipeRun(preset, 0, tmp_path, None, None, print).number(setting) for setting in SETTINGS]
        assert traced == [PHOTONS[preset]] * 2 + [REFRACTED_PHOTONS[preset]] * 2
        assert REFRACTED_PHOTONS[preset] < PHOTONS[preset]
    assert RecipeRun("full", 0, tmp_path, None, 7, print).number(Setting(n=1.4)) == 7


# Records made again beside the shipped ones

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
    assert (found.is_reproduced, found.constants) == (True, NAMES[made.stem])
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


def problem(shipped, other, chains=(), others=()):
    return compared("one", shipped, other, dict(chains), dict(others)).problem


def test_what_is_not_reproduced_is_named():
    """A constant that was not fitted must be equal."""
    assert compared("one", content(error=None), content(error=None), {}, {}).is_reproduced
    assert "a was not fitted and is" in problem(content(error=None), content(1 + 1e-10, error=None))
    assert "'degenerate' in place of 'converged'" in problem(content(), {**content(), "fit": {"result": "degenerate"}})
    one, draws = of_chain(np.random.default_rng(5).standard_normal(1000))
    assert "the chain of misfit is in one record only" in problem(one, content(), draws)


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
    assert "the interval of a, misfit" in problem(one, other, draws, again)


def test_records_of_other_photons_are_not_compared(made, tmp_path):
    path, name = Path(shutil.copy(made, tmp_path)), made.stem
    content = json.loads(path.read_text())
    content["seed"] += 1
    path.write_text(json.dumps(content))
    assert reproduction(path, name) is None
    assert reproduction(path, "nothing-of-this-name") is None
    assert reproduction(fits_folder() / made.name, name) is None

"""Running recipes: what is checked before it starts, what is traced, and in which order records are made."""

from pathlib import Path

import pytest

from mcml_sim import Setting
from profilefit.errors import RecipeError
from profilefit.recipes import catalogue, recipe
from profilefit.recipes.kinds import KINDS, albedo_map, law
from profilefit.recipes.regenerate import regenerate, requests_of
from profilefit.recipes.run import RecipeRun

FITS = catalogue.fits_folder()


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
    assert made == [
        ("albedo-n1.4", refracted),
        ("albedo-rational", None),
        ("checked", diffuse),
        ("profile-n1.4", refracted),
        ("profile-diffuse", None),
    ]
    assert [step.name for step in written] == [
        f"photons: {refracted}",
        f"photons: {diffuse}",
        *(name for name, _ in made),
    ]
    assert [step.path.stem for step in written[2:]] == [name for name, _ in made]
    assert [line.split(":")[0] for line in said[2:]] == [name for name, _ in made]


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

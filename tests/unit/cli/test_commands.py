"""The command line as a user meets it: what it writes, what it refuses, and in how many lines."""

import json
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from mcml_sim import Setting
from profilefit.errors import InputError
from profilefit.recipes import catalogue
from profilefit.recipes.folder import fits_folder
from tests.unit.cli.conftest import interrupted

RECIPE = """
title = "A small one"
law = "liang"
equations = "(8)"
pipeline = "albedo"
truth = "orders"

[albedos]
low = 0.1
high = 0.9
count = 9

[weighting]
objective = "albedo"
"""


@pytest.fixture
def recipe(tmp_path) -> Path:
    path = tmp_path / "small.toml"
    path.write_text(RECIPE)
    return path


def small(recipe: Path, out: str = "out", *more: str) -> tuple[str, ...]:
    return ("regenerate", str(recipe), "--out", out, "--photons", "20000", *more)


@pytest.mark.parametrize(
    "words",
    [
        *("fit phantom.csv --out out", "fit petzold --kind phase --out out", "photo --simulate photo.toml --out out"),
        *("report hazard --html page.html", "report hazard --figures out", "regenerate burley-whole --out out"),
        *("check hazard --out out", "stability liang --out out", "tradeoff laws --out out", "scene sea.toml --out out"),
    ],
)
def test_a_full_disk_is_met_before_the_work(refused, monkeypatch, tmp_path, words):
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(total=10**12, free=10**6))
    refused(words, "No space left on device: 1.0 MB are free, ")
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


@pytest.mark.slow
def test_regenerate_writes_a_record_that_loads(done, recipe):
    out = done(*small(recipe, "out", "--json", "--quiet"))
    content = json.loads(Path("out/small.json").read_text())
    assert content["truth"]["photons"] == 20000
    assert content["fit"]["result"] == "converged"
    law = catalogue.albedo_law("liang", constants="out/small.json")
    assert law.p == pytest.approx(content["constants"]["p"]["regenerated"])
    assert content["posterior"]["statistical"]["result"] == "converged"
    told = json.loads(out)["small"]
    assert (told["path"], told["result"]) == ("out/small.json", "converged")
    kept = content["constants"]["p"]
    assert told["constants"]["p"] == {key: kept[key] for key in told["constants"]["p"]}
    assert told["constants"]["p"]["statistical_error"] > 0
    assert told["worst"]["delta_A"]["regenerated"] == content["quality"]["regenerated"]["delta_A"]


@pytest.mark.slow
def test_a_surface_that_refracts_gets_its_own_record(command, tmp_path):
    """A recipe's table [setting] says which; the record is found by the name that goes with it."""
    path = tmp_path / "albedo-rational-n1.45.toml"
    text = RECIPE.replace('pipeline = "albedo"\n', 'pipeline = "albedo"\nrandom_starts = 3\n')
    for old, new in ('"liang"', '"rational"'), ("= 9", "= 5"), ('tive = "albedo"', 'tive = "reflectance"'):
        text = text.replace(old, new)
    path.write_text(f"{text}\n[setting]\nn = 1.45\n")
    status, _, err = command(*small(path))
    assert status == 0, err
    assert "2e+04 photons: searchlight, n = 1.45, g = 0" in err
    assert err.count("photons:") == 1
    content = json.loads(Path("out/albedo-rational-n1.45.json").read_text())
    assert content["setting"] == {"illumination": "searchlight", "n": 1.45, "g": 0.0}
    assert content["starts"]["count"] == 3
    assert 0 < content["quality"]["regenerated"]["delta_A"] < 0.01  # from exact light: 20 000 photons, five albedos
    assert list(Path("out/.photons/seed-1/n1.45").glob("batch-*"))
    law = catalogue.albedo_law("rational", setting=Setting(n=1.45), folder=Path("out"))
    assert law.reflectance(1.0) == pytest.approx(4 * 1.45 / 2.45**2)
    assert command("report", "--fits", "out")[0] == 0


@pytest.mark.slow
def test_one_seed_gives_identical_records_and_another_does_not(command, recipe):
    for out, seed in (("a", "3"), ("b", "3"), ("c", "4")):
        assert command(*small(recipe, out, "--seed", seed))[0] == 0
    for suffix in ("json", "npz"):
        same, again, other = (Path(f"{out}/small.{suffix}").read_bytes() for out in "abc")
        assert same == again
        assert same != other


@pytest.mark.slow
def test_more_photons_resume_the_ones_that_are_there(command, recipe):
    """Two batches and then a third make the record of three at once, and the two are not traced again."""

    def batches() -> dict[Path, tuple[int, bytes]]:
        found = Path("out/.photons").glob("*/batch-*")
        return {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in found}

    assert command(*small(recipe, "out", "--photons", str(2 * 2**20)))[0] == 0
    before = batches()
    assert len(before) == 2
    assert command(*small(recipe, "out", "--photons", str(3 * 2**20)))[0] == 0
    after = batches()
    assert len(after) == 3
    assert {path: after[path] for path in before} == before
    assert command(*small(recipe, "at-once", "--photons", str(3 * 2**20)))[0] == 0
    for suffix in ("json", "npz"):
        assert Path(f"out/small.{suffix}").read_bytes() == Path(f"at-once/small.{suffix}").read_bytes()


@pytest.mark.slow
def test_control_c_is_one_line_and_keeps_the_batches(recipe, tmp_path):
    words = ("profilefit", "regenerate", recipe, "--out", "out", "--photons", 2**30)
    status, _, err = interrupted(*words, cwd=tmp_path, once="out/.photons/*/run.json")
    assert (status, err) == (130, "profilefit: stopped; the finished batches are kept, the same command resumes\n")


@pytest.mark.parametrize(
    ("words", "status", "said"),
    [
        (("regenerate", "--nonsense"), 2, "profilefit: No such option: --nonsense"),
        (("--help",), 0, ""),
    ],
)
def test_python_m_profilefit_ends_with_the_right_status(words, status, said, tmp_path):
    run = subprocess.run(
        [sys.executable, "-m", "profilefit", *words], cwd=tmp_path, capture_output=True, text=True, timeout=120
    )
    assert run.returncode == status
    assert run.stderr.startswith(said)
    assert run.stderr.count("\n") == (1 if status else 0)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ('law = "liang"|law = "lang"', "law must be one of liang, rational, van_de_hulst, chiang, got 'lang'"),
        ('objective = "albedo"|objective = "energy"', "must be one of albedo, reflectance, relative_reflectance, got"),
    ],
)
def test_a_bad_recipe_is_one_line_and_writes_nothing(refused, recipe, change, said):
    recipe.write_text(RECIPE.replace(*change.split("|")))
    assert str(recipe) in refused(small(recipe), said)
    assert not list(Path("out").glob("**/*.*")) if Path("out").exists() else True


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("regenerate no-such-recipe", "recipe must be one of albedo-liang,"),
        ("regenerate albedo-rational --photons 0", "photons must be a whole number >= 1, got 0"),
        ("regenerate albedo-rational --seed -1", "seed must be a whole number in [0, 4294967295], got -1"),
        ("regenerate missing.toml --seed 4294967296", "seed must be a whole number in [0, 4294967295], got"),
        ("report --fits empty", "must be a folder of records, got 'empty', which is none"),
    ],
)
def test_bad_words_are_one_line(refused, words, said):
    refused(words, said)
    assert not list(Path().iterdir()), "refused before anything is made"


def test_two_recipes_of_one_name_are_refused(refused, recipe):
    other = Path("other/small.toml")
    other.parent.mkdir()
    other.write_text(RECIPE)
    refused(
        f"regenerate {recipe} {other} --out out --photons 20000",
        f"recipes must have different names, as their records do, got {recipe} and {other}",
    )
    assert not Path("out").exists()


def test_a_damaged_record_is_one_line(refused):
    Path("fits").mkdir()
    content = json.loads((catalogue.fits_folder() / "liang-whole.json").read_text())
    del content["fit"]
    Path("fits/liang-whole.json").write_text(json.dumps(content))
    refused("report liang-whole", "fits/liang-whole.json: is damaged: fit must be a table, got nothing; regenerate it")


@pytest.mark.slow
def test_report_shows_shipped_records_and_draws_figures(done):
    out = done("report", "albedo-liang", "--figures", "figures", "--quiet")
    assert "(8)" in out
    assert list(Path("figures").glob("*.png"))


def test_version_is_a_number(done):
    assert done("--version", said=None).startswith("profilefit 0.")


def test_shipped_records_are_written_over_only_where_they_are_named(refused, monkeypatch):
    """Where ./fits is what is shipped, as in a clone; the last error comes from behind that check."""
    monkeypatch.chdir(fits_folder().parent)
    refused("regenerate albedo-liang", "--out must be given where ./fits holds the shipped records")
    monkeypatch.setattr("mcml_sim.files.whole_file.require_folder", _reached)
    refused("regenerate albedo-liang --out fits", "the folder is next")


def _reached(*_, **__):
    raise InputError("the folder is next")

"""profilefit choose: the whole way from a file to a table, and one line for a mistake."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from profilefit.cli import app
from profilefit.errors import InputError

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
SKIN, HEART, SEA = (EXAMPLES / f"{name}.toml" for name in ("skin", "heart", "sea"))


def run(*arguments):
    return CliRunner().invoke(app, ["choose", *map(str, arguments)])


def test_a_mistake_is_one_line(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text("[view]\npixel = -1\n", encoding="utf-8")
    found = run(path)
    assert isinstance(found.exception, InputError)
    older = 'keys are of an older format: write scene = "skin" and [choose] pixel for [view] pixel'
    assert str(found.exception) == f"{path}: {older}"


@pytest.mark.slow
def test_the_example():
    """Skin: chosen within tolerance and budget, one layer enough; the same as data."""
    table = run(SKIN)
    assert table.exit_code == 0
    assert table.stdout.startswith("The cheapest option within tolerance and budget: ")
    assert "one layer is enough" in table.stdout
    made = json.loads(run(SKIN, "--json").stdout)
    assert made["nearest"]["error"] <= 0.02
    assert made["nearest"]["ms"] <= 5.0
    assert made["cheaper"]["error"] > 0.02 or made["cheaper"]["ms"] > 5.0
    assert made["one_layer"]["verdict"] == "enough"


@pytest.mark.slow
def test_nothing_serves(tmp_path):
    """Exit status 1, and the nearest; refracting skin."""
    text = SKIN.read_text(encoding="utf-8").partition("# Skin as two layers")[0]
    path = tmp_path / "scene.toml"
    path.write_text(text.replace("tolerance = 0.02 ", "tolerance = 0.002 "), "utf-8")
    found = run(path)
    assert found.exit_code == 1
    assert found.stdout.startswith("No option meets 0.20 % within 5 ms: the most accurate in the budget is ")
    assert "light: diffuse, n = 1.4." in found.stdout


@pytest.mark.slow
def test_whether_a_heart_needs_an_atlas(opengl):
    found = run(HEART, "--json")
    told = json.loads(found.stdout)
    assert told["verdict"] == "no atlas"
    assert 0 < told["hidden"] < told["error"] < told["tolerance"] == 0.02
    line = " ".join(run(HEART).stdout.split())
    error, hidden = (f"{100 * told[key]:.2g} %" for key in ("error", "hidden"))
    assert line.startswith(f"no atlas: the screen by itself is wrong by {error} of the light, by {hidden} for what it")
    refused = run(HEART, "--measure").exception
    assert str(refused) == f"{HEART}: --measure must be left out of a heart's file, of which no cost is asked"


def test_what_a_sea_needs():
    told = json.loads(run(SEA, "--json").stdout)
    assert (told["terms"], told["splat"], told["steps"]) == ("broadened", "cells", {"light": 0, "view": 16})
    assert 0.1 == told["tolerance"] < told["haze"]["scaled"] < told["haze"]["single"] < 1.0
    lines = " ".join(run(SEA).stdout.split())
    scaled, single = (f"{kind} {100 * told['haze'][kind]:.2g} %" for kind in ("scaled", "single"))
    assert lines.startswith("terms: broadened; off the broadened haze at worst: ")
    for text in (scaled, single, "(requested: 10 %)", f"(F {told['focus']:.2g})", "views 16 (S 11)"):
        assert text in lines
    refused = run(SEA, "--measure").exception
    assert str(refused) == f"{SEA}: --measure must be left out of a sea's file, of which no cost is asked"


def test_a_sea_that_there_is_not(tmp_path):
    path = tmp_path / "sea.toml"
    path.write_text(SEA.read_text(encoding="utf-8").replace("depth = 4.0", "depth = 0.01"), encoding="utf-8")
    found = run(path)
    assert isinstance(found.exception, InputError)
    assert str(found.exception).startswith(f"{path}: ")
    assert "\n" not in str(found.exception)


@pytest.fixture
def fur(tmp_path, monkeypatch):
    """A file, and the study of one angle with few rays."""
    for name, value in {"PATCHES": 6, "RAYS": 100, "MOST": 16, "ANGLES": (75,)}.items():
        monkeypatch.setattr(f"profilefit.studies.choose.scenes.{name}", value)
    path = tmp_path / "fur.toml"
    path.write_text('scene = "fur"\n[fur]\nlength = 5\n[technique]\ntolerance = 0.1\n', encoding="utf-8")
    return path


def test_how_many_layers_fur_needs(fur):
    made = run(fur, "--json")
    told = json.loads(made.stdout)
    assert (made.exit_code, told["angle"], told["tolerance"]) == (0, 75, 0.1)
    assert told["by_angle"][0]["cheapest"] == told["way"]
    assert told["by_angle"][0]["layers"][told["way"]] == told["layers"] < 16
    assert told["by_angle"][0]["layers"]["linear"] is None
    lines = " ".join(run(fur).stdout.split())
    assert lines.startswith("75 degrees: linear none, quadratic none, fitted none, swept ")
    assert f"{told['way'].replace(',', '')}, {told['layers']} layers: the cheapest to 75 degrees" in lines
    refused = run(fur, "--measure").exception
    assert str(refused) == f"{fur}: --measure must be left out of a fur's file, of which no cost is asked"


@pytest.mark.slow
def test_fur_that_no_way_serves(fur):
    """Exit status 1; and one line for what rays do not tell."""
    text = fur.read_text(encoding="utf-8")
    fur.write_text(text.replace("length = 5", "length = 50"), encoding="utf-8")
    found = run(fur)
    assert found.exit_code == 1
    assert "no way is within the tolerance at 75 degrees" in " ".join(found.stdout.split())
    fur.write_text(text.replace("0.1", "0.001"), encoding="utf-8")
    assert str(run(fur).exception).startswith(f"{fur}: [technique] tolerance must be at least 0.01 ")

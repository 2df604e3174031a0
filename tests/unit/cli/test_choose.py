"""profilefit choose: the whole way from a file to a table, and one line for a mistake."""

import json
from pathlib import Path

import pytest

from tests.fixtures import EXAMPLES

SKIN, HEART, SEA = (EXAMPLES[f"{name}.toml"] for name in ("skin", "heart", "sea"))


@pytest.fixture
def chosen(command):
    """What `choose WORDS` prints, on one line; and the same as data."""

    def run(*words: object, status: int = 0) -> tuple[str, dict]:
        (ended, out, err), (_, data, _) = command("choose", *words), command("choose", *words, "--json")
        assert (ended, err) == (status, "")
        return " ".join(out.split()), json.loads(data)

    return run


def changed(path: str, *change: str) -> str:
    """The name of a file in the folder, which is another one changed."""
    Path("scene.toml").write_text(Path(path).read_text(encoding="utf-8").replace(*change), encoding="utf-8")
    return "scene.toml"


def test_a_mistake_is_one_line(refused):
    Path("scene.toml").write_text("[view]\npixel = -1\n", encoding="utf-8")
    older = 'keys are of an older format: write scene = "skin" and [choose] pixel for [view] pixel'
    assert refused("choose scene.toml", older) == f"profilefit: scene.toml: {older}\n"


@pytest.mark.parametrize("kind", ["heart", "sea", "fur"])
def test_only_skin_has_a_cost_to_measure(refused, kind):
    file = EXAMPLES[f"{kind}.toml"]
    said = f"profilefit: {file}: --measure must be left out of a {kind}'s file, of which no cost is asked\n"
    assert refused(f"choose {kind}.toml --measure", "--measure") == said


@pytest.mark.slow
def test_the_example(chosen):
    """Skin: chosen within tolerance and budget, one layer enough; the same as data."""
    table, made = chosen(SKIN)
    assert table.startswith("The cheapest option within tolerance and budget: ")
    assert "one layer is enough" in table
    assert made["nearest"]["error"] <= 0.02
    assert made["nearest"]["ms"] <= 5.0
    assert made["cheaper"]["error"] > 0.02 or made["cheaper"]["ms"] > 5.0
    assert made["one_layer"]["verdict"] == "enough"


@pytest.mark.slow
def test_nothing_serves(chosen):
    """Exit status 1, and the nearest; refracting skin."""
    changed(SKIN, "tolerance = 0.02 ", "tolerance = 0.002 ")
    text = Path("scene.toml").read_text(encoding="utf-8")
    Path("scene.toml").write_text(text.partition("# Skin as two layers")[0], encoding="utf-8")
    table, _ = chosen("scene.toml", status=1)
    assert table.startswith("No option meets 0.20 % within 5 ms: the most accurate in the budget is ")
    assert "light: diffuse, n = 1.4." in table


@pytest.mark.slow
def test_whether_a_heart_needs_an_atlas(chosen, opengl):
    line, told = chosen(HEART)
    assert told["verdict"] == "no atlas"
    assert 0 < told["hidden"] < told["error"] < told["tolerance"] == 0.02
    error, hidden = (f"{100 * told[key]:.2g} %" for key in ("error", "hidden"))
    assert line.startswith(f"no atlas: the screen by itself is wrong by {error} of the light, by {hidden} for what it")


def test_what_a_sea_needs(chosen):
    lines, told = chosen(SEA)
    assert (told["terms"], told["splat"], told["steps"]) == ("broadened", "cells", {"light": 0, "view": 16})
    assert 0.1 == told["tolerance"] < told["haze"]["scaled"] < told["haze"]["single"] < 1.0
    scaled, single = (f"{kind} {100 * told['haze'][kind]:.2g} %" for kind in ("scaled", "single"))
    assert lines.startswith("terms: broadened; off the broadened haze at worst: ")
    for text in (scaled, single, "(requested: 10 %)", f"(F {told['focus']:.2g})", "views 16 (S 11)"):
        assert text in lines


def test_a_sea_that_there_is_not(refused):
    assert refused(f"choose {changed(SEA, 'depth = 4.0', 'depth = 0.01')}", "").startswith("profilefit: scene.toml: ")


@pytest.fixture
def fur(tmp_path, monkeypatch):
    """A file, and the study of one angle with few rays."""
    for name, value in {"PATCHES": 6, "RAYS": 100, "MOST": 16, "ANGLES": (75,)}.items():
        monkeypatch.setattr(f"profilefit.studies.choose.scenes.{name}", value)
    path = tmp_path / "fur.toml"
    path.write_text('scene = "fur"\n[fur]\nlength = 5\n[technique]\ntolerance = 0.1\n', encoding="utf-8")
    return path


def test_how_many_layers_fur_needs(chosen, fur):
    lines, told = chosen(fur)
    assert (told["angle"], told["tolerance"]) == (75, 0.1)
    assert told["by_angle"][0]["cheapest"] == told["way"]
    assert told["by_angle"][0]["layers"][told["way"]] == told["layers"] < 16
    assert told["by_angle"][0]["layers"]["linear"] is None
    assert lines.startswith("75 degrees: linear none, quadratic none, fitted none, swept ")
    assert f"{told['way'].replace(',', '')}, {told['layers']} layers: the cheapest to 75 degrees" in lines


@pytest.mark.slow
def test_fur_that_no_way_serves(chosen, refused, fur):
    """Exit status 1; and one line for what rays do not tell."""
    text = fur.read_text(encoding="utf-8")
    fur.write_text(text.replace("length = 5", "length = 50"), encoding="utf-8")
    assert "no way is within the tolerance at 75 degrees" in chosen(fur, status=1)[0]
    fur.write_text(text.replace("0.1", "0.001"), encoding="utf-8")
    assert "[technique] tolerance must be at least 0.01 " in refused(f"choose {fur}", f"profilefit: {fur}: ")

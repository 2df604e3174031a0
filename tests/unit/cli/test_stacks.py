"""Stacks of layers in the shell: from a file to its record, and from the record to one file for a shader."""

import json
from pathlib import Path

import numpy as np
import pytest

from profilefit.materials import CHANNELS
from profilefit.recipes import record
from profilefit.recipes.folder import fits_folder
from profilefit.recipes.kinds import gaussians
from profilefit.recipes.kinds import stack as stacks
from profilefit.shader.law_file import LANGUAGES
from tests.fixtures import functions
from tests.unit.recipes.stack.test_record import STACK, made
from tests.unit.recipes.stack.test_sum_record import made_sums

GREY = """\
layers = [
    {name = "veil", n = 1.0, mu_a = 0.2, mu_s = 2.2, g = 0.0, thickness = 0.3},
    {name = "wall", n = 1.0, mu_a = 0.8, mu_s = 1.2, g = 0.0},
]
"""


@pytest.fixture
def heart(command, monkeypatch):
    """STACK as a file, whose fit takes no time."""
    monkeypatch.setattr(stacks, "_channel", made)
    monkeypatch.setattr(gaussians, "_of_light", made_sums)
    monkeypatch.setattr("profilefit.recipes.workers.cores", lambda: 1)
    Path("heart.toml").write_text(STACK, encoding="utf-8")
    return "heart.toml"


@pytest.fixture
def mine(command, heart):
    """The records of STACK in a folder."""
    assert command("regenerate", heart, "--out", "mine", "--quiet")[0] == 0


def test_a_stack_becomes_a_record_and_that_a_text(command, done, heart):
    told = json.loads(done("regenerate", heart, "--out", "mine", "--json", "--quiet"))
    assert list(told) == ["stacks/heart", "gaussians/heart"]
    assert told["gaussians/heart"]["constants"]["diffuse.6.red.w1"]["jackknife_error"] == 1e-3
    law = stacks.load(Path("mine/stacks/heart.json")).laws[1]
    text = done("export", "heart", "--lang", "python", "--fits", "mine", said="profilefit: records of 'mine'\n")
    assert command("export", "mine/stacks/heart.json", "--lang", "python") == (0, text, "")
    names, r = functions(text), np.geomspace(0.01, 10.0, 30)
    np.testing.assert_allclose(names["heart_profile"](r, 1.0, 0.2), law.profile(r, 0.2), rtol=1e-10)
    assert names["heart_total"](1.0, 0.2) == pytest.approx(float(law.total(0.2)), rel=1e-10)
    assert names["heart_once_radiance"](1.0, 0.2, 0.5, 0.5, 0.0) > 0


@pytest.mark.parametrize("lang", LANGUAGES)
def test_every_language_says_what_it_is(done, mine, lang):
    path = Path("mine/stacks/heart.json")
    text = done("export", str(path), "--lang", lang)
    for said in ("epicardium", stacks.load(path).digest, "no error of photons", "mm", "jackknife"):
        assert said.lower() in text.lower(), said
    assert text.isascii()
    if lang == "json":
        told = json.loads(text)
        assert (told["label"], told["setting"]) == ("heart", {"illumination": "diffuse", "n": 1.38, "g": 0.0})
        assert (told["constants"], list(told["numbers"])) == (record.read(path)["constants"], sorted(CHANNELS))
        assert told["half_spaces"] == record.read(path)["half_spaces"]
    else:
        mark = "#" if lang == "python" else "//"
        head = text[: text.index("\n\n")].splitlines()
        assert all(line.startswith(mark) for line in head)
        assert any("rel at most 0.012, ks 0.003, A 0.0015" in line for line in head)
        assert "+- 1e-05 (dr), +- 0.002 (misfit), +- 0.03 (jackknife)" in text


def test_a_name_of_its_own_and_files(command, mine):
    words = ("export", "mine/stacks/heart.json", "--name", "left", "--out", "left.glsl")
    assert command(*words) == (0, "", "")
    text = Path("left.glsl").read_text()
    assert "float left_profile(float r, float channel, float thickness)" in text
    assert "heart_" not in text
    Path("mine/stacks/heart.json").rename("mine/stacks/my-heart.json")
    assert "float my_heart_profile(" in command("export", "mine/stacks/my-heart.json")[1]


def test_a_mistake_in_the_file_is_one_line_and_writes_nothing(refused, heart):
    Path(heart).write_text(STACK.replace('"diffuse"', '"sun"'), encoding="utf-8")
    said = "heart.toml: illumination must be one of searchlight, diffuse, got 'sun'"
    refused(f"regenerate {heart} --out mine --quiet", said)
    assert not Path("mine/stacks").exists()


def test_a_stack_is_reported_by_its_name(command, done, mine):
    content = record.read(Path("mine/stacks/heart.json"))
    out = done("report", "heart", "--fits", "mine", "--quiet")
    assert out.startswith("heart  Muscle under its skin")
    rows = [line.split() for line in out.splitlines()]
    for name in content["constants"]:
        assert [row[:3] for row in rows].count(name.split(".")) == 1
    assert ["green", "1", "0.200", "mm", "0.012", "0.0030", "-0.0015"] in rows
    assert list(json.loads(command("report", "heart", "hazard", "--json")[1])["records"]) == ["heart", "hazard"]
    told = json.loads(command("report", "heart", "--fits", "mine", "--json")[1])
    sums = record.read(Path("mine/gaussians/heart.json"))
    assert told == {"records": {"heart": content}, "gaussians": {"heart": sums}}
    rows = [line.split() for line in out.splitlines()]
    assert ["diffuse", "6", "0.017", "0.033", "0.050", "0.050", "0.050", "0.050"] in rows
    assert sum(row[:1] == ["searchlight"] for row in rows) == 8
    Path("mine/gaussians/heart.json").unlink()
    alone = command("report", "heart", "--fits", "mine", "--quiet")[1]
    assert alone == out[: len(alone)]
    assert "Gaussians" not in alone


def test_tables_of_stacks_in_markdown(command, mine):
    """Of those named; of all in the folder, if none is; and of none the tables stay as they were."""
    marks = ("stack-errors", "stack-constants", "stack-gaussians", "constants")
    text = "".join(f"<!-- {mark} -->\nold\n<!-- /{mark} -->\n" for mark in marks)
    for names in (("heart",), ()):
        Path("page.md").write_text(text, encoding="utf-8")
        assert command("report", *names, "--fits", "mine", "--markdown", "page.md", "--quiet") == (0, "", "")
        filled = Path("page.md").read_text(encoding="utf-8")
        assert "| heart | red | 1 | 0.200 mm | 0.012 | 0.0030 | -0.0015 |" in filled
        assert filled.count("| heart | blue |") == 1 + 9
        assert "| heart | 15 % | 7.5 % | 5.0 % | 3.8 % | 5.0 %" in filled
        assert filled.count("old") == 1, "no table of other records"
    Path("page.md").write_text(text, encoding="utf-8")
    command("report", "hazard", "--markdown", "page.md")
    assert Path("page.md").read_text(encoding="utf-8").count("old") == 3


def test_a_stack_beside_other_records(command, done, heart):
    """In ./fits, and shipped: where it is from is said if that is not where the records are from."""
    command("regenerate", heart, "--quiet")
    out = done("report", "heart", "hazard", said="profilefit: stack 'heart' is of 'fits'\n")
    assert "Muscle under its skin" in out
    done("report", "skin")
    Path("fits/hazard.json").write_bytes((fits_folder() / "hazard.json").read_bytes())
    other = "profilefit: records of 'fits' in the current folder; --fits chooses others\n"
    assert command("report", "heart")[::2] == (0, other)
    assert command("report", "skin")[::2] == (0, f"{other}profilefit: stack 'skin' is of {str(fits_folder())!r}\n")


def test_what_a_stack_does_not_take_is_one_line(refused, mine):
    said = "must be left out where NAME is a stack, got"
    refused("export mine/stacks/heart.json --constants published", f"--constants {said} 'mine/stacks/heart.json'")
    for option in ("--quality", "--figures=figures", "--html=page.html"):
        refused(f"report heart {option} --fits mine --quiet", f"{option.partition('=')[0]} {said} 'heart'")
    lists = "stacks are heart, and `profilefit report` lists "
    for words, said in {
        "hart": f"no record 'hart' in mine; did you mean heart? {lists}",
        "skin": f"no record 'skin' in mine; {lists}records",
        "--json": "mine has no records: `profilefit regenerate` makes them",
    }.items():
        refused(f"report {words} --fits mine --quiet", said)


def test_a_damaged_stack_is_no_report(refused, mine):
    path = Path("mine/stacks/heart.json")
    content = json.loads(path.read_text(encoding="utf-8"))
    content["interfaces"]["red"]["quality"] = []
    path.write_text(json.dumps(content), encoding="utf-8")
    said = "heart.json: is damaged: [interfaces.red] quality must be 1, one per interface, got 0; regenerate it\n"
    for words in ("report heart", "report heart --json", "report"):
        refused(f"{words} --fits mine --quiet", said)


@pytest.mark.slow
def test_a_grey_stack_is_fitted(command, done):
    """Truly: a minute or two."""
    Path("veil.toml").write_text(GREY, encoding="utf-8")
    assert command("regenerate", "veil.toml", "--out", "mine", "--quiet") == (0, "", "")
    path = Path("mine/stacks/veil.json")
    content = record.read(path)
    kinds = ["discretisation_error", "jackknife_error", "misfit_error", "model_error", "statistical_error"]
    for one in content["constants"].values():
        found = {key: value for key, value in one.items() if key.endswith("_error")}
        assert sorted(found) == kinds
        assert [key for key, value in found.items() if value is None] == ["model_error", "statistical_error"]
        assert all(value >= 0 for value in found.values() if value is not None)
    worst = content["quality"]["regenerated"]
    assert max(worst["rel"]) < 0.03
    assert max(worst["ks"]) < 0.01
    assert worst["delta_A"] < 0.01
    # Between the thicknesses that were fitted the law is not the light itself, nor are all constants known exactly.
    assert max(worst["rel"]) > 1e-4
    for lang in ("glsl", "hlsl", "python", "json"):
        assert "veil" in done("export", str(path), "--lang", lang)
    sums = gaussians.load(Path("mine/gaussians/veil.json"))
    assert sums.content["fit"]["result"] == "converged"
    red, green, blue = sums.laws("diffuse", 8)
    assert red == green == blue  # one grey light, fitted with itself
    known = sums.content["constants"]["diffuse.6.v1"]
    assert [key for key in kinds if known[key] is None] == ["statistical_error"]
    law = stacks.load(path).laws[0]
    names = functions(command("export", str(path), "--lang", "python")[1])
    r = np.geomspace(0.01, 3.0, 30)
    np.testing.assert_allclose(names["veil_profile"](r, 2.0, 0.3), law.profile(r, 0.3), rtol=1e-10)

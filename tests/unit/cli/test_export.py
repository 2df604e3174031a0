"""`profilefit export` as a user meets it: what it writes, what it refuses, and in how many lines."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from mcml_sim.files.text_file import read_toml
from profilefit.recipes import catalogue
from profilefit.recipes.catalogue import find
from profilefit.scenes.fur import law as fur
from profilefit.scenes.sea import beam_share
from profilefit.scenes.sea.scene import read
from profilefit.shader.law_file import export
from tests.fixtures import EXAMPLES

FITS = catalogue.fits_folder()
SEA = EXAMPLES["sea.toml"]


def test_prints_the_text_or_writes_it(command):
    text = export(find("hazard-diffuse", FITS), FITS, "hlsl")
    assert command("export", "hazard-diffuse", "--lang", "hlsl") == (0, text, "")
    assert command("export", "hazard-diffuse", "--lang", "hlsl", "--out", "hazard.hlsl") == (0, "", "")
    assert Path("hazard.hlsl").read_text() == text


def test_a_law_with_constants_of_ones_choice_and_by_a_name_of_its_own(command, done):
    """What was only printed needs no word for it."""
    _, published, _ = command("export", "burley", "--constants", "published")
    _, regenerated, _ = command("export", "burley")
    assert "burley_s0 = 1.85;" in published
    assert "record burley-whole" in regenerated
    assert "record burley-whole" not in published
    for name in ("burley_diffuse_mfp", "van_de_hulst", "chiang"):
        assert f"\n// {name}, published: " in done("export", name, said=None)
    _, text, _ = command("export", "hazard", "--name", "skin")
    assert "float skin_profile(float r" in text
    assert "// skin_profile(r, alpha, mfp)" in text
    assert "hazard_" not in text


def test_records_that_are_not_the_shipped_ones_are_named(command):
    """A cloned folder may bring records of its own."""
    _, shipped, err = command("export", "hazard")
    assert err == ""
    Path("fits").mkdir()
    for name in ("hazard", "albedo-rational"):
        shutil.copy(FITS / f"{name}.json", "fits")
    said = "profilefit: records of 'fits' in the folder that you are in; --fits chooses others\n"
    assert command("export", "hazard") == (0, shipped, said)
    assert command("export", "hazard", "--fits", "fits") == (0, shipped, "profilefit: records of 'fits'\n")
    assert command("export", "hazard", "--fits", str(FITS)) == (0, shipped, "")
    (Path("fits") / "albedo-rational.json").unlink()
    status, out, err = command("export", "hazard")
    assert (status, "// map: this record came with profilefit" in out) == (0, True)
    assert err.splitlines()[1:] == ["profilefit: no record 'albedo-rational' in 'fits': the shipped map serves"]


def test_a_folder_that_lacks_the_record_gives_no_other(refused):
    """As after a `regenerate --out mine` that failed."""
    Path("mine").mkdir()
    for name in ("hazard", "gaussians", "albedo liang"):
        for more in (), ("--constants", "regenerated"):
            said = "there is no such record; `profilefit regenerate"
            assert "mine/" in refused(("export", name, *more, "--fits", "mine"), said)
    Path("mine/burley.csv").write_text("r, value, sigma\n1,1,1\n2,.5,.1\n3,.1,.1\n")
    refused("fit mine/burley.csv --unit mm --law hazard --fits mine", "mine/hazard.json: there is no such record")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("hazzard", "name must be a law, map or record, got 'hazzard'; did you mean hazard"),
        ("gaussians:3", "--constants must be the path of a record (.json): "),
        ("hazard --name gl_skin", "name must be letters, digits and single underscores"),
        ("hazard --name skin --lang json", "name must be left out where lang is json"),
        ("hazard --lang wgsl", "lang must be one of glsl, hlsl, glsl-es, python, json, got 'wgsl'"),
        ("hazard --constants old", "--constants must be one of regenerated, "),
        ("hazard --out no/such/folder.glsl", "cannot write no/such/folder.glsl: No such file"),
        ("hazard --constants x.json", "x.json: there is no such record"),
        ("hazard --fits nowhere", "--fits must be a folder of records, got 'nowhere', which is none"),
        ("sea-segment --n 1.3", "--n must be left out where NAME is of light in water, got 'sea-segment'"),
        ("heart.toml", f"{EXAMPLES['heart.toml']}: scene must be sea, whose water has a text, got 'heart'"),
        ("nope.toml", "nope.toml: expected a file that can be read, got: No such file or directory"),
        ("fur --n 1.3", "--n must be left out where NAME is of fur, got 'fur'"),
        ("fur --constants old", "--constants must be left out where NAME is of fur, got 'fur'"),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(refused, tmp_path, words, said):
    assert refused(f"export {words}", said).startswith(f"profilefit: {said}")
    assert list(tmp_path.iterdir()) == []


def test_light_in_water_and_cones_of_fur(command):
    """By their names, by a name of one's own, and the blur of a scene's file."""
    assert "def sea_segment_integral(" in command("export", "sea-segment", "--lang", "python")[1]
    told = json.loads(command("export", SEA, "--lang", "json")[1])
    made: dict = {}
    exec(command("export", SEA, "--lang", "python", "--name", "fog")[1], made)
    assert made["fog_sigma4"](2.0) == pytest.approx(told["numbers"]["blue"]["sigma"][3])
    world = read(SEA, read_toml(SEA)).world
    exact = beam_share(world.omega[1], world.c[1] * told["depth"], world.c[1] * 0.1, world.lobes)
    assert made["fog_share"](0.1, 1.0) == pytest.approx(exact, abs=0.01)
    exec(command("export", "fur", "--lang", "python", "--name", "hair")[1], made)
    assert made["hair_shadow"](0.5, 10.0) == pytest.approx(fur.shadow(0.5, 10.0, np.pi / 4))


def test_constants_of_a_file_stay_those_at_another_g(command, tmp_path):
    record = json.loads((FITS / "hazard-forward.json").read_text())
    record["constants"]["a00"]["regenerated"] += 1.0
    (tmp_path / "own.json").write_text(json.dumps(record))
    words = ("export", "hazard", "--n", "1.4", "--lang", "json")
    for g in ("0.9", "0.5"):
        own, shipped = (json.loads(command(*words, "--g", g, *more)[1]) for more in (("--constants", "own.json"), ()))
        assert own != shipped, g

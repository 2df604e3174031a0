"""`profilefit check` and `export` as a user meets them: what passes, what fails and where, and what is no machine for
it; what is written, what is refused, and in how many lines.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mcml_sim.files.whole_file import read_toml
from profilefit.recipes import catalogue
from profilefit.recipes.catalogue import find
from profilefit.recipes.evidence import stale
from profilefit.scenes.fur import law as fur
from profilefit.scenes.sea import beam_share
from profilefit.scenes.sea.scene import read
from profilefit.shader.check.chosen import INDICES, scope
from profilefit.shader.law_file import export
from tests.fixtures import EXAMPLES, functions

FITS = catalogue.fits_folder()


@pytest.fixture
def folder(tmp_path):
    """Records of one surface, to be changed."""
    for name in ("hazard-refracting", "albedo-rational-refracting"):
        shutil.copy(FITS / f"{name}.json", tmp_path)
    return tmp_path


@pytest.mark.slow
def test_a_good_law_passes_in_100_columns(done, opengl):
    out = done("check", "hazard-refracting", "albedo-rational-refracting", "--precision", "float16")
    lines = out.splitlines()
    assert max(map(len, lines)) <= 100
    for name in ("hazard-refracting", "albedo-rational-refracting"):
        rows = [line.split() for line in lines if line.split()[:1] == [name]]
        assert [(row[1], row[-1]) for row in rows if row[-1] == "pass"] == [(f"{n:g}", "pass") for n in INDICES]
    assert lines[-1] == f"{2 * len(INDICES)} laws or maps: all pass"
    assert "burley" in out  # what costs are counted in
    assert "float16 arithmetic: not offered by" in out or "arithmetic" in out


@pytest.mark.slow
def test_json_has_all_of_it_and_is_what_a_folder_keeps(done, opengl):
    words = ("check", "albedo-rational-refracting", "hazard-refracting", "--json", "--out", "kept")
    out = done(*words, said="wrote kept/check.json\n")
    found = json.loads(out)
    assert Path("kept/check.json").read_text(encoding="utf-8") == out
    assert next(iter(found)) == "made"
    assert found["made"]["command"] == " ".join(("profilefit", *words))
    assert not stale(found["made"], FITS)
    assert found["of"] == ["albedo-rational-refracting", "hazard-refracting"], "not all there is"
    assert found["passed"] is True
    laws, maps = ([one["setting"]["n"] for one in found[key]] for key in ("laws", "maps"))
    assert laws == maps == list(INDICES)
    law, mapped = found["laws"][0], found["maps"][0]
    assert (law["constants"], mapped["constants"]) == ("hazard-refracting", "albedo-rational-refracting")
    assert set(law["spreads"]["R_d"]) == {"half", "most", "largest", "where"}
    assert all(bound["value"] <= bound["limit"] for bound in law["bounds"])
    assert set(found["costs"]) == {"burley", "refracting_hazard"}


def test_a_part_is_not_told_as_the_whole():
    assert scope(None, None) == scope([], "regenerated") == "all"
    assert (scope(None, "published"), scope(["liang"], "published")) == ("all published", ["liang"])


@pytest.mark.slow
def test_a_record_whose_bound_is_broken_is_status_1(command, opengl, folder):
    """A record that claims a model a million times as good as it is."""
    path = folder / "hazard-refracting.json"
    content = json.loads(path.read_text())
    content["quality"]["by_index"]["rel"][-1] *= 1e-8
    path.write_text(json.dumps(content))
    status, out, _ = command("check", "hazard-refracting", "--fits", str(folder))
    assert status == 1
    assert "FAIL hazard-refracting, n = 1.6: float32 rel: " in out
    assert out.splitlines()[-1] == f"{len(INDICES)} laws or maps: 1 fail"


@pytest.mark.slow
def test_the_printed_laws_of_liang_fail_where_they_are_wrong(command, opengl):
    status, out, _ = command("check", "liang", "--constants", "published")
    text = " ".join(out.split())
    assert status == 1
    for wrong in (
        "FAIL liang, published: rel against the exact half space",
        "cdf(r_max) is 13.6 to 15.5",
        "negative; the source takes |g|: 0.009766 at ξ < 0.01",
        "the law is 0/0",
        "FAIL map liang, published: bad numbers: 164 at A 0.9185 (164 not monotone)",
        "beyond its fold at A = 0.9165",
        "α is 0.99824",
    ):
        assert wrong in text
    assert "FAIL liang, published: float32" not in text  # the text itself is right


@pytest.fixture
def blind(tmp_path):
    """Run `profilefit WORDS` in a process of its own, which finds no driver."""
    environment = {**os.environ, "__EGL_VENDOR_LIBRARY_DIRS": str(tmp_path), "__EGL_VENDOR_LIBRARY_FILENAMES": ""}

    def run(*words):
        command = [sys.executable, "-m", "profilefit", *words]
        return subprocess.run(command, capture_output=True, text=True, env=environment, check=False, cwd=tmp_path)

    return run


@pytest.mark.slow
def test_no_opengl_is_one_line_and_status_2(blind):
    done = blind("check", "hazard-refracting")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("profilefit: no OpenGL 3.3 without a window")
    assert done.stderr.count("\n") == 1


@pytest.mark.slow
def test_without_opengl_a_readme_keeps_its_table(blind, folder):
    page = folder / "page.md"
    page.write_text("<!-- check -->\nas it was\n<!-- /check -->\n")
    done = blind("report", "--markdown", str(page), "--fits", str(folder))
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    assert "the table 'check' stays as it was: no OpenGL 3.3" in done.stderr
    assert page.read_text() == "<!-- check -->\nas it was\n<!-- /check -->\n"


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
    said = "profilefit: records of 'fits' in the current folder; --fits chooses others\n"
    assert command("export", "hazard") == (0, shipped, said)
    (Path("fits") / "albedo-rational.json").unlink()
    status, out, err = command("export", "hazard")
    assert (status, "// map: this record came with profilefit" in out) == (0, True)
    warning = "profilefit: no record 'albedo-rational' in 'fits': the shipped albedo inversion is used"
    assert err.splitlines()[1:] == [warning]


def test_a_folder_that_lacks_the_record_gives_no_other(refused):
    """As after a `regenerate --out mine` that failed."""
    Path("mine").mkdir()
    for name in ("hazard", "gaussians", "albedo liang"):
        for more in (), ("--constants", "regenerated"):
            said = "there is no such record; `profilefit regenerate"
            assert "mine/" in refused(("export", name, *more, "--fits", "mine"), said)
    Path("mine/burley.csv").write_text("r, value, sigma\n1,1,1\n2,.5,.1\n3,.1,.1\n")
    refused("fit mine/burley.csv --unit mm --law hazard --fits mine", "mine/hazard.json: there is no such record")


def test_light_in_water_and_cones_of_fur(command):
    """By their names, by a name of one's own, and the blur of a scene's file."""
    assert "def sea_segment_integral(" in command("export", "sea-segment", "--lang", "python")[1]
    told = json.loads(command("export", SEA, "--lang", "json")[1])
    made = functions(command("export", SEA, "--lang", "python", "--name", "fog")[1])
    assert made["fog_sigma4"](2.0) == pytest.approx(told["numbers"]["blue"]["sigma"][3])
    world = read(SEA, read_toml(SEA)).world
    exact = beam_share(world.omega[1], world.c[1] * told["depth"], world.c[1] * 0.1, world.lobes)
    assert made["fog_share"](0.1, 1.0) == pytest.approx(exact, abs=0.01)
    made = functions(command("export", "fur", "--lang", "python", "--name", "hair")[1])
    assert made["hair_shadow"](0.5, 10.0) == pytest.approx(fur.shadow(0.5, 10.0, np.pi / 4))


def test_constants_of_a_file_stay_those_at_another_g(command, tmp_path):
    record = json.loads((FITS / "hazard-forward.json").read_text())
    record["constants"]["a00"]["regenerated"] += 1.0
    (tmp_path / "own.json").write_text(json.dumps(record))
    words = ("export", "hazard", "--n", "1.4", "--lang", "json")
    for g in ("0.9", "0.5"):
        own, shipped = (json.loads(command(*words, "--g", g, *more)[1]) for more in (("--constants", "own.json"), ()))
        assert own != shipped, g

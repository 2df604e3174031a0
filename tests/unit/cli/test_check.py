"""`profilefit check` as a user meets it: what passes, what fails and where, and what is no machine for it."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from profilefit.recipes import catalogue
from profilefit.recipes.evidence import stale
from profilefit.shader.check.chosen import INDICES, scope
from tests.fixtures import slow

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


@pytest.mark.parametrize(
    ("names", "constants", "told"),
    [
        (None, None, "all"),
        ([], "regenerated", "all"),
        (None, "published", "all published"),
        (["liang"], "published", ["liang"]),
    ],
)
def test_a_part_is_not_told_as_the_whole(names, constants, told):
    assert scope(names, constants) == told


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


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("nothing", "name must be a law, map or record, got 'nothing'; laws: liang, "),
        *slow(("hazzard", "did you mean hazard"), ("reproduction", "record 'reproduction' holds no law")),
        ("hazard --constants nothing", "--constants must be one of regenerated"),
        ("--constants nothing", "--constants must be regenerated or a printed set, got 'nothing'"),
        ("hazard --precision float8", "float8"),
    ],
)
def test_bad_input_is_one_line_and_status_2(refused, words, said):
    refused(f"check {words}", said)


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

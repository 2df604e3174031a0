"""`profilefit stability` as a user meets it."""

import csv
import json
import shutil

import pytest

from profilefit.recipes import catalogue
from profilefit.recipes.evidence import stale
from profilefit.studies.stability.cells import ADVICE

FITS = catalogue.fits_folder()


@pytest.mark.slow
def test_a_map_that_holds_and_one_that_folds(command, tmp_path):
    status, out, err = command("stability", "albedo-rational", "--out", "atlas")
    assert status == 0, err
    assert err == "atlas: stability*.png, .svg; stability.csv, .json\n"
    kept = json.loads((tmp_path / "atlas" / "stability.json").read_text(encoding="utf-8"))
    assert list(kept)[:3] == ["made", "of", "passed"]
    assert kept["of"] == ["albedo-rational"], "not the whole atlas"
    assert not stale(kept["made"], FITS)
    assert "ours: 1 laws, maps and functions, none has a red cell inside its range" in out
    assert max(map(len, out.splitlines())) <= 100
    with open(tmp_path / "atlas" / "stability.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    red = [row for row in rows if row["class"] != "not judged"]
    assert {(row["precision"], row["advice"]) for row in red} == {("float16 stored", ADVICE["float16 stored"])}
    assert all(row["inside_its_range"] == "0" for row in red)
    aside = [row for row in rows if row["class"] == "not judged"]
    assert aside
    assert all(row["quantity"].startswith("∂") and "differences are rounding" in row["advice"] for row in aside)


def test_json_has_every_region(command):
    status, out, _ = command("stability", "albedo-liang", "--json")
    found = json.loads(out)
    assert status == 0
    assert next(iter(found)) == "made"
    assert found["passed"] is True
    assert any(one["class"] == "NaN or Inf" and "fold" in one["advice"] for one in found["regions"])
    assert found["subjects"]["albedo-liang"]["right"] > 100


def test_a_law_of_ours_that_breaks_its_word_is_status_1(command, tmp_path):
    """A record of which one constant has the wrong sign: A is negative next to black."""
    folder = tmp_path / "records"
    folder.mkdir()
    shutil.copy(FITS / "albedo-rational.json", folder)
    path = folder / "albedo-rational.json"
    content = json.loads(path.read_text())
    content["constants"]["b"]["regenerated"] = -3.0
    path.write_text(json.dumps(content))
    status, out, _ = command("stability", "albedo-rational", "--fits", str(folder))
    assert status == 1
    assert "FAIL albedo-rational: A(α), float64, negative" in out
    assert "1 of them with red cells" in out


@pytest.mark.parametrize(
    ("words", "said"), [("hazzard", "name must be a law, map or record"), ("--out", "requires an argument")]
)
def test_bad_input_is_one_line_and_status_2(refused, words, said):
    refused(f"stability {words}", said)

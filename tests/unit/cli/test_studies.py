"""`profilefit tradeoff`, `stability` and `choose` as a user meets them, and one line for a mistake."""

import csv
import json
import shutil
from pathlib import Path

import pytest

from profilefit.recipes import catalogue
from profilefit.recipes.evidence import digest, stale
from profilefit.recipes.folder import fits_folder
from profilefit.report.tables.cells import significant
from profilefit.studies.stability.cells import ADVICE
from profilefit.studies.tradeoff.parts import is_comparable, keep, read
from tests.fixtures import EXAMPLES


def test_what_cannot_be_done_is_told_before_anything_is_measured(refused, tmp_path):
    said = "PART must be one of truth, laws, samplers, fits, sea, fur, got 'light'"
    assert refused("tradeoff laws light", said) == f"profilefit: {said}\n"
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "file").write_text("")
    refused("tradeoff laws --out file", "profilefit: cannot write into file:")


def run_of(date: str, sha256: str = "a", **parts: int) -> dict:
    """What a run found, each part with a number."""
    heads = {
        "made": {"version": "1", "sha256": sha256, "machine": {"cores": 2}, "date": date},
        "machine": {"load before": date},
    }
    return {**heads, **{name: {"number": number, **heads} for name, number in parts.items()}}


def numbers(file) -> dict[str, int]:
    return {name: value["number"] for name, value in read(file).items() if "number" in value}


def test_parts_are_kept_beside_each_other_and_a_new_one_replaces_its_own(tmp_path):
    file = tmp_path / "tradeoff.json"
    keep(file, run_of("monday", truth=1, samplers=2))
    keep(file, run_of("tuesday", laws=3))
    assert list(numbers(file)) == ["truth", "laws", "samplers"], "in their own order"
    keep(file, run_of("wednesday", truth=4))
    assert numbers(file) == {"truth": 4, "laws": 3, "samplers": 2}
    found = read(file)
    assert found["made"]["date"] == "wednesday"
    days = {name: (found[name]["made"]["date"], found[name]["machine"]["load before"]) for name in numbers(file)}
    assert days == {"truth": ("wednesday",) * 2, "laws": ("tuesday",) * 2, "samplers": ("monday",) * 2}


def test_parts_of_an_earlier_file_have_its_date(tmp_path):
    file = tmp_path / "tradeoff.json"
    before = run_of("monday", truth=1)
    file.write_text(json.dumps({**before, "truth": {"number": 1}}))
    keep(file, run_of("tuesday", laws=2))
    assert read(file)["truth"] == before["truth"]


@pytest.mark.parametrize("change", ["sha256", "version", "machine"])
def test_parts_that_do_not_compare_go(tmp_path, change):
    file = tmp_path / "tradeoff.json"
    before = run_of("monday", truth=1)
    keep(file, before)
    now = run_of("tuesday", laws=2)
    now["made"][change] = "another"
    assert is_comparable(before, run_of("tuesday"))
    assert not is_comparable(before, now)
    keep(file, now)
    assert numbers(file) == {"laws": 2}


@pytest.mark.parametrize("damaged", ["{", "[1]", "{}", '{"made": 1, "truth": {}}', "[" * 10**5])
def test_a_damaged_file_has_no_parts(tmp_path, damaged):
    file = tmp_path / "tradeoff.json"
    file.write_text(damaged)
    assert read(file) == {}
    keep(file, run_of("tuesday", laws=2))
    assert numbers(file) == {"laws": 2}


@pytest.mark.slow
def test_a_part_is_written_beside_those_of_the_same_records(command, tmp_path):
    """Twice in a folder with records of its own, which count; then with the ones shipped."""
    (tmp_path / "fits").mkdir()
    for path in fits_folder().glob("*.json"):
        if path.stem != "quantile":
            (tmp_path / "fits" / path.name).write_bytes(path.read_bytes())
    file = tmp_path / "charts" / "tradeoff.json"
    words = ("--quick", "--json", "--out", "charts")
    status, out, err = command("tradeoff", "laws", *words)
    assert (status, list(json.loads(out))) == (0, ["made", "machine", "laws"]), err
    assert file.read_text(encoding="utf-8") == out
    assert read(file)["made"]["sha256"] == digest(tmp_path / "fits") != digest(fits_folder())
    laws = read(file)["laws"]
    status, out, err = command("tradeoff", "samplers", *words)
    assert (status, list(json.loads(out))) == (0, ["made", "machine", "samplers"])
    assert err.startswith("wrote charts/tradeoff-samplers.png")
    assert list(read(file)) == ["made", "machine", "laws", "samplers"]
    assert read(file)["laws"] == laws
    status, out, err = command("tradeoff", "laws", *words, "--fits", str(fits_folder()))
    assert err.splitlines()[0] == "charts/tradeoff.json of other records, version or machine is replaced"
    assert file.read_text(encoding="utf-8") == out


@pytest.mark.slow
def test_quick_measures_charts_and_writes(done, tmp_path):
    out = done("tradeoff", "--quick", "--json", "--out", "charts", said=None)
    numbers = json.loads(out)
    assert list(numbers) == ["made", "machine", "truth", "laws", "samplers", "fits"]
    assert (tmp_path / "charts" / "tradeoff.json").read_text(encoding="utf-8") == out
    for name in ("truth", "laws", "samplers", "fits"):
        for kind in ("png", "svg", "csv"):
            assert (tmp_path / "charts" / f"tradeoff-{name}.{kind}").stat().st_size > 0
        lines = (tmp_path / "charts" / f"tradeoff-{name}.csv").read_text().splitlines()
        rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
        assert {row["panel"] for row in rows} == set(numbers[name]["panels"])
        assert "front" in {row["standing"] for row in rows}
        assert any(line.startswith("# processor: ") for line in lines)


FITS = catalogue.fits_folder()


@pytest.mark.slow
def test_a_map_that_holds_and_one_that_folds(done, tmp_path):
    said = "atlas: stability*.png, .svg; stability.csv, .json\n"
    out = done("stability", "albedo-rational", "--out", "atlas", said=said)
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


def test_json_has_every_region(done):
    found = json.loads(done("stability", "albedo-liang", "--json", said=None))
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
    shallow = changed(SEA, "depth = 8.0", "depth = 0.01")
    assert refused(f"choose {shallow}", "").startswith("profilefit: scene.toml: "), "a sea that there is not"


@pytest.mark.parametrize("kind", ["heart", "sea", "fur"])
def test_only_skin_has_a_cost_to_measure(refused, kind):
    file = EXAMPLES[f"{kind}.toml"]
    said = f"profilefit: {file}: --measure must be left out with a {kind}'s file, which has no cost ratios\n"
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
@pytest.mark.parametrize("is_turned", [True, False])
def test_whether_a_heart_needs_an_atlas(chosen, opengl, tmp_path, is_turned):
    """The heart is seen from the side that the lamp does not reach; a ball in front of it needs no atlas."""
    content = Path(HEART).read_text(encoding="utf-8")
    ball = content.replace('kind = "heart"', 'kind = "ball"').replace("paint = true", "")
    file = tmp_path / "ball.toml"
    file.write_text(ball.replace("[0.866, 0.1, 0.5]", "[0.0, 0.0, 1.0]"), encoding="utf-8")
    line, told = chosen(HEART if is_turned else file)
    assert told["verdict"] == ("atlas" if is_turned else "no atlas")
    assert 0 < told["hidden"] < told["error"]
    assert (told["error"] > told["tolerance"] == 0.02) == is_turned
    error, hidden = (f"{significant(100 * told[key])} %" for key in ("error", "hidden"))
    assert line.startswith(f"{told['verdict']}: screen space alone has an error of {error} of the light, ")
    assert f"and hidden surface causes {hidden} " in line


def test_what_a_sea_needs(chosen):
    lines, told = chosen(SEA)
    assert (told["terms"], told["splat"], told["steps"]) == ("broadened", "cells", {"light": 0, "view": 16})
    assert 0.1 == told["tolerance"] < told["haze"]["scaled"] < told["haze"]["single"] < 1.0
    scaled, single = (f"{kind} {100 * told['haze'][kind]:.2g} %" for kind in ("scaled", "single"))
    assert lines.startswith("terms: broadened; off the broadened haze at worst: ")
    for text in (scaled, single, "(requested: 10 %)", f"(F {told['focus']:.2g})", "views 16 (S 16)"):
        assert text in lines


@pytest.fixture
def fur(tmp_path, monkeypatch):
    """A file, and the study of one angle with few rays."""
    for name, value in {"PATCHES": 6, "RAYS": 100, "MOST": 16, "ANGLES": (75,)}.items():
        monkeypatch.setattr(f"profilefit.studies.choose.scenes.{name}", value)
    path = tmp_path / "fur.toml"
    path.write_text(
        'scene = "fur"\n[fur]\ndensity = 0.64\nradius = 0.5\nlength = 5\n[technique]\ntolerance = 0.1\n',
        encoding="utf-8",
    )
    return path


def test_how_many_layers_fur_needs(chosen, fur):
    lines, told = chosen(fur)
    assert (told["angle"], told["tolerance"], told["by_angle"][0]["cheapest"]) == (75, 0.1, told["way"])
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

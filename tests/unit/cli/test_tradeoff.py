"""`profilefit tradeoff` as a user meets it."""

import csv
import json

import pytest

from profilefit.recipes.evidence import digest
from profilefit.recipes.folder import fits_folder
from profilefit.studies.tradeoff.parts import is_comparable, keep, read


def test_what_cannot_be_done_is_told_before_anything_is_measured(refused, tmp_path):
    said = "PART must be one of truth, laws, samplers, fits, sea, fur, got 'light'"
    assert refused("tradeoff laws light", said) == f"profilefit: {said}\n"
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "file").write_text("")
    refused("tradeoff laws --out file", "profilefit: cannot write into file:")


def told(date: str, sha256: str = "a", **parts: int) -> dict:
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
    keep(file, told("monday", truth=1, samplers=2))
    keep(file, told("tuesday", laws=3))
    assert list(numbers(file)) == ["truth", "laws", "samplers"], "in their own order"
    keep(file, told("wednesday", truth=4))
    assert numbers(file) == {"truth": 4, "laws": 3, "samplers": 2}
    found = read(file)
    assert found["made"]["date"] == "wednesday"
    days = {name: (found[name]["made"]["date"], found[name]["machine"]["load before"]) for name in numbers(file)}
    assert days == {"truth": ("wednesday",) * 2, "laws": ("tuesday",) * 2, "samplers": ("monday",) * 2}


def test_parts_of_an_earlier_file_have_its_date(tmp_path):
    file = tmp_path / "tradeoff.json"
    before = told("monday", truth=1)
    file.write_text(json.dumps({**before, "truth": {"number": 1}}))
    keep(file, told("tuesday", laws=2))
    assert read(file)["truth"] == before["truth"]


@pytest.mark.parametrize("change", ["sha256", "version", "machine"])
def test_parts_that_do_not_compare_go(tmp_path, change):
    file = tmp_path / "tradeoff.json"
    before = told("monday", truth=1)
    keep(file, before)
    now = told("tuesday", laws=2)
    now["made"][change] = "another"
    assert is_comparable(before, told("tuesday"))
    assert not is_comparable(before, now)
    keep(file, now)
    assert numbers(file) == {"laws": 2}


@pytest.mark.parametrize("damaged", ["{", "[1]", "{}", '{"made": 1, "truth": {}}', "[" * 10**5])
def test_a_damaged_file_has_no_parts(tmp_path, damaged):
    file = tmp_path / "tradeoff.json"
    file.write_text(damaged)
    assert read(file) == {}
    keep(file, told("tuesday", laws=2))
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
    assert err.splitlines()[0] == "charts/tradeoff.json is of other records, another version or machine: written afresh"
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

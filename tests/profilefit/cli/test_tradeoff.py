"""`profilefit tradeoff` as a user meets it."""

import csv
import json

import pytest


def test_an_unknown_part_is_one_line(command, tmp_path):
    status, out, err = command("tradeoff", "laws", "light")
    assert (status, out) == (2, "")
    assert err == "profilefit: PART must be one of truth, laws, samplers, fits, got 'light'\n"
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_is_told_before_anything_is_measured(command, tmp_path):
    (tmp_path / "file").write_text("")
    status, _, err = command("tradeoff", "laws", "--out", "file")
    assert status == 2
    assert err.startswith("profilefit: cannot write into file:")


@pytest.mark.slow
def test_quick_measures_charts_and_writes(command, tmp_path):
    status, out, err = command("tradeoff", "--quick", "--json", "--out", "charts")
    assert (status, err) == (0, "")
    numbers = json.loads(out)
    assert set(numbers) == {"machine", "truth", "laws", "samplers", "fits"}
    for name in ("truth", "laws", "samplers", "fits"):
        for kind in ("png", "svg", "csv"):
            assert (tmp_path / "charts" / f"tradeoff-{name}.{kind}").stat().st_size > 0
        lines = (tmp_path / "charts" / f"tradeoff-{name}.csv").read_text().splitlines()
        rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
        assert {row["panel"] for row in rows} == set(numbers[name]["panels"])
        assert "front" in {row["standing"] for row in rows}
        assert any(line.startswith("# processor: ") for line in lines)

"""What the tables of fur rest on, one of them printed and written; random furs, small, and what is summed of them."""

import json

import numpy as np
import pytest

from benchmarks import fur, fur_choose
from benchmarks.fur_choose import COVER, DEGREES, SLENDER, TOLERANCES, Fur, Judged, furs, summary
from benchmarks.fur_layers import LINEAR, layers_for
from profilefit.studies.choose import scenes as study


def test_layers_of_an_error():
    errors = np.array(LINEAR, float) ** -0.7
    assert layers_for(20.0**-0.7, errors) == pytest.approx(20.0, rel=1e-9)
    assert np.isnan(layers_for(2.0, errors))
    assert np.isnan(layers_for(1e-6, errors))


def test_a_table_is_printed_and_written(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(fur, "XS", (1.0,))
    fur.main(["--only", "exponent", "--json", str(tmp_path / "numbers.json")])
    assert "The best exponent p" in capsys.readouterr().out
    (row,) = json.loads((tmp_path / "numbers.json").read_text())["exponent"]
    assert row["law"] == pytest.approx(2.162, abs=0.002)
    assert row["worst"] < 0.1


def test_furs_are_within_their_ends_and_the_same_again():
    found = furs(200)
    for name, ends in {"density": COVER, "length": SLENDER, "degrees": DEGREES, "tolerance": TOLERANCES}.items():
        values = [getattr(one, name) for one in found]
        assert ends[0] <= min(values) < max(values) <= ends[1]
        assert max(values) - min(values) > 0.8 * (ends[1] - ends[0])
    assert furs(200) == found != furs(200, 1)


def test_the_sum_leaves_out_what_no_way_serves():
    ways = [("swept", 12, error, least) for error, least in ((0.049, 10), (0.051, 13), (0.05, 12))]
    told = summary([Judged(Fur(0.1, 20.0, 45.0, 0.05), *way) for way in (*ways, (None,) * 4)])
    assert (told["furs"], told["with a way"], told["within"]) == (4, 3, pytest.approx(2 / 3))
    assert (told["median ratio"], told["mean ratio"]) == pytest.approx((1.0, (1.2 + 12 / 13 + 1.0) / 3))


def test_it_prints_and_writes(monkeypatch, tmp_path, capsys):
    few = {"RAYS": 100, "PATCHES": 4, "DEGREES": (0.0, 20.0)}
    for module, sizes in ((fur_choose, few), (study, {"RAYS": 50, "MOST": 16})):
        for name, size in sizes.items():
            monkeypatch.setattr(module, name, size)
    path = tmp_path / "numbers.json"
    fur_choose.main(["--furs", "2", "--json", str(path)])
    told = json.loads(path.read_text(encoding="utf-8"))
    assert len(told["furs"]) == told["summary"]["furs"] == 2
    for row in told["furs"]:
        assert row["layers"] is None or row["least"] <= 1.5 * row["layers"]
    assert "mean ratio" in capsys.readouterr().out

"""What the tables of fur rest on, and one of them printed and written."""

import json

import numpy as np
import pytest

from benchmarks import fur
from benchmarks.fur_layers import LINEAR, layers_for


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

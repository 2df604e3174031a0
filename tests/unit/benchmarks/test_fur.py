"""What the tables of fur rest on, and one of them printed and written."""

import json

import numpy as np
import pytest

from benchmarks import fur
from benchmarks.fur_feet import mean_shadow, shared_shadow
from benchmarks.fur_layers import LINEAR, layers_for
from profilefit.scenes.fur.law import shadow


def test_a_shadow_that_two_share():
    """All of it where both look the same way, the shorter where one looks over the other, else the root at least."""
    for eye in (0.0, 0.02, 0.4, 1.2):
        assert shared_shadow(0.05, 1.0, eye, eye) == pytest.approx(shadow(0.05, 1.0, eye))
        assert shared_shadow(0.05, 1.0, eye, 1.3) == pytest.approx(shadow(0.05, 1.0, eye))
        assert shared_shadow(0.05, 1.0, eye, 1.3, np.pi) == pytest.approx(np.pi * 0.05**2)
    # Against places that are tried, turned by 20 degrees.
    turn, rng = np.radians(20.0), np.random.default_rng(1)
    place = rng.uniform([-0.05, -0.05], [1.0, 0.5], (400_000, 2))

    def within(long, turned):
        along = place @ np.array([np.cos(turned), np.sin(turned)])
        aside = place @ np.array([-np.sin(turned), np.cos(turned)])
        # The hull of the disc and the tip: the discs of the cone at each height, between its tangents.
        sine = 0.05 / long
        beyond = along > 0.05 * sine
        spike = beyond & (along <= long) & (np.abs(aside) <= (long - along) * sine / np.sqrt(1.0 - sine**2))
        return spike | (along**2 + aside**2 <= 0.05**2)

    both = np.mean(within(0.5, 0.0) & within(0.8, turn)) * 1.05 * 0.55
    assert shared_shadow(0.05, 1.0, np.arctan(0.5), np.arctan(0.8), turn) == pytest.approx(both, rel=0.03)


def test_a_mean_shadow_is_that_of_leans_drawn():
    for degrees in (0.0, 50.0):
        theta, drawn = np.radians(degrees), np.random.default_rng(2).normal(0.0, 0.3 / 2.0**0.5, (200_000, 2))
        aside = np.hypot(np.tan(theta) - drawn[:, 0], drawn[:, 1])
        assert mean_shadow(theta, 0.3) == pytest.approx(np.mean(shadow(0.05, 1.0, np.arctan(aside))), rel=0.005)


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

"""Table 1's measures on data made by hand, and the rows that match print beside those that do not."""

import dataclasses
import json

import numpy as np
import pytest

from profilefit.materials import BY_NAME
from profilefit.recipes.table1 import (
    NORMALIZED_DIFFUSION,
    mean_squared_errors,
    normalized_diffusion,
    printed_halves,
    r_squared,
    rational,
    table1,
)


@pytest.fixture(scope="module")
def rows():
    return table1()


def _row(rows, material, model, choice):
    (row,) = [r for r in rows if (r.material, r.channel, r.model, r.range_choice) == (material, "red", model, choice)]
    return row


def test_mean_squared_errors_by_hand():
    assert mean_squared_errors(np.array([1.0, 2, 3, 4]), np.array([1.0, 0, 3, 1])) == (2.0, 4.5, 3.25)


def test_r_squared_by_hand():
    data, law = np.array([1.0, 2, 3, 0, 2, 4]), np.array([1.0, 2, 3, 1, 2, 3])
    r2 = r_squared(law, data)
    assert r2["determination"][:2] == pytest.approx([1.0, 1 - 2 / 8])
    assert r2["explained"][:2] == pytest.approx([1.0, 2 / 4])
    assert r2["correlation"][:2] == pytest.approx([1.0, 1.0])


def test_definitions_of_r_squared_agree_for_a_regression_only():
    x = np.linspace(0, 1, 50)
    data = np.concatenate([x + 0.1 * np.sin(40 * x)] * 2)
    slope, shift = np.polyfit(np.tile(x, 2), data, 1)
    fitted = r_squared(slope * np.tile(x, 2) + shift, data)
    assert fitted["explained"] == pytest.approx(fitted["determination"])
    shifted = r_squared(slope * np.tile(x, 2) + shift + 0.3, data)
    assert shifted["correlation"] == pytest.approx(fitted["correlation"])
    assert shifted["determination"][2] < shifted["explained"][2] < shifted["correlation"][2]


def test_models_hold_their_energy():
    r = (np.arange(400000) + 0.5) * 1e-3
    energy = 2 * np.pi * 1e-3 * normalized_diffusion(r, 0.5, 2.0).sum()
    assert energy == pytest.approx(0.5, rel=1e-4)
    energy = 2 * np.pi * 1e-3 * rational(r, 0.9, 0.415, 2.0, 0.0641, True).sum()
    assert energy == pytest.approx(0.415, rel=1e-4)


def test_materials_of_the_table():
    assert BY_NAME["potato"].mfp[0] == pytest.approx(1 / 0.6824)
    assert BY_NAME["ketchup"].alpha == pytest.approx([0.7469, 0.0673, 0.0203], abs=1e-4)


def test_apple_comes_out_one_stride_before_the_end_of_the_walk(rows):
    choice = "one stride before (6)"
    diffusion = _row(rows, "apple", NORMALIZED_DIFFUSION, choice)
    assert diffusion.range_mm == pytest.approx(8.0)
    assert diffusion.mse_over_printed == pytest.approx((1, 1, 1), abs=0.03)
    corrected = _row(rows, "apple", "paper, b0 = .0641", choice)
    assert corrected.mse_over_printed == pytest.approx((1, 1, 1), abs=0.08)
    printed = _row(rows, "apple", "paper as printed", choice)
    assert min(printed.mse_over_printed) > 1000


def test_printed_r_squared_is_explained_over_explained_and_residual(rows):
    for material in ("apple", "marble"):
        for model in (NORMALIZED_DIFFUSION, "paper, b0 = .0641"):
            gaps = _row(rows, material, model, "one stride before (6)").r2_minus_printed
            assert abs(gaps["explained"][0]) < 0.001
            assert abs(gaps["explained"][2]) < 0.001
            assert abs(gaps["explained"][1]) < abs(gaps["determination"][1]) / 3
    # and what is not reproduced stays visible: normalized diffusion's .50 over the second half
    assert _row(rows, "apple", NORMALIZED_DIFFUSION, "one stride before (6)").r2_minus_printed["explained"][1] > 0.1


def test_ketchup_is_not_reproduced(rows):
    ketchup = [r for r in rows if r.material == "ketchup"]
    assert min(max(abs(x - 1) for x in r.mse_over_printed) for r in ketchup) > 0.15


def test_one_printed_half_contradicts_its_whole():
    off = {(c.material, c.model): c.off for c in printed_halves()}
    assert off.pop(("apple", "paper")) > 0.004
    assert max(map(abs, off.values())) < 0.0005


def test_rows_are_plain_data(rows):
    assert len(json.loads(json.dumps([dataclasses.asdict(r) for r in rows], allow_nan=False))) == len(rows)

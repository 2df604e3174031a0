"""Cells of arguments, their classes, and the regions that they make."""

from dataclasses import replace

import numpy as np
import pytest

from profilefit.studies.stability import cells
from profilefit.studies.stability.cells import ArgumentGrid, Cells, Verdict, axis, regions_of, relative


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64])
def test_every_cell_is_a_number_of_its_format(dtype):
    """Lengths reach both ends of what is accepted, and beyond."""
    grid = ArgumentGrid.of(dtype)
    for at in (grid.alpha, grid.x, grid.xi, grid.mfp):
        np.testing.assert_array_equal(at.values.astype(dtype).astype(float), at.values)
        assert np.all(np.diff(at.values) > 0)
    limits = np.finfo(dtype)
    assert (grid.alpha.values[0], grid.alpha.values[-1]) == (0, 1)
    assert {float(limits.smallest_subnormal), float(limits.tiny)} <= set(grid.alpha.values)
    assert {float(limits.max), np.inf} <= set(grid.x.values)
    assert 1.0 - float(limits.epsneg) in grid.xi.values
    low, high = cells.LENGTHS[dtype]
    accepted = grid.mfp.values[grid.accepted]
    assert (np.min(accepted), np.max(accepted)) == (dtype(low), dtype(high))
    assert not np.all(grid.accepted)
    assert np.all(ArgumentGrid.of(dtype, beyond=False).mfp.values <= max(high, 1e3))


def test_numbers_as_a_person_writes_them_and_a_span_says_all_where_it_is_all():
    values = (0.0, 2.0**-24, 1 - 2.0**-53, 0.25, np.inf, 1.0)
    assert [cells.shown(value) for value in values] == ["0", "2^-24", "1-2^-53", "0.25", "inf", "1"]
    spans = [axis("α", [0.0, 0.5, 1.0]).span(*ends) for ends in ((0, 2), (1, 2), (1, 1))]
    assert spans == ["all α", "α 0.5 … 1", "α 0.5"]
    assert cells.labelled("of", ("r = -1", "l = 0")).span(0, 1) == "r = -1, l = 0"


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"value": 1.0, "reference": 1.0 + 1e-4}, Verdict.RIGHT),
        ({"value": 1.0, "reference": 1.01}, Verdict.INACCURATE),
        ({"value": 1.0, "reference": 1.01, "judge": False}, Verdict.OUTSIDE),
        ({"value": -1.0, "reference": 1.0}, Verdict.NEGATIVE),
        ({"value": np.nan, "reference": 1.0}, Verdict.NOT_FINITE),
        ({"value": np.nan, "reference": np.nan, "judge": False}, Verdict.NOT_FINITE),
        ({"value": np.inf, "reference": 1.0}, Verdict.NOT_FINITE),
        ({"value": np.inf, "reference": np.inf}, Verdict.RIGHT),
        ({"value": np.inf, "reference": 1e39, "arithmetic": cells.FLOAT32}, Verdict.BEYOND),
        ({"value": 0.0, "reference": 1e-40, "arithmetic": cells.FLOAT32}, Verdict.BEYOND),
        ({"value": 1.0, "reference": 1e-40, "arithmetic": cells.FLOAT32}, Verdict.INACCURATE),
        ({"value": 0.0, "reference": 1e-20, "dim": True}, Verdict.BEYOND),
        ({"value": 0.0, "reference": 1e-20}, Verdict.INACCURATE),
        ({"value": 1.0, "reference": 1.0, "wrong_way": True}, Verdict.NOT_MONOTONE),
        ({"value": 7.0, "reference": np.nan}, Verdict.NOT_JUDGED),
        ({"value": 7.0, "reference": np.nan, "judge": False}, Verdict.OUTSIDE),
        ({"value": -7.0, "reference": np.nan}, Verdict.NEGATIVE),
        ({"value": 7.0, "reference": np.nan, "wrong_way": True}, Verdict.NOT_MONOTONE),
    ],
)
def test_class_of_a_cell(given, expected):
    of = {name: np.array([one]) for name, one in given.items() if name != "arithmetic"}
    error, arithmetic = relative(of["value"], of["reference"]), given.get("arithmetic", cells.FLOAT64)
    assert Cells("f", True, "cdf", arithmetic, (axis("x", [1.0]),), **of, error=error, bound=1e-3).codes[0] == expected


@pytest.mark.parametrize("bound", [np.inf, np.nan])
def test_without_a_bound_nothing_is_right(bound):
    one, judge = np.ones(2), np.array([True, False])
    tensor = Cells("f", True, "cdf", cells.FLOAT64, (axis("x", one),), one, one, 0.0 * one, bound, judge=judge)
    np.testing.assert_array_equal(tensor.codes, [Verdict.NOT_JUDGED, Verdict.OUTSIDE])
    # A figure shows the largest class over all lengths: what is not judged beside what is right.
    assert max(Verdict.RIGHT, Verdict.OUTSIDE, Verdict.BEYOND, Verdict.NOT_JUDGED) == Verdict.NOT_JUDGED
    assert not Verdict.NOT_JUDGED.is_red


def test_failures_are_the_red_classes_inside():
    codes = np.array(list(Verdict), np.int8)
    one = np.ones(codes.shape)
    at = axis("x", np.arange(codes.size))
    for inside in (True, False):
        tensor = Cells("f", True, "cdf", cells.FLOAT64, (at,), one, one, one, 0.1, np.full(codes.shape, inside), codes)
        failures = {region.verdict for region in regions_of(tensor) if region.is_failure}
        assert failures == {each for each in Verdict if inside and each.is_red}


def test_steps_count_beyond_rounding_only():
    rising = np.array([[1.0, 2.0, 2.0 - 1e-15, 1.9, np.inf, np.nan]])
    down = cells.steps_down(rising, 1, np.float64)
    np.testing.assert_array_equal(down, [[False, False, False, True, False, False]])
    np.testing.assert_array_equal(cells.steps_up(-rising, 1, np.float64), down)
    assert not cells.steps_down(rising, 1, np.float16)[0, 3] or 16 * np.finfo(np.float16).eps * 2.0 < 0.1


def test_errors_of_equal_infinities_are_none():
    value, right = np.array([np.inf, 0.0, 1.0]), np.array([np.inf, 0.0, 2.0])
    np.testing.assert_array_equal(relative(value, right), [0.0, 0.0, 0.5])
    np.testing.assert_array_equal(cells.absolute(value, right), [0.0, 0.0, 1.0])


def small_cells(codes, **changed):
    """A tensor of half precision over l."""
    axes, one = (axis("α", [0.5]), axis("l", [1.0, 2.0, 2.0**-14], "length")), np.ones((1, 3))
    tensor = Cells("f", False, "cdf", cells.TEXT16, axes, one, one, one, 0.1, one > 0, np.array([codes], np.int8))
    return replace(tensor, **changed)


def test_neighbours_of_one_class_are_one_region():
    wrong, fine, not_finite = Verdict.INACCURATE, Verdict.RIGHT, Verdict.NOT_FINITE
    assert [one.count for one in regions_of(small_cells([wrong, wrong, fine]))] == [2]
    assert [one.count for one in regions_of(small_cells([wrong, fine, wrong]))] == [1, 1]
    assert [one.verdict for one in regions_of(small_cells([not_finite, wrong, wrong]))] == [wrong, not_finite]
    assert regions_of(small_cells([fine, Verdict.OUTSIDE, Verdict.BEYOND])) == []


def test_a_region_has_its_worst_cell_its_advice_and_why_it_is_not_judged():
    (region,) = regions_of(small_cells([Verdict.INACCURATE] * 3, error=np.array([[0.2, 0.5, 0.3]])))
    assert (region.place, region.error, region.where) == ("α 0.5; l 2", 0.5, "α 0.5; all l")
    (region,) = regions_of(small_cells([Verdict.NOT_JUDGED] * 3, unjudged="no text"))
    assert (region.verdict, region.advice) == (Verdict.NOT_JUDGED, "no text")
    assert not region.is_failure
    assert set(cells.ADVICE) == set(cells.ARITHMETICS)
    (region,) = regions_of(small_cells([Verdict.INACCURATE] * 3))
    assert region.advice == cells.ADVICE[cells.TEXT16]
    (region,) = regions_of(small_cells([Verdict.INACCURATE] * 3, advice="mend it"))
    assert region.advice == "mend it"

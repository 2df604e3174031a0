"""Each class is given where it belongs, and only there."""

import numpy as np
import pytest

from profilefit.studies.stability.cells import Cells, Verdict, absolute, judged, relative, steps_down, steps_up
from profilefit.studies.stability.layout import FLOAT64, ArgumentAxis

BOUND = 1e-3


def verdict(value, reference, inside=True, dtype=np.float64, dim=False, wrong_way=False):
    value, reference = np.array([value]), np.array([reference])
    error = relative(value, reference)
    codes = judged(value, reference, error, BOUND, np.array([inside]), dtype, np.array([dim]), np.array([wrong_way]))
    return Verdict(codes[0])


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"value": 1.0, "reference": 1.0 + 1e-4}, Verdict.RIGHT),
        ({"value": 1.0, "reference": 1.01}, Verdict.INACCURATE),
        ({"value": 1.0, "reference": 1.01, "inside": False}, Verdict.OUTSIDE),
        ({"value": -1.0, "reference": 1.0}, Verdict.NEGATIVE),
        ({"value": np.nan, "reference": 1.0}, Verdict.NOT_FINITE),
        ({"value": np.nan, "reference": np.nan, "inside": False}, Verdict.NOT_FINITE),
        ({"value": np.inf, "reference": 1.0}, Verdict.NOT_FINITE),
        ({"value": np.inf, "reference": np.inf}, Verdict.RIGHT),
        ({"value": np.inf, "reference": 1e39, "dtype": np.float32}, Verdict.BEYOND),
        ({"value": 0.0, "reference": 1e-40, "dtype": np.float32}, Verdict.BEYOND),
        ({"value": 1.0, "reference": 1e-40, "dtype": np.float32}, Verdict.INACCURATE),
        ({"value": 0.0, "reference": 1e-20, "dim": True}, Verdict.BEYOND),
        ({"value": 0.0, "reference": 1e-20}, Verdict.INACCURATE),
        ({"value": 1.0, "reference": 1.0, "wrong_way": True}, Verdict.NOT_MONOTONE),
        ({"value": 7.0, "reference": np.nan}, Verdict.NOT_JUDGED),
        ({"value": 7.0, "reference": np.nan, "inside": False}, Verdict.OUTSIDE),
        ({"value": -7.0, "reference": np.nan}, Verdict.NEGATIVE),
        ({"value": 7.0, "reference": np.nan, "wrong_way": True}, Verdict.NOT_MONOTONE),
    ],
)
def test_class_of_a_cell(given, expected):
    assert verdict(**given) == expected


@pytest.mark.parametrize("bound", [np.inf, np.nan])
def test_without_a_bound_nothing_is_right(bound):
    one = np.ones(2)
    codes = judged(one, one, 0.0 * one, bound, np.array([True, False]), np.float64)
    np.testing.assert_array_equal(codes, [Verdict.NOT_JUDGED, Verdict.OUTSIDE])


def test_what_is_not_judged_shows_beside_what_is_right():
    """A figure shows the largest class over all lengths."""
    assert max(Verdict.RIGHT, Verdict.OUTSIDE, Verdict.BEYOND, Verdict.NOT_JUDGED) == Verdict.NOT_JUDGED
    assert not Verdict.NOT_JUDGED.is_red


def test_failures_are_the_red_classes_inside():
    codes = np.array(list(Verdict), np.int8)
    one = np.ones(codes.shape)
    axis = ArgumentAxis("x", "-", np.arange(1.0 * codes.size))
    for inside in (True, False):
        cells = Cells("f", True, "cdf", FLOAT64, (axis,), one, one, one, 0.1, np.full(codes.shape, inside), codes)
        np.testing.assert_array_equal(cells.failures, [inside and each.is_red for each in Verdict])


def test_steps_count_beyond_rounding_only():
    rising = np.array([[1.0, 2.0, 2.0 - 1e-15, 1.9, np.inf, np.nan]])
    np.testing.assert_array_equal(steps_down(rising, 1, np.float64), [[False, False, False, True, False, False]])
    np.testing.assert_array_equal(steps_up(-rising, 1, np.float64), steps_down(rising, 1, np.float64))
    assert not steps_down(rising, 1, np.float16)[0, 3] or 16 * np.finfo(np.float16).eps * 2.0 < 0.1


def test_errors_of_equal_infinities_are_none():
    value, right = np.array([np.inf, 0.0, 1.0]), np.array([np.inf, 0.0, 2.0])
    np.testing.assert_array_equal(relative(value, right), [0.0, 0.0, 0.5])
    np.testing.assert_array_equal(absolute(value, right), [0.0, 0.0, 1.0])

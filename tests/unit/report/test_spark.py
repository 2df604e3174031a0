"""Rows of blocks: high where a number is large, and no higher than it is."""

import math

import pytest

from profilefit.report.tables.cells import BLOCKS, span, spark


def test_powers_of_ten_are_even_steps():
    values = [10.0**power for power in range(8)]
    assert spark(values, span([values])) == BLOCKS
    assert spark(values[::-1], span([values])) == BLOCKS[::-1]


def test_one_scale_for_several_rows():
    good, bad = [1e-4, 2e-4], [0.5, 1.0]
    ends = span([good, bad])
    assert ends == (1e-4, 1.0)
    assert max(spark(good, ends)) < min(spark(bad, ends))
    assert spark([1e-9, 9.0], ends) == BLOCKS[0] + BLOCKS[-1], "beyond the ends it stays at them"


def test_of_many_values_the_largest_of_each_stretch_is_shown():
    values = [1.0] * 24
    values[13] = 1e7
    shown = spark(values, span([values]), 12)
    assert shown == BLOCKS[0] * 6 + BLOCKS[-1] + BLOCKS[0] * 5
    assert len(spark(values[:5], span([values]), 12)) == 5


@pytest.mark.parametrize("nothing", [None, math.nan, math.inf, 0.0, -1.0])
def test_what_is_no_positive_number_is_a_gap(nothing):
    assert spark([1.0, nothing, 10.0], (1.0, 10.0)) == BLOCKS[0] + " " + BLOCKS[-1]
    assert spark([nothing, nothing], span([[nothing, nothing]])) == "  "


def test_equal_numbers_have_no_scale():
    assert spark([2.0, 2.0], span([[2.0, 2.0]])) == BLOCKS[0] * 2
    assert spark([], None) == ""

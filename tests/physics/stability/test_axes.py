"""The cells of each argument are numbers of their format, and read as a person writes them."""

import numpy as np
import pytest

from profilefit.studies.stability import layout
from profilefit.studies.stability.layout import LENGTHS, ArgumentGrid

DTYPES = (np.float16, np.float32, np.float64)


@pytest.mark.parametrize("dtype", DTYPES)
def test_every_cell_is_a_number_of_its_format(dtype):
    grid = ArgumentGrid.of(dtype)
    for axis in (grid.alpha, grid.x, grid.xi, grid.mfp):
        np.testing.assert_array_equal(axis.values.astype(dtype).astype(float), axis.values)
        assert np.all(np.diff(axis.values) > 0)
    limits = np.finfo(dtype)
    assert grid.alpha.values[0] == 0
    assert grid.alpha.values[-1] == 1
    assert {float(limits.smallest_subnormal), float(limits.tiny)} <= set(grid.alpha.values)
    assert {float(limits.max), np.inf} <= set(grid.x.values)
    assert 1.0 - float(limits.epsneg) in grid.xi.values


@pytest.mark.parametrize("dtype", DTYPES)
def test_lengths_reach_both_ends_of_what_is_accepted_and_beyond(dtype):
    low, high = LENGTHS[dtype]
    grid = ArgumentGrid.of(dtype)
    assert np.min(grid.mfp.values[grid.accepted]) == dtype(low)
    assert np.max(grid.mfp.values[grid.accepted]) == dtype(high)
    assert not np.all(grid.accepted)
    assert np.all(ArgumentGrid.of(dtype, beyond=False).mfp.values <= max(high, 1e3))


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (2.0**-24, "2^-24"), (1 - 2.0**-53, "1-2^-53"), (0.25, "0.25"), (np.inf, "inf"), (1.0, "1")],
)
def test_numbers_as_a_person_writes_them(value, text):
    assert layout.shown(value) == text


def test_a_span_says_all_where_it_is_all():
    axis = layout.ArgumentAxis("α", "-", np.array([0.0, 0.5, 1.0]))
    assert axis.span(0, 2) == "all α"
    assert axis.span(1, 2) == "α 0.5 … 1"
    assert axis.span(1, 1) == "α 0.5"
    assert layout.ArgumentAxis("of", "-", np.arange(2.0), ("r = -1", "l = 0")).span(0, 1) == "r = -1, l = 0"

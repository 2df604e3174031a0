"""The walk of (6), stride by stride, and where it stops."""

import numpy as np
import pytest

from profilefit.fitting.profiles import trimmed_radius, walk


def test_strides_by_hand():
    """.05 on [0, .5], .1 to 1, .2 to 2, .5 to 5, 1 beyond."""
    expected = [0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]
    expected += [1.2, 1.4, 1.6, 1.8, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 6.0, 7.0, 8.0]
    np.testing.assert_allclose(walk(8.0), expected, rtol=1e-14)


@pytest.mark.parametrize(("last", "end"), [(8.5, 9.0), (6.0, 6.0), (0.3, 5.0)])
def test_the_walk_reaches_the_last_radius(last, end):
    """The strides of (6) up to 5 are always there; the caller keeps what he has data for."""
    assert walk(last)[-1] >= min(last, end)
    assert walk(last).max() <= max(last + 1, 5.0)


@pytest.mark.parametrize(("rate", "expected"), [(1.0, 6.0), (2.0, 3.0), (4.0, 1.4), (12.0, 0.45), (0.6, 9.0)])
def test_an_exponential_is_cut_where_it_should_be(rate, expected):
    """e^(-k r) <= .005 beyond ln 200 / k = 5.298 / k: the first radius of the walk past that."""
    r = (np.arange(4000) + 0.5) * 0.005
    data = np.exp(-rate * r)
    # The first ring's centre stands for r = 0: its value is lower by e^(-rate * .0025), too little to move a stride.
    assert trimmed_radius(r, data) == pytest.approx(expected, rel=1e-12)
    assert 5.298 / rate <= expected


def test_a_looser_bound_cuts_earlier():
    r = (np.arange(2000) + 0.5) * 0.005
    assert trimmed_radius(r, np.exp(-r), 0.05) == 3.0  # ln 20 = 2.996
    assert trimmed_radius(r, np.exp(-r), 0.5) == pytest.approx(0.7)  # ln 2 = .693


def test_between_rings_the_data_are_straight_lines():
    """Rings at 0.5, 1.5, 2.5 with 1, .5, 0: at 2.5 the line reaches 0; (6) asks at 2.0 (.25) and at 2.5."""
    assert trimmed_radius(np.array([0.5, 1.5, 2.5]), np.array([1.0, 0.5, 0.0])) == 2.5


def test_data_that_never_fall_end_at_the_last_ring():
    r = np.array([0.5, 1.5, 2.5])
    assert trimmed_radius(r, np.ones(3)) == 2.5


def test_the_largest_value_stands_for_the_one_at_0():
    """r R_d is zero in the middle: a walk that took the first value for the largest would stop at once."""
    r = (np.arange(2000) + 0.5) * 0.01
    assert trimmed_radius(r, r * np.exp(-r)) == 9.0  # r e^(1 - r) is .0073 at 8 and .0030 at 9

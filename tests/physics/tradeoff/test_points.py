"""The front: by hand, against a plain twin, and with errors on both axes."""

import numpy as np
import pytest

from profilefit.studies.tradeoff.points import BEATEN, FRONT, TIED, Point, WithSpread, front, standings


def point(cost, error, worst=None, spread=0.0):
    """Known to a share `spread` on either side."""

    def known(value):
        return WithSpread(value, value * (1 - spread), value * (1 + spread))

    return Point("panel", "method", "", known(cost), known(error), None if worst is None else known(worst))


def test_measured_is_the_median_between_its_percentiles():
    found = WithSpread.of(np.arange(101.0))
    assert (found.value, found.low, found.high) == (50.0, 16.0, 84.0)
    assert WithSpread.exactly(2) == WithSpread(2.0, 2.0, 2.0)
    assert WithSpread(1.0, 0.9, 1.1).is_below(WithSpread(1.3, 1.2, 1.4))
    assert not WithSpread(1.0, 0.9, 1.2).is_below(WithSpread(1.3, 1.2, 1.4))


def test_front_of_what_is_known_without_error():
    points = [point(*one) for one in ((1, 0.5), (2, 0.3), (3, 0.1), (4, 0.2), (0.5, 0.9), (3, 0.1), (2, 0.4))]
    assert [points[i].cost.value for i in front(points)] == [0.5, 1, 2, 3, 3]
    assert standings(points) == [FRONT, FRONT, FRONT, BEATEN, FRONT, FRONT, TIED]
    assert standings([]) == []


def test_front_is_what_the_plain_definition_says():
    """Distinct numbers without error: on the front is what no other is below in both."""
    values = np.random.default_rng(1).random((60, 2))
    plain = [not any(np.all(other < one) for other in values) for one in values]
    assert [standing == FRONT for standing in standings([point(*one) for one in values])] == plain


def test_beaten_is_only_what_is_worse_by_more_than_the_errors_in_both():
    better = point(1.0, 0.1, spread=0.1)
    assert standings([better, point(1.5, 0.15, spread=0.1)])[1] == BEATEN
    assert standings([better, point(1.1, 0.5, spread=0.1)])[1] == TIED  # as fast, within the errors
    assert standings([better, point(5.0, 0.11, spread=0.1)])[1] == TIED  # as near
    assert standings([better, point(1.1, 0.11, spread=0.1)]) == [FRONT, FRONT]
    assert standings([better, point(1.5, 0.05, spread=0.1)]) == [FRONT, FRONT]


def test_both_errors_must_be_smaller():
    assert standings([point(1.0, 0.1, worst=0.5), point(2.0, 0.2, worst=0.4)]) == [FRONT, FRONT]
    assert standings([point(1.0, 0.1, worst=0.3), point(2.0, 0.2, worst=0.4)]) == [FRONT, BEATEN]


def test_there_is_always_a_front():
    """Ties are not transitive: in a ring of them all would be off it. (Three of the sets drawn here are such rings.)"""
    generator = np.random.default_rng(0)
    for _ in range(3000):
        middles, spreads = generator.random((2, generator.integers(1, 9), 2))
        ends = np.stack([middles, middles - 0.4 * spreads, middles + 0.4 * spreads], axis=-1)
        points = [Point("", "", "", WithSpread(*cost), WithSpread(*error)) for cost, error in ends.tolist()]
        assert front(points)


@pytest.mark.parametrize("shift", [0.0, 3.0])
def test_front_does_not_depend_on_the_order(shift):
    values = np.random.default_rng(2).random((20, 2)) + shift
    order = np.random.default_rng(3).permutation(20)
    there = standings([point(*one, spread=0.05) for one in values])
    shuffled = standings([point(*one, spread=0.05) for one in values[order]])
    assert shuffled == [there[i] for i in order]

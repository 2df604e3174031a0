"""The front, by hand and against a plain twin; turns, rates and pinning; fitted laws and their limit without noise."""

import time
from dataclasses import replace

import numpy as np
import pytest

from profilefit.recipes import catalogue
from profilefit.studies.tradeoff import fits, stopwatch
from profilefit.studies.tradeoff.fits import FittedConstants, Trial
from profilefit.studies.tradeoff.points import BEATEN, FRONT, TIED, Point, WithSpread, front, standings
from profilefit.studies.tradeoff.stopwatch import Rates


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
    # Of distinct numbers, on the front is what no other is below in both.
    values = np.random.default_rng(1).random((60, 2))
    plain = [not any(np.all(other < one) for other in values) for one in values]
    assert [standing == FRONT for standing in standings([point(*one) for one in values])] == plain


def test_beaten_is_only_what_is_worse_by_more_than_the_errors_in_both():
    """As fast within the errors, or as near, is tied; and of two errors both must be smaller."""
    better = point(1.0, 0.1, spread=0.1)
    for cost, error, standing in ((1.5, 0.15, BEATEN), (1.1, 0.5, TIED), (5.0, 0.11, TIED)):
        assert standings([better, point(cost, error, spread=0.1)])[1] == standing
    for cost, error in ((1.1, 0.11), (1.5, 0.05)):
        assert standings([better, point(cost, error, spread=0.1)]) == [FRONT, FRONT]
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
    assert standings([point(*one, spread=0.05) for one in values[order]]) == [there[i] for i in order]


def test_works_take_turns_after_an_untimed_one():
    calls, shown = [], []

    def track(turns, title):
        shown.append((list(turns), title))
        return turns

    def work(name, seconds):
        def run(seed):
            calls.append((name, seed))
            time.sleep(seconds * (10 if seed == 0 else 1))
            return 2

        return run

    rates = stopwatch.take_turns({"a": work("a", 0.002), "b": work("b", 0.004)}, 3, track, "both")
    assert calls == [(name, seed) for seed in range(4) for name in "ab"]
    assert shown == [([0, 1, 2, 3], "both")]
    assert all(len(rates.by_name[name]) == 3 for name in "ab")
    assert np.all(rates.seconds("a") >= 0.001)  # of one of the two
    assert rates.first["a"] >= 0.02 > 0.0


def test_what_disturbs_a_turn_disturbs_no_ratio():
    rates = Rates({"slow": [1.0, 0.1, 1.0], "fast": [4.0, 0.4, 4.0]})
    np.testing.assert_allclose(rates.times("slow", "fast"), 4.0)
    ratio = rates.ratio("fast", "slow")
    assert ((ratio.median, ratio.least, ratio.most), str(ratio)) == (pytest.approx((4.0, 4.0, 4.0)), "4.00")
    assert str(Rates({"a": [30.0, 10.0], "b": [1.0, 1.0]}).ratio("a", "b")) == "20.0 (10.0 ... 30.0)"
    assert rates.best("slow") == 1.0


def test_one_core_and_back():
    before = stopwatch.cores()
    with stopwatch.on_one_core() as pinned:
        assert not pinned or stopwatch.cores() == before[-1:]
    assert stopwatch.cores() == before


def test_change_is_that_of_the_energies():
    """a and b a hundredth larger, and c as it was: so is every ring's energy."""
    law = catalogue.load("liang", "corrected")
    assert fits.change(law, law) == (0.0, 0.0)
    larger = replace(law, **{name: 1.01 * getattr(law, name) for name in ("a1", "a2", "b0")})
    energy, counts = fits.judged()
    share = np.diff(fits.energy_within(law), axis=1)[counts] / energy[counts]
    rms, worst = fits.change(larger, law)
    assert rms == pytest.approx(0.01 * np.sqrt(np.mean(share**2)), rel=1e-9)
    assert worst == pytest.approx(0.01 * share.max(), rel=1e-9)


def test_standardised_is_in_standard_errors():
    limit = FittedConstants({"a": 1.0, "b": 2.0}, {}, "converged")
    found = FittedConstants({"a": 1.3, "b": 1.2}, {"a": 0.1, "b": 0.2}, "converged")
    assert fits.standardised(found, limit) == pytest.approx(np.sqrt((9.0 + 16.0) / 2.0))
    assert np.isnan(fits.standardised(limit, limit))


def test_points_have_the_spread_of_the_seeds_and_failures_are_told():
    trials = [Trial(0.1 * k, 1.0, 0.01 * k, 0.1 * k, 1.0, k != 2) for k in (1, 2, 3)]
    alone, whole = (fits.point_of(panel, "way", 10**6, trials) for panel in ("fit", "whole"))
    assert (alone.cost.value, whole.cost.value, alone.error.value) == pytest.approx((0.2, 1.2, 0.02))
    assert alone.error.low < alone.error.value < alone.error.high
    assert (alone.label, alone.facts["converged"]) == ("1e6 photons", 2)
    assert fits.notes_of({("way", 10**6): trials}, {"way": 3.0}) == (
        "1 of 3 did not converge: way, 1e+06 photons",
        "first fits, which compile, not in the times [s]: way 3.0",
    )


@pytest.mark.slow
def test_more_photons_move_the_law_less():
    part = fits.measure(fits.FitSizes((1_000_000, 20_000_000), (), 3))
    alone = {(point.method, point.facts["photons"]): point for point in part.panels[0].points}
    for method in (fits.ALL_AT_ONCE, fits.TWO_STAGES):
        few, many = alone[method, 1_000_000], alone[method, 20_000_000]
        assert many.error.value < few.error.value
        assert few.facts["converged"] == many.facts["converged"] == 3
    whole = part.panels[1].points
    assert all(point.cost.value > alone[point.method, point.facts["photons"]].cost.value for point in whole)

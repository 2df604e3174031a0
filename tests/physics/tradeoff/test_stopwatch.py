"""Turns, rates and pinning."""

import time

import numpy as np
import pytest

from profilefit.studies.tradeoff import stopwatch
from profilefit.studies.tradeoff.stopwatch import Rates


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
    assert (ratio.median, ratio.least, ratio.most) == pytest.approx((4.0, 4.0, 4.0))
    assert str(ratio) == "4.00"
    assert str(Rates({"a": [30.0, 10.0], "b": [1.0, 1.0]}).ratio("a", "b")) == "20.0 (10.0 ... 30.0)"
    assert rates.best("slow") == 1.0


def test_one_core_and_back():
    before = stopwatch.cores()
    with stopwatch.on_one_core() as pinned:
        assert not pinned or stopwatch.cores() == before[-1:]
    assert stopwatch.cores() == before

"""Random constants around where a fit begins, and what became of fits from there."""

from dataclasses import replace

import numpy as np
import pytest

from mcml_sim import Setting
from profilefit.fitting.estimate import fit
from profilefit.fitting.profiles import Profiles
from profilefit.fitting.solver import CONVERGED, Solution
from profilefit.recipes import catalogue, checks, recipe, targets
from profilefit.recipes.targets import truth_of

FITS = catalogue.fits_folder()


def test_random_constants_spread_as_the_rule_says():
    constants = np.array([2.0, -0.01, 0.0])
    found = checks.spread_out(constants, 20_000, seed=3)
    assert np.array_equal(found, checks.spread_out(constants, 20_000, seed=3))
    assert not np.array_equal(found, checks.spread_out(constants, 20_000, seed=4))
    factor = found[:, :2] / constants[:2]
    assert np.all(factor > 0)
    # Two of three within a factor of two: the normal's 0.6827, its error here 0.0033.
    assert np.mean(np.abs(np.log2(factor)) < 1, axis=0) == pytest.approx([0.6827, 0.6827], abs=0.013)
    assert np.std(found[:, 2]) == pytest.approx(np.log(2), rel=0.02)


def solution(parameters, cost, result=CONVERGED):
    """An optimum of this cost, whose constants the data pins to about cost^(1/2) / 10."""
    size = len(parameters)
    residuals = np.full(100 + size, np.sqrt(cost / (100 + size)))
    jacobian = np.zeros((100 + size, size))
    jacobian[:size] = np.eye(size)
    return Solution(np.asarray(parameters, float), residuals, jacobian, 7, result)


NAMES = ("a", "b")


def test_outcomes_are_told_apart():
    near, far, failed = solution([1, 2], 1e-6), solution([5, 1], 2e-6), "no convergence in 500 steps: fix a constant"
    found = [near, far, near, solution([9, 9], 5e-6, failed), far, near, solution([np.inf, 1], np.nan, "not finite: x")]
    told = checks.summarised(near, found, NAMES, seed=1, rule="so")
    assert told["result"] == checks.OWN_IS_BEST
    assert told["share_best"] == pytest.approx(3 / 7)
    assert [outcome["count"] for outcome in told["outcomes"]] == [3, 2, 1, 1]
    assert [outcome["cost_ratio"] for outcome in told["outcomes"]] == pytest.approx([1, 2, 5, np.inf])
    assert told["outcomes"][1]["constants"] == {"a": 5.0, "b": 1.0}
    assert told["outcomes"][2]["result"] == failed
    assert told["others"] == 0
    assert told["count"] == 7


def test_a_better_optimum_than_the_recipes_own_is_told():
    near, far = solution([1, 2], 1e-6), solution([5, 1], 2e-6)
    told = checks.summarised(far, [far, near, far], NAMES, 1, "so")
    assert told["result"] == checks.OWN_IS_BEATEN
    assert told["outcomes"][0]["constants"] == {"a": 1.0, "b": 2.0}
    assert told["share_best"] == pytest.approx(1 / 3)
    failed = solution([1, 2], 1e-7, "no convergence in 500 steps")
    stopped = checks.summarised(far, [failed, far], NAMES, 1, "so")  # where it stopped is no optimum
    assert stopped["result"] == checks.OWN_IS_BEST
    assert checks.summarised(failed, [near], NAMES, 1, "so")["result"] == checks.OWN_IS_BEATEN
    none = checks.summarised(failed, [failed], NAMES, 1, "so")
    assert (none["result"], none["share_best"]) == (checks.NONE_CONVERGED, 0.0)
    assert none["outcomes"][0]["cost_ratio"] == 1.0


def test_what_is_one_optimum():
    """Costs within 1e-6; constants within a thousandth, or a tenth of their misfit error (here 1e-4)."""
    own = solution([1.0, 1e-9], 1e-6)
    for parameters, cost, same in (
        ([1.0009, 1e-9], 1e-6 * (1 + 9e-7), True),
        ([1.0011, 1e-9], 1e-6, False),
        ([1.0, 0.9e-5], 1e-6, True),
        ([1.0, 1.1e-5], 1e-6, False),
        ([1.0, 1e-9], 1e-6 * (1 + 1.1e-6), False),
    ):
        told = checks.summarised(own, [solution(parameters, cost)], NAMES, 1, "so")
        assert told["share_best"] == same, (parameters, cost)


def test_many_outcomes_are_counted_but_not_all_listed():
    found = [solution([1, 2 + i], 1e-6 * (1 + i)) for i in range(20)]
    told = checks.summarised(found[0], found, NAMES, 1, "so")
    assert len(told["outcomes"]) == checks.MOST_OUTCOMES
    assert told["others"] == 20 - checks.MOST_OUTCOMES


@pytest.mark.slow
def test_all_random_starts_of_a_smooth_law_find_the_optimum(normalisation):
    alpha = 1 - np.linspace(0.05, 0.95, 5) ** 2  # too few for a jackknife, which takes time to compile
    truth = normalisation.reflectance(alpha) * (1 + 1e-3 * np.sin(9 * alpha))  # not quite the law's
    none = np.zeros((5, 1))
    profiles = Profiles(
        alpha, np.array([0.0, 1e3]), truth[:, None], none, none + np.inf, none[:, 0], "exact", Setting()
    )
    begin = replace(normalisation, **type(normalisation).entry.start)
    own = fit(profiles, begin, "reflectance")
    told = checks.random_starts(own, begin, 10, seed=5)
    assert told["result"] == checks.OWN_IS_BEST
    assert told["share_best"] == 1.0
    assert len(told["outcomes"]) == 1
    assert told["outcomes"][0]["constants"]["b"] == pytest.approx(own.law.b, rel=1e-4)


@pytest.mark.slow
def test_random_starts_beat_the_printed_start_of_the_papers_inverse():
    """A known case: from (20) as printed, the search ends in the second-best optimum."""
    from_exact = recipe.find("liang-inverse-whole", FITS).changed(truth="exact")
    profiles = truth_of(from_exact, None)
    start = targets.starting_law(from_exact, FITS)
    xi = tuple((np.arange(64) + 0.5) / 64 * 0.99)
    own = fit(profiles, start, "share", targets.free(from_exact, start), xi=xi)
    told = checks.random_starts(own, start, 50, seed=1)
    assert told["result"] == checks.OWN_IS_BEATEN
    better = fit(profiles, replace(start, **told["outcomes"][0]["constants"]), "share", own.free, xi=xi)
    assert better.solution.cost < 0.8 * own.solution.cost

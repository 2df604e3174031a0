"""Which option is chosen, and from which cases."""

import math
from dataclasses import replace

import numpy as np
import pytest

from mcml_sim import Setting
from profilefit.studies.choose.case import Case, Option
from profilefit.studies.choose.choice import Predicted, cases, chosen, laws
from profilefit.studies.choose.cost import Milliseconds
from profilefit.studies.choose.error import Error

CASE = Case((0.5, 0.5, 0.5), (1.0, 1.0, 1.0), 0.1)


def predicted(*pairs):
    """(ms, error) of options, cheapest first."""
    return [
        Predicted(Option("separable", i), Milliseconds(ms, ms, ms), Error(e, e, 0.0, 0.0, 0.0, 0, CASE))
        for i, (ms, e) in enumerate(pairs)
    ]


OPTIONS = predicted((1.0, 0.2), (2.0, 0.03), (3.0, 0.05), (4.0, 0.015), (5.0, 0.018), (6.0, 0.004))


def test_the_cheapest_that_serves(scene):
    choice = chosen(scene, OPTIONS)
    assert choice.chosen is choice.nearest is OPTIONS[3]
    assert choice.cheaper is OPTIONS[1]  # the most accurate of the cheaper ones
    assert choice.dearer is OPTIONS[5]  # not the next, which is worse
    assert choice.meets_tolerance
    assert choice.meets_budget


def test_too_dear(scene):
    """No money for it: the cheapest within the tolerance is named."""
    choice = chosen(replace(scene, budget=replace(scene.budget, ms=3.5)), OPTIONS)
    assert choice.chosen is None
    assert choice.nearest is OPTIONS[3]
    assert choice.meets_tolerance
    assert not choice.meets_budget


def test_none_is_good_enough(scene):
    """The most accurate within the budget."""
    choice = chosen(replace(scene, tolerance=0.001), OPTIONS)
    assert choice.chosen is None
    assert choice.nearest is OPTIONS[3]
    free = chosen(replace(scene, tolerance=0.001, budget=replace(scene.budget, ms=None)), OPTIONS)
    assert free.nearest is OPTIONS[5]
    assert free.dearer is None
    assert chosen(replace(scene, tolerance=0.5), OPTIONS).cheaper is None


def test_a_hair_is_not_worth_its_price(scene):
    """Of options that are as good, to what a prediction can tell, the cheapest."""
    choice = chosen(replace(scene, tolerance=0.001), predicted((1.0, 0.2), (2.0, 0.0101), (4.9, 0.01)))
    assert choice.nearest.ms == 2.0


def test_cases_go_through_the_ranges(scene):
    """Both ends of everything, steps of the mean free path in pixels between, one kernel for all."""
    wide = replace(
        scene,
        reflectance=((0.4, 0.8), (0.3, 0.5), (0.2, 0.2)),
        mfp=((1.0, 2.0), (0.7, 0.7), (0.5, 0.5)),
        pixel=(0.1, 1.0),
        resolution=(100, 50),
    )
    found = list(cases(wide))
    paths = sorted({one.mfp[0] / one.pixel for one in found})
    assert paths[0] == pytest.approx(1.0)
    assert paths[-1] == pytest.approx(20.0)
    assert np.max(np.diff(np.log(paths))) <= math.log(4.0)
    assert {one.reflectance for one in found} == {(0.4, 0.3, 0.2), (0.8, 0.5, 0.2)}
    assert {one.kernel for one in found} == {(0.6000000000000001, 0.4, 0.2)}
    assert {one.radius for one in found} == {math.inf, 5.0}
    assert found[0].window == pytest.approx((50.0, 25.0))
    assert len(found) == 2 * 2 * len(paths)


def test_a_curve_below_the_pixels_is_not_looked_at(scene):
    far = replace(scene, pixel=(2.0, 2.0))
    assert [one.radius for one in cases(far)] == [math.inf]


def test_laws_of_a_setting():
    assert list(laws(Setting("diffuse"))) == ["burley-whole-diffuse", "hazard-diffuse", "quantile-diffuse"]
    for n in (1.02, 1.37, 1.6):
        found = laws(Setting("diffuse", n=n))
        assert list(found) == ["burley-whole-diffuse", "hazard-diffuse-refracting", "quantile-diffuse"]
        assert {name: law.setting.n for name, law in found.items()} == dict.fromkeys(found, 1.0) | {
            "hazard-diffuse-refracting": n
        }

"""Filters: Gaussians that come back from their own sum, taps that are one, and an edge that follows the surface."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.special import ndtr

from profilefit.scenes.skin.law import Separable
from profilefit.studies.choose.case import Option
from profilefit.studies.choose.predicted import OneGaussian, filtered, fitted, passes
from profilefit.studies.choose.response import FARTHEST, NEAR, Beyond, response

X = np.array([0.125, 0.625, 1.625])
DEPTH = np.arcsinh(FARTHEST / NEAR)


def test_gaussians_are_found_again():
    weight, sigma = np.array([0.3, 0.7]), np.array([2.0, 0.4])
    u = np.linspace(0.0, DEPTH, 400)
    tail = ndtr(-NEAR * np.sinh(u)[:, None] / sigma) @ weight
    found = fitted(Beyond(CubicSpline(u, np.log(np.maximum(tail, 1e-15)))), 2)
    order = np.argsort(found[1])
    np.testing.assert_allclose(found[0][order], [0.7, 0.3], rtol=1e-3)
    np.testing.assert_allclose(found[1][order], [0.4, 2.0], rtol=1e-3)


def test_taps_of_a_gaussian():
    taps = OneGaussian(sigma=(2.0, 1.0, 0.5)).taps(33, np.array([2.0, 1.0, 0.5]))
    np.testing.assert_allclose(taps[:, :3].sum(axis=0), 1.0, rtol=1e-6)
    spread = np.sqrt(taps[:, 3] ** 2 @ taps[:, :3])
    np.testing.assert_allclose(spread, [2.0, 1.0, 0.5], rtol=0.05)


@pytest.mark.parametrize("count", [2, 3, 4])
def test_more_gaussians_are_nearer(light, case, count):
    """On a plane; of so many taps that they do not matter."""

    def missed(number):
        share = light.beyond(case.reflectance[0])
        found = filtered(Option("gaussians", 255, number), case, light, 0, X)
        return np.max(np.abs(found - response(share, X, 1.0, np.inf)))

    assert missed(count) < missed(1)
    assert missed(count) < (0.02, 0.006, 0.004)[count - 2]


@pytest.mark.slow
def test_the_separable_kernel_is_as_wide_as_the_stage_makes_it(light, case):
    """At its quartile a step edge has risen to 3/4, within what 255 taps tell."""
    ((_, kernel, stretches),) = passes(Option("separable", 255), case, light)
    assert isinstance(kernel, Separable)
    alpha = np.array([light.alpha(a) for a in case.reflectance])
    np.testing.assert_allclose(stretches, kernel.stretches(alpha, np.array(case.mfp)), rtol=3e-3)
    quartile = np.array([light.beyond(case.reflectance[0]).quartile])
    assert filtered(Option("separable", 255), case, light, 0, quartile) == pytest.approx(0.75, abs=0.02)


def test_taps_are_lost_with_depth(light, case):
    """Light from around the cylinder is replaced by the point's own."""
    option = Option("separable", 33)
    flat = filtered(option, case, light, 0, X)
    wide = filtered(option, replace(case, radius=1e4), light, 0, X)
    narrow = filtered(option, replace(case, radius=2.0), light, 0, X)
    np.testing.assert_allclose(wide, flat, atol=1e-3)
    assert np.all(narrow >= flat)
    assert np.max(narrow - flat) > 0.01

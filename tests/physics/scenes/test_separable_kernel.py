"""The separable filter's kernel: that of its authors, and as wide as a material."""

import numpy as np
import pytest
from scipy.special import erf

from profilefit.errors import InputError
from profilefit.scenes.skin.law import FALLOFF, Separable, exact_quartile, kernel_quartile
from profilefit.scenes.skin.passes import SeparableFilter
from profilefit.scenes.stage.pattern import Sampling
from profilefit.scenes.stage.stage import Stage
from tests.physics.scenes import edges

PUBLISHED_STRENGTH = (0.48, 0.41, 0.28)  # the default of the authors' code: too weak for a width to be matched
# The authors' own table of 17 taps (SeparableSSS.h, SSSS_QUALITY 1): offset, and weights of red, green and blue.
PRINTED = {
    0.0: (0.536343, 0.624624, 0.748867),
    0.28125: (0.0571056, 0.0287432, 0.0172844),
    2.0: (0.00317394, 0.000134823, 3.77269e-05),
}


def test_taps_are_those_of_the_authors():
    """Their falloff is 0.001 more than told, relative to red: 3 % of the far taps, which fall steeply."""
    taps = Separable(PUBLISHED_STRENGTH).taps(17, np.array(FALLOFF))
    for offset, weights in PRINTED.items():
        found = taps[np.argmin(np.abs(taps[:, 3] - offset))]
        np.testing.assert_allclose(found[3], offset, atol=1e-6)
        np.testing.assert_allclose(found[:3], weights, rtol=0.03)


@pytest.mark.parametrize("number", [1, 4, 17, 256])
def test_weights_sum_to_one(number):
    taps = Separable().taps(number, np.array([2.0, 1.0, 0.5]))
    assert len(taps) == number | 1
    np.testing.assert_allclose(taps[:, :3].sum(axis=0), 1.0, rtol=1e-6)
    np.testing.assert_allclose(taps[:, 3], -taps[::-1, 3])


def test_quartile_of_a_gaussian_and_of_the_half_space():
    """1/4 of the light crosses an edge there; of the five Gaussians it lies within the widest's and the narrowest's."""
    at = exact_quartile(0.8, edges.DIFFUSE)
    np.testing.assert_allclose(edges.answer(np.array([at, -at]), 0.8), [0.75, 0.25], atol=2e-4)
    sigma = np.sqrt([0.0484, 7.41])
    low, high = sigma * 0.6745  # erf(0.6745 / sqrt 2) = 1/2
    assert abs(erf(0.6745 / np.sqrt(2)) - 0.5) < 1e-4
    assert low < kernel_quartile(1.0) < high
    assert kernel_quartile(0.767) < kernel_quartile(1.0)


def test_a_step_edge_rises_where_the_material_lets_it(context):
    """At the exact quartile the light is 3/4, with many taps; twice the mean free path is twice as far."""
    alpha, mfp = 0.8, 16.0
    at = exact_quartile(alpha, edges.DIFFUSE) * mfp
    buffers, x = edges.aslant((256, 4), 1.0, 1.0, 0.0)
    with Stage(context, (256, 4), shadow_side=16) as stage:
        stage.upload(buffers)
        light = stage.scatter(SeparableFilter(), mfp, Sampling(255), fixed_alpha=alpha)
    for channel in range(3):
        np.testing.assert_allclose(np.interp([at, -at], x[2], light[2, :, channel]), [0.75, 0.25], atol=0.01)


def test_bad_strength_is_named():
    with pytest.raises(InputError, match=r"strength must be three shares in \(0, 1\], got \(0, 1, 1\)"):
        Separable((0, 1, 1))
    with pytest.raises(InputError, match=r"as wide as no material, got 0\.48"):
        Separable(PUBLISHED_STRENGTH).stretches(np.full(3, 0.8), np.ones(3))

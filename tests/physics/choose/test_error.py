"""What an error is made of."""

from dataclasses import replace

import numpy as np
import pytest

from profilefit.errors import InputError
from profilefit.studies.choose.case import NOTHING, STEEPEST, Case, Option, Within
from profilefit.studies.choose.error import error

WITHIN = Within()


def test_nothing_leaves_the_whole_step(light, case):
    """What Lambert misses is the light from beyond the edge: here by hand, of the brightest channel."""
    found = error(NOTHING, case, light, WITHIN)
    x = case.places(0, WITHIN)
    missed = light.beyond(case.reflectance[0])(x)
    assert found.model == pytest.approx(0.6 * np.sqrt(np.mean(missed**2)), rel=1e-3)
    assert found.channel == 0
    assert found.noise == found.curvature == 0.0
    assert found.total == pytest.approx(found.model, rel=0.02)


@pytest.mark.slow
def test_own_law_has_noise_only(light, case, hazard):
    """The truth is the law itself: what is left falls with the samples, and pixels are small."""
    found = [error(Option("sampled", n, law=hazard), case, light, WITHIN) for n in (8, 64)]
    assert found[0].model == found[1].model == pytest.approx(0.0, abs=1e-12)
    assert found[0].noise > 3.0 * found[1].noise
    assert found[1].total == pytest.approx(np.hypot(found[1].noise, found[1].pixel), rel=0.2)


def test_a_truth_that_may_be_off_counts(light, case):
    found = error(NOTHING, case, replace(light, floor=0.05), WITHIN)
    own = error(NOTHING, case, light, WITHIN)
    assert found.total == pytest.approx(np.hypot(own.total, 0.05 * 0.6), rel=1e-6)


def test_large_pixels_and_curves_are_named(light, case):
    far = error(Option("separable", 17), replace(case, pixel=4.0), light, WITHIN)
    assert far.pixel > far.model
    bent = error(Option("separable", 33), replace(case, radius=2.0), light, WITHIN)
    assert bent.curvature > bent.model


def test_places():
    flat = Case((0.5, 0.5, 0.5), (1.0, 0.5, 0.02), pixel=0.1)
    np.testing.assert_allclose(flat.places(1, WITHIN)[[0, -1]], [0.05, 1.95])
    np.testing.assert_allclose(flat.places(2, WITHIN), [0.05, 0.15])  # two pixels at the least
    bent = replace(flat, radius=2.0)
    assert bent.places(0, WITHIN).max() <= 2.0 * np.sin(STEEPEST)
    with pytest.raises(InputError, match=r"within.mfp must be a number of mean free paths in \(0, 100\], got 0"):
        Within(mfp=0)
    with pytest.raises(InputError, match=r"within.pixels must be a whole number in 1 ... 100, got 1000"):
        Within(pixels=1000)

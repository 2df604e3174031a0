"""What an error is made of."""

from dataclasses import replace

import numpy as np
import pytest

from mcml_sim import Setting
from profilefit.errors import InputError
from profilefit.scenes.stage.step_edge import step_response
from profilefit.studies.choose.case import NOTHING, STEEPEST, Case, Option, Within
from profilefit.studies.choose.choice import laws
from profilefit.studies.choose.error import error
from profilefit.studies.choose.response import reference_light

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


@pytest.mark.slow
def test_light_under_a_surface_is_exact():
    """The law of its index misses what its record says of it; one of a matched surface ten times that."""
    setting, case = Setting("diffuse", n=1.37), Case((0.6, 0.4, 0.2), (1.0, 0.7, 0.5), pixel=0.25)
    light, found = reference_light(setting), laws(setting)
    own, matched = (
        error(Option("sampled", 64, law=found[name]), case, light, WITHIN)
        for name in ("hazard-diffuse-refracting", "quantile-diffuse")
    )
    assert own.model < 5e-4 < 5e-3 < matched.model
    x = np.array([0.1, 1.0])
    np.testing.assert_allclose(
        light.beyond(0.6)(x), 1.0 - step_response(x, light.alpha(0.6), setting=setting), atol=2e-5
    )
    assert reference_light(setting).alpha(1.0) == 1.0  # no surface that refracts is white
    with pytest.raises(InputError, match=r"index must be a refractive index in \[1, 1.6\], got 1.61"):
        reference_light(Setting(n=1.61))


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

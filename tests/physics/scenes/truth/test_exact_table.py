"""The table between its nodes, against the exact half space itself."""

from dataclasses import replace

import numpy as np
import pytest

from mcml_sim import Setting, exact
from profilefit.errors import InputError, SettingError
from profilefit.scenes.skin.law import Separable
from profilefit.scenes.stage.exact_law import ExactLaw, exact_table

REFLECTANCES = np.concatenate([np.linspace(0.013, 0.987, 24), [1e-4, 2e-3, 0.9991, 0.99993]])
SKIN, REFRACTED = Setting("diffuse", n=1.4), np.concatenate([np.linspace(0.013, 0.905, 24), [1e-4, 2e-3, 0.922]])
RADII = np.geomspace(1.1e-5, 2.9e3, 41)


@pytest.mark.slow
@pytest.mark.parametrize("setting", [Setting(), Setting("diffuse")], ids=str)
def test_is_the_exact_half_space(setting):
    curves = exact_table(setting).curves(REFLECTANCES)
    np.testing.assert_allclose(exact.reflectance(curves.alpha, setting), REFLECTANCES, rtol=1e-8)
    x, alpha = np.broadcast_to(RADII, (REFLECTANCES.size, RADII.size)), curves.alpha[:, None]
    truth = exact.profile(RADII, alpha, setting=setting) / REFLECTANCES[:, None]
    bright = RADII**2 * truth > 1e-10
    assert np.max(np.abs(curves.density(x) - truth)[bright] / truth[bright]) < 1e-5
    assert np.all(curves.density(x)[~bright] * np.broadcast_to(RADII**2, bright.shape)[~bright] < 1.01e-10)
    np.testing.assert_allclose(curves.share(x), exact.cdf(RADII, alpha, setting=setting), rtol=1e-6)
    shifted = exact_table(setting).curves(REFLECTANCES * 0.9999)  # the comparison can fail
    assert np.max(np.abs(shifted.density(x) - truth)[bright] / truth[bright]) > 1e-5


@pytest.mark.slow
def test_is_the_exact_half_space_under_a_surface_that_refracts():
    curves = exact_table(SKIN).curves(REFRACTED)
    np.testing.assert_allclose(exact.reflectance(curves.alpha, SKIN), REFRACTED, rtol=1e-7)
    x, alpha = np.broadcast_to(RADII, (REFRACTED.size, RADII.size)), curves.alpha[:, None]
    truth = exact.profile(RADII, alpha, setting=SKIN) / REFRACTED[:, None]
    bright = RADII**2 * truth > 1e-8
    assert np.max(np.abs(curves.density(x) - truth)[bright] / truth[bright]) < 1e-3
    assert np.all(np.isfinite(curves.density(x)))
    np.testing.assert_allclose(curves.share(x), exact.cdf(RADII, alpha, setting=SKIN), atol=1e-7)


@pytest.mark.slow
def test_ends():
    curves = exact_table(Setting("diffuse")).curves([0.0, 1.0])
    np.testing.assert_array_equal(curves.alpha, [0.0, 1.0])
    assert np.all(np.isfinite(curves.density(np.array([[0.0, 1e9], [0.0, 1e9]]))))
    np.testing.assert_allclose(curves.share(np.array([[0.0, 1e9], [0.0, 1e9]])), [[0.0, 1.0], [0.0, 1.0]], atol=2e-4)


@pytest.mark.slow
def test_misuse():
    with pytest.raises(InputError, match=r"reflectance must be a list of numbers in \[0, 1\]"):
        exact_table(Setting("diffuse")).curves([1.2])


@pytest.mark.parametrize("made", [lambda own: ExactLaw((0.5,), own), exact_table, lambda own: Separable(setting=own)])
def test_scattering_with_a_direction_is_refused(made):
    with pytest.raises(SettingError, match=r"setting must have g = 0, got diffuse, n = 1\.4, g = 0\.8"):
        made(replace(SKIN, g=0.8))

"""The map between alpha and A under surfaces that refract: exact ends and slope, closed both ways, near exact light."""

import numpy as np
import pytest

from mcml_sim import Setting, exact
from mcml_sim.exact import single_scattering
from profilefit import albedo_law, albedo_quality
from profilefit.laws.refracting_rational import RefractingRational
from tests.fixtures import slow
from tests.physics.laws import surface

ANY = {**RefractingRational.entry.start, "c0": 1.7, "d1": 1.2, "f0": 0.05}
SETTINGS = [Setting(light, n) for light in ("searchlight", "diffuse") for n in (1.0005, 1.1, 1.45, 1.6)]


@pytest.mark.parametrize("setting", SETTINGS, ids=str)
def test_ends_and_the_slope_of_dark_media_are_exact_whatever_the_constants(setting):
    law = RefractingRational(setting, **ANY)
    most = law.reflectance(1.0)
    assert most == pytest.approx(single_scattering.entered(setting), rel=1e-14)
    assert law.reflectance(0.0) == 0.0
    assert law.reflectance(1e-9) / 1e-9 == pytest.approx(single_scattering.reflected(setting), rel=1e-6)
    assert law.alpha(0.0) == 0.0
    assert law.alpha(most) == 1.0
    assert law.alpha(1.0) == 1.0  # more than there is


@pytest.mark.parametrize("setting", SETTINGS, ids=str)
def test_the_inverse_goes_back(setting):
    law = albedo_law("rational", setting=setting)
    alpha = np.concatenate([np.geomspace(1e-12, 0.5, 30), 1 - np.geomspace(0.5, 1e-10, 30)])
    np.testing.assert_allclose(law.alpha(law.reflectance(alpha)), alpha, rtol=1e-9)
    even = np.linspace(0.0, law.entered, 401)
    assert np.all(np.diff(law.alpha(even)) > 0)


@pytest.mark.parametrize("setting", SETTINGS, ids=str)
def test_light_scattered_again_is_the_rest(setting):
    law = albedo_law("rational", setting=setting)
    alpha = np.linspace(0.05, 1.0, 20)
    rest = law.reflectance(alpha) - alpha * single_scattering.reflected(setting)
    np.testing.assert_allclose(alpha**2 * law.scattered_again(alpha), rest, rtol=1e-9)
    assert np.all(law.scattered_again(np.linspace(0, 1, 101)) > 0)


@pytest.mark.parametrize("n", [1.4, *slow(1.001, 1.02, 1.2, 1.37, 1.6)])
@pytest.mark.parametrize("light", ["searchlight", "diffuse"])
def test_near_exact_light_at_every_index(light, n):
    law = albedo_law("rational", setting=Setting(light, n))
    quality = albedo_quality(law)
    assert quality.delta_A < 4e-5
    assert quality.monotone
    alpha = np.array([0.2, 0.5, 0.8, 0.95, 0.99])
    twin = [surface.reflectance(one, law.setting) for one in alpha]
    np.testing.assert_allclose(law.reflectance(alpha), twin, atol=6e-5)
    other = albedo_law("rational", setting=Setting(light, n - 0.01 if n > 1.01 else n + 0.01))  # the negative control
    assert np.max(np.abs(other.reflectance(alpha) - exact.reflectance(alpha, setting=law.setting))) > 5e-4

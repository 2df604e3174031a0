"""The measures: zero for the truth itself, by hand where a hand can, sensitive to what they are named after."""

from dataclasses import fields

import numpy as np
import pytest

from mcml_sim import Setting, exact
from profilefit.fitting.quality import (
    MEASURES,
    OF_MAP,
    OF_PROFILE,
    AlbedoQuality,
    Quality,
    albedo_quality,
    profile_quality,
    r_squared,
)
from profilefit.laws.base import AlbedoLaw
from profilefit.laws.printed_maps import LiangAlbedo
from profilefit.recipes.folder import fits_folder
from profilefit.recipes.record import Records

ALPHAS = [0.3, 0.9]


class Truth:
    """The exact profile in a law's clothes, with its radii stretched and its energy scaled."""

    def __init__(self, stretch=1.0, brighter=1.0, setting=None):
        self.stretch, self.brighter, self.setting = stretch, brighter, setting or Setting()

    def profile(self, r, alpha, mfp=1.0):
        stretched = exact.profile(np.asarray(r) / self.stretch, alpha, mfp, self.setting) / self.stretch**2
        return self.brighter * stretched

    def cdf(self, r, alpha, mfp=1.0):
        return exact.cdf(np.asarray(r) / self.stretch, alpha, mfp, self.setting)


class ExactMap(AlbedoLaw):
    """The exact A(alpha), its inverse by interpolation on a fine table."""

    def reflectance(self, alpha):
        return exact.reflectance(alpha, self.setting)

    def alpha(self, reflectance):
        alpha = 1 - np.linspace(1, 0, 1001) ** 2
        return np.interp(reflectance, exact.reflectance(alpha, self.setting), alpha)


@pytest.mark.parametrize("setting", [Setting(), Setting("diffuse")], ids=str)
def test_the_truth_has_no_error(setting):
    found = profile_quality(Truth(setting=setting), ALPHAS)
    for measure in (found.rel, found.ks, found.l1, found.mse):
        np.testing.assert_array_equal(measure, 0.0)
    np.testing.assert_array_equal(found.r2, 1.0)
    np.testing.assert_array_equal(found.alpha, ALPHAS)


def test_measures_of_brighter_mistaken_and_stretched_light():
    found = profile_quality(Truth(brighter=1.07), ALPHAS)
    np.testing.assert_allclose(found.rel, 0.07, rtol=1e-12)
    np.testing.assert_array_equal(found.ks, 0.0)  # a cdf is normalised

    # Negative control: the searchlight's profile called diffuse.
    class Mistaken(Truth):
        def profile(self, r, alpha, mfp=1.0):
            return exact.profile(r, alpha, mfp)

    assert np.all(profile_quality(Mistaken(setting=Setting("diffuse")), ALPHAS).rel > 0.02)
    # By brute force over a grid of its own, six times finer.
    for alpha in ALPHAS:
        r = np.geomspace(0.05, 30, 6000)
        brute = np.max(np.abs(exact.cdf(r / 1.05, alpha) - exact.cdf(r, alpha)))
        # The measure's own 1600 radii are 0.9 % apart: near a maximum that costs the square of it.
        assert profile_quality(Truth(stretch=1.05), alpha).ks[0] == pytest.approx(brute, rel=1e-3)
    # Stretched light moves outward through one radius only: what is lost inside is all the misplaced energy.
    found = profile_quality(Truth(stretch=1.05), ALPHAS)
    np.testing.assert_allclose(found.l1, found.ks, rtol=2e-3)


def test_l1_is_half_the_integral_of_the_difference(burley):
    alpha = 0.8
    x, w = np.polynomial.legendre.leggauss(800)
    low, high = np.log(1e-5), np.log(100.0)
    r = np.exp(0.5 * (high - low) * (x + 1) + low)
    difference = np.abs(burley.profile(r, alpha) - exact.profile(r, alpha))
    integral = np.sum(w * 0.5 * (high - low) * 2 * np.pi * r**2 * difference)
    # Burley's A is 3e-6 off, and a sign change within a ring costs the square of the ring.
    assert profile_quality(burley, alpha).l1[0] == pytest.approx(0.5 * integral / exact.reflectance(alpha), rel=2e-3)


@pytest.mark.parametrize(("alpha", "cut"), [(0.8, 6.0), (0.9, 8.0), (0.99, 14.0)])
def test_mse_and_r2_are_of_r_times_the_profile(burley, alpha, cut):
    """Over the range of (6): `cut` is the first radius of its walk where r R_d is under .005 of its largest."""
    walk = np.arange(5.0, 20.0)
    largest = alpha / (4 * np.pi)  # at r = 0
    assert walk[np.argmax(walk * exact.profile(walk, alpha) <= 0.005 * largest)] == cut
    r = (np.arange(400) + 0.5) / 400 * cut
    data, law = r * exact.profile(r, alpha), r * burley.profile(r, alpha)
    found = profile_quality(burley, alpha)
    for part, mse, r2 in (
        (slice(None), found.mse[0], found.r2[0]),
        (slice(200), found.mse_halves[0, 0], found.r2_halves[0, 0]),
        (slice(200, None), found.mse_halves[0, 1], found.r2_halves[0, 1]),
    ):
        assert mse == pytest.approx(np.mean((data - law)[part] ** 2), rel=1e-9)
        assert r2 == pytest.approx(1 - np.mean((data - law)[part] ** 2) / np.var(data[part]), rel=1e-9)


def test_r_squared_by_hand():
    """Squares of the misfit 0 + 1 + 0 + 1, about the mean 2.25 + 0.25 + 0.25 + 2.25."""
    assert r_squared(np.array([1.0, 2, 3, 4]), np.array([1.0, 3, 3, 3])) == pytest.approx(1 - 2 / 5)
    assert r_squared(np.array([1.0, 2]), np.array([1.0, 2])) == 1.0
    assert r_squared(np.array([1.0, 3]), np.array([2.0, 2])) == 0.0


def test_maps_are_measured_against_the_exact_one_and_folds_are_told(normalisation):
    found = albedo_quality(ExactMap(Setting()))
    assert found.delta_A == 0.0
    assert found.delta_alpha < 1e-5  # the table's linear interpolation
    assert found.monotone
    assert (found.fold, found.at_one) == (1.0, pytest.approx(1.0))

    class Mistaken(ExactMap):
        def reflectance(self, alpha):
            return exact.reflectance(alpha)

    even = np.linspace(0, 1, 400)
    expected = np.max(exact.reflectance(even, Setting("diffuse")) - exact.reflectance(even))
    assert albedo_quality(Mistaken(Setting("diffuse"))).delta_A == pytest.approx(expected, rel=1e-3)

    # A map that is NaN everywhere errs by 1 - A, not by nothing.
    class Nothing(ExactMap):
        def reflectance(self, alpha):
            return np.full(np.shape(alpha), np.nan)

    assert albedo_quality(Nothing(Setting())).delta_A == pytest.approx(1.0, abs=1e-3)
    found = albedo_quality(LiangAlbedo(Setting(), 5.67, 3.84, 0.84))
    assert not found.monotone
    assert found.fold == pytest.approx(np.sqrt(0.84), abs=1e-4)  # a grid of 5e-5
    assert found.at_one == pytest.approx(0.9982, abs=5e-5)
    # Where alpha > .99947 the map has no A at all, and 1 - alpha is wrong by more than its own size.
    assert 0.05 < found.delta_A < 0.2
    assert found.largest_s > 1.0
    found = albedo_quality(normalisation)
    assert found.monotone
    assert found.delta_A < 4e-6
    assert found.largest_s < 1e-4
    assert found.at_one == 1.0


def test_words_and_worst_values_of_measures():
    assert [MEASURES[name].worst([0.1, 0.3, 0.2]) for name in ("rel", "r2")] == [0.3, 0.1]
    assert MEASURES["delta_A"].worst(0.5) == 0.5
    assert MEASURES["mse"].meaning == "of r R_d [1/mfp²]"
    assert MEASURES["ks"].meaning == MEASURES["ks"].formula
    assert (MEASURES["inversion_error"].header, MEASURES["rel"].header) == ("error", "rel")
    told = [
        content["quality"]["regenerated"]
        for content in Records(fits_folder()).contents().values()
        if "quality" in content
    ]
    for name in (*OF_PROFILE, *OF_MAP):
        assert any(name in one for one in told)
    for kind in (Quality, AlbedoQuality):
        assert {field.name for field in fields(kind)} - {"alpha", "mse_halves", "r2_halves"} <= set(MEASURES)

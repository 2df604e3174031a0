"""Conventions: each against its source's own statement, there and back, and at both ends."""

import numpy as np
import pytest
from scipy.optimize import brentq

from mcml_sim import Setting, exact
from profilefit import convert
from profilefit.convert import BY_NAME, LENGTHS, Optical, alpha_of, reflectance_of
from profilefit.errors import InputError
from tests.fixtures import slow

ALPHAS = np.array([1e-6, 0.1, 0.5, 0.9, 0.99, 0.9999])
LIGHTS = pytest.mark.parametrize("light", ["searchlight", "diffuse"])
EACH = pytest.mark.parametrize("name", list(BY_NAME))


# Colour


@LIGHTS
def test_reflectance_there_and_back(light):
    values = np.array([0.0, 1e-9, 0.01, 0.3, 0.4999, 0.5, 0.8, 0.99, 0.9995, 1.0])
    np.testing.assert_allclose(reflectance_of(alpha_of(values, light), light), values, rtol=0, atol=1e-12)
    np.testing.assert_allclose(alpha_of(reflectance_of(ALPHAS, light), light), ALPHAS, rtol=1e-12)


@LIGHTS
@pytest.mark.parametrize("n", [1.37, *slow(1.001, 1.6)])
def test_reflectance_there_and_back_under_a_surface(light, n):
    """What does not enter is never reflected: no A beyond that of a white medium has an albedo."""
    white = reflectance_of(1.0, light, n)
    values = white * np.array([0.0, 1e-9, 0.01, 0.3, 0.9, 1.0])
    np.testing.assert_allclose(reflectance_of(alpha_of(values, light, n), light, n), values, rtol=0, atol=1e-12)
    assert alpha_of(0.5, light, n) != pytest.approx(alpha_of(0.5, light), abs=1e-5)
    with pytest.raises(InputError, match=r"reflectance must be in \[0, 0\.[89]\d*\], got 1"):
        alpha_of(1.0, light, n)


@LIGHTS
def test_beyond_there_rounding_of_alpha_is_what_limits(light):
    error = reflectance_of(alpha_of(1 - 1e-7, light), light) - (1 - 1e-7)
    assert 1e-12 < abs(error) < 1e-8


def test_the_albedo_by_bisection():
    """The plainest inverse there is."""
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if exact.reflectance(middle, Setting("diffuse")) < 0.7 else (low, middle)
    assert alpha_of(0.7, "diffuse") == pytest.approx(low, rel=1e-14)
    assert alpha_of(0.7, "searchlight") > low + 0.005, "the same A is another medium under another light"


# Lengths


@EACH
def test_every_length_there_and_back(name):
    alpha, mfp = np.array([0.0, 0.2, 0.8, 0.97, 0.9999]), np.array([1e-3, 0.7, 1.0, 20.0, 1e4])
    medium = Optical(alpha, mfp)
    value = medium.length(name)
    assert np.all(np.isfinite(value) & (value > 0))
    back = Optical.from_length(name, value, alpha)
    np.testing.assert_array_equal(back.alpha, alpha)
    np.testing.assert_allclose(back.mfp, mfp, rtol=1e-12)
    for other in BY_NAME:
        np.testing.assert_allclose(back.length(other), medium.length(other), rtol=1e-12)


@EACH
def test_every_length_scales_with_the_mean_free_path(name):
    np.testing.assert_allclose(Optical(0.9, 3.0).length(name), 3.0 * Optical(0.9, 1.0).length(name), rtol=1e-14)


def test_coefficients_there_and_back():
    mu_a, mu_s = np.array([0.0, 0.013, 5.0]), np.array([2.0, 1.09, 0.0])
    medium = Optical.from_coefficients(mu_a, mu_s)
    np.testing.assert_allclose(medium.mu_a, mu_a, rtol=1e-12)
    np.testing.assert_allclose(medium.mu_s, mu_s, rtol=1e-12)
    np.testing.assert_allclose(medium.alpha, [1.0, 1.09 / 1.103, 0.0], rtol=1e-15)
    np.testing.assert_allclose(medium.mfp, [0.5, 1 / 1.103, 0.2], rtol=1e-15)


def test_without_absorption_there_is_no_diffuse_mean_free_path():
    medium = Optical(1.0, 2.0)
    infinite = {name for name in BY_NAME if not np.isfinite(medium.length(name))}
    assert infinite == {"dmfp", "dmfp_classical", "decay_length", "falloff_dmfp"}
    for name in infinite:
        with pytest.raises(InputError, match=f"{name} must be another length at alpha = 1"):
            Optical.from_length(name, 1.0, 1.0)


def test_the_memo_s_scales():
    """1.85 - A + 7 |A - .8|^3, 1.9 - A + 3.5 (A - .8)^2, 3.5 + 100 (A - .33)^4 at A = 0.3 and 1 by hand."""
    np.testing.assert_allclose(convert.scale_searchlight([0.3, 1.0]), [1.55 + 0.875, 0.85 + 0.056], rtol=1e-14)
    np.testing.assert_allclose(convert.scale_diffuse([0.3, 1.0]), [1.6 + 0.875, 0.9 + 0.14], rtol=1e-14)
    np.testing.assert_allclose(convert.scale_dmfp([0.3, 1.0]), [3.500081, 3.5 + 20.151121], rtol=1e-14)


def test_a_falloff_is_of_its_own_light():
    medium = Optical.from_length("falloff_diffuse", 0.4, alpha_of(0.3, "diffuse"))
    assert medium.mfp == pytest.approx(0.4 * 2.475, rel=1e-12)
    medium = Optical.from_length("falloff_searchlight", 0.4, alpha_of(0.3, "searchlight"))
    assert medium.mfp == pytest.approx(0.4 * 2.425, rel=1e-12)


def test_three_diffuse_mean_free_paths_by_hand():
    """alpha = 0.9: 1 / sqrt(0.3), sqrt(1.1 / 0.3), and the exact one between, its artanh checked."""
    medium = Optical(0.9, 1.0)
    assert medium.length("dmfp_classical") == pytest.approx(0.3**-0.5, rel=1e-14)
    assert medium.length("dmfp") == pytest.approx((1.1 / 0.3) ** 0.5, rel=1e-14)
    kappa = 1 / medium.length("decay_length")
    assert 0.9 * np.arctanh(kappa) / kappa == pytest.approx(1.0, rel=1e-12)
    assert medium.length("dmfp_classical") < medium.length("decay_length") < medium.length("dmfp")


def test_the_memo_means_grosjean_s():
    """Its scales imply l_d / l = s_dmfp / s_searchlight: Grosjean's is the nearest of the three, as the module says."""
    alpha = 1 - np.linspace(0.98, 0.005, 100) ** 2
    a = reflectance_of(alpha, "searchlight")
    inside = (a > 0.02) & (a < 0.95)
    implied = convert.scale_dmfp(a) / convert.scale_searchlight(a)
    medium = Optical(alpha, 1.0)
    off = {
        name: np.mean(np.abs(medium.length(name) / implied - 1)[inside])
        for name in ("dmfp", "decay_length", "dmfp_classical")
    }
    assert [round(100 * value) for value in off.values()] == [4, 7, 10]


# Engines


def test_cycles_draws_the_memo_s_falloff():
    """bssrdf_setup_radius: l = radius / (4 pi); bssrdf_burley_setup: d = l / s(A), the diffuse s."""
    medium = Optical.from_length("cycles_radius", 1.0, alpha_of(0.6, "diffuse"))
    assert medium.mfp == pytest.approx(0.07957747, rel=1e-6)  # what shader compilers make of its 0.25f * M_1_PI_F
    assert medium.length("falloff_diffuse") == pytest.approx(0.07957747 / (1.3 + 3.5 * 0.04), rel=1e-6)


def test_cycles_skin_radius_is_a_classical_diffuse_mean_free_path():
    """radius sqrt(3 (1 - alpha')) = l, with alpha' where the dipole has the colour, to twelve halvings."""
    for a in (0.05, 0.4, 0.8):
        medium = Optical(alpha_of(a, "diffuse"), 1.0)
        alpha = float(convert.cycles_skin_alpha(a))
        assert 1 / medium.length("cycles_skin_radius") ** 2 == pytest.approx(3 * (1 - alpha), rel=1e-9)
        root = brentq(lambda x, a=a: convert.dipole_reflectance(x, 1.4) - a, 0.0, 1.0)
        assert abs(alpha - root) <= 2.0**-12
        assert alpha != root
        assert (alpha * 2**12) % 1 == 0, "a midpoint of the last halving"


def test_dipole_reflectance_by_hand():
    """IOR 1: F = .668 + .0636 + .71 - 1.44 = .0016; alpha' = 2/3: s = 1, A = (1 + e^(-4/3 K)) / (3 e)."""
    k = 1.0016 / 0.9984
    expected = (1 + np.exp(-4 / 3 * k)) / (3 * np.e)
    assert convert.dipole_reflectance(2 / 3, 1.0) == pytest.approx(expected, rel=1e-12)
    assert convert.dipole_reflectance(1.0, 1.4) == 1.0


def test_cycles_clamps_the_darkest_and_the_brightest_colours():
    np.testing.assert_array_equal(convert.cycles_skin_alpha([0.0, 9e-5, 0.995, 1.0]), [0, 0, 0.999999, 0.999999])


def test_hdrp_has_997_thousandths_within_its_radius():
    """UpdateKernel: cdf = 0.997 of 1 - e^(-r/d)/4 - 3 e^(-r/3d)/4, d the scattering distance."""
    medium = Optical(0.8, 1.7)
    t = medium.length("hdrp_radius") / medium.length("hdrp_distance")
    assert 1 - 0.25 * np.exp(-t) - 0.75 * np.exp(-t / 3) == pytest.approx(0.997, abs=1e-14)
    assert medium.length("hdrp_distance") == medium.length("falloff_diffuse")


def test_hdrp_walks_with_the_mean_free_path():
    """RemapSubSurfaceScatteringParameters: sigma_t = 1 / (distance (1.9 - A + 3.5 (A - 0.8)^2))."""
    medium = Optical(alpha_of(0.5, "diffuse"), 2.0)
    assert 1 / (medium.length("hdrp_distance") * (1.4 + 3.5 * 0.09)) == pytest.approx(1 / medium.mfp, rel=1e-12)


def test_unreal_s_own_numbers():
    """SubsurfaceProfile.cpp: "1 mfp can map to 1.44 dmfp (surface albedo -> 0.0) or 43.50 dmfp (-> 1.0)"."""
    medium = Optical([0.0, 1.0], 1.0)
    ratio = medium.length("unreal_dmfp") / medium.length("unreal_mfp")
    np.testing.assert_allclose(ratio, [1.44, 43.50], atol=0.01)


def test_unreal_draws_the_memo_s_falloff():
    """GetDiffuseMeanFreePathFromMeanFreePath: dmfp = mfp s_dmfp / s / 0.6; Burley_Profile: d = dmfp / s_dmfp."""
    medium = Optical(alpha_of(0.7, "searchlight"), 0.3)
    s, s_dmfp = 1.15 + 7 * 0.001, 3.5 + 100 * 0.37**4
    dmfp = medium.length("unreal_mfp") * s_dmfp / s / 0.6
    assert dmfp == pytest.approx(medium.length("unreal_dmfp"), rel=1e-12)
    assert dmfp / s_dmfp == pytest.approx(medium.length("falloff_searchlight"), rel=1e-12)


# Input


def test_numbers_and_lists_broadcast():
    medium = Optical([0.1, 0.5, 0.9], 2.0)
    np.testing.assert_array_equal(medium.mfp, [2.0, 2.0, 2.0])
    assert medium.length("dmfp").shape == (3,)
    assert Optical(0.5, 1.0).length("mfp").shape == ()


def test_a_length_says_whose_colour_it_goes_with():
    assert {length.colour for length in LENGTHS} == {"", "searchlight", "diffuse"}
    assert len(BY_NAME) == len(LENGTHS)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Optical(1.1, 1.0), r"alpha must be in \[0, 1\], got 1.1"),
        (lambda: Optical(np.nan, 1.0), r"alpha must be in \[0, 1\], got nan"),
        (lambda: Optical("red", 1.0), r"alpha must be numbers in \[0, 1\], got 'red'"),
        (lambda: Optical(0.5, 0.0), "mfp must be > 0 and finite, got 0"),
        (lambda: Optical(0.5, -1.0), "mfp must be >= 0 and finite, got -1"),
        (lambda: Optical(0.5, np.inf), "mfp must be >= 0 and finite, got inf"),
        (lambda: Optical([0.5, 0.6], [1, 2, 3]), "alpha and mfp must have one value or equally many, got 2 and 3"),
        (lambda: Optical.from_length("radius", 1.0, 0.5), "length must be one of mfp, dmfp, .*, got 'radius'"),
        (lambda: Optical(0.5, 1.0).length("radius"), "length must be one of mfp, dmfp, .*, got 'radius'"),
        (lambda: Optical.from_length("dmfp", 0.0, 0.5), "dmfp must be > 0 and finite, got 0"),
        (lambda: Optical.from_coefficients(0.0, 0.0), r"mu_a \+ mu_s must be > 0"),
        (lambda: Optical.from_coefficients(-1.0, 0.0), "mu_a must be >= 0 and finite, got -1"),
        (lambda: alpha_of(1.5, "diffuse"), r"reflectance must be in \[0, 1\], got 1.5"),
        (lambda: alpha_of(0.5, "sunny"), "illumination must be one of searchlight, diffuse, got 'sunny'"),
    ],
)
def test_bad_numbers_are_named(make, said):
    with pytest.raises(InputError, match=said):
        make()

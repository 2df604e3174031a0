"""The exact half space against printed values, slow twins that share no code with it, and itself."""

import numpy as np
import pytest
from scipy.integrate import quad

from mcml_sim import Setting, exact
from mcml_sim.exact.by_albedo import BLOCK
from mcml_sim.exact.light import log_once
from mcml_sim.exact.single_scattering import ring_shares
from mcml_sim.exact.transform import FARTHEST_RADIUS, NEAREST_RADIUS
from tests.physics.exact.half_space_twins import RealAxis, profile_along_contour

SEARCHLIGHT, DIFFUSE = Setting(), Setting("diffuse")
BOTH = pytest.mark.parametrize("setting", [SEARCHLIGHT, DIFFUSE], ids=["searchlight", "diffuse"])
ALPHAS = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99, 0.999, 0.9999]
# A of the half space to six digits, from an independent solution of Chandrasekhar's equation that was confirmed with
# 1e8 photons. Under a searchlight 1 - H(1) sqrt(1 - alpha) (Radiative Transfer, 1950, sec. 38 and 41).
DIGITS = {
    "searchlight": "016390 035231 057214 083357 115226 155415 208680 285255 414947 535541 752721 912845 971418",
    "diffuse": "021698 046265 074451 107335 146544 194716 256557 341867 478024 596669 794564 929713 977187",
}
PRINTED = {light: [float(f"0.{digits}") for digits in row.split()] for light, row in DIGITS.items()}


def h_by_quadrature(mu, alpha):
    """H(mu) of the infinite medium's half by adaptive quadrature of ln H, x = tan(t)."""

    def integrand(t):
        x = np.tan(t)
        return np.log1p(-alpha * np.arctan(x) / x) / (np.cos(t) ** 2 + (mu * np.sin(t)) ** 2)

    return np.exp(-mu / np.pi * quad(integrand, 0, np.pi / 2, epsabs=1e-12, epsrel=1e-12, limit=200)[0])


# Printed values


@BOTH
def test_reflectance_is_the_printed_one(setting):
    printed = PRINTED[setting.illumination]
    np.testing.assert_allclose(exact.reflectance(ALPHAS, setting), printed, rtol=0, atol=0.5001e-6)  # rounded digits


@pytest.mark.parametrize("alpha", [0.05, 0.5, 0.9, 0.99])
def test_reflectance_is_chandrasekhars(alpha):
    """1 - H(1) sqrt(1 - alpha), and 1 - 2 sqrt(1 - alpha) int H(mu) mu dmu, by adaptive quadrature."""
    s = np.sqrt(1 - alpha)
    # quad's own 1e-10, over the smallest A = .008 that the difference from 1 cancels to
    assert exact.reflectance(alpha) == pytest.approx(1 - h_by_quadrature(1.0, alpha) * s, rel=1e-7, abs=1e-9)
    moment = quad(lambda mu: h_by_quadrature(mu, alpha) * mu, 0, 1, epsabs=1e-9, epsrel=1e-9)[0]
    assert exact.reflectance(alpha, DIFFUSE) == pytest.approx(1 - 2 * s * moment, rel=1e-6, abs=1e-8)


# Slow twins


@BOTH
@pytest.mark.parametrize("alpha", [pytest.param(0.05, marks=pytest.mark.slow), 0.8, 0.999])
def test_profile_and_cdf_are_those_of_the_real_axis(alpha, setting):
    twin = RealAxis(alpha, setting.illumination)
    total = twin.transform([1e-9])[0]
    assert exact.reflectance(alpha, setting) == pytest.approx(total, rel=1e-8)  # k = 1e-9 stands for 0
    for r in (1e-3, 0.05, 1.0, 15.0):
        found = exact.profile(r, alpha, setting=setting)
        # What is left by cancellation on the real axis: 1e-9 of the profile, down to 2e-9 mfp^-2
        assert found == pytest.approx(twin.profile(r), rel=1e-10, abs=2e-18)
        share = twin.energy(r) / exact.reflectance(alpha, setting)
        assert exact.cdf(r, alpha, setting=setting) == pytest.approx(share, abs=1e-10)


@pytest.mark.slow
@BOTH
@pytest.mark.parametrize("alpha", [0.05, 0.5, 0.9, 0.999])
def test_profile_is_that_along_another_contour(alpha, setting):
    """To 1e-9 wherever R_d >= 1e-11, and farther out."""
    r = np.append(np.geomspace(1e-3, 15.0, 12), 35.0)
    found = exact.profile(r, alpha, setting=setting)
    assert found[-2] > 1e-11 or alpha == 0.05
    np.testing.assert_allclose(found, profile_along_contour(r, alpha, setting.illumination), rtol=1e-9)


def test_the_twins_are_that_sharp():
    """Negative control: an alpha wrong by 1e-8 is seen."""
    wrong = exact.profile(0.6, 0.8 + 1e-8)
    assert wrong != pytest.approx(RealAxis(0.8).profile(0.6), rel=1e-9)
    assert wrong != pytest.approx(profile_along_contour(np.array([0.6]), 0.8)[0], rel=1e-9)


def test_little_scattering_is_single_scattering():
    """Its closed form is held against plain integrals in `test_single`."""
    r, alpha = np.array([0.01, 0.3, 1.0, 5.0, 20.0]), 1e-7  # twice scattered light adds of order alpha r
    once = np.exp(log_once(r, SEARCHLIGHT)) / (2 * np.pi * r)
    np.testing.assert_allclose(exact.profile(r, alpha) / alpha, once, rtol=1e-5)
    shares = ring_shares([0.0, 0.2, 1.0, 4.0], SEARCHLIGHT)
    np.testing.assert_allclose(exact.cdf([0.2, 1.0, 4.0], 0.0), np.cumsum(shares)[:-1] / shares.sum(), rtol=1e-7)


# Conservation and identities


@BOTH
@pytest.mark.parametrize("alpha", [0.1, 0.7, 0.99, 1.0])
def test_cdf_is_the_integral_of_the_profile(alpha, setting):
    r = np.geomspace(0.01, 50.0, 9)
    x, w = np.polynomial.legendre.leggauss(24)
    low, width = np.log(r[:-1, None]), np.diff(np.log(r))[:, None]
    nodes = np.exp(low + 0.5 * width * (x + 1))
    density = 2 * np.pi * nodes**2 * exact.profile(nodes, alpha, setting=setting)
    rings = np.sum(0.5 * width * w * density, axis=1) / exact.reflectance(alpha, setting)
    # 24 Gauss nodes an e-fold: 1e-12 of the ring; the difference of two cdfs near 1 has only their 1e-11 left.
    np.testing.assert_allclose(np.diff(exact.cdf(r, alpha, setting=setting)), rings, rtol=1e-8, atol=1e-11)


@BOTH
@pytest.mark.parametrize("alpha", [0.0, 0.05, 0.6, 0.95, 0.9999, 1.0])
def test_quantile_inverts_the_cdf(alpha, setting):
    xi = np.concatenate([[1e-9, 1e-6, 1e-3], np.linspace(0.05, 0.95, 19), [0.99, 0.9999, 1 - 1e-8]])
    found = exact.cdf(exact.quantile(xi, alpha, setting=setting), alpha, setting=setting)
    # Shares are counted from the far end, so 1 - S has the rounding of 1 left in it.
    np.testing.assert_allclose(found, xi, rtol=1e-9, atol=2e-14)
    assert np.all(np.diff(exact.quantile(xi, alpha, setting=setting)) > 0)


@BOTH
def test_only_the_radius_in_mean_free_paths_counts(setting):
    r, alpha, xi = np.array([0.1, 1.0, 7.0]), 0.9, np.array([0.2, 0.5, 0.9])
    for mfp in (0.01, 3.0, 1e4):
        scaled = exact.profile(r * mfp, alpha, mfp, setting)
        np.testing.assert_allclose(scaled * mfp**2, exact.profile(r, alpha, setting=setting), rtol=1e-12)
        shares = exact.cdf(r * mfp, alpha, mfp, setting)
        np.testing.assert_allclose(shares, exact.cdf(r, alpha, setting=setting), rtol=1e-12)
        quantiles = exact.quantile(xi, alpha, mfp, setting)
        np.testing.assert_allclose(quantiles, mfp * exact.quantile(xi, alpha, setting=setting), rtol=1e-12)


def test_more_albedo_more_light_everywhere_and_more_of_diffuse_light():
    assert np.min(exact.reflectance(ALPHAS, DIFFUSE) - exact.reflectance(ALPHAS)) > 5e-3, "the table would tell a swap"
    alpha = np.linspace(0.05, 1.0, 20)
    assert np.all(np.diff(exact.reflectance(alpha)) > 0)
    assert np.all(np.diff(exact.profile(np.array([[0.1], [1.0], [8.0]]), alpha), axis=1) > 0)


@pytest.mark.parametrize("count", [1, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK])
def test_how_many_radii_are_asked_for_changes_no_bit(count):
    """They are worked on in blocks, the last one filled up."""
    r = np.geomspace(0.1, 9.0, 3 * BLOCK)
    np.testing.assert_array_equal(exact.profile(r[:count], 0.7), exact.profile(r, 0.7)[:count])
    np.testing.assert_array_equal(exact.reflectance(r[:count] / 10), exact.reflectance(r / 10)[:count])


# Ends


# Chandrasekhar, Radiative Transfer (1950), table XI: H(1) at alpha = 1 is 2.9078; the digits beyond are Stibbs and
# Weir's (Mon. Not. R. Astron. Soc. 119, 1959).
H_NORMAL_CONSERVATIVE = 2.907810529


@BOTH
def test_ends_of_every_argument_between_which_the_cdf_rises(setting):
    assert exact.reflectance(0.0, setting) == 0.0
    assert exact.reflectance(1.0, setting) == 1.0
    assert exact.profile(0.0, 0.5, setting=setting) == np.inf
    assert exact.profile(np.inf, 0.5, setting=setting) == 0.0
    assert exact.profile(1.0, 0.0, setting=setting) == exact.profile(0.0, 0.0, setting=setting) == 0.0
    assert exact.cdf(0.0, 0.5, setting=setting) == 0.0
    assert exact.cdf(np.inf, 0.5, setting=setting) == 1.0
    assert exact.quantile(0.0, 0.5, setting=setting) == 0.0
    assert exact.quantile(1.0, 0.5, setting=setting) == np.inf
    for alpha in (0.0, 0.3, 0.9, 1.0):
        shares = exact.cdf(np.geomspace(1e-8, 1e4, 500), alpha, setting=setting)
        assert np.all(np.diff(shares) >= 0)
        assert shares[0] < 1e-7
        # At alpha = 1 light creeps out as S = H(1) / (sqrt(3) r), or its diffuse like; else nothing is left.
        assert 1 - shares[-1] < (2e-4 if alpha == 1 else 1e-12)


@BOTH
@pytest.mark.parametrize("alpha", [0.2, 0.9, 1.0])
def test_at_the_source_half_of_alpha_is_left(alpha, setting):
    r = np.array([1e-9, 1e-6, 1e-5])
    found = 2 * np.pi * r * exact.profile(r, alpha, setting=setting)
    np.testing.assert_allclose(found, alpha / 2, rtol=1e-3)  # the next term is of order r ln r
    inside = exact.cdf(r, alpha, setting=setting) * exact.reflectance(alpha, setting)
    np.testing.assert_allclose(inside, r * found, rtol=1e-3)


@BOTH
def test_nothing_jumps_where_the_limit_at_the_source_takes_over_and_quantile_inverts_below(setting):
    r = NEAREST_RADIUS * np.array([1 - 1e-9, 1 + 1e-9])
    for found in (exact.profile(r, 0.9, setting=setting), exact.cdf(r, 0.9, setting=setting)):
        assert found[0] == pytest.approx(found[1], rel=1e-8)
    xi = 1e-3 * exact.cdf(NEAREST_RADIUS, 0.5, setting=setting)
    assert exact.cdf(exact.quantile(xi, 0.5, setting=setting), 0.5, setting=setting) == pytest.approx(xi, rel=1e-9)


def test_near_conservative_the_loss_is_2_91_times_the_root_and_conservative_light_ends_in_a_power():
    """Where nothing is absorbed R^(k) = 1 - H(1) k / sqrt(3) + ..., so 1 - cdf = H(1) / (sqrt(3) r)."""
    for exponent in (6, 8, 10):
        s = 10.0 ** (-exponent / 2)
        # The next term of the expansion is O(s) relative, about 4 s.
        assert (1 - exact.reflectance(1 - s**2)) / s == pytest.approx(H_NORMAL_CONSERVATIVE, rel=6 * s)
    for r in (1e3, 1e4, FARTHEST_RADIUS, 100 * FARTHEST_RADIUS):
        end = 2 * np.pi * r**3 * exact.profile(r, 1.0)
        assert end == pytest.approx(H_NORMAL_CONSERVATIVE / np.sqrt(3), rel=10 / r)
    for r in (1e3, 1e4):
        assert (1 - exact.cdf(r, 1.0)) * r == pytest.approx(H_NORMAL_CONSERVATIVE / np.sqrt(3), rel=5 / r)
    # In almost conservative media it nearly does: kappa = 1.7e-7 tells them apart at 1e7 mfp, not at 1e3.
    found, limit = exact.profile([1e3, 1e8], 1 - 1e-14), exact.profile([1e3, 1e8], 1.0)
    assert found[0] == pytest.approx(limit[0], rel=1e-3)
    assert found[1] < 1e-5 * limit[1]


@BOTH
@pytest.mark.parametrize(("alpha", "r", "tolerance"), [(0.6, 100.0, 2e-3), (0.8, 90.0, 3e-3), (0.95, 100.0, 5e-3)])
def test_far_away_the_profile_decays_as_it_should(alpha, r, tolerance, setting):
    """d ln(r^2 R_d) / dr = -kappa but for terms of order 1/r^2."""
    step = 1e-3 * r
    logs = np.log(exact.profile([r - step, r + step], alpha, setting=setting)) + 2 * np.log([r - step, r + step])
    slope = float(np.diff(logs)[0]) / (2 * step)
    kappa = exact.decay_rate(alpha)
    assert slope == pytest.approx(-kappa, rel=tolerance)
    # Negative control: without r^2 the slope is off by 2/r.
    assert slope - 2 / r != pytest.approx(-kappa, rel=tolerance)


@BOTH
@pytest.mark.parametrize("alpha", [0.01, 0.5, 0.97, 1.0])
def test_the_slope_of_the_log_of_the_share_beyond_falls(alpha, setting):
    """From alpha / 2A at the source to kappa: what the search for the quantile is built on."""
    r = np.geomspace(1e-5, 10.0, 100)
    beyond = 1 - exact.cdf(r, alpha, setting=setting)
    slope = 2 * np.pi * r * exact.profile(r, alpha, setting=setting) / (exact.reflectance(alpha, setting) * beyond)
    assert np.all(np.diff(slope[beyond > 1e-5]) < 0)
    assert slope[0] == pytest.approx(alpha / (2 * exact.reflectance(alpha, setting)), rel=1e-3)
    assert slope[beyond > 1e-5].min() > exact.decay_rate(alpha)

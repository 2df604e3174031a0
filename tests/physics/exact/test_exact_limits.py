"""The exact half space at the ends of its arguments: at the source, far away, without scattering and without loss."""

import numpy as np
import pytest

from mcml_sim import Setting, exact
from mcml_sim.exact.transform import FARTHEST_RADIUS, NEAREST_RADIUS

BOTH = pytest.mark.parametrize("setting", [Setting(), Setting("diffuse")], ids=["searchlight", "diffuse"])
# Chandrasekhar, Radiative Transfer (1950), table XI: H(1) at alpha = 1 is 2.9078; the digits beyond are Stibbs and
# Weir's (Mon. Not. R. Astron. Soc. 119, 1959).
H_NORMAL_CONSERVATIVE = 2.907810529


@BOTH
def test_ends_of_every_argument(setting):
    assert exact.reflectance(0.0, setting) == 0.0
    assert exact.reflectance(1.0, setting) == 1.0
    assert exact.profile(0.0, 0.5, setting=setting) == np.inf
    assert exact.profile(np.inf, 0.5, setting=setting) == 0.0
    assert exact.profile(1.0, 0.0, setting=setting) == exact.profile(0.0, 0.0, setting=setting) == 0.0
    assert exact.cdf(0.0, 0.5, setting=setting) == 0.0
    assert exact.cdf(np.inf, 0.5, setting=setting) == 1.0
    assert exact.quantile(0.0, 0.5, setting=setting) == 0.0
    assert exact.quantile(1.0, 0.5, setting=setting) == np.inf


@BOTH
@pytest.mark.parametrize("alpha", [0.2, 0.9, 1.0])
def test_at_the_source_half_of_alpha_is_left(alpha, setting):
    r = np.array([1e-9, 1e-6, 1e-5])
    found = 2 * np.pi * r * exact.profile(r, alpha, setting=setting)
    np.testing.assert_allclose(found, alpha / 2, rtol=1e-3)  # the next term is of order r ln r
    np.testing.assert_allclose(
        exact.cdf(r, alpha, setting=setting) * exact.reflectance(alpha, setting), r * found, rtol=1e-3
    )


@BOTH
def test_nothing_jumps_where_the_limit_at_the_source_takes_over(setting):
    r = NEAREST_RADIUS * np.array([1 - 1e-9, 1 + 1e-9])
    for found in (exact.profile(r, 0.9, setting=setting), exact.cdf(r, 0.9, setting=setting)):
        assert found[0] == pytest.approx(found[1], rel=1e-8)


@BOTH
def test_quantile_inverts_below_the_nearest_radius_too(setting):
    xi = 1e-3 * exact.cdf(NEAREST_RADIUS, 0.5, setting=setting)
    assert exact.cdf(exact.quantile(xi, 0.5, setting=setting), 0.5, setting=setting) == pytest.approx(xi, rel=1e-9)


def test_near_conservative_the_loss_is_2_91_times_the_root():
    for exponent in (6, 8, 10):
        s = 10.0 ** (-exponent / 2)
        # The next term of the expansion is O(s) relative, about 4 s.
        assert (1 - exact.reflectance(1 - s**2)) / s == pytest.approx(H_NORMAL_CONSERVATIVE, rel=6 * s)


def test_conservative_light_ends_in_a_power():
    """Where nothing is absorbed R^(k) = 1 - H(1) k / sqrt(3) + ..., so 1 - cdf = H(1) / (sqrt(3) r)."""
    for r in (1e3, 1e4, FARTHEST_RADIUS, 100 * FARTHEST_RADIUS):
        end = 2 * np.pi * r**3 * exact.profile(r, 1.0)
        assert end == pytest.approx(H_NORMAL_CONSERVATIVE / np.sqrt(3), rel=10 / r)
    for r in (1e3, 1e4):
        assert (1 - exact.cdf(r, 1.0)) * r == pytest.approx(H_NORMAL_CONSERVATIVE / np.sqrt(3), rel=5 / r)


def test_almost_conservative_is_almost_conservative():
    """kappa = 1.7e-7 tells them apart at 1e7 mfp, not at 1e3."""
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

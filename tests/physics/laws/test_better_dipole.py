"""The better dipole against its authors' closed forms."""

import math

import numpy as np
import pytest

from mcml_sim import Setting
from profilefit.laws.better_dipole import BetterDipole
from profilefit.laws.diffusion import fresnel_moments


@pytest.mark.parametrize("n", [0.8, 1.0, 1.4])
@pytest.mark.parametrize("alpha", [0.1, 0.9, 0.999])
def test_total_reflectance_in_closed_form(n, alpha):
    """Hery 2012: a^2/2 e^-sigma (C_E (1 + e^-x) + C_phi (1 - e^-x) / m), m = sqrt((1 - a)(2 - a) / 3), x = 4 A m."""
    first, second = fresnel_moments(n)
    c_phi, c_e, m = (1 - first) / 4, (1 - second) / 2, math.sqrt((1 - alpha) * (2 - alpha) / 3)
    decay = math.exp(-(1 + second) / c_phi * m)
    expected = c_e * (1 + decay) + c_phi / m * (1 - decay)
    expected *= 0.5 * alpha**2 * math.exp(-math.sqrt(3 * (1 - alpha) / (2 - alpha)))
    assert BetterDipole(Setting(n=n)).reflectance(alpha) == pytest.approx(expected * 4 * n / (n + 1) ** 2, rel=1e-12)


@pytest.mark.parametrize("n", [0.7, 1.0, 1.3, 1.5])
def test_a_white_half_space_gives_all_light_back(n):
    """The factors of fluence and flux are such that no surface loses light."""
    law = BetterDipole(Setting(n=n))
    assert law.reflectance(1.0) == pytest.approx(law.entered, rel=1e-12)


def test_profile_as_implementations_write_it():
    """a^2/4 pi (e_r (C_E z_r (1 + sigma d_r) / d_r^2 + C_phi / D) - e_v (C_E z_v ... + C_phi / D)), z_v below 0."""
    r, alpha, n = np.geomspace(0.01, 20, 30), 0.9, 1.4
    first, second = fresnel_moments(n)
    c_phi, c_e, boundary = (1 - first) / 4, (1 - second) / 2, (1 + second) / (1 - first)
    diffusion = (2 * 0.1 + 0.9) / 3
    sigma = math.sqrt(0.1 / diffusion)
    total = 0.0
    for sign, z in ((1, 1.0), (-1, -1.0 - 4 * boundary * diffusion)):
        d = np.sqrt(r**2 + z**2)
        weight = c_e * z * (1 + sigma * d) / d**2 + c_phi / diffusion
        total = total + sign * weight * np.exp(-sigma * d) / d
    expected = alpha**2 / (4 * np.pi) * total * 4 * n / (n + 1) ** 2
    np.testing.assert_allclose(BetterDipole(Setting(n=n)).profile(r, alpha), expected, rtol=1e-12)

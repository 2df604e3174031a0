"""The standard dipole against what its authors print."""

import math

import numpy as np
import pytest

from mcml_sim import Setting
from profilefit.laws.diffusion import fresnel_moments
from profilefit.laws.dipole import Dipole, diffuse_fresnel
from profilefit.materials import BY_NAME

# Jensen et al. 2001, table 1, "diffuse reflectance" of red, green, blue: n = 1.3, marble 1.5.
TABLE = {
    "apple": (0.85, 0.84, 0.53),
    "chicken2": (0.32, 0.16, 0.10),
    "cream": (0.98, 0.90, 0.73),
    "ketchup": (0.16, 0.01, 0.00),
    "marble": (0.83, 0.79, 0.75),
    "potato": (0.77, 0.62, 0.21),
    "skimmilk": (0.81, 0.81, 0.69),
    "skin1": (0.44, 0.22, 0.13),
    "skin2": (0.63, 0.44, 0.34),
    "wholemilk": (0.91, 0.88, 0.76),
}


@pytest.mark.parametrize("name", TABLE)
def test_reflectances_of_the_authors_table(name):
    """They are of light that entered. Coefficients and reflectances are rounded to two digits: 0.01 is what is left."""
    law = Dipole(Setting(n=1.5 if name == "marble" else 1.3))
    found = law.reflectance(np.array(BY_NAME[name].alpha)) / law.entered
    np.testing.assert_allclose(found, TABLE[name], rtol=0, atol=0.0105)


@pytest.mark.parametrize("n", [0.8, 1.0, 1.4])
@pytest.mark.parametrize("alpha", [0.1, 0.9, 1.0])
def test_total_reflectance_in_closed_form(n, alpha):
    """Jensen and Buhler 2002, eq. 5."""
    sigma, fresnel = math.sqrt(3 * (1 - alpha)), diffuse_fresnel(n)
    boundary = (1 + fresnel) / (1 - fresnel)
    expected = 0.5 * alpha * (1 + math.exp(-4 / 3 * boundary * sigma)) * math.exp(-sigma)
    assert Dipole(Setting(n=n)).reflectance(alpha) == pytest.approx(expected * 4 * n / (n + 1) ** 2, rel=1e-13)


def test_profile_by_hand():
    """At alpha = 1 and r = 0: (1 + 1 / z_v^2) / 4 pi, z_v = 1 + 4/3 (1.0016 / 0.9984)."""
    image = 1 + 4 / 3 * 1.0016 / 0.9984
    assert Dipole(Setting()).profile(0.0, 1.0) == pytest.approx((1 + image**-2) / (4 * math.pi), rel=1e-12)


def test_profile_as_the_authors_write_it():
    """alpha'/4 pi (z_r (sigma d_r + 1) e^(-sigma d_r) / d_r^3 + z_v (sigma d_v + 1) e^(-sigma d_v) / d_v^3)."""
    r, alpha = np.geomspace(0.01, 20, 30), 0.95
    sigma, boundary = math.sqrt(3 * 0.05), (1 + diffuse_fresnel(1.3)) / (1 - diffuse_fresnel(1.3))
    terms = []
    for z in (1.0, 1.0 + 4 * boundary / 3):
        d = np.sqrt(r**2 + z**2)
        terms.append(z * (sigma * d + 1) * np.exp(-sigma * d) / d**3)
    expected = alpha / (4 * np.pi) * sum(terms) * 5.2 / 5.29  # 4 n / (n + 1)^2 enters
    np.testing.assert_allclose(Dipole(Setting(n=1.3)).profile(r, alpha), expected, rtol=1e-12)


@pytest.mark.parametrize("n", [0.6, 0.8, 0.95, 1.0, 1.2, 1.3, 1.5, 2.0])
def test_diffuse_fresnel_is_a_fit_of_the_mean_reflectance(n):
    """2 int mu F dmu; a sign or digit lost in the fit would show."""
    assert diffuse_fresnel(n) == pytest.approx(fresnel_moments(n)[0], abs=0.002)

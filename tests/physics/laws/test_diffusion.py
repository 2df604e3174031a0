"""Physically based diffusion laws against what their authors print, and what they share: surface, shares, samplers."""

import itertools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import Setting, exact
from mcml_sim.exact import single_scattering
from profilefit.errors import SettingError
from profilefit.fitting.quality import profile_quality
from profilefit.laws import diffusion as laws
from profilefit.laws.diffusion import BeamDiffusion, BetterDipole, Dipole, diffuse_fresnel, fresnel_moments
from profilefit.materials import BY_NAME

# Shares are closed in the dipoles; the beam's are quadrature, to 5e-9.
LAWS = [(Dipole(Setting()), 1e-12), (BetterDipole(Setting(n=0.8)), 1e-12), (BeamDiffusion(Setting(n=1.4)), 1e-8)]
NAMES = ["dipole", "better", "beam"]
# The sampler is one loop over the law's own formulas: the dipole tests it, the others take seconds to compile.
SAMPLED = pytest.mark.parametrize(
    "law", [LAWS[0][0], *(pytest.param(law, marks=pytest.mark.slow) for law, _ in LAWS[1:])], ids=NAMES
)


def printed_moments(n):
    """2 C_1 and 3 C_2 as d'Eon and Irving (2011) print them."""
    if n < 1:
        return (
            0.919317 - 3.4793 * n + 6.75335 * n**2 - 7.80989 * n**3 + 4.98554 * n**4 - 1.36881 * n**5,
            0.828421 - 2.62051 * n + 3.36231 * n**2 - 1.95284 * n**3 + 0.236494 * n**4 + 0.145787 * n**5,
        )
    return (
        -9.23372 + 22.2272 * n - 20.9292 * n**2 + 10.2291 * n**3 - 2.54396 * n**4 + 0.254913 * n**5,
        -1641.1
        + (135.926 / n**3 - 656.175 / n**2 + 1376.53 / n)
        + (1213.67 * n - 568.556 * n**2 + 164.798 * n**3 - 27.0181 * n**4 + 1.91826 * n**5),
    )


def test_moments_are_the_printed_fits_and_right_at_their_ends():
    assert fresnel_moments(1.0) == pytest.approx((0.0, 0.0), abs=1e-14)
    assert laws.exitance_factors(1.0) == pytest.approx((0.25, 0.5, 1.0), abs=1e-14)
    # D = 2/3 and sigma = sqrt(3/2) where all is absorbed, 1/3 and 0 where nothing is.
    with jax.enable_x64(True):
        diffusion, sigma = laws.grosjean(jnp.array([0.0, 1.0]))
    np.testing.assert_allclose(diffusion, [2 / 3, 1 / 3])
    np.testing.assert_allclose(sigma, [1.5**0.5, 0.0])
    # The fits themselves are 0.007 off at n = 1, where nothing is reflected, and 0.0077 at n = 2.5.
    for n in (0.5, 0.7, 0.9, 1.0, 1.1, 1.3, 1.4, 1.5, 2.0, 2.5):
        np.testing.assert_allclose(fresnel_moments(n), printed_moments(n), rtol=0, atol=0.008, err_msg=f"n = {n}")
    # 2 int mu F dmu; a sign or digit lost in the dipole's fit would show.
    for n in (0.6, 0.8, 0.95, 1.0, 1.2, 1.3, 1.5, 2.0):
        assert diffuse_fresnel(n) == pytest.approx(fresnel_moments(n)[0], abs=0.002), n


@pytest.mark.parametrize("n", [0.8, 1.4])
def test_moments_by_plain_sums(n):
    mu = (np.arange(400_000) + 0.5) / 400_000
    sine = np.minimum(n * np.sqrt(1 - mu**2), 1.0)
    out = np.sqrt(1 - sine**2)
    reflected = 0.5 * (((n * mu - out) / (n * mu + out)) ** 2 + ((mu - n * out) / (mu + n * out)) ** 2)
    expected = 2 * np.mean(mu * reflected), 3 * np.mean(mu**2 * reflected)
    assert fresnel_moments(n) == pytest.approx(expected, abs=2e-8)  # midpoints meet a root at the critical angle


@pytest.mark.parametrize("setting", [Setting("diffuse"), Setting(g=0.5)])
def test_another_light_is_refused(setting):
    with pytest.raises(SettingError, match="setting must be a searchlight with g = 0"):
        Dipole(setting)


# Everything is asked on one grid of radii and albedos: each shape compiles anew.
ALPHA = np.array([[0.0], [0.5], [1.0]])
RADII = np.concatenate([[0.0], np.geomspace(1e-9, 1e9, 30), [np.inf]])


@pytest.mark.parametrize(("law", "tolerance"), [*LAWS[:2], pytest.param(*LAWS[2], marks=pytest.mark.slow)], ids=NAMES)
def test_share_is_the_integral_of_the_profile(law, tolerance):
    edges = np.array([0.0, 0.05, 0.7, 0.999, 1.001, 2.5, 7.0, 15.0])
    total, inside, (x, w) = law.reflectance(ALPHA), np.zeros((3, 1)), np.polynomial.legendre.leggauss(32)
    shares = law.cdf(np.resize(edges, 32), ALPHA)
    for i, (low, high) in enumerate(itertools.pairwise(edges)):
        power, width, u = 1 if low else 3, high - low, 0.5 * (x + 1)  # r ln r at the source is smooth in u
        r, dr = low + width * u**power, 0.5 * w * width * power * u ** (power - 1)
        inside = inside + np.sum(2 * np.pi * r * law.profile(r, ALPHA) * dr, axis=1, keepdims=True)
        np.testing.assert_allclose((shares * total)[:, i + 1], inside[:, 0], rtol=0, atol=tolerance)


@pytest.mark.slow
@pytest.mark.parametrize("law", [law for law, _ in LAWS], ids=NAMES)
def test_both_ends(law):
    """Shares rise from 0 to 1, and profiles are finite, from alpha = 0 to 1 and from the source to infinity."""
    shares, values = law.cdf(RADII, ALPHA), law.profile(RADII, ALPHA)
    np.testing.assert_allclose(shares[:, [0, -1]], [[0, 1]] * 3, rtol=0, atol=1e-15)
    assert np.all(np.diff(shares) >= -1e-15)
    assert np.all(np.isfinite(values[:, 1:]) & (values[:, 1:] >= 0))
    np.testing.assert_array_equal(values[0], 0.0)
    np.testing.assert_allclose(values[:, -1], 0.0, atol=1e-300)
    assert law.constant_names() == ()


@SAMPLED
def test_sampler_inverts_the_cdf_and_has_the_laws_density(law):
    xi = np.concatenate([[0.0], np.geomspace(1e-6, 0.5, 15), 1 - np.geomspace(0.49, 1e-9, 15), [1.0]])
    r = law.sampler.sample(xi, ALPHA)
    found = [law.cdf(row, ALPHA)[i] for i, row in enumerate(r)]
    np.testing.assert_allclose(found, [xi] * 3, rtol=0, atol=1e-13)
    np.testing.assert_array_equal(r[:, [0, -1]], [[0.0, np.inf]] * 3)
    density = law.sampler.pdf(RADII, ALPHA) * law.reflectance(ALPHA)
    near = (RADII > 0) & (RADII < 1e3)
    expected = 2 * np.pi * RADII[near] * law.profile(RADII, ALPHA)[:, near]
    np.testing.assert_allclose(density[:, near], expected, rtol=1e-12)
    source = law.source_strength(jnp.asarray(ALPHA, jnp.float32))
    np.testing.assert_allclose(density[:, [0]], source, rtol=1e-6, atol=1e-12)
    np.testing.assert_array_equal(density[:, -1], 0.0)
    single = law.cdf(jnp.float32(0.7), jnp.float32(0.5))
    assert single.dtype == jnp.float32
    assert float(single) == pytest.approx(law.cdf(np.full(32, 0.7), ALPHA)[1, 0], rel=1e-5)


@pytest.mark.slow
def test_derivatives_are_finite_differences():
    law, step = LAWS[1][0], 1e-5
    with jax.enable_x64(True):
        slopes = jax.jit(jax.grad(law.cdf, argnums=(0, 1)))(jnp.asarray(0.7), jnp.asarray(0.8))
    r, alpha = 0.7 + step * np.array([1, -1, 0, 0]), 0.8 + step * np.array([0, 0, 1, -1])
    values = law.cdf(r, alpha)
    expected = (values[0] - values[1]) / (2 * step), (values[2] - values[3]) / (2 * step)
    np.testing.assert_allclose([float(slope) for slope in slopes], expected, rtol=1e-6)


# Dipoles

# Jensen et al. 2001, table 1, "diffuse reflectance" of red, green, blue: n = 1.3, marble 1.5.
TABLE = {
    **{"apple": (0.85, 0.84, 0.53), "chicken2": (0.32, 0.16, 0.10), "cream": (0.98, 0.90, 0.73)},
    **{"ketchup": (0.16, 0.01, 0.00), "marble": (0.83, 0.79, 0.75), "potato": (0.77, 0.62, 0.21)},
    **{"skimmilk": (0.81, 0.81, 0.69), "skin1": (0.44, 0.22, 0.13), "skin2": (0.63, 0.44, 0.34)},
    "wholemilk": (0.91, 0.88, 0.76),
}
R = np.geomspace(0.01, 20, 30)


@pytest.mark.parametrize("name", TABLE)
def test_reflectances_of_the_authors_table(name):
    """They are of light that entered. Coefficients and reflectances are rounded to two digits: 0.01 is what is left."""
    law = Dipole(Setting(n=1.5 if name == "marble" else 1.3))
    found = law.reflectance(np.array(BY_NAME[name].alpha)) / law.entered
    np.testing.assert_allclose(found, TABLE[name], rtol=0, atol=0.0105)


@pytest.mark.parametrize("n", [0.8, 1.0, 1.4])
@pytest.mark.parametrize("alpha", [0.1, 0.9, 0.999])
def test_total_reflectance_in_closed_form(n, alpha):
    """Jensen and Buhler 2002, eq. 5; Hery 2012.

    a/2 (1 + e^(-4/3 K sigma)) e^-sigma; a^2/2 e^-sigma (C_E (1 + e^-x) + C_phi (1 - e^-x) / m),
    m = sqrt((1 - a)(2 - a) / 3), x = 4 A m.
    """
    entered, sigma, fresnel = 4 * n / (n + 1) ** 2, math.sqrt(3 * (1 - alpha)), diffuse_fresnel(n)
    expected = 0.5 * alpha * (1 + math.exp(-4 / 3 * (1 + fresnel) / (1 - fresnel) * sigma)) * math.exp(-sigma)
    assert Dipole(Setting(n=n)).reflectance(alpha) == pytest.approx(expected * entered, rel=1e-13)
    first, second = fresnel_moments(n)
    c_phi, c_e, m = (1 - first) / 4, (1 - second) / 2, math.sqrt((1 - alpha) * (2 - alpha) / 3)
    decay = math.exp(-(1 + second) / c_phi * m)
    expected = c_e * (1 + decay) + c_phi / m * (1 - decay)
    expected *= 0.5 * alpha**2 * math.exp(-math.sqrt(3 * (1 - alpha) / (2 - alpha)))
    assert BetterDipole(Setting(n=n)).reflectance(alpha) == pytest.approx(expected * entered, rel=1e-12)


def test_dipoles_by_hand_and_as_they_are_written():
    """At alpha = 1 and r = 0: (1 + 1 / z_v^2) / 4 pi, z_v = 1 + 4/3 (1.0016 / 0.9984)."""
    image = 1 + 4 / 3 * 1.0016 / 0.9984
    assert Dipole(Setting()).profile(0.0, 1.0) == pytest.approx((1 + image**-2) / (4 * math.pi), rel=1e-12)
    # alpha'/4 pi (z_r (sigma d_r + 1) e^(-sigma d_r) / d_r^3 + z_v (sigma d_v + 1) e^(-sigma d_v) / d_v^3).
    sigma, boundary = math.sqrt(3 * 0.05), (1 + diffuse_fresnel(1.3)) / (1 - diffuse_fresnel(1.3))
    terms = []
    for z in (1.0, 1.0 + 4 * boundary / 3):
        d = np.sqrt(R**2 + z**2)
        terms.append(z * (sigma * d + 1) * np.exp(-sigma * d) / d**3)
    expected = 0.95 / (4 * np.pi) * sum(terms) * 5.2 / 5.29  # 4 n / (n + 1)^2 enters
    np.testing.assert_allclose(Dipole(Setting(n=1.3)).profile(R, 0.95), expected, rtol=1e-12)
    # a^2/4 pi (e_r (C_E z_r (1 + sigma d_r) / d_r^2 + C_phi / D) - e_v (C_E z_v ... + C_phi / D)), z_v below 0.
    alpha, n = 0.9, 1.4
    first, second = fresnel_moments(n)
    c_phi, c_e, boundary = (1 - first) / 4, (1 - second) / 2, (1 + second) / (1 - first)
    diffusion = (2 * 0.1 + 0.9) / 3
    sigma, total = math.sqrt(0.1 / diffusion), 0.0
    for sign, z in ((1, 1.0), (-1, -1.0 - 4 * boundary * diffusion)):
        d = np.sqrt(R**2 + z**2)
        weight = c_e * z * (1 + sigma * d) / d**2 + c_phi / diffusion
        total = total + sign * weight * np.exp(-sigma * d) / d
    expected = alpha**2 / (4 * np.pi) * total * 4 * n / (n + 1) ** 2
    np.testing.assert_allclose(BetterDipole(Setting(n=n)).profile(R, alpha), expected, rtol=1e-12)
    # A white half space gives all light back: factors of fluence and flux are such that no surface loses light.
    for n in (0.7, 1.0, 1.3, 1.5):
        law = BetterDipole(Setting(n=n))
        assert law.reflectance(1.0) == pytest.approx(law.entered, rel=1e-12)


# Photon beam diffusion


def summed_over_depths(r, alpha, n, number=200_000):
    """Light scattered twice or more, per light that entered: equally likely depths, as the authors draw them."""
    z = -np.log1p(-(np.arange(number) + 0.5) / number)
    first, second = fresnel_moments(n)
    diffusion = (2 * (1 - alpha) + alpha) / 3
    sigma = math.sqrt((1 - alpha) / diffusion)
    virtual = -z - 4 * diffusion * (1 + second) / (1 - first)
    d_r, d_v = np.sqrt(r**2 + z**2), np.sqrt(r**2 + virtual**2)
    fluence = (np.exp(-sigma * d_r) / d_r - np.exp(-sigma * d_v) / d_v) / (4 * np.pi * diffusion)
    flux = z * (1 + sigma * d_r) * np.exp(-sigma * d_r) / d_r**3
    flux = (flux - virtual * (1 + sigma * d_v) * np.exp(-sigma * d_v) / d_v**3) / (4 * np.pi)
    kappa = 1 - np.exp(-2 * (d_r + z))
    return alpha**2 * np.mean(kappa * (fluence * (1 - first) / 4 + flux * (1 - second) / 2))


def summed_single(r, alpha, n, number=200_000):
    """Light scattered once at depths beyond the critical one, per light that entered."""
    critical = r * math.sqrt(max(n * n - 1, 0.0))
    z = critical - np.log1p(-(np.arange(number) + 0.5) / number)
    d = np.sqrt(r**2 + z**2)
    cosine = z / d
    out = np.sqrt(np.maximum(1 - n**2 * (1 - cosine**2), 0))
    across, along = (n * cosine - out) / (n * cosine + out), (cosine - n * out) / (cosine + n * out)
    passed = 1 - 0.5 * (across**2 + along**2)
    return alpha * np.mean(np.exp(-d - critical) / d**2 * cosine * passed) / (4 * np.pi)


@pytest.mark.slow
@pytest.mark.parametrize("n", [1.0, 1.4])
def test_profile_is_the_authors_sum(n):
    law, alpha = BeamDiffusion(Setting(n=n)), np.array([[0.3], [0.8], [0.95]])
    r = np.array([0.05, 0.5, 2.0, 8.0])
    expected = [[summed_over_depths(x, a, n) + summed_single(x, a, n) for x in r] for a in alpha[:, 0]]
    # Equally likely depths leave the deepest, e^-12, to one midpoint.
    found = law.profile(np.resize(r, 32), alpha)[:, :4] / law.entered
    np.testing.assert_allclose(found, expected, rtol=2e-5)


@pytest.mark.parametrize("n", [0.8, 1.0, 1.4])
def test_single_scattering_is_the_simulators(n):
    edges = np.concatenate([[0.0], np.geomspace(1e-3, 20, 30)])
    within = np.cumsum(single_scattering.ring_shares(edges, Setting(n=n))[:-1])
    with jax.enable_x64(True):
        np.testing.assert_allclose(laws.once_scattered_within(jnp.asarray(edges[1:]), n), within, rtol=1e-12)
        if n == 1.0:  # all of it, by hand: int mu / (1 + mu) dmu / 2
            whole = float(laws.once_scattered_within(jnp.asarray(1e12), n))
            assert whole == pytest.approx((1 - math.log(2)) / 2, rel=1e-10)


def test_source_and_total():
    """Near the source it is single scattering, 2 pi r R_d = alpha/2; in all it has too much light."""
    law, r = BeamDiffusion(Setting()), np.full(32, 1e-6)
    source = 2 * np.pi * r * law.profile(r, np.array([[0.2], [0.5], [0.9]]))
    np.testing.assert_allclose(source[:, 0], [0.1, 0.25, 0.45], rtol=1e-4)
    assert law.reflectance(1.0) == pytest.approx(1.093, abs=5e-4)


@pytest.mark.slow
def test_more_nodes_change_nothing_and_quality_is_a_tenth():
    """Profiles to 1e-9, shares to 1e-8; and what half of the nodes change is seen: a negative control."""
    law, r, alpha = BeamDiffusion(Setting()), np.array([0.01, 1.0, 10.0]), np.array([[0.3], [0.9], [1.0]])
    finer = BeamDiffusion(law.setting, law.albedo, 3)  # halves of the nodes: none in common
    np.testing.assert_allclose(law.profile(r, alpha), finer.profile(r, alpha), rtol=1e-9)
    shares = finer.cdf(r, alpha)
    np.testing.assert_allclose(law.cdf(r, alpha), shares, atol=1e-8)
    coarse = BeamDiffusion(law.setting, law.albedo, 1)
    assert np.max(np.abs(coarse.cdf(r, alpha) - shares)) > 10.0 * np.max(np.abs(law.cdf(r, alpha) - shares))
    # Christensen and Burley judge it the best of the physically based profiles; a dipole is off by a half.
    quality = profile_quality(law, [0.5, 0.95])
    assert np.all(quality.rel < 0.12)
    assert np.all(quality.ks < 0.04)
    assert law.profile(40.0, 0.99) == pytest.approx(exact.profile(40.0, 0.99), rel=0.03)

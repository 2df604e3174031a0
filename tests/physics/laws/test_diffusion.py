"""What the physically based laws share: surface, light of their own, shares, samplers."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import Setting
from profilefit.errors import SettingError
from profilefit.laws.beam_diffusion import BeamDiffusion
from profilefit.laws.better_dipole import BetterDipole
from profilefit.laws.diffusion import exitance_factors, fresnel_moments, grosjean
from profilefit.laws.dipole import Dipole

# Shares are closed in the dipoles; the beam's are quadrature, to 5e-9.
LAWS = [(Dipole(Setting()), 1e-12), (BetterDipole(Setting(n=0.8)), 1e-12), (BeamDiffusion(Setting(n=1.4)), 1e-8)]
NAMES = ["dipole", "better", "beam"]
EVERY = pytest.mark.parametrize("law", [law for law, _ in LAWS], ids=NAMES)
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


@pytest.mark.parametrize("n", [0.5, 0.7, 0.9, 1.0, 1.1, 1.3, 1.4, 1.5, 2.0, 2.5])
def test_moments_are_the_printed_fits(n):
    """The fits themselves are 0.007 off at n = 1, where nothing is reflected, and 0.0077 at n = 2.5."""
    np.testing.assert_allclose(fresnel_moments(n), printed_moments(n), rtol=0, atol=0.008)


def test_a_surface_that_does_not_refract():
    assert fresnel_moments(1.0) == pytest.approx((0.0, 0.0), abs=1e-14)
    assert exitance_factors(1.0) == pytest.approx((0.25, 0.5, 1.0), abs=1e-14)


@pytest.mark.parametrize("n", [0.8, 1.4])
def test_moments_by_plain_sums(n):
    mu = (np.arange(400_000) + 0.5) / 400_000
    sine = np.minimum(n * np.sqrt(1 - mu**2), 1.0)
    out = np.sqrt(1 - sine**2)
    reflected = 0.5 * (((n * mu - out) / (n * mu + out)) ** 2 + ((mu - n * out) / (mu + n * out)) ** 2)
    expected = 2 * np.mean(mu * reflected), 3 * np.mean(mu**2 * reflected)
    assert fresnel_moments(n) == pytest.approx(expected, abs=2e-8)  # midpoints meet a root at the critical angle


def test_grosjeans_diffusion_at_both_ends():
    """D = 2/3 and sigma = sqrt(3/2) where all is absorbed, 1/3 and 0 where nothing is."""
    with jax.enable_x64(True):
        diffusion, sigma = grosjean(jnp.array([0.0, 1.0]))
    np.testing.assert_allclose(diffusion, [2 / 3, 1 / 3])
    np.testing.assert_allclose(sigma, [1.5**0.5, 0.0])


@pytest.mark.parametrize("setting", [Setting("diffuse"), Setting(g=0.5)])
def test_another_light_is_refused(setting):
    with pytest.raises(SettingError, match="setting must be a searchlight with g = 0"):
        Dipole(setting)


# Everything is asked on one grid of radii and albedos: each shape compiles anew.
ALPHA = np.array([[0.0], [0.5], [1.0]])
RADII = np.concatenate([[0.0], np.geomspace(1e-9, 1e9, 30), [np.inf]])


def nodes(low, high, power):
    """Gauss's rule on r = low + (high - low) u^power: 32 radii and weights."""
    x, w = np.polynomial.legendre.leggauss(32)
    u = 0.5 * (x + 1)
    return low + (high - low) * u**power, 0.5 * w * (high - low) * power * u ** (power - 1)


@pytest.mark.parametrize(("law", "tolerance"), [*LAWS[:2], pytest.param(*LAWS[2], marks=pytest.mark.slow)], ids=NAMES)
def test_share_is_the_integral_of_the_profile(law, tolerance):
    edges = np.array([0.0, 0.05, 0.7, 0.999, 1.001, 2.5, 7.0, 15.0])
    total, inside = law.reflectance(ALPHA), np.zeros((3, 1))
    shares = law.cdf(np.resize(edges, 32), ALPHA)
    for i, (low, high) in enumerate(itertools.pairwise(edges)):
        r, dr = nodes(low, high, 1 if low else 3)  # r ln r at the source is smooth in u
        inside = inside + np.sum(2 * np.pi * r * law.profile(r, ALPHA) * dr, axis=1, keepdims=True)
        np.testing.assert_allclose((shares * total)[:, i + 1], inside[:, 0], rtol=0, atol=tolerance)


@pytest.mark.slow
@EVERY
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
def test_sampler_inverts_the_cdf(law):
    xi = np.concatenate([[0.0], np.geomspace(1e-6, 0.5, 15), 1 - np.geomspace(0.49, 1e-9, 15), [1.0]])
    r = law.sampler.sample(xi, ALPHA)
    found = [law.cdf(row, ALPHA)[i] for i, row in enumerate(r)]
    np.testing.assert_allclose(found, [xi] * 3, rtol=0, atol=1e-13)
    np.testing.assert_array_equal(r[:, [0, -1]], [[0.0, np.inf]] * 3)


@SAMPLED
def test_sampler_density_is_the_laws_and_ends_in_its_limits(law):
    density = law.sampler.pdf(RADII, ALPHA) * law.reflectance(ALPHA)
    near = (RADII > 0) & (RADII < 1e3)
    expected = 2 * np.pi * RADII[near] * law.profile(RADII, ALPHA)[:, near]
    np.testing.assert_allclose(density[:, near], expected, rtol=1e-12)
    source = law.source_strength(jnp.asarray(ALPHA, jnp.float32))
    np.testing.assert_allclose(density[:, [0]], source, rtol=1e-6, atol=1e-12)
    np.testing.assert_array_equal(density[:, -1], 0.0)


@SAMPLED
def test_single_precision(law):
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

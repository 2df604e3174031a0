"""Photon beam diffusion against plain sums over depths, exact single scattering, and the half space."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import Setting, exact
from mcml_sim.exact import single_scattering
from profilefit.fitting.quality import profile_quality
from profilefit.laws.beam_diffusion import BeamDiffusion, once_scattered_within
from profilefit.laws.diffusion import fresnel_moments


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
        np.testing.assert_allclose(once_scattered_within(jnp.asarray(edges[1:]), n), within, rtol=1e-12)
        if n == 1.0:  # all of it, by hand: int mu / (1 + mu) dmu / 2
            assert float(once_scattered_within(jnp.asarray(1e12), n)) == pytest.approx((1 - math.log(2)) / 2, rel=1e-10)


def test_source_and_total():
    """Near the source it is single scattering, 2 pi r R_d = alpha/2; in all it has too much light."""
    law, r = BeamDiffusion(Setting()), np.full(32, 1e-6)
    source = 2 * np.pi * r * law.profile(r, np.array([[0.2], [0.5], [0.9]]))
    np.testing.assert_allclose(source[:, 0], [0.1, 0.25, 0.45], rtol=1e-4)
    assert law.reflectance(1.0) == pytest.approx(1.093, abs=5e-4)


@pytest.mark.slow
def test_more_nodes_change_nothing():
    """Profiles to 1e-9, shares to 1e-8; and what half of the nodes change is seen: a negative control."""
    law, r, alpha = BeamDiffusion(Setting()), np.array([0.01, 1.0, 10.0]), np.array([[0.3], [0.9], [1.0]])
    np.testing.assert_allclose(law.profile(r, alpha), law.finer.profile(r, alpha), rtol=1e-9)
    shares = law.finer.cdf(r, alpha)
    np.testing.assert_allclose(law.cdf(r, alpha), shares, atol=1e-8)
    coarse = BeamDiffusion(law.setting, law.albedo, 1)
    assert np.max(np.abs(coarse.cdf(r, alpha) - shares)) > 10.0 * np.max(np.abs(law.cdf(r, alpha) - shares))


@pytest.mark.slow
def test_quality_is_a_tenth():
    """Christensen and Burley judge it the best of the physically based profiles; a dipole is off by a half."""
    quality = profile_quality(BeamDiffusion(Setting()), [0.5, 0.95])
    assert np.all(quality.rel < 0.12)
    assert np.all(quality.ks < 0.04)
    law = BeamDiffusion(Setting())
    assert law.profile(40.0, 0.99) == pytest.approx(exact.profile(40.0, 0.99), rel=0.03)

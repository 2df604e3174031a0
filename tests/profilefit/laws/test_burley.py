"""Normalized diffusion: its scale law, and Golubev's closed inverse."""

import math

import numpy as np
import pytest


@pytest.mark.parametrize(("reflectance", "scale"), [(0.0, 5.434), (0.5, 1.539), (0.8, 1.05), (1.0, 0.906)])
def test_scale_by_hand(burley, reflectance, scale):
    """1.85 - A + 7 |A - 0.8|^3: at A = 0.5 it is 1.35 + 7 * 0.027; without the modulus it would be 1.161."""
    assert float(burley.scale(reflectance)) == pytest.approx(scale, rel=1e-6)


def test_profile_by_hand(burley):
    """A s (e^-s + e^(-s/3)) / (8 pi) at r = l, with A = 0.5."""
    alpha = burley.albedo.alpha(0.5)
    expected = 0.5 * 1.539 * (math.exp(-1.539) + math.exp(-0.513)) / (8 * math.pi)
    assert burley.profile(1.0, alpha) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("alpha", [0.05, 0.5, 0.9, 1.0])
def test_sampler_inverts_the_cdf(burley, alpha):
    xi = np.concatenate([[0.0], np.geomspace(1e-6, 0.5, 40), 1 - np.geomspace(0.49, 1e-9, 40)])
    np.testing.assert_allclose(burley.cdf(burley.sampler.sample(xi, alpha), alpha), xi, rtol=0, atol=1e-12)
    assert np.all(np.diff(burley.sampler.sample(xi, alpha)) > 0)


def test_sampler_density_is_the_laws(burley):
    r = np.geomspace(1e-3, 50, 30)
    density = 2 * np.pi * r * burley.profile(r, 0.7) / burley.albedo.reflectance(0.7)
    np.testing.assert_allclose(burley.sampler.pdf(r, 0.7), density, rtol=1e-12)


def test_median_by_bisection(burley):
    """The inverse against the plainest one there is."""
    low, high = 0.0, 20.0
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if burley.cdf(middle, 0.8) < 0.5 else (low, middle)
    assert burley.sampler.sample(0.5, 0.8) == pytest.approx(low, rel=1e-13)


def test_every_constant_is_seen(burley):
    assert burley.seen_by("energy") == ("s0", "s1", "s2", "s3")

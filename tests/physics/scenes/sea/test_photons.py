"""The numpy Monte Carlo of water against what is known of it without photons."""

import numpy as np
import pytest
from scipy.integrate import quad

from benchmarks.sea_photons import trace_beam, trace_view
from mcml_sim.media.phase import HenyeyGreenstein, Isotropic
from profilefit.scenes.sea.paths import turn

SHARP = HenyeyGreenstein(0.924)
DEPTHS, RADII = np.array([0.3, 1.0, 2.5]), np.array([0.05, 0.5, 2.0])


def test_one_scattering_is_its_integral(sidak):
    """Down through a plane by order 1: int_0^t e^-s int_0^1 p e^{-(t - s) / mu} dmu ds, for two phases."""
    bound = sidak(6)
    for phase in (SHARP, Isotropic()):
        found = trace_beam(phase, DEPTHS, RADII, 200_000, 11).plane.groups[:, 1]
        value, error = found.mean(axis=0), found.std(axis=0, ddof=1) / np.sqrt(len(found))
        x, w = np.polynomial.legendre.leggauss(80)
        # mu = 1 - u^2: even where a sharp lobe is
        u, weight = 0.5 * (x + 1), 0.5 * w
        mu = 1 - u * u
        for t, one, sigma in zip(DEPTHS, value, error, strict=True):
            rate = 1 / mu - 1
            inner = np.exp(-t) * -np.expm1(-t * rate) / np.maximum(rate, 1e-300)
            known = np.sum(weight * 2 * u * 2 * np.pi * phase.pdf(mu) * inner)
            assert abs(one - known) < 1.5 * bound * sigma  # errors of 16 groups have errors of 18 %
            assert abs(one - 1.05 * known) > 1.5 * bound * sigma


def test_energy_between_planes(sidak):
    """Of isotropic scattering far down, net flux falls as absorption takes it: both directions, all orders.

    The flux that is absorbed below a plane is what crosses it, net; deep enough under the source the fluence falls as
    e^{-k t}, with k = 0.7104 for omega 0.8, the root of omega atanh(k) = k.
    """
    planes = np.array([2.0, 3.0])
    found = trace_beam(Isotropic(), planes, [1.0], 400_000, 3)
    down, up = found.plane.at(0.8), found.upward.at(0.8)
    net = down.value - up.value
    error = np.hypot(down.standard_error, up.standard_error) / net
    assert abs(np.log(net[0] / net[1]) - 0.7104) < 0.08 + 4 * np.hypot(*error)
    assert np.all(up.value > 0)


def test_turned_directions():
    """Unit vectors at the angle asked for, from every direction, straight up and down included."""
    random = np.random.default_rng(2)
    count = 1000
    begin = random.normal(size=(3, count))
    begin /= np.linalg.norm(begin, axis=0)
    begin[:, :2] = [[0, 0], [0, 0], [1, -1]]
    below = 10 ** random.uniform(-9, np.log10(2), count)
    end = np.array(turn(*begin, below, 2 - below, random.uniform(0, 2 * np.pi, count)))
    np.testing.assert_allclose(np.sum(end**2, axis=0), 1.0, rtol=1e-12)
    # |a - b|^2 = 2 (1 - cos), which keeps digits that 1 - a b has lost
    np.testing.assert_allclose(0.5 * np.sum((end - begin) ** 2, axis=0), below, rtol=1e-4, atol=1e-15)


def test_a_view_has_single_scattering_by_its_integral():
    """Order 1, by quadrature along the ray, in any direction and under a low sun; an eye that looks up sees the end."""
    for cosine, sun in ((0.0, 0.0), (0.6, 0.0), (-0.6, 0.5), (1.0, 0.3), (-1.0, 0.0), (-0.9, 1.0)):
        found = trace_view(SHARP, [0.4, 2.0], cosine, sun, photons=16, seed=0).groups[0, 1]
        turned = np.sqrt(1 - cosine**2) * np.sin(sun) - cosine * np.cos(sun)
        for depth, value in zip((0.4, 2.0), found, strict=True):
            end = depth / -cosine if cosine < 0 else 50.0
            known = quad(lambda s, d=depth: np.exp(-(d + cosine * s) / np.cos(sun) - s), 0, end, epsabs=1e-13)[0]  # noqa: B023
            assert value == pytest.approx(float(SHARP.pdf(turned)) * known, rel=1e-7)


def test_backward_is_forward(sidak):
    """Radiance toward a horizontal eye under isotropic scattering is omega / 4 pi times the fluence there.

    At the surface of a half space in the sun, straight down, that is H(1) times the sun's irradiance (Chandrasekhar,
    Radiative Transfer, 1950).
    """
    depth = 1e-6
    found = trace_view(Isotropic(), [depth], photons=200_000, seed=4).at(0.8)
    x, w = np.polynomial.legendre.leggauss(64)
    mu, weight = 0.5 * (x + 1), 0.5 * w
    h = np.ones_like(mu)
    for _ in range(200):  # H(mu) = 1 / (sqrt(1 - omega) + omega / 2 int mu' H / (mu + mu') dmu')
        h = 1 / (np.sqrt(0.2) + 0.4 * np.sum(weight * mu * h / (mu[:, None] + mu), axis=1))
    known = 1 / (np.sqrt(0.2) + 0.4 * np.sum(weight * mu * h / (1 + mu)))
    value, error = found.value[0] * 4 * np.pi / 0.8, found.standard_error[0] * 4 * np.pi / 0.8
    assert abs(value - known) < 1.5 * sidak(1) * error + 1e-4
    assert error < 0.01 * known

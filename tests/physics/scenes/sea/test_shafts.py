"""Shafts under waves by lines, prisms and slices against quadrature."""

from functools import cache

import numpy as np
import pytest
from scipy.optimize import brentq

from mcml_sim.media.phase import HenyeyGreenstein, Isotropic
from profilefit.errors import InputError
from profilefit.scenes.sea.chart import FINE, Bundle, ViewRay, by_lines, by_prisms, by_slices, flux_below

WAVES = ((0.05, 1, 0.0), (0.03, 2, 1.0), (0.02, 3, 2.0))
OVERHEAD, TILTED = Bundle(0.0, WAVES), Bundle(0.4, WAVES)
SHARP = HenyeyGreenstein(0.924)


def view(x, z, elevation, length, azimuth=0.0):
    up, around = np.radians(elevation), np.radians(azimuth)
    return ViewRay(x, z, (np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)), length)


VIEWS = [
    view(x, z, elevation, length, azimuth)
    for x in (0.0, 0.37)
    for z, elevation, length in ((1.0, 20, 2.0), (2.0, -20, 3.0), (0.5, 45, 2.0), (2.5, -60, 2.5), (1.5, 0, 3.0))
    for azimuth in (0, 40)
]


@cache
def truths(bundle, phase):
    return np.array([by_prisms(bundle, one, phase, FINE) for one in VIEWS])


def rms(way, count, bundle=OVERHEAD, phase=SHARP):
    found = np.array([way(bundle, one, phase, count) for one in VIEWS])
    return float(np.sqrt(np.mean((found / truths(bundle, phase) - 1) ** 2)))


def test_the_quadrature_against_a_sum_along_the_ray():
    """Before the first fold a place has one ray, found by bisection, and irradiance 1 / |1 + z dq/dX|."""
    bundle = Bundle(0.3, ((0.04, 1, 0.4),), c=0.7)
    at = view(0.2, 0.5, 25, 1.5, 30)
    t = at.length * (np.arange(4000) + 0.5) / 4000
    along = np.empty_like(t)
    for i, one in enumerate(t):
        x, z = at.x + at.direction[0] * one, at.z + at.direction[2] * one
        start = brentq(lambda s, x=x, z=z: s + z * float(bundle.slope(np.array(s))) - x, x - 3, x + 3, xtol=1e-13)
        q = float(bundle.slope(np.array(start)))
        density = 1 / (1 + z * 0.04 * 2 * np.pi * np.cos(2 * np.pi * start + 0.4))
        slant = np.sqrt(1 + q * q)
        cosine = -(at.direction[0] * q + at.direction[2]) / slant
        along[i] = float(SHARP.pdf(cosine)) * density * slant * np.exp(-0.7 * (z * slant + one))
    assert by_prisms(bundle, at, SHARP, FINE) == pytest.approx(at.length * along.mean(), rel=2e-6)


def test_error_over_samples():
    """Lines 3.4 % at 16 a period and 0.7 at 64; prisms 0.3 and 0.02; slices 0.7 at 64: rms over twenty views."""
    for bundle, lines, prisms in ((OVERHEAD, (0.034, 0.007), (0.003, 2e-4)), (TILTED, (0.09, 0.0065), (0.0065, 3e-4))):
        for i, count in enumerate((16, 64)):
            assert 0.5 * lines[i] < rms(by_lines, count, bundle) < 1.2 * lines[i]
            assert rms(by_prisms, count, bundle) < 1.3 * prisms[i]
        assert rms(by_prisms, 16, bundle) < 0.2 * rms(by_lines, 16, bundle)
    # Lines and prisms have one limit.
    at = VIEWS[0]
    assert by_lines(OVERHEAD, at, SHARP, 1 << 17) == pytest.approx(truths(OVERHEAD, SHARP)[0], rel=2e-5)


@pytest.mark.slow
@pytest.mark.parametrize("bundle", [OVERHEAD, TILTED])
def test_slices(bundle):
    for phase in (Isotropic(), SHARP):
        assert rms(by_slices, 64, bundle, phase) < 0.01


def test_flux_is_kept():
    for depth in (0.0, 0.7, 3.0):
        x = np.linspace(-0.7, 2.0, 50)
        flux, _ = flux_below(OVERHEAD, depth, x)
        np.testing.assert_allclose(flux_below(OVERHEAD, depth, x + 1.0)[0] - flux, 1.0, rtol=1e-12)
        assert np.all(np.diff(flux) >= 0)
    np.testing.assert_allclose(flux_below(TILTED, 2.0, np.array([0.0, 1.0]))[1], (0.0, 0.4), atol=1e-12)
    assert np.max(np.abs(np.diff(flux) / np.diff(x) - 1)) > 0.5  # and the map is none of an even light


def test_what_has_no_prisms():
    with pytest.raises(InputError, match="count must be"):
        by_prisms(OVERHEAD, VIEWS[0], SHARP, 0)

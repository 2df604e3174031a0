"""Exact irradiance under waves of one dimension: closed forms, conservation, and photons."""

import numpy as np
import pytest

from benchmarks.sea_boxes import SUN, caustic_boxes
from mcml_sim.media.fresnel import fresnel
from profilefit.errors import InputError
from profilefit.scenes.sea.truth import caustic_irradiance
from profilefit.scenes.sea.waves import refracted

N, PERIOD = 1.34, 2.0
EDGES = np.linspace(0.0, PERIOD, 65)


def sea(x):
    return 0.06 * np.cos(np.pi * x + 0.3) + 0.02 * np.cos(3.0 * np.pi * x + 1.0)


def sea_slope(x):
    return -0.06 * np.pi * np.sin(np.pi * x + 0.3) - 0.06 * np.pi * np.sin(3.0 * np.pi * x + 1.0)


def calm(x):
    return 0.0 * x


@pytest.mark.parametrize("tilt", [0.0, 0.5, 1.2])
def test_below_a_calm_sea(tilt):
    """T(tilt) cos(tilt), whatever the depth; nothing is reflected between like media."""
    share = 1.0 - float(fresnel(1.0, N, np.cos(tilt))[0])
    found = caustic_irradiance(calm, np.linspace(-3.0, 3.0, 5), 5.0, tilt, N)
    np.testing.assert_allclose(found, share * np.cos(tilt), rtol=1e-13)
    np.testing.assert_allclose(caustic_boxes(calm, EDGES, 0.3, tilt, N), share * np.cos(tilt), rtol=1e-10)
    np.testing.assert_allclose(caustic_irradiance(sea, 0.7, 5.0, tilt, 1.0), np.cos(tilt), rtol=1e-10)
    assert isinstance(caustic_irradiance(calm, 0.7, 5.0, tilt, N), float)


def test_under_a_crest():
    """Where the slope is 0: T(0) / |1 - (1 - 1/n) (D + a) kappa|, before the focus and, with two more rays, beyond."""
    height, k = 0.05, 2.0
    crest = lambda x: height * np.cos(k * x)  # noqa: E731
    normal = 1.0 - ((N - 1.0) / (N + 1.0)) ** 2
    for depth in (2.0, 5.0, 30.0):
        ray = normal / abs(1.0 - (1.0 - 1.0 / N) * (depth + height) * height * k**2)
        found = caustic_irradiance(crest, 0.0, depth, 0.0, N)
        if depth < 30.0:
            np.testing.assert_allclose(found, ray, rtol=1e-7)
        else:
            assert found > 1.2 * ray


@pytest.mark.parametrize(("depth", "tilt"), [(1.5, 0.0), (5.0, 0.4), (5.0, 1.2)])
def test_no_light_is_lost(depth, tilt):
    """A period of the floor has what entered through a period of the sea, shaded waves and folds included."""
    x = np.arange(2**16) * PERIOD / 2**16
    across = x * np.cos(tilt) + sea(x) * np.sin(tilt)
    twice = np.concatenate([across - PERIOD * np.cos(tilt), across])
    lit = across >= np.maximum.accumulate(twice)[x.size :]
    entered = np.mean(np.where(lit, refracted(tilt, (sea_slope(x), calm(x)), N)[2], 0.0))
    np.testing.assert_allclose(caustic_boxes(sea, EDGES, depth, tilt, N).mean(), entered, rtol=2e-4)
    # Between like media each place has cos(tilt), though crests shade a part of the sea.
    np.testing.assert_allclose(caustic_boxes(sea, EDGES, depth, tilt, 1.0), np.cos(tilt), rtol=1e-8)


@pytest.mark.parametrize(("depth", "tilt"), [(1.5, 0.0), (5.0, 0.4)])
def test_places_and_boxes_are_one_function(depth, tilt):
    """A box of 1e-6 m has what its middle has; differences of eighth order are as good as given derivatives."""
    x = np.random.default_rng(2).uniform(0.0, PERIOD, 40)
    places = caustic_irradiance(sea, x, depth, tilt, N)
    boxes = np.array([caustic_boxes(sea, [one - 5e-7, one + 5e-7], depth, tilt, N)[0] for one in x])
    np.testing.assert_allclose(places, boxes, rtol=1e-4)

    def bend(x):
        return -0.06 * np.pi**2 * (np.cos(np.pi * x + 0.3) + 3.0 * np.cos(3.0 * np.pi * x + 1.0))

    given = caustic_irradiance(sea, x, depth, tilt, N, slope=sea_slope, curvature=bend)
    np.testing.assert_allclose(places, given, rtol=1e-6)
    np.testing.assert_allclose(places, caustic_irradiance(sea, x, depth, tilt, N, spacing=0.002), rtol=1e-6)


def against_photons(depth, tilt, batches, seed):
    """Exact boxes, and those of a floor 1 % deeper, less photons: in standard errors; these errors, relative.

    A million photons a batch enter at random over a period of the sea; where they land counts within the period.
    """
    rng = np.random.default_rng(seed)
    exact, wrong = (caustic_boxes(sea, EDGES, deep, tilt, N) for deep in (depth, 1.01 * depth))
    count = 1_000_000
    first, second = np.zeros((2, EDGES.size - 1))
    for _ in range(batches):
        x = rng.uniform(0.0, PERIOD, count)
        across, _, flux = refracted(tilt, (sea_slope(x), calm(x)), N)
        box = (np.mod(x + (depth + sea(x)) * across, PERIOD) * (first.size / PERIOD)).astype(int) % first.size
        first += np.bincount(box, flux, first.size)
        second += np.bincount(box, flux**2, first.size)
    scale = first.size / (count * batches)
    found, error = scale * first, scale * np.sqrt(second)
    return (exact - found) / error, (wrong - found) / error, error / found


@pytest.mark.parametrize(("depth", "tilt"), [(1.5, 0.0), (5.0, 0.4)])
def test_against_photons(sidak, depth, tilt):
    """2e6 photons tell a floor that is 1 % deeper apart where light folds, and no difference from the exact one."""
    off, wrong, _ = against_photons(depth, tilt, 2, seed=4)
    assert np.abs(off).max() < sidak(off.size)
    assert 0.7 < np.sqrt(np.mean(off**2)) < 1.3
    if depth > 2.0:
        assert np.abs(wrong).max() > 2.0 * sidak(off.size)


@pytest.mark.slow
@pytest.mark.parametrize(("depth", "tilt"), [(1.5, 0.0), (5.0, 0.4)])
def test_against_many_photons(sidak, depth, tilt):
    """6e7 photons: within their errors, and within 1 %."""
    off, wrong, error = against_photons(depth, tilt, 60, seed=5)
    assert np.abs(off).max() < sidak(off.size)
    assert np.abs(off * error).max() < 0.01
    assert np.abs(wrong).max() > 2.0 * sidak(off.size)


@pytest.mark.slow
def test_a_fold_is_infinite_under_a_point_sun_only():
    """Toward a fold irradiance grows without end, as 1 / sqrt of the distance; pixels and a sun's disc bound it."""
    depth = 5.0
    x = np.linspace(0.0, PERIOD, 20001)
    places = caustic_irradiance(sea, x, depth, 0.0, N)
    fine = [caustic_boxes(sea, np.linspace(0.0, PERIOD, n + 1), depth, 0.0, N) for n in (64, 1024)]
    sunny = [caustic_boxes(sea, np.linspace(0.0, PERIOD, n + 1), depth, 0.0, N, sun=SUN) for n in (64, 1024)]
    assert places.max() > 20.0
    assert fine[1].max() > 2.5 * fine[0].max()
    assert sunny[1].max() < 1.5 * sunny[0].max()
    np.testing.assert_allclose([one.mean() for one in sunny], fine[0].mean(), rtol=1e-4)
    # The disc is as wide as SUN / n each way, times the depth: light is 0.7 % of the depth wide.
    np.testing.assert_allclose(2.0 * SUN / N, 0.007, rtol=0.02)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"depth": -1.0}, "depth must be a length > 0 \\[m\\], got -1.0$"),
        ({"depth": 0.05}, "depth must be below the deepest trough, 0\\.07\\d* m, got 0.05$"),
        ({"tilt": 30.0}, "tilt must be in \\[0, pi / 2\\), in radians, got 30.0$"),
        ({"tilt": -0.1}, "tilt must be in \\[0, pi / 2\\), in radians, got -0.1$"),
        ({"tilt": np.nan}, "tilt must be in \\[0, pi / 2\\), in radians, got nan$"),
        ({"n": 0.0}, "n must be a refractive index > 0, got 0.0$"),
        ({"n": "water"}, "n must be a refractive index > 0, got 'water'$"),
        ({"x": [0.0, np.nan]}, "x must be finite numbers \\[m\\], got nan$"),
        ({"surface": lambda x: x + np.nan}, "surface must be finite, got nan$"),
        ({"surface": 3.0}, "surface must be a function of an array of x \\[m\\], got 'float' object is not callable$"),
        ({"spacing": 0.0}, "spacing must be a length > 0 \\[m\\], got 0.0$"),
    ],
)
def test_refusals(given, message):
    with pytest.raises(InputError, match=f"^{message}"):
        caustic_irradiance(**{"surface": sea, "x": [0.0, 1.0], "depth": 5.0, "tilt": 0.0, "n": N, **given})

"""Sums of cosines, and what their slopes do to sunlight."""

import numpy as np
import pytest

from mcml_sim.media.fresnel import fresnel
from profilefit.errors import InputError
from profilefit.scenes.sea.waves import Waves, random_floor, random_sea, refracted

TILE = 10.0
STEP = 2.0 * np.pi / TILE


@pytest.fixture
def sea():
    return random_sea(0.15, TILE, seed=3)


def test_slopes_are_derivatives(sea):
    x, y = np.random.default_rng(0).uniform(0.0, TILE, (2, 200))
    step = 1e-4
    east, west, north, south = (
        sea.height(x + dx, y + dy) for dx, dy in np.array([[1, 0], [-1, 0], [0, 1], [0, -1]]) * step
    )
    zx, zy = sea.slope(x, y)
    np.testing.assert_allclose(zx, (east - west) / (2 * step), atol=1e-8)
    np.testing.assert_allclose(zy, (north - south) / (2 * step), atol=1e-8)


def test_lattice_is_height_and_slope_at_all_pairs(sea):
    x, y = np.linspace(-3.0, 4.0, 7), np.linspace(0.5, 9.0, 5)
    at = np.meshgrid(x, y)
    for found, expected in zip(sea.lattice(x, y), (sea.height(*at), *sea.slope(*at)), strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-13)


def test_the_tile_repeats(sea):
    x, y = np.random.default_rng(1).uniform(0.0, TILE, (2, 50))
    np.testing.assert_allclose(sea.height(x + TILE, y - 2.0 * TILE), sea.height(x, y), atol=1e-12)
    assert np.max(np.abs(sea.height(x + 0.5 * TILE, y) - sea.height(x, y))) > 0.01


def test_random_sea_has_its_slope_and_runs_with_the_wind(sea):
    x = np.arange(64) * TILE / 64
    _, zx, zy = sea.lattice(x, x)
    np.testing.assert_allclose(np.sqrt(np.mean(zx**2 + zy**2)), 0.15, rtol=1e-12)
    np.testing.assert_allclose(sea.rms_slope, 0.15, rtol=1e-12)
    # The factor (k.w)^2 leaves slopes across the wind a third of the variance; 40 seas of 24 waves scatter by 5 %.
    along, across = np.zeros((2, 40))
    for seed in range(40):
        one = random_sea(0.15, TILE, seed, wind=(0.0, 7.0))
        across[seed], along[seed] = (np.sum((one.amplitudes * one.vectors[:, axis]) ** 2) for axis in (0, 1))
    assert 2.0 < along.sum() / across.sum() < 4.5
    np.testing.assert_array_equal(random_sea(0.15, TILE, 3).amplitudes, sea.amplitudes)
    assert not np.allclose(random_sea(0.15, TILE, 4).amplitudes, sea.amplitudes)


def test_bounds_and_the_steepest_and_most_curved_place():
    one = Waves(TILE, [0.2], [[3 * STEP, 4 * STEP]], [0.7], mean=-4.0)
    k = 5 * STEP
    assert (one.lowest, one.highest) == (-4.2, -3.8)
    np.testing.assert_allclose([one.steepest, one.crest], [0.2 * k, 0.2 * k**2], rtol=1e-3)
    np.testing.assert_allclose(one.scaled(3.0).crest, 3.0 * one.crest)
    floor = random_floor(0.4, TILE, 5.0, seed=2)
    assert floor.mean == -5.0
    np.testing.assert_allclose(floor.rms_slope, 0.4)
    x = np.linspace(0.0, TILE, 200)
    z = floor.lattice(x, x)[0]
    assert floor.lowest < z.min() < z.max() < floor.highest


def test_refraction_is_snell_and_fresnel():
    """Angles to the surface's own normal, by another way: sines of angles between vectors."""
    rng = np.random.default_rng(5)
    zx, zy = rng.normal(0.0, 0.3, (2, 500))
    tilt, n = 0.6, 1.34
    x, y, flux = refracted(tilt, (zx, zy), n)
    ray = np.stack([x, y, -np.ones_like(x)], axis=-1) / np.sqrt(1.0 + x**2 + y**2)[:, None]
    normal = np.stack([-zx, -zy, np.ones_like(zx)], axis=-1)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    sun = np.array([np.sin(tilt), 0.0, -np.cos(tilt)])
    np.testing.assert_allclose(n * np.cross(ray, normal), np.cross(sun, normal), atol=1e-12)
    cosine = -normal @ sun
    np.testing.assert_allclose(flux, (1.0 - fresnel(1.0, n, cosine)[0]) * cosine / normal[:, 2], rtol=1e-12)
    # Nothing changes at a surface between like media; what faces away is dark.
    x, y, flux = refracted(tilt, (zx, zy), 1.0)
    np.testing.assert_allclose([x, y], [np.full(500, np.tan(tilt)), np.zeros(500)], atol=1e-12)
    assert refracted(1.4, (np.array([-0.2]), np.zeros(1)), 1.34)[2] == 0.0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Waves(0.0), "tile must be a length in 1e-09 ... 1e\\+09 m, got 0.0"),
        (
            lambda: Waves(TILE, [0.1], [[1.0, 0.0]], [0.0]),
            "vectors must be multiples of 2 pi / tile = 0.628319 /m, got 1",
        ),
        (lambda: Waves(TILE, [0.1], [[STEP, 0.0]], [0.0, 1.0]), "phases must have shape \\(1,\\), got \\(2,\\)"),
        (lambda: Waves(TILE, [np.nan], [[STEP, 0.0]], [0.0]), "amplitudes must be finite numbers, got nan"),
        (lambda: Waves(TILE, mean=np.inf), "mean must be a level \\[m\\], got inf"),
        (lambda: random_sea(-0.1, TILE), "rms_slope must be a number >= 0, got -0.1"),
        (lambda: random_sea(0.1, 1e-300), "tile must be a length in 1e-09 ... 1e\\+09 m, got 1e-300"),
        (lambda: random_floor(0.1, 1e-300, 5.0), "tile must be a length in 1e-09 ... 1e\\+09 m, got 1e-300"),
        (lambda: random_sea(0.1, TILE, wind=(0.0, 0.0)), "wind must be two speeds \\[m/s\\], not both 0"),
        (lambda: random_sea(0.1, TILE, count=0), "count must be a whole number >= 1, got 0"),
        (lambda: random_floor(0.1, TILE, -1.0), "depth must be a length in 1e-09 ... 1e\\+09 m, got -1.0"),
    ],
)
def test_refusals(make, message):
    with pytest.raises(InputError, match=f"^{message}.*$"):
        make()

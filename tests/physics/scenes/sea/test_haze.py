"""What the water leaves, and the haze of a sunlit sea, against all orders of scattering."""

from functools import cache

import numpy as np
import pytest

from benchmarks.sea_photons import scattered_once, trace_view
from profilefit.errors import InputError
from profilefit.scenes.sea.haze import BROADENED, KINDS, SCALED, SINGLE, sunlit_haze, table, ways
from profilefit.scenes.sea.law import beam_share, water_mtf
from profilefit.scenes.sea.paths import Sunlight, followed
from profilefit.scenes.sea.scene import lobes_of
from profilefit.scenes.sea.water import World
from profilefit.scenes.sea.waves import Waves

LOBES = lobes_of("petzold")
OMEGAS, DEPTHS = np.array([0.2, 0.5, 0.8]), np.array([0.3, 1.0, 2.0, 4.0])
LEVEL, UP = 0.0, -0.5  # cosines of views to the downward vertical
NONE, ONE = (0.0,) * 3, (1.0,) * 3
# By all light: the least and the most of `BROADENED` over the depths, of each albedo.
KNOWN = {LEVEL: ((0.90, 1.00), (0.74, 1.02), (0.61, 1.13)), UP: ((0.92, 1.00), (0.86, 0.99), (0.87, 0.96))}


SEA, FLOOR = Waves(5.0), Waves(5.0, mean=-60.0)
WATER = World(tuple(1.0 - OMEGAS), tuple(OMEGAS), LOBES, 1.0 + 1e-7, SEA, FLOOR, NONE, 0.0, ONE, NONE)


@cache
def by_laws(cosine, kind):
    """(albedos, depths) [1/sr]."""
    return np.array([[sunlit_haze(omega, ct, cosine, LOBES, kind) for ct in DEPTHS] for omega in OMEGAS])


@cache
def by_paths(cosine, rays=20_000):
    """All orders in a deep, calm sea that mirrors nothing, and the standard errors: (2, albedos, depths)."""
    light = Sunlight(WATER, levels=4, pixels=8, rays=8)
    found = np.zeros((2, 3, DEPTHS.size))
    for column, ct in enumerate(DEPTHS):
        place = np.tile([0.0, 0.0, -ct], (rays, 1))
        way = np.tile([-np.sqrt(1.0 - cosine**2), 0.0, -cosine], (rays, 1))
        each = followed(WATER, light, place, way, np.random.default_rng(column)) / WATER.calm[1]
        found[:, :, column] = each.mean(axis=0), each.std(axis=0) / np.sqrt(rays)
    return found


def is_known(cosine, kind, value, error):
    """Whether a way of counting is by all light what is known of `BROADENED`, within 2 % and four errors."""
    ratio, slack = by_laws(cosine, kind) / value, 4.0 * error / value
    least, most = np.array(KNOWN[cosine]).T[..., None]
    return bool(np.all((ratio > least - 0.02 - slack) & (ratio < most + 0.02 + slack)))


@pytest.mark.parametrize("cosine", [LEVEL, UP])
def test_all_light_that_comes_to_an_eye(cosine):
    """Broadened twice it is within 10 % at albedo 0.2; a level view at ct 4 has 74 % of it at 0.5, and 61 % at 0.8."""
    value, error = by_paths(cosine)
    assert [is_known(cosine, kind, value, error) for kind in KINDS] == [True, False, False]
    assert np.all(error < 0.03 * value)
    broadened, scaled, single = (np.abs(by_laws(cosine, kind) / value - 1.0)[1:, 1:] for kind in KINDS)
    assert np.all(broadened < 0.7 * scaled)
    assert np.all(scaled < 0.7 * single)


@pytest.mark.slow
@pytest.mark.parametrize("cosine", [LEVEL, UP])
def test_photons_that_come_to_an_eye(cosine):
    """The same by the other tracer, which shares nothing with the paths but the phase function."""
    orders = trace_view(WATER.phase, DEPTHS, cosine, 0.0, 8_000_000, seed=7)
    found = [orders.at(float(omega)) for omega in OMEGAS]
    value, error = (np.array([getattr(one, name) for one in found]) for name in ("value", "standard_error"))
    assert [is_known(cosine, kind, value, error) for kind in KINDS] == [True, False, False]
    assert np.all(error < 0.05 * value)


@pytest.mark.parametrize("cosine", [LEVEL, UP, 0.6, -1.0])
def test_single_scattering_is_its_integral(cosine):
    """By its closed form, under each albedo."""
    view = (-np.sqrt(1.0 - cosine**2), 0.0, cosine)
    once = scattered_once(WATER.phase, DEPTHS, view, (0.0, 0.0, 1.0))
    np.testing.assert_allclose(by_laws(cosine, SINGLE), OMEGAS[:, None] * once, rtol=2e-4)
    assert np.all(np.abs(by_laws(cosine, SCALED) / (OMEGAS[:, None] * once) - 1.0) > 0.05)


def test_ways_of_each_kind():
    """Single: c t. Scaled: the peak, mean of g^2, goes on. Broadened: from sharp through shafts to wide light."""
    omega, ct = OMEGAS[:, None], DEPTHS
    for found in ways(omega, ct, 0.3, LOBES, SINGLE):
        np.testing.assert_array_equal(found, np.broadcast_to(ct, (3, 4)))
    peak = sum(weight * g**2 for weight, g in LOBES)
    for found in ways(omega, ct, 0.3, LOBES, SCALED):
        np.testing.assert_allclose(found, ct * (1.0 - omega * peak), rtol=1e-14)
    sharp, narrow, wide = ways(omega, ct, 0.3, LOBES, BROADENED)
    np.testing.assert_array_equal(sharp, np.broadcast_to(ct, (3, 4)))
    np.testing.assert_allclose(np.exp(-narrow), beam_share(omega, ct, 0.3, LOBES), rtol=1e-12)
    np.testing.assert_allclose(np.exp(-wide), water_mtf(omega, ct, 0.0, LOBES), rtol=1e-12)
    assert np.all((wide < narrow) & (narrow < sharp))
    for width, same in ((0.0, sharp), (np.inf, wide)):
        np.testing.assert_allclose(ways(omega, ct, width, LOBES, BROADENED)[1], same, rtol=1e-9)
    for found in ways(0.0, ct, 0.3, LOBES, BROADENED):
        np.testing.assert_allclose(found, ct, rtol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_a_table_has_a_row_of_each(kind):
    """Of lengths in metres, each colour by its own attenuation."""
    c, omega, lengths, width = np.array([0.4, 0.2, 1.1]), np.array([0.2, 0.6, 0.8]), np.linspace(0.0, 20.0, 7), 0.4
    found = table(c, omega, width, LOBES, kind, lengths)
    assert (found.dtype, found.shape) == (np.float32, (3, 7, 4))
    for colour in range(3):
        known = ways(omega[colour], c[colour] * lengths, c[colour] * width, LOBES, kind)
        np.testing.assert_allclose(found[..., colour], known, rtol=1e-6)
    np.testing.assert_array_equal(found[:, 0], 0.0)
    assert not np.allclose(found[..., 0], found[..., 1])


def test_what_no_haze_has():
    for call in (lambda: ways(0.5, 1.0, 1.0, LOBES, "double"), lambda: sunlit_haze(0.5, 1.0, 0.0, LOBES, "double")):
        with pytest.raises(InputError, match=r"^kind must be one of broadened, scaled, single, got 'double'$"):
            call()

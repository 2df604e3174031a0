"""Photons in water: a Monte Carlo of beams and views, haze in closed form, and the truth's paths."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import quad

from benchmarks.sea_photons import scattered_once, trace_beam, trace_view
from mcml_sim.media.medium import fresnel
from mcml_sim.media.phase import HenyeyGreenstein, Isotropic
from profilefit.scenes.sea import paths
from profilefit.scenes.sea.caustics import Splat, caustic_map
from profilefit.scenes.sea.haze import BROADENED, KINDS, SCALED, SINGLE, sunlit_haze, table, ways
from profilefit.scenes.sea.law import beam_share, water_mtf
from profilefit.scenes.sea.paths import Sunlight, followed, met, traced, turn
from profilefit.scenes.sea.scene import lobes_of
from profilefit.scenes.sea.water import World
from profilefit.scenes.sea.waves import Waves, dense_hit, newton_hit, random_floor, random_sea, refracted, to_plane
from tests.fixtures import slow
from tests.unit.scenes.scenes import refused

SHARP = HenyeyGreenstein(0.924)
OMEGAS = np.array([0.2, 0.5, 0.8])
NONE, ONE = (0.0,) * 3, (1.0,) * 3
DEPTHS, RADII = np.array([0.3, 1.0, 2.5]), np.array([0.05, 0.5, 2.0])
TILE, N, LIKE_AIR = 5.0, 1.34, 1.0 + 1e-7  # a world's water must be denser than the air
MILD = ((1.0, 0.8),)
RATES = np.array([0.6, 1.0, 1.6])
VIEWS = [(0.5, 0.0, 0.5), (0.5, -0.6, 2.0), (0.0, 0.0, 2.0)]


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
    found = trace_beam(Isotropic(), np.array([2.0, 3.0]), [1.0], 400_000, 3)
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
    end = np.array(turn(begin, below, 2 - below, random.uniform(0, 2 * np.pi, count)))
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
    found = trace_view(Isotropic(), [1e-6], photons=200_000, seed=4).at(0.8)
    x, w = np.polynomial.legendre.leggauss(64)
    mu, weight = 0.5 * (x + 1), 0.5 * w
    h = np.ones_like(mu)
    for _ in range(200):  # H(mu) = 1 / (sqrt(1 - omega) + omega / 2 int mu' H / (mu + mu') dmu')
        h = 1 / (np.sqrt(0.2) + 0.4 * np.sum(weight * mu * h / (mu[:, None] + mu), axis=1))
    known = 1 / (np.sqrt(0.2) + 0.4 * np.sum(weight * mu * h / (1 + mu)))
    value, error = found.value[0] * 4 * np.pi / 0.8, found.standard_error[0] * 4 * np.pi / 0.8
    assert abs(value - known) < 1.5 * sidak(1) * error + 1e-4
    assert error < 0.01 * known


LOBES = lobes_of("petzold")
HAZE_DEPTHS = np.array([0.3, 1.0, 2.0, 4.0])
LEVEL, UP = 0.0, -0.5  # cosines of views to the downward vertical
# By all light: the least and the most of `BROADENED` over the depths, of each albedo.
KNOWN = {LEVEL: ((0.90, 1.00), (0.74, 1.02), (0.61, 1.13)), UP: ((0.92, 1.00), (0.86, 0.99), (0.87, 0.96))}
SEA, FLOOR = Waves(5.0), Waves(5.0, mean=-60.0)
WATER = World(tuple(1.0 - OMEGAS), tuple(OMEGAS), LOBES, 1.0 + 1e-7, SEA, FLOOR, NONE, 0.0, ONE, NONE)


@cache
def by_laws(cosine, kind):
    """(albedos, depths) [1/sr]."""
    return np.array([[sunlit_haze(omega, ct, cosine, LOBES, kind) for ct in HAZE_DEPTHS] for omega in OMEGAS])


def by_paths(cosine, rays=20_000):
    """All orders in a deep, calm sea that mirrors nothing, and the standard errors: (2, albedos, depths)."""
    light = Sunlight(WATER, levels=4, pixels=8, rays=8)
    found = np.zeros((2, 3, HAZE_DEPTHS.size))
    for column, ct in enumerate(HAZE_DEPTHS):
        place = np.tile([0.0, 0.0, -ct], (rays, 1))
        way = np.tile([-np.sqrt(1.0 - cosine**2), 0.0, -cosine], (rays, 1))
        each = followed(WATER, light, place, way, np.random.default_rng(column)) / WATER.calm[1]
        found[:, :, column] = each.mean(axis=0), each.std(axis=0) / np.sqrt(rays)
    return found


def by_photons(cosine):
    """All orders by the tracer that shares nothing with the paths but the phase function."""
    orders = trace_view(WATER.phase, HAZE_DEPTHS, cosine, 0.0, 8_000_000, seed=7)
    found = [orders.at(float(omega)) for omega in OMEGAS]
    return (np.array([getattr(one, name) for one in found]) for name in ("value", "standard_error"))


@pytest.mark.parametrize(("by", "most_error"), [(by_paths, 0.03), *slow((by_photons, 0.05))])
@pytest.mark.parametrize("cosine", [LEVEL, UP])
def test_all_light_that_comes_to_an_eye(cosine, by, most_error):
    """Broadened twice it is within 10 % at albedo 0.2; a level view at ct 4 has 74 % of it at 0.5, and 61 % at 0.8."""
    value, error = by(cosine)
    least, most = np.array(KNOWN[cosine]).T[..., None]
    slack = 0.02 + 4.0 * error / value
    for kind in KINDS:
        ratio = by_laws(cosine, kind) / value
        assert np.all((ratio > least - slack) & (ratio < most + slack)) == (kind == BROADENED)
    assert np.all(error < most_error * value)
    broadened, scaled, single = (np.abs(by_laws(cosine, kind) / value - 1.0)[1:, 1:] for kind in KINDS)
    assert np.all(broadened < 0.7 * scaled)
    assert np.all(scaled < 0.7 * single)


@pytest.mark.parametrize("cosine", [LEVEL, UP, 0.6, -1.0])
def test_single_scattering_is_its_integral(cosine):
    view = (-np.sqrt(1.0 - cosine**2), 0.0, cosine)
    once = scattered_once(WATER.phase, HAZE_DEPTHS, view, (0.0, 0.0, 1.0))
    np.testing.assert_allclose(by_laws(cosine, SINGLE), OMEGAS[:, None] * once, rtol=2e-4)
    assert np.all(np.abs(by_laws(cosine, SCALED) / (OMEGAS[:, None] * once) - 1.0) > 0.05)


def test_ways_of_each_kind():
    """Single: c t. Scaled: the peak, mean of g^2, goes on. Broadened: from sharp through shafts to wide light."""
    omega, ct = OMEGAS[:, None], HAZE_DEPTHS
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


def coarse(world):
    """Sunlight where its detail does not matter."""
    return Sunlight(world, levels=4, pixels=32, rays=128)


def anywhere(world, count, rng):
    """Places in the water and directions, even over both."""
    level = rng.uniform(world.floor.highest, world.sea.lowest, count)
    way = rng.normal(size=(count, 3))
    return np.column_stack([rng.uniform(0.0, TILE, (count, 2)), level]), way / np.linalg.norm(way, axis=1)[:, None]


def furnace(reflectance):
    """Without loss, between a white floor and a white sky."""
    sea, floor = random_sea(0.2, TILE, 3), random_floor(0.4, TILE, 3.0, 5)
    return World(NONE, (0.05, 0.08, 0.1), MILD, LIKE_AIR, sea, floor, (reflectance,) * 3, 0.4, NONE, (np.pi,) * 3)


def in_furnace(reflectance, count, seed):
    """Mean radiance (10, 3) of ways in ten equal bands of elevation, and its standard error."""
    world, rng = furnace(reflectance), np.random.default_rng(seed)
    place, way = anywhere(world, count, rng)
    found = followed(world, coarse(world), place, way.copy(), rng)
    band = np.minimum((5.0 * (way[:, 2] + 1.0)).astype(int), 9)
    each = [found[band == one] for one in range(10)]
    return np.array([(one.mean(axis=0), one.std(axis=0) / np.sqrt(len(one))) for one in each]).transpose(1, 0, 2)


def test_in_a_furnace_all_is_one():
    """Under waves and over an uneven floor, whatever way a ray goes; not over a floor that takes a half."""
    value, error = in_furnace(1.0, 30_000, seed=1)
    dark, dark_error = in_furnace(0.5, 6_000, seed=2)
    assert np.all(np.abs(value - 1.0) < 4.0 * error)
    assert error.max() < 0.035
    assert np.all(dark[:5] < 1.0 - 8.0 * dark_error[:5])


def other_photons(lobes, tilt, cosine, level, photons, rays, seed=3):
    """A deep, calm sea without mirrors: paths, photons and order 1 (3,), and the standard error of either."""
    b = OMEGAS * RATES
    floor = Waves(TILE, mean=-60.0)
    world = World(tuple(RATES - b), tuple(b), lobes, LIKE_AIR, Waves(TILE), floor, NONE, tilt, ONE, NONE)
    depths = level * RATES
    aside = float(np.sqrt(1.0 - cosine**2))
    orders = trace_view(world.phase, depths, cosine, tilt, photons, seed)
    each = [orders.at(omega) for omega in OMEGAS]
    place, way = np.tile([0.0, 0.0, -level], (rays, 1)), np.tile([-aside, 0.0, -cosine], (rays, 1))
    found = followed(world, coarse(world), place, way, np.random.default_rng(seed)) / (world.calm[1] * world.slant)
    once = scattered_once(world.phase, depths, (-aside, 0.0, cosine), (np.sin(tilt), 0.0, np.cos(tilt)))
    others = np.array([(one.value[i], one.standard_error[i]) for i, one in enumerate(each)]).T
    return found.mean(axis=0), others[0], OMEGAS * once, found.std(axis=0) / np.sqrt(rays), others[1]


@pytest.mark.parametrize(("tilt", "cosine", "level"), [(0.0, 0.0, 0.5), (0.0, -0.5, 2.0), *VIEWS])
def test_other_photons_bring_the_same(tilt, cosine, level):
    """All orders, in each of three waters that one path stands for; the first order alone is far off."""
    value, other, once, error, its = other_photons(MILD, tilt, cosine, level, photons=100_000, rays=40_000)
    off, short = (value - other) / np.hypot(error, its), (once - other) / np.hypot(error, its)
    assert np.all(np.abs(off) < 4.0)
    assert np.all(np.hypot(error, its) < 0.03 * other)
    assert np.all(short < -30.0)


@pytest.mark.slow
@pytest.mark.parametrize(("tilt", "cosine", "level"), VIEWS)
def test_other_photons_of_the_sea(tilt, cosine, level):
    """Petzold's lobe is so sharp that photons need millions, of which each group's error is known badly."""
    value, other, once, error, its = other_photons(lobes_of("petzold"), tilt, cosine, level, 4_000_000, 200_000, 5)
    off = (value - other) / np.hypot(error, its)
    assert np.all(np.abs(off) < 4.0)
    assert np.all(error < 0.01 * other)
    assert np.all((once - other) / np.hypot(error, its) < -10.0)


@pytest.mark.parametrize("tilt", [0.0, 0.6])
def test_light_to_and_fro_under_a_calm_surface(tilt):
    """Clear water: the floor has F / (1 - rho r), r what the surface mirrors of even light, 1 - T / n^2."""
    share, sun, sky = np.array([0.6, 0.3, 0.1]), np.array([3.0, 2.0, 1.0]), np.array([0.5, 0.4, 0.3])
    floor = Waves(TILE, mean=-3.0)
    world = World(NONE, (1e-9,) * 3, MILD, N, Waves(TILE), floor, tuple(share), tilt, tuple(sun), tuple(sky))
    into = 1.0 - quad(lambda u: 2.0 * u * float(fresnel(1.0, N, u)[0]), 0.0, 1.0)[0]
    flux = sun * (1.0 - float(fresnel(1.0, N, np.cos(tilt))[0])) * np.cos(tilt) + sky * into
    known = share * flux / np.pi / (1.0 - share * (1.0 - into / N**2))
    rng = np.random.default_rng(1)
    _, way = anywhere(world, 40_000, rng)
    way[:, 2] = -np.abs(way[:, 2])
    found = followed(world, coarse(world), np.tile([0.0, 0.0, -1.0], (len(way), 1)), way, rng)
    value, error = found.mean(axis=0), found.std(axis=0) / np.sqrt(len(found))
    assert np.all(np.abs(value - known) < 4.0 * error)
    assert np.all(error < 0.006 * known)
    assert np.all((share * flux / np.pi - value)[:2] < -20.0 * error[:2])  # once reflected


@pytest.mark.parametrize(("tilt", "drift"), [(0.0, 0), (0.5, 12)])
def test_sunlight_in_the_water_is_a_caustic_map(context, tilt, drift):
    """On the floor, which is so deep that a calm sea bends light by whole pixels; another sea's map is far from it."""
    pixels = 32
    bend = float(refracted(tilt, (np.zeros(1), np.zeros(1)), N)[0][0])
    depth = drift * TILE / pixels / bend if drift else 4.0
    sea, floor = random_sea(0.12, TILE, 3), Waves(TILE, mean=-depth)
    world = World((0.1,) * 3, (0.1,) * 3, MILD, N, sea, floor, ONE, tilt, ONE, NONE)
    light = Sunlight(world, levels=8, pixels=pixels, rays=384)
    fine = np.arange(700) * TILE / 700
    entered = refracted(tilt, sea.lattice(fine, fine)[1:], N)[2].mean()
    levels = light.light[..., 0].astype(float).mean(axis=1)
    np.testing.assert_allclose(levels, entered, rtol=1e-6)  # of each level
    middle = (np.arange(pixels) + 0.5) * TILE / pixels
    x, y = (one.ravel() for one in np.meshgrid(middle, middle))
    flux, way = light.at(x, y, np.full(x.size, -depth))
    seas = sea, random_sea(0.12, TILE, 4)
    drawn, other = (caustic_map(context, one, Splat.CELLS, 256, pixels, depth, tilt).light for one in seas)
    found = flux.reshape(pixels, pixels) / entered
    off, transposed, far = (np.sqrt(np.mean((one - drawn) ** 2)) for one in (found, found.T, other))
    assert off < 0.03
    assert min(transposed, far) > 0.2
    np.testing.assert_allclose(np.linalg.norm(way, axis=1), 1.0, rtol=1e-12)
    assert np.all(way[:, 2] < -0.8)


def test_sunlight_under_a_calm_sea_is_alike_all_over():
    """Its flux and its way are those of one ray, at every place, and above the surface."""
    world = World(ONE, ONE, MILD, N, Waves(TILE), Waves(TILE, mean=-4.0), ONE, 0.6, ONE, NONE)
    place = np.random.default_rng(0).uniform((-9.0, -9.0, -4.0), (9.0, 9.0, 0.1), (500, 3))
    flux, way = coarse(world).at(*place.T)
    share = 1.0 - float(fresnel(1.0, N, np.cos(0.6))[0])
    np.testing.assert_allclose(flux, share * np.cos(0.6), rtol=1e-6)
    inside = np.arcsin(np.sin(0.6) / N)
    np.testing.assert_allclose(way, np.tile([np.sin(inside), 0.0, -np.cos(inside)], (500, 1)), atol=1e-6)


@pytest.mark.parametrize(("is_floor", "slope"), [(True, 0.4), (False, 0.3)])
def test_where_a_ray_meets_a_surface(is_floor, slope):
    """Against thousands of steps: all but rays within 6 degrees of level, of which a tenth takes a later wave."""
    rays, depth = 2000, 3.0
    surface = random_floor(slope, TILE, depth, 1) if is_floor else random_sea(slope, TILE, 3)
    rng, above = np.random.default_rng(0), 1.0 if is_floor else -1.0
    side = rng.uniform(0.0, TILE, (rays, 2))
    start = np.column_stack([side, surface.height(*side.T) + above * rng.uniform(1e-6, depth, rays)])
    cosine, azimuth = rng.uniform(0.02, 1.0, rays), rng.uniform(0.0, 2.0 * np.pi, rays)
    sine = np.sqrt(1.0 - cosine**2)
    way = np.column_stack([sine * np.cos(azimuth), sine * np.sin(azimuth), -above * cosine])
    upright = replace(surface, amplitudes=above * surface.amplitudes, mean=above * surface.mean)
    rays_down = start * (1.0, 1.0, above), way * (1.0, 1.0, above)
    true = dense_hit(upright.height, *rays_down, upright.lowest, upright.highest, steps=1024)
    first = np.maximum(np.nan_to_num(to_plane(start, way, surface.mean)), 0.0)
    plain = newton_hit(upright.height, upright.slope, *rays_down, first)
    steep = surface.steepest * sine / cosine
    off, wrong = (~(np.abs(one - true) <= 0.01 * depth) for one in (met(surface, start, way), plain))
    once = steep < paths.ONCE
    assert not np.any(off[steep < 2.5])
    assert off[steep < 10.0].mean() < 0.002
    assert off.mean() < 0.015
    assert wrong.mean() > 0.05
    np.testing.assert_allclose(met(surface, start, way)[once], true[once], atol=1e-9)
    assert once.sum() > 100


def test_a_plane_is_met_at_once():
    """From where a ray is, or from behind by a rounding."""
    start, way = np.array([[0.3, 0.7, -1.0], [2.0, 1.0, -4.0 - 1e-12]]), np.array([[0.6, 0.0, -0.8], [0.0, 0.6, -0.8]])
    np.testing.assert_allclose(met(Waves(TILE, mean=-4.0), start, way), [3.75, 0.0], rtol=1e-12)
    np.testing.assert_allclose(met(Waves(TILE), start[:1], -way[:1]), [1.25], rtol=1e-12)
    assert met(Waves(TILE), np.zeros((0, 3)), np.zeros((0, 3))).shape == (0,)


def rays_of_furnace(count, seed, number=2, way=None):
    """By rays of all directions, or `count` of one."""
    world, aside = furnace(1.0), np.zeros(3)
    ways = anywhere(world, count, np.random.default_rng(9))[1] if way is None else np.tile(way, (count, 1))
    return traced(world, coarse(world), np.array([1.0, 2.0, -1.5]), ways, aside, aside, number, seed)


def test_a_seed_is_a_run_and_its_halves_err_apart(monkeypatch):
    """What one half errs by says nothing of the other; batches of rays have numbers of their own."""
    one, other = (rays_of_furnace(1500, seed) for seed in (4, 5))
    assert one.shape == (2, 1500, 3)
    for pair in (one, (one[0], other[0])):
        first, second = (np.asarray(half)[:, 1] - 1.0 for half in pair)
        assert abs(np.corrcoef(first, second)[0, 1]) < 4.0 / np.sqrt(len(first))
        assert np.mean(first != second) > 0.6  # some see the sky at once
    np.testing.assert_array_equal(*(rays_of_furnace(5, 4) for _ in range(2)))
    monkeypatch.setattr(paths, "TOGETHER", 8)
    assert np.unique(rays_of_furnace(40, 0, way=[0.6, 0.0, -0.8])[..., 1].round(9)).size > 50


def test_a_pixel_is_the_mean_over_its_area():
    """One that the edge of Snell's window crosses, in clear water over a black floor; its corner is elsewhere."""
    world = World(NONE, (1e-9,) * 3, MILD, N, Waves(TILE), Waves(TILE, mean=-4.0), NONE, 0.0, NONE, ONE)
    corner, across, up = np.array([0.8, -0.1, 0.8]), np.array([0.1, 0.0, 0.1]), np.array([0.3, 0.5, 0.0])
    u, v = np.meshgrid(*[(np.arange(400) + 0.5) / 400] * 2)

    def seen(way):
        cosine = way[..., 2] / np.linalg.norm(way, axis=-1)
        return (1.0 - fresnel(N, 1.0, cosine)[0]) * N**2 / np.pi

    whole = seen(corner + u[..., None] * across + v[..., None] * up)
    known, spread = whole.mean(), whole.std() / np.sqrt(10_000)
    pixel = world, coarse(world), np.array([0.0, 0.0, -2.0]), corner[None]
    found = traced(*pixel, across, up, 20_000, 1)[:, 0, 0]
    bare = traced(*pixel, 0 * up, 0 * up, 100).mean(axis=0)[0, 0]
    assert np.all(np.abs(found - known) < 4.0 * spread)
    assert abs(bare - seen(corner)) < 1e-6
    assert abs(seen(corner) - known) > 40.0 * spread


def test_what_no_haze_and_no_truth_has():
    for call, *given in ((ways, 0.5, 1.0, 1.0), (sunlit_haze, 0.5, 1.0, 0.0)):
        refused(r"^kind must be one of broadened, scaled, single, got 'double'$", call, *given, LOBES, "double")
    refused(r"^paths must be a whole number >= 2.*, got 1$", rays_of_furnace, 1, 0, number=1)
    for name, given in (("levels", 1), ("pixels", 0), ("rays", 9000)):
        named = {"levels": 2, "pixels": 4, "rays": 8, name: given}
        refused(f"^{name} must be a whole number .*, got {given}$", Sunlight, furnace(1.0), **named)

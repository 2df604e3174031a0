"""The truth's paths: in a furnace, against other photons and closed forms; sunlight in the water; hits; halves."""

import numpy as np
import pytest
from scipy.integrate import quad

from benchmarks.sea_photons import scattered_once, trace_view
from mcml_sim.media.fresnel import fresnel
from profilefit.errors import InputError
from profilefit.scenes.sea import paths
from profilefit.scenes.sea.caustics import Splat, caustic_map
from profilefit.scenes.sea.paths import Sunlight, followed, met, traced
from profilefit.scenes.sea.scene import lobes_of
from profilefit.scenes.sea.water import World
from profilefit.scenes.sea.waves import Waves, dense_hit, newton_hit, random_floor, random_sea, refracted, to_plane

TILE, N, LIKE_AIR = 5.0, 1.34, 1.0 + 1e-7  # a world's water must be denser than the air
MILD = ((1.0, 0.8),)
NONE, ONE = (0.0,) * 3, (1.0,) * 3
OMEGAS, RATES = (0.2, 0.5, 0.8), (0.6, 1.0, 1.6)


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
    b = np.array(OMEGAS) * RATES
    floor = Waves(TILE, mean=-60.0)
    world = World(tuple(RATES - b), tuple(b), lobes, LIKE_AIR, Waves(TILE), floor, NONE, tilt, ONE, NONE)
    depths = level * np.array(RATES)
    aside = float(np.sqrt(1.0 - cosine**2))
    orders = trace_view(world.phase, depths, cosine, tilt, photons, seed)
    each = [orders.at(omega) for omega in OMEGAS]
    place, way = np.tile([0.0, 0.0, -level], (rays, 1)), np.tile([-aside, 0.0, -cosine], (rays, 1))
    found = followed(world, coarse(world), place, way, np.random.default_rng(seed)) / (world.calm[1] * world.slant)
    once = scattered_once(world.phase, depths, (-aside, 0.0, cosine), (np.sin(tilt), 0.0, np.cos(tilt)))
    others = np.array([(one.value[i], one.standard_error[i]) for i, one in enumerate(each)]).T
    return found.mean(axis=0), others[0], OMEGAS * once, found.std(axis=0) / np.sqrt(rays), others[1]


@pytest.mark.parametrize(
    ("tilt", "cosine", "level"), [(0.0, 0.0, 0.5), (0.0, 0.0, 2.0), (0.0, -0.5, 2.0), (0.5, -0.6, 2.0), (0.5, 0.0, 0.5)]
)
def test_other_photons_bring_the_same(tilt, cosine, level):
    """All orders, in each of three waters that one path stands for; the first order alone is far off."""
    value, other, once, error, its = other_photons(MILD, tilt, cosine, level, photons=100_000, rays=40_000)
    off, short = (value - other) / np.hypot(error, its), (once - other) / np.hypot(error, its)
    assert np.all(np.abs(off) < 4.0)
    assert np.all(np.hypot(error, its) < 0.03 * other)
    assert np.all(short < -30.0)


@pytest.mark.slow
@pytest.mark.parametrize(("tilt", "cosine", "level"), [(0.5, 0.0, 0.5), (0.5, -0.6, 2.0), (0.0, 0.0, 2.0)])
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
    drawn, other = (
        caustic_map(context, one, Splat.CELLS, 256, pixels, depth, tilt).light
        for one in (sea, random_sea(0.12, TILE, 4))
    )
    found = flux.reshape(pixels, pixels) / entered
    off, transposed, far = (np.sqrt(np.mean((one - drawn) ** 2)) for one in (found, found.T, other))
    assert off < 0.03
    assert transposed > 0.2
    assert far > 0.2
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
    flip = np.array([1.0, 1.0, above])

    def height(x, y):
        return above * surface.height(x, y)

    levels = sorted((above * surface.lowest, above * surface.highest))
    true = dense_hit(height, start * flip, way * flip, *levels, steps=1024)
    plain = newton_hit(
        height,
        lambda x, y: tuple(above * one for one in surface.slope(x, y)),
        start * flip,
        way * flip,
        np.maximum(np.nan_to_num(to_plane(start, way, surface.mean)), 0.0),
    )
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


def rays_of_furnace(count, seed, number=2, **more):
    world = furnace(1.0)
    _, way = anywhere(world, count, np.random.default_rng(9))
    aside = np.zeros(3)
    return traced(world, coarse(world), np.array([1.0, 2.0, -1.5]), way, aside, aside, number, seed, **more)


def test_a_seed_is_a_run_and_its_halves_err_apart(monkeypatch):
    """What one half errs by says nothing of the other; batches of rays have numbers of their own."""
    one, other = (rays_of_furnace(1500, seed).halves for seed in (4, 5))
    assert one.shape == (2, 1500, 3)
    for pair in (one, (one[0], other[0])):
        first, second = (np.asarray(half)[:, 1] - 1.0 for half in pair)
        assert abs(np.corrcoef(first, second)[0, 1]) < 4.0 / np.sqrt(len(first))
        assert np.mean(first != second) > 0.6  # some see the sky at once
    again = [rays_of_furnace(5, 4) for _ in range(2)]
    np.testing.assert_array_equal(again[0].halves, again[1].halves)
    np.testing.assert_allclose(again[0].radiance, again[0].halves.mean(axis=0))
    monkeypatch.setattr(paths, "TOGETHER", 8)
    world = furnace(1.0)
    same = np.tile([0.6, 0.0, -0.8], (40, 1))
    batches = traced(world, coarse(world), np.array([1.0, 2.0, -1.5]), same, np.zeros(3), np.zeros(3), 2).halves
    assert np.unique(batches[..., 1].round(9)).size > 50


def test_a_pixel_is_the_mean_over_its_area():
    """One that the edge of Snell's window crosses, in clear water over a black floor; its corner is elsewhere."""
    world = World(NONE, (1e-9,) * 3, MILD, N, Waves(TILE), Waves(TILE, mean=-4.0), NONE, 0.0, NONE, ONE)
    corner, across, up = np.array([0.8, -0.1, 0.8]), np.array([0.1, 0.0, 0.1]), np.array([0.3, 0.5, 0.0])
    u, v = np.meshgrid(*[(np.arange(400) + 0.5) / 400] * 2)

    def seen(way):
        cosine = way[..., 2] / np.linalg.norm(way, axis=-1)
        return (1.0 - fresnel(N, 1.0, cosine)[0]) * N**2 / np.pi

    known = seen(corner + u[..., None] * across + v[..., None] * up).mean()
    found = traced(world, coarse(world), np.array([0.0, 0.0, -2.0]), corner[None], across, up, 20_000, 1).halves[
        :, 0, 0
    ]
    bare = traced(world, coarse(world), np.array([0.0, 0.0, -2.0]), corner[None], 0 * up, 0 * up, 100).radiance[0, 0]
    spread = seen(corner + u[..., None] * across + v[..., None] * up).std() / np.sqrt(10_000)
    assert np.all(np.abs(found - known) < 4.0 * spread)
    assert abs(bare - seen(corner)) < 1e-6
    assert abs(seen(corner) - known) > 40.0 * spread


def test_what_no_truth_has():
    with pytest.raises(InputError, match=r"^paths must be a whole number >= 2.*, got 1$"):
        rays_of_furnace(1, 0, number=1)
    for name, given in (("levels", 1), ("pixels", 0), ("rays", 9000)):
        with pytest.raises(InputError, match=f"^{name} must be a whole number .*, got {given}$"):
            Sunlight(furnace(1.0), **{"levels": 2, "pixels": 4, "rays": 8, name: given})

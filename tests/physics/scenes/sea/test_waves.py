"""Sums of cosines and what slopes do to sunlight; a ray's first crossing, where iterations fail, in float32."""

from functools import partial

import moderngl
import numpy as np
import pytest

from mcml_sim.media.medium import fresnel
from profilefit.scenes.sea import waves
from profilefit.scenes.sea.waves import (
    Waves,
    dense_hit,
    first_hit,
    newton_hit,
    random_floor,
    random_sea,
    refracted,
    surface_map,
)
from profilefit.scenes.stage.renderer import float_texture
from profilefit.scenes.stage.world import unit
from profilefit.shader.context import program
from profilefit.shader.emit import text_beside
from tests.unit.scenes.scenes import refusals, refused

TILE = 10.0
STEP = 2.0 * np.pi / TILE
SEA = random_sea(0.15, TILE, seed=3)
DEPTH = 5.0
DOWN = np.array([0.0, 0.0, -1.0])


def test_heights_and_slopes_of_a_sea():
    """Slopes are derivatives, a lattice is both at all pairs, and the tile repeats."""
    x, y = np.random.default_rng(0).uniform(0.0, TILE, (2, 200))
    step = 1e-4
    for slope, (dx, dy) in zip(SEA.slope(x, y), ((step, 0.0), (0.0, step)), strict=True):
        rise = SEA.height(x + dx, y + dy) - SEA.height(x - dx, y - dy)
        np.testing.assert_allclose(slope, rise / (2 * step), atol=1e-8)
    np.testing.assert_allclose(SEA.height(x + TILE, y - 2.0 * TILE), SEA.height(x, y), atol=1e-12)
    assert np.max(np.abs(SEA.height(x + 0.5 * TILE, y) - SEA.height(x, y))) > 0.01
    x, y = np.linspace(-3.0, 4.0, 7), np.linspace(0.5, 9.0, 5)
    at = np.meshgrid(x, y)
    for found, expected in zip(SEA.lattice(x, y), (SEA.height(*at), *SEA.slope(*at)), strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-13)


@pytest.mark.parametrize("time", [0.0, 1.7])
def test_an_inverse_fft_of_the_waves_is_their_sum(time):
    """Height, slopes and curvature of every wave, at 1e-12; on a lattice that is too coarse for some waves, too."""
    sea = SEA.after(time, (5.0, 0.0), 4.0)
    for count, shift in ((64, 0.0), (64, 0.5), (5, 0.25)):
        x = (np.arange(count) + shift) * sea.tile / count
        at = x[None, :], x[:, None]
        found = sea.sampled(count, ("", "x", "y", "xy"), shift)
        angle = sea._angle(*at)
        curved = -(sea.amplitudes * np.prod(sea.vectors, axis=1) * np.cos(angle)).sum(axis=-1)
        for one, expected in zip(found, (sea.height(*at), *sea.slope(*at), curved), strict=True):
            np.testing.assert_allclose(one, expected, atol=1e-12 * np.abs(expected).max() * sea.amplitudes.size)
    table = surface_map(sea, 16)
    middles = (np.arange(16) + 0.5) * sea.tile / 16
    np.testing.assert_allclose(
        table[3, 7, :3], [sea.height(middles[7], middles[3]), *sea.slope(middles[7], middles[3])], rtol=1e-6
    )


def test_the_sea_moves_by_its_waves_own_speeds():
    """Derivative of the heights with time, by the difference of two lattices."""
    step, depth, wind = 1e-4, 4.0, (5.0, 0.0)
    ahead, back = (SEA.after(one, wind, depth).sampled(32, ("",))[0] for one in (1.0 + step, 1.0 - step))
    k = np.linalg.norm(SEA.vectors, axis=1)
    rate = np.sqrt(9.81 * k * np.tanh(k * depth)) * np.where(SEA.vectors[:, 0] < 0.0, -1.0, 1.0)
    now = SEA.after(1.0, wind, depth)
    x = np.arange(32) * SEA.tile / 32
    expected = (SEA.amplitudes * rate * np.sin(now._angle(x[None, :], x[:, None]))).sum(axis=-1)
    np.testing.assert_allclose((ahead - back) / (2.0 * step), expected, atol=1e-5 * np.abs(expected).max())


def test_random_sea_has_its_slope_and_runs_with_the_wind():
    x = np.arange(64) * TILE / 64
    _, zx, zy = SEA.lattice(x, x)
    np.testing.assert_allclose(np.sqrt(np.mean(zx**2 + zy**2)), 0.15, rtol=1e-12)
    np.testing.assert_allclose(SEA.rms_slope, 0.15, rtol=1e-12)
    # The factor (k.w)^2 leaves slopes across the wind a third of the variance; 40 seas of 24 waves scatter by 5 %.
    along, across = np.zeros((2, 40))
    for seed in range(40):
        one = random_sea(0.15, TILE, seed, wind=(0.0, 7.0))
        across[seed], along[seed] = (np.sum((one.amplitudes * one.vectors[:, axis]) ** 2) for axis in (0, 1))
    assert 2.0 < along.sum() / across.sum() < 4.5
    np.testing.assert_array_equal(random_sea(0.15, TILE, 3).amplitudes, SEA.amplitudes)
    assert not np.allclose(random_sea(0.15, TILE, 4).amplitudes, SEA.amplitudes)


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
    zx, zy = np.random.default_rng(5).normal(0.0, 0.3, (2, 500))
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


def test_what_no_waves_are():
    length, along = r"must be a length in 1e-09 ... 1e\+09 m, got", [[STEP, 0.0]]
    refused(f"^tile {length} 0.0", Waves, 0.0)
    wanted = "^vectors must be multiples of 2 pi / tile = 0.628319 /m, got 1"
    refused(wanted, Waves, TILE, [0.1], [[1.0, 0.0]], [0.0])
    refused(r"^phases must have shape \(1,\), got \(2,\)", Waves, TILE, [0.1], along, [0.0, 1.0])
    refused("^amplitudes must be finite numbers, got nan", Waves, TILE, [np.nan], along, [0.0])
    refused(r"^mean must be a level \[m\], got inf", Waves, TILE, mean=np.inf)
    refused("^rms_slope must be a number >= 0, got -0.1", random_sea, -0.1, TILE)
    refused(f"^tile {length} 1e-300", random_sea, 0.1, 1e-300)
    refused(f"^tile {length} 1e-300", random_floor, 0.1, 1e-300, 5.0)
    refused(r"^wind must be two speeds \[m/s\], not both 0", random_sea, 0.1, TILE, wind=(0.0, 0.0))
    refused(f"^depth {length} -1.0", random_floor, 0.1, TILE, -1.0)
    wanted = "ways must be numbers of steps or of newton, newton_1m, shah, got 'bisect'"
    refused(wanted, waves.wrong_shares, ["bisect"], [1.0])


def lit_floor(steep, count=2000, seed=0):
    """A floor, origins above it and rays of a sun at 63 degrees below waves, of which the flattest has this S."""
    place = np.random.default_rng(seed).uniform(0.0, TILE, (count, 2))
    x, y, _ = refracted(np.radians(63.0), random_sea(0.15, TILE, seed).slope(*place.T), 1.34)
    ray = np.column_stack([x, y, -np.ones(count)]) / np.sqrt(1.0 + x**2 + y**2)[:, None]
    floor = random_floor(1.0, TILE, DEPTH, seed + 1)
    floor = floor.scaled(steep / np.max(floor.steepest * np.hypot(x, y)))
    origin = np.column_stack([place, np.full(count, max(0.0, floor.highest))])
    return floor, origin, ray


def in_depths(context, steep):
    """Errors of Newton's distance and of the first hit over the depth, of the same float32 rays in a vertex shader."""
    floor, *rays = lit_floor(steep)
    origin, ray = (one.astype(np.float32).astype(float) for one in rays)
    true = dense_hit(floor.height, origin, ray, floor.lowest, floor.highest)
    return np.abs(by_vertices(context, floor, origin, ray) - true[:, None]) / DEPTH


def test_a_plane_is_met_exactly():
    """z = -5 + 0.3 x: one Newton step is exact, whatever the bracket. Scalars in, scalar out."""
    ray = unit((1.0, 0.0, -2.0))

    def slant(x, y):
        return -5.0 + 0.3 * np.asarray(x)

    found = first_hit(slant, [0.0, 1.0, 0.5], ray, -20.0, 5.0)
    assert isinstance(found, float)
    np.testing.assert_allclose(found, 5.5 / (-ray[2] + 0.3 * ray[0]), rtol=1e-12)
    several = first_hit(slant, np.zeros((2, 3, 3)), ray, -20.0, 5.0, steps=1)
    assert several.shape == (2, 3)
    np.testing.assert_allclose(several, 5.0 / (-ray[2] + 0.3 * ray[0]), rtol=1e-9)


def plane(x, y):
    return np.full(np.shape(x), -5.0)


@pytest.mark.parametrize("steps", [1, 16, 1024])
def test_a_level_floor_at_its_own_bounds(steps):
    for bounds in ((-5.0, -4.0), (-6.0, -5.0)):
        np.testing.assert_allclose(first_hit(plane, np.zeros(3), DOWN, *bounds, steps), 5.0, rtol=1e-12)


def test_rays_that_never_hit_are_nan():
    floor = random_floor(0.3, TILE, DEPTH)
    rays = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], DOWN])
    found = first_hit(floor.height, np.zeros(3), rays, floor.lowest, floor.highest)
    np.testing.assert_array_equal(np.isnan(found), [True, True, False])
    # A map that ends: rays that leave it before they are down.
    ends = lambda x, y: np.where(np.asarray(x) < 2.0, -5.0, np.nan)  # noqa: E731
    found = first_hit(ends, np.zeros(3), unit([(1.0, 0.0, -1.0), (0.3, 0.0, -1.0)]), -6.0, -4.0)
    np.testing.assert_array_equal(np.isnan(found), [True, False])
    # Upward from a valley, through the hill beside it.
    hills = lambda x, y: np.cos(np.asarray(x))  # noqa: E731
    up = unit((1.0, 0.0, 0.1))
    rising = first_hit(hills, [np.pi, 0.0, -0.9], up, -1.0, 1.0, steps=64)
    np.testing.assert_allclose(hills(np.pi + rising * up[0], 0.0), -0.9 + rising * up[2])


def test_the_first_of_three_crossings():
    """A ray that grazes a wave and comes out of it: later crossings are farther on."""
    wave = lambda x, y: 0.5 * np.cos(np.asarray(x))  # noqa: E731
    tilt = lambda x, y: (-0.5 * np.sin(np.asarray(x)), 0.0 * np.asarray(y))  # noqa: E731
    ray, origin = unit((1.0, 0.0, -0.05)), np.array([np.pi, 0.0, 0.55])
    found = first_hit(wave, origin, ray, -0.5, 0.56, slope=tilt)
    k = np.linspace(0.0, 30.0, 3_000_001)
    gap = origin[2] + k * ray[2] - wave(origin[0] + k * ray[0], 0.0)
    changes = k[np.flatnonzero(np.diff(np.sign(gap)))]
    assert len(changes) > 2
    np.testing.assert_allclose(found, changes[0], atol=2e-5)
    np.testing.assert_allclose(dense_hit(wave, origin, ray, -0.5, 0.56), changes[0], atol=2e-5)


@pytest.mark.slow
def test_where_iterations_fail():
    """S = 0.66, 2.5, 5: shares off by more than 1 % of the depth. Iterations alone fail where S > 1, steps do not."""
    ways = ["newton_1m", "newton", "shah", 1, 8, 16]
    shares = waves.wrong_shares(ways, [0.66, 2.5, 5.0], rays=1500)
    published, newton, shah, one, eight, sixteen = shares
    assert np.all(shares[1:, 0] == 0.0)
    assert published[1] > 0.3 and shah[1] > 0.2 and newton[1] > 0.05  # noqa: PT018
    assert newton[2] > one[2] > 0.05
    assert np.all(eight <= 0.01)
    assert np.all(sixteen <= 0.002)  # 0.0005 at most over four floors of 2000 rays


def test_newton_is_exact_while_the_ray_hits_once():
    """From the mean plane, S < 1: 3 iterations within 4e-6 of the depth, 4 within 2e-11. From 1 m they may diverge."""
    for steep, three in ((0.33, 1e-12), (0.66, 1e-8), (0.999, 1e-5)):
        floor, origin, ray = lit_floor(steep)
        rays = origin, ray, floor.lowest, floor.highest
        true, start = dense_hit(floor.height, *rays), waves.to_plane(origin, ray, floor.mean)
        off, fourth = (
            np.abs(newton_hit(floor.height, floor.slope, origin, ray, start, count) - true) / DEPTH for count in (3, 4)
        )
        assert np.median(off) < 1e-14
        assert off.max() < three
        assert fourth.max() < 1e-9
        for slope in (floor.slope, None):
            assert np.abs(first_hit(floor.height, *rays, 16, slope) - true).max() < 1e-13 * DEPTH
    assert np.abs(newton_hit(floor.height, floor.slope, origin, ray, 1.0) - true).max() > DEPTH
    assert np.abs(newton_hit(floor.height, None, origin, ray, start) - true).max() > 0.001 * DEPTH


FEEDBACK = """
in vec3 origin;
in vec3 along;
uniform sampler2D floor_waves;
uniform vec3 bed;
uniform float tile;
out vec2 distance;

vec3 floor_at(vec2 place) {
    vec3 ground = waves_at(floor_waves, tile, place);
    return vec3(bed.x + ground.x, ground.yz);
}

void main() {
    distance = vec2(newton_hit(origin, along, bed.x, 4), first_hit(origin, along, bed.y, bed.z, 16));
    gl_Position = vec4(0.0);
}
"""


def by_vertices(context, floor, origin, ray):
    """Newton's distance and the first hit, (n, 2), as a vertex shader finds them."""
    texts = (text_beside(waves.__name__, f"glsl/{name}.glsl") for name in ("waves", "hits"))
    vertex = "\n".join(["#version 330", *texts, FEEDBACK])
    compiled = program(context, "hits", "#version 330\nvoid main() {}", vertex, varyings=["distance"])
    table = float_texture(context, (floor.texels.shape[1], 1), 4, floor.texels)
    table.use(0)
    compiled["floor_waves"], compiled["tile"] = 0, floor.tile
    compiled["bed"] = floor.mean, floor.lowest, floor.highest
    buffer = context.buffer(np.hstack([origin, ray]).astype("f4").tobytes())
    found = context.buffer(reserve=8 * len(origin))
    array = context.vertex_array(compiled, [(buffer, "3f 3f", "origin", "along")])
    target = context.simple_framebuffer((1, 1))  # nothing is drawn, but OpenGL wants one
    with context.scope(target):
        array.transform(found, moderngl.POINTS, vertices=len(origin))
    distances = np.frombuffer(found.read(), np.float32).reshape(-1, 2).astype(float)
    for one in (array, found, buffer, table, compiled, target):
        one.release()
    return distances


def test_single_precision_in_a_vertex_shader(context):
    """The text that ships against float64, over the same float32 rays, in the depth."""
    assert np.all(in_depths(context, 0.7).max(axis=0) < 1e-6)
    newton, first = np.mean(in_depths(context, 5.0) > 0.01, axis=0)
    assert first < 0.002
    assert newton > 0.1


def test_level_floors_in_a_vertex_shader(context):
    """2,100 views of level and nearly level floors, .1 to 1000 m deep, from .01 m on: each ray hits, to 1e-6 depths."""
    rng = np.random.default_rng(1)
    for depth in (0.1, 1.0, 4.0, 5.0, 10.0, 100.0, 1000.0):
        for slope in (0.0, 1e-8, 1e-4):
            floor = random_floor(slope, 2.0 * depth, depth) if slope else Waves(2.0 * depth, mean=-depth)
            eye = np.geomspace(0.01, max(0.02, 0.5 * depth), 100)
            origin = np.column_stack([rng.uniform(0.0, depth, (100, 2)), floor.highest + eye])
            turn, down = rng.uniform(0.0, 2.0 * np.pi, 100), rng.uniform(0.01, 1.0, 100)
            level = np.sqrt(1.0 - down**2)
            ray = np.column_stack([level * np.cos(turn), level * np.sin(turn), -down])
            origin, ray = (one.astype(np.float32).astype(float) for one in (origin, ray))
            true = dense_hit(floor.height, origin, ray, floor.lowest, floor.highest, 64)
            off = np.abs(by_vertices(context, floor, origin, ray)[:, 1] - true) * -ray[:, 2]
            assert off.max() < 1e-6 * depth, (depth, slope)


test_what_has_no_hit = refusals(
    partial(first_hit, height=plane, origin=np.zeros(3), direction=DOWN, lowest=-6.0, highest=-4.0),
    ({"direction": [0.0, 0.0, -2.0]}, "^direction must be of unit length, got \\|direction\\| = 2$"),
    ({"direction": [0.0, -1.0]}, "^direction must have shape \\(\\.\\.\\., 3\\), got \\(2,\\)$"),
    ({"direction": [0.0, 0.0, np.nan]}, "^direction must be finite, got nan$"),
    ({"origin": [0.0, np.inf, 0.0]}, "^origin must be finite, got inf$"),
    ({"origin": "here"}, "^origin must be finite numbers \\(\\.\\.\\., 3\\), got 'here'$"),
    ({"origin": np.zeros((2, 3)), "direction": [DOWN] * 4}, "^origin and direction must broadcast to one shape"),
    ({"origin": [0.0, 0.0, -5.5]}, "^origin must not be below the floor, got one that is 0.5 m below it$"),
    ({"lowest": -3.0}, "^lowest must not be above highest, got -3 and -4 m$"),
    ({"lowest": np.nan}, "^lowest must be a finite level \\[m\\], got nan$"),
    ({"highest": -5.2}, "^highest must be no lower than the floor is, got -5.2 m$"),
    ({"steps": 0}, "^steps must be a whole number >= 1 and <= 1024, got 0$"),
    ({"steps": 1025}, "^steps must be a whole number >= 1 and <= 1024, got 1025$"),
)


@pytest.mark.parametrize(("k", "depth"), [(3.0, 0.2), (3.0, 50.0), (0.5, 1.0)])
def test_waves_move_downwind_with_the_speed_of_their_length_and_depth(k, depth):
    """Long waves of shallow water at sqrt(g h), short ones of deep water at sqrt(g / k), and back after a period."""
    tile, seconds = 2.0 * np.pi / k, 0.3
    speed = np.sqrt(9.81 / k * np.tanh(k * depth))
    waves = Waves(tile, np.array([0.1]), np.array([[k, 0.0]]), np.array([0.7]))
    x = np.linspace(0.0, tile, 50)
    later = waves.after(seconds, (5.0, 0.0), depth)
    np.testing.assert_allclose(later.height(x, 0.0), waves.height(x - speed * seconds, 0.0), atol=1e-12)
    against = waves.after(seconds, (-5.0, 0.0), depth)
    np.testing.assert_allclose(against.height(x, 0.0), waves.height(x + speed * seconds, 0.0), atol=1e-12)
    period = tile / speed
    np.testing.assert_allclose(waves.after(period, (5.0, 0.0), depth).height(x, 0.0), waves.height(x, 0.0), atol=1e-12)
    assert np.max(np.abs(later.height(x, 0.0) - waves.height(x, 0.0))) > 0.01
    assert speed <= np.sqrt(9.81 * depth) * (1.0 + 1e-12)

"""Lamps add up; a sky's irradiance, by integral and by harmonics; what is in its way, against closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from profilefit.scenes.skin.material import plain
from profilefit.scenes.stage.light.environment import (
    Environment,
    even_directions,
    harmonic_irradiance,
)
from profilefit.scenes.stage.light.occlusion import sky_irradiance
from profilefit.scenes.stage.pattern import Sampling
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.world import Camera, Light, Part, Scene, parameters, sheet, unit
from tests.unit.scenes.scenes import RADIUS, ball, refused, scene

SIZE = 64, 48
STAGE = SIZE, 512
ONE, OTHER = Light((0.5, 0.4, 0.8), (1.0, 0.8, 0.6)), Light((-0.9, 0.2, -0.4), (0.3, 0.5, 0.9))
DARK = Light(irradiance=(0.0, 0.0, 0.0))
ROUNDING = 2e-6  # of float32 sums, over what is largest
NORMALS = even_directions(60)


def under(*lamps, ambient=(0.0, 0.0, 0.0)):
    """A ball with a small one before it, the one in the other's shadow."""
    parts = ball(), ball((12.0, 5.0, 8.0), 3.0)
    return replace(scene((0.0, 0.0, 1.0), *parts), light=lamps[0], more=lamps[1:], ambient=ambient)


def drawn(stage, law, of):
    stage.draw(of)
    return stage.scatter(law, 1.5, Sampling(8)).copy(), stage.render(law, 1.5, Sampling(8)).copy()


def test_two_lamps_are_the_sum_of_each(stage, burley):
    """Of scattered light and of radiance, with its highlights and what shines through."""
    both = drawn(stage, burley, under(ONE, OTHER))
    first, second = drawn(stage, burley, under(ONE)), drawn(stage, burley, under(OTHER))
    for whole, one, other in zip(both, first, second, strict=True):
        assert min(one.max(), other.max()) > 0.1
        np.testing.assert_allclose(whole, one + other, atol=ROUNDING * whole.max())


def test_a_lamp_in_two_halves_is_the_same_picture(stage, burley):
    half = Light(ONE.direction, tuple(0.5 * value for value in ONE.irradiance))
    quarter = Light(ONE.direction, tuple(0.25 * value for value in ONE.irradiance))
    whole = drawn(stage, burley, under(ONE, ambient=(0.1, 0.2, 0.3)))
    for lamps in ((half, half), (half, quarter, quarter), (quarter,) * 4):
        for one, parts in zip(whole, drawn(stage, burley, under(*lamps, ambient=(0.1, 0.2, 0.3))), strict=True):
            np.testing.assert_allclose(parts, one, atol=ROUNDING * one.max())


def test_lamps_have_a_largest_number():
    refused("more must be at most 3 lamps beside the first, got 4", under, *(ONE,) * 5)


def test_an_even_map_lets_pi_times_its_radiance_fall():
    for rows in (1, 32, 300):
        sky = Environment.of_map(np.full((rows, 2 * rows, 3), (0.5, 1.0, 2.0)))
        even = np.broadcast_to(np.pi * np.array([0.5, 1.0, 2.0]), (60, 3))
        np.testing.assert_allclose(sky.power.sum(axis=0), 4.0 * np.array(even[0]), rtol=1e-12)
        np.testing.assert_allclose(sky.irradiance(NORMALS), even, rtol=1e-4)
        np.testing.assert_allclose(harmonic_irradiance(sky.harmonics, NORMALS), even, rtol=1e-4)
        assert sky.error.most < 2e-4


def toward(rows):
    """Directions (rows, 2 rows, 3) of a map's pixels."""
    theta, phi = (np.arange(rows) + 0.5) * np.pi / rows, (np.arange(2 * rows) + 0.5) * np.pi / rows - np.pi
    across, height = np.sin(theta)[:, None], np.broadcast_to(np.cos(theta)[:, None], (rows, 2 * rows))
    return np.stack([across * np.sin(phi), height, -across * np.cos(phi)], axis=-1)


def test_a_cosine_lobe():
    """Along its axis 2 pi / 3; harmonics up to l = 2 leave (1 + 4 / 3 + 5 / 16) pi / 4, and .8 % is their error."""
    axis = unit((0.3, 0.8, -0.5))
    sky = Environment.of_map(np.maximum(toward(128) @ axis, 0.0)[..., None] * np.ones(3))
    np.testing.assert_allclose(sky.irradiance(axis[None]), 2.0 * np.pi / 3.0, rtol=1e-4)
    of_harmonics = harmonic_irradiance(sky.harmonics, axis[None])
    np.testing.assert_allclose(of_harmonics, (1.0 + 4.0 / 3.0 + 5.0 / 16.0) * np.pi / 4.0, rtol=1e-4)
    assert 0.003 < sky.error.rms < sky.error.most < 0.03


@pytest.mark.parametrize("rotation", [0.0, 90.0, -30.0])
def test_a_small_sun(rotation):
    """One pixel of power P: P max(cos, 0), and by harmonics P (1 / 4 + cos / 2 + 5 / 16 (3 cos^2 - 1) / 2)."""
    places = toward(64)
    values = np.zeros((64, 128, 3))
    values[20, 90] = 1.0, 2.0, 3.0
    c, s = np.cos(np.radians(rotation)), np.sin(np.radians(rotation))
    x, y, z = places[20, 90]
    sun = np.array([c * x - s * z, y, s * x + c * z])  # -z goes toward +x
    sky = Environment.of_map(values, rotation, scale=2.0)
    power = sky.power.sum(axis=0)
    np.testing.assert_allclose(power, 2.0 * np.sin(20.5 / 64 * np.pi) * (np.pi / 64) ** 2 * values[20, 90], rtol=1e-3)
    cosine = (NORMALS @ sun)[:, None]
    np.testing.assert_allclose(sky.irradiance(NORMALS), power * np.maximum(cosine, 0.0), atol=0.02 * power.max())
    order = 0.25 + 0.5 * cosine + 5.0 / 32.0 * (3.0 * cosine**2 - 1.0)
    np.testing.assert_allclose(harmonic_irradiance(sky.harmonics, NORMALS), power * order, atol=3e-3 * power.max())


def test_the_middle_of_a_map_is_ahead_and_its_right_is_right():
    for column, axis in ((128, (0.0, 0.0, -1.0)), (192, (1.0, 0.0, 0.0)), (64, (-1.0, 0.0, 0.0)), (0, (0.0, 0.0, 1.0))):
        values = np.zeros((128, 256, 3))
        values[63:65, [column - 1, column]] = 1.0
        sky = Environment.of_map(values)
        np.testing.assert_allclose(sky.irradiance([axis]), sky.power.sum(axis=0)[None], rtol=1e-3)
    values = np.zeros((128, 256, 3))
    values[0] = 1.0
    sky = Environment.of_map(values)
    np.testing.assert_allclose(sky.irradiance([(0.0, 1.0, 0.0)]), sky.power.sum(axis=0)[None], rtol=1e-3)


def test_many_normals_are_interpolated():
    random = np.random.default_rng(3)
    sky = Environment.of_map(random.random((16, 32, 3)) ** 8)
    exact = sky.irradiance(NORMALS)
    np.testing.assert_allclose(sky.interpolated(NORMALS), exact, atol=1e-3 * exact.mean())


def floor(half, height=0.0, columns=2):
    """A square of two sides `half`, facing up."""
    u, v = parameters(columns, columns)
    points = np.stack([half * (2.0 * u - 1.0), np.full_like(u, height), half * (1.0 - 2.0 * v)], axis=-1)
    return Part(sheet(points, u, v), plain((0.8, 0.5, 0.3)))


def wall(half, height, at):
    """An upright rectangle that faces +z, at some z."""
    u, v = parameters(2, 2)
    points = np.stack([half * (2.0 * u - 1.0), height * v, np.full_like(u, at)], axis=-1)
    return Part(sheet(points, u, v), plain((0.8, 0.5, 0.3)))


def below(*parts, height=150.0, eye=(0.0, 300.0, 220.0)):
    """Parts under an even sky of irradiance 1, seen from above."""
    return Scene(parts, DARK, (1.0, 1.0, 1.0), Camera(eye, (0.0, 0.0, 0.0), height))


def on_floor(x, z):
    points = np.stack(np.broadcast_arrays(x, 0.0, z), axis=-1).astype(float).reshape(-1, 3)
    return points, np.broadcast_to((0.0, 1.0, 0.0), points.shape)


HALF, HEIGHT, BACK = 120.0, 50.0, -60.0


def open_beside_a_wall(x, z):
    """Share of a floor's irradiance that a rectangle leaves: its form factor is that of two with a common edge."""
    away, slant = z - BACK, np.hypot(z - BACK, HEIGHT)
    sides = [np.arctan(s / away) - away / slant * np.arctan(s / slant) for s in (HALF - x, HALF + x)]
    return 1.0 - sum(sides) / (2.0 * np.pi)


def test_nothing_is_in_the_way_of_a_plane(context):
    points, normals = on_floor(np.linspace(-90.0, 90.0, 20), np.linspace(-70.0, 80.0, 20))
    only = below(floor(100.0))
    np.testing.assert_allclose(sky_irradiance(context, only, points, normals, 64, 256), 1.0, atol=1e-6)
    with Stage(context, SIZE, 64) as stage:
        stage.draw(only)
        buffers = stage.buffers()
        np.testing.assert_allclose(buffers.irradiance[buffers.mask > 0.5], 1.0, atol=1e-6)


def test_a_floor_beside_a_wall(context):
    """Where the wall is endless the share is (1 + cos of its angle) / 2; twice the patches change less."""
    x, z = np.meshgrid(np.linspace(-60.0, 60.0, 7), np.array([-50.0, -40.0, -20.0, 10.0, 60.0]))
    points, normals = on_floor(x, z)
    exact = open_beside_a_wall(x, z).ravel()
    endless = 0.5 * (1.0 + np.cos(np.arctan2(HEIGHT, 10.0)))
    assert abs(open_beside_a_wall(0.0, BACK + 10.0) - endless) < 0.005
    corner = below(floor(HALF), wall(HALF, HEIGHT, BACK))
    errors = []
    for patches in (64, 256):
        arrives = sky_irradiance(context, corner, points, normals, patches, 1024)
        np.testing.assert_allclose(arrives, arrives[:, :1] * np.ones(3), rtol=1e-5)
        errors.append(np.sqrt(np.mean((arrives[:, 0] - exact) ** 2)))
    assert errors[1] < 0.01
    assert errors[1] < 0.6 * errors[0]


@pytest.mark.parametrize("height", [10.0, 16.0])
def test_a_ball_over_a_floor(context, height):
    """A ball's form factor is r^2 cos / d^2, by the way to its middle."""
    at = np.array([6.0, 9.0, 12.0, 20.0, 40.0])
    points, normals = on_floor(at, 0.0 * at)
    exact = 1.0 - RADIUS**2 * height / np.hypot(at, height) ** 3
    of = below(floor(60.0), ball((0.0, height, 0.0)))
    arrives = sky_irradiance(context, of, points, normals, 512, 1024)[:, 0]
    np.testing.assert_allclose(arrives, exact, atol=0.015)


def shown_share(context, of, size=(160, 120)):
    """Where a stage sees a floor: x, z [mm], and the share of the sky's light that it has there."""
    with Stage(context, size, 64) as stage:
        stage.draw(of)
        buffers = stage.buffers()
    view = of.camera.view()
    place = (buffers.position - view[:3, 3]) @ view[:3, :3]
    flat = (buffers.normal @ view[:3, :3])[..., 1] > 0.99
    on = flat & (np.abs(place[..., 1]) < 0.1) & (buffers.mask > 0.5)
    return place[on][:, 0], place[on][:, 2], buffers.irradiance[on][:, 0]


def test_the_screen_sees_a_wall(context):
    """All of it is on the screen: what is left is the search's steps."""
    x, z, share = shown_share(context, below(floor(HALF), wall(HALF, HEIGHT, BACK), height=280.0))
    exact = open_beside_a_wall(x, z)
    good = z > BACK + 5.0
    assert good.sum() > 3000
    flat = np.sqrt(np.mean((1.0 - exact[good]) ** 2))
    assert np.sqrt(np.mean((share[good] - exact[good]) ** 2)) < 0.08 * flat


def test_the_screen_sees_a_ball(context):
    """Its lower half and what it covers are hidden: an eighth of the error is left."""
    x, z, share = shown_share(context, below(floor(60.0), ball((0.0, 12.0, 0.0)), height=70.0))
    exact = 1.0 - RADIUS**2 * 12.0 / (x**2 + z**2 + 144.0) ** 1.5
    near = np.hypot(x, z) < 40.0
    flat = np.sqrt(np.mean((1.0 - exact[near]) ** 2))
    assert np.sqrt(np.mean((share[near] - exact[near]) ** 2)) < 0.2 * flat


def test_an_even_environment_is_ambient_light(context):
    """On the screen and in the reference: pi times its radiance, occluded alike."""
    pair = floor(60.0), ball((0.0, 12.0, 0.0))
    sky = Environment.of_map(np.full((64, 128, 3), 1.0 / np.pi))
    pictures = []
    for of in (below(*pair), replace(below(*pair), ambient=(0.0, 0.0, 0.0), environment=sky)):
        with Stage(context, (32, 24), 64) as stage:
            stage.draw(of)
            pictures.append((stage.buffers().irradiance, stage.true_buffers().irradiance))
    np.testing.assert_allclose(pictures[1][0], pictures[0][0], atol=1e-3)
    np.testing.assert_allclose(pictures[1][1], pictures[0][1], atol=0.03)  # patches in another order
    assert abs(np.mean(pictures[1][1] - pictures[0][1])) < 1e-3
    assert pictures[0][1].min(where=pictures[0][1] > 0, initial=1.0) < 0.6


def test_a_reference_leaves_the_stage_as_it_was(stage, burley):
    """Its sky is in the buffers that it returns, and nowhere else; without a scene there is none."""
    of = under(ONE, OTHER, ambient=(0.5, 0.5, 0.5))
    stage.draw(of)
    before = stage.buffers()
    true = stage.true_buffers()
    np.testing.assert_array_equal(stage.buffers().irradiance, before.irradiance)
    assert np.abs(true.irradiance - before.irradiance).max() > 0.02
    stage.draw(replace(of, has_occlusion=False))
    inside = before.mask > 0.5
    open_sky = stage.buffers().irradiance[inside]
    np.testing.assert_allclose(stage.true_buffers().irradiance[inside], open_sky, atol=1e-5)
    assert np.all(open_sky >= before.irradiance[inside] - 1e-6)
    stage.upload(before)
    np.testing.assert_array_equal(stage.true_buffers().irradiance, before.irradiance)

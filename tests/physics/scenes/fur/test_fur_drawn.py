"""Fur as OpenGL draws it: against rays in float64, discs in closed form, and radiance that is written out."""

import numpy as np
import pytest

from benchmarks.fur_feet import shared_shadow
from profilefit.scenes.fur.ball import NOTHING, SKIN, Ball, FurView, random_ball
from profilefit.scenes.fur.chart import patch_view
from profilefit.scenes.fur.law import lobe_mean, occlusion, shadow, shell_shadow, visibility
from profilefit.scenes.fur.passes import BACKGROUND, HITS, Coat, FurSurface, Shading
from profilefit.scenes.fur.truth import Patch, by_shells, by_slabs, random_patch
from profilefit.scenes.fur.ways import FITTED, LINEAR, QUADRATIC, SWEPT, SWEPT_TWO
from profilefit.scenes.stage.renderer import Renderer
from profilefit.scenes.stage.world import Camera, Light
from tests.fixtures import slow

SIZE = 64, 64


@pytest.mark.parametrize("lean", [(0.0, 0.0), (0.3, -0.2)])
@pytest.mark.parametrize("degrees", [5.0, 45.0, 70.0])
def test_layers_in_opengl_are_those_of_rays(context, degrees, lean):
    """But for rays that pass an outline, or a border between two strands, by less than a texel of the map."""
    patch, theta = random_patch(16.0, 0.1, 1.0, 3.0, 5, lean), np.radians(degrees)
    view, start = patch_view(patch, theta, SIZE)
    surface = FurSurface.of_patch(patch, 16.0)
    with Renderer(context, SIZE) as renderer:
        for way, layers in ((LINEAR, 12), (QUADRATIC, 12), (FITTED, 12), (SWEPT, 6), (SWEPT_TWO, 6)):
            found = np.maximum(renderer.image(surface.layered(view, way, layers))[..., 3].ravel(), 0.0)
            if way.tested:
                expected = by_slabs(patch, theta, start, layers, way.tested)
            else:
                expected = by_shells(patch, theta, start, layers, way.exponent_of(layers, 10.0))
            same = np.abs(found - expected) < 1e-3
            assert same.mean() > (0.98 if way.tested else 0.999), (way.name, same.mean())
            assert abs(found.mean() - expected.mean()) < 0.01
            if not way.tested:  # the control: other layers are others
                other = np.maximum(renderer.image(surface.layered(view, way, layers + 3))[..., 3].ravel(), 0.0)
                assert np.mean(np.abs(other - expected) < 1e-3) < 0.95


@pytest.mark.parametrize("exponent", [LINEAR, QUADRATIC])
def test_discs_drawn_cover_what_the_union_says(context, exponent):
    """One strand: the share of the rays that meet its discs, over the cone's own shadow."""
    patch = Patch(np.array([[1.0, 1.0]]), 2.0, 0.1, 1.0)
    size = 1024, 1024
    surface = FurSurface.of_patch(patch)
    for degrees, layers in ((20.0, 8), (45.0, 8), (45.0, 24), (58.0, 16)):
        theta = np.radians(degrees)
        view, _ = patch_view(patch, theta, SIZE)
        with Renderer(context, size) as renderer:
            share = np.mean(renderer.image(surface.layered(view, exponent, layers))[..., 3] >= 0.0)
        drawn = share * patch.side**2 / shadow(0.1, 1.0, theta)
        assert drawn == pytest.approx(shell_shadow(layers, exponent.exponent, 0.1, 1.0, theta), rel=0.01)


def small_ball(force=(0.0, -0.3, 0.1)):
    ball = random_ball(300, 10.0, 0.5, 3.0, force, 3)
    view = FurView.of(Camera((0.0, 0.0, 100.0), (0.0, 0.0, 0.0), 32.0), (40, 30))
    return ball, view


@pytest.mark.slow
def test_the_truth_of_a_ball_against_steps_along_each_ray():
    """Which strand is the first to be inside of, at five hundred places a ray, each against all strands."""
    ball, view = small_ball()
    size = 20, 15
    found = ball.cast(view, size)
    start, way = view.rays(size)
    axis = ball.length * ball.axes
    tall = np.sum(axis * ball.feet, axis=1)
    first = np.full(size[::-1], NOTHING)
    for far in np.linspace(85.0, 115.0, 500)[::-1]:
        place = start + far * way
        away = place[..., None, :] - ball.ball * ball.feet
        t = np.sum(away * ball.feet, axis=-1) / tall
        off = np.linalg.norm(away - t[..., None] * axis, axis=-1)
        inside = (off < ball.radius * (1.0 - t)) & (t >= 0) & (t <= 1)
        first = np.where(inside.any(axis=-1), np.max(np.where(inside, t, 0.0), axis=-1), first)
        first = np.where(np.linalg.norm(place, axis=-1) < ball.ball, SKIN, first)
    same = np.abs(first - found[..., 3]) < 0.1
    assert same.mean() > 0.93  # a ray that grazes a strand is inside of it for less than a step
    assert {True} == {bool(np.any(found[..., 3] == one)) for one in (SKIN, NOTHING)}
    assert np.sum(found[..., 3] >= 0) > 30


def test_layers_on_a_ball_tend_to_its_truth(context):
    ball, view = small_ball()
    size = 160, 120
    true = ball.cast(view, size)
    surface = FurSurface.of_ball(ball)
    with Renderer(context, size) as renderer:
        wrong = [
            np.mean(np.abs(renderer.image(surface.layered(view, way, layers))[..., 3] - true[..., 3]) > 0.02)
            for way, layers in ((SWEPT_TWO, 64), (SWEPT, 64), (SWEPT, 8), (LINEAR, 8))
        ]
    assert wrong[0] < 0.01
    assert wrong[1] < 0.02
    assert wrong[1] < wrong[2] < wrong[3]


def test_a_strand_alone_on_a_ball():
    """Seen from above its tip, and where the force has put the tip."""
    ball = Ball(np.array([[0.0, 0.0, 1.0]]), 10.0, 0.5, 4.0, (0.25, 0.0, 0.0))
    view = FurView(
        np.array([0.0, 0.0, 50.0]), np.array([0.0, 0.0, -1.0]), np.array([2.0, 0, 0]), np.array([0, 2.0, 0]), True
    )
    found = ball.cast(view, (400, 400))[..., 3]
    row, column = np.unravel_index(np.argmax(found), found.shape)
    assert found[row, column] > 0.97
    assert (column + 0.5) / 100.0 - 2.0 == pytest.approx(1.0, abs=0.03)
    assert np.mean(found >= 0) * 16.0 == pytest.approx(shadow(0.5, 4.0, 0.0, (0.25, 0.0)), rel=0.01)


def test_even_light_from_above():
    """No fur hides nothing; toward the tips all is open; and rays drawn by the cosine say the same."""
    assert occlusion(1e-12, 0.5, 10.0, 0.0) == pytest.approx(1.0, abs=1e-9)
    assert occlusion(0.64, 0.5, 10.0, 10.0) == pytest.approx(1.0, abs=1e-9)
    random = np.random.default_rng(4)
    theta, angle = np.arcsin(np.sqrt(random.random(200_000))), 2.0 * np.pi * random.random(200_000)
    tangent = np.tan(theta)
    aside = np.hypot(tangent * np.cos(angle) - 0.4, tangent * np.sin(angle))
    seen = visibility(0.64, 0.5, 10.0, np.arctan(aside), 6.0)
    error = seen.std() / seen.size**0.5
    assert abs(seen.mean() - occlusion(0.64, 0.5, 10.0, 6.0, 0.4)) < 4.0 * error
    assert abs(seen.mean() - occlusion(0.64, 0.5, 10.0, 6.0)) > 8.0 * error


SHADED = 20, 15
DENSITY, RADIUS, LENGTH, FORCE = 0.5, 0.5, 4.0, (0.1, -0.3, 0.2)
COLOUR, BARE, AMBIENT = (0.55, 0.38, 0.22), (0.35, 0.22, 0.16), (0.2, 0.25, 0.3)
LIGHT = Light((-0.7, 0.3, 0.6), (3.0, 2.8, 2.5))


def drawn(context, shading, hits, view):
    ball = random_ball(50, 10.0, RADIUS, LENGTH, FORCE, 3)
    coat = Coat(ball, DENSITY, COLOUR, BARE, LIGHT, AMBIENT, shading)
    with Renderer(context, SHADED) as renderer:
        renderer.write(HITS, hits)
        return renderer.image(coat.shade(view))[..., :3].astype(float)


def written_out(shading, hit, to_eye):
    """Of one hit: diffuse in the fur's shadow, even light as far as it is open, rim, and two lobes."""
    if hit[3] == NOTHING:
        return np.array(BACKGROUND)
    n, z, force = hit[:3], max(hit[3], 0.0), np.array(FORCE)
    to_light = np.array(LIGHT.direction) / np.linalg.norm(LIGHT.direction)
    lean = (force - n * (force @ n)) / (1.0 + force @ n)
    tall = LENGTH * (1.0 + force @ n)
    onto = n @ to_light
    lit = 0.0
    if onto > 0:
        lamp, eye = ((one - n * (n @ one)) / max(n @ one, 1e-4) - lean for one in (to_light, to_eye))
        turn = np.arccos(np.clip(lamp @ eye / np.linalg.norm(lamp) / np.linalg.norm(eye), -1.0, 1.0))
        angles = (float(np.arctan(np.linalg.norm(one))) for one in (eye, lamp))
        own = shadow(RADIUS, tall, np.arctan(np.linalg.norm(lamp)))
        lit = np.exp(-DENSITY * (1.0 - z) ** 2 * (own - shared_shadow(RADIUS, tall, *angles, float(turn))))
    open_ = occlusion(DENSITY, RADIUS, LENGTH, z * LENGTH, float(np.linalg.norm(lean)))
    colour = np.array(BARE if hit[3] == SKIN else COLOUR)
    bias, scale, power = shading.rim
    edge = min(max(bias + scale * (1.0 - max(n @ to_eye, 0.0)) ** power, 0.0), 1.0)
    seen = colour / np.pi * (np.array(LIGHT.irradiance) * max(onto, 0.0) * lit + np.array(AMBIENT) * open_)
    seen += edge * open_ * np.array(AMBIENT) / np.pi
    if hit[3] >= 0:
        axis, half = n + force, to_eye + to_light
        angle = np.arccos(axis @ half / np.linalg.norm(axis) / np.linalg.norm(half))
        for p, shift, strength, tint in zip(
            shading.exponents, shading.shifts, shading.strengths, (np.ones(3), np.array(COLOUR)), strict=True
        ):
            peak = strength / lobe_mean(p) / (4.0 * np.pi) if shading.normalised else strength
            seen += lit * np.array(LIGHT.irradiance) * tint * peak * abs(np.sin(angle - np.arctan(shift))) ** p
    return seen


@pytest.mark.parametrize("normalised", [True, *slow(False)])
def test_the_shader_says_what_is_written_out(context, normalised):
    shading = Shading(rim=(0.1, 0.6, 3.0), normalised=normalised)
    view = FurView.of(Camera((0.0, 0.0, 100.0), (0.0, 0.0, 0.0), 32.0), SHADED)
    rng = np.random.default_rng(6)
    up = rng.normal(size=(*SHADED[::-1], 3))
    up[..., 2] = np.abs(up[..., 2])
    to_light = np.array(LIGHT.direction) / np.linalg.norm(LIGHT.direction)
    up[0] = to_light * rng.uniform(0.5, 1.0, (SHADED[0], 1)) + 0.2 * up[0]  # the lamp at one's back
    height = rng.random(SHADED[::-1])
    height[1], height[2] = SKIN, NOTHING
    hits = np.concatenate([up / np.linalg.norm(up, axis=-1, keepdims=True), height[..., None]], axis=-1)
    found = drawn(context, shading, hits, view)
    _, way = view.rays(SHADED)
    expected = np.array(
        [[written_out(shading, *pair) for pair in zip(*row, strict=True)] for row in zip(hits, -way, strict=True)]
    )
    # The table of occlusion is linear between its 64 heights and 12 leans.
    np.testing.assert_allclose(found, expected, atol=2e-3 * expected.max(), rtol=2e-3)
    assert expected.std() > 0.2 * expected.mean()
    other = drawn(context, Shading(rim=shading.rim, normalised=not normalised), hits, view)
    assert np.abs(other - expected).max() > 0.02 * expected.max()


def test_a_lobe_is_as_bright_at_every_exponent():
    """Its mean over directions, drawn evenly over the sphere; as published it falls as the root of the exponent."""
    cosine = np.random.default_rng(3).uniform(-1.0, 1.0, 400_000)
    for p in (0.0, 4.0, 60.0, 400.0):
        lobe = (1.0 - cosine**2) ** (0.5 * p)
        assert abs(lobe.mean() - lobe_mean(p)) < 4.0 * lobe.std() / cosine.size**0.5 + 1e-12
    assert lobe_mean(400.0) == pytest.approx(lobe_mean(100.0) / 2.0, rel=0.01)


@pytest.mark.slow
def test_rays_are_averaged_before_they_are_encoded(context):
    """The picture is the mean of linear radiance: one of encoded rays is darker where a pixel has contrast."""
    from profilefit.scenes.fur import scene
    from profilefit.scenes.stage.picture import srgb_codes, to_srgb

    small = {"scene": "fur", "camera": {"resolution": [24, 18]}, "technique": {"supersampling": 4}}
    with scene.reference_render(context, scene.read("fur.toml", small)) as found:
        judge, white = found.judge, found.judge.exposure
        once = srgb_codes(white * judge.reference)
        each = scene.averaged(srgb_codes(white * found.fine), 4)
        assert np.all(each <= once + 1e-6)
        assert np.mean((once - each)[judge.mask]) > 2.0
        np.testing.assert_array_equal(to_srgb(judge.reference, white), np.round(once))

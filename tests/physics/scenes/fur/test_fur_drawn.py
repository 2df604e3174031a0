"""Fur as OpenGL draws it: against the same ways by rays in float64, against discs in closed form, and on a ball."""

import numpy as np
import pytest

from profilefit.scenes.fur.ball import NOTHING, SKIN, Ball, FurView, random_ball
from profilefit.scenes.fur.chart import patch_view
from profilefit.scenes.fur.law import occlusion, shadow, shell_shadow, visibility
from profilefit.scenes.fur.passes import FurSurface
from profilefit.scenes.fur.truth import Patch, by_shells, by_slabs, random_patch
from profilefit.scenes.fur.ways import FITTED, LINEAR, QUADRATIC, SWEPT, SWEPT_TWO
from profilefit.scenes.stage.renderer import Renderer
from profilefit.scenes.stage.world import Camera

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

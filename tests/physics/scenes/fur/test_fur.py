"""Fur: random cones in closed form, rays against them, shells and slabs, and what OpenGL draws of all."""

from itertools import pairwise, product

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.spatial import cKDTree

from benchmarks.fur_exponent import best_of, fitted, misfit
from benchmarks.fur_feet import FEET, shared_shadow
from benchmarks.fur_patches import spaced_patch, tufted_patch
from profilefit.scenes import fur
from profilefit.scenes.fur import law, scene
from profilefit.scenes.fur.ball import NOTHING, SKIN, Ball, FurView, random_ball
from profilefit.scenes.fur.chart import patch_view
from profilefit.scenes.fur.law import best_exponent, lobe_mean, occlusion, shadow, shell_shadow, visibility
from profilefit.scenes.fur.passes import BACKGROUND, HITS, Coat, FurSurface, ShadingTable
from profilefit.scenes.fur.truth import Patch, by_shells, by_slabs, cast, random_patch, rays, struck
from profilefit.scenes.fur.ways import FITTED, LINEAR, QUADRATIC, SWEPT, SWEPT_TWO, WALKED, FurTrial
from profilefit.scenes.stage.judge import srgb_codes, to_srgb
from profilefit.scenes.stage.light.environment import Environment
from profilefit.scenes.stage.reference.surface import averaged
from profilefit.scenes.stage.renderer import Renderer
from profilefit.scenes.stage.world import Camera, Light, unit
from tests.fixtures import slow
from tests.unit.scenes.scenes import refused

PATCHES, RAYS = 10, 800
SIZE = 64, 64


def seen(density, theta, lean, heights):
    """Shares of rays that meet nothing above each height, of patches drawn anew, and their standard errors."""
    found = []
    side = max(6.0, 1.2 * np.tan(theta))  # no ray comes by a strand twice
    for seed in range(PATCHES):
        patch = random_patch(density, 0.05, 1.0, side, seed, lean)
        first = cast(patch, theta, rays(patch, RAYS, seed))
        found.append([np.mean(first <= z) for z in heights])
    return np.mean(found, axis=0), np.std(found, axis=0, ddof=1) / np.sqrt(PATCHES) + 1e-4


@pytest.mark.parametrize("lean", [(0.0, 0.0), (0.4, -0.3)])
@pytest.mark.parametrize("degrees", [0.0, 20.0, 45.0, 70.0, *slow(85.0)])
def test_what_is_seen_of_a_random_fur(degrees, lean):
    """Within 4 standard errors of rays at four heights, and within 0.01; the shadow of upright strands is not it."""
    heights, theta = np.array([0.0, 0.3, 0.6, 0.9]), np.radians(degrees)
    for density in (8.0, 40.0):
        found, error = seen(density, theta, lean, heights)
        expected = visibility(density, 0.05, 1.0, theta, heights, lean)
        assert np.all(np.abs(found - expected) < 4.0 * error), (found, expected, error)
        assert np.all(np.abs(found - expected) < 0.02)
    if lean != (0.0, 0.0) and degrees < 60.0:
        assert np.any(np.abs(found - visibility(40.0, 0.05, 1.0, theta, heights)) > 8.0 * error)


def test_the_shadow_is_a_hull():
    """Of a disc and a point: against the area between both tangents, and the tip inside the disc."""
    for aside in (0.0, 0.03, 0.05, 0.0500001, 0.2, 5.0):
        turns = np.linspace(0.0, 2.0 * np.pi, 200_001)
        # The support of the hull in each direction is the larger one; its area is half the integral of h^2 - h'^2.
        support = np.maximum(0.05, aside * np.cos(turns))
        slope = np.where(support > 0.05, -aside * np.sin(turns), 0.0)
        area = 0.5 * np.trapezoid(support**2 - slope**2, turns)
        assert shadow(0.05, 1.0, np.arctan(aside)) == pytest.approx(area, rel=1e-3)
    # No digits are lost where the tip comes out of the disc, next to d = r0 and at 89.9 degrees: more give the same.
    root = np.longdouble(0.05)
    for aside in (0.05 * (1.0 + 1e-12), 0.05 * (1.0 + 1e-6), np.tan(np.radians(89.9))):
        u = np.sqrt((np.longdouble(aside) - root) * (np.longdouble(aside) + root)) / root
        expected = float(root**2 * (np.pi + u - np.arctan(u)))
        assert shadow(0.05, 1.0, float(np.arctan(aside))) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0, 4.0])
@pytest.mark.parametrize("degrees", [0.0, 1.0, 30.0, 60.0, 85.0])
def test_discs_on_shells_against_a_quadrature(exponent, degrees):
    """Twice the integral of the largest half-width at each place along the line of their middles."""
    theta = np.radians(degrees)
    for layers in (1, 2, 7, 24):
        t = np.arange(layers) / layers
        x, r = np.tan(theta) * t, 0.05 * (1.0 - t**exponent)

        def width(at, x=x, r=r):
            return 2.0 * np.sqrt(np.max(np.maximum(r**2 - (at - x) ** 2, 0.0)))

        ends = np.unique(np.concatenate([x - r, x + r]))
        area = sum(quad(width, a, b, limit=200)[0] for a, b in pairwise(ends))
        expected = area / shadow(0.05, 1.0, theta)
        assert shell_shadow(layers, exponent, 0.05, 1.0, theta) == pytest.approx(expected, rel=2e-5)


def test_many_shells_are_the_cone_or_another_one():
    """Linear ones tend to the cone; quadratic ones to a strand that is 1.3 times as opaque aslant."""
    for degrees in (30.0, 45.0, 60.0):
        theta = np.radians(degrees)
        assert shell_shadow(4096, 1.0, 0.05, 1.0, theta) == pytest.approx(1.0, abs=2e-3)
        assert 1.28 < shell_shadow(4096, 2.0, 0.05, 1.0, theta) < 1.33
    assert shell_shadow(5, 2.0, 0.05, 1.0, 0.0) == pytest.approx(1.0, rel=1e-12)


def test_the_exponent_is_that_of_a_fit():
    found, error = fitted()
    assert (*found, *error) == pytest.approx((*law.FITTED, *law.FITTED_ERRORS), abs=1e-3)
    # It is better than both that were published, where there are few layers; and the best is no better by much.
    for layers in (16, 24, 32):
        own = misfit(layers, float(best_exponent(layers / 20.0)), 20.0)
        assert own < 0.9 * misfit(layers, 1.0, 20.0)
        assert own <= misfit(layers, 2.0, 20.0)
        assert own < 1.05 * misfit(layers, best_of(layers, 20.0), 20.0)


def test_what_no_fur_has():
    refused("density must be a finite number >= 0, got -1", fur.visibility, -1, 0.05, 1, 0.5, 0)
    refused("radius must be a finite number > 0, got 0", fur.visibility, 1, 0.0, 1, 0.5, 0)
    refused("length must be a", fur.visibility, 1, 0.05, -1, 0.5, 0)
    refused(r"theta must be an angle in \[0, pi / 2\) radians, got 45", fur.visibility, 1, 0.05, 1, 45.0, 0)
    refused("z must be at most the length, 1, got 2", fur.visibility, 1, 0.05, 1, 0.5, 2)
    refused("layers must be a whole number >= 1 and <= 4096, got 0", fur.shell_shadow, 0, 1, 0.05, 1, 0.5)
    refused("layers must be a whole number >= 1 and <= 4096, got 1", fur.shell_shadow, 10**9, 1, 0.05, 1, 0.5)
    refused("exponent must be a finite number > 0, got 0", fur.shell_shadow, 4, 0, 0.05, 1, 0.5)
    refused(r"x = N r0 / L must be in \[0.64, 6.4\], got 0.5", fur.best_exponent, 0.5)


def rms(found, true):
    return float(np.sqrt(np.mean((found - true) ** 2)))


UPRIGHT, ASLANT = (0.0, 0.0), (0.3, -0.5)


@pytest.mark.parametrize(
    ("degrees", "lean"),
    [
        *((3.0, UPRIGHT), (80.0, ASLANT)),
        *slow(*product((0.0, 50.0), (UPRIGHT, ASLANT)), (80.0, UPRIGHT), (3.0, ASLANT)),
    ],
)
def test_against_steps_along_each_ray(degrees, lean):
    """Four hundred heights, at each of them all images of all strands: the first inside is within a step of the hit."""
    patch, theta, steps = random_patch(6.0, 0.08, 1.5, 2.0, 3, lean), np.radians(degrees), 400
    start = rays(patch, 25, 3)
    found = cast(patch, theta, start)
    stepped = np.zeros(len(start))
    images = np.arange(-6, 7)
    shifts = patch.side * np.stack(np.meshgrid(images, images), axis=-1).reshape(-1, 2)
    feet = (patch.feet[:, None] + shifts).reshape(-1, 2)
    for z in (np.arange(steps) + 0.5)[::-1] * patch.length / steps:
        place = start + np.array([-np.tan(theta), 0.0]) * (patch.length - z)
        away = place[:, None] - feet - np.array(patch.lean) * z
        inside = np.any(np.sum(away**2, axis=-1) < (patch.radius * (1.0 - z / patch.length)) ** 2, axis=1)
        stepped = np.where(inside & (stepped == 0.0), z, stepped)
    same = np.abs(found - stepped) < 2.0 * patch.length / steps
    assert np.mean(same) > 0.85  # a ray that grazes a cone is inside of it for less than a step
    assert np.all(found >= stepped - patch.length / steps)
    assert found.max() > 0.1


def test_shells_and_slabs_tend_to_the_cones():
    """At 45 degrees: shells slowly, slabs at once; quadratic shells to another strand."""
    patch, theta = random_patch(64.0, 0.05, 1.0, 4.0, 1), np.radians(45.0)
    start = rays(patch, 2500, 1)
    true = cast(patch, theta, start)
    linear, finer, quadratic = (rms(by_shells(patch, theta, start, *of), true) for of in ((16, 1), (240, 1), (240, 2)))
    slabs = {n: rms(by_slabs(patch, theta, start, n), true) for n in (8, 16)}
    two = {n: rms(by_slabs(patch, theta, start, n, 2), true) for n in (8, 12)}
    assert finer < 0.06 < 0.2 < linear
    assert quadratic > 0.15
    assert slabs[16] < 0.02
    assert two[12] < 0.005
    assert two[8] < 0.6 * slabs[8]


def test_one_strand_head_on_and_aside():
    patch = Patch(np.array([[0.5, 0.5]]), 1.0, 0.1, 2.0)
    start = np.array([[0.5, 0.5], [0.55, 0.5], [0.7, 0.5]])
    np.testing.assert_allclose(cast(patch, 0.0, start), [2.0, 1.0, 0.0], atol=1e-12)
    # Past the strand, and into its image in the next tile: |0.95 - 2 s| = 0.05 s.
    np.testing.assert_allclose(cast(patch, np.arctan(2.0), np.array([[0.45, 0.5]])), [2.0 - 0.95 / 2.05], rtol=1e-9)


def nearest(patch):
    return cKDTree(patch.feet, boxsize=patch.side).query(patch.feet, 2)[0][:, 1].min()


def through(make, theta, patches, z):
    """Share of rays that meet nothing above a height, 1500 on each patch."""
    return np.mean([cast(one, theta, rays(one, 1500, i)) <= z for i, one in enumerate(map(make, range(patches)))])


def test_strands_are_apart():
    """By no less than is said, around the edge, too; and there are as many as of independent feet."""
    for packing in (0.2, 0.6):
        patch = spaced_patch(64.0, 0.05, 1.0, 4.0, packing, 1)
        assert len(patch.feet) == 1024
        apart = (packing / 64.0) ** 0.5
        assert apart <= nearest(patch) < 1.05 * apart
    assert nearest(random_patch(64.0, 0.05, 1.0, 4.0, 1)) < 0.01
    assert len(spaced_patch(64.0, 0.05, 1.0, 4.0, 0.0).feet) == 1024
    # A single strand, and others than it when the seed is another one.
    assert len(spaced_patch(1.0, 0.05, 1.0, 1.0, 0.6).feet) == 1
    assert not np.allclose(patch.feet, spaced_patch(64.0, 0.05, 1.0, 4.0, 0.6, 2).feet)


def test_strands_are_in_tufts():
    patch = tufted_patch(64.0, 0.05, 1.0, 4.0, 8, 0.2, 1)
    assert len(patch.feet) == 1024
    away = patch.feet.reshape(-1, 8, 1, 2) - patch.feet.reshape(-1, 1, 8, 2)
    away -= patch.side * np.round(away / patch.side)
    apart = np.hypot(away[..., 0], away[..., 1])
    assert apart.max() <= 0.4
    # Two places of a disc are 128 / (45 pi) of its radius apart on average.
    assert apart[apart > 0].mean() == pytest.approx(0.2 * 128.0 / (45.0 * np.pi), rel=0.03)


def test_strands_apart_hide_more_and_tufts_less():
    """By ln of the skin that is seen over that of independent feet."""
    theta, patch = np.radians(45.0), (16.0, 0.05, 1.0, 5.0)
    each = (
        lambda seed: spaced_patch(*patch, 0.5, seed),
        lambda seed: random_patch(*patch, seed),
        lambda seed: tufted_patch(*patch, 8, 0.35, seed),
    )
    apart, alone, tufts = (-np.log(through(make, theta, 6, 0.0)) / (16.0 * shadow(0.05, 1.0, theta)) for make in each)
    assert apart > 1.1
    assert abs(alone - 1.0) < 0.08
    assert tufts < 0.85


def test_a_shadow_that_two_share():
    """All of it where both look the same way, the shorter where one looks over the other, else the root at least."""
    for eye in (0.0, 0.02, 0.4, 1.2):
        assert shared_shadow(0.05, 1.0, eye, eye) == pytest.approx(shadow(0.05, 1.0, eye))
        assert shared_shadow(0.05, 1.0, eye, 1.3) == pytest.approx(shadow(0.05, 1.0, eye))
        assert shared_shadow(0.05, 1.0, eye, 1.3, np.pi) == pytest.approx(np.pi * 0.05**2)
    # Against places that are tried, turned by 20 degrees.
    turn, rng = np.radians(20.0), np.random.default_rng(1)
    place = rng.uniform([-0.05, -0.05], [1.0, 0.5], (400_000, 2))

    def within(long, turned):
        along = place @ np.array([np.cos(turned), np.sin(turned)])
        aside = place @ np.array([-np.sin(turned), np.cos(turned)])
        # The hull of the disc and the tip: the discs of the cone at each height, between its tangents.
        sine = 0.05 / long
        beyond = along > 0.05 * sine
        spike = beyond & (along <= long) & (np.abs(aside) <= (long - along) * sine / np.sqrt(1.0 - sine**2))
        return spike | (along**2 + aside**2 <= 0.05**2)

    both = np.mean(within(0.5, 0.0) & within(0.8, turn)) * 1.05 * 0.55
    assert shared_shadow(0.05, 1.0, np.arctan(0.5), np.arctan(0.8), turn) == pytest.approx(both, rel=0.03)


def test_factors_of_feet_are_those_of_rays():
    """On patches that they were not fitted to, within 8 %: the law's own 3 %, and noise of 6 patches."""
    theta = np.radians(45.0)
    for feet, make in (
        ("apart", lambda seed: spaced_patch(64.0, 0.05, 1.0, 3.0, 0.5, seed + 100)),
        ("tufts", lambda seed: tufted_patch(64.0, 0.05, 1.0, 3.0, 8, 0.5 * (8 / 64.0) ** 0.5, seed + 100)),
    ):
        z = 0.6
        seen = through(make, theta, 8, z)
        factor = FEET[feet].factor(0.05 * 8.0 * (1.0 - z))
        assert -np.log(seen) == pytest.approx(-np.log(visibility(64.0 * factor, 0.05, 1.0, theta, z)), rel=0.08)
        assert abs(factor - 1.0) > 0.1


@pytest.mark.parametrize("degrees", [0.0, 40.0, 75.0])
def test_the_strand_that_is_met_is_where_it_is_met(degrees):
    """A hit is on the strand's cone, at its height; rays that meet none come to the skin."""
    theta, lean = np.radians(degrees), (0.3, -0.2)
    patch = random_patch(20.0, 0.05, 1.0, 5.0, 2, lean)
    start = rays(patch, 2000, 2)
    z, which = struck(patch, theta, start)
    np.testing.assert_array_equal(z, cast(patch, theta, start))
    np.testing.assert_array_equal(which < 0, z == 0.0)
    hit = which >= 0
    assert 0.05 < np.mean(hit) < 0.999
    place = (start - np.array([np.tan(theta), 0.0]) * (1.0 - z)[:, None])[hit]
    away = place - patch.feet[which[hit]] - np.array(lean) * z[hit, None]
    away -= patch.side * np.round(away / patch.side)
    np.testing.assert_allclose(np.hypot(*away.T), 0.05 * (1.0 - z[hit]), atol=1e-9)


def test_what_no_patch_has():
    many = "density must be a number > 0 of 1048576 strands at most"
    refused("density must be a number > 0", random_patch, 0.0, 0.1, 1.0, 1.0)
    refused("density must be a number > 0", random_patch, np.nan, 0.1, 1.0, 1.0)
    refused(many, random_patch, 1e9, 0.1, 1.0, 1.0)
    refused("layers must be a whole", by_slabs, random_patch(9.0, 0.1, 1.0, 1.0), 0.5, np.zeros((1, 2)), 0)
    refused(r"packing must be a number in \[0, 0.6\], got 0.65", spaced_patch, 9.0, 0.1, 1.0, 1.0, 0.65)
    refused("each must be a whole number >= 1, got 0", tufted_patch, 9.0, 0.1, 1.0, 1.0, 0, 0.1)
    refused("spread must be a finite length >= 0, got -0.1", tufted_patch, 9.0, 0.1, 1.0, 1.0, 3, -0.1)
    refused(many, tufted_patch, 1e9, 0.1, 1.0, 1.0, 3, 0.1)


@pytest.mark.parametrize("lean", [(0.0, 0.0), (0.3, -0.2)])
@pytest.mark.parametrize("degrees", [5.0, 45.0, 70.0])
def test_layers_in_opengl_are_those_of_rays(context, degrees, lean):
    """But for rays that pass an outline, or a border between two strands, by less than a texel of the map."""
    patch, theta = random_patch(16.0, 0.1, 1.0, 3.0, 5, lean), np.radians(degrees)
    view, start = patch_view(patch, theta, SIZE)
    surface = FurSurface.of_patch(patch, 16.0)
    with Renderer(context, SIZE) as renderer:
        aside = np.hypot(np.tan(theta) - lean[0], lean[1])
        for way, layers in ((LINEAR, 12), (QUADRATIC, 12), (FITTED, 12), (SWEPT, 6), (SWEPT_TWO, 6), (WALKED, 6)):
            found = np.maximum(renderer.image(surface.layered(view, way, layers))[..., 3].ravel(), 0.0)
            if way.tested:
                steps = max(int(np.ceil(layers * aside)), 1) if way.walked else layers
                expected = by_slabs(patch, theta, start, steps, way.tested)
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


VIEW = FurView.of(Camera((0.0, 0.0, 100.0), (0.0, 0.0, 0.0), 32.0), (40, 30))
SMALL = random_ball(300, 10.0, 0.5, 3.0, (0.0, -0.3, 0.1), 3)


@pytest.mark.slow
def test_the_truth_of_a_ball_against_steps_along_each_ray():
    """Which strand is the first to be inside of, at five hundred places a ray, each against all strands."""
    ball, size = SMALL, (20, 15)
    found = ball.cast(VIEW, size)
    start, way = VIEW.rays(size)
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


CLUMPED = random_ball(3000, 10.0, 0.15, 3.0, (0.0, -0.3, 0.1), 3, 40, 0.6)


def wrong(context, ball, surface, *ways):
    """Shares of rays whose first hit is another by more than 0.02 of the length."""
    size = 160, 120
    true = ball.cast(VIEW, size)
    with Renderer(context, size) as renderer:
        found = [renderer.image(surface.layered(VIEW, way, layers)) for way, layers in ways]
    return [float(np.mean(np.abs(one[..., 3] - true[..., 3]) > 0.02)) for one in found]


def test_layers_on_a_ball_tend_to_its_truth(context):
    ways = (SWEPT_TWO, 64), (SWEPT, 64), (SWEPT, 8), (LINEAR, 8), (WALKED, 4), (SWEPT_TWO, 4)
    found = wrong(context, SMALL, FurSurface.of_ball(SMALL), *ways)
    assert found[0] < 0.01
    assert found[1] < 0.02
    assert found[1] < found[2] < found[3]
    assert found[4] < 0.002 < found[5]


def test_steps_through_clumps_tend_to_their_truth(context):
    """And maps of the same strands without clumps do not."""
    surface = FurSurface.of_ball(CLUMPED)
    fine, coarse = wrong(context, CLUMPED, surface, (WALKED, 64), (WALKED, 8))
    assert fine < 0.003
    assert coarse > 0.01
    upright = surface._replace(uniforms={**surface.uniforms, "gathered": 0.0})
    assert wrong(context, CLUMPED, upright, (WALKED, 64))[0] > 0.2


def test_a_tip_is_moved_toward_the_centre_of_its_clump():
    """By a share of the way between both, as directions from the ball's middle less the force."""
    tips = CLUMPED.ball * CLUMPED.feet + CLUMPED.length * (CLUMPED.axes - np.array(CLUMPED.force))
    way = tips / (CLUMPED.ball + CLUMPED.length)
    centre = CLUMPED.feet + (way - CLUMPED.feet) / 0.6
    away, which = cKDTree(CLUMPED.centres).query(centre)
    assert np.max(away) < 1e-6
    nearest, _ = cKDTree(CLUMPED.centres).query(CLUMPED.feet)
    own = np.linalg.norm(CLUMPED.centres[which] - CLUMPED.feet, axis=1)
    assert np.max(own - nearest) < 3.0 / 512  # a texel of the map
    assert len(np.unique(which)) > 30


@pytest.mark.parametrize("parallel", [False, True])
def test_the_truth_of_a_ball_against_all_strands(parallel):
    """Each ray against each strand, the strips left out; strands toward every side of the picture."""
    size = 24, 18
    view = (
        VIEW if not parallel else VIEW._replace(parallel=True, right=16.0 * unit(VIEW.right), up=12.0 * unit(VIEW.up))
    )
    start, way = (np.broadcast_to(one, (18, 24, 3)).reshape(-1, 3) for one in view.rays(size))
    ray, strand = (one.ravel() for one in np.meshgrid(np.arange(len(way)), np.arange(3000), indexing="ij"))
    far, height = (one.reshape(len(way), 3000) for one in CLUMPED._met(strand, start[ray], way[ray]))
    first = np.argmin(far, axis=1)
    found = CLUMPED.cast(view, size).reshape(-1, 4)
    hit = found[:, 3] >= 0
    assert 0.1 < hit.mean() < 0.9
    rows = np.arange(len(way))
    np.testing.assert_array_equal(found[hit, :3], CLUMPED.feet[first[hit]])
    np.testing.assert_array_equal(found[hit, 3], height[rows, first][hit])
    skin = found[:, 3] == SKIN
    to_skin = np.sum((10.0 * found[skin, :3] - start[skin]) * way[skin], axis=1)
    assert np.all(to_skin < far[rows, first][skin])
    assert np.all(np.isinf(far[found[:, 3] == NOTHING]))


def test_the_first_strand_on_a_patch_against_all():
    """Thin ones, so that steps are longer than a root; each strand's images in reach against each ray."""
    patch, theta = random_patch(20.0, 0.02, 1.0, 2.0, 7, (0.2, -0.1)), np.radians(50.0)
    start = rays(patch, 300, 7)
    way = np.array([np.tan(theta), 0.0])
    images = np.array(list(product((-2, -1, 0, 1, 2), (-1, 0, 1)))) * patch.side
    feet = (patch.feet[:, None] + images).reshape(-1, 2)
    # |start - way s - foot - lean (1 - s)| = 0.02 s, s down from the tips: the first root in 0 ... 1.
    away, rate = start[:, None] - feet - patch.lean, patch.lean - way
    a, b, c = rate @ rate - 0.02**2, away @ rate, np.sum(away**2, axis=-1)
    under = b * b - a * c
    s = (-b - np.sqrt(np.maximum(under, 0.0))) / a
    s = np.where((under >= 0) & (s >= 0) & (s <= 1), s, 1.0).min(axis=1)
    np.testing.assert_allclose(cast(patch, theta, start), 1.0 - s, atol=1e-9)
    assert 0.2 < np.mean(s < 1.0) < 0.95


def test_steps_need_as_many_at_every_angle():
    """What holds at 45 degrees holds at 75, where layers fail: mean squares over four patches."""
    patches = [random_patch(20.0, 0.05, 1.0, 6.0, seed) for seed in range(4)]
    for way, most in ((WALKED, 1.6), (SWEPT_TWO, 10.0)):
        flat, steep = (
            np.mean([FurTrial(one, np.radians(theta), rays(one, 1500, 3)).error(way, 8) ** 2 for one in patches])
            for theta in (45.0, 75.0)
        )
        assert (steep < most**2 * flat) == way.walked, (way.name, steep, flat)


def test_a_strand_alone_on_a_ball():
    """Seen from above its tip, and where the force has put the tip."""
    ball = Ball(np.array([[0.0, 0.0, 1.0]]), 10.0, 0.5, 4.0, (0.25, 0.0, 0.0))
    view = FurView(*np.array([[0.0, 0.0, 50.0], [0.0, 0.0, -1.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]]), parallel=True)
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
TO_LIGHT = unit(LIGHT.direction)


def drawn(context, shading, hits):
    ball = random_ball(50, 10.0, RADIUS, LENGTH, FORCE, 3)
    coat = Coat(ball, DENSITY, COLOUR, BARE, LIGHT, AMBIENT, shading)
    with Renderer(context, SHADED) as renderer:
        renderer.write(HITS, hits)
        return renderer.image(coat.shade(VIEW))[..., :3].astype(float)


def test_lamps_and_a_sky_add_up(context):
    """Two lamps, an even map, and ambient light: each alone, less the background that each has."""
    rng = np.random.default_rng(8)
    hits = np.concatenate([unit(rng.normal(size=(15, 20, 3))), rng.uniform(0.0, 1.0, (15, 20, 1))], axis=-1)
    hits[3, :5, 3], hits[4, :5, 3] = SKIN, NOTHING
    ball = random_ball(50, 10.0, RADIUS, LENGTH, FORCE, 3)
    none, dark = (0.0, 0.0, 0.0), Light(irradiance=(0.0, 0.0, 0.0))
    other, radiance = Light((0.8, 0.5, 0.2), (0.3, 0.9, 1.5)), np.array(AMBIENT) / np.pi
    sky = Environment.of_map(np.full((64, 128, 3), radiance))
    cases = (
        (LIGHT, AMBIENT, (other,), sky),
        (LIGHT, none, (), None),
        (other, none, (), None),
        (dark, AMBIENT, (), None),
    )
    pictures = []
    with Renderer(context, SHADED) as renderer:
        renderer.write(HITS, hits)
        for light, ambient, more, map_ in cases:
            coat = Coat(ball, DENSITY, COLOUR, BARE, light, ambient, ShadingTable(), more, map_)
            pictures.append(renderer.image(*coat.shades(VIEW))[..., :3].astype(float))
    whole, first, second, even = pictures
    shown = hits[..., 3] != NOTHING
    np.testing.assert_allclose(whole[shown], (first + second + 2.0 * even)[shown], rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(whole[~shown], np.broadcast_to(BACKGROUND, whole[~shown].shape), rtol=1e-6)


def written_out(shading, hit, to_eye):
    """Of one hit: diffuse in the fur's shadow, even light as far as it is open, rim, and two lobes."""
    if hit[3] == NOTHING:
        return np.array(BACKGROUND)
    n, z, force = hit[:3], max(hit[3], 0.0), np.array(FORCE)
    lean = (force - n * (force @ n)) / (1.0 + force @ n)
    tall = LENGTH * (1.0 + force @ n)
    onto = n @ TO_LIGHT
    lit = 0.0
    if onto > 0:
        lamp, eye = ((one - n * (n @ one)) / max(n @ one, 1e-4) - lean for one in (TO_LIGHT, to_eye))
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
        axis, half = n + force, to_eye + TO_LIGHT
        angle = np.arccos(axis @ half / np.linalg.norm(axis) / np.linalg.norm(half))
        for p, shift, strength, tint in zip(
            shading.exponents, shading.shifts, shading.strengths, (np.ones(3), np.array(COLOUR)), strict=True
        ):
            peak = strength / lobe_mean(p) / (4.0 * np.pi) if shading.normalised else strength
            seen += lit * np.array(LIGHT.irradiance) * tint * peak * abs(np.sin(angle - np.arctan(shift))) ** p
    return seen


@pytest.mark.parametrize("normalised", [True, *slow(False)])
def test_the_shader_says_what_is_written_out(context, normalised):
    shading = ShadingTable(rim=(0.1, 0.6, 3.0), normalised=normalised)
    rng = np.random.default_rng(6)
    up = rng.normal(size=(*SHADED[::-1], 3))
    up[..., 2] = np.abs(up[..., 2])
    up[0] = TO_LIGHT * rng.uniform(0.5, 1.0, (SHADED[0], 1)) + 0.2 * up[0]  # the lamp at one's back
    height = rng.random(SHADED[::-1])
    height[1], height[2] = SKIN, NOTHING
    hits = np.concatenate([up / np.linalg.norm(up, axis=-1, keepdims=True), height[..., None]], axis=-1)
    found = drawn(context, shading, hits)
    _, way = VIEW.rays(SHADED)
    each = zip(hits.reshape(-1, 4), -way.reshape(-1, 3), strict=True)
    expected = np.array([written_out(shading, *pair) for pair in each]).reshape(found.shape)
    # The table of occlusion is linear between its 64 heights and 12 leans.
    np.testing.assert_allclose(found, expected, atol=2e-3 * expected.max(), rtol=2e-3)
    assert expected.std() > 0.2 * expected.mean()
    other = drawn(context, ShadingTable(rim=shading.rim, normalised=not normalised), hits)
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
    small = {"scene": "fur", "camera": {"resolution": [24, 18]}, "technique": {"supersampling": 4}}
    with scene.reference_render(context, scene.read("fur.toml", small)) as found:
        judge, white = found.judge, found.judge.exposure
        once = srgb_codes(white * judge.reference)
        each = averaged(srgb_codes(white * found.fine), 4)
        assert np.all(each <= once + 1e-6)
        assert np.mean((once - each)[judge.mask]) > 2.0
        np.testing.assert_array_equal(to_srgb(judge.reference, white), np.round(once))

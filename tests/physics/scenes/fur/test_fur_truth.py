"""Rays against cones: against all images of all strands, shells and slabs, and feet that are not independent."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from benchmarks.fur_feet import FEET, shared_shadow
from benchmarks.fur_patches import spaced_patch, tufted_patch
from profilefit.errors import InputError
from profilefit.scenes.fur.law import shadow, visibility
from profilefit.scenes.fur.truth import Patch, by_shells, by_slabs, cast, random_patch, rays, struck
from tests.fixtures import slow


def rms(found, true):
    return float(np.sqrt(np.mean((found - true) ** 2)))


@pytest.mark.parametrize(
    ("degrees", "lean"),
    [
        (3.0, (0.0, 0.0)),
        (80.0, (0.3, -0.5)),
        *slow(*((degrees, (0.0, 0.0)) for degrees in (0.0, 50.0, 80.0))),
        *slow(*((degrees, (0.3, -0.5)) for degrees in (0.0, 3.0, 50.0))),
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
    linear, quadratic = ([rms(by_shells(patch, theta, start, n, p), true) for n in (16, 240)] for p in (1.0, 2.0))
    slabs = {n: rms(by_slabs(patch, theta, start, n), true) for n in (8, 16)}
    two = {n: rms(by_slabs(patch, theta, start, n, 2), true) for n in (8, 12)}
    assert linear[0] > 0.2
    assert linear[1] < 0.06
    assert quadratic[1] > 0.15
    assert slabs[16] < 0.02
    assert two[12] < 0.005
    assert two[8] < 0.6 * slabs[8]


def test_one_strand_head_on_and_aside():
    patch = Patch(np.array([[0.5, 0.5]]), 1.0, 0.1, 2.0)
    start = np.array([[0.5, 0.5], [0.55, 0.5], [0.7, 0.5]])
    np.testing.assert_allclose(cast(patch, 0.0, start), [2.0, 1.0, 0.0], atol=1e-12)
    # Past the strand, and into its image in the next tile: |0.95 - 2 s| = 0.05 s.
    np.testing.assert_allclose(cast(patch, np.arctan(2.0), np.array([[0.45, 0.5]])), [2.0 - 0.95 / 2.05], rtol=1e-9)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: random_patch(0.0, 0.1, 1.0, 1.0), "density must be a number > 0"),
        (lambda: random_patch(np.nan, 0.1, 1.0, 1.0), "density must be a number > 0"),
        (lambda: random_patch(1e9, 0.1, 1.0, 1.0), "density must be a number > 0 of 1048576 strands at most"),
        (lambda: by_slabs(random_patch(9.0, 0.1, 1.0, 1.0), 0.5, np.zeros((1, 2)), 0), "layers must be a whole"),
    ],
)
def test_what_no_patch_has(call, said):
    with pytest.raises(InputError, match=said):
        call()


def nearest(patch):
    return cKDTree(patch.feet, boxsize=patch.side).query(patch.feet, 2)[0][:, 1].min()


def kappa(make, theta, patches=6, count=1500):
    """ln of the skin that is seen over that of independent feet."""
    found = [
        np.mean(cast(patch, theta, rays(patch, count, seed)) == 0)
        for seed, patch in enumerate(map(make, range(patches)))
    ]
    return -np.log(np.mean(found)) / (16.0 * shadow(0.05, 1.0, theta))


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
    theta = np.radians(45.0)
    apart = kappa(lambda seed: spaced_patch(16.0, 0.05, 1.0, 5.0, 0.5, seed), theta)
    alone = kappa(lambda seed: random_patch(16.0, 0.05, 1.0, 5.0, seed), theta)
    tufts = kappa(lambda seed: tufted_patch(16.0, 0.05, 1.0, 5.0, 8, 0.35, seed), theta)
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
        seen = np.mean([cast(p, theta, rays(p, 1500, i)) <= z for i, p in enumerate(map(make, range(8)))])
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


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: spaced_patch(9.0, 0.1, 1.0, 1.0, 0.65), r"packing must be a number in \[0, 0.6\], got 0.65"),
        (lambda: spaced_patch(0.0, 0.1, 1.0, 1.0, 0.5), "density must be a number > 0"),
        (lambda: tufted_patch(9.0, 0.1, 1.0, 1.0, 0, 0.1), "each must be a whole number >= 1, got 0"),
        (lambda: tufted_patch(9.0, 0.1, 1.0, 1.0, 3, -0.1), "spread must be a finite length >= 0, got -0.1"),
        (lambda: tufted_patch(1e9, 0.1, 1.0, 1.0, 3, 0.1), "density must be a number > 0 of 1048576 strands at most"),
    ],
)
def test_what_no_feet_are(call, said):
    with pytest.raises(InputError, match=said):
        call()

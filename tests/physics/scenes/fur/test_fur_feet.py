"""Feet that are not independent, and which strand a ray meets."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from benchmarks.fur_feet import FEET, shared_shadow
from benchmarks.fur_patches import spaced_patch, tufted_patch
from profilefit.errors import InputError
from profilefit.scenes.fur.law import shadow, visibility
from profilefit.scenes.fur.truth import cast, random_patch, rays, struck


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

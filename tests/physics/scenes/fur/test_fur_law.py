"""Random cones in closed form against rays, their discs on shells against a quadrature, and the fitted exponent."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad

from benchmarks.fur_exponent import best_of, fitted, misfit
from profilefit.errors import InputError
from profilefit.scenes import fur
from profilefit.scenes.fur import law
from profilefit.scenes.fur.law import best_exponent, shadow, shell_shadow, visibility
from profilefit.scenes.fur.truth import cast, random_patch, rays

DEGREES = (0.0, 20.0, 45.0, 70.0)
PATCHES, RAYS = 10, 800


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
@pytest.mark.parametrize("degrees", [*DEGREES, pytest.param(85.0, marks=pytest.mark.slow)])
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
    assert found.size == pytest.approx(law.FITTED.size, abs=1e-3)
    assert found.power == pytest.approx(law.FITTED.power, abs=1e-3)
    assert error.size == pytest.approx(law.FITTED_ERRORS.size, abs=1e-3)
    assert error.power == pytest.approx(law.FITTED_ERRORS.power, abs=1e-3)
    # It is better than both that were published, where there are few layers; and the best is no better by much.
    for layers in (16, 24, 32):
        own = misfit(layers, float(best_exponent(layers / 20.0)), 20.0)
        assert own < 0.9 * misfit(layers, 1.0, 20.0)
        assert own <= misfit(layers, 2.0, 20.0)
        assert own < 1.05 * misfit(layers, best_of(layers, 20.0), 20.0)


def test_no_digits_are_lost_where_the_tip_comes_out_of_the_disc():
    """Against the same in more digits, next to d = r0 and at 89.9 degrees."""
    for aside in (0.05 * (1.0 + 1e-12), 0.05 * (1.0 + 1e-6), np.tan(np.radians(89.9))):
        d = np.longdouble(aside)
        u = np.sqrt((d - np.longdouble(0.05)) * (d + np.longdouble(0.05))) / np.longdouble(0.05)
        expected = float(np.longdouble(0.05) ** 2 * (np.pi + u - np.arctan(u)))
        assert shadow(0.05, 1.0, float(np.arctan(aside))) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: fur.visibility(-1, 0.05, 1, 0.5, 0), "density must be a finite number >= 0, got -1"),
        (lambda: fur.visibility(1, 0.0, 1, 0.5, 0), "radius must be a finite number > 0, got 0"),
        (lambda: fur.visibility(1, 0.05, -1, 0.5, 0), "length must be a"),
        (lambda: fur.visibility(1, 0.05, 1, 45.0, 0), r"theta must be an angle in \[0, pi / 2\) radians, got 45"),
        (lambda: fur.visibility(1, 0.05, 1, 0.5, 2), "z must be at most the length, 1, got 2"),
        (lambda: fur.shell_shadow(0, 1, 0.05, 1, 0.5), "layers must be a whole number >= 1 and <= 4096, got 0"),
        (lambda: fur.shell_shadow(10**9, 1, 0.05, 1, 0.5), "layers must be a whole number >= 1 and <= 4096, got 1"),
        (lambda: fur.shell_shadow(4, 0, 0.05, 1, 0.5), "exponent must be a finite number > 0, got 0"),
        (lambda: fur.best_exponent(0.5), r"x = N r0 / L must be in \[0.64, 6.4\], got 0.5"),
    ],
)
def test_what_no_fur_has(call, said):
    with pytest.raises(InputError, match=said):
        call()

"""The step edge on a plane and around a cylinder, against integrals over the surface itself."""

import numpy as np
import pytest

from profilefit.scenes.stage.step_edge import step_response
from profilefit.studies.choose.error import averaged, beyond, response
from tests.physics.choose.conftest import DIFFUSE

ALPHA = 0.85
X = np.array([0.05, 0.4, 1.3, 3.0])


@pytest.fixture(scope="module")
def share(hazard):
    return beyond(ALPHA, DIFFUSE, hazard)


def over_the_cylinder(law, place, radius):
    """Lit over visible, each a sum of the profile over strips in arc and height, closer together at the place."""
    at = np.arcsin(place / radius)
    steps = np.concatenate([[0.0], np.geomspace(1e-4, np.pi, 240)])
    edges = np.sort(np.clip(np.concatenate([at - steps, at + steps, [0.0]]), -np.pi / 2, np.pi / 2))
    height = np.concatenate([[0.0], np.geomspace(1e-4, 60.0, 240)])
    arc, up = 0.5 * (edges[1:] + edges[:-1]), 0.5 * (height[1:] + height[:-1])
    chord = 2.0 * radius * np.sin(0.5 * np.abs(arc - at))
    distance = np.hypot(chord[:, None], up)
    strips = law.profile(np.maximum(distance, 1e-9), ALPHA) @ np.diff(height) * np.diff(edges)
    return strips[arc > 0].sum() / strips.sum()


def test_plane_is_the_integral(hazard, share):
    np.testing.assert_allclose(response(share, X, 1.0, np.inf), step_response(X, ALPHA, law=hazard), atol=2e-5)
    np.testing.assert_allclose(response(share, 3.0 * X, 3.0, np.inf), step_response(X, ALPHA, law=hazard), atol=2e-5)


@pytest.mark.parametrize("radius", [2.0, 8.0])
def test_cylinder_is_the_sum_over_its_surface(hazard, share, radius):
    """Straight through; 1e-3 is what the strips next to the source leave open."""
    places = X[0.9 * radius > X]
    found = response(share, places, 1.0, radius)
    expected = [over_the_cylinder(hazard, place, radius) for place in places]
    np.testing.assert_allclose(found, expected, atol=1e-3)
    assert radius > 4 or np.max(np.abs(response(share, places, 1.0, np.inf) - expected)) > 2.5e-3


def test_a_wide_cylinder_is_a_plane(share):
    np.testing.assert_allclose(response(share, X, 1.0, 1e4), response(share, X, 1.0, np.inf), atol=1e-4)


def test_a_window_takes_away_what_it_does_not_show(share):
    """Both ends far: nothing; near: the rest weighs more, and adds up to the same light."""
    np.testing.assert_allclose(response(share, X, 1.0, np.inf, 1e3), response(share, X, 1.0, np.inf), atol=1e-12)
    cut = response(share, X, 1.0, np.inf, 4.0)
    lit = 1.0 - share(X) - share(4.0 - X)
    np.testing.assert_allclose(cut, lit / (lit + share(X) - share(4.0 + X)), rtol=1e-12)
    assert np.max(np.abs(cut - response(share, X, 1.0, np.inf))) > 1e-3


@pytest.mark.parametrize("radius", [np.inf, 6.0])
def test_average_is_the_mean_over_the_pixel(share, radius):
    pixel = 0.8
    middles = pixel * (np.arange(3) + 0.5)
    fine = middles[:, None] + pixel * ((np.arange(20000) + 0.5) / 20000 - 0.5)
    expected = response(share, fine, 1.0, radius).mean(axis=1)
    found = averaged(share, middles, pixel, 1.0, radius)
    np.testing.assert_allclose(found, expected, atol=1e-5)
    assert abs(response(share, middles[:1], 1.0, radius) - expected[0])[0] > 1e-3


def test_quartile(share):
    assert share(np.array(share.quartile)) == pytest.approx(0.25, abs=1e-9)

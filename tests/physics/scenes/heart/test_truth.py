"""The sum over a whole surface against what is known: a sphere, an endless plane, and one point alone."""

import numpy as np
import pytest

from profilefit.errors import InputError
from profilefit.scenes.heart import screen_share, split, surface_blur
from profilefit.scenes.heart.law import Kernel, balance
from profilefit.scenes.heart.truth import Elements, sphere_blur, summed

VARIANCES, WEIGHTS = np.array([0.3, 2.0, 9.0]), np.array([0.2, 0.5, 0.3])
RADIUS, COUNT = 3.0, 20_000


def sphere(count: int = COUNT) -> tuple[np.ndarray, np.ndarray]:
    """Points on spirals of even area, and their areas."""
    z = 1.0 - 2.0 * (np.arange(count) + 0.5) / count
    turn = np.pi * (1.0 + np.sqrt(5.0)) * np.arange(count)
    across = np.sqrt(1.0 - z * z)
    points = RADIUS * np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)
    return points, np.full(count, 4.0 * np.pi * RADIUS**2 / count)


def test_a_sphere_is_its_oracle():
    points, areas = sphere()
    at = points[:: COUNT // 40]
    light = 1.0 + points[:, 2] / RADIUS
    found = surface_blur(points, areas, light, VARIANCES, WEIGHTS, at=at)
    known = sphere_blur(RADIUS, at[:, 2] / RADIUS, VARIANCES, WEIGHTS)
    np.testing.assert_allclose(found, known, atol=1e-5)
    # Negative control: distances along the surface, or light that is renormalised, are something else.
    wider = sphere_blur(RADIUS, at[:, 2] / RADIUS, 1.02 * VARIANCES, WEIGHTS)
    assert np.max(np.abs(found - wider)) > 1e-3


def test_many_gaussians_are_summed_apart():
    """As all at once, though each takes the points together as wide as it can; those narrower than points stay."""
    points, areas = sphere()
    at = points[:: COUNT // 40]
    light = 1.0 + (points[:, :2] > 0)
    own = 1.0 + (at[:, :2] > 0)
    spacing = float(np.sqrt(areas[0]))
    variances, weights = np.append(1e-6, VARIANCES), np.array([[0.1, 0.2], [0.3, 0.1], [0.2, 0.3], [0.4, 0.4]])
    found = summed(Elements(points, areas, light, spacing), variances, weights, at, own)
    expected = weights[0] * own + surface_blur(points, areas, light, VARIANCES, weights[1:], at=at)
    np.testing.assert_allclose(found, expected, atol=4e-3)
    assert rms(found - expected) < 2e-3
    assert rms(own - expected) > 0.1


def rms(off: np.ndarray) -> float:
    return float(np.sqrt(np.mean(off**2)))


def test_the_oracle_of_little_and_of_great_curvature():
    """Of a plane nothing is lost, and of a grain next to nothing is left."""
    assert sphere_blur(1e4, 0.5, VARIANCES, WEIGHTS) == pytest.approx(1.5, rel=1e-6)
    area = 4.0 * np.pi * 1e-6
    expected = area * np.sum(WEIGHTS / (2.0 * np.pi * VARIANCES))
    assert sphere_blur(1e-3, 0.5, VARIANCES, WEIGHTS) == pytest.approx(expected, rel=1e-4)


def test_one_point_and_channels():
    """A point gives the kernel itself; three channels of light take weights of their own."""
    r = np.array([0.0, 0.7, 4.0])
    at = np.stack([r, 0 * r, 0 * r], axis=1)
    weights = np.stack([WEIGHTS, 2.0 * WEIGHTS, WEIGHTS[::-1]], axis=1)
    found = surface_blur(np.zeros((1, 3)), [0.5], [[1.0, 3.0, 2.0]], VARIANCES, weights, at=at)
    kernel = np.exp(-(r[:, None] ** 2) / (2 * VARIANCES)) / (2 * np.pi * VARIANCES)
    np.testing.assert_allclose(found, 0.5 * kernel @ weights * np.array([1.0, 3.0, 2.0]), rtol=1e-12)


def test_light_is_counted_once():
    points, areas = sphere(6000)
    kernel = Kernel(VARIANCES, WEIGHTS)
    light = 1.0 + points[:, 0] / RADIUS
    whole = surface_blur(points, areas, light, VARIANCES, WEIGHTS, at=points[:50])
    for crossover in (0.0, 1.0, 1.5, 9.0):
        parts = split(kernel, crossover)
        assert sum(one.variances.size for one in parts) == 3
        near, far = (
            surface_blur(points, areas, light, one.variances, one.weights, at=points[:50])
            if one.variances.size
            else 0.0
            for one in parts
        )
        np.testing.assert_allclose(near + far, whole, rtol=1e-12)


def test_the_share_of_the_screen():
    """Half of a sphere is seen: all that its pole gathers, half of what its rim does, next to nothing behind."""
    points, areas = sphere(6000)
    at = RADIUS * np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    share = screen_share(points, areas, points[:, 2] > 0, Kernel(VARIANCES[:1], np.ones(1)), at)
    np.testing.assert_allclose(share, [1.0, 0.5, 0.0], atol=0.01)
    chosen = balance(0.0, 1.0, 2.0, share, 0.97)
    np.testing.assert_array_equal(chosen, [1.0, 2.0, 2.0])


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"points": np.zeros((2, 2))}, r"points must have shape \(n, 3\), got \(2, 2\)"),
        ({"areas": [1.0, -1.0]}, "areas must be 2 numbers >= 0"),
        ({"irradiance": [np.nan, 1.0]}, "irradiance must be finite, got nan"),
        ({"irradiance": [1.0]}, r"irradiance must be of shape \(2,\)"),
        ({"variances": [0.0]}, "variances must be a list of numbers > 0"),
        ({"weights": [1.0, 2.0]}, "weights must be one for each of 1 variances"),
        ({"areas": "much"}, "areas must be numbers, got 'much'"),
    ],
)
def test_bad_input(changed, told):
    good = {
        "points": np.eye(3)[:2],
        "areas": [1.0, 1.0],
        "irradiance": [1.0, 1.0],
        "variances": [1.0],
        "weights": [1.0],
    }
    with pytest.raises(InputError, match=told):
        surface_blur(**(good | changed))
    with pytest.raises(InputError, match="crossover must be a length >= 0, got nan"):
        split(Kernel(VARIANCES, WEIGHTS), np.nan)

"""Lattices of any size: every cell is one, and the points are as far apart as they can be."""

import numpy as np
import pytest

from profilefit.scenes.stage import pattern


@pytest.mark.parametrize("samples", [1, 2, 3, 4, 16, 17, 60, 64, 255, 256])
def test_cell_tiles_the_torus(samples):
    """Area 1 / n, and both edges lead from a point to a point: shifts within it reach everything once."""
    found = pattern.best(samples)
    np.testing.assert_allclose(abs(np.linalg.det(found.cell)), 1 / samples, rtol=1e-6)
    steps = np.round(found.cell[:, 1] * samples)
    off = found.cell[:, 0] - steps * found.generator / samples
    np.testing.assert_allclose(off, np.round(off), atol=1e-9)


@pytest.mark.parametrize("samples", [17, 64, 256])
def test_points_are_far_apart(samples):
    """At least 0.8 of the least distance in the densest packing, (2 / sqrt(3) / n)^(1/2); random points are not."""
    spread = pattern.points(samples)
    assert least_distance(spread) > 0.8 * np.sqrt(2 / np.sqrt(3) / samples)
    assert least_distance(np.random.default_rng(1).random((samples, 2))) < 0.4 * np.sqrt(2 / np.sqrt(3) / samples)


def least_distance(points):
    difference = points[:, None] - points
    difference -= np.round(difference)
    return np.linalg.norm(difference + 9.0 * np.eye(len(points))[..., None], axis=-1).min()

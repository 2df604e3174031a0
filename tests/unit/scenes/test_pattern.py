"""Lattices, whose every cell is one and whose points lie far apart, and blue noise, whose every level is even."""

import numpy as np
import pytest

from profilefit.scenes.stage import pattern

SIDE = 32


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
    assert least_distance(pattern.points(samples)) > 0.8 * np.sqrt(2 / np.sqrt(3) / samples)
    assert least_distance(np.random.default_rng(1).random((samples, 2))) < 0.4 * np.sqrt(2 / np.sqrt(3) / samples)


def least_distance(points):
    difference = points[:, None] - points
    difference -= np.round(difference)
    return np.linalg.norm(difference + 9.0 * np.eye(len(points))[..., None], axis=-1).min()


def low_power(tile):
    """Mean power of a tile's frequencies up to a fifth of a cycle a pixel, over that of all; 1 for white noise."""
    power = np.abs(np.fft.fft2(tile - tile.mean())) ** 2
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(len(tile)), np.fft.fftfreq(len(tile))))
    return power[(frequency > 0) & (frequency < 0.2)].mean() / power[frequency > 0].mean()


def test_ranks_are_blue_noise():
    """Every one stands once, with little power at low frequencies, and every level is spread evenly."""
    ranks = pattern.ranks(SIDE, seed=3)
    np.testing.assert_array_equal(np.sort(ranks.ravel()), np.arange(SIDE**2))
    white = np.random.default_rng(1).permutation(SIDE**2).reshape(SIDE, SIDE)
    assert low_power(ranks) < 0.1
    assert low_power(white) > 0.5
    for share in (0.05, 0.25, 0.75):
        # Chosen places in 8 x 8 blocks: chance alone would give a variance of 64 share (1 - share).
        counts = (ranks < share * SIDE**2).reshape(4, 8, 4, 8).sum(axis=(1, 3))
        assert counts.var() < 0.3 * 64 * share * (1 - share), share


def test_two_channels_are_independent():
    tile = pattern.shifts()
    assert tile.shape == (64, 64, 2)
    assert 0 < tile.min() < tile.max() < 1
    assert abs(np.corrcoef(tile[..., 0].ravel(), tile[..., 1].ravel())[0, 1]) < 4 / 64  # four standard errors

"""Blue noise: every level is spread evenly, so a tile has next to no power at low frequencies."""

import numpy as np
import pytest

from profilefit.scenes.stage import pattern

SIDE = 32


@pytest.fixture(scope="module")
def ranks():
    return pattern.ranks(SIDE, seed=3)


def low_power(tile):
    """Mean power of a tile's frequencies up to a fifth of a cycle a pixel, over that of all; 1 for white noise."""
    power = np.abs(np.fft.fft2(tile - tile.mean())) ** 2
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(len(tile)), np.fft.fftfreq(len(tile))))
    return power[(frequency > 0) & (frequency < 0.2)].mean() / power[frequency > 0].mean()


def test_every_rank_stands_once(ranks):
    np.testing.assert_array_equal(np.sort(ranks.ravel()), np.arange(SIDE**2))


def test_little_power_at_low_frequencies(ranks):
    white = np.random.default_rng(1).permutation(SIDE**2).reshape(SIDE, SIDE)
    assert low_power(ranks) < 0.1
    assert low_power(white) > 0.5


@pytest.mark.parametrize("share", [0.05, 0.25, 0.75])
def test_every_level_is_spread_evenly(ranks, share):
    """Chosen places in 8 x 8 blocks: chance alone would give a variance of 64 share (1 - share)."""
    counts = (ranks < share * SIDE**2).reshape(4, 8, 4, 8).sum(axis=(1, 3))
    assert counts.var() < 0.3 * 64 * share * (1 - share)


def test_two_channels_are_independent():
    tile = pattern.shifts()
    assert tile.shape == (64, 64, 2)
    assert 0 < tile.min() < tile.max() < 1
    assert abs(np.corrcoef(tile[..., 0].ravel(), tile[..., 1].ravel())[0, 1]) < 4 / 64  # four standard errors

"""The walk over a normal density, whose width is known, and a walk that is too short."""

import numpy as np
import pytest

from profilefit.fitting.chains import walk

SCALES = np.array([1.0, 30.0])


def log_density(points):
    return np.where(points[:, 0] > -50, -0.5 * np.sum((points / SCALES) ** 2, axis=1), -np.inf)


def start(offset=0.0):
    return offset + SCALES * np.random.default_rng(0).standard_normal((32, 2))


@pytest.mark.slow
def test_a_normal_density_is_sampled():
    found = walk(log_density, start(), np.zeros(2), seed=1, max_steps=4000, kept=4000)
    assert found.result == "converged"
    assert found.samples.shape == (4000, 2)
    np.testing.assert_allclose(found.log_density, log_density(found.samples))
    effective = found.walkers * found.steps / 2 / found.tau
    # The standard error of a standard deviation is 1/sqrt(2 n): four of these.
    np.testing.assert_allclose(found.samples.std(axis=0) / SCALES, 1.0, atol=4 / np.sqrt(2 * min(effective, 4000)))
    again = walk(log_density, start(), np.zeros(2), seed=1, max_steps=4000, kept=4000)
    np.testing.assert_array_equal(found.samples, again.samples)


def test_a_walk_that_is_too_short_says_so():
    found = walk(log_density, start(), np.zeros(2), seed=1, max_steps=60, kept=100)
    assert found.steps == 60
    assert found.result.startswith("chain of 60 steps is under 50 autocorrelation times")


@pytest.mark.parametrize("offset", [-60.0, -1000.0])
def test_walkers_that_start_nowhere_come_in(offset):
    found = walk(log_density, start(offset), np.zeros(2), seed=1, max_steps=100, kept=100)
    assert np.all(np.isfinite(found.log_density))

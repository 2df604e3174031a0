"""Walks over densities whose moments are known: normal, skewed or bounded; proposals without their ratio fail."""

import emcee
import numpy as np
import pytest

from profilefit.fitting.chains import default_moves, laplace_move, walk
from tests.fixtures import slow

SCALES = np.array([1.0, 30.0])


def log_density(points):
    return np.where(points[:, 0] > -50, -0.5 * np.sum((points / SCALES) ** 2, axis=1), -np.inf)


def start(offset=0.0):
    return offset + SCALES * np.random.default_rng(0).standard_normal((32, 2))


@pytest.mark.slow
def test_a_normal_density_is_sampled():
    found = walk(log_density, start(), np.zeros(2), seed=1, max_steps=4000, kept=4000)
    assert (found.result, found.samples.shape) == ("converged", (4000, 2))
    np.testing.assert_allclose(found.log_density, log_density(found.samples))
    effective = found.walkers * found.steps / 2 / found.tau
    # The standard error of a standard deviation is 1/sqrt(2 n): four of these.
    np.testing.assert_allclose(found.samples.std(axis=0) / SCALES, 1.0, atol=4 / np.sqrt(2 * min(effective, 4000)))
    again = walk(log_density, start(), np.zeros(2), seed=1, max_steps=4000, kept=4000)
    np.testing.assert_array_equal(found.samples, again.samples)


def test_a_walk_that_is_too_short_says_so_and_walkers_that_start_nowhere_come_in():
    found = walk(log_density, start(), np.zeros(2), seed=1, max_steps=60, kept=100)
    assert found.steps == 60
    assert found.result.startswith("chain of 60 steps is under 50 autocorrelation times")
    for offset in (-60.0, -1000.0):
        found = walk(log_density, start(offset), np.zeros(2), seed=1, max_steps=100, kept=100)
        assert np.all(np.isfinite(found.log_density))


BEND, WIDTH = 0.3, 0.6
WALKERS, STEPS = 64, 2000


def banana(points):
    """x is standard normal, y about BEND (x^2 - 1), of standard deviation WIDTH."""
    x, y = points.T
    return -0.5 * x**2 - 0.5 * ((y - BEND * (x**2 - 1.0)) / WIDTH) ** 2


def half(points):
    """The same where a flat prior ends at x = 0, beside the middle of the proposals."""
    return np.where(points[:, 0] > 0, banana(points), -np.inf)


# Of x, x^2, y, x y and y^2 over the whole plane and over its half; E x^3 = 2 sqrt(2 / pi) for x > 0.
MEAN_X = np.sqrt(2 / np.pi)
Y_SQUARE = 2 * BEND**2 + WIDTH**2
MOMENTS = {banana: (0.0, 1.0, 0.0, 0.0, Y_SQUARE), half: (MEAN_X, 1.0, 0.0, BEND * MEAN_X, Y_SQUARE)}
# Laplace's approximation at the top of the banana, and one that is off but wide: alone, proposals need tails beyond the
# density's, or walkers stay in them for long and no moment of theirs has an error.
AT_THE_TOP = np.array([0.0, -BEND]), np.diag([1.0, WIDTH**2])
OFF = np.array([0.4, 0.0]), np.array([[2.0, 0.3], [0.3, 2.5]])


def deviations(density, moves):
    """z of the moments, each with the error that its own autocorrelation leaves."""
    start = np.abs(np.random.default_rng(1).standard_normal((WALKERS, 2)))
    found = walk(density, start, np.array([0.1, 0.0]), 2, STEPS, WALKERS * STEPS, moves, STEPS)
    x, y = np.moveaxis(found.samples.reshape(-1, WALKERS, 2), -1, 0)
    values = np.stack([x, x**2, y, x * y, y**2], axis=-1)
    tau = emcee.autocorr.integrated_time(values, tol=0)
    error = values.std(axis=(0, 1)) * np.sqrt(tau / x.size)
    return found, (values.mean(axis=(0, 1)) - MOMENTS[density]) / error


ALONE, MIXED, TOP = ((laplace_move(*OFF), 1.0),), default_moves(*OFF), default_moves(*AT_THE_TOP)


@pytest.mark.parametrize(
    ("moves", "density"),
    [
        *((ALONE, banana), (ALONE, half), (MIXED, banana)),
        *slow((MIXED, half), (TOP, banana), (TOP, half)),
    ],
    ids=["alone-banana", "alone-half", "off-banana", "off-half", "top-banana", "top-half"],
)
def test_moments_of_a_banana_and_of_half_of_it(density, moves, sidak):
    found, z = deviations(density, moves)
    assert found.result == "converged"
    assert np.abs(z).max() < sidak(5 * 6)
    # Negative control: proposals that are accepted as if they were symmetric.
    propose = moves[0][0].get_proposal
    wrong = emcee.moves.MHMove(lambda points, random: (propose(points, random)[0], np.zeros(len(points))))
    assert np.abs(deviations(density, ((wrong, moves[0][1]), *moves[1:]))[1]).max() > 2 * sidak(5 * 6)


@pytest.mark.parametrize("size", [4, 40])
def test_tau_of_a_normal_density_is_a_few_steps(size):
    """Fifty of them fit into the first look, and the draws have the density's width."""
    rng = np.random.default_rng(3)
    root = rng.standard_normal((size, size))
    covariance = root @ root.T
    white = np.linalg.inv(root)

    def normal(points):
        return -0.5 * np.sum((points @ white.T) ** 2, axis=1)

    start = rng.standard_normal((4 * size, size)) @ root.T
    found = walk(normal, start, np.zeros(size), 4, 250, 4000, default_moves(np.zeros(size), covariance), 250)
    assert found.result == "converged"
    assert 1.0 < found.tau < 5.0
    effective = min(len(found.samples), len(start) * found.steps / found.tau)
    deviation = (found.samples @ white.T).std(axis=0)
    np.testing.assert_allclose(deviation, 1.0, atol=4.5 / np.sqrt(2 * effective))  # 4.5: the most of forty

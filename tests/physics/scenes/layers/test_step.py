"""What "a stack at each point" is wrong by beside a step in the first layer's thickness, against traced light.

Two half-planes under a searchlight, whose first layers are thin where x < 0 and thick where x > 0; g = 0 and no index
changes. With mu_t = 1 everywhere a flight is as long wherever it goes, so one path serves every place of the step: only
its weight depends on what it went through. That is delta tracking in which no collision is a null one, and leaves the
difference of two places with little noise.
"""

from typing import NamedTuple

import numpy as np
import pytest

from mcml_sim import Layer, Medium, exact

AWAY = np.array([0.0, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 20.0])  # from the step [mfp]
NO_STEP, BESIDE = -1, 0  # places in lists that go along AWAY and end where there is no step
HERE = 1.0  # radius of what leaves near where it entered [mfp]
LEAST_ERROR = 0.01
LIMIT = 3.0  # standard errors of four numbers, most of whose photons are the same: 3 in 1000 each
SPREAD = 4.0  # standard errors of six numbers to four or three digits: 4 in 10000, and half a digit


class Step(NamedTuple):
    """Albedos of the two layers, and thicknesses of the first on either side of the step [mfp]."""

    top: float
    below: float
    thin: float
    thick: float

    def endless(self, thickness: float) -> exact.Solution:
        top, below = (Layer(1.0, 1.0 - alpha, alpha, 0.0) for alpha in (self.top, self.below))
        return exact.solve(Medium((Layer(1.0, top.mu_a, top.mu_s, 0.0, thickness), below)))


class Traced(NamedTuple):
    """A [-], and what leaves within HERE of where it entered: of light on the thin side and on the thick one, each at
    the distances AWAY from the step and where there is none, (2 sides, 2, places); and standard errors."""

    mean: np.ndarray
    error: np.ndarray


def traced(step: Step, count: int, seed: int) -> Traced:
    random = np.random.default_rng(seed)
    away = np.append(AWAY, np.inf)
    edge = np.concatenate([away, -away])  # x of the step, from where light enters: it is on the thin side first
    edge[[BESIDE, away.size + BESIDE]] = 1e-12, -1e-12
    survives = max(step.top, step.below)  # the rest of the albedo is weight
    place, course, weight = np.zeros((count, 3)), np.tile([0.0, 0.0, 1.0], (count, 1)), np.ones((count, edge.size))
    total, squares = np.zeros((2, edge.size)), np.zeros((2, edge.size))
    while place.size:
        place = place + random.exponential(size=len(place))[:, None] * course
        out = place[:, 2] < 0.0
        left = place[out] - course[out] * (place[out, 2:] / course[out, 2:])
        near = np.hypot(left[:, 0], left[:, 1]) < HERE
        for i, found in enumerate((weight[out], weight[out][near])):
            total[i] += found.sum(axis=0)
            squares[i] += (found**2).sum(axis=0)
        kept = ~out & (random.random(len(place)) < survives)
        place, weight = place[kept], weight[kept]
        thickness = np.where(place[:, :1] < edge, step.thin, step.thick)
        weight = weight * np.where(place[:, 2:] < thickness, step.top, step.below) / survives
        up, around = 2.0 * random.random(len(place)) - 1.0, 2.0 * np.pi * random.random(len(place))
        flat = np.sqrt(1.0 - up * up)
        course = np.stack([flat * np.cos(around), flat * np.sin(around), up], axis=1)
    mean = total / count
    error = np.sqrt((squares / count - mean**2) / count)
    return Traced(*(np.stack(np.split(one, 2, axis=1)) for one in (mean, error)))


def exact_of(step: Step) -> np.ndarray:
    """A and what leaves within HERE of the endless stacks, (2 sides, 2)."""
    lights = [step.endless(thickness) for thickness in (step.thin, step.thick)]
    return np.array([[light.reflectance, light.reflectance * float(light.cdf(HERE))] for light in lights])


def strip(error: np.ndarray) -> float:
    """Distance at which the error of A [-] along AWAY falls below LEAST_ERROR [mfp]."""
    assert error[0] > LEAST_ERROR > error[-1]
    return float(np.interp(-np.log(LEAST_ERROR), -np.log(error), AWAY))


VEIL, DARK = Step(0.9, 0.99, 0.1, 0.4), Step(0.6, 0.99, 0.3, 1.5)


@pytest.mark.slow
@pytest.mark.parametrize("step", [VEIL, DARK], ids=["veil", "dark"])
def test_the_tracer_is_right_where_there_is_no_step(step):
    """And beside one the light is another: of photons by the ten thousand."""
    true, found = exact_of(step), traced(step, 40_000, seed=3)
    z = (found.mean - true[..., None]) / found.error
    assert np.all(np.abs(z[..., NO_STEP]) < LIMIT), z[..., NO_STEP]
    assert np.all(np.abs(z[:, 0, BESIDE]) > 2.0 * LIMIT)  # the comparison can fail
    assert np.all(z[:, 0, BESIDE] * [1.0, -1.0] < 0)  # what it takes from one side it gives to the other


# Means of 16 runs of 400 000 photons, on the thin side and on the thick one, and the standard error of one run: the
# largest error of A [-], the strip beside the step in which it is above 1 % [mfp], and that of what leaves nearby [-].
# Light of the layer below goes 6 mfp before it has fallen to 1 / e.
FOUND = [
    # A is 0.732 and 0.669. At 5 mfp its error is 0.2 %.
    (VEIL, [[0.0319, 0.0329], [1.53, 1.58], [0.0192, 0.0193]], [[2e-4, 2e-4], [0.011, 0.017], [2e-4, 2e-4]]),
    # A is 0.529 and 0.203. At 5 mfp its error is 2.4 % and 1.9 %.
    (DARK, [[0.308, 0.396], [7.61, 6.88], [0.138, 0.121]], [[9e-4, 2e-3], [0.038, 0.065], [1e-3, 1e-3]]),
]


@pytest.mark.slow
@pytest.mark.parametrize(("step", "known", "spread"), FOUND, ids=["veil", "dark"])
def test_how_wrong_a_stack_at_each_point_is(step, known, spread):
    true, found = exact_of(step), traced(step, 400_000, seed=1)
    z = (found.mean - true[..., None]) / found.error
    assert np.all(np.abs(z[..., NO_STEP]) < LIMIT), z[..., NO_STEP]
    assert np.all(np.abs(z[..., AWAY.size - 1]) < LIMIT), z[..., AWAY.size - 1]
    assert np.all(np.abs(z[..., BESIDE]) > 2.0 * LIMIT)
    # Over the same paths without the step, whose noise is in both.
    error = np.abs(found.mean[..., :-1] / found.mean[..., NO_STEP, None] - 1.0)
    assert np.all(np.diff(error[:, 0]) < 0)
    measured = np.array([error[:, 0, BESIDE], [strip(one) for one in error[:, 0]], error[:, 1, BESIDE]])
    assert np.all(np.abs(measured - known) < SPREAD * np.array(spread)), measured
    nearby = np.argmax(error[:, 1] < LEAST_ERROR, axis=1)
    assert np.all(AWAY[nearby] <= 1.5 * HERE)  # what leaves near where it entered has hardly been beyond the step

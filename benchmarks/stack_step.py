"""Error of "a stack at each point" beside a step in the first layer's thickness, against traced light.

    python -m benchmarks.stack_step   # a minute

Two half-planes under a searchlight, whose first layers are thin where x < 0 and thick where x > 0; g = 0 and no index
changes. With mu_t = 1 everywhere a flight is as long wherever it goes, so one path serves every place of the step: only
its weight depends on what it went through. That is delta tracking in which no collision is a null one, and leaves the
difference of two places with little noise.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from benchmarks.table import Listed, Rows, show_all
from mcml_sim import Layer, Medium, exact

AWAY = np.array([0.0, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 20.0])  # from the step [mfp]
NO_STEP, BESIDE = -1, 0  # places in lists that go along AWAY and end where there is no step
HERE = 1.0  # radius of what leaves near where it entered [mfp]
LEAST_ERROR = 0.01
PHOTONS, SEED = 400_000, 1


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
    """Light on the thin side and on the thick one: A [-], and what leaves within HERE of where it entered.

    Each at the distances AWAY from the step and where there is none, (2 sides, 2, places); and standard errors.
    """

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
    """Return A and what leaves within HERE of the endless stacks, (2 sides, 2)."""
    lights = [step.endless(thickness) for thickness in (step.thin, step.thick)]
    return np.array([[light.reflectance, light.reflectance * float(light.cdf(HERE))] for light in lights])


def strip(error: np.ndarray) -> float:
    """Distance at which the error of A [-] along AWAY falls below LEAST_ERROR [mfp]."""
    assert error[0] > LEAST_ERROR > error[-1]
    return float(np.interp(-np.log(LEAST_ERROR), -np.log(error), AWAY))


VEIL, DARK = Step(0.9, 0.99, 0.1, 0.4), Step(0.6, 0.99, 0.3, 1.5)


def errors() -> Rows:
    """Return A, its error at the step, the strip in which it is above 1 %, the error nearby, by side; and the check."""
    rows: Rows = []
    for name, step in (("0.9 over 0.99", VEIL), ("0.6 over 0.99", DARK)):
        true, found = exact_of(step), traced(step, PHOTONS, SEED)
        z = (found.mean - true[..., None]) / found.error
        # Over the same paths without the step, whose noise is in both.
        error = np.abs(found.mean[..., :-1] / found.mean[..., NO_STEP, None] - 1.0)
        for side, where in enumerate(("thin", "thick")):
            at_step, nearby = (float(error[side, part, BESIDE]) for part in (0, 1))
            check = float(np.abs(z[side, :, NO_STEP]).max())
            rows.append((name, where, float(true[side, 0]), at_step, strip(error[side, 0]), nearby, check))
    return rows


# Standard errors of one run: of the error of A 0.0002 to 0.002, of the strip 0.01 to 0.07 mfp, nearby 0.0002 to 0.001.
COLUMNS = {
    **{"first layer over medium": "", "side": "", "A": ".3f", "error of A": ".2%", "strip above 1 % [mfp]": ".2f"},
    **{"error within 1 mfp": ".2%", "traced less exact where there is no step [standard errors]": ".1f"},
}

if __name__ == "__main__":
    show_all({"step": Listed("A stack at each point, beside a step in thickness", COLUMNS, errors)}, None)

"""The samples of a screen-space gather on the step edge, in float64: the stage's estimator on an endless surface."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from profilefit.fitting.sampling import LawTarget
from profilefit.laws.base import ProfileLaw
from profilefit.scenes.stage.step_edge import LAST_XI, shifted_points
from profilefit.studies.choose.case import Case

Floats = NDArray[np.float64]
# Of scatter.frag: least radius [mfp], weight of the own light per sample, least cosine, where it fades to Lambert [px].
NEAREST, OWN, LEAST_COSINE, LAMBERT = 1e-6, 1e-4, 0.05, (0.05, 0.1)
# Every estimate has a shift of its own: 1024 of them, and of many samples 256: errors known to 2 and 4 %.
MOST, FULL, SEED = 1024, 65_536, 1
FAINT = 1e-300
TABLE = np.linspace(np.log(NEAREST), np.log(1e4), 1200)  # of ln x


@dataclass(frozen=True)
class Density:
    """ln of 2 pi x R_d / A over ln x, at one albedo."""

    values: Floats

    def __call__(self, x: Floats) -> Floats:
        return np.exp(np.interp(np.log(x), TABLE, self.values))


@lru_cache(maxsize=256)
def density(law: ProfileLaw, alpha: float) -> Density:
    return Density(np.log(np.maximum(LawTarget(law).density(np.exp(TABLE), alpha), FAINT)))


@lru_cache(maxsize=256)
def drawn(law: ProfileLaw, alpha: float, samples: int) -> tuple[Floats, Floats, Floats]:
    """Radii x = r/l, their density, and angles of every trial, (trials, samples) each."""
    trials = min(MOST, FULL // samples)
    points = shifted_points(samples, trials, SEED)
    xi = np.full(FULL, 0.5)  # one shape, one compilation
    xi[: trials * samples] = np.minimum(points[..., 0], LAST_XI).ravel()
    x = np.maximum(np.asarray(law.sampler.sample(xi, alpha)), NEAREST)
    radii, known = (values[: trials * samples].reshape(trials, samples) for values in (x, law.sampler.pdf(x, alpha)))
    return radii, known, 2.0 * np.pi * points[..., 1]


def estimates(law: ProfileLaw, alpha: tuple[float, ...], samples: int, case: Case, channel: int, x: Floats) -> Floats:
    """L / A that the channel gathers at places x (m,) on the lit side, each with trials of its own: (m, trials)."""
    length, longest = case.mfp[channel], case.mfp[case.longest]
    every = drawn(law, alpha[case.longest], samples)
    each = len(every[0]) // len(x)
    radii, known, angle = (one[: each * len(x)].reshape(len(x), each, samples) for one in every)
    side = longest * radii
    p = known / longest
    across = x[:, None, None] + side * np.cos(angle)
    shown = (p > 0) & (np.abs(across) < case.window[0]) & (np.abs(side * np.sin(angle)) < case.window[1])
    own = density(law, alpha[channel])
    with np.errstate(divide="ignore", invalid="ignore"):
        distance, area = _met(side, across, x, case)
        weight = area * side / distance * own(distance / length) / length / p
    weight = np.where(shown, weight, 0.0)
    rest = OWN * samples
    found = (rest + np.sum(weight * (across > 0), axis=2)) / (rest + np.sum(weight, axis=2))
    low, high = LAMBERT
    blurred = np.clip((length / case.pixel - low) / (high - low), 0.0, 1.0)
    return 1.0 + blurred * (found - 1.0)


def _met(side: Floats, across: Floats, x: Floats, case: Case) -> tuple[Floats, Floats]:
    """Where the ray of each sample meets the tangent plane of the pixel that it hits: distance, and area it stands for.

    Beside the cylinder the area is 0.
    """
    if case.is_flat:
        return side, np.ones_like(side)
    radius = case.radius
    middle = (np.floor(across / case.pixel) + 0.5) * case.pixel
    seen = np.abs(middle) < radius
    middle = np.where(seen, middle, 0.0)
    height = np.sqrt(radius**2 - middle**2)
    facing = np.maximum(height / radius, LEAST_COSINE)
    depth = height - (across - middle) * middle / (radius * facing) - np.sqrt(radius**2 - x[:, None, None] ** 2)
    return np.hypot(side, np.where(seen, depth, 0.0)), np.where(seen, 1.0 / facing, 0.0)

"""Exponent of shells: fitted to the shadow of the cone, its constants with their errors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from profilefit.fitting.solver import differences, solve
from profilefit.scenes.fur.law import LEAST_X, MOST_X, Exponent, shell_shadow

Floats = NDArray[np.float64]
SLENDER = (10.0, 20.0, 50.0)  # L / r0
PER_DECADE = 8  # x = N r0 / L, even in its logarithm
ANGLES = np.radians(np.arange(2.0, 80.0, 4.0))  # middles of equal parts of 0 to 80 degrees
FIRST, LARGEST = 2.0, 8.0
STEP, TOLERANCE = 1e-5, 1e-6  # of an exponent, for derivatives; of its search


def misfit(layers: int, exponent: float, slender: float) -> float:
    """Return the mean square of ln(shadow of shells / shadow of the cone), weighed by sin cos, over 0 to 80 degrees."""
    return float(np.sum(_residual(layers, exponent, slender) ** 2))


def best_of(layers: int, slender: float) -> float:
    """Return the exponent of the least misfit."""
    at = differences(lambda p: _residual(layers, float(p[0]), slender), STEP, LARGEST)
    return float(solve(at, np.array([FIRST]), (1.0, LARGEST), tolerance=TOLERANCE).parameters[0])


def _residual(layers: int, exponent: float, slender: float) -> Floats:
    """Return ln(shadow of the shells / shadow of the cone) at each angle, times the root of its share of the weight."""
    logs = np.log([shell_shadow(layers, exponent, 1.0 / slender, 1.0, float(angle)) for angle in ANGLES])
    weight = np.sin(ANGLES) * np.cos(ANGLES)
    return logs * np.sqrt(weight / weight.sum())


def fitted(slender: Sequence[float] = SLENDER) -> tuple[Exponent, Exponent]:
    """Fit p = 1 + size x^power by least squares of ln(p - 1), and return the constants and their errors.

    The errors are the standard deviations of constants fitted to one slenderness each: what the law leaves out.
    """
    each, rows = [], []
    for one in slender:
        count = int(PER_DECADE * np.log10(MOST_X / LEAST_X)) + 1
        numbers = np.unique(np.ceil(one * np.geomspace(LEAST_X, MOST_X, count) - 1e-9).astype(int))
        numbers = numbers[numbers <= MOST_X * one]
        own = [(np.log(n / one), np.log(best_of(int(n), one) - 1.0)) for n in numbers]
        rows += own
        each.append(_line(own))
    size, power = _line(rows)
    spread = np.std(each, axis=0, ddof=1)
    return Exponent(float(np.exp(size)), power), Exponent(float(np.exp(size) * spread[0]), float(spread[1]))


def _line(rows: Sequence[tuple[float, float]]) -> tuple[float, float]:
    x, y = np.array(rows).T
    power, size = np.polyfit(x, y, 1)
    return float(size), float(power)

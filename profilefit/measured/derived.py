"""What people call a medium by, from the coordinates of a fit, with errors."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from profilefit.measured.model import LENGTH, SCALE, U, alpha_of

Floats = NDArray[np.float64]
QUANTITIES = ("A", "alpha", "l", "mu_s'", "mu_a", "scale")
POWERS = {"A": 0, "alpha": 0, "l": 1, "mu_s'": -1, "mu_a": -1, "scale": 0}  # of the unit of length
# What a fit can be asked to know well: each is zero or infinite only where there is no medium.
STRENGTHS = ("mu_s'", "mu_a", "scale")


def quantities(points: Floats, reflectance: Floats) -> dict[str, Floats]:
    """Each quantity (m,) at points (m, 3) whose total reflectances A are (m,)."""
    s = expit(points[:, U])
    alpha, length = alpha_of(points[:, U]), np.exp(points[:, LENGTH])
    values = (reflectance, alpha, length, alpha / length, s**2 / length, np.exp(points[:, SCALE]))
    return dict(zip(QUANTITIES, values, strict=True))


def slopes(point: Floats, reflectance_slope: Floats) -> dict[str, Floats]:
    """The derivatives (3,) of each quantity by the coordinates; of A they are given."""
    s = float(1.0 / (1.0 + np.exp(-point[U])))
    alpha, length = float(alpha_of(point[U])), float(np.exp(point[LENGTH]))
    steep = 2.0 * s**2 * (1.0 - s)  # of 1 - alpha by u
    u, ln_l, ln_k = np.eye(3)[[U, LENGTH, SCALE]]
    return {
        "A": reflectance_slope,
        "alpha": -steep * u,
        "l": length * ln_l,
        "mu_s'": -(steep * u + alpha * ln_l) / length,
        "mu_a": (steep * u - s**2 * ln_l) / length,
        "scale": float(np.exp(point[SCALE])) * ln_k,
    }


def errors(gradients: dict[str, Floats], covariance: Floats) -> dict[str, float]:
    """Standard error of each quantity, from the covariance (3, 3) of the coordinates."""
    return {name: math.sqrt(max(float(row @ covariance @ row), 0.0)) for name, row in gradients.items()}


def correlation(gradients: dict[str, Floats], covariance: Floats, names: tuple[str, ...]) -> Floats:
    """Correlations (k, k) of the named quantities."""
    rows = np.stack([gradients[name] for name in names])
    joint = rows @ covariance @ rows.T
    spread = np.sqrt(np.diag(joint))
    with np.errstate(invalid="ignore", divide="ignore"):
        return joint / np.outer(spread, spread)


def unit_of(name: str, unit: str) -> str:
    """The unit of a quantity where lengths are in `unit`."""
    if POWERS[name] == 0:
        return ""
    return (unit or "unit of r") if POWERS[name] > 0 else f"1/{unit or 'unit of r'}"

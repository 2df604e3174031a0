"""The exact half space as small tables, rows of albedos, columns of radii: what `exact.js` computes from.

ln(R_d l^2 / A) + kappa x and ln(cdf / x), x = r/l, at even u and ln x, where sqrt(1 - alpha) = 1 - (1 - u^3)^2 crowds
the rows at both ends; `exact.js` puts polynomials of six points through both. Between the knots, for A up to 0.9999,
R_d is right to 4e-6 for r within 99.5 % of the energy and the cdf to 1e-6 everywhere; nearer to white to 1e-4 and 1e-5.

Under a surface that refracts the tables are coarser, and stand at a few indices, through which goes a polynomial over
mu_c = sqrt(1 - 1/n^2): R_d is right to 5e-4 and the cdf to 5e-5 from n = 1.1 up, below it to 3e-3 and 3e-4, where light
is scattered hardly at all or almost always.
"""

from __future__ import annotations

import base64
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from mcml_sim import Setting, exact
from profilefit.scenes.stage.exact_law import LEAST_ALPHA, log_profile

Floats = NDArray[np.float64]
LIGHTS = ("searchlight", "diffuse")
KNOTS = (1.02, 1.05, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6)  # n, denser where the light changes fastest with it
FAINT = 1e-9  # x^2 R_d l^2 / A below which the quadrature of a refracting surface leaves no digits


@dataclass(frozen=True)
class TableGrid:
    """rows of albedos, columns of radii; low, high the first and last x [mfp]."""

    rows: int
    columns: int
    low: float = 1e-4
    high: float = 1e4


GRID, COARSE = TableGrid(65, 111), TableGrid(49, 89)


def grid_of(setting: Setting) -> TableGrid:
    """Return the grid of a setting's table: coarser under a refracting interface."""
    return GRID if setting.n == 1.0 else COARSE


@lru_cache(maxsize=len(LIGHTS) * (1 + len(KNOTS)))
def baked(setting: Setting) -> str:
    """Return A / alpha (rows,), then both tables (rows, columns): float32, little-endian, in base64."""
    grid = grid_of(setting)
    s = 1.0 - (1.0 - np.linspace(0.0, 1.0, grid.rows) ** 3) ** 2
    alpha = np.maximum((1.0 - s) * (1.0 + s), LEAST_ALPHA)
    y = np.linspace(np.log(grid.low), np.log(grid.high), grid.columns)
    reflectance = np.asarray(exact.reflectance(alpha, setting))
    own = log_profile if setting.n == 1.0 else _refracted
    profile = own(y, alpha, setting) - np.log(reflectance)[:, None]
    cdf = np.log(np.asarray(exact.cdf(np.exp(y), alpha[:, None], setting=setting))) - y
    numbers = np.concatenate([reflectance / alpha, profile.ravel(), cdf.ravel()])
    return base64.b64encode(numbers.astype("<f4").tobytes()).decode("ascii")


def _refracted(y: Floats, alpha: Floats, setting: Setting) -> Floats:
    """Return ln(R_d l^2) + kappa x (albedos, radii), continued as x^-2 from where R_d is `FAINT` [-]."""
    x = np.exp(y)
    profile = np.asarray(exact.profile(x, alpha[:, None], setting=setting))
    reflectance = np.asarray(exact.reflectance(alpha, setting))
    seen = np.logical_and.accumulate(x**2 * profile > FAINT * reflectance[:, None], axis=1)
    held = np.minimum(np.arange(y.size), np.sum(seen, axis=1)[:, None] - 1)
    path = np.asarray(exact.decay_rate(alpha))[:, None] * x[held]
    return np.log(np.take_along_axis(profile, held, axis=1)) + path - 2.0 * (y - y[held])

"""Exact half space as a law that a shader can run: textures for given albedos behind the functions of a law.

For tests and references: what any closed form would give if it had no error.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from mcml_sim import Setting, exact
from profilefit.errors import InputError, SettingError
from profilefit.shader.emit import literal, text_beside

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
DIFFUSE = Setting("diffuse")  # the light that irradiance is
NAME = "exact"
MOST_DEPTH = 24 * np.log(2.0)  # t = -ln(1 - xi) at the largest xi of a law's text, 1 - 2^-24
DRAWN, KNOWN = 2048, 4096  # columns of the tables
NEAR = 0.05  # x = NEAR sinh u [mfp]: u is even in x near the source and in ln x far away
NEAREST, FARTHEST = 1e-6, 1000.0  # x [mfp] of the first and the last column
LEAST_DENSITY = 1e-37  # [1/mfp]: its logarithm stays a number
MOST_ALBEDOS = 16


@dataclass(frozen=True)
class ExactLaw:
    """Exact profiles of some albedos: density, cdf and the radius that a share of the energy leaves within.

    alpha  those that shaders may use; for another one the nearest is taken
    """

    alpha: tuple[float, ...]
    setting: Setting = DIFFUSE

    def __post_init__(self) -> None:
        if not 1 <= len(self.alpha) <= MOST_ALBEDOS or not all(0 < a <= 1 for a in self.alpha):
            raise InputError(f"alpha must be 1 ... {MOST_ALBEDOS} albedos in (0, 1], got {self.alpha!r}")
        require_isotropic(self.setting)

    def text(self, name: str) -> str:
        """Return the law's text with the prefix `name`; it needs the textures of `textures(name)`."""
        reflectance = np.atleast_1d(exact.reflectance(self.alpha, self.setting))
        rows = {"ROWS": str(len(self.alpha)), "ALPHAS": ", ".join(literal(a) for a in self.alpha)}
        return table_text(name, reflectance) + _filled("exact_law", name, rows)

    def textures(self, name: str) -> dict[str, Singles]:
        """Return float textures (rows, columns, channels) by the names of their samplers."""
        drawn, known = _tables(self.alpha, self.setting)
        return {f"{name}_drawn": drawn, f"{name}_known": known}


def require_isotropic(setting: Setting) -> None:
    """Raise SettingError where a setting has g: a scene's albedos and lengths are reduced, exact light's are not."""
    if setting.g != 0.0:
        raise SettingError(f"a scene's exact light scatters isotropically: setting must have g = 0, got {setting}")


def table_text(name: str, reflectance: Iterable[float]) -> str:
    """Return GLSL of a table, whose shapes are rows, of A [-] each."""
    reflectances = [literal(float(a)) for a in reflectance]
    values = {
        "ROWS": str(len(reflectances)),
        "REFLECTANCES": ", ".join(reflectances),
        "MOST_DEPTH": literal(MOST_DEPTH),
        "LARGEST_U": literal(float(np.arcsinh(FARTHEST / NEAR))),
        "NEAR": literal(NEAR),
    }
    return _filled("exact_table", name, values)


def _filled(file: str, name: str, values: Mapping[str, str]) -> str:
    text = text_beside(__name__, f"glsl/{file}.glsl").replace("LAW_", f"{name}_")
    for key, value in values.items():
        text = text.replace(f"@{key}@", value)
    return text


def columns() -> tuple[Floats, Floats]:
    """Return t (DRAWN,) of the radii that are drawn, and x (KNOWN,) [mfp] of density and cdf: a table's columns."""
    t = np.linspace(0.0, MOST_DEPTH, DRAWN)
    t[0] = 1e-4 * t[1]
    return t, np.maximum(NEAR * np.sinh(np.linspace(0.0, np.arcsinh(FARTHEST / NEAR), KNOWN)), NEAREST)


def row(radius: Floats, ring: Floats, share: Floats) -> tuple[Singles, Singles]:
    """Return a row of x at each t, and a row of density and cdf at each x.

    They are ln(x/t) (DRAWN, 1), and the logarithm of the density 2 pi x R_d / A beside -ln(1 - cdf) (KNOWN, 2).
    """
    left = np.maximum(1.0 - share, np.exp(-MOST_DEPTH - 10.0))
    known = np.stack([np.log(np.maximum(ring, LEAST_DENSITY)), -np.log(left)], axis=-1)
    return np.log(np.minimum(radius, FARTHEST) / columns()[0])[:, None].astype(np.float32), known.astype(np.float32)


@cache
def _tables(alpha: tuple[float, ...], setting: Setting) -> tuple[Singles, Singles]:
    """Return a row for each albedo; the same arrays each time, which are sent once."""
    drawn, known = zip(*(_table(one, setting) for one in alpha), strict=True)
    return np.stack(drawn), np.stack(known)


@cache
def _table(alpha: float, setting: Setting) -> tuple[Singles, Singles]:
    t, x = columns()
    ring = 2.0 * np.pi * x * exact.profile(x, alpha, setting=setting) / exact.reflectance(alpha, setting)
    radius = np.asarray(exact.quantile(-np.expm1(-t), alpha, setting=setting))
    return row(radius, ring, np.asarray(exact.cdf(x, alpha, setting=setting)))

"""Exact light of a half space, ready to be fitted (`mcml_sim.exact.light`).

Where scattering has a direction it is that of the table. Where it has none, between its nodes this is within 1e-5 of
`mcml_sim.exact` for x up to 20 mfp, within 3e-4 farther out, until light has fallen by e^-20. Beyond x = 28 / kappa,
where the exact solution runs out of digits (12 / kappa next to white), R_d goes on as e^{-kappa x} (1 + kappa x) / x^3.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from mcml_sim import exact
from mcml_sim.exact.anisotropic import forward_table
from mcml_sim.exact.half_space import require_solved
from mcml_sim.exact.light import LEAST, ExactLight, coefficients, log_once, nodes, tabulated
from mcml_sim.files.kept import kept
from mcml_sim.media.setting import FORWARD_N, Setting

Floats = NDArray[np.float64]
EXACT = "exact"  # its name among laws
DEGREES = 64  # Chebyshev polynomials in s
STEP = 0.06  # of ln x
NEAREST, FARTHEST = 1e-4, 1e3  # mfp, of f
# kappa x that the exact solution reaches; the second where kappa < WHITE
SOLVED, SOLVED_WHITE, WHITE = 28.0, 12.0, 0.06


VERSION = 1  # of what `_solved` gives


@lru_cache(maxsize=64)
def exact_light(setting: Setting) -> ExactLight:
    """Of a half space that `mcml_sim.exact` solves; SettingError of another. Seconds where g = 0, the first time."""
    require_solved(setting)
    if not setting.is_isotropic:
        return _filled(forward_table.light(setting))
    parts = ("rest", "kappa", "share")
    name = f"light-{setting.illumination}-n{setting.n!r}-{DEGREES}-v{VERSION}"
    found = kept(name, parts, lambda: dict(zip(parts, _solved(setting), strict=True)))
    return tabulated(setting, NEAREST, STEP, *(found[part] for part in parts))


def light_at_hand(setting: Setting) -> ExactLight:
    """The same of one of many settings that a search tries: that of the table, to 3e-4, where it has these n."""
    if setting.is_isotropic and FORWARD_N[0] <= setting.n <= FORWARD_N[1]:
        return _filled(forward_table.light(setting))
    return exact_light(setting)


def _solved(setting: Setting) -> tuple[Floats, Floats, Floats]:
    """The spline of f, kappa and A / alpha in Chebyshev polynomials of s."""
    s = np.sqrt(1.0 - LEAST) * 0.5 * (1.0 + nodes(DEGREES))
    alpha = 1.0 - s**2
    log = np.arange(np.log(NEAREST), np.log(FARTHEST) + STEP, STEP)
    kappa = np.asarray(exact.decay_rate(alpha))[:, None]
    x = np.exp(log)[None]
    solved = np.minimum(x, np.where(kappa > WHITE, SOLVED, SOLVED_WHITE) / kappa)
    light = 2.0 * np.pi * solved * exact.profile(solved, alpha[:, None], setting=setting)
    rest = (light - alpha[:, None] * np.exp(log_once(solved, setting))) / alpha[:, None] ** 2
    f = np.log(rest) + kappa * solved - np.log1p(kappa * solved) - 2.0 * np.log(x / solved)
    whole = nodes(DEGREES) * 0.5 + 0.5
    share = coefficients(np.asarray(exact.reflectance(1.0 - whole**2, setting=setting)) / (1.0 - whole**2))
    rest = coefficients(CubicSpline(log, f, axis=1).c.transpose(2, 1, 0))
    return rest, coefficients(kappa[:, 0]), share


def _filled(light: ExactLight) -> ExactLight:
    """Return the light with as many intervals as where g = 0, so that both share compiled code.

    Those that are added hold f at its end.
    """
    intervals = np.arange(np.log(NEAREST), np.log(FARTHEST) + STEP, STEP).size - 1
    with jax.enable_x64(True):
        end = light.rest[:, -1] @ jnp.power(light.step, jnp.arange(3.0, -1.0, -1.0))
        shape = end.size, intervals - light.rest.shape[1], 4
        more = jnp.zeros(shape).at[..., 3].set(end[:, None])
        return replace(light, rest=jnp.concatenate([light.rest, more], 1))

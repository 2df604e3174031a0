"""Cost of half precision: of what is stored in it, and of computing in it where the driver can.

Informs, and breaks nothing: engines store albedo textures and results in float16 and compute in float32.
"""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from profilefit.fitting.quality import ENERGY_WITHIN, NEAREST
from profilefit.recipes.catalogue import LoadedLaw
from profilefit.shader.check.bounds import ALBEDOS
from profilefit.shader.check.shader_law import ShaderLaw, Values, half_extension

Floats = NDArray[np.float64]
FARTHEST, RADII = 100.0, 200
ALPHA, REFLECTANCE, RADIUS, RESULTS, ARITHMETIC = "α stored", "A stored", "r stored", "results stored", "arithmetic"


@dataclass(frozen=True)
class HalfCheck:
    """`rel` and `ks` [-] of what float16 alone changes, worst over the records' albedos, for l = 1."""

    of: LoadedLaw
    rel: dict[str, float]
    ks: dict[str, float]


def check_half(context: moderngl.Context, loaded: LoadedLaw) -> HalfCheck:
    """Store one thing in float16 at a time, all else in float32; then compute in it, if that is offered."""
    law = loaded.law.in_reduced()
    r, alpha = np.geomspace(NEAREST, FARTHEST, RADII)[None, :], ALBEDOS[:, None]
    cdf = np.asarray(law.cdf(r, alpha))
    truth = np.asarray(law.profile(r, alpha)), cdf, cdf <= ENERGY_WITHIN
    single = ShaderLaw(context, law)
    found = {ALPHA: single.values(r, 0.5, _half(alpha))}
    if getattr(law, "albedo", None) is not None:
        found[REFLECTANCE] = single.values(r, 0.5, law.albedo.alpha(_half(law.albedo.reflectance(alpha))))
    found[RADIUS] = single.values(_half(r), 0.5, alpha)
    found[RESULTS] = ShaderLaw(context, law, results="f2").values(r, 0.5, alpha)
    if half_extension(context):
        found[ARITHMETIC] = ShaderLaw(context, law, half=True).values(r, 0.5, alpha)
    errors = {name: _errors(values, *truth) for name, values in found.items()}
    return HalfCheck(loaded, {n: error[0] for n, error in errors.items()}, {n: error[1] for n, error in errors.items()})


def _half(values: Floats) -> Floats:
    return np.asarray(values, np.float16).astype(np.float64)


def _errors(values: Values, profile: Floats, cdf: Floats, used: NDArray[np.bool_]) -> tuple[float, float]:
    with np.errstate(all="ignore"):
        error = np.where(used, np.abs(values.profile / profile - 1.0), 0.0)
        rel = np.sum(error, axis=1) / np.sum(used, axis=1)
        return float(np.max(rel)), float(np.max(np.abs(values.cdf - cdf)))

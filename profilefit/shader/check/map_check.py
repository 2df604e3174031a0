"""Check of a map's source where it runs, judged like a profile law, by its own model error."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from mcml_sim import exact
from mcml_sim.exact.light import unreduced
from profilefit.recipes.catalogue import LoadedLaw
from profilefit.recipes.record import Folder
from profilefit.shader.check import bounds, validity
from profilefit.shader.check.bounds import MODEL_FACTOR, ROUNDING_SHARE, Bound
from profilefit.shader.check.dense_grid import ULP, Count, ShaderCheck, bad_numbers
from profilefit.shader.check.shader_law import ShaderMap
from profilefit.shader.check.validity import Range

Floats = NDArray[np.float64]
# Even in A, and even in sqrt(1 - alpha) as `quality.albedo_quality`: both as the GPU sees them.
REFLECTANCE = np.linspace(0.0, 1.0, 2001).astype(np.float32).astype(np.float64)
ALPHA = (1.0 - np.linspace(1.0, 0.0, 1001) ** 2).astype(np.float32).astype(np.float64)
STEPS = 4  # of ULP that a falling alpha or A may be rounding


@dataclass(frozen=True)
class MapCheck(ShaderCheck):
    """Findings on one map: `delta_A` and `delta_alpha`, and where their rounding is largest, in words."""

    places: dict[str, str]


def check_map(context: moderngl.Context, loaded: LoadedLaw, folder: Folder, text: str = "") -> MapCheck:
    """Check a map with its constants; `text` in place of its own. ShaderError if it does not compile."""
    model = bounds.of_map(loaded, folder)
    of_reflectance, of_alpha = validity.of_map(loaded, folder)
    shader, law = ShaderMap(context, loaded.law, text), loaded.law.in_reduced()
    alpha, reflectance = shader.alpha(REFLECTANCE), shader.reflectance(ALPHA)
    with np.errstate(all="ignore"):  # what is no number is counted, not warned of
        errors = {
            "delta_A": np.abs(reflectance - law.reflectance(ALPHA))[of_alpha.holds(ALPHA)],
            "delta_alpha": np.abs(alpha - law.alpha(REFLECTANCE))[of_reflectance.holds(REFLECTANCE)],
        }
    rounding = {name: float(np.max(values)) for name, values in errors.items()}
    places = {
        "delta_A": f"α {ALPHA[of_alpha.holds(ALPHA)][np.argmax(errors['delta_A'])]:.4g}",
        "delta_alpha": f"A {REFLECTANCE[of_reflectance.holds(REFLECTANCE)][np.argmax(errors['delta_alpha'])]:.4g}",
    }
    measured = _measured(shader, of_alpha)
    inside = _counted(alpha, reflectance, of_reflectance, of_alpha)
    outside = _counted(alpha, reflectance, Range(), Range()).less(inside)
    limits = []
    for name, value in model.values.items():
        limits.append(Bound(f"float32 {name}", rounding[name], ROUNDING_SHARE * value, places[name]))
        if name in measured:
            limits.append(Bound(f"{name} against the exact half space", measured[name], MODEL_FACTOR * value))
    limits += [bad_numbers(inside), *validity.promised_by_map(loaded)]
    return MapCheck(loaded, model, rounding, measured, inside, outside, tuple(limits), places)


def _measured(shader: ShaderMap, of_alpha: Range) -> dict[str, float]:
    """Largest errors against the exact half space, for albedos below 1 where the map holds [-]."""
    if not shader.setting.is_solved:
        return {}
    alpha = ALPHA[of_alpha.holds(ALPHA)]
    truth = np.asarray(exact.reflectance(unreduced(alpha, shader.setting.g), setting=shader.setting))
    return {
        "delta_A": float(np.max(np.abs(shader.reflectance(alpha) - truth))),
        "delta_alpha": float(np.max(np.abs(shader.alpha(truth) - alpha))),
    }


def _counted(alpha: Floats, reflectance: Floats, of_reflectance: Range, of_alpha: Range) -> Count:
    """Count what must not be: both directions rise."""
    numbers, first = np.zeros(4, int), ""
    for given, value, span, sign in (
        (REFLECTANCE, alpha, of_reflectance, "A"),
        (ALPHA, reflectance, of_alpha, "α"),
    ):
        held = span.holds(given)
        with np.errstate(invalid="ignore"):
            falls = np.append(False, np.diff(value) < -STEPS * ULP) & held & np.append(False, held[:-1])
            kinds = [np.isnan(value) & held, np.isinf(value) & held, (value < 0) & held, falls]
        numbers += [int(np.sum(kind)) for kind in kinds]
        bad = np.any(kinds, axis=0)
        if np.any(bad) and not first:
            first = f"{sign} {given[np.argmax(bad)]:.4g}"
    nan, infinite, negative, wrong_way = (int(number) for number in numbers)
    return Count(nan, infinite, negative, wrong_way, first)

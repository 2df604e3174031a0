"""Sums of 1 to 8 Gaussians of a stack in both lights, three colours sharing variances: their record, and back to laws.

Records lie in a folder of their own, FITS/gaussians, each beside the arrays of the light that it was fitted to.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mcml_sim import Medium, Setting
from mcml_sim.media.setting import ILLUMINATIONS
from profilefit.errors import RecordError
from profilefit.laws.gaussians import DEFAULT, MOST, MediumGaussians
from profilefit.materials import CHANNELS
from profilefit.recipes import record
from profilefit.recipes.folder import SUMS
from profilefit.recipes.kinds import COUNT, DIGEST, LIST, MEASURE, NUMBERS, TABLE, TEXT
from profilefit.recipes.schema import Kinds
from profilefit.recipes.stack import fit, gaussians
from profilefit.recipes.stack.file import LayerStack
from profilefit.recipes.stack.gaussians import SumLight
from profilefit.recipes.stack.record import StackRequest, damage, told_stack
from profilefit.recipes.stack.sum_errors import constant_names, errors, quality
from profilefit.recipes.work import Made, Work

PIPELINE = "gaussians"
TITLE = "Sums of 1 to 8 Gaussians, three colours with the same variances"
EQUATIONS = "R_d = A sum_i w_i e^(-r^2 / 2 v_i) / (2 pi v_i)"
NOT_FITTED = (
    "A constant without errors was not fitted: a weight of 0, which least squares would make negative, or of 1, since "
    "there is no other."
)
NOTE = f"No error of photons: the light is exact. {NOT_FITTED}"
TRACED_NOTE = (
    "Traced light, since a layer scatters forward: rel, rms and ks contain the photons' noise, and rings have no error "
    f"of nodes. {NOT_FITTED}"
)
ARRAYS = ("edges", "energy", "weight", "noise", "ends")  # of a colour's light; the last A and what is inside [-]
COUNTS = range(1, MOST + 1)
MEASURED = ("rel", "rms", "ks", "alone")  # of red, green and blue
# What tables and pictures take from a record.
TOLD: Kinds = {
    **dict.fromkeys(("title", "equations", "note", "unit"), TEXT),
    "layers": LIST,
    "sums": TABLE,
    "data_digest": DIGEST,
}
OF_LIGHT: Kinds = {
    **dict.fromkeys(("reflectance", "share"), NUMBERS),
    "by_count": LIST,
    "by_count.*": TABLE,
    "by_count.*.result": TEXT,
    "by_count.*.steps": COUNT,
    "by_count.*.condition_number": MEASURE,
    **{f"by_count.*.{name}": NUMBERS for name in MEASURED},
}
SHOWN: Kinds = {
    **TOLD,
    **{f"sums.{light}": TABLE for light in ILLUMINATIONS},
    **{f"sums.{light}.{key}": kind for light in ILLUMINATIONS for key, kind in OF_LIGHT.items()},
}
ROUNDED = 1e-10  # of a sum of weights of twelve digits


@dataclass(frozen=True)
class SumRecord:
    """A record, read. stack  what it is of;  content  all that it says;  path  of its file"""

    stack: LayerStack
    content: Mapping[str, Any]
    path: Path

    def laws(self, illumination: str, count: int = DEFAULT) -> tuple[MediumGaussians, ...]:
        """Of red, green and blue, as `gaussians.alike` fits them."""
        found, units = self.content["sums"][illumination], [one.layers[0].similar.mfp for one in self.stack.media]
        variances, *weights = _values(self.content, illumination, count)
        scaled = (tuple((variances / unit**2).tolist()) for unit in units)
        return tuple(
            MediumGaussians(fit.setting_of(medium, illumination), whole, own, tuple(weight.tolist()))
            for medium, whole, own, weight in zip(self.stack.media, found["reflectance"], scaled, weights, strict=True)
        )

    def lights(self, illumination: str) -> tuple[SumLight, ...]:
        """What red, green and blue were fitted to, edges in the stack's unit; RecordError on damaged arrays."""
        arrays, found = record.read_arrays(self.path), []
        for channel in CHANNELS:
            try:
                edges, energy, weight, noise, ends = (arrays[f"{illumination}_{channel}_{key}"] for key in ARRAYS)
                light = SumLight(edges, energy, weight, float(ends[0]), noise, float(ends[1]))
                sound = edges.shape == (energy.size + 1,) and energy.shape == weight.shape == noise.shape
            except (KeyError, TypeError, IndexError, ValueError):
                sound = False
            if not (sound and np.all(np.diff(edges) > 0) and np.all(energy > 0) and light.whole > 0):
                file = self.path.with_suffix(".npz")
                raise RecordError(f"{file}: is damaged: {illumination}_{channel} is no light in rings; regenerate it")
            found.append(light)
        return tuple(found)


def work(of: StackRequest) -> Work:
    """Fits of the sums of a stack in both lights: a minute. InputError on media without a law."""
    for medium in of.stack.media:
        fit.require(medium)

    def finish(found: list[Any]) -> Made:
        (lights,) = found
        arrays = {f"{light}_{name}": array for light, one in lights.items() for name, array in one["arrays"].items()}
        return _content(of, lights, arrays), arrays

    return Work(f"{SUMS}/{of.name}", (partial(_of_lights, of.stack.media),), finish)


def beside(stack: Path) -> Path | None:
    """The record of sums that belongs to a stack's, FITS/stacks/NAME.json; None where there is none."""
    path = stack.parent.parent / SUMS / stack.name
    return path if path.exists() else None


def load(path: Path) -> SumRecord:
    """A record; RecordError in one line on one that is damaged."""
    content = record.read_of(path, PIPELINE, "sums of Gaussians", SHOWN)
    if text := _mismatched(content):
        raise RecordError(f"{path}: is damaged: {text}; regenerate it")
    record.record_setting(content)
    with damage(path):
        return SumRecord(told_stack(str(path), content, TOLD), content, path)


def _of_lights(media: tuple[Medium, ...]) -> dict[str, dict[str, Any]]:
    """Fit both illuminations in one process, since they share most of the work of the exact light."""
    return {illumination: _of_light(media, illumination) for illumination in ILLUMINATIONS}


def _of_light(media: tuple[Medium, ...], illumination: str) -> dict[str, Any]:
    """All that is recorded of one light."""
    is_traced = any(layer.g > 0 for layer in media[0].layers)
    lights = gaussians.lights_of(media, illumination)
    fewer = None if is_traced else gaussians.lights_of(media, illumination, fit.NODES.fewer)
    constants: dict[str, Any] = {}
    by_count = []
    for count in COUNTS:
        found = gaussians.joint(lights, count)
        values, known = np.append(found.variances, found.weights), errors(found, lights, media, fewer)
        for place, name in enumerate(constant_names(count)):
            constants[f"{count}.{name}"] = {
                **{"published": None, "regenerated": values[place], "free": bool(found.free[place])},
                **{key: None if one is None else one[place] for key, one in known.items()},
            }
        each = [quality(one, found.variances, own) for one, own in zip(lights, found.weights, strict=True)]
        by_count.append(
            {
                "result": found.best.result,
                "steps": found.best.steps,
                "condition_number": found.best.condition_number,
                **{key: [one[key] for one in each] for key in ("rel", "rms", "ks")},
                "alone": [_alone(light, count) for light in lights],
            }
        )
    return {
        "constants": constants,
        "reflectance": [light.whole for light in lights],
        "share": [float(np.sum(light.energy[light.weight > 0])) / light.whole for light in lights],
        "by_count": by_count,
        "arrays": {
            f"{channel}_{key}": array
            for channel, light in zip(CHANNELS, lights, strict=True)
            for key, array in zip(ARRAYS, _arrays(light), strict=True)
        },
    }


def _arrays(light: SumLight) -> tuple[np.ndarray, ...]:
    return light.edges, light.energy, light.weight, light.noise, np.array([light.whole, light.inside])


def _alone(light: SumLight, count: int) -> float:
    """rel where a colour has variances of its own."""
    found = gaussians.joint([light], count)
    return quality(light, found.variances, found.weights[0])["rel"]


def _content(of: StackRequest, found: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> dict[str, Any]:
    first = of.stack.media[0].layers[0]
    is_traced = any(layer.g > 0 for layer in of.stack.media[0].layers)
    results = [one["result"] for of_light in found.values() for one in of_light["by_count"]]
    of_default = [of_light["by_count"][DEFAULT - 1] for of_light in found.values()]
    return {
        "title": TITLE,
        "law": PIPELINE,
        "pipeline": PIPELINE,
        "equations": EQUATIONS,
        "note": TRACED_NOTE if is_traced else NOTE,
        "setting": Setting(of.illumination, n=first.n, g=first.g),
        "unit": of.stack.unit,
        "layers": of.stack.layers,
        "constants": {
            f"{light}.{name}": value for light, one in found.items() for name, value in one["constants"].items()
        },
        "fit": {"result": next((one for one in results if one != "converged"), "converged")},
        "quality": {"regenerated": {key: [v for one in of_default for v in one[key]] for key in ("rel", "ks")}},
        "sums": {
            light: {key: one[key] for key in ("reflectance", "share", "by_count")} for light, one in found.items()
        },
        "truth": {"kind": "photons" if is_traced else "exact"},
        "preset": "quick",
        "seed": gaussians.SEED,
        "versions": record.versions(),
        "data_digest": record.digest(*(arrays[name] for name in sorted(arrays))),
    }


def _values(content: Mapping[str, Any], illumination: str, count: int) -> np.ndarray:
    """(4, N): variances [unit^2], then weights of red, green and blue [-]."""
    of = content["constants"]
    found = [float(of[f"{illumination}.{count}.{name}"]["regenerated"]) for name in constant_names(count)]
    return np.reshape(found, (1 + len(CHANNELS), count))


def _mismatched(content: Mapping[str, Any]) -> str | None:
    """Lists that must be as long as others, constants that must be there, and make a sum."""
    for light in ILLUMINATIONS:
        one = content["sums"][light]
        if len(one["by_count"]) != MOST:
            return f"sums.{light}.by_count must be {MOST}, one a number of Gaussians, got {len(one['by_count'])}"
        lists = {key: one[key] for key in ("reflectance", "share")}
        lists |= {f"by_count.{i}.{key}": each[key] for i, each in enumerate(one["by_count"]) for key in MEASURED}
        for key, values in lists.items():
            if len(values) != len(CHANNELS):
                return f"sums.{light}.{key} must be {len(CHANNELS)}, one a colour, got {len(values)}"
        if not all(0 < value <= 1 for value in one["reflectance"]):
            return f"sums.{light}.reflectance must be in (0, 1]"
        for count in COUNTS:
            names = (f"{light}.{count}.{name}" for name in constant_names(count))
            if missing := next((name for name in names if name not in content["constants"]), None):
                return f"constants.{missing} must be a table, got nothing"
            variances, *weights = _values(content, light, count)
            if not (variances[0] > 0 and np.all(np.diff(variances) > 0)):
                return f"constants.{light}.{count}.v1 and on must rise from above 0"
            if not all(np.all(own >= 0) and abs(np.sum(own) - 1) < ROUNDED for own in weights):
                return f"constants.{light}.{count}: weights of a colour must be >= 0 and sum to 1"
    return None

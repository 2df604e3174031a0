"""Sums of 1 to 8 Gaussians of a stack in both lights, three colours sharing variances: their record, and back to laws.

Records lie in a folder of their own, FITS/gaussians, each beside the arrays of the light that it was fitted to.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, model_validator

from mcml_sim import Medium
from mcml_sim.media.setting import ILLUMINATIONS
from profilefit.errors import InputError, RecordError
from profilefit.laws.gaussians import DEFAULT, MOST, MediumGaussians
from profilefit.materials import CHANNELS
from profilefit.recipes import record
from profilefit.recipes.declared import Keys, Refused, Table, words
from profilefit.recipes.folder import SUMS
from profilefit.recipes.kinds.stack import StackRequest, Thickness, header, recorded_stack, request
from profilefit.recipes.record import SOLVED, Count, Digest, LawRecord, damage
from profilefit.recipes.run import LAWS, RecipeRun, RecordContent, Work
from profilefit.recipes.stack import fit as stacks
from profilefit.recipes.stack import gaussians
from profilefit.recipes.stack.file import LayerStack
from profilefit.recipes.stack.fit import Tracing
from profilefit.recipes.stack.gaussians import SumLight, constant_names, errors, quality

__all__ = ["find", "fit", "quality", "read", "request"]
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
ROUNDED = 1e-10  # of a sum of weights of twelve digits
EACH = Field(min_length=len(CHANNELS), max_length=len(CHANNELS))
Colours = Annotated[list[float], EACH, words("a list of 3 numbers, one a colour")]
Shares = Annotated[
    list[Annotated[float, Field(gt=0, le=1)]], EACH, words("a list of 3 numbers in (0, 1], one a colour")
]
Summed = Annotated[Table, Keys(**SOLVED, steps=Count, **dict.fromkeys(MEASURED, Colours))]
SUMS_OF_LIGHT = Keys(reflectance=Shares, share=Colours, by_count=list[Summed])


class ShownSums(LawRecord):
    """Record with what tables and pictures take from sums of Gaussians."""

    title: str
    equations: str
    note: str
    unit: str
    layers: list[Thickness]
    sums: Annotated[Table, Keys(**dict.fromkeys(ILLUMINATIONS, SUMS_OF_LIGHT))]
    data_digest: Digest

    @model_validator(mode="after")
    def _complete(self) -> Self:
        """Refuse a record without a sum of each number of Gaussians, or with constants that make no sum."""
        for light, sums in self.sums.items():
            if len(sums["by_count"]) != MOST:
                raise Refused(f"{MOST}, one a number of Gaussians", len(sums["by_count"]), "sums", light, "by_count")
            for count in COUNTS:
                self.require_constants(f"{light}.{count}.{name}" for name in constant_names(count))
                variances, *weights = _values(self.constants, light, count)
                if not (variances[0] > 0 and np.all(np.diff(variances) > 0)):
                    raise InputError(f"constants.{light}.{count}.v1 and on must rise from above 0")
                if not all(np.all(own >= 0) and abs(np.sum(own) - 1) < ROUNDED for own in weights):
                    raise InputError(f"constants.{light}.{count}: weights of a colour must be >= 0 and sum to 1")
        return self


@dataclass(frozen=True)
class SumRecord:
    """Record of the sums of a stack: its layers, all that it says, and its file."""

    stack: LayerStack
    content: Mapping[str, Any]
    path: Path

    def laws(self, illumination: str, count: int = DEFAULT) -> tuple[MediumGaussians, ...]:
        """Return the sums of red, green and blue, as `gaussians.shared_gaussians` fits them."""
        variances, *weights = _values(self.content["constants"], illumination, count)
        whole = self.content["sums"][illumination]["reflectance"]
        return tuple(
            gaussians.medium_sum(medium, illumination, one, variances, own)
            for medium, one, own in zip(self.stack.media, whole, weights, strict=True)
        )

    def lights(self, illumination: str) -> tuple[SumLight, ...]:
        """Return the light that red, green and blue were fitted to, edges in the stack's unit.

        RecordError on damaged arrays.
        """
        arrays, lights = record.read_arrays(self.path), []
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
            lights.append(light)
        return tuple(lights)


def find(name: str, folder: Path) -> SumRecord | None:
    """Return the sums of a stack by the path of their record or by name in a folder; None where there are none."""
    path = record.named(name, folder / SUMS, PIPELINE)
    return None if path is None else load(path)


def fit(of: StackRequest, run: RecipeRun) -> Work:
    """Return the record to be made of a stack in both lights, in one part: a minute. InputError if no law fits."""
    for medium in of.media:
        stacks.require(medium)

    def finish(results: list[Any]) -> RecordContent:
        (lights,) = results
        arrays = {f"{light}_{name}": array for light, one in lights.items() for name, array in one["arrays"].items()}
        return _content(of, run, lights, arrays), arrays

    part = partial(_of_lights, of.media, Tracing.of(run, f"{of.name}-sums", of.media[0]))
    return Work(f"{SUMS}/{of.name}", (part,), finish, order=(LAWS, 1, 1))


def read(path: Path) -> dict[str, Any]:
    """Return all that a record says; RecordError on one that is damaged."""
    return dict(load(path).content)


def beside(stack: Path) -> Path | None:
    """Return the record of sums that belongs to a stack's, FITS/stacks/NAME.json; None where there is none."""
    path = stack.parent.parent / SUMS / stack.name
    return path if path.exists() else None


def load(path: Path) -> SumRecord:
    """Return a record; RecordError in one line on one that is damaged."""
    content = record.read_of(path, PIPELINE, "a record of sums of Gaussians", ShownSums)
    record.record_setting(content)
    with damage(path):
        return SumRecord(recorded_stack(str(path), content), content, path)


def _of_lights(media: tuple[Medium, ...], tracing: Tracing) -> dict[str, dict[str, Any]]:
    """Fit both illuminations in one process, since they share most of the work of the exact light."""
    return {illumination: _of_light(media, illumination, tracing) for illumination in ILLUMINATIONS}


def _of_light(media: tuple[Medium, ...], illumination: str, tracing: Tracing) -> dict[str, Any]:
    """Fit one light, and return all that is recorded of it."""
    is_traced = any(layer.g > 0 for layer in media[0].layers)
    lights = gaussians.lights_of(media, illumination, tracing=tracing)
    fewer = None if is_traced else gaussians.lights_of(media, illumination, stacks.NODES.fewer)
    constants: dict[str, Any] = {}
    by_count = []
    for count in COUNTS:
        fitted = gaussians.joint(lights, count)
        values, known = np.append(fitted.variances, fitted.weights), errors(fitted, lights, media, fewer)
        for place, name in enumerate(constant_names(count)):
            constants[f"{count}.{name}"] = {
                **{"published": None, "regenerated": values[place], "free": bool(fitted.free[place])},
                **{key: None if one is None else one[place] for key, one in known.items()},
            }
        each = [quality(one, fitted.variances, own) for one, own in zip(lights, fitted.weights, strict=True)]
        own = [(light, gaussians.joint([light], count)) for light in lights]
        by_count.append(
            {
                **{key: getattr(fitted.best, key) for key in ("result", "steps", "condition_number")},
                **{key: [one[key] for one in each] for key in ("rel", "rms", "ks")},
                # rel where a colour has variances of its own.
                "alone": [quality(light, one.variances, one.weights[0])["rel"] for light, one in own],
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
            for key, array in zip(ARRAYS, (*light[:3], light.noise, np.array([light.whole, light.inside])), strict=True)
        },
    }


def _content(
    of: StackRequest, run: RecipeRun, lights: Mapping[str, Any], arrays: Mapping[str, np.ndarray]
) -> dict[str, Any]:
    of_default = [of_light["by_count"][DEFAULT - 1] for of_light in lights.values()]
    return {
        **header(of, run, PIPELINE, EQUATIONS, (NOTE, TRACED_NOTE)),
        "title": TITLE,
        "constants": {
            f"{light}.{name}": value for light, one in lights.items() for name, value in one["constants"].items()
        },
        "fit": {"result": record.first_failure([one["result"] for of in lights.values() for one in of["by_count"]])},
        "quality": {"regenerated": {key: [v for one in of_default for v in one[key]] for key in ("rel", "ks")}},
        "sums": {
            light: {key: one[key] for key in ("reflectance", "share", "by_count")} for light, one in lights.items()
        },
        "seed": gaussians.OFFSET + run.seed,
        "data_digest": record.digest(*(arrays[name] for name in sorted(arrays))),
    }


def _values(constants: Mapping[str, Any], illumination: str, count: int) -> np.ndarray:
    """Return (4, N): variances [unit^2], then weights of red, green and blue [-]."""
    values = [float(constants[f"{illumination}.{count}.{name}"]["regenerated"]) for name in constant_names(count)]
    return np.reshape(values, (1 + len(CHANNELS), count))

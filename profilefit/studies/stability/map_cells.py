"""Maps between alpha and A, both ways, in all arithmetics, against the exact half space; and lengths, to and fro."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from mcml_sim import exact
from mcml_sim.media.arrays import Floats
from profilefit.convert import LENGTHS, Optical, alpha_of, reflectance_of
from profilefit.errors import InputError
from profilefit.laws.base import AlbedoLaw, Range
from profilefit.recipes.catalogue import LoadedLaw
from profilefit.recipes.record import Folder
from profilefit.shader.check import bounds
from profilefit.studies.stability import cells
from profilefit.studies.stability.cells import ArgumentAxis, Cells, RoundedText, Verdict, absolute, axis, steps_down

FACTOR = 1.5  # of what a record states
# Against the exact half space: of A, and of sqrt(1 - alpha), in which every law of alpha is smooth.
MODEL_BOUND = 0.02
ROOT_STORED = "A(√(1−α))"
WAYS = {cells.ALPHA_OF: "delta_alpha", cells.REFLECTANCE_OF: "delta_A"}  # measures in records
OF_MAPS = (
    "use the rational map, which rises to alpha(1) = 1 and misses A by 3e-6; others need A clamped below their fold"
)
UNSTATED = "no record states the error of this direction"


def cells_of(named: LoadedLaw, folder: Folder) -> Iterator[Cells]:
    """Yield both directions in every arithmetic, then what keeping alpha or its root in half costs."""
    model, spans = bounds.model_of_map(named, folder), bounds.valid_map(named, folder)
    for (name, measure), span in zip(WAYS.items(), spans, strict=True):
        limit = bounds.ROUNDING_SHARE * (model.get(measure) or np.inf)
        for arithmetic in (cells.FLOAT64, cells.FLOAT32, cells.TEXT32, cells.TEXT16):
            at = cells.unit_axis("A" if name == cells.ALPHA_OF else "α", cells.DTYPES[arithmetic])
            value = _value(named.law, name, arithmetic, at)
            reference = _text_value(named.law, cells.EXTENDED, name, at.values)
            yield _cells(named, name, arithmetic, at, value, reference, limit=limit, span=span)
    yield from _kept_in_half(named, spans[1])
    if named.setting.is_solved:
        yield from _against_exact(named, *spans, model)


def _cells(
    named: LoadedLaw, name: str, arithmetic: str, at: ArgumentAxis, *values: Floats, limit: float, span: Range
) -> Cells:
    """Return the cells of one direction, of value, reference and error, by default |value - reference|."""
    value, reference = values[:2]
    error = values[2] if len(values) > 2 else absolute(value, reference)
    inside, falls = span.holds(at.values), steps_down(value, 0, cells.DTYPES[arithmetic], 1.0)
    given = map_label(named), named.law.entry.own, name, arithmetic, (at,), value, reference, error, limit, inside
    advice = OF_MAPS if arithmetic in cells.HELD else ""
    return Cells(*given, judge=inside, wrong_way=falls, unjudged=UNSTATED, advice=advice)


def map_label(named: LoadedLaw) -> str:
    """Return the label of a map, apart from the law of its name."""
    return named.label if named.records else f"map {named.label}"


def _value(law: AlbedoLaw, name: str, arithmetic: str, at: ArgumentAxis) -> Floats:
    given: Any = at.values
    if arithmetic in (cells.TEXT32, cells.TEXT16):
        return _text_value(law, cells.DTYPES[arithmetic], name, given)
    if arithmetic == cells.FLOAT32:
        law = jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.float32), law)
        given = jnp.asarray(given, jnp.float32)
    with np.errstate(all="ignore"):
        return np.asarray(cells.functions_of(law)[name](given), float)


def _text_value(law: AlbedoLaw, dtype: type, name: str, given: Any) -> Floats:
    return np.asarray(RoundedText(law, dtype).call(name, given), float)


def _kept_in_half(named: LoadedLaw, span: Range) -> Iterator[Cells]:
    """Yield A where alpha, or its root, is kept in half and the map is computed in single precision."""
    at = cells.unit_axis("α", np.float32)
    reference = _text_value(named.law, cells.EXTENDED, cells.REFLECTANCE_OF, at.values)
    half = at.values.astype(np.float16).astype(np.float32)
    root = np.sqrt(1.0 - at.values).astype(np.float16).astype(np.float32)
    for name, alpha in ((cells.REFLECTANCE_OF, half), (ROOT_STORED, (1.0 - root) * (1.0 + root))):
        value = _text_value(named.law, np.float32, cells.REFLECTANCE_OF, alpha)
        yield _cells(named, name, cells.STORED16, at, value, reference, limit=cells.HALF_BOUND, span=span)


def _against_exact(named: LoadedLaw, colours: Range, albedos: Range, model: bounds.ModelError) -> Iterator[Cells]:
    """Yield the errors in A and in sqrt(1 - alpha), at albedos even in the latter."""
    root = np.linspace(1.0, 0.0, 41)
    alpha = axis("α", 1.0 - root**2)
    reflectance, law = axis("A", np.asarray(exact.reflectance(alpha.values, setting=named.setting))), named.law
    with np.errstate(all="ignore"):
        back, there = np.asarray(law.alpha(reflectance.values)), np.asarray(law.reflectance(alpha.values))
    stated = model.get(WAYS[cells.REFLECTANCE_OF]) or np.nan
    bound = min(MODEL_BOUND, FACTOR * stated) if named.law.entry.own else MODEL_BOUND  # ours as their records
    of_alpha, of_colour = (alpha, there, reflectance.values), (reflectance, back, alpha.values)
    yield _cells(named, cells.REFLECTANCE_OF, cells.MODEL, *of_alpha, limit=bound, span=albedos)
    error = np.abs(np.sqrt(np.clip(1.0 - back, 0.0, None)) - root)
    yield _cells(named, cells.ALPHA_OF, cells.MODEL, *of_colour, error, limit=MODEL_BOUND, span=colours)


# There and back: a few roundings; a colour to what `alpha_of` promises of A.
RETURN_BOUND, COLOUR_BOUND = 1e-12, 1e-8


def conversion_cells() -> Iterator[Cells]:
    """Yield lengths in order of `convert.LENGTHS`, then colours under both lights."""
    for length in LENGTHS:
        yield _length(length.name)
    for light in ("searchlight", "diffuse"):
        yield _colour(light)


def _length(name: str) -> Cells:
    """Return l = 1 there and back: infinite lengths, where nothing is absorbed, are refused by name on the way back."""
    at = cells.unit_axis("α", np.float64)
    with np.errstate(all="ignore"):
        value = np.asarray(Optical(at.values, np.array(1.0)).length(name))
        back = np.where(np.isinf(value), 1.0, np.nan)
        for i, length in enumerate(value):
            with contextlib.suppress(InputError):
                back[i] = Optical.from_length(name, length, at.values[i]).mfp
    infinite = np.isinf(value) & (at.values == 1.0)
    error, reference = np.where(infinite, 0.0, np.abs(back - 1.0)), np.where(infinite, np.inf, value)
    made = Cells("convert", False, name, cells.FLOAT64, (at,), value, reference, error, RETURN_BOUND)
    made.codes[(value == 0) | np.isnan(back)] = Verdict.NOT_FINITE
    return made


def _colour(light: str) -> Cells:
    at = cells.unit_axis("A", np.float64)
    value = np.full(at.values.size, np.nan)  # where something is raised: every A in [0, 1] has an alpha
    for i, reflectance in enumerate(at.values):
        with contextlib.suppress(Exception):  # whatever comes is what is looked for
            value[i] = alpha_of(reflectance, light)
    raised = np.isnan(value)
    error = np.abs(reflectance_of(np.where(raised, 0.0, value), light) - at.values)
    given = "convert", False, f"{cells.ALPHA_OF}, {light}", cells.FLOAT64, (at,), value, value, error, COLOUR_BOUND
    made = Cells(*given, wrong_way=steps_down(value, 0, np.float64, 1.0))
    made.codes[raised] = Verdict.RAISES
    return made

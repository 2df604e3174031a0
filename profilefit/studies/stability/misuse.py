"""Arguments that nothing allows: refused by an error that names them, or else clamped to a number."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from mcml_sim import exact
from profilefit.convert import BY_NAME, Optical, alpha_of
from profilefit.errors import InputError
from profilefit.laws.base import AlbedoLaw
from profilefit.recipes.catalogue import LoadedLaw
from profilefit.studies.stability import cells
from profilefit.studies.stability.cells import Cells, RoundedText, Verdict, functions_of
from profilefit.studies.stability.map_cells import map_label

NAN, INF = float("nan"), float("inf")
Case = tuple[str, str, float]
"""Symbol, keyword and value of what is wrong in an otherwise ordinary call."""
Call = Callable[[str, float], Any]
"""Keyword and value of a case -> the function called with it."""
SHARES: tuple[float, ...] = (-0.1, 1.1, NAN, INF, -INF)
LENGTHS: tuple[float, ...] = (0.0, -0.0, -1.0, NAN, INF)
RADII: tuple[float, ...] = (-1.0, NAN, -INF)
ALBEDO, LENGTH, COLOUR = ("α", "alpha", SHARES), ("l", "mfp", LENGTHS), ("A", "reflectance", SHARES)
ARGUMENTS = {
    **dict.fromkeys((cells.PROFILE, cells.CDF, cells.PDF), (("r", "r", RADII), ALBEDO, LENGTH)),
    cells.SAMPLE: (("ξ", "xi", SHARES), ALBEDO, LENGTH),
    **{cells.ALPHA_OF: (COLOUR,), cells.REFLECTANCE_OF: (ALBEDO,)},
}
ORDINARY = {"r": 1.0, "xi": 0.5, "alpha": 0.5, "mfp": 1.0, "reflectance": 0.5}
CHECK = "check alpha in [0, 1], l > 0 and r >= 0 once a material, as the law in Python does: a shader refuses nothing"


def of_law(named: LoadedLaw) -> Iterator[Cells]:
    """Yield each function of a profile law, in Python and by its shader source, or both directions of a map."""
    law, own = named.law, named.law.entry.own
    text = None if isinstance(law, AlbedoLaw) else RoundedText(law, np.float32)
    label = map_label(named) if text is None else named.label
    for name, function in functions_of(law).items():
        yield _refused(label, own, name, function)
        if text is not None:
            yield _clamped(label, own, name, cases_of(name), text)


def of_exact() -> Iterator[Cells]:
    """Yield each function of the exact half space."""
    functions: tuple[Callable[..., Any], ...] = (exact.profile, exact.cdf, exact.quantile, exact.reflectance)
    for name, function in zip((*cells.QUANTITIES[:3], cells.REFLECTANCE_OF), functions, strict=True):
        yield _refused("exact", True, name, function)


def of_convert() -> Iterator[Cells]:
    """Yield media from albedo, length, coefficients and colour."""
    one = np.array(1.0)
    calls: list[tuple[str, list[Case], Call]] = [
        ("medium", _cases(ALBEDO), lambda _, value: Optical(np.array(value), one)),
        ("medium of l", _cases(LENGTH), lambda _, value: Optical(np.array(0.5), np.array(value))),
        (cells.ALPHA_OF, _cases(COLOUR), lambda _, value: alpha_of(value, "diffuse")),
        *(
            (name, _cases((name, name, LENGTHS)), lambda key, value: Optical.from_length(key, value, 0.5))
            for name in BY_NAME
        ),
    ]
    yield from (refusals("convert", False, *call) for call in calls)


def _cases(*arguments: tuple[str, str, tuple[float, ...]]) -> list[Case]:
    return [(symbol, key, value) for symbol, key, values in arguments for value in values]


def cases_of(name: str) -> list[Case]:
    """Return what is tried of each argument of a function."""
    return _cases(*ARGUMENTS[name])


def _given(name: str, key: str, value: float) -> dict[str, float]:
    return {word: ORDINARY[word] for _, word, _ in ARGUMENTS[name]} | {key: value}


def _refused(subject: str, own: bool, name: str, function: Callable[..., Any]) -> Cells:
    return refusals(subject, own, name, cases_of(name), lambda key, value: function(**_given(name, key, value)))


def refusals(subject: str, own: bool, name: str, cases: list[Case], call: Call) -> Cells:
    """Return cells that are red where no error comes, or another than InputError that names the argument."""
    codes = np.full(len(cases), Verdict.INACCURATE, np.int8)
    for i, (_, key, value) in enumerate(cases):
        try:
            call(key, value)
        except InputError as error:
            codes[i] = Verdict.OUTSIDE if key in str(error) else Verdict.RAISES
        except Exception:  # whatever else comes is what is looked for
            codes[i] = Verdict.RAISES
    return _cells(subject, own, name, cells.FLOAT64, cases, codes, np.full(len(cases), np.nan))


def _clamped(subject: str, own: bool, name: str, cases: list[Case], text: RoundedText) -> Cells:
    """Return cells of a text, which cannot refuse: it owes a number, but for NaN, which comes back as such."""
    given = [np.array(list(_given(name, key, value).values()))[:, None] for _, key, value in cases]
    results = np.array([float(text.call(name, *each)[0]) for each in given])
    is_fine = np.isfinite(results) | np.isnan([value for *_, value in cases]) & np.isnan(results)
    codes = np.where(is_fine, Verdict.OUTSIDE, Verdict.NOT_FINITE).astype(np.int8)
    return _cells(subject, own, name, cells.TEXT32, cases, codes, results)


def _cells(subject: str, own: bool, name: str, arithmetic: str, cases: list[Case], codes: Any, value: Any) -> Cells:
    axes = (cells.labelled("of", (f"{symbol} = {value:g}" for symbol, _, value in cases)),)
    given = value, np.array(np.nan), np.array(np.nan), np.inf, arithmetic == cells.FLOAT64, codes
    return Cells(subject, own, f"{name}, misused", arithmetic, axes, *given, advice=CHECK)

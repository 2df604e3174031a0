"""Arguments that nothing allows: refused by an error that names them, or else clamped to a number."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from mcml_sim import exact
from profilefit.convert import BY_NAME, Optical, alpha_of
from profilefit.errors import InputError
from profilefit.laws.base import AlbedoLaw, ProfileLaw
from profilefit.recipes.catalogue import Named
from profilefit.studies.stability.cells import Cells, RoundedText, Verdict
from profilefit.studies.stability.layout import (
    ALPHA_OF,
    CDF,
    FLOAT64,
    PDF,
    PROFILE,
    REFLECTANCE_OF,
    SAMPLE,
    TEXT32,
    ArgumentAxis,
)

NAN, INF = float("nan"), float("inf")
Case = tuple[str, str, float]
SHARES: tuple[float, ...] = (-0.1, 1.1, NAN, INF, -INF)
LENGTHS: tuple[float, ...] = (0.0, -0.0, -1.0, NAN, INF)
RADII: tuple[float, ...] = (-1.0, NAN, -INF)
# Symbol, keyword and value of what is wrong in an otherwise ordinary call.
FIRST = {PROFILE: ("r", "r", RADII), CDF: ("r", "r", RADII), PDF: ("r", "r", RADII), SAMPLE: ("ξ", "xi", SHARES)}
ORDINARY = {"r": 1.0, "xi": 0.5, "alpha": 0.5, "mfp": 1.0}


def of_law(one: Named) -> Iterator[Cells]:
    """Each function of a profile law, in Python and by its text."""
    law: ProfileLaw = one.law
    calls: dict[str, Callable[..., Any]] = {
        PROFILE: law.profile,
        CDF: law.cdf,
        SAMPLE: law.sampler.sample,
        PDF: law.sampler.pdf,
    }
    own = law.entry.own
    text = RoundedText(law, np.float32)
    for name, call in calls.items():
        in_python = refusals(one.label, own, name, cases_of(name), partial(_called, call, name))
        yield in_python
        refused = in_python.codes == Verdict.OUTSIDE
        yield replace(_clamped(one.label, own, name, cases_of(name), text), refused=refused)


def of_map(one: Named) -> Iterator[Cells]:
    """Both directions of a map."""
    law: AlbedoLaw = one.law
    label = one.label if one.records else f"map {one.label}"
    ways: tuple[tuple[str, Case, Callable[..., Any]], ...] = (
        (ALPHA_OF, ("A", "reflectance", 0.0), law.alpha),
        (REFLECTANCE_OF, ("α", "alpha", 0.0), law.reflectance),
    )
    for name, (symbol, key, _), call in ways:
        cases = [(symbol, key, value) for value in SHARES]
        yield refusals(label, law.entry.own, name, cases, partial(_alone, call))


def of_exact() -> Iterator[Cells]:
    """Each function of the exact half space."""
    calls: dict[str, Callable[..., Any]] = {PROFILE: exact.profile, CDF: exact.cdf, SAMPLE: exact.quantile}
    for name, call in calls.items():
        yield refusals("exact", True, name, cases_of(name), partial(_called, call, name))
    cases = [("α", "alpha", value) for value in SHARES]
    yield refusals("exact", True, REFLECTANCE_OF, cases, partial(_alone, exact.reflectance))


def of_convert() -> Iterator[Cells]:
    """Media from albedo, length, coefficients and colour."""
    shares, lengths = ([(s, k, v) for v in values] for s, k, values in (("α", "alpha", SHARES), ("l", "mfp", LENGTHS)))
    yield refusals("convert", False, "medium", shares, lambda _, value: Optical(np.array(value), np.array(1.0)))
    yield refusals("convert", False, "medium of l", lengths, lambda _, value: Optical(np.array(0.5), np.array(value)))
    cases = [("A", "reflectance", value) for value in SHARES]
    yield refusals("convert", False, ALPHA_OF, cases, lambda _, value: alpha_of(value, "diffuse"))
    for name in BY_NAME:
        given = [(name, name, value) for value in LENGTHS]
        yield refusals("convert", False, name, given, lambda key, value: Optical.from_length(key, value, 0.5))


def _called(call: Callable[..., Any], name: str, key: str, value: float) -> Any:
    return call(**_given(name, key, value))


def _alone(call: Callable[..., Any], key: str, value: float) -> Any:
    del key
    return call(value)


def cases_of(name: str) -> list[Case]:
    symbol, key, values = FIRST[name]
    arguments = ((symbol, key, values), ("α", "alpha", SHARES), ("l", "mfp", LENGTHS))
    return [(mark, word, value) for mark, word, group in arguments for value in group]


def _given(name: str, key: str, value: float) -> dict[str, float]:
    return {word: ORDINARY[word] for word in (FIRST[name][1], "alpha", "mfp")} | {key: value}


def _axis(cases: list[Case]) -> ArgumentAxis:
    labels = tuple(f"{symbol} = {value:g}" for symbol, _, value in cases)
    return ArgumentAxis("of", "-", np.arange(len(cases), dtype=float), labels)


def refusals(subject: str, own: bool, name: str, cases: list[Case], call: Callable[[str, float], Any]) -> Cells:
    """Red where no error comes, or another than InputError that names the argument."""
    codes = np.array([_outcome(call, key, value) for _, key, value in cases], np.int8)
    return _cells(subject, own, name, FLOAT64, cases, codes, np.full(len(cases), np.nan))


def _outcome(call: Callable[[str, float], Any], key: str, value: float) -> Verdict:
    try:
        call(key, value)
    except InputError as error:
        return Verdict.OUTSIDE if key in str(error) else Verdict.RAISES
    except Exception:  # whatever else comes is what is looked for
        return Verdict.RAISES
    return Verdict.INACCURATE


def _clamped(subject: str, own: bool, name: str, cases: list[Case], text: RoundedText) -> Cells:
    """A text cannot refuse: a number is what it owes, but for NaN, which comes back as such."""
    function = "profile" if name == PROFILE else name
    given = [np.array(list(_given(name, key, value).values()))[:, None] for _, key, value in cases]
    found = np.array([float(text.call(function, *each)[0]) for each in given])
    values = np.array([value for _, _, value in cases])
    codes = np.where(np.isfinite(found), Verdict.OUTSIDE, Verdict.NOT_FINITE).astype(np.int8)
    codes[np.isnan(values) & np.isnan(found)] = Verdict.OUTSIDE
    return _cells(subject, own, name, TEXT32, cases, codes, found)


def _cells(subject: str, own: bool, name: str, arithmetic: str, cases: list[Case], codes, value) -> Cells:
    nothing = np.full(len(cases), np.nan)
    held = np.full(len(cases), arithmetic == FLOAT64)
    return Cells(
        subject,
        own,
        f"{name}, misused",
        arithmetic,
        (_axis(cases),),
        value,
        nothing,
        nothing,
        np.inf,
        held,
        codes,
    )

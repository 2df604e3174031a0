"""Every law on one axis: how far each is from the exact half space, by albedo; maps and samplers likewise."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from rich.console import RenderableType
from rich.text import Text

from mcml_sim.media.arrays import Floats
from mcml_sim.media.setting import Setting
from profilefit.fitting.quality import MEASURES, OF_MAP, AlbedoQuality, Quality, albedo_quality, profile_quality
from profilefit.fitting.sampling import LAST_SHARE, ExactTarget, SamplerQuality, drawn_by, sampler_quality
from profilefit.recipes.catalogue import LoadedLaw, Names, albedo_laws, profile_laws, sampled_laws
from profilefit.recipes.folder import EVIDENCE
from profilefit.recipes.pipelines import QUALITY_ALBEDOS
from profilefit.recipes.record import Folder, Records
from profilefit.recipes.targets import albedo_values
from profilefit.report.tables.cells import SEARCHLIGHT, column_table, on_the_point, row_table, significant, span, spark
from profilefit.report.tables.check_tables import markdown_check
from profilefit.report.tables.claims_table import markdown_claims
from profilefit.report.tables.markdown import markdown_table
from profilefit.report.tables.quality_tables import albedo_number

Measured = TypeVar("Measured")
Track = Callable[[Iterator[Any], str, int], Iterator[Any]]
"""Items as they come, what they are, how many -> the items, as they are shown to come."""
# Where laws are judged: held-out albedos. Samplers take longer and hardly change with alpha.
ALBEDOS = np.asarray(albedo_values(QUALITY_ALBEDOS))
SAMPLED_ALBEDOS = (0.1, 0.5, 0.9)
# A law without a shader source is a quadrature of tens of milliseconds, which its sampler inverts in many steps: one
# albedo will do.
SLOW_ALBEDOS = (0.5,)
SHARES = 256


@dataclass(frozen=True)
class MeasuredSampler:
    """One sampler of a law.

    quality      for the light of the law itself, at reduced albedos, its lengths in l*
    exact_error  (m,) max over xi in [0, 0.999] of |exact cdf(r(xi)) - xi| at the same albedos [-]; of two xi that draw
                 one radius, the one meant
    """

    of: LoadedLaw
    name: str
    quality: SamplerQuality
    exact_error: Floats


def for_each(
    measure: Callable[[LoadedLaw], Measured], laws: Sequence[LoadedLaw], track: Track | None = None, title: str = ""
) -> list[tuple[LoadedLaw, Measured]]:
    """Measure every law, in order, side by side: most of it is compiling and small arrays, which take one core."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        results = pool.map(measure, laws)
        return list(zip(laws, track(results, title, len(laws)) if track else results, strict=True))


def measured_samplers(named: LoadedLaw, alpha: Sequence[float] | None = None) -> list[MeasuredSampler]:
    """Return every sampler of a profile law at `alpha` (m,)."""
    albedos = alpha or (SAMPLED_ALBEDOS if named.law.entry.has_text else SLOW_ALBEDOS)
    samplers, xi, target = [], np.linspace(0.0, LAST_SHARE, SHARES), ExactTarget(named.setting)
    for name, sampler in named.law.samplers.items():
        errors = []
        for value in albedos:
            drawn = drawn_by(sampler, xi, float(value), target)
            errors.append(np.max(np.abs(drawn - xi)))
        samplers.append(MeasuredSampler(named, name, sampler_quality(sampler, albedos), np.array(errors)))
    return samplers


INFINITE = "∞"
NEGLIGIBLE = 5e-6  # a draw from 2^24 steps and the quadrature know no better
# Header and measure; the two "by law" are of a shader that takes the law's density for the sampler's.
COLUMNS = {
    "inversion": "inversion_error",
    "atom": "atom",
    "even\nown": "bias",
    "even\nlaw": "bias_by_law_pdf",
    "edge\nown": "edge_bias",
    "edge\nlaw": "edge_bias_by_law_pdf",
    "variance": "variance",
}
CAPTION = (
    "inversion: max |cdf(r(ξ)) − ξ|, ξ ≤ 0.999; atom: share of samples at one radius; even, edge: relative error under "
    "even illumination and beside its edge, with the pdf of the sampler (own) or of the model (law); variance: of the "
    "weight of one sample, with the pdf of the sampler"
)


def sampler_tables(qualities: Mapping[str, SamplerQuality]) -> list[RenderableType]:
    """Return a table a sampler, by albedo, the worst last; what the columns are stands under the last."""
    parts: list[RenderableType] = []
    for name, quality in qualities.items():
        columns = {"α": [*(f"{alpha:.3f}" for alpha in quality.alpha), "worst"]}
        for header, measure in COLUMNS.items():
            values = getattr(quality, measure)
            columns[header] = on_the_point([*(sampler_number(float(value)) for value in values), _worst(values)])
        caption = CAPTION if len(parts) == len(qualities) - 1 else ""
        parts.append(column_table(f"Sampler: {name}", columns, caption, left=("α",)))
    return parts


def _worst(values: Floats) -> str:
    return sampler_number(float(values[np.argmax(np.abs(values))]))


def sampler_number(value: float) -> str:
    """Return a measure of a sampler as text."""
    if abs(value) < NEGLIGIBLE:
        return "0"
    if math.isinf(value):
        return INFINITE if value > 0 else f"-{INFINITE}"
    return significant(value)


PERCENT, BILLIONTHS = 100.0, 1e9
SHOWN, SPARK = 3, 12  # albedos in columns, and characters of a sparkline over all of them
# Measures of a profile, and the factor and unit with which their columns fit a line.
SCALES: Mapping[str, tuple[float, str]] = {
    **dict.fromkeys(("rel", "ks", "l1"), (PERCENT, " [%]")),
    "mse": (BILLIONTHS, " [1e-9 / mfp²]"),
    "r2": (1.0, ""),
}
MAP_HEADERS = ("map", "light", "n", "δA", "δα", "√(1-α)", "rises", "α(1)", "fold", "α(0)")
MAP_CAPTION = "δA, δα: largest errors; √(1-α): largest relative error; fold: A at which alpha(A) turns; for its light"
NOTHING = "None of these records holds a model with an exact solution as reference."


@dataclass(frozen=True)
class Qualities:
    """Measures of the laws of a folder, in the order in which they are shown."""

    profiles: list[tuple[LoadedLaw, Quality]]
    maps: list[tuple[LoadedLaw, AlbedoQuality]]
    samplers: list[MeasuredSampler]


def measured(
    folder: Folder,
    names: Names = None,
    alpha: Floats = ALBEDOS,
    sampled_alpha: Sequence[float] | None = None,
    track: Track | None = None,
) -> Qualities:
    """Measure profiles by setting, then maps, then samplers.

    names    restricts all to laws of the records named; alpha, sampled_alpha where profiles and samplers are measured
    track    is shown the progress
    """
    records = Records.of(folder)
    profiles, maps, sampled = (find(records, names, False) for find in (profile_laws, albedo_laws, sampled_laws))
    profiles, sampled = (sorted(laws, key=lambda one: _order(one.setting)) for laws in (profiles, sampled))
    qualities = for_each(lambda one: profile_quality(one.law, alpha), profiles, track, "profiles")
    of_maps = for_each(lambda one: albedo_quality(one.law), maps, track, "maps")
    samplers = for_each(lambda one: measured_samplers(one, sampled_alpha), sampled, track, "samplers")
    return Qualities(qualities, of_maps, [one for _, of_law in samplers for one in of_law])


def every_law(qualities: Qualities, in_detail: bool = False) -> Iterator[RenderableType]:
    """Yield profiles by setting, a table a measure; then maps; then samplers, in_detail by albedo, too."""
    for setting, laws in groupby(qualities.profiles, key=lambda pair: pair[0].setting):
        by_label = {one.label: quality for one, quality in laws}
        for measure in SCALES:
            yield _profile_table(measure, setting, by_label)
    if qualities.maps:
        rows = []
        for law, quality in qualities.maps:
            home = (law.label, law.setting.illumination, f"{law.setting.n:g}")
            numbers = (albedo_number(measure, getattr(quality, measure)) for measure in OF_MAP)
            rows.append((*home, *numbers, albedo_number("at_one", law.law.alpha(0.0))))
        yield row_table("Albedo inversions", MAP_HEADERS, rows, MAP_CAPTION, left=("light",), fold=("map",))
    for setting, of_setting in groupby(qualities.samplers, key=lambda one: one.of.setting):
        samplers = list(of_setting)
        shown = []
        for one in samplers:
            errors = (one.exact_error, *(getattr(one.quality, name) for name in COLUMNS.values()))
            shown.append((f"{one.of.label}: {one.name}", *map(_worst, errors)))
        header = ("law: sampler", "exact", *COLUMNS)
        caption = f"At the worst albedo. {CAPTION}; exact: inversion error by the exact cdf"
        yield row_table(f"Samplers, {setting}", header, shown, caption, fold=header[:1])
        if in_detail:
            yield from sampler_tables({f"{one.of.label}: {one.name}": one.quality for one in samplers})
    if not (qualities.profiles or qualities.maps or qualities.samplers):
        yield Text(NOTHING)


def content(qualities: Qualities) -> dict[str, Any]:
    """Return every measure at every albedo, for JSON."""
    return {
        "profiles": [{**_whose(one), "quality": quality} for one, quality in qualities.profiles],
        "maps": [{**_whose(one), "quality": quality} for one, quality in qualities.maps],
        "samplers": [
            {**_whose(one.of), "sampler": one.name, "exact_error": one.exact_error, "quality": one.quality}
            for one in qualities.samplers
        ],
    }


def _whose(named: LoadedLaw) -> dict[str, Any]:
    return {"law": named.name, "constants": named.constants, "records": list(named.records), "setting": named.setting}


def markdown_sections(folder: Path) -> dict[str, Callable[[], str]]:
    """Return tables of a README that are measured, not read from records, by the names of their marks.

    "check" needs OpenGL, and raises ShaderError where there is none.
    """

    def laws() -> str:
        profiles = [one for one in profile_laws(folder, matched=False) if not one.records]
        return markdown_laws(for_each(lambda one: profile_quality(one.law, ALBEDOS), profiles))

    check, claims = (lambda: markdown_check(folder)), (lambda: markdown_claims(folder / EVIDENCE))
    return {"laws": laws, "check": check, "claims": claims}


def markdown_laws(measured: Sequence[tuple[LoadedLaw, Quality]]) -> str:
    """Return a line a law: where it belongs, its constants, and its errors over alpha [%]."""
    header = ("model", "constants", "illumination", "n", "mean error of R_d [%]", "largest [%]")
    rows = [
        (
            *(one.name, one.constants or "none", one.setting.illumination, f"{one.setting.n:g}"),
            *(
                significant(PERCENT * float(of))
                for of in (np.mean(quality.rel), np.max(quality.rel), np.max(quality.ks))
            ),
        )
        for one, quality in sorted(measured, key=lambda pair: _order(pair[0].setting))
    ]
    return markdown_table((*header, "largest error of cumulative energy [%]"), rows)


def _profile_table(measure: str, setting: Setting, measured: Mapping[str, Quality]) -> RenderableType:
    alpha = next(iter(measured.values())).alpha
    rows = np.unique(np.linspace(0, alpha.size - 1, SHOWN).round().astype(int))
    values = [getattr(quality, measure) for quality in measured.values()]
    wrong = [np.abs(1.0 - row) if measure == "r2" else row for row in values]  # r2 is good where it is near to 1
    columns: dict[str, list[str]] = {"law": list(measured)}
    columns["over α"] = [spark(list(row), span(map(list, wrong)), SPARK) for row in wrong]
    for i in rows:
        columns[f"{alpha[i]:.3f}"] = [_number(measure, float(row[i])) for row in values]
    columns["mean"] = [_number(measure, float(np.mean(row))) for row in values]
    columns["worst"] = [_number(measure, MEASURES[measure].worst(row)) for row in values]
    title = f"{measure}: {MEASURES[measure].formula}{SCALES[measure][1]}, by α; {setting}"
    caption = f"mean and worst over {alpha.size} albedos; over α: logarithmic scale, from the least to the worst here"
    if setting.illumination == Setting().illumination:
        caption += f"; {SEARCHLIGHT}"
    return column_table(title, columns, caption if measure == "rel" else "", left=("over α",), fold=("law",))


def _number(measure: str, value: float) -> str:
    """Return a value in the measure's unit, in few characters."""
    value *= SCALES[measure][0]
    if measure == "r2":
        return f"{value:.3f}" if value > -1.0 else f"{value:.1f}"
    if value < 0.1:
        return f"{value:.3f}" if measure != "mse" else f"{value:.2f}"
    return f"{value:.0f}" if value >= 100.0 else significant(value)


def _order(setting: Setting) -> tuple[bool, float, float]:
    """Return a key by which pencil beams come first."""
    return setting.illumination != Setting().illumination, setting.n, setting.g

"""How good a record's constants are, beside the printed ones: by albedo, on average and at worst."""

from __future__ import annotations

from typing import Any

import numpy as np
from rich.console import RenderableType

from profilefit.report.records import Content, converged, measured_sets, measures
from profilefit.report.tables.cells import column_table, on_the_point, significant, span, spark

SHORT = {"published": "print", "corrected": "corr.", "regenerated": "regen."}
FEW_DIGITS = 0.01  # below it three decimals say too little
ROWS = 9  # albedos shown, of those in the record; mean and worst are over all
# Measures by the table they stand in; for r2 the smallest is the worst.
TABLES = (
    ("rel", "ks", "l1"),
    ("mse", "r2"),
    ("mse near", "mse far"),
    ("r2 near", "r2 far"),
    ("inversion_error",),
)
MEANING = {
    "rel": "mean |law / exact − 1| of R_d",
    "ks": "max |cdf − exact cdf|",
    "l1": "share of misplaced energy",
    "mse": "of r R_d [1/mfp²]",
    "r2": "of r R_d",
    "mse near": "of the nearer half of the trimmed range [1/mfp²]",
    "mse far": "of the farther half",
    "r2 near": "of the nearer half of the trimmed range",
    "r2 far": "of the farther half",
    "inversion_error": "max |cdf(r(ξ)) − ξ|",
    "delta_A": "max error of A",
    "delta_alpha": "max error of α",
    "largest_s": "max |√(1 − α) / exact − 1|",
    "monotone": "rises all the way",
    "at_one": "α at A = 1",
    "fold": "A where it turns",
}
SPARKED = ("rel", "ks", "inversion_error")
ALBEDO_MEASURES = ("delta_A", "delta_alpha", "largest_s", "monotone", "at_one", "fold")


def worst(measure: str, values: Any) -> float:
    """The worst of a measure over the albedos, in its own unit."""
    return float(np.min(values) if measure.startswith("r2") else np.max(values))


def values_of(one: Content, measure: str) -> list[float] | None:
    """A measure of one set at each albedo, halves apart; None if the record does not know it."""
    name, _, half = measure.partition(" ")
    if not half:
        return one.get(name)
    halves = one.get(f"{name}_halves")
    return None if halves is None else [row[half == "far"] for row in halves]


def worst_measures(content: Content) -> dict[str, dict[str, float]]:
    """Measure -> set of constants -> its worst over alpha; a failed fit has no regenerated law to measure."""
    quality = content["quality"]
    names = [name for name in measured_sets(content) if name != "regenerated" or converged(content)]
    keys = [key for key in ("rel", "ks", "inversion_error", "delta_A", "largest_s") if key in quality["regenerated"]]
    return {key: {name: worst(key, quality[name][key]) for name in names} for key in keys}


def spark_table(content: Content) -> list[RenderableType]:
    """Every set's errors over alpha as a row of blocks; nothing for what is not measured by albedo."""
    quality, names = content["quality"], measured_sets(content)
    keys = [key for key in SPARKED if all(values_of(quality[name], key) for name in names)]
    if not keys:
        return []
    rows = [(key, name, values_of(quality[name], key) or []) for key in keys for name in names]
    ends = {key: span(values for of, _, values in rows if of == key) for key in keys}
    alpha = quality["alpha"]
    columns = {
        "": [f"{key.replace('inversion_error', 'error')} {name}" for key, name, _ in rows],
        f"α {alpha[0]:.3f} … {alpha[-1]:.3f}": [spark(values, ends[key]) for key, _, values in rows],
        "least": on_the_point([significant(min(values)) for _, _, values in rows]),
        "worst": on_the_point([significant(max(values)) for _, _, values in rows]),
    }
    caption = "One logarithmic scale for each measure, from its least to its worst"
    return [column_table("Errors over α" + _failed(content), columns, caption, left=("", list(columns)[1]))]


def quality_tables(content: Content) -> list[RenderableType]:
    """Measures by albedo for every set of constants, or those of an A -> alpha map."""
    if measures(content, "delta_A"):
        return [_albedo_table(content)]
    sets = [content["quality"][name] for name in measured_sets(content)]
    groups = [[key for key in group if all(values_of(one, key) is not None for one in sets)] for group in TABLES]
    return [_table(content, group) for group in groups if group]


def _table(content: Content, group: list[str]) -> RenderableType:
    quality, names = content["quality"], measured_sets(content)
    alpha = quality["alpha"]
    rows = np.unique(np.linspace(0, len(alpha) - 1, ROWS).round().astype(int))
    columns = {"α": [*(f"{alpha[i]:.3f}" for i in rows), "mean", "worst"]}
    for measure in group:
        for name in names:
            values = values_of(quality[name], measure) or []
            shown = [*(values[i] for i in rows), float(np.mean(values)), worst(measure, values)]
            header = f"{measure.replace('inversion_error', 'error')}\n{SHORT[name]}"
            columns[header] = on_the_point([_number(measure, value) for value in shown])
    caption = "; ".join(f"{measure.replace('inversion_error', 'error')}: {MEANING[measure]}" for measure in group)
    return column_table("Quality at albedos that were not fitted" + _failed(content), columns, caption, left=("α",))


def _albedo_table(content: Content) -> RenderableType:
    quality = content["quality"]
    columns = {"": [MEANING[measure] for measure in ALBEDO_MEASURES]}
    for name in measured_sets(content):
        columns[name] = [albedo_number(measure, quality[name][measure]) for measure in ALBEDO_MEASURES]
    return column_table("Quality of the map" + _failed(content), columns)


def albedo_number(measure: str, value: Any) -> str:
    """One measure of an A -> alpha map as text."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if measure == "fold" and value >= 1.0:
        return "nowhere"
    return f"{value:.5g}" if measure in ("at_one", "fold") else significant(value)


def _number(measure: str, value: float) -> str:
    if measure.startswith("mse"):
        return f"{value:.1e}"
    if measure.startswith("r2"):
        return f"{value:.4f}"
    return f"{value:.3f}" if value >= FEW_DIGITS else significant(value)


def _failed(content: Content) -> str:
    return "" if converged(content) else " (the regenerated set is of a failed fit)"

"""Quality of a record's constants beside the printed ones: by albedo, on average and at worst."""

from __future__ import annotations

from typing import Any

import numpy as np
from rich.console import RenderableType

from profilefit.fitting.quality import MEASURES, OF_MAP, OF_PROFILE
from profilefit.recipes.record import SPANS
from profilefit.report import records
from profilefit.report.records import Content, at_index, by_index, converged, measured_sets, measures
from profilefit.report.tables.cells import column_table, on_the_point, significant, span, spark

SHORT = {"published": "print", "corrected": "corr.", "regenerated": "regen."}
FEW_DIGITS = 0.01  # below it three decimals say too little
ROWS = 9  # albedos shown, of those in the record; mean and worst are over all
INDEX_MEASURES = ("rel", "largest", "ks", "delta_A")
# Measures by the table they stand in; for r2 the smallest is the worst.
TABLES = (
    ("rel", "ks", "l1"),
    ("largest",),
    ("mse", "r2"),
    ("mse near", "mse far"),
    ("r2 near", "r2 far"),
    ("inversion_error",),
)


def values_of(content: Content, measure: str) -> list[float] | None:
    """Return a measure of one set at each albedo, halves apart; None if the record does not know it."""
    name, _, half = measure.partition(" ")
    if not half:
        return content.get(name)
    halves = content.get(f"{name}_halves")
    return None if halves is None else [row[half == "far"] for row in halves]


def worst_measures(content: Content) -> dict[str, dict[str, float]]:
    """Measure -> set of constants -> its worst over alpha, and over n where a record spans indices."""
    keys = [key for key in (*OF_PROFILE, "delta_A", "largest_s") if measures(content, key)]
    return {key: {name: records.worst(content, name, key) for name in records.judged_sets(content)} for key in keys}


def spark_table(content: Content) -> list[RenderableType]:
    """Return every set's errors over alpha as a row of blocks; nothing for what is not measured by albedo."""
    quality, names = content["quality"], measured_sets(content)
    keys = [key for key in OF_PROFILE if all(values_of(quality[name], key) for name in names)]
    if not keys:
        return []
    rows = [(key, name, values_of(quality[name], key) or []) for key in keys for name in names]
    ends = {key: span(values for of, _, values in rows if of == key) for key in keys}
    alpha = quality["alpha"]
    columns = {
        "": [f"{MEASURES[key].header} {name}" for key, name, _ in rows],
        f"α {alpha[0]:.3f} … {alpha[-1]:.3f}": [spark(values, ends[key]) for key, _, values in rows],
        "least": on_the_point([significant(min(values)) for _, _, values in rows]),
        "worst": on_the_point([significant(max(values)) for _, _, values in rows]),
    }
    caption = "Logarithmic scale for each measure, from its least to its worst"
    title = f"Errors over α{at_index(content)}{_failed(content)}"
    return [column_table(title, columns, caption, left=("", list(columns)[1]))]


def quality_tables(content: Content) -> list[RenderableType]:
    """Return measures by albedo for every set of constants, or those of an A -> alpha map, and by index."""
    first = [_index_table(content)] if by_index(content) else []
    if measures(content, "delta_A"):
        columns = {"": [MEASURES[measure].formula for measure in OF_MAP]}
        for name in measured_sets(content):
            columns[name] = [albedo_number(measure, content["quality"][name][measure]) for measure in OF_MAP]
        return [*first, column_table(f"Errors of the albedo inversion{at_index(content)}{_failed(content)}", columns)]
    sets = [content["quality"][name] for name in measured_sets(content)]
    groups = [[key for key in group if all(values_of(one, key) is not None for one in sets)] for group in TABLES]
    return [*first, *(_table(content, group) for group in groups if group)]


def _index_table(content: Content) -> RenderableType:
    """Return the worst measures over alpha at each index that a record was judged at."""
    worst = by_index(content)
    columns = {name: [f"{value:g}" for value in worst[name]] for name in SPANS if name in worst}
    known = [MEASURES[measure] for measure in INDEX_MEASURES if measure in worst]
    columns |= {one.header: on_the_point(list(map(significant, worst[one.name]))) for one in known}
    caption = "At the worst albedo. " + "; ".join(f"{one.header}: {one.meaning}" for one in known)
    title = "By refractive index" + (" and g" if "g" in worst else "")
    return column_table(title + _failed(content), columns, caption, left=("n",))


def _table(content: Content, group: list[str]) -> RenderableType:
    quality, names = content["quality"], measured_sets(content)
    alpha = quality["alpha"]
    rows = np.unique(np.linspace(0, len(alpha) - 1, ROWS).round().astype(int))
    columns = {"α": [*(f"{alpha[i]:.3f}" for i in rows), "mean", "worst"]}
    for measure in group:
        for name in names:
            values = values_of(quality[name], measure) or []
            shown = [*(values[i] for i in rows), float(np.mean(values)), MEASURES[measure].worst(values)]
            header = f"{MEASURES[measure].header}\n{SHORT[name]}"
            columns[header] = on_the_point([_number(measure, value) for value in shown])
    caption = "; ".join(f"{MEASURES[measure].header}: {MEASURES[measure].meaning}" for measure in group)
    title = f"Errors at held-out albedos{at_index(content)}{_failed(content)}"
    return column_table(title, columns, caption, left=("α",))


def albedo_number(measure: str, value: Any) -> str:
    """Return one measure of an A -> alpha map as text."""
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

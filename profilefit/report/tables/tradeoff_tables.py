"""Speed against accuracy as tables on the terminal."""

from __future__ import annotations

from collections.abc import Iterable

from rich.console import RenderableType

from profilefit.report.tables.cells import ABSENT, column_table, significant
from profilefit.studies.tradeoff.points import BEATEN, Measured, Panel, Part, standings


def tradeoff_tables(part: Part) -> list[RenderableType]:
    """A table a panel; under the last one what was left out, and what is not in the times."""
    last = len(part.panels) - 1
    return [_table(part, panel, "\n".join(part.notes) if i == last else "") for i, panel in enumerate(part.panels)]


def _table(part: Part, panel: Panel, notes: str) -> RenderableType:
    points = panel.points
    columns = {
        "": [f"{p.method}, {p.label}" if p.label else p.method for p in points],
        panel.cost.split("[")[1].rstrip("]"): [_with_spread(p.cost) for p in points],
        "error": [_with_spread(p.error) for p in points],
        "worst": [ABSENT if p.worst is None else significant(p.worst.value) for p in points],
    }
    if any("standardised" in p.facts for p in points):
        columns["away"] = [significant(float(p.facts["standardised"])) for p in points]
    columns["stands"] = ["" if one == BEATEN else one for one in standings(points)]
    caption = f"time: {panel.cost}; error: {panel.error}".replace("$", "")
    if "away" in columns:
        caption += "; away: distance of the constants from their noise-free limit, in their standard errors"
    title = f"{part.name}, {panel.title}".replace("$", "")
    return column_table(title, columns, "\n".join(filter(None, (caption, notes))), left=("", "stands"))


def _with_spread(measured: Measured) -> str:
    """1.23 (1.20 … 1.31), or the number alone where it has no spread."""
    value = significant(measured.value, 3)
    if measured.low == measured.high:
        return value
    return f"{value} ({significant(measured.low)} … {significant(measured.high)})"


def all_tables(parts: Iterable[Part]) -> list[RenderableType]:
    """Those of every part."""
    return [table for part in parts for table in tradeoff_tables(part)]

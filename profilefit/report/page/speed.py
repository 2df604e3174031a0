"""Speed against accuracy: a chart a part, its numbers folded."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape

from profilefit.report.columns import column_table
from profilefit.report.digits import ABSENT, significant
from profilefit.report.page.markup import details, markup, paragraph
from profilefit.report.page.measured import Measured, Told, missing

CHARTS = {
    "truth": "Truths: error over time for a profile at five albedos.",
    "laws": "Laws: error of R_d over the time of one evaluation.",
    "samplers": "Samplers: error at an edge of light over time.",
    "fits": "Fits: error of constants over time.",
}


def speed(found: Measured) -> Iterator[str]:
    """The parts of the section."""
    told = found.told("tradeoff")
    if told is None:
        yield missing("tradeoff")
        return
    for name, title in CHARTS.items():
        if name in told:
            yield found.origin({"made": told["made"], **told[name]})  # parts may have been measured on different days
            yield found.drawing(f"tradeoff-{name}", title)
            yield details(f"{escape(title)} The numbers", _numbers(told[name]))


def _numbers(part: Told) -> str:
    tables = []
    for panel in part["panels"].values():
        points = panel["points"]
        columns = {
            "": [f"{one['method']}, {one['label']}" if one["label"] else one["method"] for one in points],
            "cost": [_with_spread(one["cost"]) for one in points],
            "error": [_with_spread(one["error"]) for one in points],
            "worst": [significant(one["worst"]["value"]) if one["worst"] else ABSENT for one in points],
            "stands": [one["standing"] for one in points],
        }
        caption = _plain(f"cost: {panel['cost']}; error: {panel['error']}")
        tables.append(markup(column_table(_plain(panel["title"]), columns, caption, left=("", "stands"))))
    return "\n".join([*tables, *(paragraph(note, "dim") for note in part["notes"])])


def _plain(text: str) -> str:
    """Without the marks that make a subscript in a figure."""
    return text.replace("$", "")


def _with_spread(measured: Told) -> str:
    value, low, high = (measured[key] for key in ("value", "low", "high"))
    alone = significant(value, 3)
    return alone if low == high else f"{alone} ({significant(low)} … {significant(high)})"

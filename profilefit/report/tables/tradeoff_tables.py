"""Speed against accuracy: tables for the terminal, and the same as numbers.

The CSV of a part has the machine and the meaning of its columns in comment lines before it:

panel, method, label    the chart, the line there, and what distinguishes points of one line
cost, error, worst      time or samples, error of the middle (mean or root mean square) and the largest error, in the
                        units that the comment of their panel says; `..._low`, `..._high` the ends of the spread of
                        repeats, 16th and 84th percentile, equal to the value where it is known without error
standing                front, tied or beaten, within the panel
times_yardstick         laws: time over normalized diffusion's in the same turn, median [-]
constants, functions    laws: fitted constants, and transcendental functions of a point
setup_nanoseconds       laws: time of what depends on the albedo only, of one albedo [ns]
ks, worst_ks            laws: largest error of the cdf, mean and worst over the albedos [-]
photons                 truths and fits: photons traced for one answer
first_call              truths: time of the first call, which compiles [s]
stated                  truths: the relative error that the method itself states, root mean square [-]
samples                 samplers: points of one estimate
variance                samplers: its variance over that of the exact quantile's, without the bias
standardised            fits: distance of the constants from their noise-free limit, in standard errors, median [-]
light_seconds           fits: time of the order-resolved run, median [s]
seeds, converged        fits: runs, and fits of them that converged
pieces                  the sea: of a ray
vertices, fragments     the sea: of a map's sea along a side; that were drawn of it
layers                  fur: of the way that draws it
rms, energy             the sea: of a map's error; of its mean, less 1 [-]
bright, dark            the sea: relative error of a map's light where it is so [-]
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from rich.console import RenderableType

from profilefit.report.tables.cells import ABSENT, column_table, significant
from profilefit.studies.tradeoff.points import BEATEN, Panel, Point, TradeoffPart, WithSpread, standings

DIGITS = 6  # of a number in the CSV: beyond what any repeat gives again
MEASURES = ("cost", "error", "worst")
ENDS = {"": "value", "_low": "low", "_high": "high"}


def tradeoff_tables(part: TradeoffPart) -> list[RenderableType]:
    """Return a table a panel; under the last one what was left out, and what is not in the times."""
    tables: list[RenderableType] = []
    for panel in part.panels:
        points = panel.points
        columns = point_columns(list(map(asdict, points)), panel.cost.split("[")[1].rstrip("]"))
        if any("standardised" in p.facts for p in points):
            columns["distance"] = [significant(float(p.facts["standardised"])) for p in points]
        columns["stands"] = ["" if one == BEATEN else one for one in standings(points)]
        caption = f"cost: {panel.cost}; error: {panel.error}".replace("$", "")
        if "distance" in columns:
            caption += "; distance: from constants to their noise-free limit, in standard errors"
        notes = "\n".join((caption, *(part.notes if panel is part.panels[-1] else ())))
        tables.append(column_table(f"{part.name}, {panel.title}".replace("$", ""), columns, notes, left=("", "stands")))
    return tables


def point_columns(points: Sequence[Mapping[str, Any]], cost: str = "cost") -> dict[str, list[str]]:
    """Return names, costs, errors and worst errors of points as `as_numbers` has them, under their headers."""
    return {
        "": [f"{one['method']}, {one['label']}" if one["label"] else one["method"] for one in points],
        cost: [_with_spread(**one["cost"]) for one in points],
        "error": [_with_spread(**one["error"]) for one in points],
        "worst": [significant(one["worst"]["value"]) if one["worst"] else ABSENT for one in points],
    }


def _with_spread(value: float, low: float, high: float) -> str:
    """Return text such as 1.23 (1.20 … 1.31), or the number alone where it has no spread."""
    shown = significant(value, 3)
    return shown if low == high else f"{shown} ({significant(low)} … {significant(high)})"


def as_csv(part: TradeoffPart, machine: Mapping[str, str]) -> str:
    """Return the CSV file of a part."""
    comments = [f"{part.name}: {part.title}", *(f"{name}: {value}" for name, value in machine.items())]
    comments += [f"panel {p.name}: {p.title}; cost: {p.cost}; error, worst: {p.error}" for p in part.panels]
    comments += part.notes
    rows = []
    for point, standing in (one for panel in part.panels for one in _standing(panel)):
        row = {"panel": point.panel, "method": point.method, "label": point.label}
        for name in MEASURES:
            one: WithSpread | None = getattr(point, name)
            row |= {f"{name}{end}": "" if one is None else _text(getattr(one, at)) for end, at in ENDS.items()}
        rows.append(row | {"standing": standing} | {name: _text(value) for name, value in point.facts.items()})
    columns = list(dict.fromkeys(column for row in rows for column in row))
    text = io.StringIO()
    text.writelines(f"# {line.replace('$', '')}\n" for line in comments)
    writer = csv.DictWriter(text, columns, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def as_numbers(part: TradeoffPart) -> dict[str, Any]:
    """Return a part as numbers, for --json."""
    return {
        "title": part.title,
        "notes": list(part.notes),
        "panels": {
            panel.name: {
                **{name: getattr(panel, name) for name in ("title", "cost", "error")},
                "points": [{**asdict(point), "standing": standing} for point, standing in _standing(panel)],
            }
            for panel in part.panels
        },
    }


def _standing(panel: Panel) -> list[tuple[Point, str]]:
    return list(zip(panel.points, standings(panel.points), strict=True))


def _text(value: float | int | str) -> str:
    return f"{value:.{DIGITS}g}" if isinstance(value, float) else str(value)

"""A part as numbers: CSV, with the machine and the meaning of its columns in comment lines before it.

panel, method, label    the chart, the line there, and what tells points of one line apart
cost, error, worst      time, error of the middle (mean or root mean square) and the largest error, in the units that
                        the comment of their panel says; `..._low`, `..._high` the ends of the spread of repeats, 16th
                        and 84th percentile, equal to the value where it is known without error
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
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from profilefit.studies.tradeoff.points import Measured, Panel, Part, Point, standings

DIGITS = 6  # of a number in the CSV: beyond what any repeat gives again
MEASURES = ("cost", "error", "worst")
ENDS = {"": "value", "_low": "low", "_high": "high"}


def as_csv(part: Part, machine: Mapping[str, str]) -> str:
    """The part's file."""
    comments = [f"{part.name}: {part.title}", *(f"{name}: {value}" for name, value in machine.items())]
    comments += [f"panel {p.name}: {p.title}; cost: {p.cost}; error, worst: {p.error}" for p in part.panels]
    comments += part.notes
    rows = [row for panel in part.panels for row in _rows(panel)]
    columns = list(dict.fromkeys(column for row in rows for column in row))
    text = io.StringIO()
    text.writelines(f"# {line.replace('$', '')}\n" for line in comments)
    writer = csv.DictWriter(text, columns, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def as_numbers(part: Part) -> dict[str, Any]:
    """The same for --json."""
    return {
        "title": part.title,
        "notes": list(part.notes),
        "panels": {
            panel.name: {
                "title": panel.title,
                "cost": panel.cost,
                "error": panel.error,
                "points": [
                    {**asdict(point), "standing": standing}
                    for point, standing in zip(panel.points, standings(panel.points), strict=True)
                ],
            }
            for panel in part.panels
        },
    }


def _rows(panel: Panel) -> list[dict[str, str]]:
    return [_row(point, standing) for point, standing in zip(panel.points, standings(panel.points), strict=True)]


def _row(point: Point, standing: str) -> dict[str, str]:
    row = {"panel": point.panel, "method": point.method, "label": point.label}
    for name in MEASURES:
        measured: Measured | None = getattr(point, name)
        row |= {f"{name}{end}": "" if measured is None else _text(getattr(measured, at)) for end, at in ENDS.items()}
    return row | {"standing": standing} | {name: _text(value) for name, value in point.facts.items()}


def _text(value: float | int | str) -> str:
    return f"{value:.{DIGITS}g}" if isinstance(value, float) else str(value)

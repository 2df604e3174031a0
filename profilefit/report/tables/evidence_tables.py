"""The record of readings: which choices reproduce the printed constants, and the paper's table of errors redone.

Every key may be absent: this shows what is there.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import inf, log
from typing import Any

from rich.console import RenderableType
from rich.text import Text

from profilefit.recipes.reproduction import NORMALIZED_DIFFUSION
from profilefit.report.records import Content
from profilefit.report.tables.cells import ABSENT, column_table, significant

BEST = 3  # readings shown of each equation, nearest to print first


def evidence_line(content: Content) -> str:
    """Return how many equations have a reading that reproduces them, for the summary."""
    readings = content.get("readings") or []
    equations = {reading.get("equation") for reading in readings}
    good = {r.get("equation") for r in readings if r.get("verdict") == "reproduced"}
    return f"{len(readings)} readings\n{len(good)} of {len(equations)} reproduced"


def evidence_tables(content: Content) -> list[RenderableType]:
    """Return the best readings of each equation with their evidence, and the nearest rows of the paper's table 1."""
    parts: list[RenderableType] = []
    for equation, readings in _by(content.get("readings") or [], "equation").items():
        parts.append(_readings(equation, readings))
    if content.get("table1"):
        parts.append(_table1(content["table1"]))
    if content.get("halves"):
        parts.append(_halves(content["halves"]))
    return parts or [Text("This record holds no readings.")]


def _readings(equation: str, readings: list[Content]) -> RenderableType:
    best = sorted(readings, key=_curve_distance)[:BEST]
    columns = {
        "verdict": [str(reading.get("verdict", ABSENT)) for reading in best],
        "curve": [_share(reading.get("curve_distance")) for reading in best],
        "constants": [_share(reading.get("constant_distance")) for reading in best],
        "reading, its constants, its evidence": [_summary(reading) for reading in best],
    }
    more = len(readings) - len(best)
    caption = f"and {more} more in the record, further from print" if more else ""
    title = f"{equation}: rms distance of the curve and largest distance of a constant from print"
    return column_table(title, columns, caption, left=("verdict",), fold=("reading, its constants, its evidence",))


def _summary(reading: Content) -> str:
    constants = reading.get("constants") or {}
    printed = reading.get("published") or {}
    pairs = ", ".join(
        f"{name} {value:.4g}" + (f" (printed {printed[name]:g})" if name in printed else "")
        for name, value in constants.items()
    )
    return "\n".join(str(part) for part in (reading.get("choices", ""), pairs, reading.get("evidence", "")) if part)


def _table1(rows: list[Content]) -> RenderableType:
    """Return every model of each material, at the channel and range that the other law's printed error points to."""
    shown = [row for group in _by(rows, "material").values() for row in _at_its_range(group)]
    columns = {
        "material": [f"{row.get('material', ABSENT)}, {row.get('channel', '')}, {_range(row)}" for row in shown],
        "model": [str(row.get("model", ABSENT)) for row in shown],
    }
    for place, part in enumerate(("near half", "far half", "all")):
        columns[part] = [significant(ratio[place], 3) if place < len(ratio) else ABSENT for ratio in map(_ratio, shown)]
    caption = (
        f"MSE over the printed one, {len(shown)} of {len(rows)} rows. Channel and range are not printed: here they are "
        "those at which normalized diffusion, which has no unknown constant, comes nearest to its printed error."
    )
    return column_table("Table 1 redone", columns, caption, left=("material",), fold=("model",))


def _at_its_range(rows: list[Content]) -> list[Content]:
    known = [row for row in rows if row.get("model") == NORMALIZED_DIFFUSION]
    if not known:
        return rows
    best = min(known, key=_distance)
    return [
        row for row in rows if all(row.get(key) == best.get(key) for key in ("channel", "range_choice", "range_mm"))
    ]


def _halves(rows: list[Content]) -> RenderableType:
    columns = {
        "material": [f"{row.get('material', ABSENT)}, {row.get('model', '')}" for row in rows],
        "off": [_share(row.get("off")) for row in rows],
    }
    return column_table("Table 1 as printed: mean of its halves over its whole, less 1", columns, left=("material",))


def _ratio(row: Content) -> list[Any]:
    value = row.get("mse_over_printed", row.get("ratio"))
    return list(value) if isinstance(value, list | tuple) else [None, None, value]


def _distance(row: Content) -> float:
    whole = _ratio(row)[-1]
    return abs(log(whole)) if whole else inf


def _range(row: Content) -> str:
    size = row.get("range_mm", row.get("range"))
    return f"{size:g} mm" if isinstance(size, int | float) else str(size or ABSENT)


def _share(value: float | None) -> str:
    return ABSENT if value is None else f"{100 * value:.1f} %"


def _curve_distance(reading: Content) -> float:
    distance = reading.get("curve_distance")
    return inf if distance is None else float(distance)


def _by(rows: Iterable[Content], *keys: str) -> dict[Any, list[Content]]:
    """Return rows by the values of these keys, in order."""
    groups: dict[Any, list[Content]] = {}
    for row in rows:
        values = tuple(row.get(key, ABSENT) for key in keys)
        groups.setdefault(values if len(keys) > 1 else values[0], []).append(row)
    return groups

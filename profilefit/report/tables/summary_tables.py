"""All records on one screen: a line each, what was fitted to what, and its worst error before and after."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Group, RenderableType
from rich.text import Text

from profilefit.recipes import record
from profilefit.recipes.regenerate import Reproduction
from profilefit.recipes.schema import ERRORS
from profilefit.report.records import SETS, Content, converged, measures
from profilefit.report.tables.cells import ABSENT, column_table, row_table, significant, span, spark
from profilefit.report.tables.quality_tables import values_of, worst_measures

SPARK = 8  # characters of a sparkline: 80 columns hold no more beside the longest name
FAILED = "FAILED"
Records = Mapping[str, Content]
REPRODUCED = "Records made, and the largest moves of their constants from the shipped records"
REPRODUCED_CAPTION = (
    "moved: in units of the constant's stated error; at most 0.05 counts as reproduced. relative: as a "
    "share of the constant. interval: largest move of an interval's end, in units of what the Monte Carlo error of the "
    f"chains allows. {ABSENT}: no shipped record of the same photons, seed and layers."
)
CAPTION = (
    "Worst over α, and over n where a record spans indices: as printed → corrected, where there is such a set → "
    "regenerated. "
    "`profilefit report NAME` has constants, errors and quality by α."
)


def summary(records: Records) -> RenderableType:
    """Return profile laws, inverse cdfs, maps, and what compares readings, each kind in a table."""
    tables = (_laws, _inverses, _maps, _readings)
    groups = {make: {name: one for name, one in records.items() if _kind(one) is make} for make in tables}
    shown = [part for make, group in groups.items() if group for part in (make(group), Text())]
    failures = [
        Text(f"{name}: {content['fit']['result']}", style="red")
        for name, content in records.items()
        if "fit" in content and not converged(content)
    ]
    return Group(*shown, *failures, Text(CAPTION, style="dim"))


def outcome(path: Path) -> dict[str, Any]:
    """Return what came out of a recipe, for --json: constants with their errors, and the worst errors over alpha."""
    content = record.read(path)
    body: dict[str, Any] = {"path": path, "law": content["law"], "equations": content.get("equations")}
    if "fit" not in content:
        return {**body, "readings": len(content.get("readings", []))}
    kept = ("published", "regenerated", *ERRORS)
    constants = {name: {key: one.get(key) for key in kept} for name, one in content["constants"].items()}
    return {**body, "result": content["fit"]["result"], "constants": constants, "worst": worst_measures(content)}


def reproduced(
    seconds: Mapping[str, float], paths: Mapping[str, Path], reproductions: Mapping[str, Reproduction | None]
) -> RenderableType:
    """Return seconds of each record and of each setting's light, and how far each record is from the shipped one."""
    rows = []
    for name, spent in seconds.items():
        one, content = reproductions.get(name), record.read(paths[name]) if name in paths else {"fit": {"result": ""}}
        result = content["fit"]["result"] if "fit" in content else f"{len(content.get('readings', []))} readings"
        numbers = (one.moved, one.relative, one.intervals) if one else ()
        cells = [str(one.constants) if one else ABSENT, *(f"{value:.1g}" for value in numbers)] + [ABSENT] * 3
        rows.append([name, f"{spent:.1f}", *cells[:4], (one.problem if one else "") or result])
    headers = ("record", "seconds", "constants", "moved", "relative", "interval", "result")
    return row_table(REPRODUCED, headers, rows, REPRODUCED_CAPTION, left=("record",), fold=("result",))


def verdict(reproductions: Sequence[Reproduction]) -> str:
    """Return one line: how many records are reproduced, and the largest move of a constant."""
    count, moved = sum(one.is_reproduced for one in reproductions), max(one.moved for one in reproductions)
    return f"{count} of {len(reproductions)} records reproduced; largest move {moved:.1g} of a stated error"


def photons_text(content: Content) -> str:
    """Return how many photons a record was fitted to; – where its light is exact."""
    photons = (content.get("truth") or {}).get("photons")
    return ABSENT if photons is None else f"{photons:.3g}".replace("e+0", "e")


def truth(content: Content) -> str:
    """Return what a record was fitted to: the exact solution, or so many photons."""
    text = photons_text(content)
    return f"{text} photons" if text != ABSENT else str((content.get("truth") or {}).get("kind", ABSENT))


def _laws(records: Records) -> RenderableType:
    title = "Profile laws: mean |law / exact − 1| of R_d (rel) and max |cdf − exact cdf| (ks)"
    return _errors(title, records, "rel", {"ks": "ks"})


def _inverses(records: Records) -> RenderableType:
    return _errors("Inverse cdfs: max |cdf(r(ξ)) − ξ|", records, "inversion_error", {})


def _errors(title: str, records: Records, measure: str, more: Mapping[str, str]) -> RenderableType:
    """Return a line a record: the worst of a measure, set by set, and how it goes over α."""
    rows = {name: values_of(content["quality"]["regenerated"], measure) or [] for name, content in records.items()}
    ends = span(rows.values())
    header = measure.replace("inversion_error", "error")
    columns = _first(records)
    columns[header] = [_course(content, measure) for content in records.values()]
    columns |= {key: [_course(content, key, last=True) for content in records.values()] for key in more}
    columns["over α"] = [spark(row, ends, SPARK) for row in rows.values()]
    return column_table(title, columns, left=("record", "over α"))


def _maps(records: Records) -> RenderableType:
    columns = _first(records)
    columns["max error of A"] = [_course(content, "delta_A") for content in records.values()]
    columns["of √(1 − α)"] = [_course(content, "largest_s") for content in records.values()]
    return column_table("Maps between A and α", columns, left=("record",))


def _readings(records: Records) -> RenderableType:
    lines = []
    for content in records.values():
        verdicts = [(one["equation"], one["verdict"]) for one in content["readings"]]
        good = {equation for equation, verdict in verdicts if verdict == "reproduced"}
        lines.append(f"{len(verdicts)} readings, {len(good)} of {len(dict(verdicts))} reproduced")
    columns = {"record": list(records), "found": lines}
    return column_table("Readings of what a paper leaves unsaid", columns, left=("record", "found"))


def _first(records: Records) -> dict[str, list[str]]:
    return {
        "record": list(records),
        "n": [
            f"≤ {span[1]:g}" if (span := one.get("indices")) else f"{one['setting']['n']:g}" for one in records.values()
        ],
        "photons": [truth(content).removesuffix(" photons") for content in records.values()],
    }


def _course(content: Content, measure: str, last: bool = False) -> str:
    """Return the worst error of each set in turn, or of the last alone; a failed fit has no law to measure."""
    worst = worst_measures(content).get(measure, {})
    shown = [significant(worst[name]) for name in SETS if name in worst]
    if not converged(content):
        shown.append(FAILED)
    return shown[-1] if last else " → ".join(shown)


def _kind(content: Content) -> Callable[[Records], RenderableType]:
    """Return the table that a record stands in."""
    if content["pipeline"] == "evidence":
        return _readings
    if measures(content, "delta_A"):
        return _maps
    return _laws if measures(content, "rel") else _inverses

"""Where methods fail: what of ours holds, a line a cause with its remedy, the atlas."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from profilefit.report.columns import column_table
from profilefit.report.page.markup import details, markup, paragraph
from profilefit.report.page.measured import Measured, Told, missing
from profilefit.stability.classes import Verdict

HOLDS = {
    True: "No law, map or solver of this project has a red cell inside its stated range.",
    False: "A law, map or solver of this project has a red cell inside its stated range.",
}
UNKNOWN = "no truth there: NaN, sign and order only"
NOT_JUDGED = Verdict.NOT_JUDGED.words
ATLAS = "stability-"
FIRST = "stability-float32"  # the arithmetic of shaders: open, the others folded


def failures(found: Measured) -> Iterator[str]:
    """The parts of the section."""
    told = found.told("stability")
    if told is None:
        yield missing("stability")
        return
    yield found.origin(told)
    yield paragraph(HOLDS[bool(told["passed"])], "bold")
    yield paragraph(_unjudged(told["regions"]), "dim")
    causes = _causes(told["regions"])
    yield markup(column_table("Why cells are red, and what helps", causes, left=("cause", "as"), fold=("remedy",)))
    for path in sorted(found.folder.glob(f"{ATLAS}*.svg")):
        title = f"Where laws fail: {path.stem.removeprefix(ATLAS).replace('-', ' ')}"
        figure = found.drawing(path.stem, f"{title}. A cell is an albedo and a radius or share.", on_paper=True)
        yield details(title, figure, is_open=path.stem == FIRST)


def _unjudged(regions: Sequence[Told]) -> str:
    count = sum(int(one["count"]) for one in regions if one["class"] == NOT_JUDGED)
    return f"{count} cells, of all laws, are not judged: no truth reaches there."


def _causes(regions: Sequence[Told]) -> dict[str, list[str]]:
    groups: dict[str, list[Told]] = {}
    for region in regions:
        groups.setdefault(str(region["cause"]), []).append(region)
    rows = sorted(groups.values(), key=lambda group: -len(_laws(group)))
    return {
        "cause": [group[0]["cause"] for group in rows],
        "laws": [str(len(_laws(group))) for group in rows],
        "cells": [str(sum(int(one["count"]) for one in group)) for group in rows],
        "as": [", ".join(sorted({one["class"] for one in group})) for group in rows],
        "remedy": [group[0]["remedy"] or UNKNOWN for group in rows],
    }


def _laws(group: Sequence[Told]) -> set[str]:
    return {one["law"] for one in group}

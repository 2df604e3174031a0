"""Atlas of failures as tables: what helps, this project's own laws, fits; every region as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from rich.console import RenderableType
from rich.text import Text

from profilefit.report.tables.cells import ABSENT, column_table, significant
from profilefit.studies.stability.atlas import Findings
from profilefit.studies.stability.cells import Cells, Region, Verdict
from profilefit.studies.stability.fit_cases import ALBEDO, BINS, NOISE, NONSENSE, STARTS, TRIMMING, FitCase

COLUMNS = (
    "law", "quantity", "precision", "cells", "class", "count", "inside_its_range", "worst_cell", "value", "reference",
    "error", "bound", "advice",
)  # fmt: skip
FIT_COLUMNS = ("law", "case", "value", "converged", "best", "spread", "constant", "results")
SHORT = {
    Verdict.NOT_JUDGED: "not judged",
    Verdict.INACCURATE: "inacc.",
    Verdict.NOT_MONOTONE: "not mon.",
    Verdict.NEGATIVE: "neg.",
    Verdict.NOT_FINITE: "NaN/Inf",
    Verdict.RAISES: "raises",
}
# One character a class, as in the figure.
SIGNS = {
    Verdict.NOT_JUDGED: "?",
    Verdict.INACCURATE: "≈",
    Verdict.NOT_MONOTONE: "↕",
    Verdict.NEGATIVE: "−",
    Verdict.NOT_FINITE: "×",
    Verdict.RAISES: "!",
}
LEGEND = "≈ inaccurate  ↕ not monotone  − negative  × NaN or Inf  ! raises  ? not judged"
BARE = "no reference there: only NaN, sign and order are looked at"
LONGEST_NAME = 18  # characters: a line of 100 holds it beside the advice
# What a line a law says of its fits: header, case, how its value begins, and whether shares or spreads.
SUMMARY = (
    ("from × 2", STARTS, "× e^(0.69", True),
    ("from × 8", STARTS, "× e^(2.1", True),
    ("dark", ALBEDO, "α 1e-4", True),
    ("white", ALBEDO, "α 0.999", True),
    ("bins × 8", BINS, "dr 1.6", False),
    ("1e6 photons", NOISE, "1e+06", False),
    ("trimmed", TRIMMING, "ε 0.0005", False),
)


def advice_table(parts: Sequence[Findings]) -> RenderableType:
    """Return a row for each piece of advice: the subjects that it is for, their cells and the classes of failure."""
    groups: dict[tuple[bool, str], list[Region]] = {}
    for region in _regions(parts):
        groups.setdefault((not region.verdict.is_red, region.advice), []).append(region)
    rows = sorted(groups.items(), key=lambda item: (item[0][0], -len({one.subject for one in item[1]})))
    columns = {
        "of": [_among([one.subject for one in group]) for _, group in rows],
        "cells": [str(sum(one.count for one in group)) for _, group in rows],
        "as": ["".join(SIGNS[v] for v in sorted({one.verdict for one in group})) for _, group in rows],
        "what helps": [advice or BARE for (_, advice), _ in rows],
    }
    total = sum(one.codes.size for part in parts for one in part.cells)
    caption = f"{LEGEND}\n{total} cells; inaccurate: off by more than a tenth of the model's own error"
    return column_table("Where cells are red, and what helps", columns, caption, ("of", "as"), ("what helps",))


def _among(subjects: Sequence[str]) -> str:
    distinct = list(dict.fromkeys(subjects))
    if len(distinct) > 1:
        return f"{len(distinct)} of them"
    return distinct[0] if len(distinct[0]) <= LONGEST_NAME else distinct[0][: LONGEST_NAME - 1].rstrip() + "…"


def region_table(part: Findings, most: int = 20) -> RenderableType:
    """Return the regions of one subject, those inside its range first, each with its size and worst error."""
    regions = sorted(part.regions, key=lambda one: (one.inside == 0, -one.count))[:most]
    columns = {
        "quantity": [f"{one.quantity}, {one.arithmetic}" for one in regions],
        "class": [SHORT[one.verdict] for one in regions],
        "cells": [str(one.count) for one in regions],
        "inside": [str(one.inside) for one in regions],
        "where": [one.where for one in regions],
        "worst": [significant(one.error) for one in regions],
        "bound": [significant(one.bound) for one in regions],
    }
    caption = "" if len(part.regions) <= most else f"the largest {most} of {len(part.regions)} regions; --out has all"
    return column_table(part.name, columns, caption, ("class",), ("quantity", "where"))


def fit_summary(fits: Sequence[FitCase]) -> RenderableType:
    """Return a row for each law: the share of fits that converge, and how far its constants change with the data."""
    columns: dict[str, list[str]] = {"fit": [], **{header: [] for header, *_ in SUMMARY}}
    for subject in dict.fromkeys(one.subject for one in fits):
        columns["fit"].append(subject)
        for header, case, begins, is_share in SUMMARY:
            one = next(
                (o for o in fits if o.subject == subject and o.case == case and o.value.startswith(begins)), None
            )
            columns[header].append(ABSENT if one is None else _cell(one, is_share))
    refused = sum(one.case == NONSENSE and one.converged == 0 for one in fits)
    nonsense = sum(one.case == NONSENSE for one in fits)
    caption = (
        "Share that converges from starts so far off, and on dark or white albedos alone; then the largest relative\n"
        "change of a constant: with wider bins, under noise, trimmed at 0.0005 instead of 0.05.\n"
        f"Nonsense (NaN, all zeros, one albedo): {refused} of {nonsense} refused by name."
    )
    return column_table("Fits", columns, caption, ("fit",))


def _cell(case: FitCase, is_share: bool) -> str:
    return f"{100.0 * case.converged:.0f} %" if is_share else significant(case.spread) if case.worst else ABSENT


def fit_table(fits: Sequence[FitCase]) -> RenderableType:
    """Return a row for each case: how many fits converge, and how far their constants spread."""
    shown = [one for one in fits if one.case != NONSENSE]
    columns = {
        "fit": [one.subject for one in shown],
        "case": [f"{one.case}, {one.value}" for one in shown],
        "converged": [f"{100.0 * one.converged:.0f} %" for one in shown],
        "at the best": [
            f"{100.0 * one.best:.0f} %" if one.case not in (BINS, NOISE, TRIMMING) else ABSENT for one in shown
        ],
        "spread": [f"{significant(one.spread)} {one.worst}" if one.worst else ABSENT for one in shown],
        "else": [", ".join(f"{count} {kind}" for kind, count in one.results if kind != "converged") for one in shown],
    }
    nonsense = sorted({kind for one in fits if one.case == NONSENSE for kind, _ in one.results})
    caption = "spread: the largest relative change of a constant. Nonsense (NaN, all zeros, one albedo): " + "; ".join(
        nonsense
    )
    return column_table("Fits", columns, caption, ("fit",), ("case", "else"))


def verdict_lines(parts: Sequence[Findings]) -> list[Text]:
    """Return each failure of this project's own laws and solvers, and how many have none."""
    lines = []
    for part in parts:
        lines += [
            Text(
                f"FAIL {one.subject}: {one.quantity}, {one.arithmetic}, {one.verdict.words} at {one.place}: "
                f"{one.value:.4g}, reference {one.reference:.4g}; {one.advice}"
            )
            for one in part.regions
            if one.is_failure
        ]
        lines += [
            Text(f"FAIL {one.subject}: {one.case}, {one.value}: {one.results}") for one in part.fits if one.is_failure
        ]
    ours = [part for part in parts if part.fits or any(one.own for one in part.cells)]
    broken = sum(part.failures > 0 for part in ours)
    summary = (
        "none has a red cell inside its range" if not broken else f"{broken} of them with red cells inside their range"
    )
    aside, inside = _unjudged(parts)
    share = Text(f"of ours {aside} of {inside} cells inside their ranges are not judged: no reference there")
    return [*lines, Text(f"ours: {len(ours)} laws, maps and functions, {summary}"), *([share] if aside else [])]


def _unjudged(parts: Sequence[Findings]) -> tuple[int, int]:
    """Return the number of our own cells that are not judged, and of all, inside their ranges."""
    own = [one for part in parts for one in part.cells if one.own]
    aside = sum(int(np.sum((one.codes == Verdict.NOT_JUDGED) & one.inside)) for one in own)
    return aside, sum(int(np.sum(one.inside)) for one in own)


def regions_csv(parts: Iterable[Findings]) -> str:
    """Return every region that is red or not judged as CSV, a line each."""
    rows = [
        (
            one.subject, one.quantity, one.arithmetic, one.where, one.verdict.words, one.count, one.inside, one.place,
            one.value, one.reference, one.error, one.bound, one.advice,
        )
        for one in _regions(parts)
    ]  # fmt: skip
    return _csv(COLUMNS, rows)


def fits_csv(fits: Iterable[FitCase]) -> str:
    """Return every case of fits as CSV, a line each."""
    rows = [
        (
            one.subject, one.case, one.value, one.converged, one.best, one.spread, one.worst,
            "; ".join(f"{count} {kind}" for kind, count in one.results),
        )
        for one in fits
    ]  # fmt: skip
    return _csv(FIT_COLUMNS, rows)


def content(parts: Sequence[Findings]) -> dict[str, Any]:
    """Return all of it for JSON."""
    return {
        "passed": not any(part.failures for part in parts),
        "subjects": {part.name: _counts(part.cells) for part in parts if part.cells},
        "regions": [dict(zip(COLUMNS, row, strict=True)) for row in csv.reader(io.StringIO(regions_csv(parts)))][1:],
        "fits": [vars(one) for part in parts for one in part.fits],
    }


def _counts(cells: Sequence[Cells]) -> Mapping[str, int]:
    total = {one.words: 0 for one in Verdict}
    for each in cells:
        for code, count in zip(*np.unique(each.codes, return_counts=True), strict=True):
            total[Verdict(int(code)).words] += int(count)
    return total


def _regions(parts: Iterable[Findings]) -> list[Region]:
    return [region for part in parts for region in part.regions]


def _csv(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return text.getvalue()

"""Atlas of failures as tables: what helps, this project's own laws, fits; every region as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from operator import attrgetter
from typing import Any

import numpy as np
from rich.console import RenderableType
from rich.text import Text

from profilefit.report.tables.cells import ABSENT, column_table, significant
from profilefit.studies.stability.atlas import Findings
from profilefit.studies.stability.cells import Region, Verdict
from profilefit.studies.stability.fit_cases import ALBEDO, BINS, NOISE, NONSENSE, STARTS, TRIMMING, FitCase

# Columns of the CSV, and what of a region they hold.
COLUMNS = {
    "law": "subject", "quantity": "quantity", "precision": "arithmetic", "cells": "where", "class": "verdict.words",
    "count": "count", "inside_its_range": "inside", "worst_cell": "place", "value": "value", "reference": "reference",
    "error": "error", "bound": "bound", "advice": "advice",
}  # fmt: skip
FIT_COLUMNS = ("law", "case", "value", "converged", "best", "spread", "constant", "results")
SHORT = {
    Verdict.NOT_JUDGED: "not judged",
    Verdict.INACCURATE: "inacc.",
    Verdict.NOT_MONOTONE: "not mon.",
    Verdict.NEGATIVE: "neg.",
    Verdict.NOT_FINITE: "NaN/Inf",
    Verdict.RAISES: "raises",
}
SIGNS = dict(zip(SHORT, "?≈↕−×!", strict=True))  # one character a class, as in the figure
LEGEND = "≈ inaccurate  ↕ not monotone  − negative  × NaN or Inf  ! raises  ? not judged"
BARE = "no reference: only NaN, sign and order are checked"
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
    for region in (region for part in parts for region in part.regions):
        groups.setdefault((not region.verdict.is_red, region.advice), []).append(region)
    rows = sorted(groups.items(), key=lambda item: (item[0][0], -len({one.subject for one in item[1]})))
    names = []
    for subjects in ({one.subject for one in group} for _, group in rows):
        name = next(iter(subjects)) if len(subjects) == 1 else f"{len(subjects)} of them"
        names.append(name if len(name) <= LONGEST_NAME else name[: LONGEST_NAME - 1].rstrip() + "…")
    columns = {
        "method": names,
        "cells": [str(sum(one.count for one in group)) for _, group in rows],
        "as": ["".join(SIGNS[v] for v in sorted({one.verdict for one in group})) for _, group in rows],
        "advice": [advice or BARE for (_, advice), _ in rows],
    }
    total = sum(one.codes.size for part in parts for one in part.cells)
    caption = f"{LEGEND}\n{total} cells; inaccurate: an error of more than a tenth of the model error"
    return column_table("Cells that fail, and advice", columns, caption, ("method", "as"), ("advice",))


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
            of = (o for o in fits if o.subject == subject and o.case == case and o.value.startswith(begins))
            one = next(of, None)
            if one is None or not (is_share or one.worst):
                columns[header].append(ABSENT)
            else:
                columns[header].append(f"{100.0 * one.converged:.0f} %" if is_share else significant(one.spread))
    nonsense = [one.converged == 0 for one in fits if one.case == NONSENSE]
    caption = (
        "Share of fits that converge: starts within a factor of 2 or 8, only dark or only white albedos. Then the\n"
        "largest relative change of a constant: wider bins, photon noise, trimming at 0.0005 instead of 0.05.\n"
        f"Nonsense (NaN, all zeros, one albedo): {sum(nonsense)} of {len(nonsense)} refused with a message."
    )
    return column_table("Fits", columns, caption, ("fit",))


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
    nonsense = "; ".join(sorted({kind for one in fits if one.case == NONSENSE for kind, _ in one.results}))
    caption = f"spread: largest relative change of a constant. Nonsense (NaN, all zeros, one albedo): {nonsense}"
    return column_table("Fits", columns, caption, ("fit",), ("case", "else"))


def verdict_lines(parts: Sequence[Findings]) -> list[Text]:
    """Return each failure of this project's own laws and solvers, and how many have none."""
    lines = []
    for part in parts:
        lines += [
            f"FAIL {one.subject}: {one.quantity}, {one.arithmetic}, {one.verdict.words} at {one.place}: "
            f"{one.value:.4g}, reference {one.reference:.4g}; {one.advice}"
            for one in part.regions
            if one.is_failure
        ]
        lines += [f"FAIL {one.subject}: {one.case}, {one.value}: {one.results}" for one in part.fits if one.is_failure]
    ours = [part for part in parts if part.fits or any(one.own for one in part.cells)]
    broken = sum(part.failures > 0 for part in ours)
    red = f"{broken} of them with red cells inside their range" if broken else "none has a red cell inside its range"
    lines.append(f"ours: {len(ours)} laws, maps and functions, {red}")
    own = [one for part in parts for one in part.cells if one.own]
    inside = sum(int(np.sum(one.inside)) for one in own)
    if aside := sum(int(np.sum((one.codes == Verdict.NOT_JUDGED) & one.inside)) for one in own):
        lines.append(f"of ours {aside} of {inside} cells inside their ranges are not judged: no reference there")
    return list(map(Text, lines))


def regions_csv(parts: Iterable[Findings]) -> str:
    """Return every region that is red or not judged as CSV, a line each."""
    values = attrgetter(*COLUMNS.values())
    return _csv(COLUMNS, (values(region) for part in parts for region in part.regions))


def fits_csv(fits: Sequence[FitCase]) -> str:
    """Return every case of fits as CSV, a line each."""
    values = attrgetter("subject", "case", "value", "converged", "best", "spread", "worst")
    rows = ((*values(one), "; ".join(f"{count} {kind}" for kind, count in one.results)) for one in fits)
    return _csv(FIT_COLUMNS, rows)


def content(parts: Sequence[Findings]) -> dict[str, Any]:
    """Return all of it for JSON."""
    subjects = {}
    for part in (part for part in parts if part.cells):
        total = np.sum([np.bincount(one.codes.ravel(), minlength=len(Verdict)) for one in part.cells], axis=0)
        subjects[part.name] = {one.words: int(total[one]) for one in Verdict}
    return {
        "passed": not any(part.failures for part in parts),
        "subjects": subjects,
        "regions": list(csv.DictReader(io.StringIO(regions_csv(parts)))),
        "fits": [vars(one) for part in parts for one in part.fits],
    }


def _csv(header: Iterable[str], rows: Iterable[Sequence[Any]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([tuple(header), *rows])
    return text.getvalue()

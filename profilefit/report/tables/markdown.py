"""The tables of README and documentation, as GitHub markdown: constants with errors, and how good each set is."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from math import inf

import numpy as np

from profilefit.fitting.quality import MEASURES, OF_MAP
from profilefit.recipes.reproduction import LENGTH, PUBLISHED
from profilefit.report import records
from profilefit.report.records import Content, converged, largest_error
from profilefit.report.tables.cells import ABSENT, significant, to_error
from profilefit.report.tables.quality_tables import albedo_number

OF_THE_PAPER = ("liang", "burley", "rational")  # its own laws, and those it is compared with
# Words and factor of a measure in headers.
WORDS = {
    "rel": ("error of R_d [%]", 100.0),
    "inversion_error": ("error of the sampled energy [%]", 100.0),
}
DISTANCES = ("constant_distance", "curve_distance")
# Which equation of the paper a constant of its profile law belongs to.
EQUATION = {name: equation for equation, printed in PUBLISHED.items() if equation != LENGTH for name in printed}

AS_PUBLISHED = "-as-published"  # ends the name of a record of the paper's protocol
OF_MAPS: tuple[str, ...] = ("record", "constants", "error of A", "error of α", "relative error of √(1 − α)")
OF_MAPS += ("monotone", "α at A = 1", "A at the fold")

# Headers of columns that stand to the left.
NAMES = frozenset({"record", "equation", "constant", "constants", "constants found"})
NAMES |= {"verdict", "law", "profile model", "model", "map", "illumination", "light", "measure"}
NAMES |= {"claim", "stack", "channel", "table", "fit", "moments"}
MARKUP = re.compile(r"(?<!\\)[<|]")  # begins an element, or a column
# Profile models of the README: the one in use, the best sum of Gaussians, and those of the lowest error.
SHORT = {("burley", "published"), ("gaussians-6", "regenerated"), ("hazard", "regenerated")}
SHORT |= {("hazard-refracting", "regenerated")}


def markdown_constants(contents: Mapping[str, Content]) -> str:
    """Return every constant as published and as refitted by both protocols; a failed fit has no value."""
    rows: dict[tuple[str, str], list[str]] = {}
    failures = []
    for name, content in _fits(contents).items():
        stem = name.removesuffix(AS_PUBLISHED).removesuffix("-whole")
        if not converged(content):
            failures.append(f"{_text(name)} has no constants to show: {_text(content['fit']['result'])}.")
            continue
        for constant, values in content["constants"].items():
            value, error = values["regenerated"], records.total_error(values) or largest_error(values)
            published = ABSENT if values.get("published") is None else f"{values['published']:g}"
            equation = EQUATION.get(constant, stem) if content["law"] == "liang" else stem
            row = rows.setdefault((stem, constant), [equation, constant, published, ABSENT, ABSENT])
            text = (
                f"{to_error(value, error)} ± {significant(error)}" if values.get("free", True) else f"{value:g} (fixed)"
            )
            row[-2 if name.endswith(AS_PUBLISHED) else -1] = text
    table = markdown_table(("equation", "constant", "published", "paper's protocol", "whole profile"), [*rows.values()])
    return "\n\n".join([table, *failures])


def _readings(contents: Mapping[str, Content]) -> str:
    """Return the reading nearest to print of each equation: its constants, their distance, and the verdict."""
    best: dict[str, Content] = {}
    readings = [r for content in contents.values() for r in content.get("readings") or ()]
    for reading in sorted(readings, key=lambda r: inf if r["curve_distance"] is None else r["curve_distance"]):
        best.setdefault(reading["equation"], reading)
    rows = [
        (
            equation,
            ", ".join(f"{name} {value:.4g}" for name, value in best[equation]["constants"].items()),
            *(ABSENT if (far := best[equation][key]) is None else f"{far:.1%}".replace("%", " %") for key in DISTANCES),
            best[equation]["verdict"],
        )
        for equation in dict.fromkeys(reading["equation"] for reading in readings)
    ]
    header = ("equation", "constants found", "worst constant", "curve, rms", "verdict")
    return markdown_table(header, rows) if rows else ""


def sections(contents: Mapping[str, Content]) -> dict[str, str]:
    """Return the tables that are made of records, by the names of their marks in README and documentation."""
    paper = {name: c for name, c in contents.items() if _is_searchlight(c) and c["law"] in OF_THE_PAPER}
    sets = _measured(contents, "delta_A")
    maps = [(owner, which, *(albedo_number(name, values[name]) for name in OF_MAP)) for owner, which, values in sets]
    tables = {
        "short": _short(contents),
        "constants": markdown_constants(paper),
        "readings": _readings(contents),
        "inversion": _quality(_measured(contents, of := "inversion_error"), (f"mean {of}", f"largest {of}")),
        "maps": markdown_table(OF_MAPS, maps) if maps else "",
    }
    return {name: text for name, text in tables.items() if text}


def fill(text: str, tables: Mapping[str, str]) -> str:
    """Put each table between its marks, <!-- name --> and <!-- /name -->; marks without a table stay as they are."""
    for name, table in tables.items():
        begin, end = f"<!-- {name} -->", f"<!-- /{name} -->"
        if begin in text and end in text:
            head, rest = text.split(begin, 1)
            text = f"{head}{begin}\n{table}\n{end}{rest.split(end, 1)[1]}"
    return text


def _quality(sets: Sequence[tuple[str, str, Content]], columns: Sequence[str], of: str = "record") -> str:
    """Return a row for each set of constants, its mean or worst measures over alpha; nothing without a set."""
    ends = [column.split() for column in columns]
    rows = []
    for owner, which, values in sets:
        row = [owner, which]
        for end, key in ends:
            known, factor = values.get(key), WORDS[key][1]  # photons do not say all
            value = None if known is None else float(np.mean(known)) if end == "mean" else MEASURES[key].worst(known)
            row.append(significant(value and factor * value))
        rows.append(row)
    return markdown_table((of, "constants", *(f"{end} {WORDS[key][0]}" for end, key in ends)), rows) if rows else ""


def _short(contents: Mapping[str, Content]) -> str:
    """Return the errors of a few profile models for a pencil beam, the worst first."""
    searchlight = {name: c for name, c in contents.items() if _is_searchlight(c, spanning=True)}
    chosen = [item for item in _measured(searchlight, "rel") if item[:2] in SHORT]
    chosen.sort(key=lambda item: -MEASURES["rel"].worst(item[2]["rel"]))
    named = [(owner + records.at_index(contents.get(owner, {})), which, values) for owner, which, values in chosen]
    return _quality(named, ("mean rel", "largest rel"), "profile model")


def _measured(contents: Mapping[str, Content], measure: str) -> list[tuple[str, str, Content]]:
    """Return (record or law, set, measures) of each set once, printed constants of a law only once."""
    sets: dict[tuple[str, str], Content] = {}
    for name, content in _fits(contents).items():
        for which in records.judged_sets(content):
            law = f"{content['law']}{' map' if records.measures(content, 'delta_A') else ''}"
            owner = name if which == "regenerated" else law
            if measure in content["quality"][which]:
                sets.setdefault((owner, which), content["quality"][which])
    return [(*place, values) for place, values in sets.items()]


def _is_searchlight(content: Content, spanning: bool = False) -> bool:
    """Return whether a record is of a searchlight on a matched surface, or `spanning` on one of many indices."""
    setting = content.get("setting") or {}
    matched = setting.get("n") == 1 or bool(spanning and content.get("indices"))
    return matched and setting.get("illumination") == "searchlight"


def _fits(contents: Mapping[str, Content]) -> dict[str, Content]:
    return {name: content for name, content in contents.items() if "constants" in content}


def _text(cell: str) -> str:
    """Return text for Markdown: no element, and no column of a table."""
    return MARKUP.sub(r"\\\g<0>", cell)


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a GitHub table, names to the left and numbers to the right, without padding.

    What is in its cells begins no element and no further column.
    """
    rule = "|".join(":--" if name in NAMES else "--:" for name in header)
    lines = [f"| {' | '.join(map(_text, cells))} |" for cells in (header, *rows)]
    return "\n".join([lines[0], f"|{rule}|", *lines[1:]])

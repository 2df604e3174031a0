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
PROFILE_MEASURES = ("rel", "ks", "l1", "mse", "r2")
DISTANCES = ("constant_distance", "curve_distance")
# Which equation of the paper a constant of its profile law belongs to.
EQUATION = {name: equation for equation, printed in PUBLISHED.items() if equation != LENGTH for name in printed}

# Headers of columns that stand to the left.
NAMES = frozenset({"record", "equation", "constant", "constants", "nearest reading", "constants found", "printed"})
NAMES |= {"verdict", "law", "light", "sampler", "measure", "claim", "noise"}
NAMES |= {"held against", "command", "stack", "channel", "table", "fit", "moments"}
MARKUP = re.compile(r"(?<!\\)[<|]")  # begins an element, or a column
# What the README shows of all: the law in question and in use, the best sum of Gaussians, and the nearest.
SHORT = {("liang", "published"), ("burley", "published"), ("gaussians-6", "regenerated"), ("hazard", "regenerated")}
SHORT |= {("hazard-refracting", "regenerated")}


def markdown_constants(contents: Mapping[str, Content]) -> str:
    """Return every constant of every record: printed, regenerated, and its errors; a failed fit has no row."""
    known = records.known_errors(one for content in _fits(contents).values() for one in content["constants"].values())
    header = ("record", "equation", "constant", "published", "regenerated", *(f"± {word}" for word in known.values()))
    rows: list[Sequence[str]] = []
    failures = []
    for name, content in _fits(contents).items():
        if not converged(content):
            failures.append(f"{_text(name)} has no constants to show: {_text(content['fit']['result'])}.")
            continue
        for constant, values in content["constants"].items():
            errors = [significant(values.get(key)) for key in known]
            if not values.get("free", True):
                errors = ["held", *[ABSENT] * (len(known) - 1)]
            published = values.get("published")
            rows.append((
                name, EQUATION.get(constant, ABSENT) if content["law"] == "liang" else ABSENT, constant,
                ABSENT if published is None else f"{published:g}",
                to_error(values["regenerated"], largest_error(values)), *errors,
            ))  # fmt: skip
    note = "Digits end where the largest error does; constants are correlated, so compute with the record's own."
    return "\n\n".join([markdown_table(header, rows), *failures, note])


def _hazard(contents: Mapping[str, Content]) -> str:
    """Return the constants of the hazard law in every setting, a record a column, and its worst errors there.

    Records of n = 1 come first, then those that span the indices of a surface that refracts.
    """
    of_hazard = {name: c for name, c in _fits(contents).items() if (c["law"], c["pipeline"]) == ("hazard", "profile")}
    fitted = {name: c for name, c in of_hazard.items() if converged(c)}
    forms: dict[tuple[str, ...], dict[str, Content]] = {}
    for name, content in sorted(fitted.items(), key=lambda item: bool(item[1].get("indices"))):
        forms.setdefault(tuple(content["constants"]), {})[name] = content
    tables = []
    for names, alike in forms.items():  # a column for each record of the same constants
        rows = [("n", *map(records.index_words, alike.values()))]
        for name in names:
            of = [content["constants"][name] for content in alike.values()]
            rows.append((name, *(to_error(one["regenerated"], largest_error(one)) for one in of)))
        for measure in ("rel", "ks"):
            worst_of = (records.worst(content, "regenerated", measure) for content in alike.values())
            rows.append((f"{measure}, worst", *map(significant, worst_of)))
        tables.append(markdown_table(("constant", *alike), rows))
    return "\n\n".join(tables)


def _readings(contents: Mapping[str, Content]) -> str:
    """Return the reading nearest to print of each equation: its choices, its result, and the verdict."""
    header = ("equation", "nearest reading", "constants found", "printed", "worst constant", "curve, rms", "verdict")
    readings = [r for content in contents.values() for r in content.get("readings") or ()]
    best: dict[str, Content] = {}
    for reading in sorted(readings, key=lambda r: inf if r["curve_distance"] is None else r["curve_distance"]):
        best.setdefault(reading["equation"], reading)
    rows = [
        (
            equation,
            best[equation]["choices"],
            ", ".join(f"{name} {value:.4g}" for name, value in best[equation]["constants"].items()),
            ", ".join(f"{value:g}" for value in best[equation]["published"].values()),
            *(ABSENT if (far := best[equation][key]) is None else f"{far:.1%}" for key in DISTANCES),
            best[equation]["verdict"],
        )
        for equation in dict.fromkeys(reading["equation"] for reading in readings)
    ]
    return markdown_table(header, rows) if rows else ""


def sections(contents: Mapping[str, Content]) -> dict[str, str]:
    """Return the tables that are made of records, by the names of their marks in README and documentation."""
    paper = {name: c for name, c in contents.items() if _is_searchlight(c) and c["law"] in OF_THE_PAPER}
    of_maps = ("record", "constants", *(MEASURES[measure].formula.replace("|", "\\|") for measure in OF_MAP))
    sets = _measured(contents, "delta_A")
    maps = [(owner, which, *(albedo_number(name, values[name]) for name in OF_MAP)) for owner, which, values in sets]
    tables = {
        "short": _short(contents),
        "quality": _quality(_measured(paper, "rel"), PROFILE_MEASURES),
        "constants": markdown_constants(paper),
        "hazard": _hazard(contents),
        "readings": _readings(contents),
        "inversion": _quality(_measured(contents, "inversion_error"), ("inversion_error",)),
        "maps": markdown_table(of_maps, maps) if maps else "",
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


def _quality(sets: Sequence[tuple[str, str, Content]], measures: Sequence[str], of: str = "record") -> str:
    """Return a row for each set of constants: mean and worst over alpha of these measures; nothing without a set."""
    header = (of, "constants", *(f"{key.replace('_', ' ')} {end}" for key in measures for end in ("mean", "worst")))
    rows = []
    for owner, which, values in sets:
        row = [owner, which]
        for key in measures:
            ends: tuple[float | None, float | None] = (None, None)  # photons do not say all
            if (known := values.get(key)) is not None:
                ends = float(np.mean(known)), MEASURES[key].worst(known)
            row += [f"{end:.4f}" if key == "r2" and end is not None else significant(end) for end in ends]
        rows.append(row)
    return markdown_table(header, rows) if rows else ""


def _short(contents: Mapping[str, Content]) -> str:
    """Return a few laws under a searchlight by `rel` and `ks`, the worst first; one that spans indices at its own."""
    searchlight = {name: c for name, c in contents.items() if _is_searchlight(c, spanning=True)}
    chosen = [item for item in _measured(searchlight, "rel") if item[:2] in SHORT]
    chosen.sort(key=lambda item: -MEASURES["rel"].worst(item[2]["rel"]))
    named = [(owner + records.at_index(contents.get(owner, {})), which, values) for owner, which, values in chosen]
    return _quality(named, ("rel", "ks"), "law")


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
    rule = [":--" if name in NAMES else "--:" for name in header]
    lines = [[_text(cell) for cell in header], rule, *([_text(cell) for cell in row] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)

"""Measurements of the laws as sections of the page: shader check, cost, failures."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from mcml_sim.files.text_file import MOST_JSON, parse_json
from mcml_sim.files.whole_file import read_whole
from profilefit.errors import InputError
from profilefit.fitting.measures import MEASURES, OF_MAP, OF_PROFILE
from profilefit.recipes.evidence import stale
from profilefit.report.drawing import address, checked, inline
from profilefit.report.figures.sum_figure import NAME as OF_SUMS
from profilefit.report.figures.sum_figure import sum_caption, sum_figure, sums_of
from profilefit.report.page.fits import drawing
from profilefit.report.page.markup import command, details, element, figure, markup, paragraph
from profilefit.report.records import Source
from profilefit.report.tables.cells import ABSENT, column_table, significant
from profilefit.report.tables.claims_table import FILE, claim_tables, read_claims
from profilefit.report.tables.stack_table import stack_table
from profilefit.report.tables.sum_table import sum_tables
from profilefit.report.tables.tradeoff_tables import with_spread
from profilefit.studies.stability.cells import Verdict

Content = dict[str, Any]
ALL = "all"
MOST_DRAWING = 2**24  # bytes; the largest of ours has a fourteenth of it


@dataclass(frozen=True)
class EvidenceFolder:
    """A folder that `profilefit check`, `stability` and `tradeoff` wrote into with `--out`.

    records  the folder whose records the page shows
    """

    folder: Path
    records: Path

    def section(self, name: str, parts: Callable[[EvidenceFolder], Iterator[str]]) -> str:
        """Return the parts of one section; InputError where the files of `profilefit NAME` lack what it shows."""
        try:
            return "\n".join(parts(self))
        except (KeyError, TypeError, ValueError, AttributeError, OSError) as error:
            given = f"{type(error).__name__}: {error}"
            raise InputError(
                f"{self.folder / name}.json: expected what `profilefit {name} --out` writes, got {given}"
            ) from error

    def content(self, name: str) -> Content | None:
        """Return the content of `name`.json; None if there is none. InputError on a file of another kind."""
        path = self.folder / f"{name}.json"
        expected = f"{path}: expected what `profilefit {name} --out` writes"
        if not path.exists():
            return None
        try:
            content = parse_json(read_whole(path, MOST_JSON))
        except ValueError as error:
            raise InputError(f"{expected}, got: {error}") from None
        if not isinstance(content, dict) or not isinstance(content.get("made"), dict):
            raise InputError(f"{expected}, got no key 'made'")
        return content

    def drawing(self, name: str, title: str, on_paper: bool = False) -> str:
        """Return the figure `name`.svg beside it, or nothing."""
        path = self.folder / f"{name}.svg"
        if not path.exists():
            return ""
        content = read_whole(path, MOST_DRAWING)
        if len(content) > MOST_DRAWING:
            raise ValueError(f"a drawing of more than {MOST_DRAWING} bytes, {path.name}")
        return figure(inline(checked(content.decode("utf-8")), name, title), title, on_paper)

    def origin(self, content: Content) -> str:
        """Return when, where and by which command it was measured, and whether the records have changed since."""
        made = content["made"]
        machine = made.get("machine") or {}
        when = f"Measured {made.get('date')} on {machine.get('processor')} ({machine.get('cores')} cores) by"
        parts = [paragraph(when, "dim"), command(str(made.get("command")))]
        if content.get("of", ALL) != ALL:
            of = content["of"]
            listed = ", ".join(of) if isinstance(of, list) else str(of)
            parts.append(paragraph(f"Not of everything: of {listed}.", "red"))
        if stale(made, self.records):
            parts.append(paragraph("Since then records or version have changed: run it again.", "red"))
        return "\n".join(parts)


def missing(name: str) -> str:
    """Return the text for a measurement that is absent."""
    return paragraph("Not measured here. This does it:", "dim") + command(f"profilefit {name} --out evidence")


# `python -m benchmarks.render` makes them.
RENDERS = {
    "render-laws.png": "A head by the exact profile, four laws and the separable filter, and how far each is off.",
    "render-error.png": "Error of renders over samples a pixel and over time, against the exact picture.",
    "render-choices.png": "The same head by each way to sample.",
    "render-17-samples.png": "Seventeen samples a pixel, as in Figure 14 of Liang et al.",
}
# `python -m benchmarks.layers --pictures`, and those of heart, sea and fur, make them.
OF_LAYERS = {
    "render-layers.png": "A head of layered skin: its truth, the law of the stack, the first layer's dipole (Zhao et "
    "al.), the nearest half space.",
    "render-ear.png": "An ear lit from behind, by the same three ways.",
    "render-heart.png": "A heart: its truth, Gaussians split between screen and atlas, texture space alone, the screen "
    "alone, no light scattering sideways.",
    "render-heart-cost.png": "The heart's error over the time of its passes, by each way at four sizes.",
    "render-heart-map.png": "The heart's error by texel and view; the least of the three in bold.",
    "render-sea.png": "Under the sea, from the top left: all light, light broadened on its way, the forward peak kept, "
    "single scattering.",
    "render-sea-cost.png": "The sea's error over the time of its view, by each kind.",
    "render-fur.png": "A ball of fur, from the top left: rays against each strand; sixteen shells, linear, quadratic "
    "and of the fitted exponent; sixteen swept slabs that test one strand, and two.",
    "render-fur-cost.png": "Error of fur's layers over time, toward six angles.",
    "own-data.png": "What rings can know of tissue, by place and error; n and g given or open.",
}
GROUPS = {
    "laws": ("Laws in float32", OF_PROFILE),
    "maps": ("Maps in float32", OF_MAP[:2]),
}
MEANING = (
    "model: the record's error against the exact half space or photons, worst albedo; float32: what rounding adds; "
    "bad: NaN, Inf, negative or not monotone, in and out of where the law holds"
)
COSTS = "Cost of one evaluation: ns of the fastest turn; in brackets the median of its ratios to normalized diffusion's"


def shader(evidence: EvidenceFolder) -> Iterator[str]:
    """Yield the parts of the section."""
    content = evidence.content("check")
    yield missing("check") if content is None else "\n".join([evidence.origin(content), *_check(content)])
    for name, title in RENDERS.items():
        path = evidence.folder / name
        if path.exists():
            yield _picture(path.read_bytes(), title)


def layers(source: Source, evidence: EvidenceFolder) -> Iterator[str]:
    """Yield the parts of the section: records of stacks, sums of Gaussians, pictures; none without a record."""
    table = None if source.names else stack_table(source.folder)
    if table is None:
        return
    yield markup(table)
    if sums := sums_of(source.folder):
        yield drawing(OF_SUMS, lambda out: sum_figure(source, out), sum_caption(sums))
        for name, one in sums.items():
            yield details(f"{escape(name)}: the numbers", "\n".join(map(markup, sum_tables(one))))
    for name, title in OF_LAYERS.items():
        path = evidence.folder / name
        if path.exists():
            yield _picture(path.read_bytes(), title)


def _check(content: Content) -> Iterator[str]:
    counts = " and ".join(f"{len(content[key])} {key}" for key in GROUPS)
    verdict = "all pass" if content["passed"] else "bounds are broken"
    yield paragraph(f"{counts} on {content['device']}: {verdict}.", "bold")
    for key, (title, measures) in GROUPS.items():
        if content[key]:
            columns = _columns(content[key], measures)
            yield markup(column_table(title, columns, MEANING, left=("light", "result"), fold=("law",)))
    if broken := [f"{_label(one)}: {line}" for key in GROUPS for one in content[key] for line in one["broken"]]:
        yield element("ul", "".join(element("li", escape(line)) for line in broken))
    if content["costs"]:
        yield markup(column_table(COSTS, _costs(content["costs"]), left=("source",)))


def _columns(group: Sequence[Content], measures: Sequence[str]) -> dict[str, list[str]]:
    columns = {
        "law": [_label(one) for one in group],
        "result": ["FAIL" if one["broken"] else "pass" for one in group],
        "light": [one["setting"]["illumination"] for one in group],
        "n": [f"{one['setting']['n']:g}" for one in group],
    }
    for name in measures:
        short = MEASURES[name].symbol
        columns[f"{short}\nmodel"] = [significant(one["model"]["values"].get(name)) for one in group]
        columns[f"{short}\nfloat32"] = [significant(one["rounding"].get(name)) for one in group]
    for place in ("inside", "outside"):
        columns[f"bad\n{place}"] = [str(sum(v for v in one[place].values() if isinstance(v, int))) for one in group]
    return columns


def _label(content: Content) -> str:
    return f"{content['name']}, {content['constants']}" if content["constants"] else str(content["name"])


def _costs(costs: Content) -> dict[str, list[str]]:
    works = list(next(iter(costs.values()))["ns"])
    columns = {"source": list(costs)}
    for work in works:
        columns[work] = [f"{significant(one['ns'][work])} ({one['ratio'][work]:.2f})" for one in costs.values()]
    return columns


def _picture(png: bytes, title: str) -> str:
    return figure(f'<img alt="{escape(title)}" src="{address(png, loss=True)}">', title)


CHARTS = {
    "truth": "Truths: error over time for a profile at five albedos.",
    "laws": "Laws: error of R_d over the time of one evaluation.",
    "samplers": "Samplers: error at an edge of light over time.",
    "fits": "Fits: error of constants over time.",
}


def speed(evidence: EvidenceFolder) -> Iterator[str]:
    """Yield the parts of the section."""
    content = evidence.content("tradeoff")
    if content is None:
        yield missing("tradeoff")
        return
    for name, title in CHARTS.items():
        if name in content:
            # Parts may have been measured on different days.
            yield evidence.origin({"made": content["made"], **content[name]})
            yield evidence.drawing(f"tradeoff-{name}", title)
            yield details(f"{escape(title)} The numbers", _numbers(content[name]))


def _numbers(part: Content) -> str:
    tables = []
    for panel in part["panels"].values():
        points = panel["points"]
        columns = {
            "": [f"{one['method']}, {one['label']}" if one["label"] else one["method"] for one in points],
            "cost": [with_spread(**one["cost"]) for one in points],
            "error": [with_spread(**one["error"]) for one in points],
            "worst": [significant(one["worst"]["value"]) if one["worst"] else ABSENT for one in points],
            "stands": [one["standing"] for one in points],
        }
        caption = f"cost: {panel['cost']}; error: {panel['error']}".replace("$", "")
        tables.append(markup(column_table(panel["title"].replace("$", ""), columns, caption, left=("", "stands"))))
    return "\n".join([*tables, *(paragraph(note, "dim") for note in part["notes"])])


HOLDS = {
    True: "No law, map or solver of this project has a red cell inside its stated range.",
    False: "A law, map or solver of this project has a red cell inside its stated range.",
}
UNKNOWN = "no reference there: NaN, sign and order only"
NOT_JUDGED = Verdict.NOT_JUDGED.words
ATLAS = "stability-"
FIRST = "stability-float32"  # the arithmetic of shaders: open, the others folded


def failures(evidence: EvidenceFolder) -> Iterator[str]:
    """Yield the parts of the section."""
    content = evidence.content("stability")
    if content is None:
        yield missing("stability")
        return
    yield evidence.origin(content)
    yield paragraph(HOLDS[bool(content["passed"])], "bold")
    aside = sum(int(one["count"]) for one in content["regions"] if one["class"] == NOT_JUDGED)
    yield paragraph(f"{aside} cells, of all laws, are not judged: there is no reference value.", "dim")
    columns = _advice(content["regions"])
    yield markup(column_table("Where cells are red, and what helps", columns, left=("as",), fold=("what helps",)))
    for path in sorted(evidence.folder.glob(f"{ATLAS}*.svg")):
        title = f"Where laws fail: {path.stem.removeprefix(ATLAS).replace('-', ' ')}"
        figure = evidence.drawing(path.stem, f"{title}. A cell is an albedo and a radius or share.", on_paper=True)
        yield details(title, figure, is_open=path.stem == FIRST)


def _advice(regions: Sequence[Content]) -> dict[str, list[str]]:
    groups: dict[str, list[Content]] = {}
    for region in regions:
        # Earlier versions wrote a cause and its remedy.
        sentence = region["advice"] if "advice" in region else f"{region['cause']}: {region['remedy'] or UNKNOWN}"
        groups.setdefault(sentence or UNKNOWN, []).append(region)
    rows = sorted(groups.items(), key=lambda item: -len({one["law"] for one in item[1]}))
    return {
        "laws": [str(len({one["law"] for one in group})) for _, group in rows],
        "cells": [str(sum(int(one["count"]) for one in group)) for _, group in rows],
        "as": [", ".join(sorted({one["class"] for one in group})) for _, group in rows],
        "what helps": [sentence for sentence, _ in rows],
    }


def promises(evidence: EvidenceFolder) -> Iterator[str]:
    """Yield the parts of the section; nothing where no checkout measured them."""
    if (evidence.folder / FILE).exists():
        made, claims = read_claims(evidence.folder)
        yield evidence.origin({"made": made})
        yield from map(markup, claim_tables(claims))

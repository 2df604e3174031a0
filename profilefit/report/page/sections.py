"""Sections of the page: records with what makes them again, and measurements of the laws as the commands wrote them."""

from __future__ import annotations

import hashlib
import shlex
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from html import escape
from pathlib import Path

from mcml_sim.files.whole_file import MOST_JSON, parse_json, read_whole
from profilefit.errors import InputError
from profilefit.fitting.quality import MEASURES, OF_MAP, OF_PROFILE
from profilefit.recipes.evidence import digest, stale
from profilefit.recipes.record import record_setting
from profilefit.recipes.run import preset_photons
from profilefit.report.drawing import address, checked, inline
from profilefit.report.figures import record_figures as plots
from profilefit.report.figures.canvas import only
from profilefit.report.kinds import stack_table, sum_tables
from profilefit.report.page.markup import command, details, element, figure, markup, paragraph
from profilefit.report.records import Content, Source
from profilefit.report.tables.cells import ABSENT, column_table, row_table, significant
from profilefit.report.tables.claims_table import FILE, claim_tables, read_claims
from profilefit.report.tables.record_tables import photons_text, record_tables
from profilefit.report.tables.tradeoff_tables import point_columns
from profilefit.studies.stability.cells import Verdict

SHOWN = 12  # letters of a SHA-256


def provenance(source: Source, page: str) -> Iterator[str]:
    """Yield digests of data and records, libraries, the commands that make it again; `page` is the file's own name."""
    contents = {name: source.content(name) for name in source.paths}
    columns = {
        "record": list(contents),
        "photons": [photons_text(one) for one in contents.values()],
        "seed": [str(one["seed"]) for one in contents.values()],
        "preset": [str(one["preset"]) for one in contents.values()],
        "data": [str(one.get("data_digest", ABSENT))[:SHOWN] for one in contents.values()],
        "record's own": [hashlib.sha256(path.read_bytes()).hexdigest()[:SHOWN] for path in source.paths.values()],
    }
    caption = f"SHA-256, the first {SHOWN} letters, of the numbers that were fitted and of the record's file"
    yield markup(column_table("Records", columns, caption, left=("record", "preset", "data", "record's own")))
    versions = {tuple(sorted((one.get("versions") or {}).items())) for one in contents.values()} - {()}
    for known in sorted(versions):
        yield paragraph("Made with " + ", ".join(f"{name} {number}" for name, number in known) + ".", "dim")
    yield paragraph(f"SHA-256 over all records of the folder: {digest(source.folder)}", "dim")
    yield paragraph("To make all of it again (measurements with the records have their own commands, beside them):")
    shown = shlex.join(["profilefit", "report", *(source.names or ()), "--fits", "fits", "--html", page])
    yield command("\n".join([*_remake_lines(contents, bool(source.names)), shown]))


def _remake_lines(contents: Mapping[str, Content], named: bool = True) -> list[str]:
    """Return the commands that make these records again, a line for each preset, seed and number of photons."""
    groups: dict[str, list[str]] = {}
    for name, one in contents.items():
        options, photons = f"--preset {one['preset']} --seed {one['seed']}", (one.get("truth") or {}).get("photons")
        if photons not in (None, preset_photons(one["preset"], record_setting(one))):
            options += f" --photons {photons}"
        groups.setdefault(options, []).append(name)
    alone = len(groups) == 1 and not named
    return [
        " ".join(["profilefit regenerate", *([] if alone else map(shlex.quote, names)), options, "--out fits"])
        for options, names in groups.items()
    ]


# What a figure shows, by how its name begins.
CAPTIONS = {
    "liang-7-profile": "Equation (7): r R_d of photons, of the exact half space, of the law printed and regenerated.",
    "liang-7-error": "R_d of the law over the exact one, less 1; the band holds photon noise and model discrepancy.",
    "liang-8-albedo": "The map from A to alpha, and its errors to the right.",
    "liang-11-a": "Coefficient a of (7) over alpha: fits at each albedo, the law (11) printed and regenerated.",
    "liang-13-b": "Coefficient b of (7) over alpha: fits at each albedo, the law (13) printed and regenerated.",
    "liang-15-c": "Coefficient c of (7) over alpha: fits at each albedo, the law (15) printed and regenerated.",
    "liang-19-inverse": "The inverse cdf (19)-(20): printed, regenerated and exact.",
    "inversion-error": "Largest error of inverse cdfs in the share of the reflected energy, by albedo.",
    "constants": "Printed constants against regenerated ones. z: their difference over its error.",
    "quality": "Error over the reduced albedo, at held-out albedos.",
    "residuals": "Residuals of the fit.",
}


def _drawn(plan: plots.Plan, source: Source) -> str:
    """Return the figure of a plan as part of a page; where it cannot be drawn, why."""
    reason = plan.missing or ", ".join(f"no record {name}" for name in plan.needs if name not in source.paths)
    if reason:
        return paragraph(f"{plan.name}: {reason}", "dim")
    title = CAPTIONS.get(plan.name) or CAPTIONS[plan.name.split("-")[0]]
    return _drawing(plan, source, title)


def _drawing(plan: plots.Plan, source: Source, title: str) -> str:
    """Return the figure of a plan, all of whose records are there."""
    with tempfile.TemporaryDirectory() as folder, only("svg"):
        (file,) = plan.drawn(source, Path(folder))
        return figure(inline(file.read_text(encoding="utf-8"), plan.name, title), title)


def whole_figure(source: Source, name: str) -> str:
    """Return a figure of more than one record: constants, printed against regenerated, or quality by albedo."""
    (plan,) = (one for one in plots.plans(source) if one.name == name)
    return _drawn(plan, source)


def paper_figures(source: Source) -> str:
    """Return the figures of the paper again, as far as there are records for them."""
    return "\n".join(_drawn(plan, source) for plan in plots.PAPER if set(plan.needs) <= set(source.paths))


def record_part(source: Source, name: str, figures: bool = True) -> str:
    """Return everything of one record, folded; without `figures` only what its .json has."""
    content = source.content(name)
    tables = "\n".join(markup(part) for part in record_tables(content))
    plans_of = [plan for plan in plots.record_plans(source, name) if not plan.missing] if figures else []
    corner = f"corner-{name}"  # half of a page's bytes, for figures that few look at
    drawings = "\n".join(_drawn(plan, source) for plan in plans_of if plan.name != corner)
    draw = f"profilefit report {shlex.quote(name)} --figures figures  # and the posterior, constant against constant"
    commands = [draw] if any(plan.name == corner for plan in plans_of) else []
    command_again = command("\n".join([*_remake_lines({name: content}), *commands]))
    title = element("b", escape(name)) + " " + element("span", escape(content["title"]), class_="dim")
    return details(title, element("div", tables + drawings + command_again, class_="record"), f"record-{name}")


ALL = "all"
MOST_DRAWING = 2**24  # bytes; the largest of ours has a fourteenth of it


@dataclass(frozen=True)
class EvidenceFolder:
    """A folder that `profilefit check`, `stability` and `tradeoff` wrote into with `--out`.

    records  the folder whose records the page shows
    """

    folder: Path
    records: Path

    def section(self, name: str, parts: Callable[[EvidenceFolder, Content], Iterator[str]]) -> str:
        """Return the parts of one section; InputError where the files of `profilefit NAME` lack what it shows."""
        missing = paragraph("Not measured here. This does it:", "dim") + command(f"profilefit {name} --out evidence")
        try:
            content = self.content(name)
            shown: Iterable[str] = [missing] if content is None else parts(self, content)
            return "\n".join([*shown, *_pictures(self, RENDERS if name == "check" else {})])
        except (KeyError, TypeError, ValueError, AttributeError, OSError) as error:
            expected = f"{self.folder / name}.json: expected what `profilefit {name} --out` writes"
            raise InputError(f"{expected}, got {type(error).__name__}: {error}") from error

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
GROUPS = {"laws": ("Laws in float32", OF_PROFILE), "maps": ("Maps in float32", OF_MAP[:2])}
MEANING = (
    "model: the record's error against the exact half space or photons, worst albedo; float32: what rounding adds; "
    "bad: NaN, Inf, negative or not monotone, in and out of where the law holds"
)
COSTS = "Cost of one evaluation: ns of the fastest turn; in brackets the median of its ratios to normalized diffusion's"


def layers(source: Source, evidence: EvidenceFolder) -> Iterator[str]:
    """Yield the parts of the section: records of stacks, sums of Gaussians, pictures; none without a record."""
    table = None if source.names else stack_table(source.folder)
    if table is None:
        return
    yield markup(table)
    if sums := plots.sums_of(source.folder):
        yield _drawing(plots.Plan(plots.OF_SUMS, (), (), plots.sum_figure), source, plots.sum_caption(sums))
        for name, one in sums.items():
            yield details(f"{escape(name)}: the numbers", "\n".join(map(markup, sum_tables(one))))
    yield from _pictures(evidence, OF_LAYERS)


def shader(evidence: EvidenceFolder, content: Content) -> Iterator[str]:
    """Yield the parts of its section."""
    yield evidence.origin(content)
    counts = " and ".join(f"{len(content[key])} {key}" for key in GROUPS)
    verdict = "all pass" if content["passed"] else "bounds are broken"
    yield paragraph(f"{counts} on {content['device']}: {verdict}.", "bold")
    for key, (title, measures) in GROUPS.items():
        errors = (f"{MEASURES[name].symbol}\n{of}" for name in measures for of in ("model", "float32"))
        header, rows = ("law", "result", "light", "n", *errors, "bad\ninside", "bad\noutside"), []
        for one in content[key]:
            setting = (one["setting"]["illumination"], f"{one['setting']['n']:g}")
            known = (of.get(name) for name in measures for of in (one["model"]["values"], one["rounding"]))
            bad = (sum(v for v in one[place].values() if isinstance(v, int)) for place in ("inside", "outside"))
            result = "FAIL" if one["broken"] else "pass"
            rows.append((_label(one), result, *setting, *map(significant, known), *map(str, bad)))
        if rows:
            yield markup(row_table(title, header, rows, MEANING, left=("light", "result"), fold=("law",)))
    if broken := [f"{_label(one)}: {line}" for key in GROUPS for one in content[key] for line in one["broken"]]:
        yield element("ul", "".join(element("li", escape(line)) for line in broken))
    if costs := content["costs"]:
        columns = {"source": list(costs)}
        for work in next(iter(costs.values()))["ns"]:
            columns[work] = [f"{significant(one['ns'][work])} ({one['ratio'][work]:.2f})" for one in costs.values()]
        yield markup(column_table(COSTS, columns, left=("source",)))


def _label(content: Content) -> str:
    return f"{content['name']}, {content['constants']}" if content["constants"] else str(content["name"])


def _pictures(evidence: EvidenceFolder, titles: Mapping[str, str]) -> Iterator[str]:
    for name, title in titles.items():
        if (path := evidence.folder / name).exists():
            source = address(path.read_bytes(), loss=True)
            yield figure(f'<img alt="{escape(title)}" src="{source}">', title)


CHARTS = {
    "truth": "Truths: error over time for a profile at five albedos.",
    "laws": "Laws: error of R_d over the time of one evaluation.",
    "samplers": "Samplers: error at an edge of light over time.",
    "fits": "Fits: error of constants over time.",
}


def speed(evidence: EvidenceFolder, content: Content) -> Iterator[str]:
    """Yield the parts of its section."""
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
        columns = point_columns(points) | {"stands": [one["standing"] for one in points]}
        caption = f"cost: {panel['cost']}; error: {panel['error']}".replace("$", "")
        tables.append(markup(column_table(panel["title"].replace("$", ""), columns, caption, left=("", "stands"))))
    return "\n".join([*tables, *(paragraph(note, "dim") for note in part["notes"])])


HOLDS = {
    True: "No law, map or solver of this project has a red cell inside its stated range.",
    False: "A law, map or solver of this project has a red cell inside its stated range.",
}
UNKNOWN = "no reference there: NaN, sign and order only"
ATLAS = "stability-"
FIRST = "stability-float32"  # the arithmetic of shaders: open, the others folded


def failures(evidence: EvidenceFolder, content: Content) -> Iterator[str]:
    """Yield the parts of its section."""
    yield evidence.origin(content)
    yield paragraph(HOLDS[bool(content["passed"])], "bold")
    aside = sum(int(one["count"]) for one in content["regions"] if one["class"] == Verdict.NOT_JUDGED.words)
    yield paragraph(f"{aside} cells, of all laws, are not judged: there is no reference value.", "dim")
    groups: dict[str, list[Content]] = {}
    for region in content["regions"]:
        # Earlier versions wrote a cause and its remedy.
        sentence = region["advice"] if "advice" in region else f"{region['cause']}: {region['remedy'] or UNKNOWN}"
        groups.setdefault(sentence or UNKNOWN, []).append(region)
    rows = dict(sorted(groups.items(), key=lambda item: -len({one["law"] for one in item[1]})))
    columns = {
        "laws": [str(len({one["law"] for one in group})) for group in rows.values()],
        "cells": [str(sum(int(one["count"]) for one in group)) for group in rows.values()],
        "as": [", ".join(sorted({one["class"] for one in group})) for group in rows.values()],
        "what helps": list(rows),
    }
    yield markup(column_table("Where cells are red, and what helps", columns, left=("as",), fold=("what helps",)))
    for path in sorted(evidence.folder.glob(f"{ATLAS}*.svg")):
        title = f"Where laws fail: {path.stem.removeprefix(ATLAS).replace('-', ' ')}"
        figure = evidence.drawing(path.stem, f"{title}. A cell is an albedo and a radius or share.", on_paper=True)
        yield details(title, figure, is_open=path.stem == FIRST)


def promises(evidence: EvidenceFolder) -> Iterator[str]:
    """Yield the parts of the section; nothing where no checkout measured them."""
    if (evidence.folder / FILE).exists():
        made, claims = read_claims(evidence.folder)
        yield evidence.origin({"made": made})
        yield from map(markup, claim_tables(claims))

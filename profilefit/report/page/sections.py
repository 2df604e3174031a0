"""Sections of the page: records with what makes them again, and measurements of the laws as the commands wrote them."""

from __future__ import annotations

import hashlib
import shlex
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from html import escape
from pathlib import Path

from mcml_sim.files.whole_file import MOST_JSON, parse_json, read_whole
from profilefit.errors import InputError
from profilefit.fitting.quality import MEASURES, OF_MAP, OF_PROFILE
from profilefit.recipes.evidence import digest, stale
from profilefit.recipes.record import SPANS, record_setting
from profilefit.recipes.run import preset_photons
from profilefit.report.drawing import address, checked, inline
from profilefit.report.figures import record_figures as plots
from profilefit.report.figures.canvas import only
from profilefit.report.kinds import stack_table, sum_tables
from profilefit.report.page.markup import command, details, element, figure, gallery, markup, paragraph
from profilefit.report.records import Content, Source, converged, index_words, measures
from profilefit.report.tables.cells import ABSENT, column_table, row_table, significant
from profilefit.report.tables.claims_table import FILE, claim_tables, read_claims
from profilefit.report.tables.record_tables import photons_text, record_tables, summary
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
    caption = f"First {SHOWN} letters of the SHA-256: of the fitted data, and of the record's file"
    table = column_table("", columns, caption, left=("record", "preset", "data", "record's own"))
    yield details("Photons, seed and checksums of each record", markup(table))
    versions = {tuple(sorted((one.get("versions") or {}).items())) for one in contents.values()} - {()}
    for known in sorted(versions):
        yield paragraph("Made with " + ", ".join(f"{name} {number}" for name, number in known) + ".", "dim")
    yield paragraph(f"SHA-256 over all records of the folder: {digest(source.folder)}", "dim")
    yield paragraph("These commands make the records and this page again:")
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
    "liang-7-profile": "Equation (7): r R_d by photons, by the exact solution, by printed and by fitted constants.",
    "liang-7-error": "Relative error of R_d by equation (7). The band holds photon noise and model error.",
    "liang-8-albedo": "The albedo inversion, equation (8), and its errors to the right.",
    "liang-11-a": "Coefficient a of equation (7) over the albedo: printed, and fitted again.",
    "liang-13-b": "Coefficient b of equation (7) over the albedo: printed, and fitted again.",
    "liang-15-c": "Coefficient c of equation (7) over the albedo: printed, and fitted again.",
    "liang-19-inverse": "The inverse cdf, equations (19) and (20): printed, fitted again, and exact.",
    "inversion-error": "Largest error of inverse cdfs, as a share of the reflected light, over the albedo.",
    "constants": "Each constant as printed and as fitted again. z is the difference, divided by its standard error.",
    "quality": "Errors of profile models over the reduced albedo, at held-out albedos.",
    "residuals": "Residuals of the fit: the model divided by the data, minus 1, with the standard errors of the data.",
}
WHOLE = {"quality": "Errors of all records by albedo", "constants": "Printed constants and fitted ones"}
PAPER = "The records allow these figures of the paper. The command draws them, as PNG and SVG, into the folder figures."
FITTED = (
    "A record is a file with the constants of one fit. The constants were fitted to simulated light (photons) or to "
    "the exact solution. Each constant has its standard errors. For example, hazard-diffuse is the record of the model "
    "hazard under diffuse illumination.",
    "Symbols: alpha is the reduced albedo, and A the total diffuse reflectance. The length l (mfp) is the transport "
    "mean free path 1 / (mu_s' + mu_a). R_d(r) is the reflected light per area at the distance r. The cdf is the share "
    "of the reflected light within r. n is the refractive index, and g the mean cosine of scattering. Diffuse "
    "illumination is cosine-weighted light from all sides.",
)
INTRO = {  # of sections, in words
    "records": "Each line opens one record: its constants with standard errors, the fit, and its errors by albedo.",
    "quality": "Each curve is one model. Its errors are relative to the exact solution, at held-out albedos.",
    "stacks": "These records describe layered media, for example skin. A click enlarges a picture.",
    "tradeoff": "Each chart compares techniques by error and time. Techniques on the lower left are accurate and fast.",
    "stability": "Each model was evaluated at many albedos and radii, in several arithmetics, for example float32. Red "
    "cells mark values that fail.",
    "check": "Exported shader sources ran on the device below. The tables compare their values with the reference.",
    "claims": "The documentation states figures of accuracy and speed. Each row compares one figure with its last "
    "measurement. Each line below is the command that measures again.",
    "provenance": "Checksums and seeds identify the data of each record.",
}
KINDS = {"delta_A": "albedo inversion", "rel": "profile model", "inversion_error": "inverse cdf"}  # by their measures
LIGHT = {"searchlight": "pencil beam", "diffuse": "diffuse illumination"}


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


def whole_figures(source: Source) -> str:
    """Return the figures of more than one record: quality by albedo, and printed constants against regenerated ones."""
    plans = {plan.name: plan for plan in plots.plans(source)}
    drawn = {name: _drawn(plans[name], source) for name in ("quality", "constants")}
    return "".join(details(WHOLE[name], part, "", name == "quality", "whole") for name, part in drawn.items())


def paper_figures(source: Source) -> str:
    """Return the figures of the paper again, as far as records are named that they show; else how to draw them."""
    plans = [plan for plan in plots.PAPER if set(plan.needs) <= set(source.paths)]
    if source.names or not plans:
        return "\n".join(_drawn(plan, source) for plan in plans)
    listed = "".join(element("li", escape(CAPTIONS[plan.name])) for plan in plans)
    needed = shlex.join(dict.fromkeys(name for plan in plans for name in plan.needs))
    return paragraph(PAPER) + element("ul", listed) + command(f"profilefit report {needed} --figures figures")


def record_part(source: Source, name: str) -> str:
    """Return everything of one record, folded; figures only where records are named, as 25 records take a minute."""
    content = source.content(name)
    tables = "\n".join(markup(part) for part in record_tables(content))
    plans_of = [plan for plan in plots.record_plans(source, name) if not plan.missing]
    corner = f"corner-{name}"  # half of a page's bytes, for figures that few look at
    drawings = "\n".join(_drawn(plan, source) for plan in plans_of if source.names and plan.name != corner)
    draw = f"profilefit report {shlex.quote(name)} --figures figures"
    command_again = command("\n".join([*_remake_lines({name: content}), *([draw] if plans_of else [])]))
    colour = "green" if "fit" not in content or converged(content) else "red"
    result = content["fit"]["result"] if "fit" in content else f"{len(content['readings'])} readings"
    status = element("span", escape(result.partition(":")[0]), class_=colour)
    title = f"{element('b', escape(name))} {element('span', escape(in_words(content)), class_='dim')} {status}"
    return details(title, tables + drawings + command_again, f"record-{name}", group="records")


def in_words(content: Content) -> str:
    """Return the kind, illumination, n and g of a record, in words."""
    if content["pipeline"] == "evidence":
        return "comparison of readings of a paper"
    kind = next((words for measure, words in KINDS.items() if measures(content, measure)), KINDS["inversion_error"])
    spans = {name: (index_words(content, name), content.get(key)) for name, key in SPANS.items()}
    of = (f"{name} {'in' if span else '='} {words}" for name, (words, span) in spans.items() if span or words != "0")
    return f"{kind}, {LIGHT[content['setting']['illumination']]}, {', '.join(of)}"


def fitted(source: Source) -> str:
    """Return a description of the records, and their tables, folded."""
    contents = {name: source.content(name) for name in source.paths}
    kinds = Counter(in_words(one).partition(",")[0] for one in contents.values())
    listed = ", ".join(f"{kind} ({count})" for kind, count in kinds.items())
    table = details("Largest errors of every record", markup(summary(contents, glyphs=False)))
    return "".join(map(paragraph, (*FITTED, f"Records by kind: {listed}."))) + table


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
        line = command(f"profilefit {name} --out evidence")
        missing = paragraph("Not measured here. This command measures it:", "dim") + line
        try:
            content = self.content(name)
            shown: Iterable[str] = [missing] if content is None else (paragraph(INTRO[name]), *parts(self, content))
            return "\n".join([*shown, _pictures(self, RENDERS, name) if name == "check" else ""])
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
        return figure(self.drawn(path, title), title, on_paper) if path.exists() else ""

    def drawn(self, path: Path, title: str) -> str:
        """Return an SVG of the folder as part of the page; ValueError where it is none of matplotlib's."""
        content = read_whole(path, MOST_DRAWING)
        if len(content) > MOST_DRAWING:
            raise ValueError(f"a drawing of more than {MOST_DRAWING} bytes, {path.name}")
        return inline(checked(content.decode("utf-8")), path.stem, title)

    def origin(self, content: Content) -> str:
        """Return when, where and by which command it was measured, and whether the records have changed since."""
        made = content["made"]
        machine = made.get("machine") or {}
        when = f"Measured {made.get('date')} on {machine.get('processor')} ({machine.get('cores')} cores) by:"
        parts = [paragraph(when, "dim"), command(str(made.get("command")))]
        if content.get("of", ALL) != ALL:
            of = content["of"]
            listed = ", ".join(of) if isinstance(of, list) else str(of)
            parts.append(paragraph(f"Not of everything: of {listed}.", "red"))
        if stale(made, self.records):
            parts.append(paragraph("Records or version have changed since then: run it again.", "red"))
        return "\n".join(parts)


# `python -m benchmarks.render` makes them.
RENDERS = {
    "render-laws.png": "A head by the exact profile, by four models and by the separable filter, and their errors.",
    "render-error.png": "Error of pictures over samples per pixel and over time, relative to the exact picture.",
    "render-choices.png": "One head by each sampling technique.",
    "render-17-samples.png": "One head by 17 samples per pixel, as in Figure 14 of Liang et al.",
}
# `python -m benchmarks.scenes --pictures`, and those of layers, heart, sea and fur, make them.
OF_LAYERS = {
    "render-skin.png": "Skin: technique, reference, error, and two rivals.",
    "render-layers.png": "Layered skin, likewise.",
    "render-ear.png": "An ear, lit from behind: model of the layers, dipole of the first, one semi-infinite medium.",
    "render-heart.png": "A heart, likewise.",
    "render-heart-cost.png": "Error of the heart over time, by each technique at four sizes.",
    "render-heart-map.png": "Error of the heart over texel size and view. The lowest of three is bold.",
    "render-sea.png": "Under water, likewise.",
    "render-sea-cost.png": "Error under water over the time of a view, by each technique.",
    "render-fur.png": "Fur, likewise.",
    "render-fur-cost.png": "Error of fur over time, at six angles.",
    "own-data.png": "Errors of tissue's properties by place and error of the data; n and g known or not.",
}
GROUPS = {"laws": ("Profile models in float32", OF_PROFILE), "maps": ("Albedo inversions in float32", OF_MAP[:2])}
SHOWN_AS = {"rel": "R_d", "ks": "cdf", "inversion_error": "radius"}
MEANING = (
    "model: largest error over the albedo, relative to the exact solution or to photons; float32: error that rounding "
    "adds; bad: number of values that are NaN, infinite, negative or not monotone, inside and outside the range of the "
    "model"
)
COSTS = "Nanoseconds of the fastest run; in brackets the median ratio to the time of normalized diffusion"


def layers(source: Source, evidence: EvidenceFolder) -> Iterator[str]:
    """Yield the parts of the section: records of stacks, sums of Gaussians, pictures; none without a record."""
    table = None if source.names else stack_table(source.folder)
    if table is None:
        return
    yield markup(table)
    if sums := plots.sums_of(source.folder):
        yield _drawing(plots.Plan(plots.OF_SUMS, (), (), plots.sum_figure), source, plots.sum_caption(sums))
        for name, one in sums.items():
            yield details(f"{escape(name)}: the numbers", "\n".join(map(markup, sum_tables(one))), group="sums")
    yield _pictures(evidence, OF_LAYERS, "layers")


def shader(evidence: EvidenceFolder, content: Content) -> Iterator[str]:
    """Yield the parts of its section."""
    yield evidence.origin(content)
    counts = " and ".join(f"{len(content[key])} {title.split(' in ')[0].lower()}" for key, (title, _) in GROUPS.items())
    verdict = "all pass" if content["passed"] else "bounds are broken"
    yield paragraph(f"{counts} on {content['device']}: {verdict}.", "bold")
    for key, (title, names) in GROUPS.items():
        errors = (f"{SHOWN_AS.get(name, MEASURES[name].symbol)}\n{of}" for name in names for of in ("model", "float32"))
        header, rows = ("law", "result", "light", "n", *errors, "bad\ninside", "bad\noutside"), []
        for one in content[key]:
            setting = (one["setting"]["illumination"], f"{one['setting']['n']:g}")
            known = (of.get(name) for name in names for of in (one["model"]["values"], one["rounding"]))
            bad = (sum(v for v in one[place].values() if isinstance(v, int)) for place in ("inside", "outside"))
            result = "FAIL" if one["broken"] else "pass"
            rows.append((_label(one), result, *setting, *map(significant, known), *map(str, bad)))
        if rows:
            table = row_table("", header, rows, MEANING, left=("light", "result"), fold=("law",))
            yield details(title, markup(table), group="shader")
    if broken := [f"{_label(one)}: {line}" for key in GROUPS for one in content[key] for line in one["broken"]]:
        yield element("ul", "".join(element("li", escape(line)) for line in broken))
    if costs := content["costs"]:
        columns = {"source": list(costs)}
        for work in next(iter(costs.values()))["ns"]:
            columns[work] = [f"{significant(one['ns'][work])} ({one['ratio'][work]:.2f})" for one in costs.values()]
        table = column_table("", columns, COSTS, left=("source",))
        yield details("Time of one evaluation", markup(table), group="shader")


def _label(content: Content) -> str:
    return f"{content['name']}, {content['constants']}" if content["constants"] else str(content["name"])


def _pictures(evidence: EvidenceFolder, titles: Mapping[str, str], group: str) -> str:
    paths = {title: path for name, title in titles.items() if (path := evidence.folder / name).exists()}
    shown = {title: f'<img alt="" src="{address(path.read_bytes(), loss=True)}">' for title, path in paths.items()}
    return gallery(shown, f"pictures-{group}")


CHARTS = {
    "truth": "References: error of a profile at five albedos, over time.",
    "laws": "Profile models: error of R_d over the time of one evaluation.",
    "samplers": "Samplers: error at an edge of light, over time.",
    "fits": "Fits: error of constants, over time.",
}


def speed(evidence: EvidenceFolder, content: Content) -> Iterator[str]:
    """Yield the parts of its section."""
    paths = {title: evidence.folder / f"tradeoff-{name}.svg" for name, title in CHARTS.items() if name in content}
    yield gallery({title: evidence.drawn(path, title) for title, path in paths.items() if path.exists()}, "charts")
    for name in CHARTS:
        if name in content:  # parts may have been measured on different days
            numbers = evidence.origin({"made": content["made"], **content[name]}) + _numbers(content[name])
            yield details(f"Numbers: {CHARTS[name].partition(':')[0].lower()}", numbers, group="tradeoff")


def _numbers(part: Content) -> str:
    tables = []
    for panel in part["panels"].values():
        points = panel["points"]
        columns = point_columns(points) | {"stands": [one["standing"] for one in points]}
        caption = f"cost: {panel['cost']}; error: {panel['error']}".replace("$", "")
        tables.append(markup(column_table(panel["title"].replace("$", ""), columns, caption, left=("", "stands"))))
    return "\n".join([*tables, *(paragraph(note, "dim") for note in part["notes"])])


HOLDS = {
    True: "No model, map or solver of this project fails (red cell) inside its stated range.",
    False: "A model, map or solver of this project fails (red cell) inside its stated range.",
}
UNKNOWN = "no reference there: NaN, sign and order only"
ATLAS = "stability-"


def failures(evidence: EvidenceFolder, content: Content) -> Iterator[str]:
    """Yield the parts of its section."""
    yield evidence.origin(content)
    yield paragraph(HOLDS[bool(content["passed"])], "bold")
    aside = sum(int(one["count"]) for one in content["regions"] if one["class"] == Verdict.NOT_JUDGED.words)
    yield paragraph(f"{aside} cells, of all models, are not judged: there is no reference value.", "dim")
    groups: dict[str, list[Content]] = {}
    for region in content["regions"]:
        # Earlier versions wrote a cause and its remedy.
        sentence = region["advice"] if "advice" in region else f"{region['cause']}: {region['remedy'] or UNKNOWN}"
        groups.setdefault(sentence or UNKNOWN, []).append(region)
    rows = dict(sorted(groups.items(), key=lambda item: -len({one["law"] for one in item[1]})))
    columns = {
        "models": [str(len({one["law"] for one in group})) for group in rows.values()],
        "cells": [str(sum(int(one["count"]) for one in group)) for group in rows.values()],
        "result": [", ".join(sorted({one["class"] for one in group})) for group in rows.values()],
        "what helps": list(rows),
    }
    yield markup(column_table("Where cells are red, and what helps", columns, left=("result",), fold=("what helps",)))
    paths = {path: path.stem.removeprefix(ATLAS).replace("-", " ") for path in evidence.folder.glob(f"{ATLAS}*.svg")}
    titles = {f"Arithmetic: {words}": path for path, words in sorted(paths.items())}
    yield paragraph("One map for each arithmetic. One cell is one albedo and one radius (or share of the light).")
    yield gallery({title: evidence.drawn(path, title) for title, path in titles.items()}, "stability-maps")


def promises(evidence: EvidenceFolder) -> Iterator[str]:
    """Yield the parts of the section; nothing where no checkout measured them."""
    if (evidence.folder / FILE).exists():
        made, claims = read_claims(evidence.folder)
        yield evidence.origin({"made": made})
        for line, table in claim_tables(claims, titled=False).items():
            yield details(element("code", escape(line)), markup(table), group="claims")

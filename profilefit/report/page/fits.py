"""Records as parts of the page, each with tables, figures, the command that makes it; digests and versions."""

from __future__ import annotations

import hashlib
import shlex
import tempfile
from collections.abc import Callable, Iterator, Mapping
from html import escape
from pathlib import Path

from profilefit.recipes.evidence import digest
from profilefit.recipes.record import record_setting
from profilefit.recipes.run import preset_photons
from profilefit.report.drawing import inline
from profilefit.report.figures.canvas import only
from profilefit.report.figures.record_figures import PAPER, Plan, plans, record_plans
from profilefit.report.page.markup import command, details, element, figure, markup, paragraph
from profilefit.report.records import Content, Source
from profilefit.report.tables.cells import ABSENT, column_table
from profilefit.report.tables.record_tables import record_tables, summary

SHOWN = 12  # letters of a SHA-256


def provenance(source: Source, page: str) -> Iterator[str]:
    """Yield digests of data and records, libraries, the commands that make it again; `page` is the file's own name."""
    contents = {name: source.content(name) for name in source.paths}
    columns = {
        "record": list(contents),
        "photons": [_photons(one) for one in contents.values()],
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
    yield command("\n".join([*remake_lines(contents, bool(source.names)), shown]))


def remake_lines(contents: Mapping[str, Content], named: bool = True) -> list[str]:
    """Return the commands that make these records again, a line for each preset, seed and number of photons."""
    groups: dict[str, list[str]] = {}
    for name, one in contents.items():
        groups.setdefault(_options(one), []).append(name)
    alone = len(groups) == 1 and not named
    return [
        " ".join(["profilefit regenerate", *([] if alone else map(shlex.quote, names)), options, "--out fits"])
        for options, names in groups.items()
    ]


def _options(content: Content) -> str:
    options = f"--preset {content['preset']} --seed {content['seed']}"
    photons = (content.get("truth") or {}).get("photons")
    usual = preset_photons(content["preset"], record_setting(content))
    return options if photons in (None, usual) else f"{options} --photons {photons}"


def _photons(content: Content) -> str:
    photons = (content.get("truth") or {}).get("photons")
    return ABSENT if photons is None else f"{photons:.3g}".replace("e+0", "e")


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
    "quality": "Error over the single-scattering albedo, at held-out albedos.",
    "residuals": "Residuals of the fit.",
}


def drawn(plan: Plan, source: Source) -> str:
    """Return the figure of a plan as part of a page; where it cannot be drawn, why."""
    reason = plan.missing or ", ".join(f"no record {name}" for name in plan.needs if name not in source.paths)
    if reason:
        return paragraph(f"{plan.name}: {reason}", "dim")
    return drawing(plan.name, lambda out: plan.draw(source, out, name=plan.name))


def drawing(name: str, draw: Callable[[Path], list[Path]], title: str = "") -> str:
    """Return the figure `name` that `draw` writes into a folder; its title is by default the `caption` of its name."""
    with tempfile.TemporaryDirectory() as folder, only("svg"):
        (file,) = draw(Path(folder))
        svg = file.read_text(encoding="utf-8")
    shown = title or caption(name)
    return figure(inline(svg, name, shown), shown)


def caption(name: str) -> str:
    """Return what a figure shows: by its name, or by how that begins."""
    return CAPTIONS.get(name) or CAPTIONS[name.split("-")[0]]


def overview(source: Source) -> str:
    """Return the summary of all records, a line each."""
    return markup(summary({name: source.content(name) for name in source.paths}))


def whole_figure(source: Source, name: str) -> str:
    """Return a figure of more than one record: constants, printed against regenerated, or quality by albedo."""
    (plan,) = (one for one in plans(source) if one.name == name)
    return drawn(plan, source)


def paper_figures(source: Source) -> Iterator[str]:
    """Yield the figures of the paper again, as far as there are records for them."""
    for plan in PAPER:
        if all(name in source.paths for name in plan.needs):
            yield drawn(plan, source)


def record_part(source: Source, name: str, figures: bool = True) -> str:
    """Return everything of one record, folded; without `figures` only what its .json has."""
    content = source.content(name)
    tables = "\n".join(markup(part) for part in record_tables(content))
    plans_of = [plan for plan in record_plans(source, name) if not plan.missing] if figures else []
    corner = f"corner-{name}"  # half of a page's bytes, for figures that few look at
    drawings = "\n".join(drawn(plan, source) for plan in plans_of if plan.name != corner)
    draw = f"profilefit report {shlex.quote(name)} --figures figures  # and the posterior, constant against constant"
    commands = [draw] if any(plan.name == corner for plan in plans_of) else []
    command_again = command("\n".join([*remake_lines({name: content}), *commands]))
    title = element("b", escape(name)) + " " + element("span", escape(content["title"]), class_="dim")
    return details(title, element("div", tables + drawings + command_again, class_="record"), f"record-{name}")

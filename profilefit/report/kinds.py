"""Tables of the records of each kind: of one of them, of all in a folder, and those that fill a page of Markdown."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.console import RenderableType
from rich.text import Text

from mcml_sim.media.setting import ILLUMINATIONS
from profilefit.laws.gaussians import DEFAULT
from profilefit.laws.phases import FORMS
from profilefit.laws.stack import StackLaw
from profilefit.materials import CHANNELS
from profilefit.recipes import record
from profilefit.recipes.folder import PHASES, STACKS
from profilefit.recipes.kinds import Kind, gaussians, phase, stack
from profilefit.recipes.phases import BANDS
from profilefit.recipes.pipelines import read
from profilefit.recipes.stack.gaussians import constant_names, quality
from profilefit.report.records import Content, known_errors, largest_error
from profilefit.report.tables.cells import column_table, row_table, significant, to_error
from profilefit.report.tables.law_tables import markdown_sections
from profilefit.report.tables.markdown import markdown_table, sections
from profilefit.report.tables.record_tables import MEANING_OF_ERROR, record_tables, spaced, summary, title_of
from profilefit.scenes.skin.law import D_EON

Parts = Sequence[RenderableType]
Sections = dict[str, Callable[[], str]]
Paths = Mapping[str, Path]
Row = tuple[str, ...]
Rows = tuple[Row, list[Row]]  # headers, the first that of the record's name, and what is below
RowsOf = Callable[[Mapping[str, Content]], Rows]


def _value_and_errors(one: Content, known: Iterable[str]) -> Row:
    return to_error(one["regenerated"], largest_error(one)), *(significant(one.get(key)) for key in known)


def _meaning(known: Mapping[str, str], meaning: Mapping[str, str]) -> str:
    return "; ".join(f"{word}: {meaning[word]}" for word in known.values())


def _sections(load: Callable[[Path], Content], paths: Paths, **tables: RowsOf) -> Sections:
    """Return tables of these records for Markdown, by the names of their marks (_ for -); none without records."""

    def section(rows_of: RowsOf) -> str:
        return markdown_table(*rows_of({name: load(path) for name, path in paths.items()}))

    return {name.replace("_", "-"): partial(section, rows_of) for name, rows_of in tables.items()} if paths else {}


# Stacks: their layers, the errors of their laws, and each one with all its constants.

MEASURES = "R_d: mean relative error over radii, cdf: largest error, A: relative error"
CAPTION = f"{MEASURES}. Worst of three colours and of thicknesses between the fitted ones"
OF_THICKNESS = f"{MEASURES}; those of a deeper interface are of the stack from its upper layer down"
OF_STACK = MEANING_OF_ERROR | {
    "dr": "exact solution with fewer nodes",
    "model": "misfit of the model, as a random function",
    "jackknife": "spread of fits that leave out one thickness",
}
OF_FIT = "Correlated constants may not converge, but can still be accurate: see their errors above"
LEFT = ("layer", "channel", "interface", "constant", "result")


def stack_table(folder: Path) -> RenderableType | None:
    """Return the records of stacks that lie in a folder of records; None where there are none."""
    paths = record.available(folder / STACKS).values()
    stacks = [stack.read(path) for path in paths if record.read(path)["pipeline"] == stack.PIPELINE]
    if not stacks:
        return None
    worst = [one["quality"]["regenerated"] for one in stacks]
    columns = {
        "stack": [str(one["name"]) for one in stacks],
        "layers": [str(len(one["layers"])) for one in stacks],
        "light": [str(one["setting"]["illumination"]) for one in stacks],
        "n": [f"{one['setting']['n']:g}" for one in stacks],
        "g": [", ".join(f"{g:g}" for g in sorted({layer["g"] for layer in one["layers"]})) for one in stacks],
        "R_d": [significant(max(one["rel"])) for one in worst],
        "cdf": [significant(max(one["ks"])) for one in worst],
        "A": [significant(one["delta_A"]) for one in worst],
    }
    return column_table("Stacks of layers", columns, CAPTION, left=("stack", "light"))


def stack_tables(content: Content) -> list[RenderableType]:
    """Return the tables of a record, as `read` gives it: layers, errors by thickness, constants, how fits ended."""
    unit, layers, of = content["unit"], content["layers"], {content["name"]: content}
    columns = {
        "layer": [one["name"] for one in layers],
        "thickness": ["infinite" if one["thickness"] is None else f"{one['thickness']:g} {unit}" for one in layers],
        **{key: [f"{one[key]:g}" for one in layers] for key in ("n", "g")},
    }
    for key in ("mu_a", "mu_s"):
        columns[f"{key} [1/{unit}]"] = [" ".join(f"{each:g}" for each in one[key]) for one in layers]
    meaning = _meaning(known_errors(content["constants"].values(), numbered=True), OF_STACK)
    tables = {
        "Errors at unfitted thicknesses of the upper layer of an interface": (_stack_errors(of), OF_THICKNESS),
        "Constants of each colour and interface, without unit": (_stack_constants(of), meaning),
        "Fits": (_stack_fits(content), OF_FIT),
    }
    parts = [column_table("Layers, from the surface down; red, green, blue", columns, left=LEFT, fold=("layer",))]
    for title, ((header, rows), caption) in tables.items():  # without the name of the stack, which stands above
        header = tuple({"rel": "R_d", "ks": "cdf"}.get(name, name) for name in header)
        aligned = [name for name in header if name not in LEFT]
        parts.append(row_table(title, header[1:], [row[1:] for row in rows], caption, LEFT, aligned=aligned))
    return list(parts)


def _stack_errors(stacks: Mapping[str, Content]) -> Rows:
    rows: list[Row] = []
    for name, content in stacks.items():
        for channel, number in stack.interfaces(content):
            quality = content["interfaces"][channel]["quality"][number - 1]
            for d, *values in zip(*(quality[key] for key in stack.BY_THICKNESS), strict=True):
                thickness = f"{significant(d, 3)} {content['unit']}"
                rows.append((name, channel, str(number), thickness, *map(significant, values)))
        worst = content["quality"]["regenerated"]
        of_all = (max(worst["rel"]), max(worst["ks"]), worst["delta_A"])
        rows.append((name, "worst", "", "", *map(significant, of_all)))
    return ("stack", "channel", "interface", "thickness", "rel", "ks", "A"), rows


def _stack_constants(stacks: Mapping[str, Content]) -> Rows:
    known = known_errors((one for of in stacks.values() for one in of["constants"].values()), numbered=True)
    rows = [
        (name, channel, str(number), constant, *_value_and_errors(of[f"{channel}.{number}.{constant}"], known))
        for name, content in stacks.items()
        for of in [content["constants"]]
        for channel, number in stack.interfaces(content)
        for constant in StackLaw.constant_names()
    ]
    errors = (f"± {word}" for word in known.values())
    return ("stack", "channel", "interface", "constant", "regenerated", *errors), rows


def _stack_fits(content: Content) -> Rows:
    rows: list[Row] = []
    for channel, number in stack.interfaces(content):
        fit, starts = (content["interfaces"][channel][key][number - 1] for key in ("fit", "starts"))
        steps, condition = str(fit["steps"]), significant(fit["condition_number"], 3)
        as_good = f"{starts['as_good']} of {starts['count']}"
        rows.append(("", channel, str(number), fit["result"], steps, condition, as_good))
    return ("stack", "channel", "interface", "result", "steps", "condition number", "starts as good"), rows


# Sums of Gaussians of a stack: their errors over their number, and the constants of six of them.

OF_NUMBER = (
    "red, green, blue: mean relative error of R_d, in radial bins even in ln r from 0.01 mean free paths to 99.5 % of "
    "the energy; worst of the three: rms: root mean square error, ks: error of the cdf, alone: mean error if each "
    "colour has separate variances"
)
PUBLISHED = "; published: the six Gaussians of d'Eon and Luebke (GPU Gems 3, ch. 14), in mm, of a skin"
OF_SUM = OF_STACK | {"model": "the misfit as a random function", "jackknife": "leaving out a sixth of the rings"}


def sum_tables(sums: gaussians.SumRecord) -> list[RenderableType]:
    """Return the errors of 1 to 8 Gaussians in both lights, and the constants of six in the light of the stack."""
    rows: list[Row] = []
    others = published(sums)
    for light in ILLUMINATIONS:
        for count, one in zip(gaussians.COUNTS, sums.content["sums"][light]["by_count"], strict=True):
            worst = (max(one[key]) for key in ("rms", "ks", "alone"))
            rows.append((light, str(count), *map(significant, one["rel"]), *map(significant, worst)))
        if light in others:
            rel, rms, ks = ([one[key] for one in others[light]] for key in ("rel", "rms", "ks"))
            rows.append((light, "published", *map(significant, (*rel, max(rms), max(ks))), ""))
    header, caption = ("light", "N", *CHANNELS, "rms", "ks", "alone"), OF_NUMBER + (PUBLISHED if others else "")
    light, unit = sums.content["setting"]["illumination"], sums.content["unit"]
    of = {name: sums.content["constants"][f"{light}.{DEFAULT}.{name}"] for name in constant_names(DEFAULT)}
    known = known_errors(of.values(), numbered=True)
    titled = {name if "." in name else f"{name} [{unit}^2]": one for name, one in of.items()}
    constants = [(title, *_value_and_errors(one, known)) for title, one in titled.items()]
    names = ("constant", "regenerated", *(f"± {word}" for word in known.values()))
    note = f"{_meaning(known, OF_SUM)}. --json has those of every number, in both lights. {sums.content['note']}"
    return [
        row_table("Sums of N Gaussians, whose variances the colours share", header, rows, caption, ("light",)),
        row_table(f"Six of them, in {light} light", names, constants, note, ("constant",), aligned=names[1:]),
    ]


def _sum_errors(sums: Mapping[str, Content]) -> Rows:
    """Return the relative error of 2, 4, 6, 8 Gaussians [%], the largest of both illuminations and three channels."""
    rows: list[Row] = []
    for name, content in sums.items():
        both = [content["sums"][light]["by_count"] for light in ILLUMINATIONS]
        errors = [max(max(of[count - 1]["rel"]) for of in both) for count in gaussians.COUNTS[1::2]]
        errors.append(max(max(of[DEFAULT - 1]["alone"]) for of in both))
        rows.append((name, *(f"{significant(100.0 * error)} %" for error in errors)))
    return ("stack", *(f"{n} Gaussians" for n in gaussians.COUNTS[1::2]), f"{DEFAULT}, variances per channel"), rows


def published(sums: gaussians.SumRecord) -> dict[str, list[dict[str, float]]]:
    """Return `quality` of the published Gaussians of skin at a stack of that name, by light and colour; else none."""
    if sums.path.stem != "skin" or sums.stack.unit != "mm":
        return {}
    variances, weights = np.array(D_EON.variances), np.transpose(D_EON.weights)
    of = {light: zip(sums.lights(light), weights, strict=True) for light in ILLUMINATIONS}
    return {light: [quality(one, variances, own) for one, own in pairs] for light, pairs in of.items()}


# Phase functions fitted to a table: the error of each form, and the constants with their errors.

MOMENT_DIGITS = 4
OF_FORMS = (
    "rms: root mean square of ln(form / table), over all angles and between those given; cosine: mean cosine; back: "
    "backscattered share, beyond 90 degrees"
)
OF_PHASE = MEANING_OF_ERROR | {
    "photons": "the table's sigma",
    "model": "the misfit as a random function of ln angle",
    "jackknife": "leaving out a sixth of the rows",
}
OF_BANDS = tuple(f"{low:g} to {high:.3g}" for low, high in pairwise(BANDS))


def phase_tables(content: Content) -> list[RenderableType]:
    """Return the tables of a record, or of a result of `profilefit fit --kind phase`."""
    data, left = content["data"], ("form", "moments", "constant", "result")
    own = f"{data['source']}: {data['rows']} angles, {data['angles'][0]:g} to {data['angles'][1]:g} degrees"
    title = f"{own}; mean cosine {data['mean_cosine']:.4f}, backscattered {data['backscattered']:.5f}"
    header = ("form", "moments", "rms", *OF_BANDS, "cosine", "back", "result")
    rows = [(*_measures(form, how, one), one["result"]) for form, how, one in _each(content)]
    known = known_errors(content["constants"].values(), numbered=True)
    constants = [(*place, *_value_and_errors(one, known)) for place, one in _phase_constants(content)]
    names = ("form", "moments", "constant", "value", *known.values())
    meaning = _meaning(known, OF_PHASE)
    return [
        row_table(title, header, rows, OF_FORMS, left, ("form",)),
        row_table("Constants, without unit", names, constants, meaning, left, ("form",), ("value",)),
    ]


def premise_lines(content: Content) -> list[str]:
    """Return the scale of the table, its angles without rows, and whether it is as Haltrin's form takes it to be."""
    data, haltrin = content["data"], content["phases"]["haltrin"][phase.FREE]
    best = min((one["rms"], FORMS[form].title) for form, _, one in _each(content))
    own, second = (f"{data[name]:.3f}" for name in ("mean_cosine", "second"))
    return [
        *phase.table_lines(data),
        f"Haltrin's form differs by a factor of e^{haltrin['rms']:.2f} (rms), {best[1]} by e^{best[0]:.2f}. "
        f"Its premises: the mean of P_2 is the mean cosine (here {second} and {own}), "
        f"and that follows from the backscattered share by a regression (here {data['regression']:.3f} for {own}).",
    ]


def phase_table(folder: Path) -> RenderableType | None:
    """Return the records of phase functions that lie in a folder of records; None where there are none."""
    contents = [phase.read(path) for path in record.available(folder / PHASES).values()]
    if not contents:
        return None
    columns = {
        "table": [str(one["name"]) for one in contents],
        "rows": [str(one["data"]["rows"]) for one in contents],
        **{form: [significant(one["phases"][form][phase.HELD]["rms"]) for one in contents] for form in FORMS},
    }
    caption = "Root mean square of ln(form / table) over angles, with mean cosine and backscattered share of the table"
    return column_table("Phase functions", columns, f"{caption}, if a form can have them", ("table",))


def _phase_fits(phases: Mapping[str, Content]) -> Rows:
    rows = [(name, *_measures(*one)) for name, content in phases.items() for one in _each(content)]
    bands = (f"{band}°" for band in OF_BANDS)
    return ("table", "fit", "moments", "all angles", *bands, "mean cosine", "backscattered"), rows


def _each(content: Content) -> list[tuple[str, str, Content]]:
    return [(form, how, content["phases"][form][how]) for form in FORMS for how in (phase.FREE, phase.HELD)]


def _measures(form: str, how: str, content: Content) -> Row:
    """Return a form, its moments, its distance from the table, its mean cosine and backscattered share."""
    moments = (significant(content[name], MOMENT_DIGITS) for name in ("mean_cosine", "backscattered"))
    return (FORMS[form].title, how, *map(significant, (content["rms"], *content["bands"])), *moments)


def _phase_constants(content: Content) -> list[tuple[Row, Content]]:
    """Return form, moments and name of each constant, and what the record has of it."""
    return [
        ((FORMS[form].title, how, name), content["constants"][f"{form}.{how}.{name}"])
        for form, how, _ in _each(content)
        for name in FORMS[form].names
    ]


class KindTables(NamedTuple):
    """Tables of a kind in `report`.

    key       name of its records in the output of --json
    tables    tables of one record, from its content and its path
    summary   table of all its records by name, in a folder of records; None where there are none
    sections  Markdown sections of those records, by the names of their marks
    """

    key: str
    tables: Callable[[Content, Path], Parts]
    summary: Callable[[Paths, Path], RenderableType | None] = lambda paths, folder: None
    sections: Callable[[Paths, Path], Sections] = lambda paths, folder: {}


def _law_sections(paths: Paths, folder: Path) -> Sections:
    filled = sections({name: read(path) for name, path in paths.items()}) if paths else {}
    return {**{name: partial(str, text) for name, text in filled.items()}, **markdown_sections(folder)}


TABLES: Mapping[str, KindTables] = {
    "law": KindTables(
        "records",
        lambda content, _: record_tables(content),
        lambda paths, folder: summary({name: read(path) for name, path in paths.items()}) if paths else None,
        _law_sections,
    ),
    "stack": KindTables(
        "records",
        lambda content, _: spaced([title_of(content), *stack_tables(content)]),
        lambda _, folder: stack_table(folder),
        lambda paths, _: _sections(stack.read, paths, stack_errors=_stack_errors, stack_constants=_stack_constants),
    ),
    "gaussians": KindTables(
        "gaussians",
        lambda _, path: sum_tables(gaussians.load(path)),
        sections=lambda paths, _: _sections(gaussians.read, paths, stack_gaussians=_sum_errors),
    ),
    "phase": KindTables(
        "phases",
        lambda content, _: [
            *(part for table in phase_tables(content) for part in (table, Text())),
            *map(Text, premise_lines(content)),
        ],
        lambda _, folder: phase_table(folder),
        lambda _, folder: _sections(phase.read, record.available(folder / PHASES), phase_fits=_phase_fits),
    ),
}


def tables_of(kind: Kind) -> KindTables | None:
    """Return what `report` shows of a kind: by the table above, or by the function `tables` of its own module."""
    own = getattr(kind.module, "tables", None) if kind.key not in TABLES else None
    return TABLES.get(kind.key) or (own and KindTables(kind.plural or kind.key, own))

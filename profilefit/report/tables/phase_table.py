"""Phase functions fitted to a table: how far each form is from it, and the constants with their errors."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

from rich.console import RenderableType

from profilefit.laws.phases import FORMS
from profilefit.recipes import record
from profilefit.recipes.folder import PHASES
from profilefit.recipes.kinds.phase import FREE, HELD, load, table_lines
from profilefit.recipes.phases.fit import BANDS
from profilefit.report.records import known_errors, largest_error
from profilefit.report.tables.cells import column_table, on_the_point, significant, to_error
from profilefit.report.tables.markdown import markdown_table

Content = Mapping[str, Any]
MOMENT_DIGITS = 4
MEASURES = (
    "rms: root mean square of ln(form / table), over all angles and between those given; cosine: mean cosine; back: "
    "share turned by more than 90 degrees"
)
MEANING_OF_ERROR = {
    "photons": "the table's sigma",
    "model": "the misfit as a random function of ln angle",
    "misfit": "the misfit taken for independent noise, which it is not",
    "jackknife": "leaving out a sixth of the rows",
}
OF_BANDS = tuple(f"{low:g} to {high:.3g}" for low, high in pairwise(BANDS))
LEFT = ("form", "moments", "constant", "result")


def phase_tables(content: Content) -> list[RenderableType]:
    """Of a record, or of what `profilefit fit --kind phase` found."""
    data = content["data"]
    own = f"{data['source']}: {data['rows']} angles, {data['angles'][0]:g} to {data['angles'][1]:g} degrees"
    title = f"{own}; mean cosine {data['mean_cosine']:.4f}, backscattered {data['backscattered']:.5f}"
    columns: dict[str, list[str]] = {"form": [], "moments": []}
    names = ("rms", *OF_BANDS)
    columns |= {name: [] for name in (*names, "cosine", "back", "result")}
    for form, how, one in _each(content):
        columns["form"].append(FORMS[form].title)
        columns["moments"].append(how)
        for name, value in zip(names, (one["rms"], *one["bands"]), strict=True):
            columns[name].append(significant(value))
        columns["cosine"].append(significant(one["mean_cosine"], MOMENT_DIGITS))
        columns["back"].append(significant(one["backscattered"], MOMENT_DIGITS))
        columns["result"].append(one["result"])
    return [column_table(title, columns, MEASURES, LEFT, ("form",)), _constants(content)]


def premise_lines(content: Content) -> list[str]:
    """Return the scale of the table, its angles without rows, and whether it is as Haltrin's form takes it to be."""
    data, haltrin = content["data"], content["phases"]["haltrin"][FREE]
    best = min((one["rms"], FORMS[form].title) for form, _, one in _each(content))
    own, second = (f"{data[name]:.3f}" for name in ("mean_cosine", "second"))
    return [
        *table_lines(data),
        f"Haltrin's form is off by a factor of e^{haltrin['rms']:.2f} (rms), {best[1]} by e^{best[0]:.2f}. "
        f"Its premises: the mean of P_2 is the mean cosine (here {second} and {own}), "
        f"and that follows from the backscattered share by a regression (here {data['regression']:.3f} for {own}).",
    ]


def phase_table(folder: Path) -> RenderableType | None:
    """The records of phase functions that lie in a folder of records; None where there are none."""
    found = [load(path).content for path in record.available(folder / PHASES).values()]
    if not found:
        return None
    columns: dict[str, list[str]] = {"table": [str(one["name"]) for one in found]}
    columns["rows"] = [str(one["data"]["rows"]) for one in found]
    for form in FORMS.values():
        columns[form.name] = [significant(one["phases"][form.name][HELD]["rms"]) for one in found]
    caption = "root mean square of ln(form / table), mean cosine and backscattered share those of the table"
    return column_table("Phase functions", columns, f"{caption} where a form has numbers for it", ("table",))


def phase_sections(folder: Path) -> dict[str, Callable[[], str]]:
    """The tables of the records of phase functions for Markdown, by the names of their marks."""
    paths = record.available(folder / PHASES)

    def fits() -> str:
        rows = [
            (name, FORMS[form].title, how, *map(significant, (one["rms"], *one["bands"])),
             significant(one["mean_cosine"], MOMENT_DIGITS), significant(one["backscattered"], MOMENT_DIGITS))
            for name, path in paths.items() for form, how, one in _each(load(path).content)
        ]  # fmt: skip
        return markdown_table(("table", "form", "moments", "rms", *OF_BANDS, "cosine", "back"), rows)

    def constants() -> str:
        rows = [(name, *row) for name, path in paths.items() for row in _rows(load(path).content)[1]]
        return markdown_table(("table", "form", "moments", "constant", "value", "error"), rows)

    return {"phase-fits": fits, "phase-constants": constants} if paths else {}


def _each(content: Content) -> list[tuple[str, str, Content]]:
    return [(form, how, content["phases"][form][how]) for form in FORMS for how in (FREE, HELD)]


def _rows(content: Content) -> tuple[dict[str, str], list[tuple[str, ...]]]:
    of = content["constants"]
    known = {key: word for key, word in known_errors(of).items() if any(one[key] is not None for one in of.values())}
    rows: list[tuple[str, ...]] = []
    for form, how, _ in _each(content):
        for name in FORMS[form].names:
            one = of[f"{form}.{how}.{name}"]
            error = largest_error(one)
            rows.append((FORMS[form].title, how, name, to_error(one["regenerated"], error), significant(error)))
    return known, rows


def _constants(content: Content) -> RenderableType:
    known, _ = _rows(content)
    columns: dict[str, list[str]] = {name: [] for name in ("form", "moments", "constant", "value", *known.values())}
    for form, how, _ in _each(content):
        for name in FORMS[form].names:
            one = content["constants"][f"{form}.{how}.{name}"]
            cells = (FORMS[form].title, how, name, to_error(one["regenerated"], largest_error(one)))
            errors = (significant(one[key]) for key in known)
            for column, cell in zip(columns.values(), (*cells, *errors), strict=True):
                column.append(cell)
    columns["value"] = on_the_point(columns["value"])
    meaning = "; ".join(f"{word}: {MEANING_OF_ERROR[word]}" for word in known.values())
    return column_table("Constants, none with a unit", columns, meaning, LEFT, ("form",))

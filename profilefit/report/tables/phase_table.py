"""Phase functions fitted to a table: the error of each form, and the constants with their errors."""

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
from profilefit.recipes.phases import BANDS
from profilefit.report.records import largest_error, numbered_errors
from profilefit.report.tables.cells import column_table, row_table, significant, to_error
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
    """Return the tables of a record, or of a result of `profilefit fit --kind phase`."""
    data = content["data"]
    own = f"{data['source']}: {data['rows']} angles, {data['angles'][0]:g} to {data['angles'][1]:g} degrees"
    title = f"{own}; mean cosine {data['mean_cosine']:.4f}, backscattered {data['backscattered']:.5f}"
    header = ("form", "moments", "rms", *OF_BANDS, "cosine", "back", "result")
    rows = [(*_measures(form, how, one), one["result"]) for form, how, one in _each(content)]
    known, constants = _constants(content)
    meaning = "; ".join(f"{word}: {MEANING_OF_ERROR[word]}" for word in known.values())
    names = ("form", "moments", "constant", "value", *known.values())
    return [
        row_table(title, header, rows, MEASURES, LEFT, ("form",)),
        row_table("Constants, none with a unit", names, constants, meaning, LEFT, ("form",), ("value",)),
    ]


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
    """Return the records of phase functions that lie in a folder of records; None where there are none."""
    contents = [load(path).content for path in record.available(folder / PHASES).values()]
    if not contents:
        return None
    columns: dict[str, list[str]] = {"table": [str(one["name"]) for one in contents]}
    columns["rows"] = [str(one["data"]["rows"]) for one in contents]
    for form in FORMS.values():
        columns[form.name] = [significant(one["phases"][form.name][HELD]["rms"]) for one in contents]
    caption = "root mean square of ln(form / table), mean cosine and backscattered share those of the table"
    return column_table("Phase functions", columns, f"{caption} where a form has numbers for it", ("table",))


def phase_sections(folder: Path) -> dict[str, Callable[[], str]]:
    """Return the tables of the records of phase functions for Markdown, by the names of their marks."""
    paths = record.available(folder / PHASES)

    def fits() -> str:
        rows = [
            (name, *_measures(form, how, one))
            for name, path in paths.items()
            for form, how, one in _each(load(path).content)
        ]
        return markdown_table(("table", "form", "moments", "rms", *OF_BANDS, "cosine", "back"), rows)

    def constants() -> str:
        contents = {name: load(path).content for name, path in paths.items()}
        rows = [
            (name, *row[:4], significant(largest_error(one)))
            for name, content in contents.items()
            for row, one in zip(_constants(content)[1], _constant_values(content), strict=True)
        ]
        return markdown_table(("table", "form", "moments", "constant", "value", "error"), rows)

    return {"phase-fits": fits, "phase-constants": constants} if paths else {}


def _each(content: Content) -> list[tuple[str, str, Content]]:
    return [(form, how, content["phases"][form][how]) for form in FORMS for how in (FREE, HELD)]


def _measures(form: str, how: str, content: Content) -> tuple[str, ...]:
    """Return a form, its moments, its distance from the table, its mean cosine and backscattered share."""
    moments = (significant(content[name], MOMENT_DIGITS) for name in ("mean_cosine", "backscattered"))
    return (FORMS[form].title, how, *map(significant, (content["rms"], *content["bands"])), *moments)


def _constant_values(content: Content) -> list[Content]:
    return [
        content["constants"][f"{form}.{how}.{name}"] for form, how, _ in _each(content) for name in FORMS[form].names
    ]


def _constants(content: Content) -> tuple[dict[str, str], list[tuple[str, ...]]]:
    """Return the errors that the constants have, and a row for each constant: form, moments, name, value, errors."""
    known = numbered_errors(content["constants"].values())
    names = [(FORMS[form].title, how, name) for form, how, _ in _each(content) for name in FORMS[form].names]
    return known, [
        (*place, to_error(one["regenerated"], largest_error(one)), *(significant(one[key]) for key in known))
        for place, one in zip(names, _constant_values(content), strict=True)
    ]

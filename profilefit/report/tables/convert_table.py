"""One medium in the conventions of papers and engines, as a table or as numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rich.console import RenderableType

from mcml_sim.media.setting import ILLUMINATIONS
from profilefit.convert import LENGTHS, Optical
from profilefit.report.tables.cells import SEARCHLIGHT, column_table, on_the_point, significant

Floats = NDArray[np.float64]
DIGITS = 5
NONE = "none"


@dataclass(frozen=True)
class ConventionRow:
    """One convention: its name, what the table says of it, and a value a channel."""

    name: str
    title: str
    light: str  # whose A it is, or is paired with
    power: int  # of the unit of length
    formula: str
    values: Floats


def _rows(medium: Optical, n: float) -> list[ConventionRow]:
    what = "exact, index-matched" if n == 1 else f"exact, n = {n:g}"
    colour = [
        ConventionRow(f"reflectance_{light}", "reflectance A", light, 0, what, medium.reflectance(light, n))
        for light in ILLUMINATIONS
    ]
    return [
        ConventionRow("alpha", "albedo alpha", "", 0, "mu_s' / (mu_s' + mu_a)", medium.alpha),
        *colour,
        ConventionRow("mu_a", "absorption mu_a", "", -1, "(1 - alpha) / l", medium.mu_a),
        ConventionRow("mu_s", "reduced scattering mu_s'", "", -1, "alpha / l", medium.mu_s),
        *(ConventionRow(one.name, one.title, one.colour, 1, one.formula, medium.length(one.name)) for one in LENGTHS),
    ]


def content(medium: Optical, unit: str, n: float = 1.0) -> dict[str, str | float | Floats | None]:
    """The same by name, for --json; what a channel has not is not finite. n is the index that A is of."""
    return {"unit": unit or None, "n": n} | {row.name: row.values for row in _rows(medium, n)}


def convert_table(medium: Optical, unit: str, n: float = 1.0) -> RenderableType:
    """A line a convention, a column a channel; unit is that of length, or "". n is the index that A is of."""
    rows = _rows(medium, n)
    cells = np.array([[_cell(value) for value in row.values] for row in rows])
    columns = {"": [row.title for row in rows]}
    for i in range(cells.shape[1]):
        header = "value" if cells.shape[1] == 1 else f"channel {i + 1}"
        columns[header] = on_the_point(list(cells[:, i]))
    units = {0: "", 1: unit or "length", -1: f"1/{unit or 'length'}"}
    columns |= {
        "unit": [units[row.power] for row in rows],
        "A of": [row.light for row in rows],
        "is": [row.formula for row in rows],
    }
    sources = dict.fromkeys(one.source for one in LENGTHS if one.source)
    caption = [f"Sources: {'; '.join(sources)}.", f"{SEARCHLIGHT}."]
    if n != 1:
        caption += ["Lengths of engines are paired with A of the same albedo under an index-matched surface."]
    if NONE in cells:
        caption += [f"{NONE}: without absorption (alpha = 1) there is no diffuse mean free path."]
    return column_table("One medium in every convention", columns, "\n".join(caption), ("", "unit", "A of"), ("is",))


def _cell(value: float) -> str:
    return significant(value, DIGITS) if math.isfinite(value) else NONE

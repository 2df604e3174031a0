"""One medium in the conventions of papers and renderers, as tables or as numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from rich.console import Group, RenderableType
from rich.text import Text

from mcml_sim.media.arrays import Floats
from mcml_sim.media.setting import ILLUMINATIONS
from profilefit.convert import ENGINES, LENGTHS, QUANTITIES, Engine, Optical
from profilefit.report.tables.cells import ABSENT, SEARCHLIGHT, row_table, significant

DIGITS, COLOUR_PLACES = 5, 4
NONE = "none"
MEMO = "Falloffs, s and eq. 5, 6 and 8: Christensen and Burley, Pixar Technical Memo 15-04"


@dataclass(frozen=True)
class ConventionRow:
    """One quantity of the medium: its name, what the table says of it, and a value per channel."""

    name: str
    title: str
    light: str  # whose A it is, or is paired with
    power: int  # of the unit of length
    formula: str
    values: Floats


def _rows(medium: Optical, n: float) -> list[ConventionRow]:
    """Return all quantities; a table leaves out what says the same twice."""
    reflectances = []
    for name, title, index in (("reflectance", "reflectance A", n), ("matched", "  index-matched", 1.0)):
        surface = "exact, index-matched" if index == 1 else f"exact, n = {index:g}"
        if medium.g != 0.0:
            surface += f", g = {medium.g:g}" if index != 1 else ", g = 0 by similarity"
        for light in ILLUMINATIONS:
            values = medium.reflectance(light, index)
            reflectances.append(ConventionRow(f"{name}_{light}", title, light, 0, surface, values))
    return [
        ConventionRow("alpha", "albedo alpha", "", 0, "mu_s' / (mu_s' + mu_a)", medium.alpha),
        ConventionRow("alpha_unreduced", "  unreduced", "", 0, "mu_s / (mu_s + mu_a)", medium.alpha_unreduced),
        *reflectances,
        ConventionRow("mu_a", "absorption mu_a", "", -1, "(1 - alpha) / l", medium.mu_a),
        ConventionRow("mu_s", "reduced scattering mu_s'", "", -1, "alpha / l", medium.mu_s),
        ConventionRow("mu_s_unreduced", "  unreduced mu_s", "", -1, "mu_s' / (1 - g)", medium.mu_s / (1.0 - medium.g)),
        *(ConventionRow(one.name, one.title, one.colour, 1, one.formula, medium.length(one.name)) for one in LENGTHS),
    ]


def content(medium: Optical, unit: str, n: float = 1.0) -> dict[str, Any]:
    """Return every quantity and row by name, for --json; what a channel has not is not finite. n is that of A."""
    named = {row.name: row.values for row in _rows(medium, n)}
    typed = [_typed(engine, medium, unit, n) for engine in ENGINES]
    return {"unit": unit or None, "n": n, "g": medium.g, **named, "typed": typed}


def _typed(engine: Engine, medium: Optical, unit: str, n: float) -> dict[str, Any]:
    of = (engine.unit if unit else "") or unit
    return {
        **{name: getattr(engine, name) for name in ("name", "product", "version", "method")},
        "colour_field": engine.fields[0],
        "colour": engine.typed_colour(medium.alpha, n, medium.g),
        "length_field": engine.fields[1],
        "length": engine.typed_length(medium.alpha, medium.mfp, medium.g, unit),
        "unit": f"{'1/' if engine.power < 0 else ''}{of}" if of else None,
        "scale_field": engine.fields[2] or None,
        "scale": engine.scale,
        "renders": engine.rendered(medium.alpha, medium.g),
        **{name: getattr(engine, name) for name in ("formula", "source", "checked")},
    }


def convert_table(medium: Optical, unit: str, n: float = 1.0, sources: bool = False) -> RenderableType:
    """Return the medium's own quantities, then what to type into renderers, and where that is from if asked for.

    unit  that of length, or ""; n the index that A is of
    """
    lines = []
    for engine in ENGINES if sources else ():
        fields = [*engine.fields[:2], *([f"{engine.fields[2]} = {engine.scale:g}"] if engine.scale else [])]
        lines += [engine.title, f"  fields: {'; '.join(fields)}", f"  typed: {engine.formula}"]
        lines += [f"  source: {engine.source}", f"  checked: {engine.checked}"]
    described = (Text(), Text("\n".join(lines))) if sources else ()
    return Group(_quantities(medium, unit, n), Text(), _engines(medium, unit, n), *described)


def _quantities(medium: Optical, unit: str, n: float) -> RenderableType:
    shown = {length.name for length in LENGTHS if length not in QUANTITIES}
    hidden = shown | (set() if n != 1 else {f"matched_{light}" for light in ILLUMINATIONS})
    if medium.g == 0.0:
        hidden |= {"alpha_unreduced", "mu_s_unreduced", "mfp_unreduced"}
    rows = [row for row in _rows(medium, n) if row.name not in hidden]
    units = {0: "", 1: unit or "length", -1: f"1/{unit or 'length'}"}
    count = len(rows[0].values)
    channels = ["value"] if count == 1 else [f"channel {i + 1}" for i in range(count)]
    cells = [(row.title, *map(_cell, row.values), units[row.power], row.light, row.formula) for row in rows]
    caption = [f"{MEMO}. {SEARCHLIGHT}."]
    if any(NONE in row for row in cells):
        caption += [f"{NONE}: without absorption (alpha = 1) there is no diffuse mean free path."]
    header, left = ("", *channels, "unit", "A of", "is"), ("", "unit", "A of")
    return row_table("The medium", header, cells, "\n".join(caption), left, ("is",), channels)


def _engines(medium: Optical, unit: str, n: float) -> RenderableType:
    rows = []
    for engine in ENGINES:
        typed = _typed(engine, medium, unit, n)
        field = engine.unit or (f"{unit} scene" if unit else "scene unit")
        scale = f" at {engine.scale:g}" if engine.unit and engine.scale else ""
        in_unit = f"{'1/' if engine.power < 0 else ''}{field}{scale}"
        length = " ".join(_cell(value, DIGITS - 1) for value in typed["length"])
        renders = _colours(typed["renders"], COLOUR_PLACES - 1, "")
        rows.append((engine.title, _colours(typed["colour"]), length, in_unit, renders))
    caption = [
        "Colours are linear. A row holds for its version only; --sources names fields, formulas, sources and checks.",
        "at: the world scale of the renderer's settings. scene: it is modelled in this unit.",
        "renders A: what Blender shows of this medium, seen from the normal. Light enters refracted, which the map of "
        "its colour to an albedo leaves out.",
    ]
    if any(colour == ABSENT for _, colour, *_ in rows):
        caption += [f"{ABSENT}: no source says."]
    if any(NONE in length for _, _, length, *_ in rows):
        caption += [f"{NONE}: the renderer has no such g, or its row was not checked with g."]
    if not unit:
        caption += ["No unit was given: convert lengths from yours to the one of the row."]
    header = ("", "colour", "length", "in", "renders A")
    return row_table("What to type", header, rows, "\n".join(caption), ("", "in"))


def _colours(values: Floats | None, places: int = COLOUR_PLACES, absent: str = ABSENT) -> str:
    if values is None:
        return absent
    return " ".join(f"{value:.{places}f}" if math.isfinite(value) else NONE for value in values)


def _cell(value: float, digits: int = DIGITS) -> str:
    return significant(value, digits) if math.isfinite(value) else NONE

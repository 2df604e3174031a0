"""Records of stacks of layers: their layers, the errors of their laws, and each one with all its constants."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from rich.console import RenderableType

from profilefit.laws.stack import StackLaw
from profilefit.recipes import record
from profilefit.recipes.folder import STACKS
from profilefit.recipes.kinds.stack import BY_THICKNESS, PIPELINE, interfaces, read
from profilefit.report.records import Content, largest_error, numbered_errors
from profilefit.report.tables.cells import column_table, row_table, significant, to_error
from profilefit.report.tables.markdown import markdown_table

Stacks = Mapping[str, Content]
Rows = tuple[tuple[str, ...], list[tuple[str, ...]]]  # headers, the first that of the stack's name, and what is below
MEASURES = "rel: mean relative error of R_d over radii, ks: error of the cdf, A: relative error of the reflectance"
CAPTION = f"{MEASURES}, each the worst of three colours and of the thicknesses between those that were fitted"
OF_THICKNESS = f"{MEASURES}; those of a deeper interface are of the stack from its upper layer down"
MEANING_OF_ERROR = {
    "photons": "noise of the simulation",
    "dr": "exact light of fewer nodes",
    "model": "the law's misfit, as a random function",
    "misfit": "the misfit taken for independent noise, which it is not",
    "jackknife": "leaving out one thickness after the other",
}
OF_FIT = "Constants that trade against each other do not converge, and may be good all the same: see their errors above"
LEFT = ("layer", "channel", "interface", "constant", "result")


def stack_table(folder: Path) -> RenderableType | None:
    """Return the records of stacks that lie in a folder of records; None where there are none."""
    paths = record.available(folder / STACKS).values()
    stacks = [read(path) for path in paths if record.read(path)["pipeline"] == PIPELINE]
    if not stacks:
        return None
    worst = [one["quality"]["regenerated"] for one in stacks]
    columns = {
        "stack": [str(one["name"]) for one in stacks],
        "layers": [str(len(one["layers"])) for one in stacks],
        "light": [str(one["setting"]["illumination"]) for one in stacks],
        "n": [f"{one['setting']['n']:g}" for one in stacks],
        "g": [", ".join(f"{g:g}" for g in sorted({layer["g"] for layer in one["layers"]})) for one in stacks],
        "rel": [significant(max(one["rel"])) for one in worst],
        "ks": [significant(max(one["ks"])) for one in worst],
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
    known = [f"{word}: {MEANING_OF_ERROR[word]}" for word in numbered_errors(content["constants"].values()).values()]
    return [
        column_table("Layers, from the surface down; red, green, blue", columns, left=LEFT, fold=("layer",)),
        _table("Errors at thicknesses of an interface's upper layer that were not fitted", _errors(of), OF_THICKNESS),
        _table("Constants of each colour and interface, none with a unit", _constants(of), "; ".join(known)),
        _table("Fits", _fits(of), OF_FIT),
    ]


def stack_sections(paths: Mapping[str, Path]) -> dict[str, Callable[[], str]]:
    """Return the tables of these records of stacks for Markdown, by the names of their marks; none without records."""
    tables = {"stack-errors": _errors, "stack-constants": _constants} if paths else {}

    def section(rows_of: Callable[[Stacks], Rows]) -> str:
        return markdown_table(*rows_of({name: read(path) for name, path in paths.items()}))

    return {name: partial(section, rows_of) for name, rows_of in tables.items()}


def _table(title: str, table: Rows, caption: str) -> RenderableType:
    """Return the table of one stack, whose name stands above."""
    header, rows = table[0][1:], [row[1:] for row in table[1]]
    return row_table(title, header, rows, caption, LEFT, aligned=[name for name in header if name not in LEFT])


def _errors(stacks: Stacks) -> Rows:
    rows: list[tuple[str, ...]] = []
    for name, content in stacks.items():
        for channel, number in interfaces(content):
            quality = content["interfaces"][channel]["quality"][number - 1]
            for d, *values in zip(*(quality[key] for key in BY_THICKNESS), strict=True):
                thickness = f"{significant(d, 3)} {content['unit']}"
                rows.append((name, channel, str(number), thickness, *map(significant, values)))
        worst = content["quality"]["regenerated"]
        of_all = (max(worst["rel"]), max(worst["ks"]), worst["delta_A"])
        rows.append((name, "worst", "", "", *map(significant, of_all)))
    return ("stack", "channel", "interface", "thickness", "rel", "ks", "A"), rows


def _constants(stacks: Stacks) -> Rows:
    rows: list[tuple[str, ...]] = []
    known = numbered_errors(one for content in stacks.values() for one in content["constants"].values())
    for name, content in stacks.items():
        for channel, number in interfaces(content):
            for constant in StackLaw.constant_names():
                one = content["constants"][f"{channel}.{number}.{constant}"]
                value = to_error(one["regenerated"], largest_error(one))
                rows.append(
                    (name, channel, str(number), constant, value, *(significant(one.get(key)) for key in known))
                )
    errors = (f"± {word}" for word in known.values())
    return ("stack", "channel", "interface", "constant", "regenerated", *errors), rows


def _fits(stacks: Stacks) -> Rows:
    rows: list[tuple[str, ...]] = []
    for name, content in stacks.items():
        for channel, number in interfaces(content):
            fit, starts = (content["interfaces"][channel][key][number - 1] for key in ("fit", "starts"))
            steps, condition = str(fit["steps"]), significant(fit["condition_number"], 3)
            as_good = f"{starts['as_good']} of {starts['count']}"
            rows.append((name, channel, str(number), fit["result"], steps, condition, as_good))
    return ("stack", "channel", "interface", "result", "steps", "condition number", "starts as good"), rows

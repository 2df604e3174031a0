"""Records of stacks of layers: what they are of, and how good their laws are."""

from __future__ import annotations

from pathlib import Path

from rich.console import RenderableType

from profilefit.recipes import record
from profilefit.recipes.stack.record import FOLDER, PIPELINE
from profilefit.report.tables.cells import column_table, significant

CAPTION = (
    "rel: mean relative error of R_d over radii, ks: error of the cdf, A: relative error of the reflectance, each the "
    "worst of three colours and of the thicknesses between those that were fitted"
)


def stack_table(folder: Path) -> RenderableType | None:
    """The records of stacks that lie in a folder of records; None where there are none."""
    found = [record.read(path) for path in record.available(folder / FOLDER).values()]
    stacks = [one for one in found if one["pipeline"] == PIPELINE]
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

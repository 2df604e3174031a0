"""Maps of failures: a panel a law and quantity, a cell an albedo and a radius or uniform number."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.patches import Patch
from numpy.typing import NDArray
from scipy import ndimage

from profilefit.report.figures.canvas import BLACK, ORANGE, PURPLE, VERMILION, WIDTH, YELLOW, canvas, save, styled
from profilefit.report.tables.stability_tables import SIGNS
from profilefit.studies.stability.cells import ARITHMETICS, DTYPES, LENGTHS, QUANTITIES, ArgumentAxis, Cells, Verdict

# Red classes differ in lightness and carry a sign, as does what is not judged; the others are pale.
COLOURS = {
    Verdict.RIGHT: "#DCEAF4",
    Verdict.OUTSIDE: "#EDEDED",
    Verdict.BEYOND: "#C4CED6",
    Verdict.NOT_JUDGED: "#FFFFFF",
    Verdict.INACCURATE: YELLOW,
    Verdict.NOT_MONOTONE: ORANGE,
    Verdict.NEGATIVE: PURPLE,
    Verdict.NOT_FINITE: VERMILION,
    Verdict.RAISES: BLACK,
}
# One of a kind, where all are there: a figure has room for these.
ROWS = (
    *("liang, published", "liang-whole", "burley, published", "burley_diffuse_mfp, published", "dipole"),
    *("better_dipole", "beam_diffusion", "gaussians-6", "hazard", "quantile"),
)
TICKS = {"α": (0.0, 0.1, 0.5, 0.9, 1.0), "r/l": (0.0, 0.01, 1.0, 100.0, np.inf), "ξ": (0.0, 0.01, 0.5, 0.99)}
TITLES = dict(zip(QUANTITIES, ("profile R$_d$", "cdf", "radius drawn", "density of radii"), strict=True))
USUAL = (1e-3, 1e3)  # l of a panel: the worst over those
ROW_HEIGHT, MARGIN = 0.95, 1.25  # inch
SIGNED = 12  # cells that a region needs for its sign


def stability_figures(cells: Iterable[Cells], out: Path) -> list[Path]:
    """Draw a figure for each arithmetic that occurs, and return the files."""
    tensors = list(cells)
    files: list[Path] = []
    for arithmetic in ARITHMETICS:
        of = (one for one in tensors if one.arithmetic == arithmetic and one.quantity in QUANTITIES)
        panels = {(one.subject, one.quantity): one for one in of if len(one.axes) > 1 and one.axes[0].name == "α"}
        if panels:
            files += stability_figure(panels, arithmetic, out, f"stability-{arithmetic.replace(' ', '-')}")
    return files


@styled
def stability_figure(panels: Mapping[tuple[str, str], Cells], arithmetic: str, out: Path, name: str) -> list[Path]:
    """Draw the class of every cell, the worst over all lengths that a law accepts: laws down, quantities across."""
    subjects = list(dict.fromkeys(subject for subject, _ in panels))
    if len(subjects) > len(ROWS):
        subjects = [one for one in ROWS if one in subjects]
    figure = canvas(MARGIN + ROW_HEIGHT * len(subjects), WIDTH)
    quantities = [one for one in QUANTITIES if any(quantity == one for _, quantity in panels)]
    grid = figure.subplots(len(subjects), len(quantities), squeeze=False)
    for row, subject in zip(grid, subjects, strict=True):
        for ax, quantity in zip(row, quantities, strict=True):
            _draw(ax, panels.get((subject, quantity)))
        row[0].set_ylabel(subject.replace(", ", "\n").replace("_mfp", "\n_mfp"), rotation=0, ha="right", va="center")
    for ax, quantity in zip(grid[0], quantities, strict=True):
        ax.set_title(TITLES[quantity])
    for ax in grid[:-1].flat:  # numbers only at the left and below
        ax.tick_params(labelbottom=False)
    for ax in grid[:, 1:].flat:
        ax.tick_params(labelleft=False)
    seen = {code for one in panels.values() for code in np.unique(_worst(one))}
    handles = [
        Patch(facecolor=COLOURS[one], edgecolor=BLACK, linewidth=0.4, label=f"{SIGNS.get(one, '')} {one.words}".strip())
        for one in Verdict
        if one in seen
    ]
    figure.suptitle(f"{arithmetic}: albedo α up, r/l or ξ across; one cell a value, not to scale", fontsize=9.0)
    figure.legend(handles=handles, loc="outside lower center", ncols=4)
    return save(figure, out, name)


def _worst(cells: Cells) -> NDArray[np.int8]:
    """Return the worst class over usual lengths, (alphas, radii or shares)."""
    if len(cells.axes) == 2:
        return cells.codes
    lengths, (low, high) = cells.axes[2].values, LENGTHS[DTYPES[cells.arithmetic]]
    usual = (lengths >= max(low, USUAL[0])) & (lengths <= min(high, USUAL[1]))
    return cast(NDArray[np.int8], np.max(cells.codes[..., usual], axis=2))


def _draw(ax: Axes, cells: Cells | None) -> None:
    ax.grid(False)
    if cells is None:
        ax.set(xticks=[], yticks=[])
        ax.text(0.5, 0.5, "not measured", transform=ax.transAxes, ha="center", va="center", fontsize=7.0)
        return
    codes = _worst(cells)
    colours = ListedColormap([COLOURS[one] for one in Verdict])
    norm = BoundaryNorm(np.arange(len(Verdict) + 1) - 0.5, len(Verdict))
    ax.imshow(codes, origin="lower", aspect="auto", interpolation="nearest", cmap=colours, norm=norm)
    for verdict in Verdict:
        if sign := SIGNS.get(verdict):
            _sign(ax, codes == verdict, sign)
    _ticks(ax.set_yticks, cells.axes[0])
    _ticks(ax.set_xticks, cells.axes[1])
    ax.tick_params(labelsize=6.5, length=2.0, pad=1.5)


def _sign(ax: Axes, part: NDArray[np.bool_], sign: str) -> None:
    """Write a sign in the middle of every region that has room for it."""
    labels, count = ndimage.label(part, structure=np.ones((3, 3), int))
    for number in range(1, count + 1):
        inside = labels == number
        if inside.sum() < SIGNED:
            continue
        depth = ndimage.distance_transform_edt(np.pad(inside, 1))[1:-1, 1:-1]
        deepest = np.argwhere(depth >= 0.99 * depth.max())
        y, x = deepest[len(deepest) // 2]
        ax.text(float(x), float(y), sign, ha="center", va="center", fontsize=8.0)


def _ticks(put: Any, axis: ArgumentAxis) -> None:
    places: dict[int, str] = {}
    for value in TICKS[axis.name]:
        index = axis.values.size - 1 if np.isinf(value) else axis.nearest(value)
        if axis.values[index] != value and not 0.8 < axis.values[index] / max(value, 1e-9) < 1.25:
            continue
        places.setdefault(index, "∞" if np.isinf(value) else f"{value:g}".removeprefix("0") or "0")
    put(list(places), list(places.values()))

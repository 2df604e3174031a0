"""Corner plots: how the constants of one fit are correlated."""

from __future__ import annotations

from pathlib import Path
from textwrap import fill
from typing import Any

import corner
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator, ScalarFormatter
from numpy.typing import NDArray

from profilefit.report.figures.canvas import BLACK, BLUE, VERMILION, canvas, save, styled
from profilefit.report.records import Source
from profilefit.report.tables.cells import significant

Floats = NDArray[np.float64]
MEANING = {"misfit": "the law's misfit taken for noise", "statistical": "photon noise"}
# Probability inside one and two standard deviations of a normal pair of constants: 1 - exp(-k^2 / 2).
LEVELS = (1.0 - np.exp(-0.5), 1.0 - np.exp(-2.0))
BINS = 20
LABEL_DISTANCE = 0.5  # of an axis name from its panel [inch]
MOST, SHOWN = 18, 12  # constants of which a figure shows all: the panels of more are too small, so it shows so many
LARGE = 5  # constants beyond which the numbers on the axes must be few


@styled
def corner_figure(record_name: str, source: Source, out: Path, kind: str = "misfit", name: str = "") -> list[Path]:
    """Draw the posterior draws of a record's constants, in pairs and alone, with the regenerated and printed values.

    kind  "misfit" or "statistical", as in `profilefit.fitting.chains`
    """
    fitted = source.needed(record_name)
    samples = fitted.arrays[f"samples_{kind}"].astype(float)
    names, held_back = fitted.content["covariance"]["names"], ""
    if len(names) > MOST:
        kept = _most_correlated(samples, SHOWN)
        held_back = f"the {SHOWN} of {len(names)} constants that\nare most correlated with another one"
        samples, names = samples[:, kept], [names[place] for place in kept]
    constants = [fitted.content["constants"][name] for name in names]
    size = len(names)
    figure = canvas(8.0, layout="none")
    grid = corner_grid(figure, samples, BINS, max_n_ticks=2 if size > LARGE else 4)
    figure.subplots_adjust(left=0.09, right=0.97, bottom=0.09, top=0.965, wspace=0.06, hspace=0.06)
    _marks(grid, samples, constants)
    _axes(grid, names)
    title = f"{record_name}: spread by {MEANING[kind]}" + (f";\n{held_back}" if held_back else "")
    _caption(figure, samples, names, constants, title)
    return save(figure, out, name or f"corner-{record_name}")


def _most_correlated(samples: Floats, count: int) -> list[int]:
    """Return places of the constants that have the largest correlation with any other, in order."""
    correlation = np.abs(np.corrcoef(samples, rowvar=False))
    np.fill_diagonal(correlation, 0.0)
    return sorted(np.argsort(-correlation.max(axis=0), kind="stable")[:count].tolist())


def corner_grid(figure: Figure, samples: Floats, bins: int, **more: Any) -> NDArray[Any]:
    """Draw samples (draws, n) in pairs and alone, and return the panels (n, n)."""
    corner.corner(
        samples, fig=figure, bins=bins, color=BLUE, levels=LEVELS, smooth=1.0, plot_datapoints=False,
        plot_density=False, fill_contours=True, hist_kwargs={"linewidth": 1.0, "color": BLUE},
        contour_kwargs={"linewidths": 0.6}, **more,
    )  # fmt: skip
    return np.array(figure.axes).reshape(samples.shape[1], -1)


def mark(grid: NDArray[Any], place: int, value: float, **look: Any) -> None:
    """Draw lines at a value of one constant in all panels that show it."""
    for row in range(place, len(grid)):
        grid[row, place].axvline(value, linewidth=0.8, **look)
    for column in range(place):
        grid[place, column].axhline(value, linewidth=0.8, **look)


def _marks(grid: NDArray[Any], samples: Floats, constants: list[dict[str, Any]]) -> None:
    """Draw lines at the regenerated value and, where it lies in the panel, at the printed one."""
    looks = {"regenerated": (BLACK, "-"), "published": (VERMILION, "--")}
    for column, constant in enumerate(constants):
        low, high = samples[:, column].min(), samples[:, column].max()
        for which, (color, style) in looks.items():
            value = constant.get(which)
            if value is not None and low <= value <= high:
                mark(grid, column, value, color=color, linestyle=style)


def _axes(grid: NDArray[Any], names: list[str]) -> None:
    """Write names on the outside and few numbers, none with an offset that the reader must add."""
    size = len(names)
    small = size > LARGE
    for row in range(size):
        for column in range(row + 1):
            ax: Axes = grid[row, column]
            ax.grid(False)
            ax.tick_params(labelsize=6 if small else 8, length=2, pad=2)
            ax.xaxis.set_major_locator(MaxNLocator(2 if small else 3, prune="both"))
            if column < row:
                ax.yaxis.set_major_locator(MaxNLocator(2 if small else 3, prune="both"))
        grid[row, row].set_title(names[row], pad=3)
    beyond = LABEL_DISTANCE * grid[0, 0].figure.dpi / grid[0, 0].get_window_extent().width
    for place, name in enumerate(names):
        _outer(grid[size - 1, place].xaxis, name, 90)
        grid[size - 1, place].xaxis.set_label_coords(0.5, -beyond)
        if place:
            _outer(grid[place, 0].yaxis, name, 0)
            grid[place, 0].yaxis.set_label_coords(-beyond, 0.5)


def _outer(axis: Any, label: str, rotation: float) -> None:
    axis.set_major_formatter(ScalarFormatter(useOffset=False))
    axis.get_major_formatter().set_scientific(False)
    axis.set_label_text(label)
    for text in axis.get_ticklabels():
        text.set_rotation(rotation)


def _caption(figure: Any, samples: Floats, names: list[str], constants: list[Any], title: str) -> None:
    """Write what is seen, and what is not, into the empty upper right."""
    low, high = samples.min(axis=0), samples.max(axis=0)
    printed = [constant.get("published") for constant in constants]
    outside = [
        f"{name} = {value:g}".replace(" ", "\N{NO-BREAK SPACE}")
        for name, value, least, most in zip(names, printed, low, high, strict=True)
        if value is not None and not least <= value <= most
    ]
    handles = [
        Line2D([], [], color=BLACK, linewidth=0.8, label="regenerated"),
        Patch(color=BLUE, alpha=0.6, label="39 % and 86 % of the draws: one and two σ"),
    ]
    if any(value is not None for value in printed):
        label = "as printed" + ("" if not outside else "; outside its panel:\n" + fill(", ".join(outside), 40))
        handles.append(Line2D([], [], color=VERMILION, linestyle="--", linewidth=0.8, label=label))
    wider = [(c.get("jackknife_error") or 0.0) / s for c, s in zip(constants, samples.std(axis=0, ddof=1), strict=True)]
    if max(wider) > 1.0:
        note = f"the jackknife errors are up to {significant(max(wider))} times this wide"
        handles.append(Line2D([], [], linestyle="none", label=note))
    figure.legend(handles=handles, loc="upper right", bbox_to_anchor=(0.98, 0.975), title=title, alignment="left")

"""Canvas of every figure: its size, colours that colour-blind readers can distinguish, files whole or not at all."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from functools import wraps
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from mcml_sim.files.whole_file import require_folder, write_together

DPI = 150
POINTS = 72  # an inch
WIDTH = 8.0  # [inch]: 1200 pixels at DPI
# The palette of Okabe and Ito, Color Universal Design (2008).
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
YELLOW, BLUE, VERMILION, PURPLE, GREY = "#F0E442", "#0072B2", "#D55E00", "#CC79A7", "#7F7F7F"
RC: Any = MappingProxyType(  # read only
    {
        "font.family": "DejaVu Sans",  # ships with matplotlib: the same letters everywhere
        "font.size": 9.0,
        "axes.titlesize": 9.0,
        "axes.labelsize": 9.0,
        "xtick.labelsize": 8.0,
        "ytick.labelsize": 8.0,
        "legend.fontsize": 8.0,
        "legend.frameon": False,
        "axes.grid": True,
        "grid.color": "#DDDDDD",
        "grid.linewidth": 0.5,
        "axes.axisbelow": True,
        "axes.formatter.use_mathtext": True,
        "lines.linewidth": 1.4,
        "savefig.dpi": DPI,
        "svg.fonttype": "none",  # text stays text: it can be read, searched and set in the page's colour
        "svg.hashsalt": "profilefit",  # without it the ids in an SVG are random
    }
)
FORMATS: ContextVar[tuple[str, ...]] = ContextVar("FORMATS", default=("png", "svg"))
BAND = "95 % of posterior draws, the misfit taken for noise"
# How each set of constants looks in every figure.
PUBLISHED: Mapping[str, Any] = MappingProxyType({"color": VERMILION, "linestyle": (0, (5, 2))})
CORRECTED: Mapping[str, Any] = MappingProxyType({"color": ORANGE, "linestyle": (0, (4, 1.5, 1, 1.5))})
AS_PUBLISHED: Mapping[str, Any] = MappingProxyType({"color": GREEN, "linestyle": "-"})
WHOLE: Mapping[str, Any] = MappingProxyType({"color": BLUE, "linestyle": "-"})
DATA: Mapping[str, Any] = MappingProxyType(
    {"color": BLACK, "linestyle": "none", "marker": "o", "markersize": 2.6, "elinewidth": 0.8, "zorder": 4}
)


def styled(draw: Callable[..., Any]) -> Callable[..., Any]:
    """Run a drawing function under this module's settings and put matplotlib's own back."""

    @wraps(draw)
    def call(*arguments: Any, **named: Any) -> Any:
        with matplotlib.rc_context(RC):
            return draw(*arguments, **named)

    return call


def canvas(height: float, width: float = WIDTH, layout: Any = "constrained") -> Figure:
    """Return an empty figure of `width` x `height` [inch] with its own Agg canvas: pyplot never hears of it."""
    figure = Figure(figsize=(width, height), layout=layout)
    FigureCanvasAgg(figure)
    return figure


def legend_below(figure: Figure, axes: list[Axes]) -> None:
    """Draw one legend for all `axes` under the figure, in as many columns as fit."""
    handles: dict[str, Any] = {}
    for ax in axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    for columns in (4, 3, 2, 1):
        legend = figure.legend(list(handles.values()), list(handles), loc="outside lower center", ncols=columns)
        if columns == 1 or legend.get_window_extent().width < 0.98 * figure.bbox.width:
            return
        legend.remove()


def band_under(ax: Axes, x: Any, band: tuple[Any, Any] | None, color: str, label: str = BAND) -> None:
    """Shade a band in its law's colour; the legend explains it once, in grey. Nothing if there is none."""
    if band is not None:
        ax.fill_between(x, *band, color=color, alpha=0.25, linewidth=0)
        ax.fill_between([], [], [], color=GREY, alpha=0.4, linewidth=0, label=label)


class DrawnLaw(NamedTuple):
    """Law in a figure: its label and look, and the record with its posterior, if it has one."""

    label: str
    law: Any
    style: Mapping[str, Any]
    fitted: Any = None


def draw_curves(ax: Axes, x: Any, curves: Iterable[DrawnLaw], evaluate: Callable[[Any], Any]) -> None:
    """Draw `evaluate(law)` of each curve over x, and under it the 95 % band of its record."""
    for one in curves:
        band_under(ax, x, one.fitted.band(evaluate) if one.fitted else None, one.style["color"])
        ax.plot(x, evaluate(one.law), label=one.label, **one.style)


def plain_log(axis: Axis) -> None:
    """Label a short logarithmic axis with plain numbers at 1, 2 and 5."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def albedo_axis(ax: Axes) -> None:
    """Stretch x evenly in sqrt(1 - alpha), alpha [-] from 0 to 1: the end near 1 is where laws differ."""
    forward_and_back = (
        lambda alpha: 1.0 - np.sqrt(np.clip(1.0 - np.asarray(alpha), 0.0, None)),
        lambda x: 1.0 - np.clip(1.0 - np.asarray(x), 0.0, None) ** 2,
    )
    ax.set_xscale("function", functions=forward_and_back)
    ax.set_xlim(0.0, 1.0)
    ax.set_xticks([0, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95, 0.99, 1], ["0", ".2", ".4", ".6", ".8", ".9", ".95", ".99", "1"])
    ax.set_xlabel("reduced albedo α [-], even in √(1 − α)")


@contextmanager
def only(*formats: str) -> Iterator[None]:
    """Let `save` write these formats, of png and svg, and not both."""
    token = FORMATS.set(formats)
    try:
        yield
    finally:
        FORMATS.reset(token)


def save(figure: Figure, out: Path, name: str) -> list[Path]:
    """Write `name`.png and `name`.svg into folder `out`, both or neither; the SVG carries no date."""
    files = {kind: out / f"{name}.{kind}" for kind in FORMATS.get()}
    if tuple(files) == ("svg",):
        figure.dpi = POINTS  # as the SVG is drawn: what was measured of its texts serves again
    if (layout := figure.get_layout_engine()) is not None:
        layout.execute(figure)
    figure.set_layout_engine("none")  # it is laid out now: no need to do so again for each format
    contents: dict[Path, bytes | str] = {}
    for kind, path in files.items():
        drawn = io.BytesIO()
        figure.dpi = DPI
        # Not savefig, which draws everything once before, to find the layout.
        if kind == "png":
            FigureCanvasAgg(figure).print_png(drawn)
        else:
            FigureCanvasSVG(figure).print_svg(drawn, metadata={"Date": None})
        contents[path] = drawn.getvalue()
    require_folder(out)
    write_together(contents)
    return list(files.values())

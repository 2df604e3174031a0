"""Printed constants against regenerated ones, each on its own scale, with the error of the regenerated one."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D

from profilefit.report.canvas import BLACK, BLUE, GREY, VERMILION, canvas, save, styled
from profilefit.report.content import TOTAL, Content, converged, total_error, z_score
from profilefit.report.source import Source

ROW, FEET = 0.21, 1.0  # height of a constant, and of axis and legend [inch]
LINEAR, TICKS = 0.1, (-10, -1, -0.1, 0, 0.1, 1, 10)  # share of a constant up to which the axis is linear
FAR = 3.0  # standard errors


@styled
def constants_figure(source: Source, out: Path, name: str = "constants") -> list[Path]:
    """(published - regenerated) / |regenerated| [-] of every constant that is printed, ± its total error, and z."""
    rows = _printed(source)
    figure = canvas(ROW * len(rows) + FEET, layout=ConstrainedLayoutEngine(w_pad=0.1))
    ax = figure.subplots()
    for place, (_, one) in enumerate(rows):
        scale, z = abs(one["regenerated"]), z_score(one)
        far = z is not None and abs(z) > FAR
        ax.errorbar(0.0, place, xerr=(total_error(one) or 0.0) / scale, color=GREY, elinewidth=3.5, alpha=0.6)
        ax.plot(
            (one["published"] - one["regenerated"]) / scale, place, linestyle="none", markersize=4.5,
            marker="D" if far else "o", color=VERMILION if far else BLUE,
        )  # fmt: skip
        told = "held" if not one.get("free", True) else "–" if z is None else f"{z:+.1f}".replace("-", "−")
        ax.annotate(told, (1.01, place), xycoords=("axes fraction", "data"), va="center", fontsize=7.0)
    ax.axvline(0.0, color=BLACK, linewidth=0.8)
    ax.set_xscale("symlog", linthresh=LINEAR)
    ax.set_xticks(TICKS, [f"{tick:+g}".replace("-", "−") if tick else "0" for tick in TICKS])
    ax.set_yticks(range(len(rows)), [label for label, _ in rows], fontsize=7.0)
    ax.set(ylim=(len(rows) - 0.4, -0.6), xlabel="(published − regenerated) / |regenerated| [-], linear within ±0.1")
    ax.annotate("z", (1.01, -0.9), xycoords=("axes fraction", "data"), va="bottom", annotation_clip=False)
    _legend(figure)
    return save(figure, out, name)


def has_printed(source: Source) -> tuple[str, ...]:
    """Records with a constant that was printed."""
    return tuple(dict.fromkeys(label.split(" ")[0] for label, _ in _printed(source)))


def _printed(source: Source) -> list[tuple[str, Content]]:
    """(record and name, constant) of each that was printed; those of a failed fit are no law."""
    found = []
    for record_name in source.paths:
        content = source.content(record_name)
        if "constants" not in content or not converged(content):
            continue
        source.needed(record_name)  # whole, or an error that says what is wrong with it
        of = content["constants"].items()
        found += [(f"{record_name} {name}", one) for name, one in of if one.get("published") is not None]
    return found


def _legend(figure: Figure) -> None:
    handles = [
        Line2D([], [], color=BLUE, marker="o", linestyle="none", label=f"published, within {FAR:g} standard errors"),
        Line2D([], [], color=VERMILION, marker="D", linestyle="none", label="published, farther"),
        Line2D([], [], color=GREY, linewidth=3.5, alpha=0.6, label=f"± {TOTAL}"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3)

"""Quality of each law: the relative error of R_d and the largest error of the cdf, over the albedos."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes

from profilefit.fitting.measures import MEASURES
from profilefit.report.figures.canvas import (
    BLUE,
    GREEN,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    albedo_axis,
    canvas,
    plain_log,
    save,
    styled,
)
from profilefit.report.records import SETS, Content, Source, converged, measures

SHOWN = (MEASURES["rel"], MEASURES["ks"])
KINDS = {
    "searchlight": "pencil beam, n = 1",
    "diffuse": "diffuse light, n = 1",
    "refracting": "refracting surfaces, n = 1.4",
}
# Lines of one panel in turn, by colour and marker: never by colour alone. Printed constants are dashed.
COLOURS, MARKERS = (BLUE, VERMILION, GREEN, ORANGE, PURPLE, SKY), "osv^Dx+<"
ROW, FEET, HEAD = 2.7, 0.5, 0.3  # height of a row of panels, of what is below, of what is above [inch]


@dataclass(frozen=True)
class Line:
    """One set of constants: its label, where it was measured, the measures by name; whether it has a g."""

    label: str
    alpha: list[float]
    values: Content
    printed: bool
    forward: bool


@styled
def quality_figure(source: Source, out: Path, name: str = "quality") -> list[Path]:
    """Draw rel and ks [-] of every profile law and set of constants against alpha [-], at held-out albedos.

    A row of panels for each light, one for all surfaces that refract.
    """
    return _drawn(source, source.paths, out, name)


@styled
def record_quality_figure(record_name: str, source: Source, out: Path, name: str = "") -> list[Path]:
    """Draw rel and ks [-] of one record: its constants, and those printed for its law."""
    return _drawn(source, [record_name], out, name or f"quality-{record_name}")


def _drawn(source: Source, names: Iterable[str], out: Path, name: str) -> list[Path]:
    contents = {one: source.content(one) for one in names if measures(source.content(one), "rel")}
    rows = {kind: [c for c in contents.items() if _kind(c[1]) == kind] for kind in KINDS}
    shown = {kind: list(_lines(group)) for kind, group in rows.items() if group}
    figure = canvas(HEAD + ROW * len(shown) + FEET)
    grid = figure.subplots(len(shown), len(SHOWN), squeeze=False)
    for row, (kind, lines) in zip(grid, shown.items(), strict=True):
        for ax, one in zip(row, SHOWN, strict=True):
            _panel(ax, one.name, lines)
        row[0].set_ylabel(KINDS[kind])
        if lines:  # none where every fit failed
            row[-1].legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7.0)
    for ax, one in zip(grid[0], SHOWN, strict=True):
        ax.set_title(f"{one.formula} [{one.unit}]".replace("R_d", "R$_d$"))
    for ax in grid[:-1].flat:
        ax.set_xlabel("")
    return save(figure, out, name)


def _panel(ax: Axes, key: str, lines: list[Line]) -> None:
    for place, line in enumerate(lines):
        look: dict[str, Any] = {
            "color": COLOURS[place % len(COLOURS)],
            "marker": MARKERS[place % len(MARKERS)],
            "linestyle": "--" if line.printed else "-",
        }
        ax.plot(line.alpha, line.values[key], label=line.label, markersize=3.0, **look)
    albedo_axis(ax)
    if any(line.forward for line in lines):
        ax.set_xlabel("single-scattering albedo α [-], reduced if g ≠ 0")
    ax.tick_params(axis="x", labelsize=7.0)
    ax.set_yscale("log")
    plain_log(ax.yaxis)


def _kind(content: Content) -> str:
    setting = content["setting"]
    return str(setting["illumination"]) if setting["n"] == 1 and setting["g"] == 0 else "refracting"


def _lines(contents: Iterable[tuple[str, Content]]) -> Iterator[Line]:
    """Yield each set once: printed constants are the same in every record of their law."""
    drawn: set[str] = set()
    for name, content in contents:
        quality = content["quality"]
        for which in (one for one in SETS if one in quality):
            regenerated = which == "regenerated"
            g = content["setting"]["g"]
            label = (name if regenerated else f"{content['law']}, {which}") + (f", g = {g:g}" if g else "")
            if label not in drawn and (converged(content) or not regenerated):
                drawn.add(label)
                yield Line(label, quality["alpha"], quality[which], not regenerated, bool(g))

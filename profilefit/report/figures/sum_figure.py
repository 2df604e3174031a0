"""Error of sums of Gaussians over their number, of every stack that a folder has records of."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.ticker import NullLocator

from mcml_sim.media.setting import ILLUMINATIONS
from profilefit.laws.gaussians import DEFAULT
from profilefit.materials import CHANNELS
from profilefit.recipes import record
from profilefit.recipes.folder import SUMS
from profilefit.recipes.kinds.gaussians import COUNTS, SumRecord, load
from profilefit.report.figures.canvas import BLUE, GREEN, GREY, VERMILION, canvas, legend_below, plain_log, save, styled
from profilefit.report.kinds import published
from profilefit.report.records import Source

NAME = "gaussians-of-stacks"
LOOKS = {"red": (VERMILION, "o"), "green": (GREEN, "s"), "blue": (BLUE, "^")}  # never by colour alone
LONGEST = 3  # panels of a row
ROW, FEET = 2.5, 0.7  # height of a row, and of what is below [inch]
LINES = {"searchlight": (0, (1, 1.5)), "diffuse": "-"}


def sums_of(folder: Path) -> dict[str, SumRecord]:
    """Return the records of sums that lie in a folder of records, by the names of their stacks."""
    return {name: load(path) for name, path in record.available(folder / SUMS).items()}


@styled
def sum_figure(source: Source, out: Path, name: str = NAME) -> list[Path]:
    """Draw rel [-] of 1 to 8 Gaussians, a panel a stack; of skin the six published ones too."""
    sums = sums_of(source.folder)
    columns = min(len(sums), LONGEST)
    rows = -(-len(sums) // columns)
    figure = canvas(ROW * rows + FEET)
    panels = list(figure.subplots(rows, columns, sharey=True, squeeze=False).flat)
    for ax in panels[len(sums) :]:
        ax.remove()
    for ax, (stack, one) in zip(panels, sums.items(), strict=False):
        _draw(ax, one)
        ax.set_title(stack)
    for ax in panels[0::columns]:
        ax.set_ylabel("mean relative error of R$_d$ [-]")
    legend_below(figure, panels[: len(sums)])
    return save(figure, out, name)


def sum_caption(sums: Mapping[str, SumRecord]) -> str:
    """Return what the figure shows, and what six Gaussians cost by these records."""
    of_six = {
        (key, stack, light, channel): value
        for stack, one in sums.items()
        for light in ILLUMINATIONS
        for key in ("rel", "alone")
        for channel, value in zip(CHANNELS, one.content["sums"][light]["by_count"][DEFAULT - 1][key], strict=True)
    }
    rel, alone = ({place[1:]: v for place, v in of_six.items() if place[0] == key} for key in ("rel", "alone"))
    worst = max(rel, key=rel.__getitem__)
    text = (
        "Sums of Gaussians of one set of variances in all colours: mean relative error of R_d, in rings even in ln r "
        "from 0.01 mean free paths to 99.5 % of the light. "
        f"Six are off by {_percent(min(rel.values()))} to {_percent(max(rel.values()))} (worst: {worst[0]}, "
        f"{worst[2]}, {worst[1]}), by at most {_percent(max(alone.values()))} where each colour has its own variances."
    )
    for one in sums.values():
        if others := published(one).get(one.content["setting"]["illumination"]):
            own = one.content["sums"][one.content["setting"]["illumination"]]["by_count"][DEFAULT - 1]
            off = ", ".join(_percent(each["rel"]) for each in others)
            text += (
                f" The six that d'Eon and Luebke published for a skin (GPU Gems 3, ch. 14) are off this one's light by "
                f"{off} in red, green and blue; their cdf by at most {max(each['ks'] for each in others):.2g}, that of "
                f"the six here by {max(own['ks']):.2g}."
            )
    return text


def _percent(share: float) -> str:
    return f"{100 * share:.3g} %"


def _draw(ax: Axes, record: SumRecord) -> None:
    others = published(record)
    for channel, (color, marker) in LOOKS.items():
        place = CHANNELS.index(channel)
        style: dict[str, Any] = {"color": color, "marker": marker, "markersize": 3.5}
        for light, line in LINES.items():
            rel = [each["rel"][place] for each in record.content["sums"][light]["by_count"]]
            ax.plot(COUNTS, rel, linestyle=line, label=channel if line == "-" else None, **style)
            if others:
                of_six = others[light][place]["rel"]
                ax.plot(DEFAULT, of_six, color=color, linestyle="none", marker=marker, markersize=6, fillstyle="none")
    ax.plot([], [], color=GREY, linestyle=LINES["diffuse"], label="diffuse light")
    ax.plot([], [], color=GREY, linestyle=LINES["searchlight"], label="searchlight")
    if others:
        ax.plot([], [], color=GREY, linestyle="none", marker="o", markersize=6, fillstyle="none", label="published")
    ax.set_yscale("log")
    plain_log(ax.yaxis)
    ax.set_xticks(list(COUNTS))
    ax.xaxis.set_minor_locator(NullLocator())
    ax.set_xlabel("number of Gaussians [-]")

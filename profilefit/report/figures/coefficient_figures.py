"""Equations (11), (13) and (15) redone: a, b and c of (7) against the albedo, and each law over the per-albedo fits."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from profilefit.fitting.staged import COEFFICIENTS, CONSTANTS_OF
from profilefit.report.figures.canvas import (
    AS_PUBLISHED,
    BLACK,
    BLUE,
    CORRECTED,
    DATA,
    GREY,
    PUBLISHED,
    PURPLE,
    VERMILION,
    WHOLE,
    DrawnLaw,
    canvas,
    draw_curves,
    legend_below,
    plain_log,
    save,
    styled,
)
from profilefit.report.records import TOTAL, Content, Fitted, Source, coefficients, converged, total_error, z_score

Floats = NDArray[np.float64]
EQUATION = {"a": "(11)", "b": "(13)", "c": "(15)"}
UNIT = {"a": "1/mfp", "b": "-", "c": "mfp"}
STAGED = {"color": PURPLE, "linestyle": (0, (1, 1.2))}
RATIOS = (0.6, 1.4)  # shown of law over fitted point [-]


@styled
def coefficient_figure(letter: str, source: Source, out: Path, name: str = "") -> list[Path]:
    """Draw one coefficient against alpha [-], the end near 1 enlarged, and the laws over the fitted points below."""
    data = source.needed("liang-as-published")
    lines = _lines(letter, source, data)
    figure = canvas(6.4)
    axes = figure.subplots(2, 2, height_ratios=(1.6, 1.0), width_ratios=(1.5, 1.0))
    for column, (low, high) in enumerate(((0.0, 1.0), (0.9, 1.0))):
        top, bottom = axes[0, column], axes[1, column]
        alpha = np.linspace(max(low, 0.02), high, 500)
        _values(top, letter, alpha, lines, data)
        _ratios(bottom, letter, lines, data)
        for ax in (top, bottom):
            ax.set_xlim(low, high + 0.02 * (high - low))
        bottom.set_xlabel("single-scattering albedo α [-]")
        if column:
            _fit_y(top, letter, alpha, lines, data, low)
    axes[0, 0].set(ylabel=f"{letter} of (7) [{UNIT[letter]}]", title=f"{letter} by {EQUATION[letter]}, l = 1")
    axes[0, 1].set_title("the end near α = 1, enlarged")
    axes[1, 0].set_ylabel("law over fitted point [-]")
    if letter == "b":
        axes[0, 0].set(yscale="log", ylim=(5e-4, 1.0))
        axes[0, 1].set_yscale("log")
        plain_log(axes[0, 1].yaxis)
    if letter == "a":
        for ax in axes[0]:
            ax.axhline(0.0, color=GREY, linestyle=":", label="a = 0: from here on (7) has no r$_{max}$")
    legend_below(figure, list(axes.flat))
    return save(figure, out, name or f"liang-{EQUATION[letter][1:-1]}-{letter}")


a_figure = partial(coefficient_figure, "a")
b_figure = partial(coefficient_figure, "b")
c_figure = partial(coefficient_figure, "c")


def _lines(letter: str, source: Source, data: Fitted) -> list[DrawnLaw]:
    setting, equation = data.law.setting, EQUATION[letter]
    printed = source.printed("liang", "published", setting)
    lines = [DrawnLaw(f"{equation} as printed", printed, PUBLISHED)]
    corrected = source.printed("liang", "corrected", setting)
    if any(getattr(corrected, name) != getattr(printed, name) for name in CONSTANTS_OF[letter]):
        label = f"{equation} as printed but b0 = {corrected.constants()['b0']:g}"
        lines.append(DrawnLaw(label, corrected, CORRECTED))
    stage = data.content["stages"]["coefficient_laws"][letter]
    staged = data.law.with_vector(tuple(stage["constants"]), list(stage["constants"].values()))
    failed = "" if stage["result"] == "converged" else " (did not converge)"
    lines.append(DrawnLaw(f"{equation} through the points{failed}", staged, STAGED))
    labels = {
        "liang-as-published": ("regenerated, the paper's protocol, jointly", AS_PUBLISHED),
        "liang-whole": ("regenerated, whole profile", WHOLE),
    }
    for name, (label, style) in labels.items():
        fitted = source.usable(name)
        if fitted is not None:
            lines.append(DrawnLaw(label, fitted.law, style, fitted))
    return lines


def _values(ax: Axes, letter: str, alpha: Floats, lines: list[DrawnLaw], data: Fitted) -> None:
    column = COEFFICIENTS.index(letter)
    draw_curves(ax, alpha, lines, lambda law: coefficients(law, alpha)[column])
    points, errors = data.arrays["coefficients"][:, column], data.arrays["coefficient_errors"][:, column]
    ax.errorbar(data.arrays["alpha"], points, errors, label="(7) fitted at one albedo, ± photon noise", **DATA)


def _ratios(ax: Axes, letter: str, lines: list[DrawnLaw], data: Fitted) -> None:
    column = COEFFICIENTS.index(letter)
    alpha, points = data.arrays["alpha"], data.arrays["coefficients"][:, column]
    for label, law, style, _ in lines:
        ratio = coefficients(law, alpha)[column] / points
        ax.plot(alpha, ratio, marker=".", markersize=3, **style)
        if ratio.min() > RATIOS[1]:
            note = f"{label}: {ratio.min():.1f} to {ratio.max():.1f} times"
            ax.text(0.5, 0.95, note, color=style["color"], transform=ax.transAxes, ha="center", va="top", fontsize=8)
    sigma = np.abs(data.arrays["coefficient_errors"][:, column] / points)
    ax.errorbar(alpha, np.ones_like(alpha), sigma, **DATA)
    ax.axhline(1.0, color=BLACK, linewidth=0.8)
    ax.set_ylim(*RATIOS)


def _fit_y(ax: Axes, letter: str, alpha: Floats, lines: list[DrawnLaw], data: Fitted, low: float) -> None:
    """Scale the enlarged panel to what it shows."""
    column = COEFFICIENTS.index(letter)
    near = data.arrays["alpha"] >= low
    shown = [coefficients(law, alpha)[column] for _, law, _, _ in lines]
    values = np.concatenate([*shown, data.arrays["coefficients"][near, column]])
    if letter == "b":
        ax.set_ylim(0.7 * values.min(), 1.4 * values.max())
    else:
        margin = 0.08 * np.ptp(values)
        ax.set_ylim(values.min() - margin, values.max() + margin)


ROW, FEET = 0.21, 1.0  # height of a constant, and of axis and legend [inch]
LINEAR, TICKS = 0.1, (-10, -1, -0.1, 0, 0.1, 1, 10)  # share of a constant up to which the axis is linear
FAR = 3.0  # standard errors


@styled
def constants_figure(source: Source, out: Path, name: str = "constants") -> list[Path]:
    """Draw (published - regenerated) / |regenerated| [-] of every printed constant, ± its total error, and z."""
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
        text = "held" if not one.get("free", True) else "–" if z is None else f"{z:+.1f}".replace("-", "−")
        ax.annotate(text, (1.01, place), xycoords=("axes fraction", "data"), va="center", fontsize=7.0)
    ax.axvline(0.0, color=BLACK, linewidth=0.8)
    ax.set_xscale("symlog", linthresh=LINEAR)
    ax.set_xticks(TICKS, [f"{tick:+g}".replace("-", "−") if tick else "0" for tick in TICKS])
    ax.set_yticks(range(len(rows)), [label for label, _ in rows], fontsize=7.0)
    ax.set(ylim=(len(rows) - 0.4, -0.6), xlabel="(published − regenerated) / |regenerated| [-], linear within ±0.1")
    ax.annotate("z", (1.01, -0.9), xycoords=("axes fraction", "data"), va="bottom", annotation_clip=False)
    _legend(figure)
    return save(figure, out, name)


def has_printed(source: Source) -> tuple[str, ...]:
    """Return records with a constant that was printed."""
    return tuple(dict.fromkeys(label.split(" ")[0] for label, _ in _printed(source)))


def _printed(source: Source) -> list[tuple[str, Content]]:
    """Return (record and name, constant) of each that was printed; those of a failed fit are no law."""
    rows = []
    for record_name in source.paths:
        content = source.content(record_name)
        if "constants" not in content or not converged(content):
            continue
        source.needed(record_name)  # whole, or an error that says what is wrong with it
        of = content["constants"].items()
        rows += [(f"{record_name} {name}", one) for name, one in of if one.get("published") is not None]
    return rows


def _legend(figure: Figure) -> None:
    handles = [
        Line2D([], [], color=BLUE, marker="o", linestyle="none", label=f"published, within {FAR:g} standard errors"),
        Line2D([], [], color=VERMILION, marker="D", linestyle="none", label="published, farther"),
        Line2D([], [], color=GREY, linewidth=3.5, alpha=0.6, label=f"± {TOTAL}"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3)

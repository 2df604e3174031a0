"""Every figure that the records of a folder allow: residuals, quality by albedo, posteriors, sums of Gaussians."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from operator import methodcaller
from pathlib import Path
from textwrap import fill
from typing import Any

import corner
import jax
import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator, NullLocator, ScalarFormatter
from numpy.typing import NDArray

from mcml_sim import exact
from mcml_sim.media.arrays import Floats
from mcml_sim.media.setting import ILLUMINATIONS
from profilefit.fitting.quality import MEASURES
from profilefit.laws.base import ProfileLaw
from profilefit.laws.gaussians import DEFAULT
from profilefit.materials import CHANNELS
from profilefit.recipes import record
from profilefit.recipes.folder import SUMS
from profilefit.recipes.kinds import gaussians
from profilefit.recipes.workers import Workers
from profilefit.report.figures import canvas as pen
from profilefit.report.figures import paper_figures as paper
from profilefit.report.figures.canvas import albedo_axis, canvas, legend_below, plain_log, save, styled
from profilefit.report.kinds import published
from profilefit.report.records import Content, Fitted, Source, converged, judged_sets, measures
from profilefit.report.tables.cells import significant


@dataclass(frozen=True)
class Plan:
    """One figure: its file's name, the records it cannot do without, those it shows if they are there, who draws it.

    draw     returns it, under the settings of matplotlib that `drawn` makes
    missing  why it cannot be drawn although its records are there; empty if it can
    """

    name: str
    needs: tuple[str, ...]
    uses: tuple[str, ...]
    draw: Callable[[Source], Figure]
    missing: str = ""

    @styled
    def drawn(self, source: Source, out: Path) -> list[Path]:
        """Draw the figure into a folder, and return its files."""
        return save(self.draw(source), out, self.name)


Track = Callable[[list[Plan]], Iterable[Plan]]

INVERSE, QUANTILES = ("liang-inverse-whole",), ("quantile", "quantile-diffuse")
PAPER = (
    Plan("liang-7-profile", ("liang-as-published",), ("liang-whole",), paper.profile_figure),
    Plan("liang-7-error", ("liang-whole",), ("liang-as-published",), paper.error_figure),
    Plan("liang-8-albedo", ("albedo-liang",), ("albedo-rational",), paper.albedo_figure),
    Plan("liang-11-a", ("liang-as-published",), ("liang-whole",), partial(paper.coefficient_figure, "a")),
    Plan("liang-13-b", ("liang-as-published",), ("liang-whole",), partial(paper.coefficient_figure, "b")),
    Plan("liang-15-c", ("liang-as-published",), ("liang-whole",), partial(paper.coefficient_figure, "c")),
    Plan("liang-19-inverse", INVERSE, ("liang-inverse-as-published", "liang-whole"), paper.inverse_figure),
    Plan("inversion-error", INVERSE, (*QUANTILES, "hazard", "hazard-diffuse"), paper.inversion_figure),
)


def draw_all(
    folder: Path, out: Path, names: Sequence[str] | None = None, track: Track = iter, processes: int = 1
) -> tuple[list[Path], list[str]]:
    """Draw every figure that the records in `folder` allow into folder `out`, as PNG and SVG.

    names  records: only figures that show one of them; all if None or empty
    track  is shown the progress: plans, as a list -> the same, as they are drawn
    processes  how many draw, each a process of its own if not one
    Returns the files written, and a line for each figure left out, with the reason. Raises RecordError on a record
    that is damaged, OutputError where `out` cannot be written.
    """
    source = Source(folder)
    possible: list[Plan] = []
    left_out: list[str] = []
    for plan in plans(source):
        if names and set(names).isdisjoint(plan.needs + plan.uses):
            continue
        absent = [name for name in plan.needs if name not in source.paths]
        reason = f"{folder} has no record {', '.join(absent)}" if absent else plan.missing
        if reason:
            left_out.append(f"{plan.name}: {reason}")
        else:
            possible.append(plan)
    drawn: dict[int, list[Path]] = {}
    with Workers(min(processes, len(possible))) as workers:
        known = source if processes == 1 else Source(folder)  # what is read travels with the task
        figures = workers.each(methodcaller("drawn", known, out), possible)
        for _ in track(possible):
            number, drawn[number] = next(figures)
    return [path for number in range(len(possible)) for path in drawn[number]], left_out


def plans(source: Source) -> tuple[Plan, ...]:
    """Return the paper's figures, those of all laws and stacks, and of each record."""
    profiles = tuple(name for name in source.paths if measures(source.content(name), "rel"))
    lacking = "" if profiles else f"{source.folder} has no record of a profile law"
    printed = paper.has_printed(source)
    unprinted = "" if printed else f"{source.folder} has no record of constants that were printed"
    return (
        *PAPER,
        Plan("constants", (), printed, paper.constants_figure, unprinted),
        Plan("quality", (), profiles, quality_figure, lacking),
        *([Plan(OF_SUMS, (), (), sum_figure)] if record.available(source.folder / SUMS) else []),
        *(plan for name in source.paths for plan in record_plans(source, name)),
    )


def record_plans(source: Source, name: str) -> tuple[Plan, ...]:
    """Return the figures of one record."""
    content = source.content(name)
    if "constants" not in content:
        return ()
    failed = "" if converged(content) else f"the fit failed: {content['fit']['result']}"
    chained = "misfit" in content["posterior"] and "covariance" in content
    chainless = "" if chained else f"no posterior: {content['fit']['result']}"
    residuals = Plan(f"residuals-{name}", (name,), (), partial(residual_figure, name), failed)
    quality = Plan(f"quality-{name}", (name,), (), partial(quality_figure, names=[name]), failed)
    posterior = Plan(f"corner-{name}", (name,), (), partial(corner_figure, name), chainless)
    return (residuals, *([quality] if measures(content, "rel") else []), posterior)


ALBEDOS = 6  # of a record's albedos, in order
WITHIN = 0.995  # of the energy, as in quality.ENERGY_WITHIN: beyond it no measure looks
MOST_RINGS = 60  # drawn: the paper's 400 even rings would hide each other
SHARES = np.linspace(0.0, 0.999, 400)
SHADES = "viridis"  # from dark to light with alpha
HEIGHT = 3.2  # [inch]


def residual_figure(record_name: str, source: Source) -> Figure:
    """Draw a profile law's energy of a ring over that of the data, less 1 [-], with the data's standard errors.

    Of an inverse cdf: exact cdf(r(xi)) - xi [-]. Of a map: alpha or A, whichever was fitted, less that of the data [-].
    """
    fitted = source.needed(record_name)
    figure = canvas(HEIGHT)
    ax = figure.subplots()
    if fitted.content["pipeline"] == "albedo":
        _of_map(ax, fitted)
    else:
        is_inverse = fitted.content["pipeline"] == "inverse"
        alphas = fitted.arrays["alpha"]
        rows = np.unique(np.linspace(0, alphas.size - 1, ALBEDOS).round().astype(int))
        colours = matplotlib.colormaps[SHADES](np.linspace(0.05, 0.9, rows.size))
        for row, colour in zip(rows, colours, strict=True):
            alpha = float(alphas[row])
            if is_inverse:
                radii = fitted.law.sampler.sample(SHARES, alpha)
                left = np.asarray(exact.cdf(radii, alpha, setting=fitted.law.setting)) - SHARES
                ax.plot(SHARES, left, color=colour, label=f"α = {alpha:.3f}")
            else:
                _of_profile(ax, fitted, alpha, colour, int(row))
        if is_inverse:
            ax.set(xlabel="ξ [-]", ylabel="exact cdf(r(ξ)) − ξ [-]", xlim=(0.0, 1.0))
        else:
            ax.set(xscale="log", xlabel="r [mfp]", ylabel="energy of a radial bin: law / data − 1 [-]")
        ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    ax.axhline(0.0, color=pen.BLACK, linewidth=0.8)
    return figure


def _of_map(ax: Axes, fitted: Fitted) -> None:
    """Draw alpha at the data's A, or A at the data's alpha, of the fitted map, less that of the data."""
    alpha = fitted.albedos
    law = fitted.law
    reflectance, error = fitted.arrays["reflectance"], np.nan_to_num(fitted.arrays["reflectance_error"])
    if fitted.content["protocol"]["weighting"]["objective"] == "albedo":
        left, error = np.asarray(law.alpha(reflectance)) - alpha, error * np.gradient(alpha, reflectance)
        what = "α"
    else:
        left, what = np.asarray(law.reflectance(alpha)) - reflectance, "A"
    ax.errorbar(alpha, left, error, color=pen.BLUE, marker="o", markersize=2.6, linewidth=0.8, elinewidth=0.8)
    albedo_axis(ax)
    ax.set_ylabel(f"{what} of the map less {what} of the data [-]")


def _of_profile(ax: Axes, fitted: Fitted, alpha: float, colour: Floats, row: int) -> None:
    edges, energy = fitted.arrays["r_edges"], fitted.arrays["energy"][row]
    error = np.nan_to_num(fitted.arrays["energy_error"][row])
    last = np.searchsorted(np.cumsum(energy), WITHIN * np.sum(energy))
    index = np.flatnonzero((energy > 0) & (np.arange(energy.size) <= last))
    index = index[np.unique(np.geomspace(1, index.size, MOST_RINGS).astype(int) - 1)]
    inner, outer = edges[:-1][index], edges[1:][index]
    middle = np.sqrt(np.maximum(inner, 0.25 * outer) * outer)
    (model,) = np.diff(energy_within(fitted.law, np.stack([inner, outer]), alpha), axis=0)
    left, spread = model / energy[index] - 1.0, error[index] / energy[index]
    ax.errorbar(middle, left, spread, color=colour, linewidth=1.0, elinewidth=0.7, label=f"α = {alpha:.3f}")


_energy_within = jax.jit(lambda law, edges, alpha: law.unscaled_energy(edges, alpha))


def energy_within(law: ProfileLaw, edges: Floats, alpha: float) -> Floats:
    """Return what the fit compared, within each edge (..., n) [-]."""
    short = -edges.shape[-1] % MOST_RINGS  # so that one compilation serves all albedos
    full = np.pad(edges, [(0, 0)] * (edges.ndim - 1) + [(0, short)], mode="edge")
    with jax.enable_x64(True):
        return np.asarray(_energy_within(law, full, np.float64(alpha)))[..., : edges.shape[-1]]


SHOWN = (MEASURES["rel"], MEASURES["ks"])
KINDS = {
    "searchlight": "pencil beam, n = 1",
    "diffuse": "diffuse illumination, n = 1",
    "refracting": "refracting interface, n = 1.4",
}
# Lines of one panel in turn, by colour and marker: never by colour alone. Printed constants are dashed.
COLOURS, MARKERS = (pen.BLUE, pen.VERMILION, pen.GREEN, pen.ORANGE, pen.PURPLE, pen.SKY), "osv^Dx+<"
ROW, FEET, HEAD = 2.7, 0.5, 0.3  # height of a row of panels, of what is below, of what is above [inch]


def quality_figure(source: Source, names: Iterable[str] | None = None) -> Figure:
    """Draw rel and ks [-] of every profile law and set of constants against alpha [-], at held-out albedos.

    A row of panels for each light, one for all surfaces that refract. `names` are the records, all of them if None.
    """
    known = {owner: source.content(owner) for owner in names or source.paths}
    contents = {owner: content for owner, content in known.items() if measures(content, "rel")}
    groups: dict[str, list[tuple[str, Content]]] = {kind: [] for kind in KINDS}
    for owner, content in contents.items():
        light, n, g = (content["setting"][key] for key in ("illumination", "n", "g"))
        groups[light if (n, g) == (1, 0) else "refracting"].append((owner, content))
    shown = {kind: _sets(group) for kind, group in groups.items() if group}
    figure = canvas(HEAD + ROW * len(shown) + FEET)
    grid = figure.subplots(len(shown), len(SHOWN), squeeze=False)
    for row, (kind, sets) in zip(grid, shown.items(), strict=True):
        for ax, one in zip(row, SHOWN, strict=True):
            _panel(ax, one.name, sets)
        row[0].set_ylabel(KINDS[kind])
        if sets:  # none where every fit failed
            row[-1].legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7.0)
    for ax, one in zip(grid[0], SHOWN, strict=True):
        ax.set_title(f"{one.formula} [{one.unit}]".replace("R_d", "R$_d$"))
    for ax in grid[:-1].flat:
        ax.set_xlabel("")
    return figure


def _panel(ax: Axes, key: str, sets: Mapping[str, tuple[Content, str]]) -> None:
    for place, (label, (content, which)) in enumerate(sets.items()):
        look: dict[str, Any] = {
            "color": COLOURS[place % len(COLOURS)],
            "marker": MARKERS[place % len(MARKERS)],
            "linestyle": "-" if which == "regenerated" else "--",
        }
        quality = content["quality"]
        ax.plot(quality["alpha"], quality[which][key], label=label, markersize=3.0, **look)
    albedo_axis(ax)
    ax.tick_params(axis="x", labelsize=7.0)
    ax.set_yscale("log")
    plain_log(ax.yaxis)


def _sets(contents: Iterable[tuple[str, Content]]) -> dict[str, tuple[Content, str]]:
    """Return each set once, by its label: printed constants are the same in every record of their law."""
    sets: dict[str, tuple[Content, str]] = {}
    for name, content in contents:
        g = content["setting"]["g"]
        for which in judged_sets(content):
            label = name if which == "regenerated" else f"{content['law']}, {which}"
            sets.setdefault(label + (f", g = {g:g}" if g else ""), (content, which))
    return sets


# Probability inside one and two standard deviations of a normal pair of constants: 1 - exp(-k^2 / 2).
LEVELS = (1.0 - np.exp(-0.5), 1.0 - np.exp(-2.0))
BINS = 20
LABEL_DISTANCE = 0.5  # of an axis name from its panel [inch]
MOST = 9  # constants that a figure shows: the panels of more are too small
LARGE = 5  # constants beyond which the numbers on the axes must be few


def corner_figure(record_name: str, source: Source) -> Figure:
    """Draw the posterior draws of a record's constants, in pairs and alone, with the regenerated and printed values."""
    fitted = source.needed(record_name)
    samples = fitted.arrays["samples_misfit"].astype(float)
    names, held_back = fitted.content["covariance"]["names"], ""
    if len(names) > MOST:
        correlation = np.abs(np.corrcoef(samples, rowvar=False))
        np.fill_diagonal(correlation, 0.0)
        kept = sorted(np.argsort(-correlation.max(axis=0), kind="stable")[:MOST].tolist())
        held_back = f"the {MOST} of {len(names)} constants that\nare most correlated with another one"
        samples, names = samples[:, kept], [names[place] for place in kept]
    constants = [fitted.content["constants"][name] for name in names]
    figure = canvas(8.0, layout="none")
    grid = corner_grid(figure, samples, BINS, max_n_ticks=2 if len(names) > LARGE else 4)
    figure.subplots_adjust(left=0.09, right=0.97, bottom=0.09, top=0.965, wspace=0.06, hspace=0.06)
    looks = {"regenerated": (pen.BLACK, "-"), "published": (pen.VERMILION, "--")}
    for column, constant in enumerate(constants):
        for which, (color, style) in looks.items():  # where they lie in the panel
            value = constant.get(which)
            if value is not None and samples[:, column].min() <= value <= samples[:, column].max():
                mark(grid, column, value, color=color, linestyle=style)
    _axes(grid, names)
    title = f"{record_name}: spread by the law's misfit taken for noise" + (f";\n{held_back}" if held_back else "")
    _caption(figure, samples, names, constants, title)
    return figure


def corner_grid(figure: Figure, samples: Floats, bins: int, **more: Any) -> NDArray[Any]:
    """Draw samples (draws, n) in pairs and alone, and return the panels (n, n)."""
    corner.corner(
        samples, fig=figure, bins=bins, color=pen.BLUE, levels=LEVELS, smooth=1.0, plot_datapoints=False,
        plot_density=False, fill_contours=True, hist_kwargs={"linewidth": 1.0, "color": pen.BLUE},
        contour_kwargs={"linewidths": 0.6}, **more,
    )  # fmt: skip
    return np.array(figure.axes).reshape(samples.shape[1], -1)


def mark(grid: NDArray[Any], place: int, value: float, **look: Any) -> None:
    """Draw lines at a value of one constant in all panels that show it."""
    for row in range(place, len(grid)):
        grid[row, place].axvline(value, linewidth=0.8, **look)
    for column in range(place):
        grid[place, column].axhline(value, linewidth=0.8, **look)


def _axes(grid: NDArray[Any], names: list[str]) -> None:
    """Write names on the outside and few numbers, none with an offset that the reader must add."""
    size = len(names)
    small = size > LARGE
    for row in range(size):
        for column in range(row + 1):
            ax: Axes = grid[row, column]
            ax.grid(False)
            ax.tick_params(labelsize=6 if small else 8, length=2, pad=2)
            for axis in (ax.xaxis, ax.yaxis)[: 1 + (column < row)]:
                axis.set_major_locator(MaxNLocator(2 if small else 3, prune="both"))
        grid[row, row].set_title(names[row], pad=3)
    beyond = LABEL_DISTANCE * grid[0, 0].figure.dpi / grid[0, 0].get_window_extent().width
    for place, name in enumerate(names):
        _outer(grid[size - 1, place].xaxis, name, 90)
        grid[size - 1, place].xaxis.set_label_coords(0.5, -beyond)
        if place:
            _outer(grid[place, 0].yaxis, name, 0)
            grid[place, 0].yaxis.set_label_coords(-beyond, 0.5)


def _outer(axis: Any, label: str, rotation: float) -> None:
    axis.set_major_formatter(ScalarFormatter(useOffset=False, useMathText=False))
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
        Line2D([], [], color=pen.BLACK, linewidth=0.8, label="regenerated"),
        Patch(color=pen.BLUE, alpha=0.6, label="39 % and 86 % of the draws: one and two σ"),
    ]
    if any(value is not None for value in printed):
        label = "as printed" + ("" if not outside else "; outside its panel:\n" + fill(", ".join(outside), 40))
        handles.append(Line2D([], [], color=pen.VERMILION, linestyle="--", linewidth=0.8, label=label))
    wider = [(c.get("jackknife_error") or 0.0) / s for c, s in zip(constants, samples.std(axis=0, ddof=1), strict=True)]
    if max(wider) > 1.0:
        note = f"the jackknife errors are up to {significant(max(wider))} times this wide"
        handles.append(Line2D([], [], linestyle="none", label=note))
    figure.legend(handles=handles, loc="upper right", bbox_to_anchor=(0.98, 0.975), title=title, alignment="left")


# Error of sums of Gaussians over their number, of every stack that a folder has records of.

OF_SUMS = "gaussians-of-stacks"
LOOKS = {"red": (pen.VERMILION, "o"), "green": (pen.GREEN, "s"), "blue": (pen.BLUE, "^")}  # never by colour alone
LONGEST = 3  # panels of a row
STACK_ROW, STACK_FEET = 2.5, 0.7  # height of a row, and of what is below [inch]
STROKES = {"searchlight": (0, (1, 1.5)), "diffuse": "-"}


def sums_of(folder: Path) -> dict[str, gaussians.SumRecord]:
    """Return the records of sums that lie in a folder of records, by the names of their stacks."""
    return {name: gaussians.load(path) for name, path in record.available(folder / SUMS).items()}


def sum_figure(source: Source) -> Figure:
    """Draw rel [-] of 1 to 8 Gaussians, a panel a stack; of skin the six published ones too."""
    sums = sums_of(source.folder)
    columns = min(len(sums), LONGEST)
    rows = -(-len(sums) // columns)
    figure = canvas(STACK_ROW * rows + STACK_FEET)
    panels = list(figure.subplots(rows, columns, sharey=True, squeeze=False).flat)
    for ax in panels[len(sums) :]:
        ax.remove()
    for ax, (stack, one) in zip(panels, sums.items(), strict=False):
        _draw_sums(ax, one)
        ax.set_title(stack)
    for ax in panels[0::columns]:
        ax.set_ylabel("mean relative error of R$_d$ [-]")
    legend_below(figure, panels[: len(sums)])
    return figure


def sum_caption(sums: Mapping[str, gaussians.SumRecord]) -> str:
    """Return what the figure shows, and what six Gaussians cost by these records."""
    rel: dict[tuple[str, str, str], float] = {}
    alone = 0.0
    for (stack, one), light in product(sums.items(), ILLUMINATIONS):
        six = one.content["sums"][light]["by_count"][DEFAULT - 1]
        rel |= {(stack, light, channel): value for channel, value in zip(CHANNELS, six["rel"], strict=True)}
        alone = max(alone, *six["alone"])
    worst = max(rel, key=rel.__getitem__)
    text = (
        "Sums of Gaussians of one set of variances in all colours: mean relative error of R_d, in rings even in ln r "
        "from 0.01 mean free paths to 99.5 % of the light. "
        f"Six have an error of {_percent(min(rel.values()))} to {_percent(max(rel.values()))} (worst: {worst[0]}, "
        f"{worst[2]}, {worst[1]}), and at most {_percent(alone)} if each colour has its own variances."
    )
    for one in sums.values():
        light = one.content["setting"]["illumination"]
        if others := published(one).get(light):
            off, own = ", ".join(_percent(each["rel"]) for each in others), one.content["sums"][light]["by_count"]
            text += (
                f" The six that d'Eon and Luebke published for a skin (GPU Gems 3, ch. 14) are off this one's light by "
                f"{off} in red, green and blue; their cdf by at most {max(each['ks'] for each in others):.2g}, that of "
                f"the six here by {max(own[DEFAULT - 1]['ks']):.2g}."
            )
    return text


def _percent(share: float) -> str:
    return f"{100 * share:.3g} %"


def _draw_sums(ax: Axes, sums: gaussians.SumRecord) -> None:
    others = published(sums)
    for place, (channel, (color, marker)) in enumerate(LOOKS.items()):
        style: dict[str, Any] = {"color": color, "marker": marker, "markersize": 3.5}
        for light, line in STROKES.items():
            rel = [each["rel"][place] for each in sums.content["sums"][light]["by_count"]]
            ax.plot(gaussians.COUNTS, rel, linestyle=line, label=channel if line == "-" else None, **style)
            if others:
                of_six = others[light][place]["rel"]
                ax.plot(DEFAULT, of_six, color=color, linestyle="none", marker=marker, markersize=6, fillstyle="none")
    ax.plot([], [], color=pen.GREY, linestyle=STROKES["diffuse"], label="diffuse light")
    ax.plot([], [], color=pen.GREY, linestyle=STROKES["searchlight"], label="searchlight")
    if others:
        ax.plot([], [], color=pen.GREY, linestyle="none", marker="o", markersize=6, fillstyle="none", label="published")
    ax.set_yscale("log")
    plain_log(ax.yaxis)
    ax.set_xticks(list(gaussians.COUNTS))
    ax.xaxis.set_minor_locator(NullLocator())
    ax.set_xlabel("number of Gaussians [-]")

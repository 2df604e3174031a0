"""Figures of the paper redone: its profile (7), map (8), coefficients (11)-(15), inverse (19)-(21), and constants."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D

from mcml_sim import exact
from mcml_sim.media.arrays import Floats
from profilefit.fitting import discrepancy
from profilefit.fitting.staged import COEFFICIENTS, CONSTANTS_OF
from profilefit.recipes import catalogue
from profilefit.recipes.pipelines import inversion_error
from profilefit.report import records
from profilefit.report.figures import canvas as pen
from profilefit.report.figures.canvas import albedo_axis, canvas, draw_curves, legend_below, plain_log, save, styled
from profilefit.report.records import TOTAL, Content, Fitted, Source, coefficients, converged, total_error, z_score

Points = tuple[Floats, ...]
PANELS = (0.0, 0.25, 0.5, 0.75, 0.9, 1.0)  # of a record's albedos, in order: more of them near alpha = 1
RINGS_SHOWN = 26
NEAREST = 0.01  # [mfp], as in quality.NEAREST
ENERGY_WITHIN = 0.995  # as in quality.ENERGY_WITHIN: where `rel` stops looking
PHOTONS = "photons, ± 1 standard error"
TRUTH_BAND = "95 % of photon noise and model discrepancy together"
PRINTED_LAWS = {
    "published": ("(7) as printed", pen.PUBLISHED),
    "corrected": ("(7) as printed but b0 = 0.0641", pen.CORRECTED),
}
RECORDED_LAWS = {
    "liang-as-published": ("(7) regenerated, the paper's protocol", pen.AS_PUBLISHED),
    "liang-whole": ("(7) regenerated, whole profile", pen.WHOLE),
}


def _recorded(source: Source, looks: dict[str, tuple[str, Any]]) -> dict[str, pen.DrawnLaw]:
    """Return the laws of records that converged, with their labels and looks, by the record's name."""
    usable = {name: source.usable(name) for name in looks}
    return {name: pen.DrawnLaw(looks[name][0], one.law, looks[name][1], one) for name, one in usable.items() if one}


@styled
def profile_figure(source: Source, out: Path, name: str = "liang-7-profile") -> list[Path]:
    """Draw r R_d [1/mfp] against r [mfp], on a logarithmic scale that shows the tail, before the correction (18)."""
    return _by_albedo(source, out, name, "liang-as-published", canvas(6.6), _profile_panel, "r R$_d$ [1/mfp]")


@styled
def error_figure(source: Source, out: Path, name: str = "liang-7-error") -> list[Path]:
    """Draw R_d after the correction (18) over the exact one, less 1 [-], and the tallied rings with their noise."""
    return _by_albedo(source, out, name, "liang-whole", canvas(6.4), _error_panel, "R$_d$ over exact R$_d$, less 1 [-]")


def _by_albedo(
    source: Source, out: Path, name: str, record: str, figure: Any, panel: Callable[..., None], ylabel: str
) -> list[Path]:
    data = source.needed(record)
    axes = list(figure.subplots(2, 3, sharey=panel is _error_panel).flat)
    setting = data.law.setting
    laws = {
        which: pen.DrawnLaw(label, source.printed(data.content["law"], which, setting), look)
        for which, (label, look) in PRINTED_LAWS.items()
    } | _recorded(source, RECORDED_LAWS)
    for ax, share in zip(axes, PANELS, strict=True):
        panel(ax, data, round(share * (data.arrays["alpha"].size - 1)), laws)
    for ax in axes[3:]:
        ax.set_xlabel("r [mfp]")
    for ax in axes[::3]:
        ax.set_ylabel(ylabel)
    legend_below(figure, axes)
    return save(figure, out, name)


def _profile_panel(ax: Axes, data: Fitted, row: int, laws: dict[str, pen.DrawnLaw]) -> None:
    alpha = float(data.arrays["alpha"][row])
    cut = float(data.arrays["r_trim"][row])
    radii = {name: float(one.law.largest_radius(alpha)) for name, one in laws.items() if name != "published"}
    radii = {name: radius for name, radius in radii.items() if radius > 0}  # a > 0 has none
    end = 1.25 * max(cut, *radii.values())
    r_exact, profile = records.exact_profile(alpha, data.law.setting, NEAREST, end)
    source_limit = alpha / (4 * np.pi)
    r = np.linspace(0.0, end, 600)
    draw_curves(ax, r, laws.values(), lambda law: np.maximum(records.unscaled(law, r, alpha), 1e-12))
    ax.plot(r_exact, r_exact * profile, color=pen.BLACK, linewidth=0.9, label="exact", zorder=3)
    _rings(ax, data, row, end)
    at_foot: dict[str, Any] = {"transform": ax.get_xaxis_transform(), "clip_on": False, "zorder": 5}
    for name, radius in radii.items():
        ax.plot([radius], [0.0], marker="v", color=laws[name].style["color"], linestyle="none", **at_foot)
    ax.axvline(cut, color=pen.GREY, linestyle=":", linewidth=1.2, label="r'$_{max}$: where (6) trims")
    ax.plot([], [], marker="v", linestyle="none", color=pen.GREY, label="r$_{max}$ = −b/a: where (7) ends")
    ax.set(yscale="log", xlim=(0.0, end), ylim=(source_limit * 2e-4, source_limit * 15))
    ax.set_title(f"α = {alpha:.3f}")


def _rings(ax: Axes, data: Fitted, row: int, end: float) -> None:
    """Draw some of the rings, with the photons' standard error: even in r would crowd the start with none to see."""
    edges, energy, error = (data.arrays[key] for key in ("r_edges", "energy", "energy_error"))
    r = 0.5 * (edges[1:] + edges[:-1])
    places = np.linspace(0.0, min(end, r[-1]), RINGS_SHOWN)
    index = np.unique(np.searchsorted(r, places).clip(max=r.size - 1))
    index = index[energy[row][index] > 0]
    to_profile = 1.0 / (2 * np.pi * np.diff(edges))[index]  # E = 2 pi r R_d dr
    ax.errorbar(r[index], energy[row][index] * to_profile, error[row][index] * to_profile, label=PHOTONS, **pen.DATA)


def _error_panel(ax: Axes, data: Fitted, row: int, laws: dict[str, pen.DrawnLaw]) -> None:
    alpha, setting = float(data.arrays["alpha"][row]), data.law.setting
    outer = exact.quantile(ENERGY_WITHIN, alpha, setting=setting)
    r, truth = records.exact_profile(alpha, setting, NEAREST, 3.0 * float(outer))
    for one in laws.values():
        if one.fitted is not None:  # and states in which band the exact profile lies, which old records do not
            known = discrepancy.LawWithErrors.of_record(one.law, one.fitted.content, one.fitted.arrays)
            if known.discrepancy is not None:
                low, high = discrepancy.profile(known, r, alpha).interval()
                pen.band_under(ax, r, (low / truth - 1.0, high / truth - 1.0), one.style["color"], TRUTH_BAND)
        ax.plot(r, one.law.profile(r, alpha) / truth - 1.0, label=one.label, **one.style)
    edges = data.arrays["r_edges"]
    expected = np.diff(exact.cdf(edges, alpha, setting=setting)) * exact.reflectance(alpha, setting=setting)
    energy, error = data.arrays["energy"][row], data.arrays["energy_error"][row]
    middle = np.sqrt(np.maximum(edges[1:], NEAREST / 10) * np.maximum(edges[:-1], NEAREST / 10))
    shown = (energy > 0) & (edges[1:] < r[-1]) & (edges[:-1] > 0)
    ratio = energy / np.maximum(expected, 1e-300)
    ax.errorbar(middle[shown], ratio[shown] - 1, error[shown] / expected[shown], label=PHOTONS, **pen.DATA)
    ax.axhline(0.0, color=pen.BLACK, linewidth=0.8)
    ax.axvspan(float(outer), r[-1], color=pen.GREY, alpha=0.15, linewidth=0, label="the last 0.5 % of the energy")
    ax.set(xscale="log", xlim=(NEAREST, r[-1]), ylim=(-1.05, 1.05), title=f"α = {alpha:.3f}")


@styled
def albedo_figure(source: Source, out: Path, name: str = "liang-8-albedo") -> list[Path]:
    """Draw alpha [-] against A [-]; its error [-]; and sqrt(1 - alpha) over the exact one [-]: how far light goes."""
    data = source.needed("albedo-liang")
    setting = data.law.setting
    printed = catalogue.albedo_law("liang", "published", setting, source.folder)
    curves = [pen.DrawnLaw("(8) as printed", printed, pen.PUBLISHED)]
    if data.converged:
        curves.append(pen.DrawnLaw("(8) regenerated", data.law, pen.WHOLE, data))
    rational = ("rational in √(1 − α)", {"color": pen.GREEN, "linestyle": "-."})
    curves += _recorded(source, {"albedo-rational": rational}).values()
    figure = canvas(6.4)
    panels = figure.subplot_mosaic([["map", "error"], ["fold", "ratio"]])
    # Even in sqrt(1 - alpha): A is linear in it near A = 1, where all the trouble is.
    alpha = 1.0 - np.linspace(1.0, 1e-3, 500) ** 2
    exact_map = (np.asarray(exact.reflectance(alpha, setting=setting)), alpha)
    at = data.arrays.get("alpha")
    fitted = data.albedos if at is None else at
    points = fitted, data.arrays["reflectance"], data.arrays["reflectance_error"]
    even = np.linspace(0.0, 1.0, 1001)
    for ax in (panels["map"], panels["fold"]):
        ax.plot(*exact_map, color=pen.BLACK, linewidth=0.9, label="exact", zorder=3)
        draw_curves(ax, even, curves, lambda law: law.alpha(even))
        ax.errorbar(points[1], points[0], xerr=points[2], label=PHOTONS, **pen.DATA)
        ax.set_ylabel("single-scattering albedo α [-]")
    panels["map"].set(xlim=(0, 1), ylim=(0, 1.02), title="the whole map")
    panels["fold"].set(xlim=(0.7, 1.0), ylim=(0.97, 1.002), title="its end, enlarged")
    _map_errors(panels["error"], panels["ratio"], points, curves, exact_map)
    _folds(panels, curves)
    for ax in panels.values():
        ax.set_xlabel("total reflectance A [-]")
    legend_below(figure, list(panels.values()))
    return save(figure, out, name)


def _map_errors(error: Axes, ratio: Axes, points: Points, curves: list[pen.DrawnLaw], exact_map: Points) -> None:
    reflectance, alpha = exact_map
    s = np.sqrt(1.0 - alpha)
    draw_curves(error, reflectance, curves, lambda law: law.alpha(reflectance) - alpha)
    for one in curves:
        mapped = one.law.alpha(reflectance)
        inside = mapped < 1.0
        ratio.plot(reflectance[inside], np.sqrt(1.0 - mapped[inside]) / s[inside], label=one.label, **one.style)
    true_alpha, measured, sigma = points
    slope = np.interp(measured, reflectance, np.gradient(alpha, reflectance))
    error.errorbar(measured, true_alpha - np.interp(measured, reflectance, alpha), sigma * slope, **pen.DATA)
    for ax, level in ((error, 0.0), (ratio, 1.0)):
        ax.axhline(level, color=pen.BLACK, linewidth=0.8)
    error.set(xlim=(0, 1), ylabel="α less exact α [-]", title="error in α")
    ratio.set(xlim=(0.5, 1), ylim=(0.4, 100), yscale="log", title="error in √(1 − α), the root of the absorbed share")
    ratio.set_ylabel("√(1 − α) over exact √(1 − α) [-]")
    plain_log(ratio.yaxis)


def _folds(panels: dict[str, Axes], curves: list[pen.DrawnLaw]) -> None:
    """Mark where a map falls again, so that two reflectances share one albedo."""
    for place, (_, law, style, _) in enumerate(curves):
        fold = getattr(law, "fold", 1.0)
        if fold >= 1.0:
            continue
        for ax in panels.values():
            ax.axvline(fold, color=style["color"], linewidth=0.8, linestyle=":")
        note = f"turns at A = {fold:.4f}, α = {float(law.alpha(fold)):.5f}"
        panels["fold"].text(0.97, 0.05 + 0.08 * place, note, color=style["color"], transform=panels["fold"].transAxes,
                            ha="right", fontsize=8, bbox={"color": "white", "pad": 1})  # fmt: skip


EQUATION = {"a": "(11)", "b": "(13)", "c": "(15)"}
UNIT = {"a": "1/mfp", "b": "-", "c": "mfp"}
STAGED = {"color": pen.PURPLE, "linestyle": (0, (1, 1.2))}
OF_COEFFICIENTS = {
    "liang-as-published": ("regenerated, the paper's protocol, jointly", pen.AS_PUBLISHED),
    "liang-whole": ("regenerated, whole profile", pen.WHOLE),
}
RATIOS = (0.6, 1.4)  # shown of law over fitted point [-]


@styled
def coefficient_figure(letter: str, source: Source, out: Path, name: str = "") -> list[Path]:
    """Draw one coefficient against alpha [-], the end near 1 enlarged, and the laws over the fitted points below."""
    data = source.needed("liang-as-published")
    lines, column = _coefficient_laws(letter, source, data), COEFFICIENTS.index(letter)
    figure = canvas(6.4)
    axes = figure.subplots(2, 2, height_ratios=(1.6, 1.0), width_ratios=(1.5, 1.0))
    for place, (low, high) in enumerate(((0.0, 1.0), (0.9, 1.0))):
        top, bottom = axes[0, place], axes[1, place]
        alpha = np.linspace(max(low, 0.02), high, 500)

        def value(law: Any, alpha: Floats = alpha) -> Floats:
            return coefficients(law, alpha)[column]

        draw_curves(top, alpha, lines, value)
        points, errors = data.arrays["coefficients"][:, column], data.arrays["coefficient_errors"][:, column]
        top.errorbar(data.arrays["alpha"], points, errors, label="(7) fitted at one albedo, ± photon noise", **pen.DATA)
        _ratios(bottom, column, lines, data)
        for ax in (top, bottom):
            ax.set_xlim(low, high + 0.02 * (high - low))
        bottom.set_xlabel("single-scattering albedo α [-]")
        if place:  # scaled to what it shows
            shown = [value(law) for _, law, _, _ in lines]
            values = np.concatenate([*shown, points[data.arrays["alpha"] >= low]])
            margin = 0.08 * np.ptp(values)
            top.set_ylim(values.min() - margin, values.max() + margin)
            if letter == "b":
                top.set_ylim(0.7 * values.min(), 1.4 * values.max())
    axes[0, 0].set(ylabel=f"{letter} of (7) [{UNIT[letter]}]", title=f"{letter} by {EQUATION[letter]}, l = 1")
    axes[0, 1].set_title("the end near α = 1, enlarged")
    axes[1, 0].set_ylabel("law over fitted point [-]")
    if letter == "b":
        axes[0, 0].set(yscale="log", ylim=(5e-4, 1.0))
        axes[0, 1].set_yscale("log")
        plain_log(axes[0, 1].yaxis)
    if letter == "a":
        for ax in axes[0]:
            ax.axhline(0.0, color=pen.GREY, linestyle=":", label="a = 0: from here on (7) has no r$_{max}$")
    legend_below(figure, list(axes.flat))
    return save(figure, out, name or f"liang-{EQUATION[letter][1:-1]}-{letter}")


def _coefficient_laws(letter: str, source: Source, data: Fitted) -> list[pen.DrawnLaw]:
    equation = EQUATION[letter]
    printed, corrected = (source.printed("liang", which, data.law.setting) for which in ("published", "corrected"))
    lines = [pen.DrawnLaw(f"{equation} as printed", printed, pen.PUBLISHED)]
    if any(getattr(corrected, name) != getattr(printed, name) for name in CONSTANTS_OF[letter]):
        label = f"{equation} as printed but b0 = {corrected.constants()['b0']:g}"
        lines.append(pen.DrawnLaw(label, corrected, pen.CORRECTED))
    stage = data.content["stages"]["coefficient_laws"][letter]
    staged = data.law.with_vector(tuple(stage["constants"]), list(stage["constants"].values()))
    failed = "" if stage["result"] == "converged" else " (did not converge)"
    lines.append(pen.DrawnLaw(f"{equation} through the points{failed}", staged, STAGED))
    return [*lines, *_recorded(source, OF_COEFFICIENTS).values()]


def _ratios(ax: Axes, column: int, lines: list[pen.DrawnLaw], data: Fitted) -> None:
    alpha, points = data.arrays["alpha"], data.arrays["coefficients"][:, column]
    for label, law, style, _ in lines:
        ratio = coefficients(law, alpha)[column] / points
        ax.plot(alpha, ratio, marker=".", markersize=3, **style)
        if ratio.min() > RATIOS[1]:
            note = f"{label}: {ratio.min():.1f} to {ratio.max():.1f} times"
            ax.text(0.5, 0.95, note, color=style["color"], transform=ax.transAxes, ha="center", va="top", fontsize=8)
    sigma = np.abs(data.arrays["coefficient_errors"][:, column] / points)
    ax.errorbar(alpha, np.ones_like(alpha), sigma, **pen.DATA)
    ax.axhline(1.0, color=pen.BLACK, linewidth=0.8)
    ax.set_ylim(*RATIOS)


ROW, FEET = 0.21, 1.0  # height of a constant, and of axis and legend [inch]
LINEAR, TICKS = 0.1, (-10, -1, -0.1, 0, 0.1, 1, 10)  # share of a constant up to which the axis is linear
FAR = 3.0  # standard errors


@styled
def constants_figure(source: Source, out: Path, name: str = "constants") -> list[Path]:
    """Draw (published - regenerated) / |regenerated| [-] of every printed constant, ± its total error, and z."""
    rows = _printed_constants(source)
    figure = canvas(ROW * len(rows) + FEET, layout=ConstrainedLayoutEngine(w_pad=0.1))
    ax = figure.subplots()
    for place, (_, one) in enumerate(rows):
        scale, z = abs(one["regenerated"]), z_score(one)
        far = z is not None and abs(z) > FAR
        ax.errorbar(0.0, place, xerr=(total_error(one) or 0.0) / scale, color=pen.GREY, elinewidth=3.5, alpha=0.6)
        ax.plot(
            (one["published"] - one["regenerated"]) / scale, place, linestyle="none", markersize=4.5,
            marker="D" if far else "o", color=pen.VERMILION if far else pen.BLUE,
        )  # fmt: skip
        text = "held" if not one.get("free", True) else "–" if z is None else f"{z:+.1f}".replace("-", "−")
        ax.annotate(text, (1.01, place), xycoords=("axes fraction", "data"), va="center", fontsize=7.0)
    ax.axvline(0.0, color=pen.BLACK, linewidth=0.8)
    ax.set_xscale("symlog", linthresh=LINEAR)
    ax.set_xticks(TICKS, [f"{tick:+g}".replace("-", "−") if tick else "0" for tick in TICKS])
    ax.set_yticks(range(len(rows)), [label for label, _ in rows], fontsize=7.0)
    ax.set(ylim=(len(rows) - 0.4, -0.6), xlabel="(published − regenerated) / |regenerated| [-], linear within ±0.1")
    ax.annotate("z", (1.01, -0.9), xycoords=("axes fraction", "data"), va="bottom", annotation_clip=False)
    within = f"published, within {FAR:g} standard errors"
    handles = [
        Line2D([], [], color=pen.BLUE, marker="o", linestyle="none", label=within),
        Line2D([], [], color=pen.VERMILION, marker="D", linestyle="none", label="published, farther"),
        Line2D([], [], color=pen.GREY, linewidth=3.5, alpha=0.6, label=f"± {TOTAL}"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return save(figure, out, name)


def has_printed(source: Source) -> tuple[str, ...]:
    """Return records with a constant that was printed."""
    return tuple(dict.fromkeys(label.split(" ")[0] for label, _ in _printed_constants(source)))


def _printed_constants(source: Source) -> list[tuple[str, Content]]:
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


LAST_SHARE = 0.999  # as pipelines.inversion_error
OF_INVERSES = {
    "liang-inverse-as-published": ("(19) by the paper's protocol", pen.AS_PUBLISHED),
    "liang-inverse-whole": ("(19) regenerated, in shares of energy", pen.WHOLE),
}
DOUBTED = (0.4, 0.6)  # where the paper's authors find their inverse weakest
DOUBTED_BAND: Any = {"color": pen.BLACK, "alpha": 0.07, "linewidth": 0, "label": "α that the paper calls worst"}


@styled
def inverse_figure(source: Source, out: Path, name: str = "liang-19-inverse") -> list[Path]:
    """Draw r [mfp] against xi [-] at six albedos, and max |cdf(r(xi)) - xi| [-] against alpha [-]."""
    data = source.needed("liang-inverse-whole")
    figure = canvas(8.2)
    grid = figure.add_gridspec(3, 3, height_ratios=(1.0, 1.0, 1.1))
    axes = [figure.add_subplot(grid[i // 3, i % 3]) for i in range(6)]
    for i, (ax, share) in enumerate(zip(axes, PANELS, strict=True)):
        _inverse_panel(ax, source, data, round(share * (data.arrays["alpha"].size - 1)))
        if i % 3 == 0:
            ax.set_ylabel("radius |g(ξ)| [mfp]")
        if i >= 3:
            ax.set_xlabel("uniform number ξ [-]")
    wide = figure.add_subplot(grid[2, :])
    for record, (label, style) in OF_INVERSES.items():
        if record not in source.paths:
            continue
        content = source.content(record)
        quality = content["quality"]
        if record == "liang-inverse-whole" and (printed := _printed_inversion(source, record)):
            wide.plot(*printed, label="(19) as printed", marker=".", **pen.PUBLISHED)
        if converged(content):
            wide.plot(quality["alpha"], quality["regenerated"]["inversion_error"], label=label, marker=".", **style)
        else:
            wide.plot([], [], label=f"{label}: the fit failed", **style)
    wide.axvspan(*DOUBTED, **DOUBTED_BAND)
    albedo_axis(wide)
    wide.set_ylabel("max |cdf(r(ξ)) − ξ| [-]")
    wide.set_ylim(bottom=0.0)
    legend_below(figure, [*axes, wide])
    return save(figure, out, name)


def _inverse_panel(ax: Axes, source: Source, data: Fitted, row: int) -> None:
    alpha, setting = float(data.arrays["alpha"][row]), data.law.setting
    xi = np.concatenate([np.geomspace(1e-3, 0.05, 60), np.linspace(0.05, LAST_SHARE, 240)[1:]])
    r = np.geomspace(1e-4, 100.0 * float(exact.quantile(0.9, alpha, setting=setting)), 400)
    share = np.asarray(exact.cdf(r, alpha, setting=setting))
    ax.plot(share, r, color=pen.BLACK, linewidth=0.9, label="exact", zorder=3)
    printed = pen.DrawnLaw("(19) as printed", source.printed("liang", "published", setting), pen.PUBLISHED)
    curves = [printed, *_recorded(source, OF_INVERSES).values()]
    # |g(xi)| of (19), before the clip (21) at r_max
    draw_curves(ax, xi, curves, lambda law: np.maximum(np.abs(np.asarray(law.sampler.unclipped(xi, alpha))), 1e-9))
    if (whole := source.usable("liang-whole")) is not None:
        label = "r$_{max}$ where (21) clips, whole profile"
        ax.axhline(float(whole.law.largest_radius(alpha)), color=pen.GREY, linestyle=":", linewidth=1.2, label=label)
    # The tallied cdf at some ring edges, with the standard error of its sum.
    energy, error = data.arrays["energy"][row], data.arrays["energy_error"][row]
    total = energy.sum() + data.arrays["beyond"][row]
    tallied, sigma = (np.cumsum(energy) / total)[::6], (np.sqrt(np.cumsum(error**2)) / total)[::6]
    ax.errorbar(tallied, data.arrays["r_edges"][1::6], xerr=sigma, label=PHOTONS, **pen.DATA)
    ax.set(yscale="log", xlim=(0.0, 1.0), title=f"α = {alpha:.3f}")
    ax.set_ylim(0.3 * np.interp(0.02, share, r), 3.0 * np.interp(LAST_SHARE, share, r))


# Under each light the records that are drawn. The paper has one light only.
RECORDS = {
    "searchlight": ("liang-inverse-whole", "hazard", "quantile"),
    "diffuse light": ("hazard-diffuse", "quantile-diffuse"),
}
# Of each form: never distinguished by colour alone.
LOOKS: dict[str, tuple[str, Any]] = {
    "liang": ("(19)-(21) regenerated", {"color": pen.ORANGE, "marker": "s", "linestyle": "-"}),
    "quantile": ("rational in −ln(1 − ξ)", {"color": pen.BLUE, "marker": "o", "linestyle": "-"}),
    "hazard": ("escape hazard, its cdf inverted in one step", {"color": pen.PURPLE, "marker": "^", "linestyle": "-."}),
}
REQUIRED = 1e-3


@styled
def inversion_figure(source: Source, out: Path, name: str = "inversion-error") -> list[Path]:
    """Draw max |cdf(g(xi)) - xi| [-], xi in [0, 0.999], against alpha [-]: the paper's inverse and others, by light."""
    figure = canvas(4.6)
    axes = list(figure.subplots(1, 2, sharey=True))
    for ax, (light, names) in zip(axes, RECORDS.items(), strict=True):
        for record in names:
            draw_inversion(ax, source, record)
        ax.axhline(REQUIRED, color=pen.BLACK, linewidth=0.8, linestyle=":", label="one in a thousand")
        albedo_axis(ax)
        ax.set(yscale="log", title=light)
        plain_log(ax.yaxis)
    axes[0].axvspan(*DOUBTED, **DOUBTED_BAND)
    axes[0].set_ylabel("max |cdf(g(ξ)) − ξ| [-]")
    if caption := inversion_caption(source):
        figure.suptitle(caption, fontsize=9.0)
    legend_below(figure, axes)
    return save(figure, out, name)


def draw_inversion(ax: Axes, source: Source, record: str) -> None:
    """Draw the error of a record's inverse cdf over alpha, beside the printed constants."""
    fitted = source.usable(record)
    if fitted is None:
        return
    if printed := _printed_inversion(source, record):
        ax.plot(*printed, label="(19)-(21) as printed", marker="x", markersize=3.5, **pen.PUBLISHED)
    label, look = LOOKS[fitted.content["law"]]
    ax.plot(*inversion_points(fitted), label=label, markersize=3.5, **look)


def inversion_points(fitted: Fitted) -> Points:
    """Return alpha and the error of the regenerated law: as its record says, or measured now."""
    quality = fitted.content["quality"]
    alpha, known = np.asarray(quality["alpha"], float), quality["regenerated"].get("inversion_error")
    return alpha, inversion_error(fitted.law, alpha) if known is None else np.asarray(known, float)


def _printed_inversion(source: Source, record: str) -> Points | None:
    """Return alpha and the error of the printed constants, where the record has judged them."""
    quality = source.content(record)["quality"]
    error = quality.get("published", {}).get("inversion_error")
    return None if error is None else (np.asarray(quality["alpha"], float), np.asarray(error, float))


def inversion_caption(source: Source) -> str:
    """Return how bad the printed inverse is where its authors doubt it, and on either side of that."""
    name = "liang-inverse-whole"
    printed = _printed_inversion(source, name) if name in source.paths else None
    if printed is None:
        return ""
    alpha, error = printed
    low, high = DOUBTED
    inside = (alpha >= low) & (alpha <= high)
    said = []
    for where in (alpha < low, alpha > high):
        if np.any(where):
            worst = np.argmax(np.where(where, error, -np.inf))
            said.append(f"{error[worst]:.2g} at α = {alpha[worst]:.2g}")
    doubted = f"up to {error[inside].max():.2g}" if np.any(inside) else "nothing was measured"
    printed_as = f"(19)-(21) as printed: {doubted} for α in [{low:g}, {high:g}]"
    return f"{printed_as}, which the paper calls worst; {', '.join(said)}"

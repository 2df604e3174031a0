"""Equation (7) redone: r R_d against r at six albedos, and how far the normalised law is from the exact profile."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from mcml_sim import exact
from profilefit.fitting.discrepancy import LawWithErrors
from profilefit.fitting.discrepancy import profile as profile_with_errors
from profilefit.report.figures.canvas import (
    AS_PUBLISHED,
    BLACK,
    CORRECTED,
    DATA,
    GREY,
    PUBLISHED,
    TRUTH_BAND,
    WHOLE,
    DrawnLaw,
    band_under,
    canvas,
    draw_curves,
    legend_below,
    save,
    styled,
)
from profilefit.report.records import Fitted, Source, exact_profile, unscaled

Floats = NDArray[np.float64]
PANELS = (0.0, 0.25, 0.5, 0.75, 0.9, 1.0)  # of a record's albedos, in order: more of them near alpha = 1
RINGS_SHOWN = 26
NEAREST = 0.01  # [mfp], as in quality.NEAREST
ENERGY_WITHIN = 0.995  # as in quality.ENERGY_WITHIN: where `rel` stops looking
LABELS = {
    "published": "(7) as printed",
    "corrected": "(7) as printed but b0 = 0.0641",
    "liang-as-published": "(7) regenerated, the paper's protocol",
    "liang-whole": "(7) regenerated, whole profile",
}
STYLES = {"published": PUBLISHED, "corrected": CORRECTED, "liang-as-published": AS_PUBLISHED, "liang-whole": WHOLE}


@styled
def profile_figure(source: Source, out: Path, name: str = "liang-7-profile") -> list[Path]:
    """Draw r R_d [1/mfp] against r [mfp], on a logarithmic scale that shows the tail, before the correction (18)."""
    data = source.needed("liang-as-published")
    figure = canvas(6.6)
    axes = list(figure.subplots(2, 3).flat)
    laws = _laws(source, data)
    for ax, row in zip(axes, _rows(data), strict=True):
        _profile_panel(ax, data, row, laws)
    _outer_labels(axes, "r [mfp]", "r R$_d$ [1/mfp]")
    legend_below(figure, axes)
    return save(figure, out, name)


@styled
def error_figure(source: Source, out: Path, name: str = "liang-7-error") -> list[Path]:
    """Draw R_d after the correction (18) over the exact one, less 1 [-], and the tallied rings with their noise."""
    data = source.needed("liang-whole")
    figure = canvas(6.4)
    axes = list(figure.subplots(2, 3, sharey=True).flat)
    laws = _laws(source, data)
    for ax, row in zip(axes, _rows(data), strict=True):
        _error_panel(ax, data, row, laws)
    _outer_labels(axes, "r [mfp]", "R$_d$ over exact R$_d$, less 1 [-]")
    legend_below(figure, axes)
    return save(figure, out, name)


def _laws(source: Source, data: Fitted) -> dict[str, DrawnLaw]:
    """Return printed laws, and records with their bands, by name."""
    law, setting = data.content["law"], data.law.setting
    printed = ("published", "corrected")
    laws = {name: DrawnLaw(LABELS[name], source.printed(law, name, setting), STYLES[name]) for name in printed}
    for name in ("liang-as-published", "liang-whole"):
        if (fitted := source.usable(name)) is not None:
            laws[name] = DrawnLaw(LABELS[name], fitted.law, STYLES[name], fitted)
    return laws


def _rows(data: Fitted) -> list[int]:
    return [round(share * (data.arrays["alpha"].size - 1)) for share in PANELS]


def _profile_panel(ax: Axes, data: Fitted, row: int, laws: dict[str, DrawnLaw]) -> None:
    alpha = float(data.arrays["alpha"][row])
    cut = float(data.arrays["r_trim"][row])
    radii = {name: float(one.law.largest_radius(alpha)) for name, one in laws.items() if name != "published"}
    radii = {name: radius for name, radius in radii.items() if radius > 0}  # a > 0 has none
    end = 1.25 * max(cut, *radii.values())
    r_exact, profile = exact_profile(alpha, data.law.setting, NEAREST, end)
    source_limit = alpha / (4 * np.pi)
    r = np.linspace(0.0, end, 600)
    draw_curves(ax, r, laws.values(), lambda law: np.maximum(unscaled(law, r, alpha), 1e-12))
    ax.plot(r_exact, r_exact * profile, color=BLACK, linewidth=0.9, label="exact", zorder=3)
    _rings(ax, data, row, end)
    at_foot: dict[str, Any] = {"transform": ax.get_xaxis_transform(), "clip_on": False, "zorder": 5}
    for name, radius in radii.items():
        ax.plot([radius], [0.0], marker="v", color=STYLES[name]["color"], linestyle="none", **at_foot)
    ax.axvline(cut, color=GREY, linestyle=":", linewidth=1.2, label="r'$_{max}$: where (6) trims")
    ax.plot([], [], marker="v", linestyle="none", color=GREY, label="r$_{max}$ = −b/a: where (7) ends")
    ax.set(yscale="log", xlim=(0.0, end), ylim=(source_limit * 2e-4, source_limit * 15))
    ax.set_title(f"α = {alpha:.3f}")


def _error_panel(ax: Axes, data: Fitted, row: int, laws: dict[str, DrawnLaw]) -> None:
    alpha, setting = float(data.arrays["alpha"][row]), data.law.setting
    outer = exact.quantile(ENERGY_WITHIN, alpha, setting=setting)
    r, truth = exact_profile(alpha, setting, NEAREST, 3.0 * float(outer))
    for one in laws.values():
        band = _truth_band(one.fitted, r, alpha)
        if band is not None:
            band_under(ax, r, (band[0] / truth - 1.0, band[1] / truth - 1.0), one.style["color"], TRUTH_BAND)
        ax.plot(r, one.law.profile(r, alpha) / truth - 1.0, label=one.label, **one.style)
    edges = data.arrays["r_edges"]
    expected = np.diff(exact.cdf(edges, alpha, setting=setting)) * exact.reflectance(alpha, setting=setting)
    energy, error = data.arrays["energy"][row], data.arrays["energy_error"][row]
    middle = np.sqrt(np.maximum(edges[1:], NEAREST / 10) * np.maximum(edges[:-1], NEAREST / 10))
    shown = (energy > 0) & (edges[1:] < r[-1]) & (edges[:-1] > 0)
    ratio = energy / np.maximum(expected, 1e-300)
    ax.errorbar(
        middle[shown], ratio[shown] - 1, error[shown] / expected[shown], label="photons, ± 1 standard error", **DATA
    )
    ax.axhline(0.0, color=BLACK, linewidth=0.8)
    ax.axvspan(float(outer), r[-1], color=GREY, alpha=0.15, linewidth=0, label="the last 0.5 % of the energy")
    ax.set(xscale="log", xlim=(NEAREST, r[-1]), ylim=(-1.05, 1.05), title=f"α = {alpha:.3f}")


def _truth_band(fitted: Fitted | None, r: Floats, alpha: float) -> tuple[Floats, Floats] | None:
    """Return the band in which a fitted law states the exact profile to lie; None for printed laws and old records."""
    if fitted is None:
        return None
    known = LawWithErrors.of_record(fitted.law, fitted.content, fitted.arrays)
    return None if known.discrepancy is None else profile_with_errors(known, r, alpha).interval()


def _rings(ax: Axes, data: Fitted, row: int, end: float) -> None:
    """Draw some of the rings, with the photons' standard error: even in r would crowd the start with none to see."""
    edges, energy, error = (data.arrays[key] for key in ("r_edges", "energy", "energy_error"))
    r = 0.5 * (edges[1:] + edges[:-1])
    places = np.linspace(0.0, min(end, r[-1]), RINGS_SHOWN)
    index = np.unique(np.searchsorted(r, places).clip(max=r.size - 1))
    index = index[energy[row][index] > 0]
    to_profile = 1.0 / (2 * np.pi * np.diff(edges))[index]  # E = 2 pi r R_d dr
    value, sigma = energy[row][index] * to_profile, error[row][index] * to_profile
    ax.errorbar(r[index], value, sigma, label="photons, ± 1 standard error", **DATA)


def _outer_labels(axes: list[Axes], x: str, y: str) -> None:
    for ax in axes[3:]:
        ax.set_xlabel(x)
    for ax in axes[::3]:
        ax.set_ylabel(y)

"""Equations (19)-(21) redone: the radius that a uniform number draws, and how wrong it is over the albedos."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from mcml_sim import exact
from profilefit.report.figures.canvas import (
    AS_PUBLISHED,
    BLACK,
    DATA,
    GREY,
    PUBLISHED,
    WHOLE,
    albedo_axis,
    band_under,
    canvas,
    legend_below,
    save,
    styled,
)
from profilefit.report.figures.profile_figures import PANELS
from profilefit.report.records import Fitted, Source, converged

Floats = NDArray[np.float64]
LAST_SHARE = 0.999  # as pipelines.inversion_error
LABELS = {
    "liang-inverse-as-published": ("(19) by the paper's protocol", AS_PUBLISHED),
    "liang-inverse-whole": ("(19) regenerated, in shares of energy", WHOLE),
}


@styled
def inverse_figure(source: Source, out: Path, name: str = "liang-19-inverse") -> list[Path]:
    """r [mfp] against xi [-] at six albedos; max |cdf(r(xi)) - xi| [-] against alpha [-] for each set of constants."""
    data = source.needed("liang-inverse-whole")
    figure = canvas(8.2)
    grid = figure.add_gridspec(3, 3, height_ratios=(1.0, 1.0, 1.1))
    axes = [figure.add_subplot(grid[i // 3, i % 3]) for i in range(6)]
    alphas = data.arrays["alpha"]
    for i, (ax, share) in enumerate(zip(axes, PANELS, strict=True)):
        _panel(ax, source, data, round(share * (alphas.size - 1)))
        if i % 3 == 0:
            ax.set_ylabel("radius |g(ξ)| [mfp]")
        if i >= 3:
            ax.set_xlabel("uniform number ξ [-]")
    wide = figure.add_subplot(grid[2, :])
    _errors(wide, source)
    legend_below(figure, [*axes, wide])
    return save(figure, out, name)


def _panel(ax: Axes, source: Source, data: Fitted, row: int) -> None:
    alpha, setting = float(data.arrays["alpha"][row]), data.law.setting
    xi = np.concatenate([np.geomspace(1e-3, 0.05, 60), np.linspace(0.05, LAST_SHARE, 240)[1:]])
    r = np.geomspace(1e-4, 100.0 * float(exact.quantile(0.9, alpha, setting=setting)), 400)
    share = np.asarray(exact.cdf(r, alpha, setting=setting))
    ax.plot(share, r, color=BLACK, linewidth=0.9, label="exact", zorder=3)
    printed = source.printed("liang", "published", setting)
    ax.plot(xi, _radius(printed, xi, alpha), label="(19) as printed", **PUBLISHED)
    for name, (label, style) in LABELS.items():
        fitted = source.usable(name)
        if fitted is None:
            continue
        band_under(ax, xi, fitted.band(lambda law: _radius(law, xi, alpha)), style["color"])
        ax.plot(xi, _radius(fitted.law, xi, alpha), label=label, **style)
    whole = source.usable("liang-whole")
    if whole is not None:
        label = "r$_{max}$ where (21) clips, whole profile"
        ax.axhline(float(whole.law.largest_radius(alpha)), color=GREY, linestyle=":", linewidth=1.2, label=label)
    _rings(ax, data, row)
    ax.set(yscale="log", xlim=(0.0, 1.0), title=f"α = {alpha:.3f}")
    ax.set_ylim(0.3 * np.interp(0.02, share, r), 3.0 * np.interp(LAST_SHARE, share, r))


def _errors(ax: Axes, source: Source) -> None:
    for name, (label, style) in LABELS.items():
        if name not in source.paths:
            continue
        content = source.content(name)
        quality = content["quality"]
        alpha = quality["alpha"]
        if name == "liang-inverse-whole":
            ax.plot(alpha, quality["published"]["inversion_error"], label="(19) as printed", marker=".", **PUBLISHED)
        if converged(content):
            ax.plot(alpha, quality["regenerated"]["inversion_error"], label=label, marker=".", **style)
        else:
            ax.plot([], [], label=f"{label}: the fit failed", **style)
    ax.axvspan(0.4, 0.6, color=BLACK, alpha=0.07, linewidth=0, label="α that the paper calls worst")
    albedo_axis(ax)
    ax.set_ylabel("max |cdf(r(ξ)) − ξ| [-]")
    ax.set_ylim(bottom=0.0)


def _radius(law: Any, xi: Floats, alpha: float) -> Floats:
    """|g(xi)| [mfp] of (19), before the clip (21) at r_max."""
    return np.maximum(np.abs(np.asarray(law.sampler.unclipped(xi, alpha))), 1e-9)


def _rings(ax: Axes, data: Fitted, row: int) -> None:
    """The tallied cdf at some ring edges, with the standard error of its sum."""
    energy, error = data.arrays["energy"][row], data.arrays["energy_error"][row]
    total = energy.sum() + data.arrays["beyond"][row]
    share, sigma = np.cumsum(energy) / total, np.sqrt(np.cumsum(error**2)) / total
    some = slice(None, None, 6)
    ax.errorbar(
        share[some], data.arrays["r_edges"][1:][some], xerr=sigma[some], label="photons, ± 1 standard error", **DATA
    )

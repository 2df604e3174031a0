"""Equations (19)-(21) redone: the radius that a uniform number draws, and how wrong it is over the albedos.

How far each inverse cdf is from the exact one, over the albedos, is one error for every form and both lights.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from mcml_sim import exact
from profilefit.recipes.pipelines import inversion_error
from profilefit.report.figures.canvas import (
    AS_PUBLISHED,
    BLACK,
    BLUE,
    DATA,
    GREY,
    ORANGE,
    PUBLISHED,
    PURPLE,
    WHOLE,
    DrawnLaw,
    albedo_axis,
    canvas,
    draw_curves,
    legend_below,
    plain_log,
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
    """Draw r [mfp] against xi [-] at six albedos, and max |cdf(r(xi)) - xi| [-] against alpha [-]."""
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
    curves = [DrawnLaw("(19) as printed", source.printed("liang", "published", setting), PUBLISHED)]
    for name, (label, style) in LABELS.items():
        if (fitted := source.usable(name)) is not None:
            curves.append(DrawnLaw(label, fitted.law, style, fitted))
    draw_curves(ax, xi, curves, lambda law: _radius(law, xi, alpha))
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
    """Return |g(xi)| [mfp] of (19), before the clip (21) at r_max."""
    return np.maximum(np.abs(np.asarray(law.sampler.unclipped(xi, alpha))), 1e-9)


def _rings(ax: Axes, data: Fitted, row: int) -> None:
    """Draw the tallied cdf at some ring edges, with the standard error of its sum."""
    energy, error = data.arrays["energy"][row], data.arrays["energy_error"][row]
    total = energy.sum() + data.arrays["beyond"][row]
    share, sigma = np.cumsum(energy) / total, np.sqrt(np.cumsum(error**2)) / total
    some = slice(None, None, 6)
    ax.errorbar(
        share[some], data.arrays["r_edges"][1:][some], xerr=sigma[some], label="photons, ± 1 standard error", **DATA
    )


Points = tuple[Floats, Floats]
# Under each light the records that are drawn. The paper has one light only.
RECORDS = {
    "searchlight": ("liang-inverse-whole", "hazard", "quantile"),
    "diffuse light": ("hazard-diffuse", "quantile-diffuse"),
}
# Of each form: never distinguished by colour alone.
LOOKS: dict[str, tuple[str, Any]] = {
    "liang": ("(19)-(21) regenerated", {"color": ORANGE, "marker": "s", "linestyle": "-"}),
    "quantile": ("rational in −ln(1 − ξ)", {"color": BLUE, "marker": "o", "linestyle": "-"}),
    "hazard": ("escape hazard, its cdf inverted in one step", {"color": PURPLE, "marker": "^", "linestyle": "-."}),
}
DOUBTED = (0.4, 0.6)  # where the paper's authors find their inverse weakest
REQUIRED = 1e-3


@styled
def inversion_figure(source: Source, out: Path, name: str = "inversion-error") -> list[Path]:
    """Draw max |cdf(g(xi)) - xi| [-], xi in [0, 0.999], against alpha [-]: the paper's inverse and others, by light."""
    figure = canvas(4.6)
    axes = list(figure.subplots(1, 2, sharey=True))
    for ax, (light, records) in zip(axes, RECORDS.items(), strict=True):
        for record in records:
            draw(ax, source, record)
        ax.axhline(REQUIRED, color=BLACK, linewidth=0.8, linestyle=":", label="one in a thousand")
        albedo_axis(ax)
        ax.set(yscale="log", title=light)
        plain_log(ax.yaxis)
    axes[0].axvspan(*DOUBTED, color=BLACK, alpha=0.07, linewidth=0, label="α that the paper calls worst")
    axes[0].set_ylabel("max |cdf(g(ξ)) − ξ| [-]")
    if caption := caption_of(source):
        figure.suptitle(caption, fontsize=9.0)
    legend_below(figure, axes)
    return save(figure, out, name)


def draw(ax: Axes, source: Source, record: str) -> None:
    """Draw the error of a record's inverse cdf over alpha, beside the printed constants."""
    fitted = source.usable(record)
    if fitted is None:
        return
    if printed := _printed(source, record):
        ax.plot(*printed, label="(19)-(21) as printed", marker="x", markersize=3.5, **PUBLISHED)
    label, look = LOOKS[fitted.content["law"]]
    ax.plot(*points_of(fitted), label=label, markersize=3.5, **look)


def points_of(fitted: Fitted) -> Points:
    """Return alpha and the error of the regenerated law: as its record says, or measured now."""
    quality = fitted.content["quality"]
    alpha = np.asarray(quality["alpha"], float)
    if "inversion_error" in quality["regenerated"]:
        return alpha, np.asarray(quality["regenerated"]["inversion_error"], float)
    return alpha, inversion_error(fitted.law, alpha)


def _printed(source: Source, record: str) -> Points | None:
    """Return alpha and the error of the printed constants, where the record has judged them."""
    quality = source.content(record)["quality"]
    error = quality.get("published", {}).get("inversion_error")
    return None if error is None else (np.asarray(quality["alpha"], float), np.asarray(error, float))


def caption_of(source: Source) -> str:
    """Return how bad the printed inverse is where its authors doubt it, and on either side of that."""
    name = "liang-inverse-whole"
    printed = _printed(source, name) if name in source.paths else None
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
    return (
        f"(19)-(21) as printed: {doubted} for α in [{low:g}, {high:g}], which the paper calls worst; {', '.join(said)}"
    )

"""Equation (8) redone: the map from A to alpha, its error, and where it folds back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from mcml_sim import exact
from profilefit.recipes import catalogue
from profilefit.recipes.recipe import Albedos
from profilefit.recipes.targets import albedo_values
from profilefit.report.figures.canvas import (
    BLACK,
    DATA,
    GREEN,
    PUBLISHED,
    WHOLE,
    DrawnLaw,
    canvas,
    draw_curves,
    legend_below,
    plain_log,
    save,
    styled,
)
from profilefit.report.records import Fitted, Source

Floats = NDArray[np.float64]
Points = tuple[Floats, Floats, Floats]


@styled
def albedo_figure(source: Source, out: Path, name: str = "liang-8-albedo") -> list[Path]:
    """Draw alpha [-] against A [-]; its error [-]; and sqrt(1 - alpha) over the exact one [-]: how far light goes."""
    data = source.needed("albedo-liang")
    curves = _curves(source, data)
    figure = canvas(6.4)
    panels = figure.subplot_mosaic([["map", "error"], ["fold", "ratio"]])
    # Even in sqrt(1 - alpha): A is linear in it near A = 1, where all the trouble is.
    alpha = 1.0 - np.linspace(1.0, 1e-3, 500) ** 2
    reflectance = np.asarray(exact.reflectance(alpha, setting=data.law.setting))
    points, exact_map = _points(data), (reflectance, alpha)
    _map(panels["map"], points, curves, exact_map)
    _map(panels["fold"], points, curves, exact_map)
    panels["map"].set(xlim=(0, 1), ylim=(0, 1.02), title="the whole map")
    panels["fold"].set(xlim=(0.7, 1.0), ylim=(0.97, 1.002), title="its end, enlarged")
    _errors(panels["error"], panels["ratio"], points, curves, exact_map)
    _folds(panels, curves)
    for ax in panels.values():
        ax.set_xlabel("total reflectance A [-]")
    legend_below(figure, list(panels.values()))
    return save(figure, out, name)


def _curves(source: Source, data: Fitted) -> list[DrawnLaw]:
    setting = data.law.setting
    printed = catalogue.albedo_law("liang", "published", setting, source.folder)
    curves = [DrawnLaw("(8) as printed", printed, PUBLISHED)]
    if data.converged:
        curves.append(DrawnLaw("(8) regenerated", data.law, WHOLE, data))
    rational = source.usable("albedo-rational")
    if rational is not None:
        curves.append(DrawnLaw("rational in √(1 − α)", rational.law, {"color": GREEN, "linestyle": "-."}, rational))
    return curves


def _points(data: Fitted) -> Points:
    """Return alpha, A and the standard error of A [-] of the fitted points."""
    at = data.arrays.get("alpha")
    alpha = albedo_values(Albedos(**data.content["protocol"]["albedos"])) if at is None else at
    return alpha, data.arrays["reflectance"], data.arrays["reflectance_error"]


def _map(ax: Axes, points: Points, curves: list[DrawnLaw], exact_map: tuple[Floats, Floats]) -> None:
    even = np.linspace(0.0, 1.0, 1001)
    ax.plot(*exact_map, color=BLACK, linewidth=0.9, label="exact", zorder=3)
    draw_curves(ax, even, curves, lambda law: law.alpha(even))
    alpha, measured, error = points
    ax.errorbar(measured, alpha, xerr=error, label="photons, ± 1 standard error", **DATA)
    ax.set_ylabel("single-scattering albedo α [-]")


def _errors(error: Axes, ratio: Axes, points: Points, curves: list[DrawnLaw], exact_map: tuple[Floats, Floats]) -> None:
    reflectance, alpha = exact_map
    s = np.sqrt(1.0 - alpha)
    draw_curves(error, reflectance, curves, lambda law: law.alpha(reflectance) - alpha)
    for one in curves:
        mapped = one.law.alpha(reflectance)
        inside = mapped < 1.0
        ratio.plot(reflectance[inside], np.sqrt(1.0 - mapped[inside]) / s[inside], label=one.label, **one.style)
    true_alpha, measured, sigma = points
    slope = np.interp(measured, reflectance, np.gradient(alpha, reflectance))
    error.errorbar(measured, true_alpha - np.interp(measured, reflectance, alpha), sigma * slope, **DATA)
    for ax, level in ((error, 0.0), (ratio, 1.0)):
        ax.axhline(level, color=BLACK, linewidth=0.8)
    error.set(xlim=(0, 1), ylabel="α less exact α [-]", title="error in α")
    ratio.set(xlim=(0.5, 1), ylim=(0.4, 100), yscale="log", title="error in √(1 − α), the root of the absorbed share")
    ratio.set_ylabel("√(1 − α) over exact √(1 − α) [-]")
    plain_log(ratio.yaxis)


def _folds(panels: dict[str, Axes], curves: list[DrawnLaw]) -> None:
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

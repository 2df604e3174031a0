"""Equation (8) redone: the map from A to alpha, its error, and where it folds back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from mcml_sim import exact
from profilefit import catalogue
from profilefit.calibrate import albedo_values
from profilefit.recipe import Albedos
from profilefit.report.canvas import BLACK, DATA, GREEN, GREY, PUBLISHED, WHOLE, canvas, legend_below, save, styled
from profilefit.report.source import Fitted, Source

Floats = NDArray[np.float64]
Curve = tuple[str, Any, dict[str, Any], Fitted | None]


@styled
def albedo_figure(source: Source, out: Path, name: str = "liang-8-albedo") -> list[Path]:
    """alpha [-] against A [-]; the error in alpha; sqrt(1 - alpha) over the exact one, which sets how far light goes."""
    data = source.fitted("albedo-liang")
    assert data is not None  # `figures` draws only what its records are there for
    curves = _curves(source, data)
    figure = canvas(6.4)
    panels = figure.subplot_mosaic([["map", "error"], ["fold", "ratio"]])
    # Even in sqrt(1 - alpha): A is linear in it near A = 1, where all the trouble is.
    alpha = 1.0 - np.linspace(1.0, 1e-3, 1200) ** 2
    reflectance = np.asarray(exact.reflectance(alpha, setting=data.law.setting))
    _map(panels["map"], data, curves, alpha, reflectance)
    _map(panels["fold"], data, curves, alpha, reflectance)
    panels["map"].set(xlim=(0, 1), ylim=(0, 1.02), title="the whole map")
    panels["fold"].set(xlim=(0.7, 1.0), ylim=(0.97, 1.002), title="its end, enlarged")
    _errors(panels["error"], panels["ratio"], curves, alpha, reflectance)
    _folds(panels, curves)
    for ax in panels.values():
        ax.set_xlabel("total reflectance A [-]")
    legend_below(figure, list(panels.values()))
    return save(figure, out, name)


def _curves(source: Source, data: Fitted) -> list[Curve]:
    setting = data.law.setting
    printed = catalogue.albedo_law("liang", "published", setting, source.folder)
    found: list[Curve] = [("(8) as printed", printed, dict(PUBLISHED), None)]
    if data.converged:
        found.append(("(8) regenerated", data.law, dict(WHOLE), data))
    rational = source.usable("albedo-rational")
    if rational is not None:
        found.append(("rational in √(1 − α)", rational.law, {"color": GREEN, "linestyle": "-."}, rational))
    return found


def _map(ax: Axes, data: Fitted, curves: list[Curve], alpha: Floats, reflectance: Floats) -> None:
    even = np.linspace(0.0, 1.0, 2001)
    ax.plot(reflectance, alpha, color=BLACK, linewidth=0.9, label="exact", zorder=3)
    for label, law, style, fitted in curves:
        band = fitted.band(lambda law: law.alpha(even)) if fitted else None
        if band is not None:
            note = "95 % of posterior draws, misfit as noise"
            ax.fill_between(even, *band, color=style["color"], alpha=0.25, linewidth=0, label=note)
        ax.plot(even, law.alpha(even), label=label, **style)
    measured = data.arrays["reflectance"]
    at = data.arrays.get("alpha", albedo_values(Albedos(**data.content["protocol"]["albedos"])))
    error = data.arrays["reflectance_error"]
    ax.errorbar(measured, at, xerr=error, label="photons, ± 1 standard error", **DATA)
    ax.set_ylabel("single-scattering albedo α [-]")


def _errors(error: Axes, ratio: Axes, curves: list[Curve], alpha: Floats, reflectance: Floats) -> None:
    s = np.sqrt(1.0 - alpha)
    for label, law, style, fitted in curves:
        mapped = law.alpha(reflectance)
        error.plot(reflectance, mapped - alpha, label=label, **style)
        band = fitted.band(lambda law: law.alpha(reflectance) - alpha) if fitted else None
        if band is not None:
            error.fill_between(reflectance, *band, color=style["color"], alpha=0.25, linewidth=0)
        inside = mapped < 1.0
        ratio.plot(reflectance[inside], (np.sqrt(1.0 - np.where(inside, mapped, 0.0)) / s)[inside], label=label, **style)
    for ax, level in ((error, 0.0), (ratio, 1.0)):
        ax.axhline(level, color=BLACK, linewidth=0.8)
        ax.set_xlim(0, 1)
    error.set(ylabel="error in α [-]", title="law less exact")
    ratio.set(ylabel="√(1 − α) over exact √(1 − α) [-]", title="how far light goes, wrong by this factor", yscale="log")
    ratio.set_ylim(0.3, 100)


def _folds(panels: dict[str, Axes], curves: list[Curve]) -> None:
    """Where a map falls again, two reflectances share one albedo."""
    for _, law, style, _ in curves:
        fold = getattr(law, "fold", 1.0)
        if fold >= 1.0:
            continue
        for ax in panels.values():
            ax.axvline(fold, color=style["color"], linewidth=0.8, linestyle=":")
        top = float(law.alpha(fold))
        panels["fold"].annotate(
            f"turns at A = {fold:.4f}", (fold, top), (0.705, top - 0.0035 if top > 0.996 else top + 0.001),
            color=style["color"], fontsize=8, arrowprops={"arrowstyle": "->", "color": GREY, "linewidth": 0.7},
        )  # fmt: skip

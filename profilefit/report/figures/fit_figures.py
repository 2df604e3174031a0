"""Figures of one's own data: the fit of a profile and its posterior, a photographed spot and the fit of its rings."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.patches import Circle
from matplotlib.ticker import MaxNLocator, ScalarFormatter

from profilefit.measured.model import unit_of
from profilefit.measured.photo.workflow import Photo
from profilefit.measured.result import MediumPosterior
from profilefit.report.figures import canvas as pen
from profilefit.report.figures.canvas import canvas, legend_below, save, styled
from profilefit.report.figures.record_figures import corner_grid, mark

BINS = 24
ENDS = 1.15  # how far axes go beyond the data
CURVE = 64  # radii of the fitted line
SYMBOLS = {"alpha": "α", "mu_s'": "µs′", "mu_a": "µa"}
LABEL_DISTANCE = 0.3  # of an axis name, in panels


@styled
def residual_figure(result: MediumPosterior, out: Path, name: str = "fit-residuals") -> list[Path]:
    """Draw reflectance per area with the fitted law, over r [unit]; under it the residuals in standard errors."""
    fit, data = result.fit, result.fit.data
    figure = canvas(5.6)
    top, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    unit = data.unit or "unit of r"
    r, half = data.r, 0.5 * (data.outer - data.inner)
    line = np.geomspace(r[0] / ENDS, r[-1] * ENDS, CURVE)
    inner, outer = (line * 0.999, line * 1.001) if data.rings else (line, line)
    light = fit.problem.model.linearised(fit.point, inner, outer)[0][:-1]
    top.plot(line, light, label="fitted law", **pen.WHOLE)
    seen = data.value > 0
    top.errorbar(
        r[seen], data.value[seen], yerr=fit.sigma[seen], xerr=half[seen] if data.rings else None,
        label="data, one standard error" + (", width of the annulus" if data.rings else ""), **pen.DATA,
    )  # fmt: skip
    top.set(xscale="log", yscale="log", ylabel=f"reflected light per area [1/{unit}²]")
    residual = (data.value - fit.light) / fit.sigma
    below.axhspan(-2, 2, color=pen.GREY, alpha=0.12, linewidth=0)
    below.axhspan(-1, 1, color=pen.GREY, alpha=0.22, linewidth=0, label="one and two standard errors")
    below.axhline(0.0, color=pen.BLUE, linewidth=1.0)
    below.plot(r, residual, color=pen.BLACK, marker="o", markersize=3.0, linewidth=0.6)
    if fit.rel is not None and result.identifiability is not None:
        model = fit.problem.noise.model  # of exact light there is none
        band = np.sqrt(0.0 if model is None else np.diag(model)) / fit.sigma
        below.plot(r, band, color=pen.VERMILION, linestyle="--", linewidth=0.9, label="model error")
        below.plot(r, -band, color=pen.VERMILION, linestyle="--", linewidth=0.9)
    span = max(3.0, 1.15 * float(np.max(np.abs(residual))))
    below.set(xlabel=f"r [{unit}]", ylabel="(data − law) / σ [-]", ylim=(-span, span))
    legend_below(figure, [top, below])
    return save(figure, out, name)


@styled
def posterior_figure(result: MediumPosterior, out: Path, name: str = "fit-corner") -> list[Path]:
    """Draw the posterior draws of what was fitted, in pairs and alone, and the best fit; nothing without a chain."""
    if result.walk is None or not result.moving:
        return []
    free = result.fit.spec.free  # no two that say the same, where one coordinate alone was free
    names: list[str] = [name for name in ("A", "l", "mu_s'", "mu_a", "scale") if name in result.moving]
    names = names if len(free) != 1 else [("alpha", "l", "scale")[free[0]]]
    samples = np.column_stack([result.draws[one] for one in names])
    size = len(names)
    figure = canvas(2.0 + 1.5 * size, width=2.0 + 1.5 * size, layout="none")
    grid = corner_grid(figure, samples, BINS)
    for row in range(size):
        for column in range(row + 1):
            ax = grid[row, column]  # few numbers, none with an offset that the reader must add
            ax.grid(False)
            for axis in (ax.xaxis, ax.yaxis)[: 1 + (column < row)]:
                axis.set_major_locator(MaxNLocator(3, prune="both"))
                axis.set_major_formatter(ScalarFormatter(useOffset=False))
            for text in ax.get_xticklabels():
                text.set_rotation(45)
            ax.tick_params(labelsize=7, length=2, pad=2)
            if 0 < column != row:
                ax.set_yticklabels([])
            if row < size - 1:
                ax.set_xticklabels([])
    for at, one in enumerate(names):
        if (best := result.value(one)) is not None:
            mark(grid, at, best, color=pen.BLACK)
        unit = unit_of(one, result.fit.data.unit)
        label = f"{SYMBOLS.get(one, one)} [{unit or '-'}]"
        grid[size - 1, at].set_xlabel(label)
        grid[size - 1, at].xaxis.set_label_coords(0.5, -LABEL_DISTANCE)
        if at:
            grid[at, 0].set_ylabel(label)
            grid[at, 0].yaxis.set_label_coords(-LABEL_DISTANCE, 0.5)
    figure.subplots_adjust(left=0.14, right=0.98, bottom=0.12, top=0.94, wspace=0.08, hspace=0.08)
    figure.suptitle("39 % and 86 % of the posterior, by the statistical error alone; lines: best fit", fontsize=9)
    return save(figure, out, name)


COLOURS = {"red": pen.VERMILION, "green": pen.GREEN, "blue": pen.BLUE, "grey": pen.GREY}
SPOT, RINGS = "photo-spot", "photo-rings"  # their files
DECADES = 5  # of light that a picture shows
SHOWN = 800  # pixels of a picture's longer side
EVERY = 4  # rings of which one is drawn


@styled
def spot_figure(photo: Photo, out: Path, name: str = SPOT) -> list[Path]:
    """Draw the merged picture on a logarithmic scale, the spot's centre, some rings, and what no exposure recorded."""
    figure = canvas(5.4)
    axes = figure.subplots()
    colour = "green" if "green" in photo.fits else next(iter(photo.fits))
    (picture, *_), centre = photo.shot.pictures(colour), photo.shot.spot.centre
    stride = max(1, max(picture.light.shape) // SHOWN)
    light = picture.light[::stride, ::stride]
    most = float(np.nanmax(light))
    shown = np.log10(np.clip(np.where(np.isfinite(light), light, np.nan) / most, 10.0**-DECADES, 1.0))
    columns, rows = photo.shot.sides
    shades = matplotlib.colormaps["magma"].with_extremes(bad=pen.VERMILION)
    image = axes.imshow(shown, cmap=shades, extent=(0, columns, rows, 0), vmin=-DECADES, vmax=0.0)
    pixel = photo.plate.pixel(centre)
    for edge in photo.fits[colour].shot.medium.outer[::EVERY]:
        axes.add_patch(Circle(centre, edge / pixel, fill=False, color="white", linewidth=0.4, alpha=0.7))
    axes.plot(*centre, marker="+", color="white", markersize=8, linestyle="none")
    axes.set(xlabel="column [pixel]", ylabel="row [pixel]")
    axes.grid(visible=False)
    figure.colorbar(image, ax=axes, label=f"light, {colour}, decades below the brightest")
    return save(figure, out, name)


@styled
def rings_figure(photo: Photo, out: Path, name: str = RINGS) -> list[Path]:
    """Draw light of the rings by colour with the fit, over r [mm]; under it the residuals in standard errors."""
    figure = canvas(5.6)
    top, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    for colour, fit in photo.fits.items():
        rings, shade = fit.shot.medium, COLOURS[colour]
        light, rows = (one[0][: rings.value.size] for one in (fit.shot.rows(fit.x), fit.shot.residuals(fit.x)))
        error = np.sqrt(np.diag(rings.covariance))
        seen = rings.value > 0
        style = {**pen.DATA, "color": shade}
        top.errorbar(rings.r[seen], rings.value[seen], yerr=error[seen], label=f"{colour}: rings", **style)
        top.plot(rings.r, light, label=f"{colour}: fit", **{**pen.WHOLE, "color": shade})
        below.plot(rings.r, rows, marker="o", markersize=2.6, linewidth=0.6, color=shade)
    unit = "counts" if photo.shot.seconds is None else "counts a second"
    top.set(xscale="log", yscale="log", ylabel=f"light [{unit}]")
    below.axhspan(-2, 2, color=pen.GREY, alpha=0.12, linewidth=0)
    below.set(xlabel="r [mm]", ylabel="residual, whitened [σ]")
    legend_below(figure, [top, below])
    return save(figure, out, name)

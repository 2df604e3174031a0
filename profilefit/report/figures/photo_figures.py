"""Figures of a spot that was photographed: the picture, its rings and what was left out, and the fit of each colour."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.patches import Circle

from profilefit.measured.photo.workflow import Photo
from profilefit.report.figures.canvas import (
    BLUE,
    DATA,
    GREEN,
    GREY,
    VERMILION,
    WHOLE,
    canvas,
    legend_below,
    save,
    styled,
)

COLOURS = {"red": VERMILION, "green": GREEN, "blue": BLUE, "grey": GREY}
SPOT, RINGS = "photo-spot", "photo-rings"  # their files
DECADES = 5  # of light that a picture shows
SHOWN = 800  # pixels of a picture's longer side
EVERY = 4  # rings of which one is drawn


@styled
def spot_figure(photo: Photo, out: Path, name: str = SPOT) -> list[Path]:
    """Draw the merged picture on a logarithmic scale, the spot's centre, some rings, and what no exposure recorded."""
    figure = canvas(5.4)
    axes = figure.subplots()
    colour = next((one for one in photo.fits if one == "green"), next(iter(photo.fits)))
    (picture, *_), centre = photo.shot.pictures(colour), photo.shot.spot.centre
    stride = max(1, max(picture.light.shape) // SHOWN)
    light = picture.light[::stride, ::stride]
    most = float(np.nanmax(light))
    shown = np.log10(np.clip(np.where(np.isfinite(light), light, np.nan) / most, 10.0**-DECADES, 1.0))
    columns, rows = photo.shot.sides
    shades = matplotlib.colormaps["magma"].with_extremes(bad=VERMILION)
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
        top.errorbar(
            rings.r[seen], rings.value[seen], yerr=error[seen], label=f"{colour}: rings", **{**DATA, "color": shade}
        )
        top.plot(rings.r, light, label=f"{colour}: fit", **{**WHOLE, "color": shade})
        below.plot(rings.r, rows, marker="o", markersize=2.6, linewidth=0.6, color=shade)
    unit = "counts" if photo.shot.seconds is None else "counts a second"
    top.set(xscale="log", yscale="log", ylabel=f"light [{unit}]")
    below.axhspan(-2, 2, color=GREY, alpha=0.12, linewidth=0)
    below.set(xlabel="r [mm]", ylabel="residual, whitened [σ]")
    legend_below(figure, [top, below])
    return save(figure, out, name)

"""Residuals: of a profile by radial bin and albedo, of an inverse cdf by share of energy, of a map by albedo."""

from __future__ import annotations

from pathlib import Path

import jax
import matplotlib
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from mcml_sim import exact
from profilefit.laws.base import ProfileLaw
from profilefit.recipes.recipe import Albedos
from profilefit.recipes.targets import albedo_values
from profilefit.report.figures.canvas import BLACK, BLUE, albedo_axis, canvas, save, styled
from profilefit.report.records import Fitted, Source

Floats = NDArray[np.float64]
ALBEDOS = 6  # of a record's albedos, in order
WITHIN = 0.995  # of the energy, as in quality.ENERGY_WITHIN: beyond it no measure looks
MOST_RINGS = 60  # drawn: the paper's 400 even rings would hide each other
SHARES = np.linspace(0.0, 0.999, 400)
COLOURS = "viridis"  # from dark to light with alpha
HEIGHT = 3.2  # [inch]


@styled
def residual_figure(record_name: str, source: Source, out: Path, name: str = "") -> list[Path]:
    """Draw a profile law's energy of a ring over that of the data, less 1 [-], with the data's standard errors.

    Of an inverse cdf: exact cdf(r(xi)) - xi [-]. Of a map: alpha or A, whichever was fitted, less that of the data [-].
    """
    fitted = source.needed(record_name)
    figure = canvas(HEIGHT)
    ax = figure.subplots()
    draw = {"albedo": _of_map, "inverse": _of_inverse}.get(fitted.content["pipeline"], _of_profile)
    draw(ax, fitted)
    ax.axhline(0.0, color=BLACK, linewidth=0.8)
    return save(figure, out, name or f"residuals-{record_name}")


def _of_map(ax: Axes, fitted: Fitted) -> None:
    """Return alpha at the data's A, or A at the data's alpha, of the fitted map."""
    alpha = albedo_values(Albedos(**fitted.content["protocol"]["albedos"]), fitted.law.setting)
    law = fitted.law.in_reduced()  # as the data's albedos are
    reflectance, error = fitted.arrays["reflectance"], np.nan_to_num(fitted.arrays["reflectance_error"])
    if fitted.content["protocol"]["weighting"]["objective"] == "albedo":
        left, error = np.asarray(law.alpha(reflectance)) - alpha, error * np.gradient(alpha, reflectance)
        what = "α"
    else:
        left, what = np.asarray(law.reflectance(alpha)) - reflectance, "A"
    ax.errorbar(alpha, left, error, color=BLUE, marker="o", markersize=2.6, linewidth=0.8, elinewidth=0.8)
    albedo_axis(ax)
    ax.set_ylabel(f"{what} of the map less {what} of the data [-]")


def _of_inverse(ax: Axes, fitted: Fitted) -> None:
    for alpha, colour, _ in _chosen(fitted):
        radii = fitted.law.sampler.sample(SHARES, alpha)
        left = np.asarray(exact.cdf(radii, alpha, setting=fitted.law.setting)) - SHARES
        ax.plot(SHARES, left, color=colour, label=f"α = {alpha:.3f}")
    ax.set(xlabel="ξ [-]", ylabel="exact cdf(r(ξ)) − ξ [-]", xlim=(0.0, 1.0))
    _legend(ax)


def _of_profile(ax: Axes, fitted: Fitted) -> None:
    edges = fitted.arrays["r_edges"]
    for alpha, colour, row in _chosen(fitted):
        energy, error = fitted.arrays["energy"][row], np.nan_to_num(fitted.arrays["energy_error"][row])
        last = np.searchsorted(np.cumsum(energy), WITHIN * np.sum(energy))
        known = (energy > 0) & (np.arange(energy.size) <= last)
        index = np.flatnonzero(known)
        index = index[np.unique(np.geomspace(1, index.size, MOST_RINGS).astype(int) - 1)]
        inner, outer = edges[:-1][index], edges[1:][index]
        middle = np.sqrt(np.maximum(inner, 0.25 * outer) * outer)
        (model,) = np.diff(energy_within(fitted.law, np.stack([inner, outer]), alpha), axis=0)
        left, spread = model / energy[index] - 1.0, error[index] / energy[index]
        ax.errorbar(middle, left, spread, color=colour, linewidth=1.0, elinewidth=0.7, label=f"α = {alpha:.3f}")
    ax.set(xscale="log", xlabel="r [mfp]", ylabel="energy of a radial bin: law / data − 1 [-]")
    _legend(ax)


def energy_within(law: ProfileLaw, edges: Floats, alpha: float) -> Floats:
    """Return what the fit compared, within each edge (..., n) [-]."""
    short = -edges.shape[-1] % MOST_RINGS  # so that one compilation serves all albedos
    full = np.pad(edges, [(0, 0)] * (edges.ndim - 1) + [(0, short)], mode="edge")
    with jax.enable_x64(True):
        return np.asarray(_energy_within(law, full, np.float64(alpha)))[..., : edges.shape[-1]]


@jax.jit
def _energy_within(law: ProfileLaw, edges: jax.Array, alpha: jax.Array) -> jax.Array:
    return law.unscaled_energy(edges, alpha)


def _chosen(fitted: Fitted) -> list[tuple[float, tuple[float, ...], int]]:
    """Return (alpha, colour, row) of the albedos shown."""
    rows = np.unique(np.linspace(0, fitted.arrays["alpha"].size - 1, ALBEDOS).round().astype(int))
    colours = matplotlib.colormaps[COLOURS](np.linspace(0.05, 0.9, rows.size))
    pairs = zip(rows, colours, strict=True)
    return [(float(fitted.arrays["alpha"][row]), tuple(map(float, colour)), int(row)) for row, colour in pairs]


def _legend(ax: Axes) -> None:
    ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))

"""The picture that stands in where a browser cannot run the explorer: skin's profile, cdf and edge of light."""

from __future__ import annotations

import io

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import NullLocator
from numpy.typing import NDArray

from mcml_sim import Setting, exact
from profilefit.laws.base import ProfileLaw
from profilefit.materials import BY_NAME, CHANNELS
from profilefit.recipes import catalogue
from profilefit.report.drawing import inline
from profilefit.report.figures.canvas import BLACK, BLUE, GREEN, RC, VERMILION, canvas, styled
from profilefit.scenes.stage.picture import srgb_codes
from profilefit.scenes.stage.step_edge import step_response

Floats = NDArray[np.float64]
MATERIAL, LAW, SETTING = "skin1", "hazard", Setting("diffuse")
COLOURS = (VERMILION, GREEN, BLUE)
WHITE = "#ffffff"
DECADES = (0.01, 0.1, 1.0, 10.0)  # of r [mm], labelled
REACH = 5.0  # of the edge, to both sides [mm]
TITLE = f"Law {LAW} (colours) on the exact half space (dashed): {MATERIAL} under diffuse light"
# A colour of the figure -> the explorer's variable for it, so that it is read on dark pages too.
VARIABLES = {
    BLACK: "--x-fg",
    WHITE: "--x-bg",
    VERMILION: "--x-red",
    GREEN: "--x-green",
    BLUE: "--x-blue",
    RC["grid.color"]: "--x-line",
}


def still() -> str:
    """Return the picture as SVG. It takes the installation's own record: what it shows is the same in every report."""
    law = catalogue.load(LAW, setting=SETTING)
    return inline(_drawn(law), "explorer-still", TITLE, VARIABLES)


@styled
def _drawn(law: ProfileLaw) -> str:
    figure = canvas(3.2)
    profile, cdf, edge = figure.subplots(1, 3)
    _profiles(profile, cdf, law)
    _edge(edge, law)
    figure.suptitle(TITLE, fontsize=9.0)
    file = io.StringIO()
    figure.savefig(file, format="svg", metadata={"Date": None}, transparent=True)
    return file.getvalue()


def _profiles(profile: Axes, cdf: Axes, law: ProfileLaw) -> None:
    alpha, mfp = (np.array(one)[:, None] for one in (BY_NAME[MATERIAL].alpha, BY_NAME[MATERIAL].mfp))
    r = np.geomspace(0.01, 30.0, 120)
    _pairs(profile, r, r * law.profile(r, alpha, mfp), r * np.asarray(exact.profile(r, alpha, mfp, SETTING)))
    _pairs(cdf, r, law.cdf(r, alpha, mfp), np.asarray(exact.cdf(r, alpha, mfp, SETTING)))
    profile.set(ylabel="$r\\,R_d$ [1/mm]")
    profile.legend()
    cdf.set(ylabel="cdf [-]", ylim=(0.0, 1.0))
    for ax in (profile, cdf):
        ax.set(xlabel="r [mm]", xscale="log")
        ax.set_xticks(DECADES, [f"{value:g}" for value in DECADES])
        ax.xaxis.set_minor_locator(NullLocator())


def _pairs(ax: Axes, x: Floats, law: Floats, truth: Floats) -> None:
    """Draw a line (channels, n) of the law for each channel, the exact one dashed on it."""
    for name, colour, by_law, true in zip(CHANNELS, COLOURS, law, truth, strict=True):
        ax.plot(x, by_law, color=colour, linewidth=2.2, label=name)
        ax.plot(x, true, color=BLACK, linestyle="--", linewidth=0.9)
    _letters(ax, x, law)


def _letters(ax: Axes, x: Floats, law: Floats) -> None:
    """Draw the initial of each channel on its line, where it is farthest from the others."""
    ends = x.size // 12  # beside the frame
    for c, name in enumerate(CHANNELS):
        apart = np.min(np.abs(np.delete(law, c, axis=0) - law[c]), axis=0)
        at = ends + np.argmax(apart[ends:-ends])
        behind = {"boxstyle": "circle,pad=0.1", "facecolor": WHITE, "edgecolor": "none"}
        ax.text(x[at], law[c, at], name[0].upper(), ha="center", va="center", weight="bold", size=8.0, bbox=behind)


def _edge(ax: Axes, law: ProfileLaw) -> None:
    """Draw radiance beside the edge, over the strip of colours that it makes."""
    material = BY_NAME[MATERIAL]
    alpha, mfp = np.array(material.alpha), np.array(material.mfp)
    x = np.linspace(-REACH, REACH, 121)
    reflectance = np.asarray(exact.reflectance(alpha, SETTING))[:, None]
    by_law = reflectance * step_response(x, alpha[:, None], mfp[:, None], law=law)
    _pairs(ax, x, by_law, reflectance * step_response(x, alpha[:, None], mfp[:, None], SETTING))
    strip = srgb_codes(by_law.T)[None].astype(np.uint8)
    ax.imshow(strip, extent=(-REACH, REACH, 0.88, 1.0), aspect="auto", zorder=3)
    ax.set(xlabel="from the edge of the light [mm]", ylabel="radiance [white = 1]", xlim=(-REACH, REACH), ylim=(0, 1))

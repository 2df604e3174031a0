"""Exact tables and the picture of the report's explorer, which `profilefit/report/explorer` ships: made anew.

python -m benchmarks.explorer_tables [--out FOLDER]
"""

from __future__ import annotations

import argparse
import io
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import NullLocator

from mcml_sim import Setting, exact
from mcml_sim.files.whole_file import write_together
from mcml_sim.media.arrays import Floats
from profilefit.laws.base import ProfileLaw
from profilefit.materials import BY_NAME, CHANNELS
from profilefit.recipes.catalogue import load
from profilefit.report.drawing import inline
from profilefit.report.explorer.fragment import COARSE, EXACT, GRID, KNOTS, LIGHTS, STILL
from profilefit.report.explorer.fragment import __file__ as beside
from profilefit.report.figures.canvas import BLACK, BLUE, GREEN, RC, VERMILION, canvas, styled
from profilefit.scenes.stage.exact_law import LEAST_ALPHA, log_profile
from profilefit.scenes.stage.judge import srgb_codes
from profilefit.scenes.stage.reference.step_edge import step_response

FAINT = 1e-9  # x^2 R_d l^2 / A below which the quadrature of a refracting surface leaves no digits
LOWEST, STEP = -32.0, 4e-6  # of the numbers in three bytes; the same in exact.js


def files() -> dict[str, bytes | str]:
    """Return both files by their names."""
    tables = b"".join(baked(Setting(light, n)) for light in LIGHTS for n in (1.0, *KNOTS))
    return {EXACT: tables, STILL: still()}


def baked(setting: Setting) -> bytes:
    """Return A / alpha (rows,), then both tables (rows, columns): float32 at n = 1, else steps of three bytes."""
    grid, own = (GRID, log_profile) if setting.n == 1.0 else (COARSE, _refracted)
    s = 1.0 - (1.0 - np.linspace(0.0, 1.0, grid.rows) ** 3) ** 2
    alpha = np.maximum((1.0 - s) * (1.0 + s), LEAST_ALPHA)
    y = np.linspace(np.log(grid.low), np.log(grid.high), grid.columns)
    reflectance = np.asarray(exact.reflectance(alpha, setting))
    profile = own(y, alpha, setting) - np.log(reflectance)[:, None]
    cdf = np.log(np.asarray(exact.cdf(np.exp(y), alpha[:, None], setting=setting))) - y
    numbers = np.concatenate([reflectance / alpha, profile.ravel(), cdf.ravel()])
    if setting.n == 1.0:
        return numbers.astype("<f4").tobytes()
    return np.rint((numbers - LOWEST) / STEP).astype("<u4").view(np.uint8).reshape(-1, 4)[:, :3].tobytes()


def _refracted(y: Floats, alpha: Floats, setting: Setting) -> Floats:
    """Return ln(R_d l^2) + kappa x (albedos, radii), continued as x^-2 from where R_d is `FAINT` [-]."""
    x = np.exp(y)
    profile = np.asarray(exact.profile(x, alpha[:, None], setting=setting))
    reflectance = np.asarray(exact.reflectance(alpha, setting))
    seen = np.logical_and.accumulate(x**2 * profile > FAINT * reflectance[:, None], axis=1)
    held = np.minimum(np.arange(y.size), np.sum(seen, axis=1)[:, None] - 1)
    path = np.asarray(exact.decay_rate(alpha))[:, None] * x[held]
    return np.log(np.take_along_axis(profile, held, axis=1)) + path - 2.0 * (y - y[held])


MATERIAL, LAW, SETTING = "skin1", "hazard", Setting("diffuse")
COLOURS = (VERMILION, GREEN, BLUE)
WHITE = "#ffffff"
DECADES = (0.01, 0.1, 1.0, 10.0)  # of r [mm], labelled
REACH = 5.0  # of the edge, to both sides [mm]
TITLE = f"Model {LAW} (colours) and the exact solution (dashed): {MATERIAL}, diffuse illumination"
# A colour of the figure -> the explorer's variable for it, so that it is read on dark pages too.
VARIABLES = {
    BLACK: "--x-fg",
    WHITE: "--x-bg",
    VERMILION: "--x-red",
    GREEN: "--x-green",
    BLUE: "--x-blue",
    RC["grid.color"]: "--x-line",
}


@styled
def still() -> str:
    """Return the picture as SVG, by the shipped record: it is equal in every report."""
    law = load(LAW, setting=SETTING)
    figure = canvas(3.2)
    profile, cdf, edge = figure.subplots(1, 3)
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
    _edge(edge, law, alpha, mfp)
    figure.suptitle(TITLE, fontsize=9.0)
    file = io.StringIO()
    figure.savefig(file, format="svg", metadata={"Date": None}, transparent=True)
    return inline(file.getvalue(), "explorer-still", TITLE, VARIABLES)


def _pairs(ax: Axes, x: Floats, law: Floats, truth: Floats) -> None:
    """Draw a line (channels, n) of the law for each channel, the exact one dashed on it, and its initial on both.

    The initial stands where the line is farthest from the others.
    """
    for name, colour, by_law, true in zip(CHANNELS, COLOURS, law, truth, strict=True):
        ax.plot(x, by_law, color=colour, linewidth=2.2, label=name)
        ax.plot(x, true, color=BLACK, linestyle="--", linewidth=0.9)
    ends = x.size // 12  # beside the frame
    for c, name in enumerate(CHANNELS):
        apart = np.min(np.abs(np.delete(law, c, axis=0) - law[c]), axis=0)
        at = ends + np.argmax(apart[ends:-ends])
        behind = {"boxstyle": "circle,pad=0.1", "facecolor": WHITE, "edgecolor": "none"}
        ax.text(x[at], law[c, at], name[0].upper(), ha="center", va="center", weight="bold", size=8.0, bbox=behind)


def _edge(ax: Axes, law: ProfileLaw, alpha: Floats, mfp: Floats) -> None:
    """Draw radiance beside the edge, over the strip of colours that it makes."""
    x = np.linspace(-REACH, REACH, 121)
    reflectance = np.asarray(exact.reflectance(alpha, SETTING))
    by_law = reflectance * step_response(x, alpha, mfp, law=law)
    _pairs(ax, x, by_law, reflectance * step_response(x, alpha, mfp, SETTING))
    strip = srgb_codes(by_law.T)[None].astype(np.uint8)
    ax.imshow(strip, extent=(-REACH, REACH, 0.88, 1.0), aspect="auto", zorder=3)
    ax.set(xlabel="from the edge of the light [mm]", ylabel="radiance [white = 1]", xlim=(-REACH, REACH), ylim=(0, 1))


def main(arguments: list[str] | None = None) -> None:
    """Write both files into a folder, beside the explorer's source if none is given."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path(beside).parent, metavar="FOLDER")
    out = parser.parse_args(arguments).out
    write_together({out / name: content for name, content in files().items()})


if __name__ == "__main__":
    main()

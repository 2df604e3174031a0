"""Skin refracts: errors of laws made for n = 1, as profiles and as a head; the law in n beside them."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

import moderngl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter
from numpy.typing import NDArray

import profilefit
from benchmarks.render_figure import save
from benchmarks.render_pictures import COLOURS, LEVELS, LUMINANCE, STEPS
from benchmarks.render_view import Judged, judged, shown
from benchmarks.table import show
from mcml_sim import Setting, exact
from profilefit.laws.base import ProfileLaw
from profilefit.report.figures.canvas import BLUE, GREEN, VERMILION, canvas, styled
from profilefit.scenes.skin.scene import head_scene
from profilefit.scenes.skin.truth import albedo_of
from profilefit.scenes.stage.pattern import MOST_SAMPLES, Sampling
from profilefit.scenes.stage.request import HEAD
from profilefit.scenes.stage.world import Camera, unit

Floats = NDArray[np.float64]
SKIN, MATCHED = Setting("diffuse", n=1.4), Setting("diffuse")
# The face of a figure of 60 mm: a quarter of life size, so that light spreads over what a small picture resolves.
MATERIAL, SCALE = "skin2", 4.0
TARGET, DISTANCE, HEIGHT = (4.0, -6.0, 60.0), 650.0, 136.0  # of the camera [mm]
SIZE, SEEDS = (216, 216), 8  # [pixels]; pictures of MOST_SAMPLES samples whose mean is shown
COLOURS_SHOWN = (0.05, 0.15, 0.3, 0.5, 0.8)  # A [-]
NEAREST, FARTHEST, WITHIN = 0.01, 10.0, 0.995  # [mfp], [mfp], [-]: radii of errors and of the panels, as `rel` has them
LABELLED = 4e-4  # r R_d at which a curve is named, or near the right end [1/mfp]
LEAST, MOST = 1e-4, 0.2  # of r R_d in the panels [1/mfp]
END = 0.2  # of the maps [-]
EXACT = "#BBBBBB"


@dataclass(frozen=True)
class Shot:
    """Law with the head that it draws, (h, w, 3); errors of both, over the exact one [-].

    profile_error  of R_d, mean over ln r and the colours shown;  error  root mean square, over the mean exitance
    """

    title: str
    law: ProfileLaw
    colour: str
    exitance: Floats
    profile_error: float
    error: float


def judged_head(context: moderngl.Context, size: tuple[int, int]) -> AbstractContextManager[Judged]:
    """Return the head under a surface of n = 1.4 in the colour of the material, with its exact answer."""
    x, y, z = (np.array(TARGET) + DISTANCE * unit(HEAD.direction)).tolist()
    scene = head_scene(MATERIAL, Camera((x, y, z), TARGET, HEIGHT), setting=SKIN)
    return judged(context, size, True, scene, SCALE, SKIN)


def shots(judge: Judged, seeds: int) -> list[Shot]:
    """Return the shot of each law, for the same colour and the same mean free path."""
    wanted = (
        ("normalized diffusion", profilefit.load("burley", "published:diffuse"), VERMILION),
        ("hazard, n = 1", profilefit.load("hazard", setting=MATCHED), GREEN),
        ("hazard, n = 1.4", profilefit.load("hazard", setting=SKIN), BLUE),
    )
    found = []
    for title, law, colour in wanted:
        runs = [judge.stage.scatter(law, judge.mfp, Sampling(MOST_SAMPLES, seed=seed)) for seed in range(seeds)]
        exitance = np.mean(runs, axis=0, dtype=float)
        found.append(Shot(title, law, colour, exitance, _profile_error(law), judge.rmse(exitance)))
    return found


def _profile_error(law: ProfileLaw) -> float:
    errors = []
    for colour in COLOURS_SHOWN:
        alpha = albedo_of(colour, SKIN)
        r = np.geomspace(NEAREST, float(exact.quantile(WITHIN, alpha, setting=SKIN)), 200)
        truth = np.asarray(exact.profile(r, alpha, setting=SKIN))
        errors.append(np.mean(np.abs(_profile(law, r, colour) / truth - 1.0)))
    return float(np.mean(errors))


def _profile(law: ProfileLaw, r: Floats, colour: float) -> Floats:
    """Return R_d [1/mfp^2] at the albedo at which the law's own half space has the colour."""
    return np.asarray(law.profile(r, albedo_of(colour, law.setting)))


@styled
def draw(judge: Judged, found: Sequence[Shot], path: Path) -> None:
    """Draw a column per law: profiles, the head, its difference from the exact one. `path` ends in .png."""
    figure = canvas(7.9)
    grid = figure.add_gridspec(3, len(found), height_ratios=(1.0, 1.2, 1.2))
    top = None
    for column, one in enumerate(found):
        top = figure.add_subplot(grid[0, column], sharey=top)
        _profiles(top, one, first=column == 0)
        head, error = (figure.add_subplot(grid[row, column]) for row in (1, 2))
        head.imshow(shown(np.pi * _radiance(judge, one)), interpolation="nearest")
        mapped = error.imshow(
            100 * _difference(judge, one)[::-1],
            **{"cmap": STEPS, "vmin": -_end(), "vmax": _end(), "interpolation": "nearest"},
        )
        error.set_title(f"error of brightness {_percent(one.error)}", fontsize=9, pad=3)
        for ax, what in ((head, "a head, drawn by it"), (error, "its error")):
            ax.set(xticks=[], yticks=[], ylabel="" if column else what)
            ax.spines[:].set_visible(False)
    bar = figure.colorbar(
        mapped,
        ax=figure.axes,
        orientation="horizontal",
        fraction=0.03,
        aspect=70,
        pad=0.015,
        extend="both",
        ticks=np.arange(-20, 21, 5),
        format=FuncFormatter(lambda value, _: f"{value:+.0f} %" if value else "0"),
    )
    bar.set_label("brightness less that of the exact picture, in per cent of its mean")
    save(figure, path, COLOURS, (255 * STEPS(np.arange(LEVELS))[:, :3]).round().astype(int).tolist())


def _end() -> float:
    return 100 * END * LEVELS / (LEVELS - 1)


def _profiles(ax: Axes, one: Shot, first: bool) -> None:
    """Draw r R_d over r: exact, and by the law."""
    r = np.linspace(NEAREST, FARTHEST, 400)
    for colour in COLOURS_SHOWN:
        truth = r * np.asarray(exact.profile(r, albedo_of(colour, SKIN), setting=SKIN))
        ax.plot(r, truth, color=EXACT, linewidth=4.5, label="exact, n = 1.4" if colour == COLOURS_SHOWN[0] else None)
        ax.plot(r, r * _profile(one.law, r, colour), color=one.colour, linewidth=1.3)
        if not first:
            continue
        end = int(np.argmax(truth < LABELLED)) if truth[-1] < LABELLED else r.size - 60
        ax.text(
            r[end],
            truth[end],
            f"A = {colour:g}" if colour == COLOURS_SHOWN[-1] else f"{colour:g}",
            fontsize=7,
            ha="center",
            va="center",
            bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": EXACT, "linewidth": 0.8},
            zorder=5,
        )
    ax.set(yscale="log", xlim=(0.0, FARTHEST), ylim=(LEAST, MOST), xlabel="r [mean free paths]")
    ax.set_title(one.title, color=one.colour, fontsize=11, fontweight="bold", pad=16)
    ax.text(0.5, 1.03, f"error of R$_d$ {_percent(one.profile_error)}", transform=ax.transAxes, ha="center", fontsize=9)
    if first:
        ax.set_ylabel("r R$_d$ [1/mean free path]")
        ax.legend(loc="upper right", fontsize=8)
    else:
        ax.tick_params(labelleft=False)


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %" if share > 0.1 else f"{100 * share:.1f} %"


def _radiance(judge: Judged, one: Shot) -> Floats:
    """Return the camera's radiance [light's unit / sr]: with highlights, which are the stage's own."""
    sampling = Sampling(1)
    rest = judge.stage.render(one.law, judge.mfp, sampling) - judge.stage.scatter(one.law, judge.mfp, sampling) / np.pi
    return rest + one.exitance / np.pi


def _difference(judge: Judged, one: Shot) -> Floats:
    """Return (h, w) luminance less that of the exact picture, over its mean [-]; 0 where nothing scatters."""
    mean = float((judge.reference[judge.mask] @ LUMINANCE).mean())
    return np.where(judge.mask, (one.exitance - judge.reference) @ LUMINANCE, 0.0) / mean


def report(found: Sequence[Shot]) -> None:
    """Print the captions."""
    cells = [(one.title, f"{one.profile_error:.4f}", f"{one.error:.4f}") for one in found]
    show(f"Under a surface of n = {SKIN.n:g}", ("law", "R_d, mean relative error", "picture, RMSE"), cells)


def as_json(found: Sequence[Shot]) -> dict:
    return {one.title: {"profile": one.profile_error, "picture": one.error} for one in found}

"""The explorer as one piece of HTML: style, script, shaders, laws and the exact tables, nothing beside it.

The exact half space is small tables, rows of albedos, columns of radii: what `exact.js` computes from.
ln(R_d l^2 / A) + kappa x and ln(cdf / x), x = r/l, at even u and ln x, where sqrt(1 - alpha) = 1 - (1 - u^3)^2 crowds
the rows at both ends; `exact.js` puts polynomials of six points through both. Between the knots, for A up to 0.9999,
R_d is right to 4e-6 for r within 99.5 % of the energy and the cdf to 1e-6 everywhere; nearer to white to 1e-4 and 1e-5.

Under a surface that refracts the tables are coarser, and stand at a few indices, through which goes a polynomial over
mu_c = sqrt(1 - 1/n^2): R_d is right to 5e-4 and the cdf to 5e-5 from n = 1.1 up, below it to 3e-3 and 3e-4, where light
is scattered hardly at all or almost always.

Where a browser cannot run it, a picture stands in: skin's profile, cdf and edge of light.
"""

from __future__ import annotations

import base64
import io
import json
import re
from dataclasses import asdict, dataclass, replace
from functools import lru_cache, partial
from string import Template

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import NullLocator

from mcml_sim import Setting, exact
from mcml_sim.media.arrays import Floats
from profilefit.laws.base import ProfileLaw
from profilefit.materials import BY_NAME, CHANNELS, MATERIALS
from profilefit.recipes.catalogue import LoadedLaw, find, load, profile_laws
from profilefit.recipes.record import Folder, Records
from profilefit.report.drawing import inline
from profilefit.report.figures.canvas import BLACK, BLUE, GREEN, RC, VERMILION, canvas, styled
from profilefit.scenes.stage.exact_law import LEAST_ALPHA, log_profile
from profilefit.scenes.stage.judge import srgb_codes
from profilefit.scenes.stage.step_edge import step_response
from profilefit.shader.emit import text_beside
from profilefit.shader.law_file import export

_asset = partial(text_beside, __name__)
# In this order: each file uses only what comes before it, but for what runs later.
SCRIPTS = ("exact", "laws", "device", "measure", "letters", "plot", "results", "state", "controls", "ball", "main")
LOWEST, HIGHEST = -2.5, 1.5  # log10 of the transport mean free path [mm] at the ends of its slider
ABOUT = (
    "Choose a material, for example skin1, or move the sliders. The balls and curves follow. Each colour channel has its "
    "own reflectance A and mean free path l."
)
MEASURES = (
    "Errors are relative to the exact solution of a semi-infinite medium with isotropic scattering. Error of "
    "R<sub>d</sub>: mean relative error for r from 0.01 l to 99.5 % of the reflected light. Error of cdf: largest "
    "absolute error. Error at edge: largest error within 3.5 l of an edge of light, as a share of A. The exact "
    "solution is read from a table. Its relative error is 1e-5 at n = 1, 5e-4 from n = 1.1 on, and 3e-3 between. "
    "The graphics processor runs the source that <code>profilefit export --lang glsl-es</code> writes. Only hazard "
    "follows n. All other models are made for n = 1."
)


def explorer_section(folder: Folder) -> str:
    """Return what goes into the page's section: laws with the records in `folder`, in a `<div class="explorer">`.

    It needs no network and no other file, works from file://, and follows the page's variables for colours, --fg, --bg,
    --muted, --line, --blue, --green and --vermilion, where there are such. RecordError on a damaged record. Seconds.
    """
    return Template(_asset("explorer.html")).substitute(
        style=_asset("explorer.css"),
        about=ABOUT,
        measures=MEASURES,
        still=still(),
        index=_slider("n", "", 1, INDICES[-1], STEP, "n"),
        reflectances="\n".join(_slider("A", channel, 0, 1, 0.001) for channel in CHANNELS),
        paths="\n".join(_slider("l", channel, LOWEST, HIGHEST, 0.01) for channel in CHANNELS),
        data=_data(folder),
        script="\n".join(_asset(f"{name}.js") for name in SCRIPTS),
    )


def _slider(name: str, channel: str, low: float, high: float, step: float, label: str = "") -> str:
    here = f"explorer-{name}-{channel}".rstrip("-")
    return (
        f'<div class="slider {channel}"><label for="{here}">{label or channel}</label><input type="range" id="{here}" '
        f'min="{low:g}" max="{high:g}" step="{step:g}"><output for="{here}"></output></div>'
    )


def _data(folder: Folder) -> str:
    """Return all that the script reads, as JSON that cannot end the element it stands in.

    The texts of laws share two thirds of their lines: each is told by the numbers of its lines.
    """
    laws, sphere = offered(folder), _asset("sphere.glsl")
    texts = [text for law in laws for text in (law.text, law.refracting.text if law.refracting else "")]
    lines = {line: place for place, line in enumerate(dict.fromkeys("\n".join(texts).split("\n")))}
    offers = [asdict(law) for law in laws]
    for one in (part for offer in offers for part in (offer, offer["refracting"]) if part):
        one["text"] = [lines[line] for line in one["text"].split("\n")]
    shaders = {name: _asset(f"{name}.frag") for name in ("values", "edge", "inside", "ball", "show")}
    content = {
        "grids": {"matched": asdict(GRID), "refracting": asdict(COARSE)},
        "knots": KNOTS,
        "indices": INDICES,
        "tables": {light: [baked(Setting(light, n)) for n in (1.0, *KNOTS)] for light in LIGHTS},
        "lines": list(lines),
        "laws": offers,
        "materials": [{"name": one.name, "alpha": one.alpha, "mfp": one.mfp} for one in MATERIALS],
        "start": first(laws),
        "shaders": shaders | {name: sphere + shaders[name] for name in ("ball", "show")},  # behind a law's text
    }
    return json.dumps(content, ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")


PREFIX = "law"  # of the names in each text: one law runs at a time
FIRST = ("hazard-diffuse", "hazard")  # what is shown at the start, if it is there
ORDER = ("hazard", "quantile", "burley", "burley_diffuse_mfp", "liang", "gaussians", "better_dipole", "dipole")
RANK = {name: place for place, name in enumerate(ORDER)}
STEP, STEPS = 0.02, 30
INDICES = tuple(round(1.0 + STEP * (k + 1), 2) for k in range(STEPS))  # n of a surface that refracts
WORDS = r"([\s;]+)"  # between two words of a text; the same in laws.js


@dataclass(frozen=True)
class Refracting:
    """A law's text under surfaces that refract: the same words at every index but for a few, most of them numbers.

    text of the first of `INDICES`; places of the words that change; words (indices, places) of each index
    """

    text: str
    places: list[int]
    words: list[list[str]]


@dataclass(frozen=True)
class Offered:
    """Law under one illumination: its name in addresses, its own, the illumination, its name for readers.

    text, refracting  shader source in GLSL ES at n = 1, and at other indices where the law has constants for them
    """

    id: str
    name: str
    light: str
    label: str
    text: str
    refracting: Refracting | None = None


def offered(folder: Folder) -> list[Offered]:
    """Return every law of a matched surface that has a text, the best first; records are those in `folder`."""
    records, laws = Records.of(folder), []
    for named in sorted(profile_laws(records), key=lambda one: RANK.get(one.name.partition(":")[0], len(RANK))):
        if named.law.entry.has_text:
            label = title = named.law.entry.title
            if not named.records:
                label += f", {named.constants}" if named.constants else ""
            elif named.records[0].replace("-diffuse", "") != title:
                label += f": {named.records[0]}"
            text, refracting = export(named, records, "glsl-es", PREFIX), _refracting(named, records)
            laws.append(Offered(address(named), named.name, named.setting.illumination, label, text, refracting))
    return laws


def first(laws: list[Offered]) -> str:
    """Return the id of the law to begin with."""
    there = [law.id for law in laws]
    return next((name for name in FIRST if name in there), there[0])


def address(named: LoadedLaw) -> str:
    """Return the id of a law: its label, without what the address of a page may not hold."""
    return re.sub(r"[^\w.]+", "-", named.label)


def _refracting(named: LoadedLaw, records: Records) -> Refracting | None:
    """Return the text of the record of the same law and light that holds for every index, if the folder has one."""
    of = profile_laws(records, matched=False) if named.records else []
    same = (one for one in of if one.name == named.name and one.setting == replace(named.setting, n=one.setting.n))
    label = next((one.label for one in same if one.setting.n != named.setting.n), None)
    if label is None:
        return None
    texts = [export(find(label, records, n=n), records, "glsl-es", PREFIX) for n in INDICES]
    pieces = [re.split(WORDS, text) for text in texts]
    places = [at for at, words in enumerate(zip(*pieces, strict=True)) if len(set(words)) > 1]
    return Refracting(texts[0], places, [[words[at] for at in places] for words in pieces])


LIGHTS = ("searchlight", "diffuse")
KNOTS = (1.02, 1.05, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6)  # n, denser where the light changes fastest with it
FAINT = 1e-9  # x^2 R_d l^2 / A below which the quadrature of a refracting surface leaves no digits


@dataclass(frozen=True)
class TableGrid:
    """rows of albedos, columns of radii; low, high the first and last x [mfp]."""

    rows: int
    columns: int
    low: float = 1e-4
    high: float = 1e4


GRID, COARSE = TableGrid(65, 111), TableGrid(49, 89)  # coarser under a refracting interface


@lru_cache(maxsize=len(LIGHTS) * (1 + len(KNOTS)))
def baked(setting: Setting) -> str:
    """Return A / alpha (rows,), then both tables (rows, columns): float32, little-endian, in base64."""
    grid, own = (GRID, log_profile) if setting.n == 1.0 else (COARSE, _refracted)
    s = 1.0 - (1.0 - np.linspace(0.0, 1.0, grid.rows) ** 3) ** 2
    alpha = np.maximum((1.0 - s) * (1.0 + s), LEAST_ALPHA)
    y = np.linspace(np.log(grid.low), np.log(grid.high), grid.columns)
    reflectance = np.asarray(exact.reflectance(alpha, setting))
    profile = own(y, alpha, setting) - np.log(reflectance)[:, None]
    cdf = np.log(np.asarray(exact.cdf(np.exp(y), alpha[:, None], setting=setting))) - y
    numbers = np.concatenate([reflectance / alpha, profile.ravel(), cdf.ravel()])
    return base64.b64encode(numbers.astype("<f4").tobytes()).decode("ascii")


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


@styled
def still() -> str:
    """Return the picture as SVG, by the shipped record: what it shows is the same in every report."""
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

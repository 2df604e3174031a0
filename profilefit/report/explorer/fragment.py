"""The explorer as one piece of HTML: style, script, shaders, laws and the exact table, nothing beside it.

The exact half space goes in as a small table, rows of albedos, columns of radii: ln(R_d l^2 / A) + kappa x and
ln(cdf / x), x = r/l, at even u and ln x, where sqrt(1 - alpha) = 1 - (1 - u^3)^2 crowds the rows at both ends.
`exact.js` puts polynomials of six points through both. Between the knots, for A up to 0.9999, R_d is right to 4e-6 for
r within 99.5 % of the energy and the cdf to 1e-6 everywhere; nearer to white to 1e-4 and 1e-5.
"""

from __future__ import annotations

import base64
import json
import re
from dataclasses import asdict, dataclass
from functools import lru_cache
from importlib.resources import files
from string import Template

import numpy as np

from mcml_sim import Setting, exact
from profilefit.materials import MATERIALS
from profilefit.recipes.inventory import Named, profile_laws
from profilefit.recipes.record_folder import Folder, Records
from profilefit.report.explorer.still import still
from profilefit.scenes.stage.exact_table import LEAST_ALPHA, log_profile
from profilefit.shader.law_file import export

PREFIX = "law"  # of the names in each text: one law runs at a time
FIRST = ("hazard-diffuse", "hazard")  # what is shown at the start, if it is there
ORDER = ("hazard", "quantile", "burley", "burley_diffuse_mfp", "liang", "gaussians", "better_dipole", "dipole")


@dataclass(frozen=True)
class Offered:
    """id for addresses; name of the law; light that its constants belong to; label for readers; text in GLSL ES."""

    id: str
    name: str
    light: str
    label: str
    text: str


def offered(folder: Folder) -> list[Offered]:
    """Every law of a matched surface that has a text, the best first; records are those in `folder`."""
    records, found = Records.of(folder), []
    for named in sorted(profile_laws(records), key=_place):
        if named.law.entry.has_text:
            text = export(named, records, "glsl-es", PREFIX)
            found.append(Offered(address(named), named.name, named.setting.illumination, _label(named), text))
    return found


def first(laws: list[Offered]) -> str:
    """The id of the law to begin with."""
    there = [law.id for law in laws]
    return next((name for name in FIRST if name in there), there[0])


def address(named: Named) -> str:
    """The id of a law: its label, without what the address of a page may not hold."""
    return re.sub(r"[^\w.]+", "-", named.label)


def _place(named: Named) -> int:
    kind = named.name.partition(":")[0]
    return ORDER.index(kind) if kind in ORDER else len(ORDER)


def _label(named: Named) -> str:
    title = named.law.entry.title
    if not named.records:
        return f"{title}, {named.constants}" if named.constants else title
    return title if named.records[0].replace("-diffuse", "") == title else f"{title}: {named.records[0]}"


@dataclass(frozen=True)
class TableGrid:
    """rows of albedos, columns of radii; low, high the first and last x [mfp]."""

    rows: int = 65
    columns: int = 111
    low: float = 1e-4
    high: float = 1e4


GRID = TableGrid()
LIGHTS = ("searchlight", "diffuse")


@lru_cache(maxsize=len(LIGHTS))
def baked(illumination: str, grid: TableGrid = GRID) -> str:
    """A / alpha (rows,), then both tables (rows, columns): float32, little-endian, in base64. Takes a second."""
    setting = Setting(illumination)
    s = 1.0 - (1.0 - np.linspace(0.0, 1.0, grid.rows) ** 3) ** 2
    alpha = np.maximum((1.0 - s) * (1.0 + s), LEAST_ALPHA)
    y = np.linspace(np.log(grid.low), np.log(grid.high), grid.columns)
    reflectance = np.asarray(exact.reflectance(alpha, setting))
    profile = log_profile(y, alpha, setting) - np.log(reflectance)[:, None]
    cdf = np.log(np.asarray(exact.cdf(np.exp(y), alpha[:, None], setting=setting))) - y
    numbers = np.concatenate([reflectance / alpha, profile.ravel(), cdf.ravel()])
    return base64.b64encode(numbers.astype("<f4").tobytes()).decode("ascii")


# In this order: each file uses only what comes before it, but for what runs later.
SCRIPTS = ("exact", "device", "measure", "letters", "plot", "results", "state", "controls", "ball", "main")
CHANNELS = ("red", "green", "blue")
LOWEST, HIGHEST = -2.5, 1.5  # log10 of the transport mean free path [mm] at the ends of its slider
ABOUT = (
    "Each law runs here as the source that <code>profilefit export --lang glsl-es</code> writes, on this machine's "
    "graphics processor, against the exact half space (n = 1, isotropic)."
)
MEASURES = (
    "rel: mean relative error of R<sub>d</sub> for r from 0.01 l to 99.5 % of the reflected light; ks: largest error "
    "of the cdf; edge: largest error within 3.5 l of an edge of light, as a share of A. The exact "
    "solution is a table, right to 1e-5."
)


def explorer_section(folder: Folder) -> str:
    """What goes into the page's section: laws with the records in `folder`, in a `<div class="explorer">`.

    It needs no network and no other file, works from file://, and follows the page's variables for colours, --fg, --bg,
    --muted, --line, --blue, --green and --vermilion, where there are such. RecordError on a damaged record. Seconds.
    """
    return Template(_asset("explorer.html")).substitute(
        style=_asset("explorer.css"),
        about=ABOUT,
        measures=MEASURES,
        still=still(),
        reflectances="\n".join(_slider("A", channel, 0, 1, 0.001) for channel in CHANNELS),
        paths="\n".join(_slider("l", channel, LOWEST, HIGHEST, 0.01) for channel in CHANNELS),
        data=_data(folder),
        script="\n".join(_asset(f"{name}.js") for name in SCRIPTS),
    )


def _slider(name: str, channel: str, low: float, high: float, step: float) -> str:
    here = f"explorer-{name}-{channel}"
    return (
        f'<div class="slider {channel}"><label for="{here}">{channel}</label><input type="range" id="{here}" '
        f'min="{low:g}" max="{high:g}" step="{step:g}"><output for="{here}"></output></div>'
    )


def _data(folder: Folder) -> str:
    """All that the script reads, as JSON that cannot end the element it stands in.

    The texts of laws share two thirds of their lines: each is told by the numbers of its lines.
    """
    laws = offered(folder)
    texts = "\n".join(law.text for law in laws)
    lines = {line: place for place, line in enumerate(dict.fromkeys(texts.split("\n")))}
    content = {
        "grid": asdict(GRID),
        "tables": {light: baked(light) for light in LIGHTS},
        "lines": list(lines),
        "laws": [asdict(law) | {"text": [lines[line] for line in law.text.split("\n")]} for law in laws],
        "materials": [{"name": one.name, "alpha": one.alpha, "mfp": one.mfp} for one in MATERIALS],
        "start": first(laws),
        "shaders": _shaders(),
    }
    return json.dumps(content, ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")


def _shaders() -> dict[str, str]:
    """What stands behind a law's text, by program."""
    sphere = _asset("sphere.glsl")
    alone = {name: _asset(f"{name}.frag") for name in ("values", "edge", "inside")}
    return alone | {name: sphere + _asset(f"{name}.frag") for name in ("ball", "show")}


def _asset(name: str) -> str:
    return files("profilefit.report.explorer").joinpath(name).read_text(encoding="utf-8")

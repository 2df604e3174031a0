"""The explorer as one piece of HTML: style, script, shaders, laws and the exact table, nothing beside it."""

from __future__ import annotations

import json
from dataclasses import asdict
from importlib.resources import files
from pathlib import Path
from string import Template

from profilefit.materials import MATERIALS
from profilefit.report.explorer.laws import first, offered
from profilefit.report.explorer.still import still
from profilefit.report.explorer.truth import GRID, LIGHTS, baked

# In this order: each file uses only what comes before it, but for what runs later.
SCRIPTS = ("exact", "device", "measure", "letters", "plot", "results", "state", "controls", "ball", "main")
CHANNELS = ("red", "green", "blue")
LOWEST, HIGHEST = -2.5, 1.5  # log10 of the mean free path [mm] at the ends of its slider
ABOUT = (
    "Each law runs here as the text that <code>profilefit export --lang glsl-es</code> writes, in the graphics "
    "processor at hand, against the exact half space (n = 1, isotropic)."
)
MEASURES = (
    "rel: mean relative error of R<sub>d</sub> for r from 0.01 l to 99.5 % of the light; ks: largest error of the "
    "cdf; edge: largest error within 3.5 l of an edge of light, as a share of A. The exact "
    "solution is a table, right to 1e-5."
)


def explorer_section(folder: Path) -> str:
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


def _data(folder: Path) -> str:
    """All that the script reads, as JSON that cannot end the element it stands in."""
    laws = offered(folder)
    told = {
        "grid": GRID.told(),
        "tables": {light: baked(light) for light in LIGHTS},
        "laws": [asdict(law) for law in laws],
        "materials": [{"name": one.name, "alpha": one.alpha, "mfp": one.mfp} for one in MATERIALS],
        "start": first(laws),
        "shaders": _shaders(),
    }
    return json.dumps(told, ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")


def _shaders() -> dict[str, str]:
    """What stands behind a law's text, by program."""
    sphere = _asset("sphere.glsl")
    alone = {name: _asset(f"{name}.frag") for name in ("values", "edge", "inside")}
    return alone | {name: sphere + _asset(f"{name}.frag") for name in ("ball", "show")}


def _asset(name: str) -> str:
    return files("profilefit.report.explorer").joinpath(name).read_text(encoding="utf-8")

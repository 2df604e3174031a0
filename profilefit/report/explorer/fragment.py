"""The explorer as one piece of HTML: style, script, shaders, laws and the exact tables, nothing beside it."""

from __future__ import annotations

import json
from dataclasses import asdict
from importlib.resources import files
from string import Template

from mcml_sim import Setting
from profilefit.materials import MATERIALS
from profilefit.recipes.record import Folder
from profilefit.report.explorer.exact_tables import COARSE, GRID, KNOTS, LIGHTS, baked
from profilefit.report.explorer.offered import INDICES, STEP, Offered, first, offered
from profilefit.report.explorer.still import still

# In this order: each file uses only what comes before it, but for what runs later.
SCRIPTS = ("exact", "laws", "device", "measure", "letters", "plot", "results", "state", "controls", "ball", "main")
CHANNELS = ("red", "green", "blue")
LOWEST, HIGHEST = -2.5, 1.5  # log10 of the transport mean free path [mm] at the ends of its slider
ABOUT = (
    "Each law runs here as the source that <code>profilefit export --lang glsl-es</code> writes, on this machine's "
    "graphics processor, against the exact half space, isotropic, under a surface of refractive index n. The law "
    "hazard follows n, by the source that <code>--n</code> writes; all others are of n = 1, and beside another n "
    "show what that leaves out."
)
MEASURES = (
    "rel: mean relative error of R<sub>d</sub> for r from 0.01 l to 99.5 % of the reflected light; ks: largest error "
    "of the cdf; edge: largest error within 3.5 l of an edge of light, as a share of A. The exact solution is a table, "
    "right to 1e-5 where n = 1, to 5e-4 from n = 1.1 up, and to 3e-3 between."
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
    laws = offered(folder)
    texts = [text for law in laws for text in (law.text, law.refracting.text if law.refracting else "")]
    lines = {line: place for place, line in enumerate(dict.fromkeys("\n".join(texts).split("\n")))}
    content = {
        "grids": {"matched": asdict(GRID), "refracting": asdict(COARSE)},
        "knots": KNOTS,
        "indices": INDICES,
        "tables": {light: [baked(Setting(light, n)) for n in (1.0, *KNOTS)] for light in LIGHTS},
        "lines": list(lines),
        "laws": [_told(law, lines) for law in laws],
        "materials": [{"name": one.name, "alpha": one.alpha, "mfp": one.mfp} for one in MATERIALS],
        "start": first(laws),
        "shaders": _shaders(),
    }
    return json.dumps(content, ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")


def _told(law: Offered, lines: dict[str, int]) -> dict[str, object]:
    offer = asdict(law)
    for one in (offer, offer["refracting"] or {"text": ""}):
        one["text"] = [lines[line] for line in one["text"].split("\n")]
    return offer


def _shaders() -> dict[str, str]:
    """Return what stands behind a law's text, by program."""
    sphere = _asset("sphere.glsl")
    alone = {name: _asset(f"{name}.frag") for name in ("values", "edge", "inside")}
    return alone | {name: sphere + _asset(f"{name}.frag") for name in ("ball", "show")}


def _asset(name: str) -> str:
    return files("profilefit.report.explorer").joinpath(name).read_text(encoding="utf-8")

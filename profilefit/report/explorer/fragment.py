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
import json
import re
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib import resources
from string import Template

from profilefit.materials import CHANNELS, MATERIALS
from profilefit.recipes.catalogue import LoadedLaw, find, profile_laws
from profilefit.recipes.record import Folder, Records
from profilefit.shader.emit import text_beside
from profilefit.shader.law_file import export

_asset = partial(text_beside, __name__)
# In this order: each file uses only what comes before it, but for what runs later.
SCRIPTS = ("exact", "laws", "device", "measure", "letters", "plot", "results", "state", "controls", "ball", "main")
LOWEST, HIGHEST = -2.5, 1.5  # log10 of the transport mean free path [mm] at the ends of its slider
ABOUT = (
    "Choose a material, for example skin1, or move the sliders. The balls and curves follow. Each colour channel has "
    "its own reflectance A and mean free path l."
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
    """Return the HTML of the page's section: laws with the records in `folder`, in a `<div class="explorer">`.

    It needs no network and no other file, works from file://, and follows the page's variables for colours, --fg, --bg,
    --muted, --line, --blue, --green and --vermilion, where there are such. RecordError on a damaged record. Seconds.
    """
    return Template(_asset("explorer.html")).substitute(
        style=_asset("explorer.css"),
        about=ABOUT,
        measures=MEASURES,
        still=_asset(STILL),
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

    The texts of laws share two thirds of their lines: each is stored as the numbers of its lines.
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
        "tables": tables(),
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
EXACT, STILL = "exact.bin", "still.svg"  # `python -m benchmarks.explorer_tables` makes them


@dataclass(frozen=True)
class TableGrid:
    """rows of albedos, columns of radii; low, high the first and last x [mfp]; bytes of a number."""

    rows: int
    columns: int
    bytes: int
    low: float = 1e-4
    high: float = 1e4

    @property
    def size(self) -> int:
        """Bytes of A / alpha (rows,) and of both tables (rows, columns)."""
        return self.bytes * self.rows * (1 + 2 * self.columns)


GRID, COARSE = TableGrid(65, 111, 4), TableGrid(49, 89, 3)  # coarser under a refracting interface


def tables() -> dict[str, list[str]]:
    """Return the exact tables of each light, of n = 1 and of `KNOTS`, in base64: `EXACT` as the script reads it."""
    content, found = (resources.files(__package__) / EXACT).read_bytes(), {}
    for light in LIGHTS:
        sizes = [GRID.size, *(COARSE.size for _ in KNOTS)]
        parts = [content[sum(sizes[:k]) : sum(sizes[: k + 1])] for k in range(len(sizes))]
        found[light] = [base64.b64encode(part).decode("ascii") for part in parts]
        content = content[sum(sizes) :]
    return found

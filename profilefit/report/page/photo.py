"""The page of a photograph: the medium, the spot, the fit of its rings, and the medium for a shader."""

from __future__ import annotations

from html import escape
from pathlib import Path

from mcml_sim.files.version import __version__
from mcml_sim.files.whole_file import read_whole
from profilefit.measured.photo.workflow import Photo
from profilefit.report.drawing import inline
from profilefit.report.figures.photo_figures import RINGS, SPOT
from profilefit.report.page.document import document
from profilefit.report.page.markup import command, details, element, figure, markup, paragraph
from profilefit.report.tables.photo_tables import photo_lines, photo_tables

MOST_DRAWING = 2**24  # bytes
TITLE = "A medium, by photographs of a laser spot"
LEAD = "What scatters and absorbs behind a spot of light, colour by colour, from a bracket of its photographs."
DRAWN = {
    SPOT: "The merged picture, in decades below the brightest; some of the rings, and what no exposure recorded.",
    RINGS: "Light of the rings and the fit; below, what is left over, in standard errors.",
}
SHADER = (
    "A file of functions and constants: R_d, its cdf and a sampler of any albedo and mean free path, as a blur of "
    "irradiance wants them, and after them albedo and mean free path of this medium. Another language, and the law "
    "under a pencil beam:"
)


def photo_page(found: Photo, folder: Path, text: str) -> str:
    """The page as HTML that needs no other file; `folder` holds the drawings, text is that of the shader."""
    parts = {
        "medium": ("The medium", "\n".join([*map(markup, photo_tables(found)), *map(paragraph, photo_lines(found))])),
        "spot": ("The spot", _drawing(folder, SPOT, on_paper=True)),
        "fit": ("The fit", _drawing(folder, RINGS)),
        "shader": ("For a shader", _shader(found, text)),
    }
    shots = len(found.shot.sources)
    told = f"{shots} exposure{'s' if shots != 1 else ''} from {found.shot.sources[0]} on, profilefit {__version__}."
    return document(TITLE, LEAD, told, parts)


def _drawing(folder: Path, name: str, on_paper: bool = False) -> str:
    svg = read_whole(folder / f"{name}.svg", MOST_DRAWING).decode("utf-8")
    return figure(inline(svg, name, DRAWN[name]), DRAWN[name], on_paper)


def _shader(found: Photo, text: str) -> str:
    at = f"--n {found.setting.n:g} --g {found.setting.g:g}"
    lines = command(f"profilefit export hazard-diffuse {at} --lang hlsl\nprofilefit export hazard {at}")
    shown = element("pre", element("code", escape(text)), tabindex="0")
    return paragraph(SHADER) + lines + details(f"medium.glsl, {len(text.splitlines())} lines", shown)

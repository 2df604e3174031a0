"""Files of a photograph: the medium as a shader's text, and a page of it, of the spot and of the fit."""

from __future__ import annotations

from html import escape
from pathlib import Path

import numpy as np

from mcml_sim.files.version import __version__
from mcml_sim.media.setting import Setting
from profilefit.errors import SettingError
from profilefit.measured.photo.workflow import Photo
from profilefit.recipes.catalogue import LoadedLaw, find
from profilefit.recipes.folder import fits_folder
from profilefit.report.figures.fit_figures import RINGS, SPOT
from profilefit.report.page.document import document
from profilefit.report.page.markup import command, details, element, markup, paragraph
from profilefit.report.page.sections import EvidenceFolder
from profilefit.report.tables.fit_tables import photo_lines, photo_tables
from profilefit.shader.law_file import export_medium

TITLE = "A medium, by photographs of a laser spot"
LEAD = "Scattering and absorption of a medium, colour by colour, from a bracket of photographs of a laser spot."
DRAWN = {
    SPOT: "The merged picture, in decades below the brightest; some rings, and pixels that no exposure recorded.",
    RINGS: "Light of the rings and the fit; below, the residuals in standard errors.",
}
SHADER = (
    "A file of functions and constants: R_d, its cdf and a sampler of any albedo and mean free path, as a blur of "
    "irradiance wants them, and after them albedo and mean free path of this medium. Another language, and the law "
    "under a pencil beam:"
)


def diffuse_law(setting: Setting) -> LoadedLaw:
    """Return the law for diffuse light at a medium's n and g; SettingError where there is none."""
    try:
        return find("hazard-diffuse", fits_folder(), None, setting.n, setting.g)
    except SettingError as error:
        raise SettingError(f"{error}; without --out the medium alone is measured") from None


def medium_text(photo: Photo, law: LoadedLaw) -> str:
    """Return GLSL of a law for diffuse light, and after it albedo and mean free path by colour."""
    fits = list(photo.fits.values())
    values = {
        name: np.array([[one.values[of] for one in fits], [one.errors[of] for one in fits]])
        for name, of in (("albedo", "alpha"), ("mfp", "l"))
    }
    head = [
        f"by photographs from {photo.shot.sources[0]} on, {', '.join(photo.fits)}: as alpha and mfp above",
        "mfp in mm; errors of one standard deviation",
    ]
    return export_medium(law, fits_folder(), "medium", head, values)


def photo_page(photo: Photo, folder: Path, text: str) -> str:
    """Return the page as HTML that needs no other file; `folder` holds the drawings, text is that of the shader."""
    at = f"--n {photo.setting.n:g} --g {photo.setting.g:g}"
    exports = f"profilefit export hazard-diffuse {at} --lang hlsl", f"profilefit export hazard {at}"
    drawings = EvidenceFolder(folder, fits_folder())
    head, shown = f"medium.glsl, {len(text.splitlines())} lines", element("code", escape(text))
    shown = element("pre", shown, tabindex="0")
    parts = {
        "medium": ("The medium", "\n".join([*map(markup, photo_tables(photo)), *map(paragraph, photo_lines(photo))])),
        "spot": ("The spot", drawings.drawing(SPOT, DRAWN[SPOT], on_paper=True)),
        "fit": ("The fit", drawings.drawing(RINGS, DRAWN[RINGS])),
        "shader": ("For a shader", paragraph(SHADER) + command("\n".join(exports)) + details(head, shown)),
    }
    shots = len(photo.shot.sources)
    summary = f"{shots} exposure{'s' if shots != 1 else ''} from {photo.shot.sources[0]} on, profilefit {__version__}."
    return document(TITLE, LEAD, summary, parts)

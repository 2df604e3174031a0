"""One file that holds a law: its text, every constant with its errors, and what they are constants of."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mcml_sim import __version__
from mcml_sim.setting import Setting
from profilefit import catalogue, record
from profilefit.errors import InputError, RecordError
from profilefit.inventory import PRINTED_MAP, Named
from profilefit.laws import published
from profilefit.laws.base import AlbedoLaw
from profilefit.schema import ERRORS
from profilefit.shader import emit

LANGUAGES = ("glsl", "hlsl", "glsl-es", "python", "json")
ENDINGS = {"glsl": "glsl", "hlsl": "hlsl", "glsl-es": "glsl", "python": "py", "json": "json"}
MARKS = {"python": "#"}
TARGETS = {
    "glsl": "GLSL, for after #version 330 or later",
    "glsl-es": "GLSL ES, for after #version 300 es or later",
    "hlsl": "HLSL, for shader model 4 or later",
    "python": "Python, which needs numpy",
}
TRANSLATED = {"glsl-es": "glsl"}
ES_HEAD = "precision highp float; // medium precision is float16, which the laws were not written for\n\n"
MEASURES = {"rel": "mean relative error of R_d", "ks": "error of the cdf", "inversion_error": "error in xi"}
LIGHT = {
    "searchlight": "a pencil beam along the normal (MCML's)",
    "diffuse": "diffuse, cosine-weighted light (what a blur of irradiance wants)",
}
PROFILE_NAMES = (
    ("profile(r, alpha, mfp)", "R_d [1/length^2]: 2 pi r R_d integrates to A; r and mfp in one unit, any unit"),
    ("cdf(r, alpha, mfp)", "share of the reflected light within r [-]"),
    ("sample(xi, alpha, mfp)", "radius for a uniform number xi in [0, 1)"),
    ("pdf(r, alpha, mfp)", "density of that radius [1/length]"),
    ("shape(alpha)", "all that depends on alpha only, once a material or a pixel; with it, in x = r / mfp:"),
    ("density, _cumulated, _radius, _radius_density (x or xi, shape)", ""),
    ("alpha(A)", "single-scattering albedo alpha for a total reflectance A"),
)
MAP_NAMES = (
    ("alpha(A)", "single-scattering albedo alpha for a total reflectance A"),
    ("map_reflectance(alpha)", "and back"),
)
CONVENTIONS = """\
alpha = mu_s' / (mu_s' + mu_a) is the single-scattering albedo, mfp = 1 / (mu_s' + mu_a),
A the total diffuse reflectance (the colour) under that light."""


def export(named: Named, folder: Path, lang: str = "glsl", name: str | None = None) -> str:
    """The whole file of a law or map in one of `LANGUAGES`; `folder` holds its records.

    name  what the names in it begin with, by default `emit.prefix`: two media in one shader need two
    InputError for another language, for a name that is none, or for a law that has no shader text.
    """
    if lang not in LANGUAGES:
        raise InputError(f"lang must be one of {', '.join(LANGUAGES)}, got {lang!r}")
    contents = _records(named, folder)
    if lang == "json":
        if name is not None:
            raise InputError(f"name must be left out where lang is json, which has no functions, got {name!r}")
        return json.dumps(_plain(named, contents, folder), indent=1, sort_keys=True, allow_nan=False) + "\n"
    make, start = (emit.map_text, "") if isinstance(named.law, AlbedoLaw) else (emit.law_text, "map_")
    body = make(named.law, TRANSLATED.get(lang, lang), name, _remarks(contents, start))
    mark = MARKS.get(lang, "//")
    head = "".join(f"{mark} {line}".rstrip() + "\n" for line in _head(named, contents, folder, lang, name))
    return head + "\n" + (ES_HEAD if lang == "glsl-es" else "") + body


def _records(named: Named, folder: Path) -> dict[str, dict[str, Any]]:
    """The records behind a law, by name: its own, and that of the map which normalises it."""
    names = list(named.records)
    if getattr(named.law, "albedo", None) is not None:
        names.append(catalogue.record_name(catalogue.ALBEDO_RECORD, named.setting))
    return {name: record.read(_place(folder, name)) for name in names}


def _place(folder: Path, name: str) -> Path:
    for place in (folder, catalogue.fits_folder()):
        if (path := place / f"{name}.json").exists():
            return path
    raise RecordError(f"{folder}: there is no record {name!r}; `profilefit regenerate` makes them")


def _head(named: Named, contents: Mapping[str, dict[str, Any]], folder: Path, lang: str, name: str | None) -> list[str]:
    """What a reader of the file must know, a line each."""
    is_map = isinstance(named.law, AlbedoLaw)
    kind = "map between alpha and A" if is_map else "reflectance profile of a half space"
    what = f"{named.name}, {named.constants or 'no constants'}: {kind}"
    lines = [what, TARGETS[lang], f"by profilefit {__version__}; generated, do not edit", ""]
    start = name or emit.prefix(named.law)
    lines += [f"{start}_{called:30}{text}" for called, text in (MAP_NAMES if is_map else PROFILE_NAMES)]
    lines += ["", *_setting_lines(named.setting), ""]
    for of, content in contents.items():
        lines += [f"record {of}: {content['title']}", f"  {content['equations']}", *_told_of(content)]
        lines += [f"  sha256 of the data {content['data_digest']}"] if content.get("data_digest") else []
        lines += [f"  sha256 of the record {_digest(_place(folder, of))}"]
    printed = _printed(named)
    return [*lines, f"constants as printed: {printed.source}"] if printed else lines


def _setting_lines(setting: Setting) -> list[str]:
    light = f"light: {LIGHT[setting.illumination]}"
    surface = f"surface: refractive index n = {setting.n:g}; g = {setting.g:g}, other media by reduced lengths"
    return [light, surface, *CONVENTIONS.splitlines()]


def _told_of(content: dict[str, Any]) -> list[str]:
    """Range and error of a fit."""
    fitted = content["protocol"]["albedos"]
    lines = [f"  fitted for alpha from {fitted['low']:g} to {fitted['high']:g}"]
    measured = content["quality"]["regenerated"]
    worst = [f"{text} at most {max(measured[key]):.2g}" for key, text in MEASURES.items() if key in measured]
    if "delta_A" in measured:
        worst.append(f"error of A at most {measured['delta_A']:.2g}")
    return [*lines, f"  {', '.join(worst)} (albedos that were not fitted)"]


def _remarks(contents: Mapping[str, dict[str, Any]], start: str) -> dict[str, str]:
    """The errors of each constant, in words; `start` begins the names of the map's."""
    remarks = {}
    for content in contents.values():
        before = start if content["pipeline"] == "albedo" else ""
        for name, constant in content["constants"].items():
            found = [f"{constant[key]:.2g} ({word})" for key, word in ERRORS.items() if constant.get(key) is not None]
            remarks[before + name] = "+- " + ", +- ".join(found) if found else "held"
    return remarks


def _printed(named: Named) -> Any:
    """The printed set that a law's constants are, or None."""
    law = named.name + (PRINTED_MAP if isinstance(named.law, AlbedoLaw) else "")
    return next((s for s in published.SETS if not named.records and (s.law, s.name) == (law, named.constants)), None)


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _plain(named: Named, contents: Mapping[str, dict[str, Any]], folder: Path) -> dict[str, Any]:
    """The same as data: every constant with its errors, null where a kind of error does not apply."""
    printed = _printed(named)
    law = named.law
    made = {
        "law": named.name,
        "label": named.label,
        "made_by": f"profilefit {__version__}",
        "setting": {"illumination": law.setting.illumination, "n": law.setting.n, "g": law.setting.g},
        "units": "lengths in mean free paths 1 / (mu_s' + mu_a)",
        "constants": law.constants(),
        "printed_in": printed.source if printed else None,
        "records": {name: _record_data(content, _place(folder, name)) for name, content in contents.items()},
    }
    if getattr(law, "albedo", None) is not None:
        made["map"] = {"entered": law.albedo.entered, **law.albedo.constants()}
    return made


def _record_data(content: dict[str, Any], path: Path) -> dict[str, Any]:
    errors = {name: {key: one.get(key) for key in ERRORS} for name, one in content["constants"].items()}
    kept = {key: content.get(key) for key in ("title", "equations", "data_digest", "truth")}
    fitted = {key: content["protocol"]["albedos"][key] for key in ("low", "high")}
    return {**kept, "sha256": _digest(path), "errors": errors, "fitted_alpha": fitted}

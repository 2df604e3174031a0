"""File that holds a law: its text, every constant with its errors, and what they are constants of."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from mcml_sim import __version__
from mcml_sim.media.arrays import Floats
from profilefit.errors import InputError
from profilefit.fitting.quality import MEASURES, OF_PROFILE
from profilefit.laws import published
from profilefit.laws.base import AlbedoLaw, Constants
from profilefit.recipes import catalogue, kinds
from profilefit.recipes.catalogue import LoadedLaw, not_found
from profilefit.recipes.folder import known_folder
from profilefit.recipes.record import ERRORS, Folder, Records
from profilefit.shader import emit

LANGUAGES = ("glsl", "hlsl", "glsl-es", "python", "json")
JOINING = re.compile(r"(?:\\|\?\?/|\s)+$")
TARGETS = {
    "glsl": "GLSL, for after #version 330 or later",
    "glsl-es": "GLSL ES, for after #version 300 es or later",
    "hlsl": "HLSL, for shader model 4 or later",
    "python": "Python, which needs numpy",
}
TRANSLATED = {"glsl-es": "glsl"}
ES_HEAD = "precision highp float; // medium precision is float16, which the laws were not written for\n\n"
# The exported JSON keeps its words where records have changed theirs.
EXPORTED = {"misfit_error": "discrepancy_error"}
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
    ("alpha(A)", "reduced albedo alpha for a total reflectance A"),
)
MAP_NAMES = (PROFILE_NAMES[-1], ("map_reflectance(alpha)", "and back"))
CONVENTIONS = """\
alpha = mu_s' / (mu_s' + mu_a) is the reduced albedo, mfp = 1 / (mu_s' + mu_a),
A the total diffuse reflectance (the colour) under that light."""


# By the key of a kind: the module beside this one whose `source` writes the file of what the kind's `find` returned.
SOURCES = {"law": "law_file", "albedo_map": "law_file", "stack": "stack_text", "phase": "phase_text"}


def export_subject(
    subject: str,
    lang: str = "glsl",
    name: str | None = None,
    fits: Path | None = None,
    scenes: Mapping[str, tuple[str, str]] | None = None,
    **options: Any,
) -> str:
    """Return the whole file of a record or law of any kind, or of what a scene exports.

    subject  name of a record, law or map, path of a record, or what scenes export;  lang, name  as of `export`
    fits     folder of records; None stands for ./fits and those shipped;  options  of a law, as for `catalogue.find`
    scenes   what scenes export, as `profilefit.scenes.SOURCES`
    InputError on what there is not; RecordError on a damaged record.
    """
    for kind in kinds.KINDS:
        module = import_module(f"profilefit.shader.{SOURCES[kind.key]}") if kind.key in SOURCES else kind.module
        if hasattr(module, "source") and (found := kind.find(subject, fits, **options)) is not None:
            return module.source(found, lang, name)
    for ending, (words, home) in (scenes or {}).items():
        if subject == ending or (ending.startswith(".") and subject.endswith(ending)):
            kinds.require_none(options, words, subject)
            return import_module(home).source(subject, lang, name)
    raise not_found(subject, known_folder(fits), options.get("constants"))


def source(named: LoadedLaw, lang: str = "glsl", name: str | None = None) -> str:
    """Return the whole file of a law or map as `export` does, normalised by the map beside its own record."""
    return export(named, named.folder, lang, name)


def export(named: LoadedLaw, folder: Folder, lang: str = "glsl", name: str | None = None) -> str:
    """Return the whole file of a law or map in one of `LANGUAGES`; `folder` holds the record of the map behind it.

    name  what the names in it begin with, by default `emit.prefix`: two media in one shader need two
    InputError for another language, for a name that is none, or for a law without shader source; RecordError where a
    record behind it is missing or damaged.
    """
    require_language(lang, name)
    sources = _sources(named, Records.of(folder))
    if lang == "json":
        return json_file(_plain(named, sources))
    make = emit.map_text if isinstance(named.law, AlbedoLaw) else emit.law_text
    body = make(named.law, TRANSLATED.get(lang, lang), name, _remarks(named, sources))
    return text_file(_head(named, sources, name), lang, body)


def export_medium(
    named: LoadedLaw, folder: Folder, start: str, head: Sequence[str], values: Mapping[str, Floats]
) -> str:
    """Return the GLSL file of a law, with one medium's values and their errors (2, colours) after it, as START_NAME."""
    lines = []
    for name, (each, errors) in values.items():
        kind = "float" if each.size == 1 else f"vec{each.size}"
        line = f"{kind} {start}_{name} = {kind}({', '.join(f'{one:.6g}' for one in each)});"
        lines.append(f"const {line} // +- {', '.join(f'{one:.2g}' for one in errors)}\n")
    return f"{export(named, folder, name=start)}\n{commented(head, '//')}{''.join(lines)}"


def require_language(lang: str, name: str | None) -> None:
    """Raise InputError unless it is one of `LANGUAGES`, and no name is given to JSON."""
    if lang not in LANGUAGES:
        raise InputError(f"lang must be one of {', '.join(LANGUAGES)}, got {lang!r}")
    if lang == "json" and name is not None:
        raise InputError(f"name must be left out where lang is json, which has no functions, got {name!r}")


def function_lines(start: str, names: Sequence[tuple[str, str]]) -> list[str]:
    """Return what each function gives, a line each; names (call, words), the call less what it begins with, `start`."""
    width = max(30, *(len(called) + 2 for called, _ in names))
    return [f"{start}_{called:<{width}}{words}" for called, words in names]


def json_file(content: Mapping[str, Any]) -> str:
    """Return a whole file of data, and what made it."""
    body = {**content, "made_by": f"profilefit {__version__}"}
    return json.dumps(body, indent=1, sort_keys=True, allow_nan=False) + "\n"


def text_file(head: Sequence[str], lang: str, text: str) -> str:
    """Return a whole file of a text in a language, under a head of lines (comments).

    The first two hold nothing from outside: there, a word of a comment can change how Python reads it (PEP 263).
    """
    lines = [f"by profilefit {__version__}; generated, do not edit", TARGETS[lang], "", *head]
    head_text = commented(lines, "#" if lang == "python" else "//")
    return f"{head_text}\n{ES_HEAD if lang == 'glsl-es' else ''}{text}"


def commented(lines: Iterable[str], mark: str) -> str:
    """Return lines as comments and nothing else, whatever they hold.

    Split at every kind of line break; what is not printable ASCII becomes its escape, as in a Python string, and a line
    ends in no backslash (nor its trigraph), with which a preprocessor would join the next one to it.
    """
    parts = (part for line in lines for part in (line.splitlines() or [""]))
    texts = (part.encode("unicode_escape").decode("ascii").replace("\\\\", "\\") for part in parts)
    return "".join(f"{mark} {JOINING.sub('', text)}".rstrip() + "\n" for text in texts)


@dataclass(frozen=True)
class _Source:
    """A record behind a text.

    of     "law" or "map", whose constants it holds; law itself
    spare  whether it is the shipped record of a map that the folder lacks
    """

    of: str
    law: Constants
    path: Path
    content: dict[str, Any]
    digest: str
    spare: bool


def _sources(named: LoadedLaw, records: Records) -> list[_Source]:
    """Return the records behind a law: its own, and that of the map which normalises it."""
    own = "map" if isinstance(named.law, AlbedoLaw) else "law"
    behind = [(own, named.law, path, False) for path in named.files]
    if getattr(named.law, "albedo", None) is not None:
        path = records.path_or_shipped(catalogue.ALBEDO_RECORD, named.setting)
        behind.append(("map", named.law.albedo, path, path.parent != records.folder))
    return [
        _Source(of, law, path, records.read(path, whole=True), hashlib.sha256(path.read_bytes()).hexdigest(), spare)
        for of, law, path, spare in behind
    ]


def _head(named: LoadedLaw, sources: Sequence[_Source], name: str | None) -> list[str]:
    """Return what a reader of the file must know, a line each."""
    is_map = isinstance(named.law, AlbedoLaw)
    kind = "map between alpha and A" if is_map else "reflectance profile of a half space"
    lines = [f"{named.name}, {named.constants or 'no constants'}: {kind}"]
    start = name or emit.prefix(named.law)
    lines += [f"{start}_{called:30}{text}" for called, text in (MAP_NAMES if is_map else PROFILE_NAMES)]
    setting = named.setting
    surface = f"surface: refractive index n = {setting.n:g}; g = {setting.g:g}"
    surface += ", other media by reduced lengths" if setting.is_isotropic else ""
    lines += ["", f"light: {LIGHT[setting.illumination]}", surface, *CONVENTIONS.splitlines(), ""]
    most = f"{start}_{emit.HIGHEST}"
    lines.append(f"domain, which nothing checks: alpha in [0, 1]{'' if is_map else ', r >= 0, mfp > 0, xi in [0, 1)'}")
    lines.append(f"{most} = {emit.max_reflectance(named.law):.3g}: no half space of this n reflects more")
    clamps = [f"A to [0, {most}]", *filter(None, [emit.text_of(named.law).clamps])]
    lines += [f"clamps: {'; '.join(clamps)}", ""]
    if printed := _printed(named):
        lines.append(f"constants as printed: {printed.source}")
    for source in sources:
        lines += _provenance(source)
    return lines


def _provenance(source: _Source) -> list[str]:
    """Return a record's title, equations, range, error and digests, each line after whose it is."""
    content = source.content
    lines = [f"record {source.path.stem}: {content['title']}", content["equations"]]
    if source.spare:
        lines.append("this record came with profilefit: the folder of the law's has none of this light and surface")
    fitted = content["protocol"]["albedos"]
    lines.append(f"fitted for alpha from {fitted['low']:g} to {fitted['high']:g}")
    if span := content.get("indices"):
        lines.append(f"fitted for every refractive index above {span[0]:g} up to {span[1]:g}")
    if span := content.get("cosines"):
        lines.append(f"and every mean cosine g above {span[0]:g} up to {span[1]:g}")
    measured = content["quality"]["regenerated"] | content["quality"].get("by_index", {})
    known = [MEASURES[key] for key in (*OF_PROFILE, "delta_A") if key in measured]
    if worst := [f"{one.words} at most {np.max(measured[one.name]):.2g}" for one in known]:
        lines.append(f"{', '.join(worst)} (albedos that were not fitted)")
    if content.get("data_digest"):
        lines.append(f"sha256 of the data {content['data_digest']}")
    return [f"{source.of}: {line}" for line in [*lines, f"sha256 of the record {source.digest}"]]


def _remarks(named: LoadedLaw, sources: Sequence[_Source]) -> dict[str, str]:
    """Return the errors of each constant, in words; of a profile law's map, the names begin with map_."""
    # A record may hold a part of a law's constants.
    remarks = dict.fromkeys(named.law.constant_names(), "as printed") if named.files else {}
    for source in sources:
        before = "" if source.law is named.law else "map_"
        for name, errors in text_errors(source.law, source.content).items():
            remarks[before + name] = error_remark(errors) or "held"
    return remarks


def error_remark(errors: Mapping[str, Any]) -> str:
    """Return the standard errors of a constant in words, by the keys of `ERRORS`; an empty text where it has none."""
    found = [f"{errors[key]:.2g} ({word})" for key, word in ERRORS.items() if errors.get(key) is not None]
    return "+- " + ", +- ".join(found) if found else ""


def text_errors(law: Constants, content: Mapping[str, Any]) -> dict[str, dict[str, float]]:
    """Return the standard errors of each constant of a law's text that a record holds, by the keys of `ERRORS`.

    A constant that several of the record's come to at the law's index has those of their covariance; a jackknife has
    none, so that its errors are left out there.
    """
    recorded, found = content["constants"], dict[str, dict[str, float]]()
    covariance = content.get("covariance", {})
    names = covariance.get("names", [])
    for name, slopes in law.folds().items():
        own = {one: slope for one, slope in slopes.items() if one in recorded}
        if not own:
            continue
        found[name] = {}
        for key in ERRORS:
            matrix = covariance.get(key.removesuffix("_error"))
            known = [(slope, recorded[one].get(key)) for one, slope in own.items()]
            if len(own) > 1 and matrix is not None:
                along = np.array([own.get(one, 0.0) for one in names])
                found[name][key] = float(np.sqrt(max(along @ np.array(matrix, float) @ along, 0.0)))
            elif len(own) == 1 and known[0][1] is not None:
                found[name][key] = abs(known[0][0]) * known[0][1]
    return found


def _printed(named: LoadedLaw) -> Any:
    """Return the printed set that a law's constants are, or None."""
    if named.files:
        return None
    own = named.law.entry.printed, named.constants
    return next((s for s in published.SETS if (s.law, s.name) == own), None)


def _plain(named: LoadedLaw, sources: Sequence[_Source]) -> dict[str, Any]:
    """Return the file as data: every constant with its errors, null where a kind of error does not apply."""
    printed = _printed(named)
    law = named.law
    made = {
        "law": named.name,
        "label": named.label,
        "setting": {"illumination": law.setting.illumination, "n": law.setting.n, "g": law.setting.g},
        "units": "lengths in mean free paths 1 / (mu_s' + mu_a)",
        "constants": law.text_constants(),
        "max_reflectance": emit.max_reflectance(law),
        "printed_in": printed.source if printed else None,
        "records": {source.path.stem: _record_data(source) for source in sources},
    }
    if getattr(law, "albedo", None) is not None:
        made["map"] = {"entered": law.albedo.entered, **law.albedo.text_numbers(), **law.albedo.text_constants()}
    return made


def _record_data(source: _Source) -> dict[str, Any]:
    content = source.content
    found = text_errors(source.law, content).items()
    errors = {name: {EXPORTED.get(key, key): one.get(key) for key in ERRORS} for name, one in found}
    kept = {key: content.get(key) for key in ("title", "equations", "data_digest", "truth")}
    fitted = {key: content["protocol"]["albedos"][key] for key in ("low", "high")}
    own = {"of": source.of, "sha256": source.digest, "came_with_profilefit": source.spare}
    return {**kept, **own, "errors": errors, "fitted_alpha": fitted}

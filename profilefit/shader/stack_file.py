"""One file that holds a stack: the law of its three colours, light scattered once, and what they are of."""

from __future__ import annotations

import json
import math
from typing import Any

from mcml_sim import __version__
from profilefit.materials import CHANNELS
from profilefit.recipes.schema import ERRORS
from profilefit.recipes.stack.record import StackRecord
from profilefit.shader.law_file import ES_HEAD, LIGHT, MARKS, TARGETS, TRANSLATED, commented, require_language
from profilefit.shader.stack_text import channel_numbers, single_text, stack_text

NAMES = (
    ("profile(r, channel, thickness)", "R_d [1/length^2]: 2 pi r R_d integrates to A"),
    ("cdf(r, channel, thickness)", "share of the reflected light within r [-]"),
    ("sample(xi, channel, thickness)", "radius for a uniform number xi in [0, 1)"),
    ("pdf(r, channel, thickness)", "density of that radius [1/length]: weigh by 2 pi r R_d / pdf"),
    ("total(channel, thickness)", "reflectance A [-]"),
    ("shape(channel, thickness)", "all that depends on these, once a point; with it, in x = r / mfp of layer 1:"),
    ("density, _cumulated, _radius, _radius_density (x or xi, shape)", ""),
    ("once_radiance(channel, thickness, cos_in, cos_out, turned)", "light scattered once [1/sr], exactly"),
)


def export_stack(record: StackRecord, lang: str = "glsl", name: str | None = None) -> str:
    """The whole file of a stack in one of `law_file.LANGUAGES`.

    name  what the names in it begin with, by default the record's own with underscores; InputError where that is none
    """
    require_language(lang, name)
    if lang == "json":
        return json.dumps(_plain(record), indent=1, sort_keys=True, allow_nan=False) + "\n"
    start = name or record.name.replace("-", "_")
    common = TRANSLATED.get(lang, lang)
    texts = [
        stack_text(record.laws, common, start, _remarks(record)),
        single_text(record.stack.media, common, f"{start}_once"),
    ]
    head = commented(_head(record, lang, start), MARKS.get(lang, "//"))
    return head + "\n" + (ES_HEAD if lang == "glsl-es" else "") + "\n".join(texts)


def _head(record: StackRecord, lang: str, start: str) -> list[str]:
    """What a reader of the file must know, a line each; the first two hold nothing from outside."""
    stack, content = record.stack, record.content
    lines = [f"by profilefit {__version__}; generated, do not edit", TARGETS[lang], ""]
    lines += [f"{record.name}: reflectance profile of a stack of {len(stack.names)} layers, thickness of the first"]
    lines += [f"{start}_{called:<60}{text}" for called, text in NAMES]
    lines += ["channel 0, 1, 2: red, green, blue", ""]
    lines += [f"light: {LIGHT[record.setting.illumination]}", f"refractive index n = {record.setting.n:g}"]
    lines += [f"r and thickness in {stack.unit}, coefficients in 1/{stack.unit}"]
    for number, (layer, source) in enumerate(zip(stack.layers, stack.sources, strict=True), start=1):
        d = layer["thickness"]
        thick = "infinite" if d is None else f"{d:g} {stack.unit}" + (", any as an argument" if number == 1 else "")
        coefficients = ", ".join(f"{key} {' '.join(f'{one:g}' for one in layer[key])}" for key in ("mu_a", "mu_s"))
        lines += [f"layer {number} {layer['name']}: {coefficients}, g {layer['g']:g}, {thick}", f"  source: {source}"]
    worst = content["quality"]["regenerated"]
    lines += ["", "domain, which nothing checks: r >= 0, thickness >= 0, xi in [0, 1), cosines in (0, 1]"]
    lines += [content["equations"], content["note"]]
    lines += [
        f"at thicknesses that were not fitted: rel at most {max(worst['rel']):.2g}, "
        f"ks {max(worst['ks']):.2g}, A {worst['delta_A']:.2g}"
    ]
    return [*lines, f"sha256 of the data {content['data_digest']}", f"sha256 of the record {record.digest}"]


def _remarks(record: StackRecord) -> dict[str, str]:
    """The errors of the first interface's constants, in words; deeper ones stand in the text at their thickness."""
    remarks = {}
    for channel in CHANNELS:
        for name in record.laws[0].constant_names():
            one = record.content["constants"][f"{channel}.1.{name}"]
            found = [f"{one[key]:.2g} ({ERRORS[key]})" for key in ERRORS if one.get(key) is not None]
            remarks[f"{channel}_{name}"] = "+- " + ", +- ".join(found) if found else ""
    return remarks


def _plain(record: StackRecord) -> dict[str, Any]:
    """The same as data: the numbers of its text by colour, and the record's constants with their errors."""
    kept = {key: record.content.get(key) for key in ("title", "equations", "note", "data_digest", "truth", "quality")}
    numbers = {channel: channel_numbers(law) for channel, law in zip(CHANNELS, record.laws, strict=True)}
    return {
        **kept,
        "law": "stack",
        "label": record.name,
        "made_by": f"profilefit {__version__}",
        "setting": {"illumination": record.setting.illumination, "n": record.setting.n, "g": record.setting.g},
        "unit": record.stack.unit,
        "layers": record.stack.layers,
        "numbers": {key: {k: v for k, v in one.items() if math.isfinite(v)} for key, one in numbers.items()},
        "constants": record.content["constants"],
        "half_spaces": record.content["half_spaces"],
        "sha256": record.digest,
    }

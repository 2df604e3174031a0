"""Shader source of a stack of layers: the laws of red, green and blue, and single scattering; and the file of both."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp

from mcml_sim.media.medium import Medium
from profilefit.errors import InputError
from profilefit.laws.gaussians import MediumGaussians
from profilefit.laws.stack import LayerLaw, StackLaw
from profilefit.materials import CHANNELS
from profilefit.recipes.kinds.stack import StackRecord
from profilefit.shader import emit
from profilefit.shader.emit import Numbers
from profilefit.shader.law_file import LIGHT, TRANSLATED, error_remark, json_file, require_language, text_file

NAME = "stack"
LAYER = "layer"  # of the names of the half space that every layer is
HALF_SPACES = ("hazard", "refracting_hazard")  # texts of half spaces whose shapes can be made elsewhere
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


def stack_text(
    laws: Sequence[StackLaw], lang: str = "glsl", name: str = NAME, remarks: Mapping[str, str] | None = None
) -> str:
    """Return the laws of a stack's three channels, ready to include, with the first layer's thickness as an argument.

    NAME_profile(r, channel, thickness) and what else `glsl/README.md` lists; channel 0, 1, 2 is red, green, blue.
    lang, name, remarks  as for `emit.law_text`;  InputError on laws of unlike stacks
    """
    count = _one_count(laws)
    constants: Numbers = {}
    for channel, law in zip(CHANNELS, laws, strict=True):
        constants |= {f"{channel}_{key}": value for key, value in channel_numbers(law).items()}
    common, *parts = emit.shapeless(laws[0].top.law)
    own = [one.replace(emit.PLACEHOLDER, f"{emit.PLACEHOLDER}{LAYER}_") for one in parts]
    texts = [common, *own, emit.read_text("channel"), *_layer_texts(laws), emit.read_text("stack")]
    return emit.filled(texts, name, constants, count, lang, remarks or {})


def single_text(media: Sequence[Medium], lang: str = "glsl", name: str = NAME + "_once") -> str:
    """Return single scattering in a stack, NAME_radiance(channel, thickness, cos_in, cos_out, turned) [1/sr].

    media  of red, green, blue: two layers or more, the last infinite, of one index >= that above; InputError else
    """
    index, count = _one_index(media)
    constants: Numbers = {"index": index}
    for channel, one in zip(CHANNELS, media, strict=True):
        constants[f"{channel}_rate"] = one.layers[0].mu_t
        for i, layer in enumerate(one.layers, start=1):
            constants |= {f"{channel}_scattered{i}": layer.mu_s / layer.mu_t, f"{channel}_g{i}": layer.g}
            if 1 < i < count:
                constants[f"{channel}_depth{i}"] = layer.mu_t * layer.thickness
    texts = [emit.read_text(part) for part in ("common", "channel", "single_scattering")]
    return emit.filled(texts, name, constants, count, lang, {})


def gaussians_text(sums: Sequence[MediumGaussians], lang: str = "glsl", name: str = "gaussians") -> str:
    """Return sums of as many Gaussians for red, green and blue: NAME_shape(channel), and what works on shapes.

    lang, name  as for `emit.law_text`;  InputError on sums of unlike numbers
    """
    if len(sums) != len(CHANNELS) or len({one.count() for one in sums}) > 1:
        got = ", ".join(str(one.count()) for one in sums) or "none"
        raise InputError(f"sums must be three of one number of Gaussians, of red, green and blue, got {got}")
    shapes = [_rounded(one.text_shape()) for one in sums]
    shape = _of_channel(emit.PLACEHOLDER.removesuffix("_"), "_shape", shapes)
    texts = [*emit.shapeless(sums[0]), emit.read_text("channel"), shape]
    return emit.filled(texts, name, {}, sums[0].count(), lang, {})


def export_stack(record: StackRecord, lang: str = "glsl", name: str | None = None) -> str:
    """Return the whole file of a stack in one of `law_file.LANGUAGES`.

    name  what the names in it begin with, by default the record's own with underscores; InputError where that is none
    """
    require_language(lang, name)
    if lang == "json":
        return json_file(_plain(record))
    start = name or record.name.replace("-", "_")
    common = TRANSLATED.get(lang, lang)
    # Errors of the first interface's constants: deeper ones stand in the text at their thickness.
    names = [(channel, name) for channel in CHANNELS for name in record.laws[0].constant_names()]
    errors = {f"{c}_{name}": error_remark(record.content["constants"][f"{c}.1.{name}"]) for c, name in names}
    once = single_text(record.stack.media, common, f"{start}_once")
    return text_file(_head(record, start), lang, f"{stack_text(record.laws, common, start, errors)}\n{once}")


def _head(record: StackRecord, start: str) -> list[str]:
    """Return what a reader of the file must know, a line each."""
    stack, content = record.stack, record.content
    lines = [f"{record.name}: reflectance profile of a stack of {len(stack.names)} layers, thickness of the first"]
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
    errors = f"rel at most {max(worst['rel']):.2g}, ks {max(worst['ks']):.2g}, A {worst['delta_A']:.2g}"
    lines += [content["equations"], content["note"], f"at thicknesses that were not fitted: {errors}"]
    return [*lines, f"sha256 of the data {content['data_digest']}", f"sha256 of the record {record.digest}"]


def _plain(record: StackRecord) -> dict[str, Any]:
    """Return the file as data: the numbers of its text by colour, and the record's constants with their errors."""
    kept = {key: record.content.get(key) for key in ("title", "equations", "note", "data_digest", "truth", "quality")}
    numbers = {channel: channel_numbers(law) for channel, law in zip(CHANNELS, record.laws, strict=True)}
    return {
        **kept,
        "law": "stack",
        "label": record.name,
        "setting": {"illumination": record.setting.illumination, "n": record.setting.n, "g": record.setting.g},
        "unit": record.stack.unit,
        "layers": record.stack.layers,
        "numbers": {key: {k: v for k, v in one.items() if math.isfinite(v)} for key, one in numbers.items()},
        "constants": record.content["constants"],
        "half_spaces": record.content["half_spaces"],
        "sha256": record.digest,
    }


source = export_stack


def channel_numbers(law: StackLaw) -> Numbers:
    """Return the numbers of one channel's source, lengths in mean free paths of its first layer but mfp itself."""
    unit = law.top.mfp
    with jax.enable_x64(True):
        found: Numbers = {
            "mfp": unit,
            "kappa": float(law.fading()) * unit,
            "slowest": float(law.decay()) * unit,
            "below": float(law.below.whole()),
            "open": 1.0 - law.w,
            **law.constants(),
        }
        layer: LayerLaw | StackLaw = law
        number = 1
        while isinstance(layer, StackLaw):
            found[f"scale{number}"] = unit / layer.top.mfp
            if number > 1:
                found |= {f"{key}{number}": value for key, value in _edge(layer, unit).items()}
            layer, number = layer.below, number + 1
        return {**found, f"scale{number}": unit / layer.mfp}


def _layer_texts(laws: Sequence[StackLaw]) -> list[str]:
    """Return functions that give the shapes of the layers' half spaces, numbers since no albedo changes, and choose."""
    each = [[_rounded(emit.shape_numbers(one.law, one.alpha)) for one in law.layers] for law in laws]
    prefix = f"{emit.PLACEHOLDER}{LAYER}"
    keys = list(each[0][0])
    texts = [_of_channel(prefix, str(number), layers) for number, layers in enumerate(zip(*each, strict=True), start=1)]
    differ = {key for key in keys if len({one[key] for layers in each for one in layers}) > 1}
    either = {key: f"PF_SELECT(first > 0.5, one.{key}, other.{key})" if key in differ else f"one.{key}" for key in keys}
    return [*texts, _function(prefix, f"_either(float first, {prefix}_Shape one, {prefix}_Shape other)", either)]


def _of_channel(prefix: str, name: str, shapes: Sequence[Mapping[str, str]]) -> str:

    def chosen(values: Sequence[str]) -> str:
        return values[0] if len(set(values)) == 1 else f"{emit.PLACEHOLDER}of(channel, {', '.join(values)})"

    return _function(prefix, f"{name}(float channel)", {key: chosen([one[key] for one in shapes]) for key in shapes[0]})


def _function(prefix: str, head: str, values: Mapping[str, str]) -> str:
    """Return a function that fills a shape, whose curves are structures in it."""
    curves = list(dict.fromkeys(key.partition(".")[0] for key in values if "." in key))
    lines = [f"{prefix}_Shape {prefix}{head} {{", f"    {prefix}_Shape s;"]
    lines += [f"    PfCurve {curve};" for curve in curves]
    lines += [f"    {key if '.' in key else f's.{key}'} = {value};" for key, value in values.items()]
    lines += [f"    s.{curve} = {curve};" for curve in curves]
    return "\n".join([*lines, "    return s;", "}"]) + "\n"


def _rounded(numbers: Numbers) -> dict[str, str]:
    return {key: emit.literal(float(f"{value:.{emit.DIGITS}g}")) for key, value in numbers.items()}


def _edge(law: StackLaw, unit: float) -> Numbers:
    of = law.terms()
    first, second, _ = law.shares(of)
    passed = law.top.cdf(float(of.gone))
    return {
        **{key: float(value) / unit for key, value in (("gone", of.gone), ("back", of.back), ("height", of.height))},
        **{"lost": float(of.c1), "came": float(of.c2), "rate": float(of.rate) * unit, "image": float(of.image)},
        **{"passed": float(passed), "began": float(law.below.within(jnp.asarray(of.back)))},
        **{"first": float(first), "second": float(second)},
    }


def _one_count(laws: Sequence[StackLaw]) -> int:
    """Return the number of layers of all channels; InputError unless they are alike in what a text has but once."""
    if len(laws) != len(CHANNELS) or not all(isinstance(law, StackLaw) for law in laws):
        raise InputError(f"laws must be three laws of a stack, of red, green and blue, got {_kinds(laws)}")
    settings = {replace(layer.setting, g=0.0) for law in laws for layer in law.layers}
    if len(settings) > 1:
        got = "; ".join(sorted(map(str, settings)))
        raise InputError(f"laws must be of one light and one n in all layers and channels, got {got}")
    texts = {emit.source(layer.law) for law in laws for layer in law.layers}
    if len(texts) > 1 or not texts <= set(HALF_SPACES):
        got = ", ".join(sorted(texts))
        raise InputError(f"laws must be of half spaces by one text, {' or '.join(HALF_SPACES)}, got {got}")
    return _one_number("laws", [len(law.layers) for law in laws])


def _one_index(media: Sequence[Medium]) -> tuple[float, int]:
    """Return the index over that above, and the number of layers; InputError unless all channels agree in both."""
    if len(media) != len(CHANNELS) or not all(isinstance(one, Medium) for one in media):
        raise InputError(f"media must be three media, of red, green and blue, got {_kinds(media)}")
    for one in media:
        if not one.is_half_space:
            raise InputError(f"media must have an infinite last layer, got thickness {one.layers[-1].thickness:g}")
    indices = {layer.n / one.n_above for one in media for layer in one.layers}
    if len(indices) > 1 or min(indices) < 1.0:
        got = ", ".join(f"{index:g}" for index in sorted(indices))
        raise InputError(f"media must be of one n in all layers and channels, 1 or more over that above, got {got}")
    return indices.pop(), _one_number("media", [len(one.layers) for one in media])


def _one_number(name: str, counts: Sequence[int]) -> int:
    if len(set(counts)) > 1 or counts[0] < 2:
        got = ", ".join(map(str, counts))
        raise InputError(f"{name} must have one number of layers in all channels, two or more, got {got}")
    return counts[0]


def _kinds(given: Sequence[object]) -> str:
    return ", ".join(type(one).__name__ for one in given) or "none"

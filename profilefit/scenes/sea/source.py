"""Shader sources of light in water: what a beam brings to a segment of a view ray, and the blur of a scene's water."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mcml_sim.files.whole_file import read_toml
from profilefit.errors import InputError
from profilefit.materials import CHANNELS
from profilefit.scenes.sea.law import WaterGaussians, water_gaussians
from profilefit.scenes.sea.passes import GAUSSIANS
from profilefit.scenes.sea.scene import read
from profilefit.shader import emit
from profilefit.shader.law_file import TRANSLATED, function_lines, json_file, require_language, text_file

SEGMENT, BLUR = "sea_segment", "sea_blur"  # what names begin with
OWN = "segment_"  # in the GLSL beside
SEGMENT_NAMES = (
    ("integral(c, s0, t0, m, t1)", "int_0^t1 e^{-c (s0 + m t)} e^{-c (t0 + t)} dt [length]"),
    ("between(begin, end, t1)", "the same of optical ways c (s + t) at both ends [-]"),
)
SEGMENT_NOTE = (
    "c attenuation [1/length]; s0, t0 ways of the light to the segment's begin, and from there to the eye [length]",
    "m cosine of the view ray to the beam, in [-1, 1]; t1 length of the segment; times b and the phase function it is",
    "the radiance that the segment scatters to the eye, by the beam's irradiance where the ways begin",
)
BLUR_NAMES = (
    ("unscattered(channel)", "share of a pencil beam that is not scattered [-]"),
    ("weight1(channel), ...", "share in a Gaussian [-]"),
    ("sigma1(channel), ...", "its standard deviation, across the beam [m]"),
    ("share(r, channel)", "share of the light within r [m]"),
    ("mtf(k, channel)", "contrast that is left of a pattern of angular frequency k [1/m], times its mean"),
)


def source(subject: str, lang: str = "glsl", name: str | None = None) -> str:
    """Return the whole file of the segment, or of the blur of a SEA.toml, in one of `law_file.LANGUAGES`."""
    if not subject.endswith(".toml"):
        require_language(lang, name)
        title = "what a beam of sun brings to a segment of a view ray in water, and that to the eye, per scattering"
        if lang == "json":
            equations = "e^{-c (s0 + t0)} t1 phi(c (1 + m) t1), phi(x) = (1 - e^-x) / x"
            about = {"law": "sea-segment", "title": title, "equations": equations, "note": " ".join(SEGMENT_NOTE)}
            return json_file(about)
        start = name or SEGMENT
        head = [title, *function_lines(start, SEGMENT_NAMES), "", *SEGMENT_NOTE]
        return text_file(head, lang, segment_text(TRANSLATED.get(lang, lang), start))
    content = read_toml(Path(subject))
    if (scene := content.get("scene")) != "sea":
        raise InputError(f"{subject}: scene must be sea, whose water has a text, got {scene!r}")
    world = read(subject, content).world
    depth, rates = world.depth * world.slant, world.c.tolist()
    blurs = [
        water_gaussians(omega, c * depth, world.lobes, GAUSSIANS)
        for omega, c in zip(world.omega.tolist(), rates, strict=True)
    ]
    return export_blur(blurs, rates, depth, lang, name)


def segment_text(lang: str = "glsl", name: str = SEGMENT) -> str:
    """Return NAME_integral(c, s0, t0, m, t1) and NAME_between(begin, end, t1), ready to include.

    lang, name  as for `emit.law_text`
    """
    own = emit.text_beside(__name__, "glsl/segment.glsl").replace(OWN, emit.PLACEHOLDER)
    return emit.filled([emit.read_text("common"), emit.read_text("near_zero"), own], name, {}, 0, lang, {})


def blur_text(blurs: Sequence[WaterGaussians], c: Sequence[float], lang: str = "glsl", name: str = BLUR) -> str:
    """Return sums of as many Gaussians for red, green and blue, ready to include: `BLUR_NAMES`.

    c  attenuations [1/m];  lang, name  as for `emit.law_text`;  InputError on sums of unlike numbers
    """
    if len(blurs) != len(CHANNELS) or len(c) != len(CHANNELS) or len({one.weights.size for one in blurs}) > 1:
        told = ", ".join(str(one.weights.size) for one in blurs) or "none"
        raise InputError(f"blurs must be three of one number of Gaussians, of red, green and blue, got {told}")
    constants: dict[str, float] = {}
    for channel, one in zip(CHANNELS, _by_channel(blurs, c), strict=True):
        constants[f"{channel}_unscattered"] = one["unscattered"]
        for key in ("weight", "sigma"):
            constants |= {f"{channel}_{key}{i}": value for i, value in enumerate(one[key], start=1)}
    parts = [emit.read_text(part) for part in ("common", "channel", "sea_blur")]
    return emit.filled(parts, name, constants, blurs[0].weights.size, lang, {})


def export_blur(
    blurs: Sequence[WaterGaussians], c: Sequence[float], depth: float, lang: str = "glsl", name: str | None = None
) -> str:
    """Return the whole file of a blur; depth  along the beam [m], others as of `blur_text`."""
    require_language(lang, name)
    title = f"blur of a beam after {depth:.6g} m of water, of red, green and blue"
    worst = max(one.error for one in blurs)
    note = f"off by {worst:.2g} at most of the law's own transform, by the plane's light, at any frequency"
    if lang == "json":
        numbers = dict(zip(CHANNELS, _by_channel(blurs, c), strict=True))
        about = {"law": "sea-blur", "title": title, "note": note}
        return json_file({**about, "depth": depth, "unit": "m", "c": list(c), "numbers": numbers})
    start = name or BLUR
    rates = ", ".join(f"{one:g}" for one in c)
    head = [title, *function_lines(start, BLUR_NAMES), "channel 0, 1, 2: red, green, blue", ""]
    head += [f"attenuation of red, green, blue {rates} [1/m]", note]
    return text_file(head, lang, blur_text(blurs, c, TRANSLATED.get(lang, lang), start))


def _by_channel(blurs: Sequence[WaterGaussians], c: Sequence[float]) -> list[dict[str, Any]]:
    """Return weights [-] and standard deviations [m] of each colour."""
    found: list[dict[str, Any]] = []
    for one, rate in zip(blurs, c, strict=True):
        sigma = (np.sqrt(one.variances) / rate).tolist()
        found.append({"unscattered": float(one.unscattered), "weight": one.weights.tolist(), "sigma": sigma})
    return found

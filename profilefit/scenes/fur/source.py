"""Shader source of random cones of fur: what one hides of the skin, what is seen, where a ray comes into one."""

from __future__ import annotations

from typing import Any

from profilefit.shader import emit
from profilefit.shader.law_file import TRANSLATED, function_lines, json_file, require_language, text_file

FUR = "fur"  # what names begin with
OWN = "strand_"  # in the GLSL beside
TITLE = "random cones of fur: what they hide, their discs on shells, and where a ray comes into one"
NAMES = (
    ("shadow(radius, aside)", "area A that one hides of the skin [length^2]"),
    ("shared(radius, first, second, turn)", "area that one hides from an eye and from a lamp at once [length^2]"),
    ("visibility(density, shadow, z)", "chance that a ray meets none above z [-]"),
    ("slice(t, exponent)", "radius of its disc on a shell at t, over that of the root [-]"),
    ("swept(qx, qy, mx, my, r, k)", "how far along a ray it comes into one [length], 1e8 if it does not"),
)
NOTE = (
    "any length unit, the same for all; radius > 0 is that of the root",
    "aside >= 0 is how far from the root the tip is seen [length]: length tan(theta) of an upright cone, of one that",
    "leans |length (tan(theta) v - lean)|, v the direction of the view along the skin",
    "first and second are such asides, of an eye and of a lamp, turn the angle between them, 0 to pi [rad]: what the",
    "eye sees is lit by the visibility of a lamp's shadow less what both share",
    "density of strands [1/length^2]; z and t heights over the length, 0 at the skin, 1 at the tip; exponent > 0",
    "q is where the ray is across a cone's axis, r the cone's radius at that height [length], m and k what they change",
    "a length of ray [-]",
    "roots before the ray's begin or beyond the cone's ends are found too: leave them out",
)
EQUATIONS = (
    "A = r0^2 (pi + u - atan u), u = sqrt(max(d^2 - r0^2, 0)) / r0, d aside",
    "shared = r0^2 (pi + v - atan v), v = min(u1, u2, max(0, 1 / tan((b1 + b2 + turn) / 2))), tan b = 1 / u",
    "visibility = exp(-density A (1 - z)^2), slice = 1 - t^exponent",
    "swept = the first s of |q + m s| = r + k s where that is >= 0",
)


def strand_text(lang: str = "glsl", name: str = FUR) -> str:
    """Return five functions of floats, ready to include; any length unit, the same for all.

    NAME_shadow(radius, aside)           [length^2], of radius > 0 and aside >= 0 [length]
    NAME_shared(radius, first, second, turn)  [length^2], of asides >= 0 [length] and an angle in [0, pi] [rad]
    NAME_visibility(density, shadow, z)  [-], of a density [1/length^2] and a shadow [length^2] >= 0, z in [0, 1]
    NAME_slice(t, exponent)              [-], of t in [0, 1], exponent > 0
    NAME_swept(qx, qy, mx, my, r, k)     [length], of lengths q and r, m and k [-]; finite, 1e8 where there is no root

    lang, name  as for `emit.law_text`
    InputError on another language, and on a name that no language takes.
    """
    own = emit.text_beside(__name__, "glsl/strand.glsl").replace(OWN, emit.PLACEHOLDER)
    return emit.filled([emit.read_text("common"), own], name, {}, 0, lang, {})


def source(subject: str, lang: str = "glsl", name: str | None = None) -> str:
    """Return the whole file of cones in one of `law_file.LANGUAGES`, under a head of its functions and units.

    subject  "fur";  lang, name  and errors as of `strand_text`; InputError on a name for JSON, which has no functions.
    """
    require_language(lang, name)
    if lang == "json":
        content: dict[str, Any] = {"law": FUR, "title": TITLE, "functions": dict(NAMES)}
        return json_file({**content, "equations": "; ".join(EQUATIONS), "note": " ".join(NOTE)})
    start = name or FUR
    head = [TITLE, *function_lines(start, NAMES), "", *EQUATIONS, "", *NOTE]
    return text_file(head, lang, strand_text(TRANSLATED.get(lang, lang), start))

"""The shader text of a law: one GLSL file a law, filled with the constants of an instance.

The files in `glsl/` keep to what GLSL, HLSL and numpy can all say (see `languages`): floats, structures, straight-line
code, loops of a fixed length, a choice only as PF_SELECT. LAW_ stands for the law's prefix in each of their names, so
that several laws live in one shader. What every law gives is listed in `glsl/README.md`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

import numpy as np

from mcml_sim import single
from profilefit.errors import InputError
from profilefit.laws.base import AlbedoLaw, Constants, ProfileLaw
from profilefit.laws.burley import Burley
from profilefit.laws.hazard import Hazard
from profilefit.laws.rational import Rational
from profilefit.shader.languages import translated

Numbers = dict[str, float]
TEXTS = "profilefit.shader.glsl"
PLACEHOLDER = "LAW_"
# A block that stands once for each number: //% for 2 ... N   ...   //% end, with @i the number and @h the one before.
BLOCK = re.compile(r"^[ ]*//% for (\d+)\n(.*?)^[ ]*//% end\n", re.MULTILINE | re.DOTALL)
DIGITS = 12  # of a constant, as in the records: numpy gives a law back to them, a float32 drops what it cannot hold


@dataclass(frozen=True)
class Form:
    """How a class of laws becomes text.

    file    in `glsl/`; name its prefix, of the instance
    parts   files that it rests on, in order; extra constants that are not the law's own; count of its `//% for` blocks
    """

    file: str
    parts: tuple[str, ...] = ("rational",)
    extra: Callable[[Any], Numbers] = lambda law: {}
    count: Callable[[Any], int] = lambda law: 0


def _source(law: Any) -> Numbers:
    """The strength at the source over alpha, lim 2 pi x R_d / alpha [1/mfp]."""
    return {"source": single.source_strength(law.setting)}


FORMS: dict[type[ProfileLaw], Form] = {
    Hazard: Form("hazard", ("rational", "decay"), _source),
    Burley: Form("burley", extra=lambda law: {"power": law.power}),
}
MAPS: dict[type[AlbedoLaw], Form] = {Rational: Form("rational", ())}


def prefix(law: Constants) -> str:
    """What the names of a law's text begin with, less the underscore."""
    form = _form(law)
    count = form.count(law)
    return f"{form.file}{count}" if count else form.file


def law_text(
    law: ProfileLaw, lang: str = "glsl", name: str | None = None, told: Mapping[str, str] | None = None
) -> str:
    """The law with its constants, ready to include once: no version line, no precision line, no main.

    lang  "glsl" (also for GLSL ES, which differs only in what a shader says before it), "hlsl" or "python"
    name  the prefix of its names, `prefix(law)` by default
    told  a remark for each constant, which stands behind it
    InputError for a law that has no text.
    """
    form = _form(law)
    constants = {**_map_constants(law), **form.extra(law), **law.constants()}
    text = [_read("common"), *(_read(part) for part in form.parts), _read(form.file), _read("wrappers")]
    return _filled(text, name or prefix(law), constants, form.count(law), lang, told or {})


def map_text(law: AlbedoLaw, lang: str = "glsl", name: str | None = None, told: Mapping[str, str] | None = None) -> str:
    """The map between alpha and A: NAME_alpha(A) and NAME_map_reflectance(alpha); arguments as for `law_text`."""
    form = _form(law)
    constants = {f"map_{key}": value for key, value in {**form.extra(law), **law.constants()}.items()}
    if isinstance(law, Rational):
        constants["map_entered"] = law.entered
    remarks = {f"map_{key}": value for key, value in (told or {}).items()}
    return _filled([_read("common"), _read(form.file)], name or prefix(law), constants, 0, lang, remarks)


def stage_text(file: str) -> str:
    """A text of `glsl/stage/`, as it is."""
    return (resources.files(TEXTS) / "stage" / file).read_text(encoding="utf-8")


def _form(law: Constants) -> Form:
    for kind, form in (*FORMS.items(), *MAPS.items()):
        if isinstance(law, kind):
            return form
    has = ", ".join(kind.__name__ for kind in (*FORMS, *MAPS))
    raise InputError(f"law must be one that has a shader text ({has}), got {type(law).__name__}")


def _map_constants(law: Any) -> Numbers:
    """The constants of the map that normalises the law."""
    albedo = getattr(law, "albedo", None)
    if not isinstance(albedo, Rational):
        return {}
    return {"map_entered": albedo.entered, **{f"map_{key}": value for key, value in albedo.constants().items()}}


@cache
def _read(file: str) -> str:
    return (resources.files(TEXTS) / f"{file}.glsl").read_text(encoding="utf-8")


def _filled(texts: list[str], name: str, constants: Numbers, count: int, lang: str, told: Mapping[str, str]) -> str:
    common, *rest = texts
    lines = [_declared(name, key, value, told.get(key, "")) for key, value in constants.items()]
    body = "\n".join([common, "\n".join(lines) + "\n", *rest])
    return translated(_repeated(body, count).replace(PLACEHOLDER, f"{name}_"), lang)


def _declared(name: str, key: str, value: float, remark: str) -> str:
    return f"const float {name}_{key} = {literal(value)};" + (f" // {remark}" if remark else "")


def literal(value: float) -> str:
    """A number as every shading language reads it: with a point, without a suffix."""
    return np.format_float_scientific(value, DIGITS - 1, unique=True, trim="0") if _is_extreme(value) else _plain(value)


def _plain(value: float) -> str:
    return np.format_float_positional(value, DIGITS, unique=True, fractional=False, trim="0")


def _is_extreme(value: float) -> bool:
    return value != 0 and not 1e-4 <= abs(value) < 1e7


def _repeated(text: str, count: int) -> str:
    def each(found: re.Match[str]) -> str:
        first, body = int(found.group(1)), found.group(2)
        return "".join(body.replace("@i", str(i)).replace("@h", str(i - 1)) for i in range(first, count + 1))

    return BLOCK.sub(each, text)

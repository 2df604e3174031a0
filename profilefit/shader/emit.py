"""The shader text of a law: one GLSL file a law, filled with the constants of an instance.

The files in `glsl/` keep to what GLSL, HLSL and numpy can all say (see `languages`): floats, structures, straight-line
code, loops of a fixed length, a choice only as PF_SELECT. LAW_ stands for the law's prefix in each of their names, so
that several laws live in one shader. What every law gives is listed in `glsl/README.md`.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

import numpy as np

from mcml_sim.exact import single_scattering
from profilefit.errors import InputError
from profilefit.laws import diffusion
from profilefit.laws.base import AlbedoLaw, Constants, ProfileLaw
from profilefit.laws.beam_diffusion import BeamDiffusion
from profilefit.laws.better_dipole import BetterDipole
from profilefit.laws.burley import Burley, BurleyDiffuseMfp
from profilefit.laws.chiang import Chiang
from profilefit.laws.dipole import Dipole
from profilefit.laws.gaussians import Gaussians
from profilefit.laws.hazard import Hazard
from profilefit.laws.liang import Liang
from profilefit.laws.liang_albedo import LiangAlbedo
from profilefit.laws.quantile import Quantile
from profilefit.laws.rational import Rational
from profilefit.laws.van_de_hulst import VanDeHulst
from profilefit.shader.languages import translated

Numbers = dict[str, float]
PLACEHOLDER = "LAW_"
# A block that stands once for each number: //% for 2 ... N   ...   //% end, with @i the number and @h the one before.
BLOCK = re.compile(r"^[ ]*//% for (\d+)\n(.*?)^[ ]*//% end\n", re.MULTILINE | re.DOTALL)
# A prefix becomes part of names: GLSL keeps double underscores and gl_ for itself.
PREFIX = re.compile(r"(?!gl_|PF_|pf_|LAW\b)[A-Za-z][A-Za-z0-9]*(?:_[A-Za-z0-9]+)*")
# A second include of the same text is skipped; one of other constants under the same names would be so in silence.
GUARD = """\
#ifndef {name}_INCLUDED
#define {name}_INCLUDED {digest}
{text}
#elif {name}_INCLUDED != {digest}
#error {name} is included already, with other constants: export one of them under another name
#endif
"""
DIGITS = 12  # of a constant, as in the records: numpy gives a law back to them, a float32 drops what it cannot hold


@dataclass(frozen=True)
class Form:
    """How a class of laws becomes text.

    file    in `glsl/`; name its prefix, of the instance
    parts   files that it rests on, before it in order; ends files that rest on it
    extra   constants that are not the law's own; count of its `//% for` blocks
    clamps  what the text takes for another number than was given, in words
    """

    file: str
    parts: tuple[str, ...] = ("rational",)
    ends: tuple[str, ...] = ("wrappers",)
    extra: Callable[[Any], Numbers] = lambda law: {}
    count: Callable[[Any], int] = lambda law: 0
    clamps: str = "none"


def _source(law: Any) -> Numbers:
    """The strength at the source over alpha, lim 2 pi x R_d / alpha [1/mfp]."""
    return {"source": single_scattering.source_strength(law.setting)}


def _liang(law: Any) -> Numbers:
    """eps of the inverse [-], its root, and the largest -ln(1 + eps - xi)."""
    return {"eps": law.eps, "root": law.eps**0.5, "depth": -math.log(law.eps)}


def _gaussians(law: Any) -> Numbers:
    """ln (v_i / v_{i-1}) [-]."""
    own = law.constants()
    return {f"rise{i}": math.log1p(math.exp(own[f"v{i}"])) for i in range(2, law.count() + 1)}


def _dipole(law: Any) -> Numbers:
    """The share of the light that enters [-], and the height of the image [mfp]."""
    return {"entered": law.entered, "image": law.image}


def _better_dipole(law: Any) -> Numbers:
    """The share of the light that enters, both factors of exitance, and the image's height over D less 1 [-]."""
    c_phi, c_e, mismatch = diffusion.exitance_factors(law.setting.n)
    return {"entered": law.entered, "c_phi": c_phi, "c_e": c_e, "lift": 4.0 * mismatch}


NEAR = "R_d within 1e-6 mfp of the source to that at 1e-6 mfp; xi to 1 - 2^-24"
FAR = f"{NEAR}; r to 1e8 mfp"
TO_R_MAX = "R_d within 1e-6 mfp of the source to that at 1e-6 mfp; alpha to at least 1e-6; radii to r_max"
NORMALIZED = ("normalized_diffusion", "wrappers")
NUMERIC = ("numeric_inverse", "wrappers")
FORMS: dict[type[Any], Form] = {
    Hazard: Form("hazard", ("rational", "decay"), extra=_source, clamps=FAR),
    Quantile: Form("quantile", ("rational", "decay"), extra=_source, clamps=FAR),
    Liang: Form("liang", ("rational", "near_zero"), extra=_liang, clamps=TO_R_MAX),
    Burley: Form("burley", ends=NORMALIZED, extra=lambda law: {"power": law.power}, clamps=NEAR),
    BurleyDiffuseMfp: Form("burley_diffuse_mfp", ends=NORMALIZED, clamps=f"{NEAR}; falloff rate to 1e-7 / mfp"),
    Gaussians: Form("gaussians", extra=_gaussians, count=lambda law: law.count(), clamps=FAR),
    Dipole: Form("dipole", ("near_zero", "diffusion"), NUMERIC, _dipole, clamps=FAR),
    BetterDipole: Form("better_dipole", ("near_zero", "diffusion"), NUMERIC, _better_dipole, clamps=FAR),
}
MAPS: dict[type[Any], Form] = {
    Rational: Form("rational", (), extra=lambda law: {"entered": law.entered}, clamps="A to the light that enters"),
    LiangAlbedo: Form(
        "liang_albedo", (), extra=lambda law: {"fold": law.fold}, clamps="A to where it turns; alpha to 1"
    ),
    VanDeHulst: Form("van_de_hulst", (), clamps="both results to [0, 1]"),
    Chiang: Form("chiang", ("near_zero",), clamps="alpha to that of A = 1"),
}


def prefix(law: Constants) -> str:
    """What the names of a law's text begin with, less the underscore."""
    form = _form(law, {**FORMS, **MAPS})
    count = form.count(law)
    return f"{form.file}{count}" if count else form.file


def clamps(law: Constants) -> str:
    """What a law's text takes for another number than was given, in words."""
    return _form(law, {**FORMS, **MAPS}).clamps


def law_text(
    law: ProfileLaw, lang: str = "glsl", name: str | None = None, told: Mapping[str, str] | None = None
) -> str:
    """The law with its constants, ready to include: no version line, no precision line, no main.

    lang  "glsl" (also for GLSL ES, which differs only in what a shader says before it), "hlsl" or "python"
    name  the prefix of its names, `prefix(law)` by default
    told  a remark for each constant, which stands behind it
    InputError for a law that has no text.
    """
    form = _form(law, FORMS)
    map_constants = _map_constants(law) if "rational" in form.parts else {}
    constants = {**map_constants, **form.extra(law), **law.constants()}
    text = [_read(part) for part in ("common", *form.parts, form.file, *form.ends)]
    return _filled(text, name or prefix(law), constants, form.count(law), lang, told or {})


def map_text(law: AlbedoLaw, lang: str = "glsl", name: str | None = None, told: Mapping[str, str] | None = None) -> str:
    """The map between alpha and A: NAME_alpha(A) and NAME_map_reflectance(alpha); arguments as for `law_text`."""
    form = _form(law, MAPS)
    constants = {f"map_{key}": value for key, value in {**form.extra(law), **law.constants()}.items()}
    remarks = {f"map_{key}": value for key, value in (told or {}).items()}
    text = [_read(part) for part in ("common", *form.parts, form.file)]
    return _filled(text, name or prefix(law), constants, 0, lang, remarks)


@cache
def text_beside(module: str, file: str) -> str:
    """A text that lies in the folder of a module, or below it, as it is: text_beside(__name__, "glsl/x.frag")."""
    return (resources.files(module.rpartition(".")[0]) / file).read_text(encoding="utf-8")


def _form(law: Constants, known: Mapping[Any, Form]) -> Form:
    for kind, form in known.items():
        if isinstance(law, kind):
            return form
    if isinstance(law, BeamDiffusion):
        raise InputError(
            "law must have a closed form to become a shader, got beam_diffusion: its share within r is a quadrature "
            "of 20 by 48 nodes; better_dipole is its near relative"
        )
    has = ", ".join(kind.__name__ for kind in known)
    raise InputError(f"law must be one that has a shader text ({has}), got {type(law).__name__}")


def _map_constants(law: Any) -> Numbers:
    """The constants of the map that normalises the law."""
    albedo = getattr(law, "albedo", None)
    if not isinstance(albedo, Rational):
        raise InputError(f"albedo of {type(law).__name__} must be a Rational map to become a shader, got {albedo!r}")
    return {"map_entered": albedo.entered, **{f"map_{key}": value for key, value in albedo.constants().items()}}


def _read(file: str) -> str:
    return text_beside(__name__, f"glsl/{file}.glsl")


def _filled(texts: list[str], name: str, constants: Numbers, count: int, lang: str, told: Mapping[str, str]) -> str:
    if not PREFIX.fullmatch(name):
        raise InputError(f"name must be letters, digits and single underscores, not of gl_ or PF_, got {name!r}")
    common, *rest = texts
    lines = [_declared(name, key, value, told.get(key, "")) for key, value in constants.items()]
    own = _repeated("\n".join(["\n".join(lines) + "\n", *rest]), count).replace(PLACEHOLDER, f"{name}_")
    digest = f"0x{hashlib.sha256(own.encode()).hexdigest()[:7]}"  # a positive int in every language
    guarded = own if lang == "python" else GUARD.format(name=name, digest=digest, text=own)
    return translated(f"{common}\n{guarded}", lang)


def _declared(name: str, key: str, value: float, remark: str) -> str:
    return f"const float {name}_{key} = {literal(value)};" + (f" // {remark}" if remark else "")


def literal(value: float) -> str:
    """A number as every shading language reads it: with a point, without a suffix."""
    if not math.isfinite(value):
        raise InputError(f"constants of a shader must be finite, got {value!r}")
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

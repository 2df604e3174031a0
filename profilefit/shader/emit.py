"""Shader source of a law: one GLSL file a law, filled with the constants of an instance.

The files in `glsl/` keep to what GLSL, HLSL and numpy can all say, besides comments: `const float NAME = ...;`,
structures of floats, functions of floats and structures, declarations with a value, assignments,
`for (int i = 0; i < N; ++i) {`, return at the end, the functions in `NUMPY`, and PF_SELECT for a choice. Numbers have a
point, and a condition is one comparison. GLSL is the text as it is, HLSL is made of it by a word, numpy line by line; a
line that is none of these is an error here, not a surprise in somebody's engine. LAW_ stands for the law's prefix in
each name, so that several laws live in one shader. What every law gives is listed in `glsl/README.md`.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Mapping
from functools import cache
from importlib import resources
from typing import Any

import jax
import numpy as np

from mcml_sim.media.arrays import require
from profilefit.errors import InputError
from profilefit.laws import map_classes, profile_classes
from profilefit.laws.base import AlbedoLaw, Constants, Normalisation, ProfileLaw, Text

Numbers = dict[str, float]
PLACEHOLDER = "LAW_"
HIGHEST = "MAX_REFLECTANCE"  # the constant that NAME_alpha clamps A to
NORMALISED = "rational"  # the part that stands for the text of the map which normalises a law
# A block that stands once for each number: //% for 2 ... N   ...   //% end, with @i the number and @h the one before;
# @n is the last one, anywhere.
BLOCK = re.compile(r"^[ ]*//% for (\d+)\n(.*?)^[ ]*//% end\n", re.MULTILINE | re.DOTALL)
# The function that makes a shape of an albedo: a text that has its shapes as numbers leaves it out.
SHAPE = re.compile(r"^//% shape\n(.*?)^//% end shape\n", re.MULTILINE | re.DOTALL)
ON_SHAPES = ("near_zero", "survival")  # parts that work on shapes, however these were made
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


def prefix(law: Constants) -> str:
    """Return what the names of a law's source begin with, less the underscore."""
    text = text_of(law)
    return f"{text.prefix or text.file}{text.count or ''}"


def source(law: Constants) -> str:
    """Return the name of a law's source: of one prefix there may be several, as where the surface refracts."""
    text = text_of(law)
    return f"{text.file}{text.count or ''}"


def law_text(
    law: ProfileLaw, lang: str = "glsl", name: str | None = None, remarks: Mapping[str, str] | None = None
) -> str:
    """Return the law with its constants, ready to include: no version line, no precision line, no main.

    lang  "glsl" (also for GLSL ES, which differs only in what a shader says before it), "hlsl" or "python"
    name  the prefix of its names, `prefix(law)` by default
    remarks  a remark for each constant, which stands behind it
    InputError for a law that has no text.
    """
    text = text_of(law, ProfileLaw)
    own, of_map = dict[str, str](), Numbers()
    if NORMALISED in text.parts:
        albedo: Any = getattr(law, "albedo", None)
        is_map = isinstance(albedo, Normalisation)
        require(is_map, f"albedo of {type(law).__name__}", "a Rational map to become a shader", albedo)
        own, of_map = {NORMALISED: text_of(albedo).file}, _prefixed(albedo)
    files = [SHAPE.sub(r"\1", read_text(own.get(part, part))) for part in ("common", *text.parts, text.file)]
    files += map(read_text, text.ends)
    constants = {HIGHEST: max_reflectance(law), **of_map, **law.text_numbers(), **law.text_constants()}
    return filled(files, name or prefix(law), constants, text.count, lang, remarks or {})


def max_reflectance(law: Constants) -> float:
    """Return the largest total reflectance A [-] that a law's source gives an albedo to, which clamps a larger A."""
    albedo = law if isinstance(law, AlbedoLaw) else getattr(law, "albedo", None)
    return albedo.reflectances.high if isinstance(albedo, AlbedoLaw) else float(law.total(1.0))  # type: ignore[attr-defined]


def shapeless(law: ProfileLaw) -> list[str]:
    """Return the part of a law's source that works on shapes made elsewhere."""
    text = text_of(law, ProfileLaw)
    needed = [part for part in text.parts if part in ON_SHAPES]
    return [SHAPE.sub("", read_text(part)) for part in ("common", *needed, text.file)]


def shape_numbers(law: ProfileLaw, alpha: float) -> Numbers:
    """Return the members of a law's shape at an albedo, in float64, by their dotted names in its text."""
    with jax.enable_x64(True):
        if (known := law.text_shape()) is not None:
            return known
    made: dict[str, Any] = {}
    exec(compile(law_text(law, "python", "law"), "law.py", "exec"), made)

    def members(shape: Any, before: str) -> Numbers:
        found: Numbers = {}
        for key, value in vars(shape).items():
            found |= members(value, f"{before}{key}.") if hasattr(value, "__dict__") else {before + key: float(value)}
        return found

    return members(made["law_shape"](alpha), "")


def map_text(
    law: AlbedoLaw, lang: str = "glsl", name: str | None = None, remarks: Mapping[str, str] | None = None
) -> str:
    """Return the map between alpha and A: NAME_alpha(A), NAME_map_reflectance(alpha); arguments as for `law_text`."""
    text = text_of(law, AlbedoLaw)
    constants = {HIGHEST: max_reflectance(law), **_prefixed(law)}
    remarks = {f"map_{key}": value for key, value in (remarks or {}).items()}
    files = [read_text(part) for part in ("common", *text.parts, text.file)]
    return filled(files, name or prefix(law), constants, 0, lang, remarks)


@cache
def text_beside(module: str, file: str) -> str:
    """Return the text of a file in the folder of a module or below it, unchanged.

    For example, `text_beside(__name__, "glsl/x.frag")`.
    """
    return (resources.files(module.rpartition(".")[0]) / file).read_text(encoding="utf-8")


def text_of(law: Constants, kind: type[Constants] = Constants) -> Text:
    """Return the source of a law of this class, a profile law or a map; InputError where it has none."""
    text = law.entry.text
    if isinstance(law, kind) and isinstance(text, Text):
        return text
    if isinstance(text, str) and text:
        raise InputError(text)
    known = [*profile_classes().items(), *map_classes().items()]
    has = ", ".join(name for name, one in known if issubclass(one, kind) and one.entry.has_text and ":" not in name)
    raise InputError(f"law must be one that has a shader source ({has}), got {type(law).__name__}")


def _prefixed(albedo: AlbedoLaw) -> Numbers:
    """Return the numbers of a map's source, but `HIGHEST`, which is the share of the light that enters."""
    every = {**albedo.text_numbers(), **albedo.text_constants()}
    return {f"map_{key}": value for key, value in every.items() if key != "entered"}


def read_text(file: str) -> str:
    """Return the content of a GLSL file of this package."""
    return text_beside(__name__, f"glsl/{file}.glsl")


def filled(texts: list[str], name: str, constants: Numbers, count: int, lang: str, remarks: Mapping[str, str]) -> str:
    """Fill texts, the first of which is `common`, with a prefix and its constants, in a language."""
    require(PREFIX.fullmatch(name), "name", "letters, digits and single underscores, not of gl_ or PF_", name)
    common, *rest = texts

    def repeated(block: re.Match[str]) -> str:
        first, body = int(block.group(1)), block.group(2)
        return "".join(body.replace("@i", str(i)).replace("@h", str(i - 1)) for i in range(first, count + 1))

    behind = {key: f" // {remark}" for key, remark in remarks.items() if remark}
    lines = [f"const float {name}_{key} = {literal(value)};{behind.get(key, '')}" for key, value in constants.items()]
    own = BLOCK.sub(repeated, "\n".join(["\n".join(lines) + "\n", *rest]))
    own = own.replace("@n", str(count)).replace(PLACEHOLDER, f"{name}_")
    digest = f"0x{hashlib.sha256(own.encode()).hexdigest()[:7]}"  # a positive int in every language
    guarded = own if lang == "python" else GUARD.format(name=name, digest=digest, text=own)
    return translated(f"{common}\n{guarded}", lang)


def literal(value: float) -> str:
    """Return a number as every shading language reads it: with a point, without a suffix."""
    require(math.isfinite(value), "constants of a shader", "finite", value)
    if value != 0 and not 1e-4 <= abs(value) < 1e7:
        return np.format_float_scientific(value, DIGITS - 1, unique=True, trim="0")
    return np.format_float_positional(value, DIGITS, unique=True, fractional=False, trim="0")


LANGUAGES = ("glsl", "hlsl", "python")
# Functions that the languages share, by their names in numpy.
NUMPY = {name: name for name in ("exp", "log", "sqrt", "abs", "sin", "cos")}
NUMPY |= {"pow": "power", "min": "minimum", "max": "maximum", "clamp": "clip", "atan": "arctan", "PF_SELECT": "where"}
COMMON = "shader source must keep to what GLSL, HLSL and numpy share"
PYTHON_HEAD = "import numpy as np\nfrom types import SimpleNamespace\n"
CALL = re.compile(r"\b(" + "|".join(NUMPY) + r")\(")
NAME = r"[A-Za-z_]\w*"
FUNCTION = re.compile(rf"{NAME} ({NAME})\((.*)\) {{$")
# Every other line that a text may hold, and its Python: the first that matches counts, and {x} is an expression.
LINES = (
    (rf"#define ({NAME}) ([\d.e+-]+)$", "{0} = {1}"),
    (r"#", ""),
    (rf"for \(int ({NAME}) = 0; \1 < ({NAME}|\d+); \+\+\1\) {{$", "for {0} in range({1}):"),
    (r"return (?P<x>.+);$", "return {x}"),
    (rf"const (?:float|bool|int) ({NAME}) = (?P<x>.+);$", "{0} = {x}"),
    (rf"(?:{NAME}_{NAME}|Pf\w+) ({NAME});$", "{0} = SimpleNamespace()"),
    (rf"(?:{NAME} )?({NAME}(?:\.{NAME})?) ([+*/-]?=) (?P<x>.+);$", "{0} {1} {x}"),
)
# What the three languages read each in its own way, or not at all: whole numbers in a quotient, say.
FOREIGN = re.compile(r"&&|\|\||[?%!\[\]^~]|(?<![\w.])(?<![\d.]e-)\d+(?![\w.])|\d[fF]\b")
# Words that HLSL keeps for itself and GLSL does not: a variable of that name gets an underscore.
HLSL_WORDS = re.compile(
    r"\b(linear|line|point|sample|triangle|half|texture|pass|matrix|vector|string|register|shared|precise|double)\b"
)
CALLED = re.compile(rf"({NAME})\(")


def translated(text: str, lang: str) -> str:
    """Translate the common text into one of `LANGUAGES`; InputError for another one, or a line that is not common."""
    require(lang in LANGUAGES, "lang", f"one of {', '.join(LANGUAGES)}", lang)
    if lang == "glsl":
        return text
    if lang == "hlsl":
        parts = (line.partition("//") for line in text.split("\n"))
        hlsl = "\n".join(HLSL_WORDS.sub(r"\1_", code) + slashes + comment for code, slashes, comment in parts)
        # A constant would else be a parameter that the application sets.
        return re.sub(r"^const ", "static const ", hlsl, flags=re.MULTILINE)
    return PYTHON_HEAD + _python(text)


def _python(text: str) -> str:
    lines, depth, structure = [], 0, False
    for code, comment in _statements(text):
        if code.startswith("struct "):
            structure = True
            lines.append(f"# {code.split()[1]}: a namespace of")
        elif structure:
            structure = not code.startswith("}")
            lines.append(f"#     {code.removeprefix('float ').rstrip(';')} {comment}".rstrip() if structure else "")
        elif code == "}":
            depth -= 1
        else:
            line = _python_line(code) if code else ""
            lines.append(("    " * depth + line + ("  " if line and comment else "") + comment).rstrip())
            depth += code.endswith("{")
    return "\n".join(lines) + "\n"


def _statements(text: str):
    """Return code and comment, a statement at a time: one that runs over several lines is joined."""
    held = ""
    for line in text.splitlines():
        code, slashes, comment = line.strip().partition("//")
        code = f"{held} {code.strip()}".strip()
        remark = f"# {comment.strip()}" if slashes else ""
        held = ""
        if code and not code.startswith("#") and code[-1] not in ";{}":
            held = code
        else:
            yield code, remark


def _python_line(code: str) -> str:
    if found := FUNCTION.match(code):
        names = [one.split()[-1] for one in found.group(2).split(",") if one.strip()]
        return f"def {found.group(1)}({', '.join(names)}):"
    for line, python in LINES:
        if found := re.match(line, code):
            return python.format(*found.groups(), x=_expression(found.groupdict().get("x", "")))
    raise InputError(f"{COMMON}, got {code!r}")


def _expression(code: str) -> str:
    foreign = {found.group() for found in FOREIGN.finditer(code)}
    foreign |= {name for name in CALLED.findall(code) if name not in NUMPY and "_" not in name}
    if foreign:
        raise InputError(f"{COMMON}, got {min(foreign)!r} in {code!r}")
    return CALL.sub(lambda found: f"np.{NUMPY[found.group(1)]}(", code)

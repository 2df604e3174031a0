"""Translation of the common text into each language: GLSL as it is, HLSL by a word, numpy line by line.

What the text may use, besides comments: `const float NAME = ...;`, structures of floats, functions of floats and
structures, declarations with a value, assignments, `for (int i = 0; i < N; ++i) {`, return at the end, the functions in
`NUMPY`, and PF_SELECT for a choice. Numbers have a point, and a condition is one comparison. A line that is
none of these is an error here, not a surprise in somebody's engine.
"""

from __future__ import annotations

import re

from profilefit.errors import InputError

LANGUAGES = ("glsl", "hlsl", "python")
NUMPY = {
    "exp": "np.exp",
    "log": "np.log",
    "sqrt": "np.sqrt",
    "pow": "np.power",
    "abs": "np.abs",
    "min": "np.minimum",
    "max": "np.maximum",
    "clamp": "np.clip",
    "sin": "np.sin",
    "cos": "np.cos",
    "atan": "np.arctan",
    "PF_SELECT": "np.where",
}
COMMON = "shader source must keep to what GLSL, HLSL and numpy share"
PYTHON_HEAD = "import numpy as np\nfrom types import SimpleNamespace\n"
CALL = re.compile(r"\b(" + "|".join(NUMPY) + r")\(")
NAME, TYPE = r"[A-Za-z_]\w*", r"(?:float|bool|int)"
CONSTANT = re.compile(rf"const {TYPE} ({NAME}) = (.+);$")
FUNCTION = re.compile(rf"{NAME} ({NAME})\((.*)\) {{$")
LOOP = re.compile(rf"for \(int ({NAME}) = 0; \1 < ({NAME}|\d+); \+\+\1\) {{$")
STRUCTURE = re.compile(rf"({NAME}_{NAME}|Pf\w+) ({NAME});$")
VALUE = re.compile(rf"(?:{NAME} )?({NAME}(?:\.{NAME})?) ([+*/-]?=) (.+);$")
RETURN = re.compile(r"return (.+);$")
DEFINE = re.compile(rf"#define ({NAME}) ([\d.e+-]+)$")
# What the three languages read each in its own way, or not at all: whole numbers in a quotient, say.
FOREIGN = re.compile(r"&&|\|\||[?%!\[\]^~]|(?<![\w.])(?<![\d.]e-)\d+(?![\w.])|\d[fF]\b")
# Words that HLSL keeps for itself and GLSL does not: a variable of that name gets an underscore.
HLSL_WORDS = re.compile(
    r"\b(linear|line|point|sample|triangle|half|texture|pass|matrix|vector|string|register|shared|precise|double)\b"
)
CALLED = re.compile(rf"({NAME})\(")


def translated(text: str, lang: str) -> str:
    """Translate the common text into one of `LANGUAGES`; InputError for another one, or a line that is not common."""
    if lang not in LANGUAGES:
        raise InputError(f"lang must be one of {', '.join(LANGUAGES)}, got {lang!r}")
    if lang == "glsl":
        return text
    if lang == "hlsl":
        return "\n".join(_hlsl_line(line) for line in text.split("\n"))
    return PYTHON_HEAD + _python(text)


def _hlsl_line(line: str) -> str:
    code, slashes, comment = line.partition("//")
    code = HLSL_WORDS.sub(r"\1_", code)
    if code.startswith("const "):  # would else be a parameter that the application sets
        code = f"static {code}"
    return code + slashes + comment


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
    if code.startswith("#"):
        found = DEFINE.match(code)
        return f"{found.group(1)} = {found.group(2)}" if found else ""
    if found := LOOP.match(code):
        return f"for {found.group(1)} in range({found.group(2)}):"
    if found := FUNCTION.match(code):
        names = [one.split()[-1] for one in found.group(2).split(",") if one.strip()]
        return f"def {found.group(1)}({', '.join(names)}):"
    if found := RETURN.match(code):
        return f"return {_expression(found.group(1))}"
    if found := CONSTANT.match(code):
        return f"{found.group(1)} = {_expression(found.group(2))}"
    if found := STRUCTURE.match(code):
        return f"{found.group(2)} = SimpleNamespace()"
    if found := VALUE.match(code):
        return f"{found.group(1)} {found.group(2)} {_expression(found.group(3))}"
    raise InputError(f"{COMMON}, got {code!r}")


def _expression(code: str) -> str:
    foreign = {found.group() for found in FOREIGN.finditer(code)}
    foreign |= {name for name in CALLED.findall(code) if name not in NUMPY and "_" not in name}
    if foreign:
        raise InputError(f"{COMMON}, got {min(foreign)!r} in {code!r}")
    return CALL.sub(lambda found: NUMPY[found.group(1)] + "(", code)

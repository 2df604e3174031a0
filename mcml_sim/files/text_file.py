"""JSON and TOML that others wrote: read up to a bound, and refused in one line where no program should go on with it.

The parsers of Python take numbers beyond floating point for infinity, and recurse as deep as brackets nest; texts may
hold halves of characters that no file can be written with; a key that stands twice in JSON is taken once.
"""

from __future__ import annotations

import json
import math
import os
import re
import tomllib
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import asdict, is_dataclass
from typing import Any

import numpy as np

from mcml_sim.errors import InputError
from mcml_sim.files.whole_file import read_whole

MOST_JSON = 2**21  # bytes; the largest file that ships, where arithmetic fails, has two fifths of it
MOST_TOML = 2**18  # a thousand layers are a third of it
MOST_LEVELS = 32  # records nest seven deep
MOST_DIGITS = 300  # of a whole number, which floating point can hold
LONG_NUMBER = re.compile(r"""(?<![\w.'"])\d[\d_]{%d,}(?![\w.'"])""" % MOST_DIGITS)  # noqa: UP031
KEY = re.compile(r"""(?:"([^"\n]*)"|([\w.-]+))\s*[:=][^"'=:]*$""")  # at the end of a text, whose value is to follow
LONGEST_BEFORE = 1000  # characters between a key and its value
# The time of tomllib goes with the square of the names in a key: a.a.a.a = 1.
LONG_KEY = re.compile(
    r"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){%d}""" % MOST_LEVELS  # noqa: UP031
)
LONGEST_SHOWN = 40  # characters of a number or key in a message
TOO_DEEP = f"tables or lists nested more than {MOST_LEVELS} deep"


def read_json(path: str | os.PathLike[str], most: int = MOST_JSON) -> Any:
    """Read a JSON file of at most so many bytes. InputError in one line, `FILE: is not JSON: ...`."""
    return _parsed(path, most, parse_json, "JSON")


def read_toml(path: str | os.PathLike[str], most: int = MOST_TOML) -> dict[str, Any]:
    """Read a TOML file of at most so many bytes. InputError in one line, `FILE: is not TOML: ...`."""
    return _parsed(path, most, parse_toml, "TOML")


def _parsed(path: str | os.PathLike[str], most: int, parse: Callable[[bytes, int], Any], kind: str) -> Any:
    content = read_whole(path, most)
    try:
        return parse(content, most)
    except ValueError as error:
        raise InputError(f"{path}: is not {kind}: {error}") from None


def parse_json(content: bytes, most: int = MOST_JSON, infinite: bool = False) -> Any:
    """Parse JSON text; ValueError in one line if it is none, or not to be trusted (see above).

    infinite  whether Infinity is a number, as Python writes it; NaN never is one
    """
    text = _text(content, most)

    def whole(literal: str) -> int:
        if len(literal) > MOST_DIGITS:
            raise _too_long(text, literal)
        return int(literal)

    def constant(name: str) -> float:
        if infinite and name == "Infinity":
            return math.inf
        raise ValueError(f"{name}, which is no number")

    try:
        value = json.loads(
            text,
            parse_float=lambda literal: _number(text, literal),
            parse_int=whole,
            parse_constant=constant,
            object_pairs_hook=_object,
        )
    except RecursionError:
        raise ValueError(TOO_DEEP) from None
    return _checked(value)


def parse_toml(content: bytes, most: int = MOST_TOML) -> dict[str, Any]:
    """Parse TOML text; ValueError in one line if it is none, or not to be trusted (see above)."""
    text = _text(content, most)
    if LONG_KEY.search(text):
        raise ValueError(TOO_DEEP)
    long = LONG_NUMBER.search(text)
    try:
        value = tomllib.loads(text, parse_float=lambda literal: _number(text, literal))
    except RecursionError:
        raise ValueError(TOO_DEEP) from None
    except ValueError as error:
        if long is None or not str(error).startswith("Exceeds the limit"):
            raise
        raise _too_long(text, long[0]) from None
    _checked(value)
    if long is not None and _has_long(value):
        raise _too_long(text, long[0])
    return value


def _text(content: bytes, most: int) -> str:
    if len(content) > most:
        raise ValueError(f"more than {most} bytes")
    return content.decode("utf-8-sig")


def _number(text: str, literal: str) -> float:
    number = float(literal)
    if math.isinf(number) and "inf" not in literal:  # TOML may say inf
        raise ValueError(f"the number {_short(literal)}, beyond floating point{_place(text, literal)}")
    return number


def _too_long(text: str, literal: str) -> ValueError:
    digits = len(literal.replace("_", "").lstrip("-"))
    return ValueError(f"a whole number of {digits} digits, of {MOST_DIGITS} at most{_place(text, literal)}")


def _place(text: str, literal: str) -> str:
    """Return the key of a number, where there is one, and the line where the number first stands in a text."""
    at = text.find(literal)
    key = KEY.search(text[max(at - LONGEST_BEFORE, 0) : at].rstrip("-+"))
    name = f", of {_short(repr(key[1] or key[2]))}" if key else ""
    return f"{name} (at line {text.count(chr(10), 0, at) + 1})"


def _has_long(value: Any) -> bool:
    """Return whether a whole number somewhere inside has more digits than floating point holds."""
    if isinstance(value, dict | list):
        return any(_has_long(inner) for inner in (value.values() if isinstance(value, dict) else value))
    return isinstance(value, int) and abs(value) >= 10**MOST_DIGITS


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        twice, _ = Counter(name for name, _ in pairs).most_common(1)[0]
        raise ValueError(f"the key {_short(repr(twice))} twice in one object")
    return table


def _checked(value: Any) -> Any:
    """Return a parsed value; ValueError if it nests too deep, or has half a character."""
    level = [value]
    for _ in range(MOST_LEVELS + 1):
        inside: list[Any] = []
        for outer in level:
            if isinstance(outer, dict | list):
                inside += [*outer, *outer.values()] if isinstance(outer, dict) else outer
            elif isinstance(outer, str):
                outer.encode()  # UnicodeEncodeError is a ValueError, in one line
        if not inside:
            return value
        level = inside
    raise ValueError(TOO_DEEP)


def _short(text: str) -> str:
    return text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]}..."


ALL_DIGITS = 17  # give every float64 back


def plain(value: Any, digits: int = ALL_DIGITS) -> Any:
    """Return numbers, text, lists and dicts only; floats to so many digits; None for what is not finite."""
    if is_dataclass(value) and not isinstance(value, type):
        own = getattr(value, "as_table", None)  # of one that says itself what files have of it
        return plain(own() if callable(own) else asdict(value), digits)
    if isinstance(value, Mapping):
        return {str(key): plain(item, digits) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist(), digits)
    if isinstance(value, list | tuple):
        return [plain(item, digits) for item in value]
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(f"{value:.{digits}g}") if np.isfinite(value) else None
    if value is None or isinstance(value, str):
        return value
    return str(value)


def as_json(value: Any, ascii_only: bool = False) -> str:
    """Return JSON text as --json prints it and .json files hold it: `plain`, in the order given, and a line break."""
    return json.dumps(plain(value), indent=1, ensure_ascii=ascii_only, allow_nan=False) + "\n"

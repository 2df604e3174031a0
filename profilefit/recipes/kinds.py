"""Kinds of values that a record may hold, each with the words that say it."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

LONGEST_TEXT = 1000  # characters; ours have 256
LONGEST_SHOWN = 60  # characters of a value in a message


def is_line(value: Any) -> bool:
    """Whether it is one line of printable text: no line break of any kind, no control character, no hidden one."""
    return isinstance(value, str) and len(value) <= LONGEST_TEXT and value.isprintable()


def is_number(value: Any) -> bool:
    """Whether it is a number that float64 can hold; true and false are none."""
    if not isinstance(value, int | float) or isinstance(value, bool):
        return False
    return abs(value) <= sys.float_info.max  # false for nan; exact for whole numbers of any size


@dataclass(frozen=True)
class Kind:
    """What a value may be: `accepts` decides, `words` say it."""

    words: str
    accepts: Callable[[Any], bool]


def _every(accepts: Callable[[Any], bool], least: int = 0) -> Callable[[Any], bool]:
    return lambda value: isinstance(value, list) and len(value) >= least and all(map(accepts, value))


def _is_measure(value: Any) -> bool:
    return value is None or is_number(value)


def _is_matrix(value: Any) -> bool:
    return value is None or _every(lambda row: _every(_is_measure)(row) and len(row) == len(value))(value)


TEXT = Kind(f"one line of printable text, of {LONGEST_TEXT} characters at most", is_line)
TEXTS = Kind("a list of texts", _every(is_line))
DIGEST = Kind(
    "64 hexadecimal digits", lambda value: isinstance(value, str) and bool(re.fullmatch("[0-9a-f]{64}", value))
)
NUMBER = Kind("a number", is_number)
MEASURE = Kind("a number or null", _is_measure)  # null where it is not finite
COUNT = Kind("a whole number", lambda v: isinstance(v, int) and not isinstance(v, bool) and 0 <= v < 2**63)
FLAG = Kind("true or false", lambda value: isinstance(value, bool))
TABLE = Kind("a table", lambda value: isinstance(value, dict))
LIST = Kind("a list", lambda value: isinstance(value, list))
NUMBERS = Kind("a list of numbers", _every(is_number, 1))
MEASURES = Kind("a list of numbers or nulls", _every(_is_measure))
RATIOS = Kind("a list of numbers > 0", _every(lambda value: is_number(value) and value > 0, 1))
PAIR = Kind("a list of two numbers or nulls", lambda value: _every(_is_measure)(value) and len(value) == 2)
SPAN = Kind("a list of two numbers", lambda value: _every(is_number)(value) and len(value) == 2)
HALVES = Kind("a list of pairs of numbers", _every(lambda row: _every(is_number)(row) and len(row) == 2))
MATRIX = Kind("a square matrix of numbers, or null", _is_matrix)


def shown(value: Any) -> str:
    """A value for a message: printable, and shortened."""
    try:
        text = json.dumps(value)
    except (ValueError, RecursionError, TypeError):  # Python spells no whole number beyond 4300 digits
        return f"a {type(value).__name__}"
    return text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]}..."

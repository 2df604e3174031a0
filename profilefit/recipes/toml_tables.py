"""Tables of a TOML file, checked key by key: messages name file, table and key, what was got, what is accepted."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from mcml_sim.media.checks import is_number, shown
from profilefit.errors import InputError

Table = dict[str, Any]
Range = tuple[float, float]
T = TypeVar("T")
LONGEST_TEXT = 60  # characters
LENGTHS = 1e-9, 1e9  # between which lengths have squares and ratios to compute with
MOST_ASIDE = 1e6  # ratio of the ends of a range: beyond, it is a slip of the pen


class Tables:
    """The tables of one file. `where` names a table in messages, "" the file's own keys."""

    def __init__(self, file: str, known: Mapping[str, tuple[str, ...]]) -> None:
        """Take the name of a file, and by table the keys that each may have."""
        self.file, self.keys = file, known

    def table(self, content: Table, name: str, default: Table | None = None, within: str = "") -> Table:
        """Return the table of that name, with known keys only.

        InputError where it is missing and there is no default.
        """
        value = content.get(name, default)
        where = f"{within}.{name}" if within else name
        if value is None:
            raise InputError(f"{self.file}: table [{where}] is missing")
        if not isinstance(value, dict):
            raise InputError(f"{self.file}: {where} must be a table [{where}], got {shown(value)}")
        if name in self.keys:
            self.known(where, value)
        return value

    def known(self, where: str, table: Table, accepted: tuple[str, ...] | None = None) -> None:
        """InputError on a key that is none of a table's, or of those accepted."""
        keys = accepted or self.keys[where]
        for key in table:
            if key not in keys:
                place = f"[{where}] " if where else ""
                raise InputError(f"{self.file}: {place}keys must be of {', '.join(keys)}, got {shown(key)}")

    def number(self, where: str, key: str, table: Table, default: float | None = None, most: float = math.inf) -> float:
        """Return a finite number > 0, or the default."""
        value = table.get(key, default)
        if not is_number(value) or not (value == default or math.isfinite(value)) or not 0 < value <= most:
            raise self.bad(where, key, "a number > 0" + (f" and <= {most:g}" if most < math.inf else ""), value)
        return float(value)

    def range(self, where: str, key: str, table: Table, least: float = 0.0, most: float = math.inf) -> Range:
        """Two numbers > 0, the smaller first, or one that is both."""
        value = table.get(key)
        ends: list[Any] = value if isinstance(value, list) else [value, value]
        numbers = len(ends) == 2 and all(is_number(end) for end in ends)
        if not (numbers and 0 < ends[0] <= ends[1] <= most and least <= ends[0] and ends[1] < MOST_ASIDE * ends[0]):
            limits = f" and >= {least:g}" * (least > 0) + f" and <= {most:.3g}" * (most < math.inf)
            raise self.bad(where, key, f"a number > 0{limits}, or two of them, the smaller first", value)
        return float(ends[0]), float(ends[1])

    def whole(self, where: str, key: str, table: Table, default: int, least: int, most: int) -> int:
        """Return a whole number from least to most."""
        value = table.get(key, default)
        if type(value) is not int or not least <= value <= most:
            raise self.bad(where, key, f"a whole number in {least} ... {most}", value)
        return value

    def three(
        self, where: str, key: str, table: Table, default: tuple[float, float, float], least: float, most: float
    ) -> tuple[float, float, float]:
        """Three numbers from least to most."""
        value = table.get(key, list(default))
        numbers = value if isinstance(value, list) else []
        if len(numbers) != 3 or not all(is_number(one) and least <= one <= most for one in numbers):
            raise self.bad(where, key, f"three numbers in {least:g} ... {most:g}", value)
        first, second, third = map(float, numbers)
        return first, second, third

    def sides(self, where: str, key: str, table: Table, default: tuple[int, int], most: int) -> tuple[int, int]:
        """Columns and rows [pixels]."""
        value = table.get(key, list(default))
        whole = isinstance(value, list) and len(value) == 2 and all(type(side) is int for side in value)
        if not (whole and all(1 <= side <= most for side in value)):
            raise self.bad(where, key, f"two whole numbers of pixels in 1 ... {most}", value)
        return value[0], value[1]

    def text(
        self, where: str, key: str, table: Table, default: str | None = None, accepted: tuple[str, ...] = ()
    ) -> str:
        """Return a short text, or one of those accepted."""
        value = table.get(key, default)
        text = value if isinstance(value, str) else "\n"
        if not text.isprintable() or len(text) > LONGEST_TEXT or (accepted and text not in accepted):
            words = f"one of {', '.join(accepted)}" if accepted else f"a text of {LONGEST_TEXT} characters at most"
            raise self.bad(where, key, words, value)
        return text

    def build(self, where: str, make: Callable[[], T]) -> T:
        """Return what `make` makes; where it refuses, the message says in which file and table."""
        try:
            return make()
        except InputError as error:
            raise type(error)(f"{self.file}: [{where}] {error}") from None

    def bad(self, where: str, key: str, accepted: str, value: object) -> InputError:
        """Return the error of a key's value; None stands for a missing value."""
        got = "nothing" if value is None else shown(value)
        place = f"[{where}] " if where else ""
        return InputError(f"{self.file}: {place}{key} must be {accepted}, got {got}")

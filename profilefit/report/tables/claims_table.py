"""Claims of README and guides beside what was measured: the rows that `make claims` writes in a checkout."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from html import escape
from itertools import groupby, product
from pathlib import Path
from typing import Any

from rich.console import RenderableType

from mcml_sim.files.whole_file import read_json
from mcml_sim.media.arrays import is_number, shown
from profilefit.errors import InputError
from profilefit.recipes.declared import is_line
from profilefit.report.tables.cells import row_table, significant
from profilefit.report.tables.markdown import markdown_table

FILE = "claims.json"
AT_MOST, AT_LEAST = "≤", "≥"
EXACT = "exact"  # the noise of what the same records give again to every digit


@dataclass(frozen=True)
class Claim:
    """A promised figure.

    name   what `make claims ARGS="--only NAME"` calls it;  says  what the figure is of
    value  measured, and low, high: the ends of its spread [unit];  noise  what that spread is, or what else is known
    bound  what is promised [unit]: the most (sense ≤) or the least (sense ≥);  unit  % or nothing, for a plain number
    truth  what it was held against;  command  prints it again;  date  of that [UTC, ISO 8601]
    load   processes that wanted a core in the minute before, mean [-]
    """

    name: str
    says: str
    value: float
    low: float
    high: float
    noise: str
    sense: str
    bound: float
    unit: str
    truth: str
    command: str
    date: str
    load: str

    @property
    def holds(self) -> bool:
        """Whether what was measured keeps the promise."""
        return self.value <= self.bound if self.sense == AT_MOST else self.value >= self.bound

    @property
    def cells(self) -> tuple[str, str, str, str]:
        """Texts of the claim, the promise, the measured value and its noise."""
        unit = f" {self.unit}" if self.unit else ""
        value, low, high = (significant(number, 3) for number in (self.value, self.low, self.high))
        measured = f"{value}{unit}{'' if self.holds else ' BROKEN'}"
        spread = "" if self.low == self.high else f"{low} … {high}{unit}: "
        return self.says, f"{self.sense} {self.bound:g}{unit}", measured, f"{spread}{self.noise}"


def read_claims(folder: Path) -> tuple[dict[str, Any], list[Claim]]:
    """Return the origin of the claims in `folder`, and the claims; InputError where there are none."""
    path = folder / FILE
    claims = read_json(path)
    try:
        for row, field in product(claims["rows"], fields(Claim)):
            accepted = is_line if field.type == "str" else is_number
            if not accepted(row[field.name]) or (field.name == "sense" and row["sense"] not in (AT_MOST, AT_LEAST)):
                raise ValueError(f"{field.name} {shown(row[field.name])}")
        names = [field.name for field in fields(Claim)]
        return {**claims["made"]}, [Claim(**{name: row[name] for name in names}) for row in claims["rows"]]
    except (KeyError, TypeError, ValueError) as error:
        given = f"{type(error).__name__}: {error}"
        raise InputError(f"{path}: expected what `make claims` writes, got {given}") from error


def claim_tables(claims: Sequence[Claim]) -> list[RenderableType]:
    """Return a table for each command, under its name."""
    parts: list[RenderableType] = []
    for command, group in groupby(claims, key=lambda one: one.command):
        rows = list(group)
        caption = f"held against: {rows[0].truth}; {rows[0].date}, load before {rows[0].load}"
        header = ("claim", "promised", "measured", "noise")
        parts.append(row_table(command, header, [one.cells for one in rows], caption, fold=("claim", "noise")))
    return parts


def markdown_claims(folder: Path) -> str:
    """Return all rows as one table for the documentation."""
    made, claims = read_claims(folder)
    header = ("claim", "promised", "measured", "noise", "held against", "command", "load")
    rows = [(*one.cells, one.truth, f"`{one.command}`", one.load) for one in claims]
    machine = made.get("machine") or {}
    note = f"Measured until {made.get('date')} on {machine.get('processor')} ({machine.get('cores')} cores). "
    note += "load: processes that wanted a core in the minute before the command."
    return f"{markdown_table(header, rows)}\n\n{escape(note)}"

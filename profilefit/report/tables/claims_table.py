"""Claims of README and guides with measured values: the rows that `make claims` writes in a checkout."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from html import escape
from itertools import groupby, product
from pathlib import Path
from textwrap import wrap
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
EXACT = "exact"  # the noise of a value that a repeat gives to every digit
CODE, LINE = 84, 116  # characters of a line of a page, in a command and in a paragraph


@dataclass(frozen=True)
class Claim:
    """A promised figure.

    name   its anchor, and NAME of `make claims ARGS="--only NAME"`;  subject  "title: caption" of its table
    says   measured quantity;  value  measured, low, high  ends of its spread [unit];  noise  meaning of the spread
    bound  promised limit [unit]: upper (sense ≤) or lower (sense ≥);  unit  % or nothing, for a plain number
    truth  reference;  command  prints the value;  date  of the measurement [UTC, ISO 8601]
    load   mean number of processes that waited for a core in the minute before [-]
    """

    name: str
    subject: str
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
        measured = f"{significant(self.value, 3)}{unit}{'' if self.holds else ' BROKEN'}"
        noise = f"{self.spread}: {self.noise}" if self.spread else self.noise
        return self.says, f"{self.sense} {self.bound:g}{unit}", measured, noise

    @property
    def spread(self) -> str:
        """Ends of the spread, or nothing where the value has none."""
        ends = f"{significant(self.low, 3)} … {significant(self.high, 3)} {self.unit}".strip()
        return "" if self.low == self.high else ends


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


def claim_tables(claims: Sequence[Claim], titled: bool) -> dict[str, RenderableType]:
    """Return a table for each command, by command, which is its title, too, if `titled`."""
    parts: dict[str, RenderableType] = {}
    for command in dict.fromkeys(one.command for one in claims):
        rows = [one for one in claims if one.command == command]
        caption = f"Reference: {rows[0].truth}. Measured {rows[0].date[:10]} at a load of {rows[0].load} processes."
        header = ("claim", "promised", "measured", "noise")
        parts[command] = row_table(
            command if titled else "", header, [one.cells for one in rows], caption, fold=("claim", "noise")
        )
    return parts


def markdown_claims(folder: Path) -> str:
    """Return a table for each subject, an anchor for each row, and below it the commands, folded."""
    parts = []
    for subject, group in groupby(read_claims(folder)[1], key=lambda one: one.subject):
        title, _, caption = subject.partition(": ")
        rows = list(group)
        table = markdown_table(("claim", "promised", "measured"), [one.cells[:3] for one in rows]).splitlines()
        anchors = (f'| <a id="{escape(one.name)}"></a>' for one in rows)
        table[2:] = [line.replace("| ", anchor, 1) for line, anchor in zip(table[2:], anchors, strict=True)]
        parts += [f"## {escape(title)}", f"{escape(caption)}.", "\n".join(table)]
        parts += ["<details>\n<summary>Details</summary>", *_origins(rows), "</details>"]
    return "\n\n".join(parts)


def _origins(claims: Sequence[Claim]) -> Iterator[str]:
    """Yield each command, and below it the reference, the date, the load and the spreads of its values."""
    for command, group in groupby(claims, key=lambda one: one.command):
        rows = list(group)
        yield "```\n" + " \\\n    ".join(wrap(command, CODE, break_on_hyphens=False)) + "\n```"
        lines = [f"Reference: {rows[0].truth}. Measured on {rows[0].date[:10]} at load {rows[0].load}."]
        for noise in dict.fromkeys(one.noise for one in rows if one.noise != EXACT):
            spreads = [f"`{one.name}` {one.spread}".strip() for one in rows if one.noise == noise]
            lines.append(f"{noise[:1].upper()}{noise[1:]}: {', '.join(spreads)}.")
        shown = (wrap(escape(f"- {line}", quote=False), LINE, break_on_hyphens=False) for line in lines)
        yield "\n".join("\n  ".join(parts) for parts in shown)

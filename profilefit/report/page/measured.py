"""Measurements of other commands on some machine, as far as their files are there."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mcml_sim.files.text_file import MOST_JSON, parse_json
from mcml_sim.files.whole_file import read_whole
from profilefit.errors import InputError
from profilefit.recipes import evidence
from profilefit.report.drawing import checked, inline
from profilefit.report.page.markup import command, figure, paragraph

Content = dict[str, Any]
ALL = "all"
MOST_DRAWING = 2**24  # bytes; the largest of ours has a fourteenth of it


@dataclass(frozen=True)
class EvidenceFolder:
    """A folder that `profilefit check`, `stability` and `tradeoff` wrote into with `--out`.

    records  the folder whose records the page shows
    """

    folder: Path
    records: Path

    def section(self, name: str, parts: Callable[[EvidenceFolder], Iterator[str]]) -> str:
        """Return the parts of one section; InputError where the files of `profilefit NAME` lack what it shows."""
        try:
            return "\n".join(parts(self))
        except (KeyError, TypeError, ValueError, AttributeError, OSError) as error:
            given = f"{type(error).__name__}: {error}"
            raise InputError(
                f"{self.folder / name}.json: expected what `profilefit {name} --out` writes, got {given}"
            ) from error

    def content(self, name: str) -> Content | None:
        """Return the content of `name`.json; None if there is none. InputError on a file of another kind."""
        path = self.folder / f"{name}.json"
        expected = f"{path}: expected what `profilefit {name} --out` writes"
        if not path.exists():
            return None
        try:
            content = parse_json(read_whole(path, MOST_JSON))
        except ValueError as error:
            raise InputError(f"{expected}, got: {error}") from None
        if not isinstance(content, dict) or not isinstance(content.get("made"), dict):
            raise InputError(f"{expected}, got no key 'made'")
        return content

    def drawing(self, name: str, title: str, on_paper: bool = False) -> str:
        """Return the figure `name`.svg beside it, or nothing."""
        path = self.folder / f"{name}.svg"
        if not path.exists():
            return ""
        content = read_whole(path, MOST_DRAWING)
        if len(content) > MOST_DRAWING:
            raise ValueError(f"a drawing of more than {MOST_DRAWING} bytes, {path.name}")
        return figure(inline(checked(content.decode("utf-8")), name, title), title, on_paper)

    def origin(self, content: Content) -> str:
        """Return when, where and by which command it was measured, and whether the records have changed since."""
        made = content["made"]
        machine = made.get("machine") or {}
        when = f"Measured {made.get('date')} on {machine.get('processor')} ({machine.get('cores')} cores) by"
        parts = [paragraph(when, "dim"), command(str(made.get("command")))]
        if content.get("of", ALL) != ALL:
            of = content["of"]
            listed = ", ".join(of) if isinstance(of, list) else str(of)
            parts.append(paragraph(f"Not of everything: of {listed}.", "red"))
        if evidence.stale(made, self.records):
            parts.append(paragraph("Since then records or version have changed: run it again.", "red"))
        return "\n".join(parts)


def missing(name: str) -> str:
    """Return the text for a measurement that is absent."""
    return paragraph("Not measured here. This does it:", "dim") + command(f"profilefit {name} --out evidence")

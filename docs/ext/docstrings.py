"""Docstrings as they are written here become reStructuredText.

Prose stays prose; `alpha  (m,) single-scattering albedos [-]`, a name and in a second column what it is, becomes an
entry of a list; a formula, such as S = e^{-kappa x} (1 + c x) in a line of its own, stands letter by letter.
"""

import re
from collections.abc import Iterator
from itertools import groupby
from typing import Any

from sphinx.application import Sphinx

# `dr, nr   text`: what is named, two blanks or more, what it is.
ENTRY = re.compile(r"([\w(][\w, .:*=()/-]*?)\s{2,}(\S.*)")
# `name: text`, an entry of a section.
ARGUMENT = re.compile(r"(\w+): (\S.*)")
# Wide gaps inside a line, or a line that is moved in, are set by hand: a formula or a table.
BY_HAND = re.compile(r"\S {3,}\S|^ ")
EQUATION = re.compile(r"[^`]* = [^`.;]*[\^/][^`.;]*")
SPECIAL = re.compile(r"([*|\\]|(?<=\w)_(?!\w))")


def paragraphs(lines: list[str]) -> Iterator[list[str]]:
    """The lines between blank ones."""
    for blank, group in groupby(lines, key=lambda line: not line.strip()):
        if not blank:
            yield list(group)


def restructured(lines: list[str]) -> list[str]:
    """The same as reStructuredText."""
    return [line for one in paragraphs(lines) for part in blocks(in_columns(one)) for line in (*part, "")]


def in_columns(paragraph: list[str]) -> list[str]:
    """Return a section as entries of two columns: each argument and its text, or `Returns` and what."""
    title, lines = paragraph[0], [line.removeprefix("    ") for line in paragraph[1:]]
    if title == "Args:":
        return [ARGUMENT.sub(r"\1  \2", line, count=1) if line[0] != " " else line for line in lines]
    if title in ("Returns:", "Raises:"):
        return [f"{title[:-1]}  {lines[0]}", *(f"    {line}" for line in lines[1:])]
    return paragraph


def blocks(paragraph: list[str]) -> Iterator[list[str]]:
    """A paragraph in parts of one kind: entries with the lines that go on with them, text set by hand, prose."""
    entries = [bool(ENTRY.fullmatch(line)) for line in paragraph]
    if any(entries) and not any(EQUATION.fullmatch(line) for line in paragraph):
        yield from (part for kind, part in _columns(paragraph))
    elif any(BY_HAND.search(line) for line in paragraph) or all(EQUATION.fullmatch(line) for line in paragraph):
        yield ["::", "", *(f"    {line}" for line in paragraph)]
    else:
        yield [escaped(line) for line in paragraph]


def _columns(paragraph: list[str]) -> Iterator[tuple[str, list[str]]]:
    part: list[str] = []
    for line in paragraph:
        entry = ENTRY.fullmatch(line)
        if entry:
            part += [f"**{escaped(entry[1])}**", f"    {escaped(entry[2])}"]
        elif line.startswith(" ") and part:
            part.append(f"    {escaped(line.strip())}")
        else:  # prose directly before or behind the entries
            if part:
                yield "entries", part
            yield "prose", [escaped(line)]
            part = []
    if part:
        yield "entries", part


def escaped(line: str) -> str:
    """Prose whose stars, bars and last underscores are meant; what stands in `backticks` is left alone."""
    pieces = line.split("`")
    return "`".join(piece if i % 2 else SPECIAL.sub(r"\\\1", piece) for i, piece in enumerate(pieces))


def process(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    lines[:] = restructured(lines)


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("autodoc-process-docstring", process)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

"""HTML of what the terminal prints: one table, two media."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape

from rich.console import Console, Group, RenderableType
from rich.padding import Padding
from rich.style import Style
from rich.table import Column, Table
from rich.text import Text

# Text is laid out by the browser: this console only says which letters have which style.
LETTERS = Console(file=None, color_system=None, highlight=False, markup=False)


def element(tag: str, inside: str, **attributes: str | None) -> str:
    """Return `<tag ...>inside</tag>`; `class_` stands for class, underscores for hyphens; None leaves one out."""
    given = {key: text for key, text in attributes.items() if text is not None}
    named = "".join(f' {key.rstrip("_").replace("_", "-")}="{escape(text)}"' for key, text in given.items())
    return f"<{tag}{named}>{inside}</{tag}>"


def paragraph(text: str, class_: str = "") -> str:
    """Return a paragraph of plain text."""
    return element("p", escape(text), class_=class_ or None)


def command(line: str) -> str:
    """Return a command to type."""
    return element("pre", element("code", escape(line)), class_="command", tabindex="0")


def details(summary: str, inside: str, id_: str = "", is_open: bool = False, group: str = "", class_: str = "") -> str:
    """Return a summary with content that a click opens; of a group, one is open at a time."""
    given = {"id_": id_, "name": group, "class_": class_}
    attributes = {key: text or None for key, text in given.items()}
    pane = element("div", inside, class_="pane", tabindex="0") if inside else ""
    return element("details", f"<summary>{summary}</summary>\n{pane}", open="" if is_open else None, **attributes)


def section(id_: str, title: str, parts: Iterable[str]) -> str:
    """Return a section with its heading."""
    return element("section", f"<h2>{escape(title)}</h2>\n" + "\n".join(parts), id_=id_)


def gallery(drawings: Mapping[str, str], group: str) -> str:
    """Return thumbnails by their titles: a click, or the space bar, enlarges one of them and shrinks the others."""
    shown = []
    for title, drawn in drawings.items():
        small = element("span", drawn, class_="wide paper") + element("span", escape(title), class_="dim")
        shown.append(details(small, "", group=group, class_="thumb"))
    return element("div", "\n".join(shown), class_="gallery") if shown else ""


def figure(drawn: str, title: str, on_paper: bool = False) -> str:
    """Return a drawing or picture with its title below.

    on_paper  keeps its own light colours, also on a dark page: pictures of pixels have no variables
    """
    wide = "wide paper" if on_paper else "wide"
    return element("figure", element("div", drawn, class_=wide, tabindex="0") + element("figcaption", escape(title)))


def markup(part: RenderableType) -> str:
    """Return the HTML of a text, a table, or a group of them, as `profilefit.report` makes them for the terminal."""
    if isinstance(part, str):
        return paragraph(part)
    if isinstance(part, Text):
        return element("p", _letters(part, _style(part)), class_=_classes(_style(part))) if part.plain else ""
    if isinstance(part, Padding):
        return markup(part.renderable)
    if isinstance(part, Group):
        return "\n".join(markup(one) for one in part.renderables)
    if isinstance(part, Table):
        return _table(part)
    raise TypeError(f"a report is made of texts, tables and groups, got {type(part).__name__}")


def _table(table: Table) -> str:
    rows = [_row(table.columns, [str(column.header) for column in table.columns], "th")] if table.show_header else []
    head = element("thead", "".join(rows)) if rows and any(str(column.header) for column in table.columns) else ""
    cells = zip(*(list(column.cells) for column in table.columns), strict=True)
    body = element("tbody", "\n".join(_row(table.columns, row, "td") for row in cells))
    title = element("p", escape(str(table.title)), class_="bold") if table.title else ""
    caption = element("p", escape(str(table.caption)), class_="dim") if table.caption else ""
    return title + element("div", element("table", f"{head}\n{body}"), class_="wide", tabindex="0") + caption


def _row(columns: Sequence[Column], cells: Iterable[RenderableType], tag: str) -> str:
    filled = []
    for column, cell in zip(columns, cells, strict=True):
        side = "number" if column.justify == "right" else None if column.no_wrap else "text"
        text = Text(cell) if isinstance(cell, str) else cell
        inside = _letters(text, Style.null()) if isinstance(text, Text) else markup(text)
        filled.append(element(tag, inside, class_=side))
    return element("tr", "".join(filled))


def _letters(text: Text, around: Style) -> str:
    """Return the text, each stretch with its style unless it is that of what stands around; a new line is a break."""
    own, stretches = _style(text), []
    for letters, stretch, _ in text.render(LETTERS):
        inside, style = escape(letters).replace("\n", "<br>"), stretch or own  # a text of one style names none
        classes = _classes(style) if style != around else None
        stretches.append(element("span", inside, class_=classes) if classes else inside)
    return "".join(stretches)


def _style(text: Text) -> Style:
    return text.style if isinstance(text.style, Style) else LETTERS.get_style(text.style or "none")


def _classes(style: Style) -> str | None:
    """Return class names for a style's weight and colour; None where it has neither."""
    words = [word for word in ("bold", "dim") if getattr(style, word)]
    if style.color is not None:
        words.append(style.color.name)
    return " ".join(words) or None

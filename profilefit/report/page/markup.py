"""HTML of what the terminal prints: one table, two media.

matplotlib's SVG becomes part of the page, too: text stays text, colours follow the page, no two figures share an id.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from html import escape
from itertools import groupby
from types import MappingProxyType
from xml.etree import ElementTree

from rich.console import Console, Group, RenderableType
from rich.padding import Padding
from rich.style import Style
from rich.table import Column, Table
from rich.text import Text

from profilefit.report.figures.canvas import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, RC, SKY, VERMILION, YELLOW

# Text is laid out by the browser: this console only says which letters have which style.
LETTERS = Console(file=None, color_system=None, highlight=False, markup=False)


def element(tag: str, inside: str, **attributes: str) -> str:
    """`<tag ...>inside</tag>`; `class_` stands for class, underscores for hyphens."""
    told = "".join(f' {key.rstrip("_").replace("_", "-")}="{escape(text)}"' for key, text in attributes.items())
    return f"<{tag}{told}>{inside}</{tag}>"


def paragraph(text: str, class_: str = "") -> str:
    """A paragraph of plain text."""
    return element("p", escape(text), **({"class_": class_} if class_ else {}))


def command(line: str) -> str:
    """A command to type."""
    return element("pre", element("code", escape(line)), class_="command", tabindex="0")


def details(summary: str, inside: str, id_: str = "", is_open: bool = False) -> str:
    """What a click opens."""
    given = ({"id_": id_} if id_ else {}) | ({"open": ""} if is_open else {})
    return element("details", f"<summary>{summary}</summary>\n{inside}", **given)


def section(id_: str, title: str, parts: Iterable[str]) -> str:
    """A section with its heading."""
    return element("section", f"<h2>{escape(title)}</h2>\n" + "\n".join(parts), id_=id_)


def markup(part: RenderableType) -> str:
    """The HTML of a text, a table, or a group of them, as `profilefit.report` makes them for the terminal."""
    if isinstance(part, str):
        return paragraph(part)
    if isinstance(part, Text):
        return element("p", _letters(part, _style(part)), **_classes(_style(part)))
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


def _row(columns: Iterable[Column], cells: Iterable[RenderableType], tag: str) -> str:
    filled = zip(columns, cells, strict=True)
    return element("tr", "".join(element(tag, _cell(cell), **_side(column)) for column, cell in filled))


def _side(column: Column) -> dict[str, str]:
    if column.justify == "right":
        return {"class_": "number"}
    return {} if column.no_wrap else {"class_": "text"}


def _cell(cell: RenderableType) -> str:
    if isinstance(cell, str | Text):
        return _letters(cell if isinstance(cell, Text) else Text(cell), Style.null())
    return markup(cell)


def _letters(text: Text, around: Style) -> str:
    """The text, each stretch with its style unless it is that of what stands around; a new line is a break."""
    own, stretches = _style(text), []
    for letters, stretch, _ in text.render(LETTERS):
        inside, style = escape(letters).replace("\n", "<br>"), stretch or own  # a text of one style names none
        classes = _classes(style) if style != around else {}
        stretches.append(element("span", inside, **classes) if classes else inside)
    return "".join(stretches)


def _style(text: Text) -> Style:
    return text.style if isinstance(text.style, Style) else LETTERS.get_style(text.style or "none")


def _classes(style: Style) -> dict[str, str]:
    """Class names for a style's weight and colour."""
    words = [word for word in ("bold", "dim") if getattr(style, word)]
    if style.color is not None:
        words.append(style.color.name)
    return {"class_": " ".join(words)} if words else {}


# A colour of the figures -> the page's variable for it, which has another value on a dark page.
VARIABLES = MappingProxyType(
    {
        BLACK: "fg", "#ffffff": "panel", RC["grid.color"]: "line", GREY: "muted", ORANGE: "orange", SKY: "sky",
        GREEN: "green", YELLOW: "yellow", BLUE: "blue", VERMILION: "vermilion", PURPLE: "purple",
    }
)  # fmt: skip
COLOUR = re.compile("|".join(VARIABLES), re.IGNORECASE)
BY_LETTERS = {colour.lower(): name for colour, name in VARIABLES.items()}
PLACE = re.compile(r' (?:d|x|y|points|transform)="[^"]*"')
DECIMALS = re.compile(r"(\d\.\d)\d+")  # of a place: a tenth of a point is less than a screen shows
CURVED = re.compile("[CQScqsAaHhVv]")
INVISIBLE = re.compile(r'<path [^>]*style="fill: none"[^>]*/>')  # as under the contours of a corner plot
LETTER = re.compile(r'<tspan x="([^"]*)" y="([^"]*)" style="([^"]*)">([^<]*)</tspan>')
ROW = re.compile(rf"{LETTER.pattern}(?:\s*{LETTER.pattern})+")
SVG, HREF = "{http://www.w3.org/2000/svg}", "{http://www.w3.org/1999/xlink}href"
ElementTree.register_namespace("", SVG.strip("{}"))
ElementTree.register_namespace("xlink", HREF[1:].removesuffix("}href"))
ELEMENTS = ("svg", "defs", "style", "g", "path", "image", "use", "text", "tspan", "clipPath", "rect")
ATTRIBUTES = (
    "height", "viewBox", "width", "version", "type", "id", "clip-path", "transform", "d", "style", "x", "y", HREF
)  # fmt: skip
RULE = "*{stroke-linejoin: round; stroke-linecap: butt}"
REACHING = re.compile(r"url\s*\(|[\\@<>&]|expression|script", re.IGNORECASE)
ALONE = 560  # [px] below which a figure is scrolled, not shrunk


def checked(svg: str) -> str:
    """The same drawing, if it holds what matplotlib's do and nothing else; ValueError where it does not.

    A page runs what it holds: a figure that lies in some folder may bring scripts, or load what it likes.
    """
    try:
        root = ElementTree.fromstring(svg)
    except ElementTree.ParseError as error:
        raise ValueError(f"a drawing that is not SVG: {error}") from None
    for part in list(root):
        if part.tag == f"{SVG}metadata":
            root.remove(part)
    for part in root.iter():
        tag = str(part.tag).removeprefix(SVG)
        strange = [key for key, value in part.attrib.items() if key not in ATTRIBUTES or not _is_inside(key, value)]
        if tag not in ELEMENTS or strange or (tag == "style" and part.text != RULE):
            what = f"<{tag}>" + (f" with {strange[0]}" if strange else "")
            raise ValueError(f"a drawing with what matplotlib does not write: {what}")
    return ElementTree.tostring(root, encoding="unicode")


def _is_inside(key: str, value: str) -> bool:
    """Whether a value points nowhere but into the drawing."""
    if key == HREF:
        return value.startswith(("#", "data:image/png;base64,"))
    return not REACHING.search(value.replace("url(#", ""))


def inline(svg: str, prefix: str, title: str, on_paper: bool = False) -> str:
    """A figure for a page from what matplotlib wrote.

    prefix    of every id in it; title what a screen reader says
    on_paper  keeps its own light colours, also on a dark page: pictures of pixels have no variables
    """
    body = svg[svg.index("<svg") :]
    body = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->", "", body, flags=re.DOTALL)
    body = PLACE.sub(_shortened, INVISIBLE.sub("", body))
    body = ROW.sub(_together, body)
    body = COLOUR.sub(lambda found: f"var(--{BY_LETTERS[found[0].lower()]})", _own_ids(body, prefix))
    body = re.sub(r"\s*\n\s*", " ", body).replace("> <", "><").strip()
    frame = re.search(r'viewBox="([^"]*)"', body)
    if frame is None:
        raise ValueError(f"figure {prefix!r} has no viewBox")
    head = (
        f'<svg viewBox="{frame[1]}" role="img" aria-label="{escape(title)}" fill="var(--fg)" '
        'xmlns:xlink="http://www.w3.org/1999/xlink">'
    )
    wide = "paper" if on_paper else ""
    inside = element("div", head + body[body.index(">") + 1 :], class_=f"wide {wide}".strip(), tabindex="0")
    return element("figure", f"{inside}<figcaption>{escape(title)}</figcaption>")


def _shortened(place: re.Match[str]) -> str:
    """To a tenth of a point; of straight lines only the first is announced, the others follow."""
    text = DECIMALS.sub(r"\1", place[0])
    return re.sub(r"\s*L\s*", " ", text) if text.startswith(" d=") and not CURVED.search(text) else text


def _own_ids(svg: str, prefix: str) -> str:
    """Ids that something points to, with a prefix; the others are names of matplotlib's own."""
    used = set(re.findall(r"(?:url\(|href=\")#([^)\"]+)", svg))

    def renamed(found: re.Match[str]) -> str:
        return f' id="{prefix}-{found[1]}"' if found[1] in used else ""

    svg = re.sub(r' id="([^"]*)"', renamed, svg)
    return re.sub(r"(url\(|href=\")#", rf"\1#{prefix}-", svg)


def _together(found: re.Match[str]) -> str:
    """Letters of one line and style, which mathtext places one by one, as one text, each in its place."""
    letters = [one.groups() for one in LETTER.finditer(found[0])]
    lines = groupby(letters, key=lambda one: one[1:3])
    told = []
    for (y, style), line in lines:
        row = list(line)
        places = " ".join(one[0] for one in row)
        told.append(f'<tspan x="{places}" y="{y}" style="{style}">{"".join(one[3] for one in row)}</tspan>')
    return "".join(told)

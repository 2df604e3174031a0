"""matplotlib's SVG as part of a page: text stays text, colours follow the page, no two figures share an id.

matplotlib writes five times what a browser needs. What goes here is what nobody sees: names of groups, digits beyond
a tenth of a point, points on a straight line, a style said again for each of a hundred error bars.
"""

from __future__ import annotations

import base64
import io
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from itertools import groupby
from types import MappingProxyType
from xml.etree.ElementTree import Element, ParseError, fromstring, tostring

from PIL import Image

from profilefit.report.figures.canvas import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, RC, SKY, VERMILION, YELLOW
from profilefit.report.svg_path import number, shortened

# A colour of the figures -> the page's variable for it, which has another value on a dark page.
VARIABLES = MappingProxyType(
    {
        BLACK: "--fg", "#ffffff": "--panel", RC["grid.color"]: "--line", GREY: "--muted", ORANGE: "--orange",
        SKY: "--sky", GREEN: "--green", YELLOW: "--yellow", BLUE: "--blue", VERMILION: "--vermilion",
        PURPLE: "--purple",
    }
)  # fmt: skip
SVG, HREF = "{http://www.w3.org/2000/svg}", "{http://www.w3.org/1999/xlink}href"
ELEMENTS = ("svg", "defs", "style", "g", "path", "image", "use", "text", "tspan", "clipPath", "rect")
ATTRIBUTES = (
    "height", "viewBox", "width", "version", "type", "id", "clip-path", "transform", "d", "style", "x", "y", HREF
)  # fmt: skip
RULE = "*{stroke-linejoin: round; stroke-linecap: butt}"
REACHING = re.compile(r"url\s*\(|[\\@<>&]|expression|script", re.IGNORECASE)
POINTED_AT = re.compile(r"#([^)]+)")


def checked(svg: str) -> str:
    """The same drawing, if it holds what matplotlib's do and nothing else; ValueError where it does not.

    A page runs what it holds: a figure that lies in some folder may bring scripts, or load what it likes.
    """
    try:
        root = fromstring(svg)
    except ParseError as error:
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
    return tostring(root, encoding="unicode")


def _is_inside(key: str, value: str) -> bool:
    """Whether a value points nowhere but into the drawing."""
    if key == HREF:
        return value.startswith(("#", "data:image/png;base64,"))
    return not REACHING.search(value.replace("url(#", ""))


def inline(svg: str, prefix: str, title: str, variables: Mapping[str, str] = VARIABLES) -> str:
    """The `<svg>` of a page from what matplotlib wrote.

    prefix of every id in it; title what a screen reader says; variables: colour -> the page's for it
    """
    root = fromstring(svg)
    for part in root.iter():
        part.tag = str(part.tag).removeprefix(SVG)
        if HREF in part.attrib:
            part.set("href", part.attrib.pop(HREF))
    frame = root.get("viewBox")
    if frame is None:
        raise ValueError(f"figure {prefix!r} has no viewBox")
    shapes = {one.get("id", ""): one for defs in root.iter("defs") for one in defs if one.tag == "path"}
    uses = Counter(one.get("href", "#")[1:] for one in root.iter("use"))
    drawn = _together(_plain(root, {name: one for name, one in shapes.items() if uses[name] == 1 or _is_dash(one)}))
    whole = _element("svg", {"viewBox": frame, "role": "img", "aria-label": title, "fill": "#000000"}, drawn)
    _own_ids(whole, prefix)
    colours = re.compile("|".join(variables), re.IGNORECASE)
    names = {colour.lower(): f"var({name})" for colour, name in variables.items()}
    for part in whole.iter():
        for key in ("style", "fill"):
            if key in part.attrib:
                part.set(key, colours.sub(lambda found: names[found[0].lower()], part.attrib[key]))
    return _written(whole)


DRAWING, STYLE = re.compile(r"<svg .*?</svg>", re.DOTALL), re.compile(r' style="([^"]*)"')
PLAIN = re.compile(r"(?:[\w.:;,#% -]|var\(--[\w-]+\))*")  # ends no rule of a style sheet


def classed(html: str) -> tuple[str, str]:
    """The styles that the drawings of a page share, as rules of classes; the page with these classes."""
    found = (style for drawing in DRAWING.findall(html) for style in STYLE.findall(drawing) if PLAIN.fullmatch(style))
    names = {style: f"s{place}" for place, (style, _) in enumerate(Counter(found).most_common())}
    rules = "\n".join(f".{name} {{ {style} }}" for style, name in names.items())

    def named(style: re.Match[str]) -> str:
        return f' class="{names[style[1]]}"' if style[1] in names else style[0]

    return rules, DRAWING.sub(lambda drawing: STYLE.sub(named, drawing[0]), html)


def _element(tag: str, attributes: Mapping[str, str], inside: Iterable[Element] = ()) -> Element:
    made = Element(tag, dict(attributes))
    made.extend(inside)
    return made


def _plain(node: Element, shapes: Mapping[str, Element]) -> list[Element]:
    """What is drawn below a node, without the groups that only have names.

    shapes  paths to be drawn where they are used, and not by reference
    """
    found: list[Element] = []
    for part in node:
        rest = {key: _attribute(key, value) for key, value in part.attrib.items() if key != "id"}
        rest = {key: value for key, value in rest.items() if value}
        if part.tag == "g":
            inside = _plain(part, shapes)
            if part.get("id", "").startswith("matplotlib.axis"):  # lines of the grid, then ticks, then their numbers
                inside.sort(key=lambda one: (one.tag != "path", _clip_and_style(one) if one.tag == "path" else ()))
            found += [_element("g", rest, _together(inside))] if rest and inside else inside
        elif part.tag == "use" and part.get("href", "#")[1:] in shapes:
            found.append(_drawn(part, shapes[part.get("href", "#")[1:]]))
        elif part.tag == "path":
            if part.get("style") != "fill: none":  # as under the contours of a corner plot: nobody sees it
                found.append(_element("path", rest | {"d": shortened(part.get("d", ""))}))
        elif part.tag == "defs":
            kept = [one for one in part if one.tag != "style" and one.get("id") not in shapes]
            found += [_element("defs", {}, map(_definition, kept))] if kept else []
        elif part.tag == "text":
            found.append(_text(part, rest))
        elif part.tag == "image":
            png = base64.b64decode(part.get("href", "").partition(",")[2])
            found.append(_element("image", rest | {"href": address(png)}))
        elif part.tag == "use":
            found.append(_element("use", {"href": part.get("href", "")} | rest))
    return found


def _clip_and_style(part: Element) -> tuple[str, ...]:
    """What two neighbours must share to be one: clip and style."""
    return part.get("clip-path", ""), part.get("style", "")


def _definition(part: Element) -> Element:
    """A marker, or what clips a panel: drawn often, so with one digit more."""
    names = {key: value for key, value in part.attrib.items() if key == "id"}
    if part.tag == "path":
        style = {"style": _attribute("style", part.get("style", ""))} if part.get("style") else {}
        return _element("path", names | style | {"d": shortened(part.get("d", ""), 2)})
    inside = [_element(one.tag, {key: _attribute(key, value) for key, value in one.attrib.items()}) for one in part]
    return _element(part.tag, names, inside)


def _drawn(use: Element, shape: Element) -> Element:
    """A shape where it is used."""
    place = (float(use.get("x", "0")), float(use.get("y", "0")))
    style = _styles(use.get("style", "")) | _styles(shape.get("style", ""))
    if _is_dash(shape):
        style |= {"fill": "none"}
    clip = {"clip-path": use.get("clip-path", "")} if use.get("clip-path") else {}
    return _element("path", {"style": _style(style), **clip, "d": shortened(shape.get("d", ""), place=place)})


def _is_dash(shape: Element) -> bool:
    """Whether a shape is one straight line, as a tick is."""
    return re.fullmatch(r"\s*M\s+[-\d.]+\s+[-\d.]+\s+L\s+[-\d.]+\s+[-\d.]+\s*", shape.get("d", "")) is not None


def _text(part: Element, rest: Mapping[str, str]) -> Element:
    made = _element("text", rest)
    made.text = (part.text or "") if not len(part) else ""
    lines = groupby(part, key=lambda one: (one.get("y", "0"), one.get("style", "")))
    for (y, style), line in lines:  # letters of a formula, placed one by one, as one text, each in its place
        letters = list(line)
        places = " ".join(_attribute("x", one.get("x", "0")) for one in letters)
        row = _element("tspan", {"x": places, "y": _attribute("y", y), "style": _attribute("style", style)})
        row.text = "".join(one.text or "" for one in letters)
        made.append(row)
    return made


def _styles(style: str) -> dict[str, str]:
    """Property -> value; the page says which letters."""
    said = (one.partition(":") for one in style.split(";") if one.strip())
    return {key.strip(): value.strip() for key, _, value in said if key.strip() != "font-family"}


def _style(styles: Mapping[str, str]) -> str:
    return ";".join(f"{key}:{value}" for key, value in styles.items())


def _attribute(key: str, value: str) -> str:
    """The same in fewer letters; nothing if it says nothing."""
    if key == "style":
        return _style(_styles(value))
    if key == "transform":
        value = re.sub(r"rotate\(-?0(?: [^)]*)?\)", "", value)
        return re.sub(r"-?\b\d{1,9}\.\d+(?![^()]*e)", lambda one: number(round(float(one[0]) * 100), 2), value).strip()
    if key in ("x", "y", "width", "height") and re.fullmatch(r"-?\d{1,9}\.\d+", value):
        return number(round(float(value) * 10), 1)
    return value


def _together(parts: Sequence[Element]) -> list[Element]:
    """Neighbours with one clip as a group, in it those of one style; lines of one style as one path."""
    found: list[Element] = []
    for clip, run in groupby(parts, key=lambda one: one.get("clip-path", "")):
        inside = [one for style, same in groupby(run, key=_shared) for one in _of_one_style(style, list(same))]
        if clip and len(inside) > 1:
            for one in inside:
                del one.attrib["clip-path"]
            bare = [within for one in inside for within in ([one] if one.tag != "g" or one.attrib else one)]
            inside = [_element("g", {"clip-path": clip}, bare)]
        found += inside
    return found


def _shared(part: Element) -> tuple[str, str]:
    """Tag and style of what a neighbour may share; a path through which one sees would be drawn twice."""
    return part.tag, part.get("style", "")


def _of_one_style(shared: tuple[str, str], parts: list[Element]) -> list[Element]:
    tag, style = shared
    if len(parts) == 1 or not style or "opacity" in style or tag == "g":
        return parts
    clip = {"clip-path": parts[0].get("clip-path", "")} if parts[0].get("clip-path") else {}
    if tag == "path" and _styles(style).get("fill") == "none":
        return [_element("path", {"style": style, **clip, "d": "".join(one.get("d", "") for one in parts)})]
    for one in parts:
        one.attrib.pop("style")
        one.attrib.pop("clip-path", None)
    return [_element("g", {"style": style, **clip}, parts)]


def _own_ids(root: Element, prefix: str) -> None:
    """Ids are numbers after the prefix; what nothing points at has none."""
    values = (value for one in root.iter() for key, value in one.attrib.items() if key in ("href", "clip-path"))
    used = {found[1] for value in values if (found := POINTED_AT.search(value)) and not value.startswith("data:")}
    names = {name: f"{prefix}-{place}" for place, name in enumerate(sorted(used))}
    for part in root.iter():
        if (name := part.attrib.pop("id", "")) in names:
            part.set("id", names[name])
        for key in ("href", "clip-path"):
            value = part.get(key, "")
            if (found := POINTED_AT.search(value)) and not value.startswith("data:"):
                part.set(key, value.replace(found[0], f"#{names[found[1]]}"))


def _written(part: Element) -> str:
    told = "".join(f' {key}="{escape(value)}"' for key, value in part.attrib.items())
    inside = escape(part.text or "", quote=False) + "".join(map(_written, part))
    return f"<{part.tag}{told}>{inside}</{part.tag}>" if inside or part.tag == "svg" else f"<{part.tag}{told}/>"


def address(png: bytes) -> str:
    """`data:image/webp;base64,...` of a PNG file; OSError, ValueError on what is none.

    Without loss: in a map of errors the noise is what is shown, and the sign is a colour.
    """
    file = io.BytesIO()
    try:
        with Image.open(io.BytesIO(png), formats=["png"]) as picture:
            picture.save(file, "webp", lossless=True)
    except (SyntaxError, Image.DecompressionBombError) as error:  # Pillow's words for a damaged one, and for a bomb
        raise ValueError(f"a picture that cannot be read: {error}") from None
    return f"data:image/webp;base64,{base64.b64encode(file.getvalue()).decode('ascii')}"

"""matplotlib's SVG as part of a page: text stays text, colours follow the page, no two figures share an id."""

from __future__ import annotations

import base64
import io
import re
from collections import Counter
from collections.abc import Mapping
from types import MappingProxyType
from xml.etree.ElementTree import Element, ParseError, fromstring, tostring

import numpy as np
from PIL import Image

from profilefit.report.figures.canvas import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, RC, SKY, VERMILION, YELLOW

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
INSIDE = ("#", "data:image/png;base64,")  # begin a link that stays in the drawing
RULE = "*{stroke-linejoin: round; stroke-linecap: butt}"
REACHING = re.compile(r"url\s*\(|[\\@<>&]|expression|script", re.IGNORECASE)
POINTED_AT = re.compile(r"#([^)]+)")
DIGITS = re.compile(r"-?\d+\.\d+")
PLACES = ("x", "y", "width", "height")  # attributes whose digits beyond a tenth of a point nobody sees
MARKER = 1000  # letters of a path that is a marker, drawn often and so with one digit more
QUALITY, WIDEST = 75, 1000  # of a photograph as WebP, and its most pixels in a row
UNTURNED = re.compile(r"rotate\(-?0(?: [^)]*)?\)")
# Neighbours that are one element: letters of a formula, each at its place, and lines of one style; definitions of none.
TSPANS = r'<tspan x="([^"]*)" y="([^"]*)" style="([^"]*)">([^<]*)</tspan><tspan x="([^"]*)" y="\2" style="\3">'
PATHS = r'<path d="([^"]*)" ((?:clip-path="[^"]*" )?style="fill:none;(?![^"]*opacity)[^"]*")/><path d="([^"]*)" \2/>'
TOGETHER = (
    (re.compile(TSPANS), r'<tspan x="\1 \5" y="\2" style="\3">\4'),
    (re.compile(PATHS), r'<path d="\1\3" \2/>'),
    (re.compile(r"<defs>(?:<path (?![^>]* id=)[^>]*/>)*</defs>|<defs/>"), ""),
)
TICK = re.compile(r"M \S+ \S+\s+L \S+ \S+\s*")
DRAWING, STYLE = re.compile(r"<svg .*?</svg>", re.DOTALL), re.compile(r' style="([^"]*)"')
PLAIN = re.compile(r"(?:[\w.:;,#% -]|var\(--[\w-]+\))*")  # ends no rule of a style sheet


def checked(svg: str) -> str:
    """Return the same drawing, if it holds what matplotlib's do and nothing else; ValueError where it does not.

    A page runs what it holds: a figure that lies in some folder may bring scripts, or load what it likes.
    """
    try:
        root = fromstring(svg)
    except ParseError as error:
        raise ValueError(f"a drawing that is not SVG: {error}") from None
    for part in root.findall(f"{SVG}metadata"):
        root.remove(part)
    for part in root.iter():
        tag = str(part.tag).removeprefix(SVG)
        strange: list[str] = []
        for key, value in part.attrib.items():  # may point nowhere but into the drawing
            inside = value.startswith(INSIDE) if key == HREF else not REACHING.search(value.replace("url(#", ""))
            strange += [] if key in ATTRIBUTES and inside else [key]
        if tag not in ELEMENTS or strange or (tag == "style" and part.text != RULE):
            what = f"<{tag}>" + (f" with {strange[0]}" if strange else "")
            raise ValueError(f"a drawing with what matplotlib does not write: {what}")
    return tostring(root, encoding="unicode")


def inline(svg: str, prefix: str, title: str, variables: Mapping[str, str] = VARIABLES) -> str:
    """Return the `<svg>` of a page from what matplotlib wrote.

    Args:
        svg: file of matplotlib.
        prefix: beginning of every id in it.
        title: text that a screen reader says.
        variables: colour -> the page's variable for it.
    """
    root = fromstring(svg)
    if root.get("viewBox") is None:
        raise ValueError(f"figure {prefix!r} has no viewBox")
    for parent in (root, *root.iter(f"{SVG}defs")):  # their rule is in the page's style
        for part in [one for one in parent if one.tag in (f"{SVG}metadata", f"{SVG}style")]:
            parent.remove(part)
    _draw_ticks(root)
    links = [(one, key) for one in root.iter() for key in (HREF, "clip-path") if POINTED_AT.search(one.get(key, ""))]
    used = sorted({POINTED_AT.findall(one.attrib[key])[0] for one, key in links})
    names = {name: f"{prefix}-{place}" for place, name in enumerate(used)}
    for one, key in links:
        one.set(key, POINTED_AT.sub(lambda link: f"#{names[link[1]]}", one.attrib[key]))
    colours = re.compile("|".join(variables), re.IGNORECASE)
    words = {colour.lower(): f"var({name})" for colour, name in variables.items()}
    for part in root.iter():
        _shorten(part)
        if (name := part.attrib.pop("id", "")) in names:
            part.set("id", names[name])
        if "style" in part.attrib:
            part.set("style", colours.sub(lambda colour: words[colour[0].lower()], part.attrib["style"]))
    frame, black = root.attrib["viewBox"], f"var({variables[BLACK]})"
    root.attrib = {"viewBox": frame, "role": "img", "aria-label": title, "fill": black}
    drawn = tostring(root, encoding="unicode").replace(" />", "/>")
    for pieces, whole in TOGETHER:
        while (joined := pieces.sub(whole, drawn)) != drawn:
            drawn = joined
    return drawn


def _draw_ticks(root: Element) -> None:
    """Replace each use of a shape that is one straight line by that line: a tick, of which an axis has many."""
    shapes = {f"#{one.get('id')}": one for one in root.iter(f"{SVG}path") if TICK.fullmatch(one.get("d", ""))}
    for use in root.iter(f"{SVG}use"):
        if (shape := shapes.get(use.get(HREF, ""))) is not None:
            x, y = (float(use.attrib.pop(key)) for key in ("x", "y"))
            a, b, c, d = map(float, shape.attrib["d"].replace("M", "").replace("L", "").split())
            rest = {key: value for key, value in use.attrib.items() if key == "clip-path"}
            use.tag, style = f"{SVG}path", f"fill:none;{shape.get('style') or use.get('style', '')}"
            use.attrib = {"d": f"M {x + a:.1f} {y + b:.1f} L {x + c:.1f} {y + d:.1f}", **rest, "style": style}


def _shorten(part: Element) -> None:
    """Leave out blanks, bare groups, digits that nobody sees and names of letters, which the page says."""
    part.tag, part.tail = str(part.tag).removeprefix(SVG), None
    while bare := [one for one in part if one.tag == f"{SVG}g" and not set(one.attrib) - {"id"}]:
        for one in bare:
            at = list(part).index(one)
            part[at : at + 1] = list(one)
    if part.tag not in ("text", "tspan") or len(part):
        part.text = None
    if (link := part.attrib.pop(HREF, None)) is not None:
        part.set("href", link if link.startswith("#") else address(base64.b64decode(link.partition(",")[2])))
    for key in set(PLACES) & set(part.attrib):
        part.set(key, DIGITS.sub(lambda text: f"{float(text[0]):.1f}".removesuffix(".0"), part.attrib[key]))
    if d := part.get("d"):
        part.set("d", _relative(d, 2 if "id" in part.attrib and len(d) < MARKER else 1))
    if turned := UNTURNED.sub("", part.attrib.pop("transform", "")).strip():
        part.set("transform", turned)
    if "style" in part.attrib:
        words = (one.partition(":") for one in part.attrib["style"].split(";") if one.strip())
        style = ((key.strip(), value.strip()) for key, _, value in words)
        part.set("style", ";".join(f"{key}:{value}" for key, value in style if key != "font-family"))


def _relative(d: str, digits: int) -> str:
    """Return a path with each point after its predecessor: to `digits` after the point, a step is a few letters."""
    here, path, unit = np.zeros(2), "", 10.0**digits
    for letter, numbers in re.findall(r"([MLQCz])([^MLQCz]*)", d):
        points = np.rint(np.array(numbers.split(), float).reshape(-1, 2) * unit)
        steps = points if letter == "M" else points - here
        here = points[-1] if len(points) else here
        path += (letter if letter == "M" else letter.lower()) + " ".join(f"{step / unit:g}" for step in steps.ravel())
    return re.sub(r" (?=-)|(?<!\d)0(?=\.)", "", path)


def classed(html: str) -> tuple[str, str]:
    """Return the styles that the drawings of a page share, as rules of classes, and the page with these classes."""
    styles = (style for drawing in DRAWING.findall(html) for style in STYLE.findall(drawing) if PLAIN.fullmatch(style))
    names = {style: f"s{place}" for place, (style, _) in enumerate(Counter(styles).most_common())}
    rules = "\n".join(f".{name} {{ {style} }}" for style, name in names.items())

    def named(style: re.Match[str]) -> str:
        return f' class="{names[style[1]]}"' if style[1] in names else style[0]

    return rules, DRAWING.sub(lambda drawing: STYLE.sub(named, drawing[0]), html)


def address(png: bytes, loss: bool = False) -> str:
    """Return `data:image/webp;base64,...` of a PNG file; OSError, ValueError on what is none.

    Without loss by default: in a map the sign is a colour. With `loss`, the smaller of that and of quality 80.
    """
    files = []
    try:
        with Image.open(io.BytesIO(png), formats=["png"]) as picture:
            if loss:
                picture.thumbnail((WIDEST, picture.height))
            for settings in ({"lossless": True}, {"quality": QUALITY})[: 1 + loss]:
                picture.save(file := io.BytesIO(), "webp", **settings)
                files.append(file.getvalue())
    except (SyntaxError, Image.DecompressionBombError) as error:  # Pillow's words for a damaged one, and for a bomb
        raise ValueError(f"a picture that cannot be read: {error}") from None
    return f"data:image/webp;base64,{base64.b64encode(min(files, key=len)).decode('ascii')}"

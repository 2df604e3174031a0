"""Figures inside a page: every text as it was, colours by name, ids apart, places near enough."""

import base64
import io
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from PIL import Image

from profilefit.report.drawing import VARIABLES, address, checked, classed, inline
from profilefit.report.figures.canvas import BLUE, GREY, canvas, styled
from profilefit.report.svg_path import shortened

NOBODY_SEES = r'<path [^>]*style="fill: ?none"[^>]*>'


@styled
def drawn() -> str:
    figure = canvas(2.0, 3.0)
    ax = figure.subplots()
    ax.plot([0.0123, 1.9876], [0.05, 0.95], color=BLUE, marker="o", label="R$_d$ of 0.0544")
    ax.contourf(np.add.outer(np.arange(4.0), np.arange(4.0)), [0, 3, 6], colors=["none", BLUE])
    ax.set(xlabel="x [mm]", yscale="log", title="α = 0.0591 < 1")
    ax.axhline(0.5, color=GREY)
    ax.legend()
    file = io.StringIO()
    figure.savefig(file, format="svg", metadata={"Date": None})
    return file.getvalue()


@pytest.fixture(scope="module")
def original():
    return drawn()


@pytest.fixture(scope="module")
def page(original):
    return inline(original, "first", "A <title>")


def texts(svg: str) -> str:
    found = ET.fromstring(svg[svg.index("<svg") : svg.rindex("</svg>") + 6])
    return "|".join("".join("".join(one.itertext()).split()) for one in found.iter() if one.tag.endswith("text"))


def test_every_text_stays_as_it_was(original, page):
    assert texts(page) == texts(original)
    assert "α=0.0591<1" in texts(page)
    assert "0.0544" in texts(page)


def test_letters_of_a_formula_are_one_text_with_a_place_each(page):
    together = [places for places in re.findall(r'<tspan x="([^"]*)"', page) if " " in places]
    assert together
    for tspan in re.findall(r"<tspan [^>]*>[^<]*</tspan>", page):
        places, letters = re.search(r'x="([^"]*)"', tspan)[1].split(), re.search(r">([^<]*)<", tspan)[1]
        assert len(places) == len(letters)


def test_colours_are_the_pages_own(page):
    assert "var(--blue)" in page
    assert "var(--muted)" in page
    assert not [colour for colour in VARIABLES if colour.lower() in page.lower()]


def test_ids_have_the_figures_prefix_and_are_all_there(original, page):
    used = set(re.findall(r'(?:url\(|href=")#([^)"]+)', page))
    assert used
    assert all(one.startswith("first-") for one in used)
    assert used == set(re.findall(r' id="([^"]*)"', page))
    other = inline(original, "second", "B")
    assert not used & set(re.findall(r' id="([^"]*)"', other))


def corners(d: str) -> list[np.ndarray]:
    """The points of every line of a path, straight or relative, (n, 2) each; control points count as points."""
    lines, here, start = [], np.zeros(2), np.zeros(2)
    for letter, numbers in re.findall(r"([A-Za-z])([^A-Za-z]*)", d):
        values = np.array([float(one) for one in re.findall(r"-?(?:\d+\.?\d*|\.\d+)", numbers)])
        if letter in "hv":
            values = np.stack([values, 0 * values] if letter == "h" else [0 * values, values], axis=1)
        count = {"C": 3, "Q": 2}.get(letter.upper(), 1)
        for points in values.reshape(-1, count, 2) if letter not in "zZ" else [start[None]]:
            points = here + points if letter in "lhvcq" else points
            lines = [*lines, points] if letter == "M" else [*lines[:-1], np.concatenate([lines[-1], points])]
            start = points[0] if letter == "M" else start
            here = points[-1]
    return lines


def farthest(points: np.ndarray, line: np.ndarray) -> float:
    """The largest distance of points (n, 2) from a line of corners (m, 2)."""
    ahead = np.diff(line, axis=0) if len(line) > 1 else np.zeros((1, 2))
    from_start = points[:, None] - line[: len(ahead)]
    along = np.clip(np.sum(from_start * ahead, -1) / np.maximum(np.sum(ahead**2, -1), 1e-300), 0, 1)
    return np.max(np.min(np.linalg.norm(from_start - along[..., None] * ahead, axis=-1), axis=1))


SPIRAL = np.array([(30 + t * np.cos(t), 40 - t * np.sin(t)) for t in np.linspace(0, 30, 700)])


@pytest.mark.parametrize("digits", [1, 2])
@pytest.mark.parametrize("place", [(0.0, 0.0), (12.34, -5.678)])
def test_a_path_is_off_by_less_than_a_tenth_of_a_point(digits, place):
    before = "M " + " L ".join(f"{x:.6f} {y:.6f} \n" for x, y in SPIRAL)
    after = shortened(before, digits, place)
    (line,) = corners(after)
    assert len(after) < len(before) / 3
    assert max(farthest(SPIRAL + place, line), farthest(line, SPIRAL + place)) < 10.0**-digits
    assert farthest(SPIRAL + place, line[::2]) > 10.0**-digits  # the negative control: half of its corners


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("M 10 20 \nL 10 25 \nL 12.5 25 \nL 13 26 \nz", "M10 20v5h2.5l.5 1z"),
        ("M 1 1 L 2 1 L 3 1 L 4 1 z \nM 7 8 L 8 7", "M1 1h3zM7 8l1-1"),
        ("M 0.52 0.48 C 1 2 3 4 5.04 6 Q 7 8 9 -10", "M.5.5c.5 1.5 2.5 3.5 4.5 5.5q2 2 4-16"),
        ("M 3 3 L 3 3", "M3 3h0"),  # a dot, where the ends are round
        ("M 1 1 A 2 2 0 0 1 5 5", "M 1 1 A 2 2 0 0 1 5 5"),  # none of matplotlib's stays as it is
        ("M 1 L 2 2", "M 1 L 2 2"),
        ("M 1 1 L 1e999 2", "M 1 1 L 1e999 2"),
        ("", ""),
    ],
)
def test_a_path_in_few_letters(before, after):
    assert shortened(before) == after


def test_every_line_is_where_it_was(original, page):
    """Error bars, ticks and markers too, wherever they are now."""

    def lines(svg: str) -> list[np.ndarray]:
        root = ET.fromstring(svg[svg.index("<svg") : svg.rindex("</svg>") + 6])
        paths = [one for one in root.iter() if one.tag.endswith("path")]
        shapes = {one.get("id"): one.get("d") for one in paths}
        uses = [one for one in root.iter() if one.tag.endswith("use")]
        name = [(one.get("href") or one.get("{http://www.w3.org/1999/xlink}href"))[1:] for one in uses]
        placed = [
            line + np.array([use.get("x", "0"), use.get("y", "0")], float)
            for use, one in zip(uses, name, strict=True)
            for line in corners(shapes[one])
        ]
        return placed + [line for one in paths if one.get("id") not in name for line in corners(one.get("d"))]

    before, after = lines(re.sub(NOBODY_SEES, "", original)), lines(page)
    assert len(before) == len(after)
    for line in before:
        assert min(max(farthest(line, one), farthest(one, line)) for one in after) < 0.15


def test_what_nobody_sees_is_left_out(original, page):
    assert re.search(NOBODY_SEES, original)
    assert not re.search(NOBODY_SEES, page)
    assert "<metadata>" not in page


def test_a_screen_reader_hears_the_title(page):
    assert 'aria-label="A &lt;title&gt;"' in page


def test_a_figure_without_a_frame_is_refused():
    with pytest.raises(ValueError, match="figure 'x' has no viewBox"):
        inline("<svg><g/></svg>", "x", "t")


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("</svg>", "<script>evil()</script></svg>"),
        ("</svg>", "<foreignObject/></svg>"),
        ("<svg ", '<svg onload="evil()" '),
        ("<path ", '<path onclick="evil()" '),
        ('xlink:href="#', 'xlink:href="javascript:evil()#'),
        ('xlink:href="#', 'xlink:href="https://example.org/#'),
        ("fill: ", "background: url(https://example.org/x); fill: "),
        ("*{stroke-linejoin: round", "@import 'https://example.org/x'; *{stroke-linejoin: round"),
        ("</svg>", ""),
    ],
    ids=range(9),
)
def test_a_drawing_holds_what_matplotlib_draws_and_nothing_else(original, old, new):
    assert inline(checked(original), "first", "A") == inline(original, "first", "A")
    assert old in original
    with pytest.raises(ValueError, match=r"^a drawing (with what matplotlib does not write: <\w+>|that is not SVG: )"):
        checked(original.replace(old, new, 1))


def test_a_drawing_hides_nothing_in_its_head(original):
    entity = "<!DOCTYPE svg [<!ENTITY x \"<svg onload='evil()'>\">]>"
    hidden = original.replace(original[original.index("<!DOCTYPE") : original.index("<svg")], entity)
    assert "evil" not in inline(checked(hidden), "first", "A")


def test_styles_that_are_shared_are_rules(page):
    """Every style once, and where it was."""
    rules, inside = classed(f'<p style="color: red">{page}</p>{page}')
    told = dict(re.findall(r"\.(s\d+) { (.*) }", rules))
    styles = re.findall(r' style="([^"]*)"', page)
    assert sorted(told.values()) == sorted(set(styles))
    assert [told[one] for one in re.findall(r' class="([^"]*)"', inside)] == styles * 2
    assert re.findall(r' style="([^"]*)"', inside) == ["color: red"]


@pytest.mark.parametrize("evil", ["fill: red} body {display: none", "fill: /*", "fill: rgb(0", "fill: 'x"])
def test_a_style_that_would_end_its_rule_stays_where_it_is(evil):
    drawing = f'<svg viewBox="0 0 1 1"><path style="{evil}"/></svg>'
    assert classed(drawing) == ("", drawing)


def test_pictures_keep_every_pixel():
    ramp = np.add.outer(np.arange(96.0), np.arange(64.0)) / 160
    pixels = np.rint(255 * np.stack([ramp, ramp**2, 1 - ramp], axis=-1)).astype(np.uint8)
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "png")
    head, data = address(file.getvalue()).split(",")
    assert head == "data:image/webp;base64"
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(base64.b64decode(data)))), pixels)
    with pytest.raises(OSError, match="cannot identify image file"):
        address(b"GIF89a")

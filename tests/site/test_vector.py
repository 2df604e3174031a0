"""Figures inside a page: every text as it was, colours by name, ids apart, places near enough."""

import io
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from profilefit.report.figures.canvas import BLUE, GREY, canvas, styled
from profilefit.report.page.markup import VARIABLES, checked, inline

NOBODY_SEES = r'<path [^>]*style="fill: none"[^>]*>'


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


def test_places_are_off_by_less_than_a_tenth_of_a_point(original, page):
    def numbers(svg: str) -> np.ndarray:
        paths = re.findall(r' d="([^"]*)"', re.sub(NOBODY_SEES, "", svg))
        return np.array([float(one) for path in paths for one in re.findall(r"-?\d+\.?\d*", path)])

    there, here = numbers(original), numbers(page)
    assert there.size == here.size
    assert np.max(np.abs(there - here)) <= 0.1


def test_what_nobody_sees_is_left_out(original, page):
    assert re.search(NOBODY_SEES, original)
    assert not re.search(NOBODY_SEES, page)
    assert "<metadata>" not in page


def test_a_screen_reader_hears_the_title(page):
    assert 'aria-label="A &lt;title&gt;"' in page
    assert "<figcaption>A &lt;title&gt;</figcaption>" in page


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
    assert inline(checked(original), "first", "A").replace(" />", "/>").replace("  ", " ") == inline(
        original, "first", "A"
    ).replace("  ", " ")
    assert old in original
    with pytest.raises(ValueError, match=r"^a drawing (with what matplotlib does not write: <\w+>|that is not SVG: )"):
        checked(original.replace(old, new, 1))


def test_a_drawing_hides_nothing_in_its_head(original):
    entity = "<!DOCTYPE svg [<!ENTITY x \"<svg onload='evil()'>\">]>"
    hidden = original.replace(original[original.index("<!DOCTYPE") : original.index("<svg")], entity)
    assert "evil" not in inline(checked(hidden), "first", "A")

"""Figures inside a page: every text as it was, colours by name, ids apart, places to a hundredth of a point."""

import base64
import io
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from PIL import Image

from profilefit.report.drawing import VARIABLES, address, checked, classed, inline
from profilefit.report.figures.canvas import BLUE, GREY, canvas, styled


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


def numbers(svg: str) -> list[float]:
    root = ET.fromstring(svg[svg.index("<svg") : svg.rindex("</svg>") + 6])
    places = [one.get(key, "") for one in root.iter() for key in ("d", "x", "y", "width", "height") if one is not root]
    return [float(one) for one in re.findall(r"-?\d+(?:\.\d+)?", " ".join(places))]


def test_every_line_is_where_it_was(original, page):
    before, after = numbers(original), numbers(page)
    assert len(before) > 300
    np.testing.assert_allclose(after, before, rtol=0, atol=0.0051)  # half of the last digit that is kept
    assert len(page) < 0.7 * len(original)


def test_what_nobody_sees_is_left_out(page):
    assert "<metadata>" not in page
    assert "<style" not in page


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

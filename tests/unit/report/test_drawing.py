"""Figures and tables inside a page: every text and cell as it was, what is special escaped, colours by name."""

import base64
import io
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from PIL import Image
from rich.console import Group
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from profilefit.report.drawing import VARIABLES, address, checked, classed, inline
from profilefit.report.figures.canvas import BLUE, GREY, canvas, styled
from profilefit.report.page.markup import command, details, markup, section
from profilefit.report.tables.cells import column_table
from tests.fixtures import refused


@pytest.fixture(scope="module")
@styled
def original():
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
def page(original):
    return inline(original, "first", "A <title>")


def elements(svg: str, *tags: str) -> list[ET.Element]:
    """The elements of a drawing whose tags end so."""
    root = ET.fromstring(svg[svg.index("<svg") : svg.rindex("</svg>") + 6])
    return [one for one in root.iter() if one.tag.endswith(tags)]


def test_every_text_stays_as_it_was_letters_of_a_formula_with_a_place_each(original, page):
    before, after = ("|".join("".join("".join(one.itertext()).split()) for one in elements(svg, "text"))
                     for svg in (original, page))  # fmt: skip
    assert before == after
    assert "α=0.0591<1" in after
    assert "0.0544" in after
    spans = re.findall(r'<tspan [^>]*?x="([^"]*)"[^>]*>([^<]*)</tspan>', page)
    assert len(spans) == len(re.findall(r"<tspan [^>]*>[^<]*</tspan>", page))
    assert any(" " in places for places, _ in spans)
    assert [len(places.split()) for places, _ in spans] == [len(letters) for _, letters in spans]


def test_colours_and_title_are_the_pages_own_and_what_nobody_sees_is_left_out(page):
    assert [one for one in ("var(--blue)", "var(--muted)", 'aria-label="A &lt;title&gt;"') if one not in page] == []
    assert [one for one in ("<metadata>", "<style", *VARIABLES) if one.lower() in page.lower()] == []


def test_ids_have_the_figures_prefix_and_are_all_there(original, page):
    used = set(re.findall(r'(?:url\(|href=")#([^)"]+)', page))
    assert used == set(re.findall(r' id="(first-[^"]*)"', page)) == set(re.findall(r' id="([^"]*)"', page)) > set()
    assert not used & set(re.findall(r' id="([^"]*)"', inline(original, "second", "B")))


def corners(d: str) -> list[np.ndarray]:
    """The points (n, 2) of every line of a path, straight or relative; control points count as points."""
    found, here = [], np.zeros(2)
    for letter, text in re.findall(r"([A-Za-z])([^A-Za-z]*)", d):
        numbers = [float(one) for one in re.findall(r"-?(?:\d+\.?\d*|\.\d+)", text)]
        count = {"c": 3, "q": 2}.get(letter.lower(), 1)
        for points in np.reshape(numbers, (-1, count, 2)):
            points = points + here if letter.islower() else points
            found = [*found, points] if letter == "M" else [*found[:-1], np.concatenate([found[-1], points])]
            here = points[-1]
    return found


def lines(svg: str) -> list[np.ndarray]:
    """The points (n, 2) of every line and curve, wherever it is drawn."""
    paths, uses = elements(svg, "path"), elements(svg, "use")
    shapes = {f"#{one.get('id')}": one.get("d") for one in paths}
    links = [one.get("href") or one.get("{http://www.w3.org/1999/xlink}href") for one in uses]
    drawn = [(one.get("d"), 0.0, 0.0) for one in paths if one.get("style", "") and "id" not in one.attrib]
    drawn += [(shapes[link], *(one.get(key, "0") for key in "xy")) for link, one in zip(links, uses, strict=True)]
    return [line + np.array(place, float) for d, *place in drawn for line in corners(d)]


def test_every_line_is_where_it_was(original, page):
    """Error bars, ticks and markers too, to two roundings of half of a tenth of a point."""
    before, after = lines(original), lines(page)
    assert len(before) == len(after) > 40
    for line in before:
        assert min(np.max(np.abs(line - one)) for one in after if one.shape == line.shape) < 0.101
    assert len(page) < 0.6 * len(original)


def test_a_figure_without_a_frame_is_refused():
    refused("figure 'x' has no viewBox", inline, "<svg><g/></svg>", "x", "t", error=ValueError)


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


def png(colours: np.ndarray) -> tuple[np.ndarray, bytes]:
    pixels = np.rint(255 * np.clip(colours, 0, 1)).astype(np.uint8)
    Image.fromarray(pixels).save(file := io.BytesIO(), "png")
    return pixels, file.getvalue()


def test_pictures_keep_every_pixel():
    ramp = np.add.outer(np.arange(96.0), np.arange(64.0)) / 160
    pixels, file = png(np.stack([ramp, ramp**2, 1 - ramp], axis=-1))
    head, data = address(file).split(",")
    assert head == "data:image/webp;base64"
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(base64.b64decode(data)))), pixels)
    refused("cannot identify image file", address, b"GIF89a", error=OSError)


def test_a_photograph_may_lose_what_nobody_sees():
    ramp = np.add.outer(np.arange(256.0), np.arange(256.0)) / 510
    pixels, file = png(ramp[..., None] + np.random.default_rng(1).normal(0.0, 0.01, (256, 256, 3)))
    exactly, small = (address(file, loss) for loss in (False, True))
    assert len(small) < 0.5 * len(exactly)
    shown = np.asarray(Image.open(io.BytesIO(base64.b64decode(small.split(",")[1])))).astype(float)
    assert np.sqrt(np.mean((shown - pixels) ** 2)) < 5


# Tables


def cells(html: str, tag: str) -> list[str]:
    return ["".join(one.itertext()) for one in ET.fromstring(f"<x>{html.replace('<br>', ' ')}</x>").iter(tag)]


def test_a_table_has_its_title_headers_cells_and_caption_in_order():
    """Numbers stand to the right, and long texts may wrap."""
    columns = {"": ["a<b", "c"], "x [mm]": ["1", "2"], "long": ["many words", "more"]}
    html = markup(column_table("Title", columns, "told & done", fold=("long",)))
    assert (cells(html, "th"), cells(html, "td")) == (list(columns), ["a<b", "1", "many words", "c", "2", "more"])
    assert cells(html, "p") == ["Title", "told & done"]
    assert html.index("Title") < html.index("<table>") < html.index("told &amp; done")
    found = ET.fromstring(f"<x>{html}</x>")
    assert [one.get("class") for one in found.iter("td")] == [None, "number", "text"] * 2


def test_styles_become_classes_and_lines_breaks():
    html = markup(Text.assemble(("name", "bold"), "\n", ("FAILED", "bold red"), " <why>"))
    assert html == '<p><span class="bold">name</span><br><span class="bold red">FAILED</span> &lt;why&gt;</p>'


def test_a_table_of_facts_has_no_head_and_groups_are_taken_apart():
    table = Table(show_header=False, title="Fit")
    table.add_column()
    table.add_row(Text("converged", style="green"))
    html = markup(Group(Padding(table, 1), "and a line"))
    assert "<thead>" not in html
    assert (cells(html, "td"), cells(html, "p")) == (["converged"], ["Fit", "and a line"])
    assert '<span class="green">converged</span>' in html


def test_what_is_no_table_is_refused():
    with pytest.raises(TypeError, match="texts, tables and groups, got int"):
        markup(3)  # type: ignore[arg-type]


def test_commands_titles_and_ids_are_escaped():
    assert "a &amp;&amp; b" in command("a && b")
    assert section("here", "A < B", ["x"]).startswith('<section id="here"><h2>A &lt; B</h2>')
    assert '<details id="it"><summary>more</summary>' in details("more", "x", "it")
    assert '<details open=""><summary>more</summary>' in details("more", "x", is_open=True)

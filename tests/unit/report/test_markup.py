"""Tables of the terminal as HTML: the same cells, in the same order, with what is special escaped."""

import xml.etree.ElementTree as ET

import pytest
from rich.console import Group
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from profilefit.report.page.markup import command, details, markup, section
from profilefit.report.tables.cells import column_table


def cells(html: str, tag: str) -> list[str]:
    return ["".join(one.itertext()) for one in ET.fromstring(f"<x>{html.replace('<br>', ' ')}</x>").iter(tag)]


def test_a_table_has_its_title_headers_cells_and_caption_in_order():
    """Numbers stand to the right, and long texts may wrap."""
    columns = {"": ["a<b", "c"], "x [mm]": ["1", "2"], "long": ["many words", "more"]}
    html = markup(column_table("Title", columns, "told & done", fold=("long",)))
    assert cells(html, "th") == list(columns)
    assert cells(html, "td") == ["a<b", "1", "many words", "c", "2", "more"]
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
    assert cells(html, "td") == ["converged"]
    assert cells(html, "p") == ["Fit", "and a line"]
    assert '<span class="green">converged</span>' in html


def test_what_is_no_table_is_refused():
    with pytest.raises(TypeError, match="texts, tables and groups, got int"):
        markup(3)  # type: ignore[arg-type]


def test_commands_titles_and_ids_are_escaped():
    assert "a &amp;&amp; b" in command("a && b")
    assert section("here", "A < B", ["x"]).startswith('<section id="here"><h2>A &lt; B</h2>')
    assert '<details id="it"><summary>more</summary>' in details("more", "x", "it")
    assert '<details open=""><summary>more</summary>' in details("more", "x", is_open=True)

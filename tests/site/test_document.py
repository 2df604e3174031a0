"""The page as a colleague opens it: from a file, without a network, on a phone and a desk, light and dark."""

import html.parser
import json
import re
import shutil
from pathlib import Path

import pytest

from profilefit.errors import OutputError, RecordError
from profilefit.recipes import catalogue, evidence
from profilefit.report.page import document
from profilefit.report.page.document import PARTS, write_page
from profilefit.report.page.sections import CAPTIONS, EvidenceFolder, promises, record_part
from profilefit.report.records import Source
from tests.fixtures import refused
from tests.unit.report.test_figures import folder_with

SHIPPED = catalogue.fits_folder()
DATA = Path(__file__).parent / "data"
GOLDEN = DATA / "tables.html"
NAMES = ("albedo-liang", "burley-whole")
MEASURED = json.loads((DATA / "evidence" / "measured.json").read_text(encoding="utf-8"))
UNFOLD = "document.querySelectorAll('details').forEach((one) => { one.open = true; })"
BACKGROUND = "getComputedStyle(document.body).backgroundColor"
SPOILED = (
    "document.querySelector('main p').style.width = '900px'",
    "document.querySelector('main').append(Object.assign(document.createElement('p'), {style: 'overflow: hidden; "
    "width: 50px; white-space: pre', textContent: 'much more than fits into it'}))",
    "document.querySelector('figure svg text').setAttribute('transform', 'translate(-900 0)')",
)
# What stands outside the window and is not scrolled to; text of a figure outside its frame; what is wider than its box.
CLIPPED = (DATA / "clipped.js").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def records(tmp_path_factory):
    return folder_with(tmp_path_factory.mktemp("shipped"), *NAMES)


@pytest.fixture(scope="module")
def measured(tmp_path_factory, records):
    """What the other commands write, in small."""
    folder = tmp_path_factory.mktemp("evidence")
    for name, content in MEASURED.items():
        made = evidence.measurement_origin(f"profilefit {name} --out {folder}", records)
        (folder / f"{name}.json").write_text(json.dumps({"made": made, **content}), encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def page(tmp_path_factory, records, measured):
    path = tmp_path_factory.mktemp("page") / "report.html"
    write_page(path, records, measured)
    return path


def sections(folder, records):
    """The sections of what the commands wrote into a folder."""
    return [EvidenceFolder(folder, records).section(name, parts) for name, parts in document.MEASURED.items()]


class Balance(html.parser.HTMLParser):
    """Every element that is opened is closed, in order."""

    VOID = frozenset({"meta", "link", "br", "img", "input", "!doctype", "hr"})

    def __init__(self) -> None:
        super().__init__()
        self.open, self.ids, self.loads = [], [], []

    def handle_starttag(self, tag, attrs):
        self.open += [tag] if tag not in self.VOID else []
        self.ids += [value for key, value in attrs if key == "id"]
        self.loads += [value for key, value in attrs if key in ("src", "href", "xlink:href") and value]

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in self.VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        assert self.open.pop() == tag, self.getpos()


def test_it_is_whole_and_loads_nothing(page):
    found, text = Balance(), page.read_text(encoding="utf-8")
    found.feed(text)
    ids = set(found.ids)
    assert (found.open, len(found.ids)) == ([], len(ids))
    assert [one for one in found.ids if one in PARTS] == [one for one in PARTS if one not in ("claims", "stacks")]
    assert next(iter(PARTS)) == "explorer"
    assert all(one.startswith("data:") or (one[0] == "#" and one[1:] in ids) for one in found.loads)
    assert not re.search(r"url\((?!data:|#|&quot;|\"data:)", text)


def test_tables_are_those_of_the_golden_file(tmp_path):
    """Frozen records, so that only a change of the tables themselves changes them."""
    source = Source(DATA)
    parts = "\n".join(record_part(source, name) for name in source.paths)
    found = "\n".join(re.findall(r"<table>.*?</table>", parts, re.DOTALL)) + "\n"
    (tmp_path / "tables.html").write_text(found, encoding="utf-8")
    assert found == GOLDEN.read_text(encoding="utf-8"), f"look, and if it is right: cp {tmp_path}/tables.html {GOLDEN}"


def test_it_says_what_was_measured_where_and_what_is_missing(page, records, measured, tmp_path):
    text = page.read_text(encoding="utf-8")
    told = ["some &lt;GPU&gt;", "misprint: b0", "420", "compute in float32", "hazard, two steps", "alone on its core"]
    told += ["bounds are broken", "Not of everything: of burley."]
    assert [words for words in told if words not in text] == []
    assert "Not measured here" not in text
    assert "run it again" not in text
    bare = "\n".join(sections(tmp_path, records))
    assert [f"profilefit {name} --out evidence" in bare for name in MEASURED] == [True] * 3
    # Measured with the constants of other records, and told so.
    other = tmp_path / "other"
    shutil.copytree(records, other)
    (other / "albedo-liang.json").unlink()
    assert "\n".join(sections(measured, other)).count("run it again") == 3


@pytest.mark.slow
def test_what_the_commands_wrote_last_can_be_read():
    told = dict(zip(("misprint of b0", "quantile", "hazard"), sections(SHIPPED / "evidence", SHIPPED), strict=True))
    assert [name for name, text in told.items() if name not in text or "Not measured here" in text] == []


def test_what_was_promised_and_measured_last_is_a_section_of_its_own():
    told = "".join(promises(EvidenceFolder(SHIPPED / "evidence", SHIPPED)))
    assert "profilefit tradeoff truth" in told
    assert "run it again" not in told


def test_damage_is_one_line_and_leaves_the_old_page(page, records, tmp_path):
    (tmp_path / "check.json").write_text("[1]", encoding="utf-8")
    path = tmp_path / "report.html"
    path.write_text("old", encoding="utf-8")
    expected = "expected what `profilefit {} --out` writes, got "
    refused(rf"check\.json: {expected.format('check')}no key 'made'", write_page, path, records, tmp_path)
    for name in MEASURED:
        (tmp_path / f"{name}.json").write_text('{"made": {}, "laws": {}}', encoding="utf-8")
        refused(f"{expected.format(name)}KeyError", write_page, path, records, tmp_path)
        (tmp_path / f"{name}.json").unlink()
    shutil.copytree(records, tmp_path / "records")
    (tmp_path / "records/albedo-liang.json").write_text('{"format": 1}', encoding="utf-8")
    refused("damaged", write_page, path, tmp_path / "records", tmp_path, error=RecordError)
    assert path.read_text(encoding="utf-8") == "old"
    (tmp_path / "file").write_text("", encoding="utf-8")
    refused("cannot write into", write_page, tmp_path / "file" / "report.html", records, tmp_path, error=OutputError)


@pytest.mark.slow
@pytest.mark.parametrize("width", [400, 1400])
@pytest.mark.parametrize("scheme", ["dark", "light"])
def test_it_opens_without_a_complaint_and_nothing_is_clipped(open_page, page, width, scheme):
    window = open_page(page, width, color_scheme=scheme)
    window.evaluate(UNFOLD.replace("one.open", "one.removeAttribute('name'); one.open"))  # all of a group, too
    assert window.evaluate("document.documentElement.scrollWidth") <= width
    assert window.evaluate(CLIPPED) == []
    background = window.evaluate(BACKGROUND)
    assert background == ("rgb(255, 255, 255)" if scheme == "light" else "rgb(22, 24, 28)")
    window.click("#theme")
    assert window.evaluate(BACKGROUND) != background


@pytest.mark.slow
def test_the_check_of_clipping_sees_what_is_clipped(open_page, page):
    """The negative control: too wide a paragraph, a hidden overflow, a label outside its figure."""
    window = open_page(page, 400)
    assert window.evaluate(CLIPPED) == []
    for spoil in SPOILED:
        window.evaluate(spoil)
    assert len(window.evaluate(CLIPPED)) >= len(SPOILED)


@pytest.mark.slow
def test_a_link_to_a_record_opens_it(open_page, page):
    window = open_page(page, fragment="#record-burley-whole")
    assert window.evaluate("document.getElementById('record-burley-whole').open")
    assert not window.evaluate("document.getElementById('record-albedo-liang').open")


@pytest.mark.slow
def test_the_page_of_all_records_is_short_and_small(open_page, tmp_path):
    """Unfolded, with one record open, as the page allows; figures are drawn of records that are named."""
    write_page(path := tmp_path / "report.html", SHIPPED, SHIPPED / "evidence")
    assert path.stat().st_size < 3_000_000
    window = open_page(path, 1366, 768)
    window.wait_for_function("explorer.ball && explorer.ball.done >= explorer.state.samples")  # nothing is scrolled
    window.evaluate(UNFOLD)
    assert window.evaluate("document.documentElement.scrollHeight") <= 15_000
    assert window.locator("#records details").count() == len(Source(SHIPPED).paths)
    write_page(path, SHIPPED, tmp_path, ["liang-whole"])
    assert all(
        f'aria-label="{CAPTIONS[name]}"' in path.read_text() for name in ("residuals", "quality", "liang-7-error")
    )

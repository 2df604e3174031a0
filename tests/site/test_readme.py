"""What README and documentation claim is what the records say."""

import re
from pathlib import Path

import pytest

from benchmarks.claims import RUNS
from profilefit.fitting.quality import profile_quality
from profilefit.recipes import record
from profilefit.recipes.catalogue import profile_laws
from profilefit.report.tables.claims_table import markdown_claims
from profilefit.report.tables.law_tables import ALBEDOS, markdown_laws, markdown_sections
from profilefit.report.tables.markdown import fill, sections
from profilefit.shader.check.chosen import REGENERATED, chosen

ROOT = Path(__file__).resolve().parents[2]
README = ROOT / "README.md"
# Where each table stands; `make records` fills these files.
PLACES = {
    "short": README,
    **dict.fromkeys(("quality", "hazard", "laws"), ROOT / "docs/guide/laws.md"),
    **dict.fromkeys(("constants", "readings", "inversion", "maps"), ROOT / "docs/guide/paper.md"),
    "check": ROOT / "docs/howto/shader.md",
    "claims": ROOT / "docs/guide/claims.md",
}
MEASURED = ("laws", "check", "claims")
CLAIM = re.compile(r'\[([^\]]+)\]\([\w./-]*claims\.md "([\w-]+)"\)')
WRITTEN = [README, *(path for part in ("start", "guide", "howto", "theory") for path in ROOT.glob(f"docs/{part}/*.md"))]


def text_of(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def shipped() -> dict[str, dict]:
    return {name: record.read(path) for name, path in record.available(ROOT / "fits").items()}


def rows_of(name: str) -> list[list[str]]:
    """The cells of a table, line by line."""
    inside = text_of(PLACES[name]).split(f"<!-- {name} -->")[1].split(f"<!-- /{name} -->")[0]
    return [[c.strip() for c in line.strip("|").split("|")] for line in inside.splitlines() if line.startswith("|")]


def test_every_table_is_the_records_own_and_stands_in_one_place_and_no_other():
    tables = sections(shipped())
    assert set(tables) == set(PLACES) - set(MEASURED)
    for name, table in tables.items():
        assert f"<!-- {name} -->\n{table}\n<!-- /{name} -->" in text_of(PLACES[name]), f"{name}: run make records"
    known = {*tables, *markdown_sections(ROOT / "fits")}
    found = {(name, path) for path in WRITTEN for name in known if f"<!-- {name} -->" in text_of(path)}
    assert found == set(PLACES.items())
    # Filling again changes nothing, and a stale table is replaced.
    for path in set(PLACES.values()):
        assert fill(text_of(path), tables) == text_of(path)
    assert fill("<!-- maps -->\nold\n<!-- /maps -->\n", {"maps": "new"}) == "<!-- maps -->\nnew\n<!-- /maps -->\n"
    assert fill("no marks", {"maps": "new"}) == "no marks"


@pytest.mark.parametrize("page", WRITTEN, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_every_picture_and_page_it_names_is_there(page):
    names = [part.split(")")[0].split("#")[0].split(" ")[0] for part in text_of(page).split("](")[1:]]
    local = [name for name in names if name and not name.startswith("https://")]
    # A page of docs/laws is made when the documentation is built, which tells if one is missing.
    assert [name for name in local if "../laws/" not in name and not (page.parent / name).exists()] == []
    assert page != README or len(local) >= 12


def test_the_readme_is_two_screens_and_its_numbers_are_the_records_own():
    lines, words = text_of(README).splitlines(), " ".join(text_of(README).split())
    assert len(lines) <= 110
    shown = {(row[0], row[1]): row[2:] for row in rows_of("short")}
    burley = shown["burley", "published"]
    assert f"is {100 * float(burley[1]):.0f} %, and {100 * float(burley[0]):.1f} % on average" in words


def test_figures_in_prose_are_the_bounds_of_the_claims_they_link_to():
    bounds = {promise[0]: float(promise[1].split()[1]) for run in RUNS for promise in run.promises}
    found = [(page, name, text) for page in WRITTEN for text, name in CLAIM.findall(text_of(page))]
    assert [one for one in found if float(one[2].split()[0].replace(",", "")) != bounds[one[1]]] == []
    assert {name for page, name, _ in found if page == README} >= {"hazard-error", "hazard-time", "shader-time"}
    assert len(found) == sum(text_of(page).count('claims.md "') for page in WRITTEN), "a link of another form"


def test_every_record_has_its_recipe_and_ended_well():
    recipes = {path.stem for path in (ROOT / "fits").glob("*.toml")}
    records = shipped()
    assert set(records) == recipes
    fits = {name: content for name, content in records.items() if "fit" in content}
    assert len(fits) == len(recipes) - 1  # all but what compares readings
    for name, content in fits.items():
        assert content["fit"]["result"] == "converged", name
        assert {chain["result"] for chain in content["posterior"].values()} == {"converged"}, name


@pytest.mark.slow
def test_measured_tables_name_every_law_and_two_are_measured_again():
    """All of them would take a minute."""
    rows = rows_of("laws")[2:]
    laws = profile_laws(ROOT / "fits", matched=False)
    assert {(r[0], r[1], r[2]) for r in rows} == {(o.name, o.constants or "none", o.setting.illumination) for o in laws}
    for one in [o for o in laws if o.label in ("burley, published", "liang-whole")]:
        line = markdown_laws([(one, profile_quality(one.law, ALBEDOS))]).splitlines()[2]
        assert [cell.strip() for cell in line.strip("|").split("|")] in rows, f"{one.label}: run make records"


def test_the_table_of_claims_is_what_was_measured_last():
    table = markdown_claims(ROOT / "fits/evidence")
    assert fill(text_of(PLACES["claims"]), {"claims": table}) == text_of(PLACES["claims"]), "run make claims"


def test_all_that_was_regenerated_passes_the_check_and_what_was_printed_by_liang_does_not():
    laws, maps = chosen([], REGENERATED, ROOT / "fits")
    listed = {row[0]: row[-1] for row in rows_of("check") if row[-1] in ("pass", "FAIL")}
    assert listed == {**dict.fromkeys([one.label for one in (*laws, *maps)], "pass"), "liang, published": "FAIL"}

"""What README and documentation claim is what the records say; so do the pages of laws, one for each law and record."""

import importlib
import re
import shlex
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

import profilefit
from benchmarks.claims import RUNS
from mcml_sim import Setting
from profilefit.fitting.quality import profile_quality
from profilefit.recipes import catalogue, record
from profilefit.recipes.catalogue import profile_laws
from profilefit.report.records import largest_error
from profilefit.report.tables.cells import to_error
from profilefit.report.tables.claims_table import markdown_claims
from profilefit.report.tables.law_tables import ALBEDOS, markdown_laws, markdown_sections
from profilefit.report.tables.markdown import fill, sections
from profilefit.shader.check.chosen import REGENERATED, chosen

ROOT = Path(__file__).resolve().parents[2]
FITS, README = ROOT / "fits", ROOT / "README.md"
sys.path.append(str(ROOT / "docs" / "ext"))
law_pages = importlib.import_module("law_pages")
# Where each table stands; `make records` fills these files.
PLACES = {
    "short": README,
    "laws": ROOT / "docs/explanation/models.md",
    **dict.fromkeys(("constants", "readings", "inversion", "maps"), ROOT / "docs/validation/paper.md"),
    "check": ROOT / "docs/validation/checks.md",
    "claims": ROOT / "docs/validation/claims.md",
}
MEASURED = ("laws", "check", "claims")
CLAIM = re.compile(r"\[([^\]]+)\]\([\w./-]*claims\.md#([\w-]+)\)")
WRITTEN = [README, *sorted(path for path in ROOT.glob("docs/**/*.md") if not {"laws", "_build"} & {*path.parts})]


def text_of(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def shipped() -> dict[str, dict]:
    return {name: record.read(path) for name, path in record.available(FITS).items()}


def rows_of(name: str) -> list[list[str]]:
    """The cells of a table, line by line."""
    inside = text_of(PLACES[name]).split(f"<!-- {name} -->")[1].split(f"<!-- /{name} -->")[0]
    return [[c.strip() for c in line.strip("|").split("|")] for line in inside.splitlines() if line.startswith("|")]


def test_every_table_is_the_records_own_and_stands_in_one_place_and_no_other():
    tables = sections(shipped())
    assert set(tables) == set(PLACES) - set(MEASURED)
    for name, table in tables.items():
        assert f"<!-- {name} -->\n{table}\n<!-- /{name} -->" in text_of(PLACES[name]), f"{name}: run make records"
    known = {*tables, *markdown_sections(FITS)}
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


def test_the_readme_shows_the_errors_of_the_records():
    shown = {row[0]: float(row[2].split()[0]) for row in rows_of("short")[2:]}
    assert shown["hazard"] == pytest.approx(
        100 * np.mean(shipped()["hazard"]["quality"]["regenerated"]["rel"]), rel=0.05
    )
    assert shown["hazard"] < shown["hazard-refracting, n = 1.4"] < shown["burley"]


def test_figures_in_prose_are_the_bounds_of_the_claims_they_link_to():
    bounds = {promise[0]: float(promise[1].split()[1]) for run in RUNS for promise in run.promises}
    found = [(page, name, text) for page in WRITTEN for text, name in CLAIM.findall(text_of(page))]
    assert [one for one in found if float(one[2].split()[0].replace(",", "")) != bounds[one[1]]] == []
    assert {name for page, name, _ in found if page == README} >= {"hazard-error", "hazard-time", "shader-time"}
    assert len(found) == sum(text_of(page).count("claims.md#") for page in WRITTEN), "a link of another form"


def test_every_record_has_its_recipe_and_ended_well():
    recipes = {path.stem for path in FITS.glob("*.toml")}
    records = shipped()
    assert set(records) == recipes
    fits = {name: content for name, content in records.items() if "fit" in content}
    assert len(fits) == len(recipes) - 1  # all but what compares readings
    for name, content in fits.items():
        assert content["fit"]["result"] == "converged", name
        assert {chain["result"] for chain in content["posterior"].values()} == {"converged"}, name


@pytest.mark.slow
def test_measured_tables_name_every_published_set_and_two_are_measured_again():
    rows = rows_of("laws")[2:]
    laws = [one for one in profile_laws(FITS, matched=False) if not one.records]
    assert {(r[0], r[1], r[2]) for r in rows} == {(o.name, o.constants or "none", o.setting.illumination) for o in laws}
    for one in [o for o in laws if o.label in ("burley, published", "liang, corrected")]:
        line = markdown_laws([(one, profile_quality(one.law, ALBEDOS))]).splitlines()[2]
        assert [cell.strip() for cell in line.strip("|").split("|")] in rows, f"{one.label}: run make records"


def test_the_table_of_claims_is_what_was_measured_last():
    table = markdown_claims(FITS / "evidence")
    assert fill(text_of(PLACES["claims"]), {"claims": table}) == text_of(PLACES["claims"]), "run make claims"


def test_all_that_was_regenerated_passes_the_check_and_what_was_printed_by_liang_does_not():
    laws, maps = chosen([], REGENERATED, FITS)
    listed = {row[0]: row[-1] for row in rows_of("check") if row[-1] in ("pass", "FAIL")}
    assert listed == {**dict.fromkeys([one.label for one in (*laws, *maps)], "pass"), "liang, published": "FAIL"}


# Pages of laws


@pytest.fixture(scope="module")
def pages():
    return law_pages.law_pages(FITS)


def test_every_law_and_every_record_has_its_place(pages):
    members = [one for page in pages for one in page.members]
    records = {name for name, path in record.available(FITS).items() if "constants" in record.read(path)}
    assert {name for one in members for name in one.records} == records
    assert {one.label for one in profile_laws(FITS) if not one.records} <= {one.label for one in members}
    index = law_pages.index_text(pages, FITS)
    assert index.count("\n| [") == len(members)
    assert all(f"\n{page.name}\n" in index for page in pages)


def test_a_page_says_what_its_record_says(pages):
    hazard = next(page for page in pages if page.name == "hazard")
    text, content = law_pages.page_text(hazard, FITS), record.read(FITS / "hazard.json")
    for name, constant in content["constants"].items():
        shown = to_error(constant["regenerated"], largest_error(constant))
        assert re.search(rf"^\| {name} +\| +{re.escape(shown)} ", text, re.MULTILINE)
    told = [content["data_digest"], "profilefit regenerate hazard\n", 'load("hazard", setting=Setting("diffuse"']
    told += ["profilefit export hazard-diffuse-refracting --lang glsl"]
    told += [f"| worst | {max(content['quality']['regenerated']['rel']):.2g}"]
    assert [one for one in told if one not in text] == []


def test_a_page_changes_with_its_record(pages, tmp_path):
    copied = shutil.copytree(FITS, tmp_path / "fits", ignore=shutil.ignore_patterns("figures", ".photons", "*.npz"))
    path = copied / "quantile.json"
    path.write_text(path.read_text(encoding="utf-8").replace('"converged"', '"did not converge"'), encoding="utf-8")
    page = next(page for page in pages if page.name == "quantile")
    assert "No constants: did not converge." in law_pages.page_text(page, copied)
    assert "No constants: did not converge." not in law_pages.page_text(page, FITS)


@pytest.mark.slow
def test_what_a_page_tells_to_type_gives_that_law(pages):
    """Every call of `load` and `albedo_law` on every page."""
    for page in pages:
        text = law_pages.page_text(page, FITS)
        calls = re.findall(r"```python\n(.+)\n```", text)
        assert len(calls) == len(page.members)
        for call, one in zip(calls, page.members, strict=True):
            here = call.replace('"fits/', f'"{FITS}/')
            law = eval(here, {"profilefit": profilefit, "Setting": Setting})
            assert law.constants() == one.law.constants(), call
            assert law.setting == one.setting, call
        for command in re.findall(r"^profilefit export (.+) --lang glsl$", text, re.MULTILINE):
            name, *constants = shlex.split(command.replace("--constants ", ""))
            law = catalogue.find(name, FITS, *constants).law
            assert any(law.constants() == one.law.constants() for one in page.members), command

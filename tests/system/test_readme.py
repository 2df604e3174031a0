"""What the README claims is what the records say."""

from pathlib import Path

from profilefit import record
from profilefit.inventory import profile_laws
from profilefit.report import fill, sections
from profilefit.report.all_laws import measured_profile
from profilefit.report.law_tables import markdown_laws
from profilefit.shader.check.chosen import REGENERATED, chosen

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def shipped() -> dict[str, dict]:
    return {name: record.read(path) for name, path in record.available(ROOT / "fits").items()}


def test_every_table_is_the_records_own():
    tables = sections(shipped())
    assert set(tables) == {"quality", "constants", "hazard", "readings", "inversion", "maps"}
    for name, table in tables.items():
        assert f"<!-- {name} -->\n{table}\n<!-- /{name} -->" in README, f"{name}: run make readme"


def test_filling_again_changes_nothing_and_a_stale_table_is_replaced():
    tables = sections(shipped())
    assert fill(README, tables) == README
    assert fill("<!-- maps -->\nold\n<!-- /maps -->\n", {"maps": "new"}) == "<!-- maps -->\nnew\n<!-- /maps -->\n"
    assert fill("no marks", {"maps": "new"}) == "no marks"


def test_every_picture_and_page_it_names_is_there():
    names = [part.split(")")[0] for part in README.split("](")[1:]]
    assert len(names) >= 5
    missing = [name for name in names if not name.startswith("https://") and not (ROOT / name).exists()]
    assert missing == []


def test_every_record_has_its_recipe_and_ended_well():
    recipes = {path.stem for path in (ROOT / "fits").glob("*.toml")}
    records = shipped()
    assert set(records) == recipes
    fits = {name: content for name, content in records.items() if "fit" in content}
    assert len(fits) == len(recipes) - 1  # all but what compares readings
    for name, content in fits.items():
        assert content["fit"]["result"] == "converged", name
        assert {chain["result"] for chain in content["posterior"].values()} == {"converged"}, name


def test_measured_tables_name_every_law_and_two_are_measured_again():
    """All of them would take a minute."""
    text = README.split("<!-- laws -->")[1].split("<!-- /laws -->")[0]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.strip().splitlines()[2:]]
    laws = profile_laws(ROOT / "fits")
    assert {(r[0], r[1], r[2]) for r in rows} == {(o.name, o.constants or "none", o.setting.illumination) for o in laws}
    for one in [o for o in laws if o.label in ("burley, published", "liang-whole")]:
        line = markdown_laws([(one, measured_profile(one))]).splitlines()[2]
        assert [cell.strip() for cell in line.strip("|").split("|")] in rows, f"{one.label}: run make readme"


def test_all_that_was_regenerated_passes_the_check_and_what_was_printed_by_liang_does_not():
    text = README.split("<!-- check -->")[1].split("<!-- /check -->")[0]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("|")]
    laws, maps = chosen([], REGENERATED, ROOT / "fits")
    listed = {row[0]: row[-1] for row in rows if row[-1] in ("pass", "FAIL")}
    assert listed == {**dict.fromkeys([one.label for one in (*laws, *maps)], "pass"), "liang, published": "FAIL"}

"""What the README claims is what the records say."""

from pathlib import Path

from profilefit import record
from profilefit.report import fill, sections

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def shipped() -> dict[str, dict]:
    return {name: record.read(path) for name, path in record.available(ROOT / "fits").items()}


def test_every_table_is_the_records_own():
    tables = sections(shipped())
    assert set(tables) == {"quality", "constants", "readings", "inversion", "maps"}
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
    assert len(fits) == 7
    for name, content in fits.items():
        assert content["fit"]["result"] == "converged", name
        assert {chain["result"] for chain in content["posterior"].values()} == {"converged"}, name

"""Pages of laws: every law and record has one, and it says what its record says."""

import importlib
import re
import shlex
import shutil
import sys
from pathlib import Path

import pytest

import profilefit
from mcml_sim import Setting
from profilefit.recipes import catalogue, record
from profilefit.report.records import largest_error
from profilefit.report.tables.cells import to_error

ROOT = Path(__file__).resolve().parents[2]
FITS = ROOT / "fits"
sys.path.append(str(ROOT / "docs" / "ext"))
law_pages = importlib.import_module("law_pages")


@pytest.fixture(scope="module")
def pages():
    return law_pages.law_pages(FITS)


def test_every_law_and_every_record_has_its_place(pages):
    members = [one for page in pages for one in page.members]
    records = {name for name, path in record.available(FITS).items() if "constants" in record.read(path)}
    assert {name for one in members for name in one.records} == records
    printed = {one.label for one in catalogue.profile_laws(FITS) if not one.records}
    assert printed <= {one.label for one in members}
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

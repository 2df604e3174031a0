"""The README's tables read back to the numbers of the records."""

import re

import numpy as np
import pytest

from profilefit.report.records import converged
from profilefit.report.tables.markdown import markdown_constants, sections
from tests.unit.report.test_tables import FITS, RECORDS, rounding


def parsed(text: str) -> list[list[dict[str, str]]]:
    """Every table of a markdown text, each row by its headers."""
    found = []
    for block in text.split("\n\n"):
        lines = [line for line in block.splitlines() if line.startswith("|")]
        if len(lines) < 3:
            continue
        rows = [[cell.strip() for cell in line.replace(r"\|", "¦").strip("|").split("|")] for line in lines]
        assert len({len(line) for line in lines}) == 1, "columns are aligned in the source"
        assert all(set(cell) <= set(":-") for cell in rows[1])
        found.append([dict(zip(rows[0], row, strict=True)) for row in rows[2:]])
    return found


def quality_rows(records) -> list[dict[str, str]]:
    found = sections(records)
    return [row for name in ("quality", "inversion", "maps") for row in parsed(found[name])[0]]


def test_constants_read_back_those_of_the_paper_s_laws_with_their_equation():
    [rows] = parsed(markdown_constants(RECORDS))
    by_key = {(row["record"], row["constant"]): row for row in rows}
    expected = {(name, c) for name, content in FITS.items() if converged(content) for c in content["constants"]}
    assert set(by_key) == expected
    assert len(rows) == len(expected)
    for (name, constant), row in by_key.items():
        values = FITS[name]["constants"][constant]
        assert abs(float(row["regenerated"]) - values["regenerated"]) <= rounding(values)
        if values["published"] is not None:
            assert float(row["published"]) == values["published"]
        if values["free"] and values.get("jackknife_error") is not None:
            assert float(row["± jackknife"]) == pytest.approx(values["jackknife_error"], rel=0.05)
    equations = {row["constant"]: row["equation"] for row in rows if FITS[row["record"]]["law"] == "liang"}
    assert equations.items() >= {"p": "(8)", "a1": "(11)", "b0": "(13)", "c3": "(15)", "h1": "(20)"}.items()
    assert all(row["equation"] == "–" for row in rows if FITS[row["record"]]["law"] != "liang")


def test_a_failed_fit_has_a_reason_and_no_constants():
    name, content = next((name, content) for name, content in FITS.items() if converged(content))
    records = {**RECORDS, name: content | {"fit": content["fit"] | {"result": "no convergence in 9 steps"}}}
    text = markdown_constants(records)
    assert f"{name} has no constants to show: no convergence in 9 steps" in text
    assert name not in {row["record"] for table in parsed(text) for row in table}
    assert name not in {row["record"] for row in quality_rows(records)}


def test_quality_reads_back_with_printed_sets_once():
    rows = quality_rows(RECORDS)
    of_profiles = [(row["record"], row["constants"]) for row in rows if "rel mean" in row]
    assert len(set(of_profiles)) == len(of_profiles) > 0
    for row in rows:
        if row["constants"] != "regenerated":
            continue
        quality = FITS[row["record"]]["quality"]["regenerated"]
        if "rel mean" in row:
            assert "–" not in row.values()
            for key in ("rel", "ks", "l1", "mse"):
                assert float(row[f"{key} mean"]) == pytest.approx(np.mean(quality[key]), rel=0.05)
                assert float(row[f"{key} worst"]) == pytest.approx(np.max(quality[key]), rel=0.05)
            assert float(row["r2 worst"]) == pytest.approx(np.min(quality["r2"]), abs=5e-5)
        elif "max error of A" in row:
            assert float(row["max error of A"]) == pytest.approx(quality["delta_A"], rel=0.05)
            assert row["rises all the way"] == ("yes" if quality["monotone"] else "no")
        else:
            assert float(row["inversion error worst"]) == pytest.approx(np.max(quality["inversion_error"]), rel=0.05)


def test_the_short_table_and_the_hazard_s_constants_say_which_index():
    found = sections(RECORDS)
    assert "| hazard-refracting, n = 1.4 |" in found["short"]
    indices = ("1", "(1.3, 1.5]", "(1, 1.6]")  # of one, of g, too, of every n
    for index, table in zip(map(re.escape, indices), found["hazard"].split("\n\n"), strict=True):
        assert re.search(rf"^\| n +\| {index} +\| {index} +\|$", table, re.MULTILINE)

"""Promised figures: quick rows measured, the last measurement, a promise that is not kept; its table, and damage."""

import json
import re

import pytest

from benchmarks import claims
from profilefit.errors import InputError
from profilefit.recipes import record
from profilefit.report.page.sections import EvidenceFolder, promises
from profilefit.report.tables.claims_table import EXACT, FILE, markdown_claims, read_claims
from tests.fixtures import refused

EVIDENCE = claims.FITS / "evidence"
BROKEN = ("broken", "≤ 0.1 %", claims.RECORDS.promises[0][2], "error of R_d by hazard")


def of_records() -> dict:
    return {"records": {name: record.read(path) for name, path in record.available(claims.FITS).items()}}


def test_records_keep_what_is_promised_and_are_those_that_were_measured():
    rows = list(claims.claimed(claims.RECORDS, claims.RECORDS.command, of_records()))
    assert [one.cells for one in rows if not one.holds] == []
    assert {one.noise for one in rows} == {EXACT}
    told = {one.name: one.value for one in read_claims(EVIDENCE)[1]}
    assert {one.name: one.value for one in rows}.items() <= told.items()


def test_rows_that_were_measured_are_those_that_are_promised_and_none_is_broken():
    promised = {p[0]: (p[3], p[1].split()) for run in claims.RUNS for p in run.promises}
    measured = read_claims(EVIDENCE)[1]
    assert promised.keys() - {one.name for one in measured} == set(), "run make claims"
    for one in measured:
        says, (sense, bound, *unit) = promised[one.name]
        assert (one.says, one.sense, one.bound, one.unit) == (says, sense, float(bound), "".join(unit))
        assert one.low <= one.value <= one.high
        assert one.holds, one.cells


@pytest.mark.slow
def test_a_broken_promise_ends_with_status_1_after_all_is_written(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(claims, "RUNS", (claims.RECORDS._replace(promises=(BROKEN, claims.RECORDS.promises[1])),))
    worst = 100 * max(record.read(claims.FITS / "hazard.json")["quality"]["regenerated"]["rel"])
    with pytest.raises(SystemExit, match=rf"error of R_d by hazard: {worst:.3f} % BROKEN, promised ≤ 0.1 %"):
        claims.main(["--out", str(tmp_path)])
    assert f"{worst:.3f} % BROKEN" in capsys.readouterr().out
    made, rows = read_claims(tmp_path)
    assert made["command"] == "make claims"
    assert [one.holds for one in rows] == [False, True]

    # Rows that are not asked for stay, unless they are of other records.
    monkeypatch.setattr(claims, "numbers", lambda command: of_records())
    written = json.loads((tmp_path / FILE).read_text(encoding="utf-8"))

    def rows_after():
        """The rows that stand there when one of them was measured anew."""
        (tmp_path / FILE).write_text(json.dumps(written), encoding="utf-8")
        claims.main(["--only", "map-error", "--out", str(tmp_path)])
        return read_claims(tmp_path)[1]

    written["rows"][0]["value"] = 0.05
    assert [one.value for one in rows_after()] == [0.05, rows[1].value]
    written["made"]["sha256"] = "0" * 64
    kept = claims.RECORDS._replace(promises=(BROKEN,), fitted=False)
    monkeypatch.setattr(claims, "RUNS", (kept, claims.RECORDS._replace(promises=claims.RECORDS.promises[:2])))
    for left in (["broken", "map-error"], ["map-error"]):
        assert [one.name for one in rows_after()] == left
        monkeypatch.setattr(claims, "RUNS", (kept._replace(fitted=True), claims.RUNS[1]))


# The table

ROW = {
    **{"name": "time", "subject": "Speed: Times <1", "says": "time of <ours>", "value": 1.31, "low": 1.25, "high": 1.4},
    **{"noise": "least | most", "sense": "≤", "bound": 1.5, "unit": "", "truth": "theirs"},
    **{"command": "profilefit check", "date": "today", "load": "0.2"},
}
SHARE = {"sense": "≥", "bound": 20, "unit": "%", "value": 12.0, "low": 12.0, "high": 12.0, "noise": "exact"}


def written(folder, *rows):
    (folder / FILE).write_text(json.dumps({"made": {"command": "make claims"}, "rows": rows}), encoding="utf-8")
    return folder


def test_a_row_is_judged_by_its_numbers_and_shown_with_its_noise(tmp_path):
    assert "".join(promises(EvidenceFolder(tmp_path, tmp_path))) == "", "no section where none was measured"
    _, (time, share) = read_claims(written(tmp_path, ROW, {**ROW, **SHARE}))
    assert time.cells == ("time of <ours>", "≤ 1.5", "1.31", "1.25 … 1.40: least | most")
    assert share.cells[1:] == ("≥ 20 %", "12.0 % BROKEN", "exact")
    page = "".join(promises(EvidenceFolder(tmp_path, tmp_path)))
    told = ("time of &lt;ours&gt;", "1.25 … 1.40", "12.0 % BROKEN", "≥ 20 %", "Reference: theirs", "make claims")
    assert [text for text in told if text not in page] == []
    lines = markdown_claims(tmp_path).splitlines()
    assert lines[:3] == ["## Speed", "", "Times &lt;1."]
    assert {len(re.split(r"(?<!\\)\|", line)) for line in lines[4:8]} == {5}
    assert r'<a id="time"></a>time of \<ours>' in lines[6]
    reference = "- Reference: theirs. Measured on today at load 0.2."
    assert lines[-4:-1] == [reference, "- Least | most: `time` 1.25 … 1.40.", ""]


@pytest.mark.parametrize(
    "spoiled", [{"value": "1"}, {"low": True}, {"says": "\x1b[31m"}, {"sense": "<"}, {"unit": None}]
)
def test_damage_is_named(tmp_path, spoiled):
    (key,) = spoiled
    with pytest.raises(InputError, match=rf"claims.json: expected what `make claims` writes, got ValueError: {key}"):
        read_claims(written(tmp_path, {**ROW, **spoiled}))
    refused("got KeyError: 'name'", read_claims, written(tmp_path, {}))
    refused("got TypeError", read_claims, written(tmp_path, 1))

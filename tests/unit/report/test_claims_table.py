"""Claims as a file says them: judged anew, shown whole, refused where damaged."""

import json
import re

import pytest

from profilefit.errors import InputError
from profilefit.report.page.sections import EvidenceFolder, promises
from profilefit.report.tables.claims_table import FILE, markdown_claims, read_claims

ROW = {
    **{"name": "time", "says": "time of <ours>", "value": 1.31, "low": 1.25, "high": 1.4, "noise": "least | most"},
    **{"sense": "≤", "bound": 1.5, "unit": "", "truth": "theirs", "command": "profilefit check", "date": "today"},
    "load": "0.2",
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
    told = ("time of &lt;ours&gt;", "1.25 … 1.40", "12.0 % BROKEN", "≥ 20 %", "held against: theirs", "make claims")
    assert [text for text in told if text not in page] == []
    lines = markdown_claims(tmp_path).splitlines()
    assert {len(re.split(r"(?<!\\)\|", line)) for line in lines[:4]} == {9}
    assert r"time of \<ours>" in lines[2]


@pytest.mark.parametrize(
    "spoiled", [{"value": "1"}, {"low": True}, {"says": "\x1b[31m"}, {"sense": "<"}, {"unit": None}]
)
def test_damage_is_named(tmp_path, spoiled):
    (key,) = spoiled
    with pytest.raises(InputError, match=rf"claims.json: expected what `make claims` writes, got ValueError: {key}"):
        read_claims(written(tmp_path, {**ROW, **spoiled}))
    with pytest.raises(InputError, match="got KeyError: 'name'"):
        read_claims(written(tmp_path, {}))
    with pytest.raises(InputError, match="got TypeError"):
        read_claims(written(tmp_path, 1))

"""The commands, small."""

import json

import pytest

from benchmarks import forms, laws
from benchmarks.survival import FORMS, HAZARD
from profilefit.studies.tradeoff import contenders
from profilefit.studies.tradeoff.laws import LawSizes

SMALL = LawSizes(points=2000, costly=200, albedos=1000, turns=2, judged=1)


@pytest.mark.slow
def test_laws_print_and_write(monkeypatch, tmp_path, capsys):
    wanted = {contenders.YARDSTICK, "Liang, corrected", "hazard"}
    absent = contenders.Wanted("absent", "gaussians", "no-such-set")
    monkeypatch.setattr(contenders, "SPECS", (*(w for w in contenders.SPECS if w[0] in wanted), absent))
    monkeypatch.setattr(laws, "QUICK", SMALL)
    numbers = tmp_path / "numbers.json"
    laws.main(["--quick", "--json", str(numbers)])

    printed = capsys.readouterr().out
    assert "11 + 7" in printed
    assert "left out: absent: constants must be" in printed
    content = json.loads(numbers.read_text())
    assert set(content) == wanted | {f"{contenders.YARDSTICK}, Xie's sampler", "hazard, two steps"}
    assert content[contenders.YARDSTICK]["time_ratio"]["both"] == [1.0, 1.0, 1.0]
    hazard = content["hazard"]
    assert hazard["constants"] == 14
    assert hazard["functions"]["both"] == {"exp": 1, "log": 4}
    assert hazard["setup_nanoseconds"] > 0
    assert hazard["rel"]["worst"] < 0.01 < 0.05 < content["Liang, corrected"]["rel"]["worst"]
    assert "profile" not in content["hazard, two steps"]["time_ratio"]


@pytest.mark.slow
def test_forms_print_both_tables(capsys, monkeypatch):
    monkeypatch.setattr(forms, "QUICK", forms.Sizes(3, 1, (FORMS[0], HAZARD), forms.COEFFICIENT_LAWS[:1]))
    forms.main(["--quick"])
    printed = capsys.readouterr().out
    one_pole = next(line.split() for line in printed.splitlines() if line.startswith("one pole"))
    hazard = next(line.split() for line in printed.splitlines() if line.startswith(HAZARD.name))
    assert float(one_pole[-2]) > 0.05 > 0.005 > float(hazard[-2])
    assert "1, 1, 2, 1" in printed

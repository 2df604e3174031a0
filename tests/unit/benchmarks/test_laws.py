"""The tables of laws' costs and errors, and of the step edge, small, and the commands that print them."""

import json

import numpy as np
import pytest

import profilefit
from benchmarks import laws, step_edge
from profilefit.studies.tradeoff import laws as study
from profilefit.studies.tradeoff.laws import PARTS, ContenderResult, LawSizes, counts
from profilefit.studies.tradeoff.stopwatch import Ratio

SMALL = LawSizes(points=2000, costly=200, albedos=1000, turns=2, judged=1)


def test_many_functions_are_summed():
    (dipole,) = study.with_samplers("dipole", profilefit.load("dipole", "published"))
    ratios = {part: Ratio(2.0, 1.0, 3.0) for part in PARTS}
    row = ContenderResult(dipole, counts(dipole), {}, ratios, None, np.array([0.1]), np.array([0.2]))
    assert laws.as_cells(row)[1:4] == ("0", "2 exp, 2 sqrt", "162 in all")
    assert laws.as_errors(row) == ("dipole", "0.1", "0.1", "0.2", "0.2")


@pytest.mark.slow
def test_laws_print_and_write(monkeypatch, tmp_path, capsys):
    wanted = {study.YARDSTICK, "Liang, corrected", "hazard"}
    absent = study.LawSpec("absent", "gaussians", "no-such-set")
    monkeypatch.setattr(study, "SPECS", (*(w for w in study.SPECS if w[0] in wanted), absent))
    monkeypatch.setattr(laws, "QUICK", SMALL)
    numbers = tmp_path / "numbers.json"
    laws.main(["--quick", "--json", str(numbers)])

    printed = capsys.readouterr().out
    assert "11 + 7" in printed
    assert "left out: absent: constants must be" in printed
    content = json.loads(numbers.read_text())
    assert set(content) == wanted | {f"{study.YARDSTICK}, Xie's sampler", "hazard, two steps"}
    assert content[study.YARDSTICK]["time_ratio"]["both"] == [1.0, 1.0, 1.0]
    hazard = content["hazard"]
    assert hazard["constants"] == 14
    assert hazard["functions"]["both"] == {"exp": 1, "log": 4}
    assert hazard["setup_nanoseconds"] > 0
    assert hazard["rel"]["worst"] < 0.01 < 0.05 < content["Liang, corrected"]["rel"]["worst"]
    assert "profile" not in content["hazard, two steps"]["time_ratio"]


@pytest.mark.slow
def test_the_step_edge_prints_and_writes(monkeypatch, tmp_path, capsys):
    absent = ("absent", "gaussians", "no-such-set")
    wanted = {"searchlight": (("hazard", "hazard", "regenerated"), ("Liang, printed", "liang", "published"), absent)}
    monkeypatch.setattr(step_edge, "WANTED", wanted)
    monkeypatch.setattr(step_edge, "ALPHAS", (0.8,))
    numbers = tmp_path / "numbers.json"
    step_edge.main(["--samples", "16", "--trials", "100", "--json", str(numbers)])
    printed = capsys.readouterr().out
    assert "left out: absent: constants must be" in printed
    assert "16 lattice samples under searchlight light" in printed
    found = json.loads(numbers.read_text())["laws"]["searchlight"]
    assert found["hazard"]["bias"][0] < 0.003 < 0.1 < found["Liang, printed"]["bias"][0]
    assert abs(found["hazard"]["random"][0] - 1.0) < 0.05 < found["exact, uniform radii"]["random"][0] - 1.0

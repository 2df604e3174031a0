"""The table of the step edge, small."""

import json

import pytest

from benchmarks import step_edge


@pytest.mark.slow
def test_prints_and_writes(monkeypatch, tmp_path, capsys):
    absent = ("absent", "gaussians", "no-such-set")
    wanted = {"searchlight": (("hazard", "hazard", "regenerated"), ("Liang, printed", "liang", "published"), absent)}
    monkeypatch.setattr(step_edge, "WANTED", wanted)
    monkeypatch.setattr(step_edge, "ALPHAS", (0.8,))
    numbers = tmp_path / "numbers.json"
    step_edge.main(["--samples", "16", "--trials", "100", "--json", str(numbers)])
    printed = capsys.readouterr().out
    assert "left out: absent: constants must be" in printed
    assert "16 lattice samples under searchlight light" in printed
    laws = json.loads(numbers.read_text())["laws"]["searchlight"]
    assert laws["hazard"]["bias"][0] < 0.003 < 0.1 < laws["Liang, printed"]["bias"][0]
    assert abs(laws["hazard"]["random"][0] - 1.0) < 0.05 < laws["exact, uniform radii"]["random"][0] - 1.0

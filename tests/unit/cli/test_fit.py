"""`profilefit fit` as a user meets it."""

import json
import math
from pathlib import Path

import pytest

from tests.fixtures import EXAMPLES

PHANTOM, LAYERS = EXAMPLES["phantom.csv"], EXAMPLES["two_layers.mco"]


@pytest.mark.slow
def test_a_phantom_is_told_in_100_columns_with_figures_and_json(done):
    out = done("fit", PHANTOM, "--out", "out", said="wrote fit.json and 4 figures into out\n")
    lines = out.splitlines()
    assert max(map(len, lines)) <= 100
    assert lines[0] == "phantom.csv: 20 points, exact light, searchlight, n = 1, g = 0"
    (row,) = [line.split() for line in lines if line.startswith("mu_s'  ") and line.endswith("1/mm")]
    assert abs(float(row[1]) - 0.95 / 1.1) < 3 * float(row[2])
    assert any(line.startswith("no misfit is detected") for line in lines)
    figures = {f"fit-{name}.{kind}" for name in ("residuals", "corner") for kind in ("png", "svg")}
    assert {one.name for one in Path("out").iterdir()} == {"fit.json", *figures}
    found = json.loads(Path("out/fit.json").read_text())
    assert found["result"] == found["posterior"]["result"] == "converged"
    assert (found["law"]["record"], found["law"]["rel"]) == (None, 0)
    assert len(found["data"]["sha256"]) == 64
    assert found["versions"]["profilefit"]
    alpha = found["quantities"]["alpha"]
    assert alpha["interval_95_total"][0] < 0.95 < alpha["interval_95_total"][1]
    assert half(alpha["interval_95_data"]) == pytest.approx(1.96 * alpha["statistical_error"], rel=0.2), "the chain"
    assert found["quantities"]["scale"]["interval_95_data"] is None
    assert "95 %: interval by all of these errors together" in " ".join(out.split())
    assert "a pencil beam is assumed: a Gaussian one of 1/e^2 radius 0.06" in " ".join(out.split())


@pytest.mark.slow
def test_a_law_in_place_of_exact_light_brings_its_own_error(done):
    out = done("fit", PHANTOM, "--law", "hazard", "--out", "out", said=None)
    assert out.startswith("phantom.csv: 20 points, law hazard, searchlight")
    found = json.loads(Path("out/fit.json").read_text())
    assert found["law"]["record"] == "hazard.json"
    assert len(found["law"]["record_sha256"]) == 64
    length = found["quantities"]["l"]
    joint = 1.96 * math.hypot(length["statistical_error"], length["law_error"])
    assert length["law_error"] > 0.3 * length["statistical_error"]
    assert half(length["interval_95_total"]) == pytest.approx(joint, rel=0.06), "the law's error as well"


def half(ends):
    return (ends[1] - ends[0]) / 2


@pytest.mark.slow
def test_errors_from_three_replicates_are_said_to_be_estimates(done):
    """Table, JSON and chain have one and the same width: Student's of the trend's freedom, and Meier's factor."""
    rows = [line.split(",") for line in Path(PHANTOM).read_text().splitlines()[2:]]
    text = "r [mm],value1,value2,value3\n"
    for at, (r, value, _) in enumerate(rows):
        noisy = (f"{float(value) * (1 + 0.03 * math.sin(7 * at + 2 * k)):.6g}" for k in range(3))
        text += ",".join((r, *noisy)) + "\n"
    Path("three.csv").write_text(text)
    out = done("fit", "three.csv", "--out", "out", said=None)
    found = json.loads(Path("out/fit.json").read_text())
    assert found["data"]["pooled_freedom"] == pytest.approx(0.61 * 2 * 18, rel=0.01)
    assert max(found["data"]["freedom"]) <= found["data"]["pooled_freedom"] + 2
    assert found["widening"] > 1.1
    assert found["quantile_95"] == pytest.approx(2.07, abs=0.01)
    assert f"95 % is {found['quantile_95']:.2f} times ± statistical (Student's t)" in " ".join(out.split())
    length = found["quantities"]["l"]
    assert half(length["interval_95_data"]) == pytest.approx(2.07 * length["statistical_error"], rel=0.1)


@pytest.mark.slow
def test_what_is_not_identifiable_is_reported_with_a_remedy(done):
    out = done("fit", PHANTOM, "--scale", "free", "--r-max", "0.5mm")
    assert "ARE NOT SEPARATELY IDENTIFIABLE" in out
    assert "alpha: anything fits as well" in out
    assert "is beyond the data's reach" in out
    assert "most informative additional measurement: " in out
    assert "15 of 20 rows left out, by --r-min and --r-max" in out


@pytest.mark.slow
def test_two_layers_are_a_misfit(command, done):
    """A second law to compile, that of rings."""
    refracting = json.loads(command("fit", LAYERS, "--n", "1.4", "--json")[1])
    assert "the file's n is 1, fitted as n = 1.4" in refracting["data"]["notes"]
    found = json.loads(done("fit", LAYERS, "--json", said=None))
    assert json.loads(command("fit", LAYERS, "--json")[1]) == found, "to the last digit"
    assert found["misfit"]["detected"] is True
    assert found["data"]["errors_are_bounds"] is True
    assert found["data"]["medium"]["layers"][0]["mu_a"] == 5.0
    assert found["quantities"]["mu_a"]["of_file"] == 5.0
    assert found["quantities"]["mu_a"]["misfit_error"] > 3 * found["quantities"]["mu_a"]["statistical_error"]


@pytest.mark.slow
def test_three_rows_have_limits_where_alpha_may_be_one(done):
    """One-sided, without a value, marked in the row; the same in JSON."""
    rows = Path(PHANTOM).read_text().splitlines()[1:5]
    Path("three.csv").write_text("\n".join(rows) + "\n")
    out = done("fit", "three.csv", "--out", "out", said="wrote fit.json and 4 figures into out\n")
    rows = [line.split() for line in out.splitlines()[:8]]
    table = {row[0]: row[1:] for row in rows if len(row) > 3}
    assert [table[name][:4] for name in ("A", "alpha", "mu_a")] == [
        ["–", "edge", sign, table[name][3]] for name, sign in (("A", ">"), ("alpha", ">"), ("mu_a", "<"))
    ]
    quantities = json.loads(Path("out/fit.json").read_text())["quantities"]
    for name, (low, high) in {"A": (0.4, 1.0), "alpha": (0.9, 1.0), "mu_a": (0.0, 0.09)}.items():
        one = quantities[name]
        assert (one["value"], one["at_edge"], one["statistical_error"]) == (None, True, None)
        limits = one["interval_95_data"]
        assert limits.count(None) == 1
        assert limits[0 if name != "mu_a" else 1] == pytest.approx(float(table[name][3]), rel=0.01)
        assert low < float(table[name][3]) < high
    length = quantities["l"]
    assert length["at_edge"] is False
    assert length["interval_95_data"][0] < length["value"] < length["interval_95_data"][1]
    assert length["statistical_error"] is None, "derivatives at the edge are no errors"


def test_light_that_no_medium_gives_is_a_misfit_at_the_edge(done):
    """Five times as much as is there."""
    out = done("fit", PHANTOM, "--scale", "0.2")
    assert "AT AN EDGE: alpha runs to 1" in out
    assert "MISFIT (p-value below 1e-16)" in out

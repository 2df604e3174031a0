"""CSV that says what its numbers mean and where they were measured."""

import csv
import io
import re

import pytest

from profilefit.errors import InputError
from profilefit.report.tables import tradeoff_tables
from profilefit.studies.tradeoff import parts, stopwatch
from profilefit.studies.tradeoff.points import Panel, Point, TradeoffPart, WithSpread

POINTS = (
    Point(
        "p", "one", "few", WithSpread(1.0, 0.9, 1.1), WithSpread(0.5, 0.4, 0.6), WithSpread.exactly(0.7), {"photons": 3}
    ),
    Point("p", 'two, "quoted"', "", WithSpread.exactly(2.0), WithSpread.exactly(1 / 3), None, {"stated": 0.25}),
)
PART = TradeoffPart(
    "demo", "A title", (Panel("p", "R$_d$ of p", "time [s]", "error [-]", POINTS),), ("left out: three",)
)


def test_csv_reads_back_with_its_comments():
    text = tradeoff_tables.as_csv(PART, {"processor": "a chip"})
    comments = [line for line in text.splitlines() if line.startswith("#")]
    assert comments[:2] == ["# demo: A title", "# processor: a chip"]
    assert "# panel p: R_d of p; cost: time [s]; error, worst: error [-]" in comments
    assert comments[-1] == "# left out: three"
    rows = list(csv.DictReader(io.StringIO("\n".join(text.splitlines()[len(comments) :]))))
    assert [row["method"] for row in rows] == [point.method for point in POINTS]
    assert [float(rows[0][key]) for key in ("cost_low", "cost", "cost_high", "worst")] == [0.9, 1.0, 1.1, 0.7]
    assert (rows[0]["photons"], rows[0]["stated"], rows[1]["photons"], rows[1]["stated"]) == ("3", "", "", "0.25")
    assert (rows[1]["worst"], rows[1]["error"]) == ("", "0.333333")
    assert [row["standing"] for row in rows] == ["front", "front"]


def test_every_column_is_documented():
    columns = [
        *("panel", "method", "label", "cost", "error", "worst", "standing", "times_yardstick", "constants"),
        *("functions", "setup_nanoseconds", "ks", "worst_ks", "photons", "first_call", "stated", "samples"),
        *("standardised", "light_seconds", "seeds", "converged"),
    ]
    told = re.findall(r"\w+", tradeoff_tables.__doc__)
    assert [column for column in columns if column not in told] == []


def test_json_has_the_same():
    numbers = tradeoff_tables.as_numbers(PART)
    point = numbers["panels"]["p"]["points"][0]
    assert point["cost"] == {"value": 1.0, "low": 0.9, "high": 1.1}
    assert point["standing"] == "front"
    assert numbers["notes"] == ["left out: three"]


def test_machine_is_named():
    facts = stopwatch.facts(pinned=True)
    assert facts["processor"]
    assert facts["cores"].endswith("pinned to one")
    assert all(version in stopwatch.caption(facts) for version in (facts["jax"], facts["processor"]))


def test_parts_come_in_their_own_order():
    assert parts.chosen([]) == ["truth", "laws", "samplers", "fits"]
    assert parts.chosen(["fits", "truth", "fits"]) == ["truth", "fits"]
    with pytest.raises(InputError, match="part must be one of truth, laws, samplers, fits, sea, fur, got 'light'"):
        parts.chosen(["laws", "light"])

"""Speed against accuracy: charts with labels that keep off each other, CSV that says what its numbers mean."""

import csv
import io
import re

import matplotlib
import numpy as np
import pytest

from profilefit.report.figures import tradeoff_figure as figure
from profilefit.report.figures.canvas import canvas
from profilefit.report.figures.tradeoff_figure import box_of, place_labels, renderer_of
from profilefit.report.tables import tradeoff_tables
from profilefit.studies.tradeoff import parts, stopwatch
from profilefit.studies.tradeoff.points import Panel, Point, TradeoffPart, WithSpread
from tests.unit.report.test_tables import rendered

NUMBERS = {"a": (1.0, 0.5), "b": (2.0, 0.1), "normalized diffusion": (2.1, 0.11), "slow": (40.0, 0.8)}
POINTS = tuple(
    Point("p", name, "1e5 photons" if x == 1.0 else "", *(WithSpread(v, 0.9 * v, 1.1 * v) for v in (x, y)))
    for name, (x, y) in NUMBERS.items()
)
PART = TradeoffPart("demo", "Demo", (Panel("p", "R$_d$ of p", "time [s]", "error [-]", POINTS),), ("left out: three",))


@pytest.mark.slow
def test_labels_keep_off_each_other_and_inside():
    """Negative control: where there is no room, overlaps are counted and not denied."""
    chart, crowded = canvas(4.0), canvas(1.2, width=1.6)
    axes, small = chart.subplots(), crowded.subplots()
    axes.set(xscale="log", yscale="log", xlim=(0.5, 2.0), ylim=(0.01, 1.0))
    small.set(xlim=(0.0, 2.0), ylim=(0.0, 1.0))
    for one in (chart, crowded):
        one.draw_without_rendering()
    chart.set_layout_engine("none")
    labels = [(f"law number {i}", 1.0 + 0.01 * i, 0.1) for i in range(6)]
    bar = box_of(axes, [(1.0, 0.1), (1.0, 0.5)], 2.0)
    assert place_labels(axes, labels, [bar]) == [0.0] * 6
    inside = axes.get_window_extent(renderer_of(axes))
    boxes = [matplotlib.text.Text.get_window_extent(text, renderer_of(axes)) for text in axes.texts]
    for i, box in enumerate(boxes):
        assert inside.x0 <= box.x0 < box.x1 <= inside.x1
        assert not any(box.overlaps(other) for other in (bar, *boxes[:i]))
    assert max(place_labels(small, [("a long name of a law", 1.0, 0.5)] * 8, [])) > 0.0


def test_marks_say_where_points_stand():
    axes = canvas(4.0).subplots()
    figure.draw(axes, PART.panels[0], figure.colours_of(PART.points))
    points = [line for line in axes.get_lines() if line.get_marker() in ("s", "o") and len(line.get_xdata()) == 1]
    marks = {line.get_xdata()[0]: line.get_marker() for line in points}
    assert (marks[1.0], marks[2.0], marks[40.0]) == ("s", "s", "o")
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    (steps,) = [line for line in axes.get_lines() if line.get_drawstyle() == "steps-post"]
    np.testing.assert_allclose(steps.get_xdata(), [1.0, 2.0, 2.1])  # the last two are not distinguished


@pytest.mark.parametrize(
    ("label", "first", "text"),
    [("1e5 photons", True, "a: 10$^5$ photons"), ("2e4 photons", False, "2·10$^4$ photons"), ("", True, "a")],
)
def test_efforts_are_powers_of_ten(label, first, text):
    assert figure.text_of(Point("p", "a", label, *[WithSpread.exactly(1.0)] * 2), first) == text


def test_figure_and_table(tmp_path):
    written = figure.tradeoff_figure(PART, "a chip", tmp_path)
    assert [path.name for path in written] == ["tradeoff-demo.png", "tradeoff-demo.svg"]
    assert all(path.stat().st_size > 5000 for path in written)
    lines = rendered(tradeoff_tables.tradeoff_tables(PART), 100).splitlines()
    assert lines[0] == "demo, R_d of p"
    assert any(line.split()[:1] == ["slow"] and not line.rstrip().endswith("front") for line in lines)
    assert lines[-1].strip() == "left out: three"


exactly = WithSpread.exactly
COST, ERROR = WithSpread(1.0, 0.9, 1.1), WithSpread(0.5, 0.4, 0.6)
MEASURED = (
    Point("p", "one", "few", COST, ERROR, exactly(0.7), {"photons": 3}),
    Point("p", 'two, "quoted"', "", exactly(2.0), exactly(1 / 3), None, {"stated": 0.25}),
)
TOLD = TradeoffPart("demo", "A title", (Panel("p", "R$_d$ of p", "time [s]", "error [-]", MEASURED),), ("left out",))


def test_csv_reads_back_with_its_comments_and_json_has_the_same():
    text = tradeoff_tables.as_csv(TOLD, {"processor": "a chip"})
    comments = [line for line in text.splitlines() if line.startswith("#")]
    assert comments[:2] == ["# demo: A title", "# processor: a chip"]
    assert "# panel p: R_d of p; cost: time [s]; error, worst: error [-]" in comments
    assert comments[-1] == "# left out"
    rows = list(csv.DictReader(io.StringIO("\n".join(text.splitlines()[len(comments) :]))))
    assert [row["method"] for row in rows] == [point.method for point in MEASURED]
    assert [float(rows[0][key]) for key in ("cost_low", "cost", "cost_high", "worst")] == [0.9, 1.0, 1.1, 0.7]
    assert (rows[0]["photons"], rows[0]["stated"], rows[1]["photons"], rows[1]["stated"]) == ("3", "", "", "0.25")
    assert (rows[1]["worst"], rows[1]["error"]) == ("", "0.333333")
    assert [row["standing"] for row in rows] == ["front", "front"]
    numbers = tradeoff_tables.as_numbers(TOLD)
    point = numbers["panels"]["p"]["points"][0]
    assert (point["cost"], point["standing"]) == ({"value": 1.0, "low": 0.9, "high": 1.1}, "front")
    assert numbers["notes"] == ["left out"]


def test_every_column_is_documented():
    columns = [
        *("panel", "method", "label", "cost", "error", "worst", "standing", "times_yardstick", "constants"),
        *("functions", "setup_nanoseconds", "ks", "worst_ks", "photons", "first_call", "stated", "samples"),
        *("standardised", "light_seconds", "seeds", "converged"),
    ]
    told = re.findall(r"\w+", tradeoff_tables.__doc__)
    assert [column for column in columns if column not in told] == []


def test_machine_is_named():
    facts = stopwatch.facts(pinned=True)
    assert facts["processor"]
    assert facts["cores"].endswith("pinned to one")
    assert all(version in stopwatch.caption(facts) for version in (facts["jax"], facts["processor"]))


def test_parts_come_in_their_own_order():
    assert parts.chosen([]) == ["truth", "laws", "samplers", "fits"]
    assert parts.chosen(["fits", "truth", "fits"]) == ["truth", "fits"]

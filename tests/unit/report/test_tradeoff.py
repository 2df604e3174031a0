"""Charts of speed against accuracy: labels that keep off each other, marks that say where a point stands."""

import matplotlib
import numpy as np
import pytest
from rich.console import Console

from profilefit.report.figures import tradeoff_figure as figure
from profilefit.report.figures.canvas import canvas
from profilefit.report.figures.tradeoff_figure import Label, box_of, place_labels, renderer_of
from profilefit.report.tables.tradeoff_tables import tradeoff_tables
from profilefit.studies.tradeoff.points import Panel, Point, TradeoffPart, WithSpread

NUMBERS = {"a": (1.0, 0.5), "b": (2.0, 0.1), "normalized diffusion": (2.1, 0.11), "slow": (40.0, 0.8)}
POINTS = tuple(
    Point(
        "p",
        name,
        "1e5 photons" if name == "a" else "",
        WithSpread(x, 0.9 * x, 1.1 * x),
        WithSpread(y, 0.8 * y, 1.2 * y),
    )
    for name, (x, y) in NUMBERS.items()
)
PART = TradeoffPart("demo", "Demo", (Panel("p", "R$_d$ of p", "time [s]", "error [-]", POINTS),), ("left out: three",))


@pytest.mark.slow
def test_labels_keep_off_each_other_and_inside():
    chart = canvas(4.0)
    axes = chart.subplots()
    axes.set(xscale="log", yscale="log", xlim=(0.5, 2.0), ylim=(0.01, 1.0))
    chart.draw_without_rendering()
    chart.set_layout_engine("none")
    labels = [Label(f"law number {i}", 1.0 + 0.01 * i, 0.1) for i in range(6)]
    bar = box_of(axes, [(1.0, 0.1), (1.0, 0.5)], 2.0)
    assert place_labels(axes, labels, [bar]) == [0.0] * 6
    inside = axes.get_window_extent(renderer_of(axes))
    boxes = [matplotlib.text.Text.get_window_extent(text, renderer_of(axes)) for text in axes.texts]
    for i, box in enumerate(boxes):
        assert inside.x0 <= box.x0 < box.x1 <= inside.x1
        assert not box.overlaps(bar)
        assert not any(box.overlaps(other) for other in boxes[:i])


@pytest.mark.slow
def test_crowded_labels_say_so():
    """Negative control: where there is no room, overlaps are counted and not denied."""
    chart = canvas(1.2, width=1.6)
    axes = chart.subplots()
    axes.set(xlim=(0.0, 2.0), ylim=(0.0, 1.0))
    chart.draw_without_rendering()
    assert max(place_labels(axes, [Label("a long name of a law", 1.0, 0.5)] * 8, [])) > 0.0


def test_marks_say_where_points_stand():
    axes = canvas(4.0).subplots()
    figure.draw(axes, PART.panels[0], figure.colours_of(PART.points))
    faces = {
        line.get_xdata()[0]: (line.get_marker(), line.get_markerfacecolor())
        for line in axes.get_lines()
        if line.get_marker() in ("s", "o") and len(line.get_xdata()) == 1
    }
    assert faces[1.0][0] == faces[2.0][0] == "s"
    assert faces[40.0][0] == "o"
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
    console = Console(width=100, record=True, file=open(tmp_path / "printed", "w"))  # noqa: SIM115
    for table in tradeoff_tables(PART):
        console.print(table)
    console.file.close()
    lines = console.export_text().splitlines()
    assert lines[0] == "demo, R_d of p"
    assert any(line.split()[:1] == ["slow"] and not line.rstrip().endswith("front") for line in lines)
    assert lines[-1].strip() == "left out: three"

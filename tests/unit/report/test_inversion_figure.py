"""The error map of inverse cdfs: what it draws, and what its caption reads off the records."""

import numpy as np
import pytest

from profilefit.report.figures import paper_figures as figures
from profilefit.report.figures.canvas import canvas
from profilefit.report.figures.record_figures import PAPER
from profilefit.report.records import Source
from tests.unit.report.test_figures import folder_with


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    """The paper's inverse and one other, the printed one with errors that a reader can check."""

    def edit(content):
        if content["law"] == "liang":
            content["quality"]["alpha"] = [0.1, 0.3, 0.5, 0.8, 0.9]
            for which in ("published", "regenerated"):
                content["quality"][which]["inversion_error"] = [0.04, 0.02, 0.07, 0.05, 0.083]

    return Source(folder_with(tmp_path_factory.mktemp("inverses"), "liang-inverse-whole", "quantile", edit=edit))


def test_caption_says_where_the_printed_inverse_is_worst_and_lines_are_the_records_own_numbers(source):
    caption = figures.inversion_caption(source)
    assert "up to 0.07 for α in [0.4, 0.6]" in caption
    assert caption.endswith("0.04 at α = 0.1, 0.083 at α = 0.9")
    ax = canvas(2.0).subplots()
    for name in ("liang-inverse-whole", "quantile", "hazard-diffuse"):
        figures.draw_inversion(ax, source, name)
    labels = [line.get_label() for line in ax.get_lines()]
    assert labels == ["(19)-(21) as printed", "(19)-(21) regenerated", "rational in −ln(1 − ξ)"]
    np.testing.assert_array_equal(ax.get_lines()[0].get_ydata(), [0.04, 0.02, 0.07, 0.05, 0.083])
    alpha, error = figures.inversion_points(source.fitted("quantile"))
    np.testing.assert_array_equal(ax.get_lines()[2].get_xydata(), np.column_stack([alpha, error]))
    assert np.all(error <= 1e-3)


def test_it_is_drawn_without_the_records_that_it_only_uses(source, tmp_path):
    (plan,) = (plan for plan in PAPER if plan.name == "inversion-error")
    files = plan.drawn(source, tmp_path)
    assert {file.name for file in files} == {"inversion-error.png", "inversion-error.svg"}

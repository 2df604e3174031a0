"""Data that no fit can work with are one line, whatever file they come from."""

from dataclasses import replace

import numpy as np
import pytest

from profilefit.errors import InputError
from profilefit.measured.data import MOST_ROWS, Measured, require_workable


def points(rows):
    """Light that falls as 1 / r^2, known to 2 %."""
    r = np.geomspace(0.1, 10.0, rows)
    return Measured("made up", "", r, r, r**-2, 0.02 * r**-2, np.full(rows, np.inf), "as given", "mm")


def test_what_can_be_worked_with_passes():
    require_workable(points(MOST_ROWS))
    dark = points(20)
    require_workable(replace(dark, value=np.where(dark.r > 5, 0.0, dark.value)))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"value": 1e300}, "made up: expected value between 1e-40 and 1e\\+40 in size, got 1e\\+302 in the row of r"),
        ({"value": 1e-200}, "expected value between"),
        ({"inner": 1e-200, "outer": 1e-200}, "expected r between"),
        ({"sigma": 1e300}, "expected sigma between"),
        ({"sigma": 1e-20}, "expected sigma of at least 1e-12 of the value, got 2e-20 for 100 in the row of r = 0.1"),
        ({"sigma": np.nan}, "expected sigma between"),
    ],
)
def test_numbers_whose_squares_are_no_floats(change, message):
    data = points(20)
    with pytest.raises(InputError, match=message):
        require_workable(replace(data, **{name: getattr(data, name) * times for name, times in change.items()}))


def test_too_many_rows_name_the_way_out():
    with pytest.raises(InputError, match=r"at most 500 rows, got 501: average neighbours over annuli .* or .* `r_min`"):
        require_workable(points(MOST_ROWS + 1))

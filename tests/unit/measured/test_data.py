"""Data that no fit can work with are one line, whatever file they come from; lengths with their units."""

from dataclasses import replace

import numpy as np
import pytest

from profilefit.errors import InputError
from profilefit.measured.data import MOST_ROWS, Measured, area_unit, checked_unit, factor, length, require_workable


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


def test_lengths_come_in_the_unit_of_the_data():
    assert length("l", "1.2mm", "mm") == 1.2
    assert length("l", "1.2 mm", "cm") == pytest.approx(0.12)
    assert length("l", "30um", "mm") == pytest.approx(0.03)
    assert length("l", "1e-3", "m") == 1e-3
    assert length("l", "2", "") == 2.0
    assert length("l", "500nm", "mm") == pytest.approx(5e-4)
    assert length("l", "1 inch", "cm") == pytest.approx(2.54)
    assert factor("in", "mm") == pytest.approx(25.4)


@pytest.mark.parametrize("text", ["", "mm", "-1mm", "0", "1.2.3", "1 ft", "nan", "1mm2"])
def test_what_is_no_length_is_named(text):
    with pytest.raises(InputError, match=r"^held l must be a length > 0 such as 1.2mm \(units: nm, .*\), got"):
        length("held l", text, "mm")


def test_a_unit_needs_a_unit():
    with pytest.raises(InputError, match="l must be without a unit where the data has none"):
        length("l", "1mm", "")
    with pytest.raises(InputError, match=r"^unit must be a unit of length \(nm, .*\), got 'mile'"):
        checked_unit("unit", "mile")


@pytest.mark.parametrize(
    "text", ["1/mm^2", "1/mm2", "1 / mm ^2", "mm^-2", "mm-2", "1/mm²", "/mm²", "1/(mm^2)", "mm⁻²", "mm^(-2)", "1/mm**2"]
)
def test_units_of_area(text):
    assert area_unit(text) == "mm"


@pytest.mark.parametrize("text", ["a.u.", "1/mm", "mm^2", "1/mile^2", ""])
def test_what_is_no_unit_of_area(text):
    assert area_unit(text) is None

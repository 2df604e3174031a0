"""Lengths as people write them."""

import pytest

from profilefit.errors import InputError
from profilefit.measured.data import area_unit, checked_unit, factor, length


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

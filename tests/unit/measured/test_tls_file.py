"""Records of a TLS850, written here after its format."""

import numpy as np
import pytest

from profilefit.errors import InputError
from profilefit.measured import read

PIXELS, RECORDS = 512, 9


def text(records=RECORDS, pixels=PIXELS, change=lambda rows: rows):
    """Three records a colour, the green ones twice and the blue ones three times as bright; brightest at pixel 3."""
    rng, lines = np.random.default_rng(1), ["Record, Pixel, Value"]
    for record in range(1, records + 1):
        shape = np.exp(-np.arange(pixels) / 60.0) * (1 + (record - 1) % 3)
        shape[:2] *= 0.3
        value = shape * (1 + 0.01 * rng.standard_normal(pixels))
        lines += [f"{record}, {pixel}, {one:.6g}" for pixel, one in enumerate(value, 1)]
        lines += ["", "Record finished"]
    return "\n".join(change(lines)) + "\n"


@pytest.fixture
def tls(tmp_path):
    def write(*given, **named):
        path = tmp_path / "skin.txt"
        path.write_text(text(*given, **named))
        return path

    return write


def test_records_of_a_colour_are_replicates(tls):
    found = {name: read(tls(), None, True, name) for name in ("red", "green", "blue")}
    red = found["red"]
    assert (red.unit, red.value.size, red.notes[0][:14]) == ("mm", 127, "red: 3 records")
    pixel = 20 / (PIXELS - 1)
    assert red.r[0] == pytest.approx(4.5 * pixel), "the first three are left out, four are averaged"
    np.testing.assert_allclose(red.value, np.exp(-red.r / pixel / 60), rtol=0.03)
    assert found["blue"].value[0] / red.value[0] == pytest.approx(3, rel=0.03)
    assert 0.1 < np.median(red.sigma / red.value) / (0.01 / np.sqrt(12)) < 3


@pytest.mark.parametrize(
    ("given", "colour", "scaled", "message"),
    [
        ({}, None, True, "`colour` must be one of red, green, blue, got None"),
        ({}, "red", False, "expected `scaled`, since the instrument's values are in a measure of its own"),
        ({"records": 6}, "red", True, "expected 3 records of a colour or more, got 2"),
        ({"change": lambda rows: rows[:5] + rows[6:]}, "red", True, r":6: expected records and pixels that count from"),
        ({"change": lambda rows: rows[:-7]}, "red", True, "expected records of as many pixels each, got 9 that differ"),
        ({"change": lambda rows: [*rows[:5], "1, 5, x"]}, "red", True, ":6: expected a record, a pixel and a value"),
        ({"change": lambda rows: [*rows[:5], "1, 5"]}, "red", True, ":6: expected a record, a pixel and a value"),
    ],
)
def test_what_is_wrong_is_named(tls, given, colour, scaled, message):
    with pytest.raises(InputError, match=rf"skin\.txt.*{message}"):
        read(tls(**given), None, scaled, colour)


def test_another_table_has_no_colour(tmp_path):
    path = tmp_path / "own.csv"
    path.write_text("r,value,sigma\n1,1,.1\n2,.5,.1\n3,.2,.1\n")
    with pytest.raises(InputError, match="colour must be left out but for records of a TLS850, got 'red'"):
        read(path, "mm", colour="red")

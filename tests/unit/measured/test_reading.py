"""Tables of measured light, records of a TLS850 and simulated profiles: every form that is read, every fault by row and
column, what is left out, what is merged, and which errors rings get. Data that no fit can work with are one line.
"""

import json
import os
import re
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mcml_sim import read_mco
from profilefit.errors import InputError
from profilefit.measured.data import MOST_ROWS, UNITS, Measured, area_unit, factor, length, require_workable
from profilefit.measured.reading import FEWEST_PHOTONS, NARROWEST, merged, read
from tests.fixtures import refused

HEAD = "r,value1,value2,value3\n"
GOOD = "r,value,sigma\n1,0.5,0.01\n2,0.2,0.01\n3,0.1,0.01\n"
PIXELS, RECORDS = 512, 9  # of a TLS850


@pytest.fixture
def table(tmp_path):
    """Read a table of this text."""

    def written(text, **options):
        path = tmp_path / "data.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read(path, **options)

    return written


def test_points(table):
    found = table(GOOD)
    np.testing.assert_array_equal((found.r, found.value, found.sigma), ([1, 2, 3], [0.5, 0.2, 0.1], [0.01] * 3))
    assert (found.rings, found.unit, found.errors) == (False, "", "as given")
    assert np.all(np.isinf(found.freedom))


@pytest.mark.parametrize("delimiter", [",", ";", "\t", " , "])
def test_delimiters_comments_blank_lines_and_marks(table, delimiter):
    text = "\ufeff# a phantom\r\n\r\n" + GOOD.replace(",", delimiter).replace("\n", " # seen\r\n")
    np.testing.assert_array_equal(table(text).value, table(GOOD).value)


def test_columns_may_stand_in_any_order_and_case(table):
    found = table('Sigma,R [mm],"value [1/mm^2]"\n.01,1,.5\n.01,2,.2\n.01,3,.1\n')
    np.testing.assert_array_equal(found.value, [0.5, 0.2, 0.1])
    assert found.unit == "mm"


def test_rings(table):
    found = table("r_in,r_out,value,sigma\n0,1,.5,.01\n1,2,.2,.01\n4,5,.1,.01\n", unit="um")
    np.testing.assert_array_equal((found.inner, found.outer), ([0, 1, 4], [1, 2, 5]))
    assert (found.rings, found.unit) == (True, "um")
    two_ways = table("r_in [µm],r_out (um),value,sigma\n0,1,.5,.01\n1,2,.2,.01\n4,5,.1,.01\n")
    assert UNITS[two_ways.unit] == UNITS["um"]


def test_values_per_another_area_are_converted_or_of_a_free_scale(table):
    for scaled in (False, True):  # a free scale of light per area is near 1 as well
        found = table("r [mm],value [1/cm^2],sigma\n1,50,1\n2,20,1\n3,10,1\n", scaled=scaled)
        np.testing.assert_allclose((found.value, found.sigma), ([0.5, 0.2, 0.1], [0.01] * 3))
    # Any measure will do if the scale is free.
    text = "r [mm],value [a.u.],sigma\n1,50,1\n2,20,1\n3,10,1\n"
    np.testing.assert_array_equal(table(text, scaled=True).value, [50, 20, 10])
    refused(r":1: column value: expected light per area .*, got \[a.u.\]", table, text)


def test_replicates(table):
    found = table(f"{HEAD}1,.4,.5,.6\n2,.2,.3,.25\n3,.1,.12,.11\n4,.05,.06,.04\n")
    np.testing.assert_allclose(found.value, [0.5, 0.25, 0.11, 0.05])
    assert np.all((found.sigma > 0) & (found.freedom >= 2))
    assert found.errors.startswith("standard errors of the means of 3 replicates")


SAME = [
    "rho (mm);value [1/mm²];sigma\n1;0.5;0.01\n2;0.2;0.01\n3;0.1;0.01\n",
    "ρ/mm\tvalue / mm^-2\tσ\n1\t0.5\t0.01\n2\t0.2\t0.01\n3\t0.1\t0.01\n",
    "Radius [mm]  Reflectance [1 / mm ^2]   error\n  1  0.5  0.01\n 2\t0.2 0.01\n3 0.1 0.01  \n",
    "distance (mm) R_d (mm⁻²) standard_error\n1 0.5 0.01\n2 0.2 0.01\n3 0.1 0.01\n",
    "\ufeffr [cm];value [1/cm2];standard error;;\r\n0.1;50;1;;\r\n0.2;20;1;;\r\n0.3;10;1;;\r\n",
    "r [nm],value (1/(µm**2)),sigma\n1e6,.5e-6,.01e-6\n2e6,.2e-6,.01e-6\n3e6,.1e-6,.01e-6\n",
    "r (inch),value [1/mm^2],sigma [1/mm²]\n%r,.5,.01\n%r,.2,.01\n%r,.1,.01\n" % (1 / 25.4, 2 / 25.4, 3 / 25.4),  # noqa: UP031
    "r [m],value [1/μm^2],sigma\n1e-3,.5e-6,1e-8\n2e-3,.2e-6,1e-8\n3e-3,.1e-6,1e-8\n",
]


@pytest.mark.parametrize("text", SAME, ids=[text.splitlines()[0] for text in SAME])
def test_headers_as_people_write_them(table, text):
    """All of them the same profile, in units that are converted."""
    found = table(text)
    scale = UNITS[found.unit]
    np.testing.assert_allclose(found.r * scale, [1, 2, 3])
    np.testing.assert_allclose(found.value / scale**2, [0.5, 0.2, 0.1])
    np.testing.assert_allclose(found.sigma / scale**2, 0.01)


def test_replicates_that_agree_by_accident(table):
    """Coarse numbers far out: their errors are those of the trend. And rows that all have one mean have no trend."""
    assert 0 < table(f"{HEAD}1,.4,.5,.6\n2,.2,.3,.25\n3,.1,.12,.11\n4,.05,.05,.05\n").sigma[3] < 0.01
    assert np.all(table(HEAD + "".join(f"{r},.4,.5,.6\n" for r in range(1, 9))).sigma > 0)


LONG = {
    "columns": "r," + ",".join(f"value{i}" for i in range(60_000)) + "\n",
    "empty": "r," + "," * 4_000_000,
    "words": " ".join("r" for _ in range(2_000_000)),
    "square": "r [ " * 1_000_000,
    "round": "r( " * 1_000_000,
    "blank": "r," + " " * 4_000_000 + "value",
    "long": "r," + "a " * 60_000 + "b,value,sigma",
    "lines": "\n" * 4_000_000,
    "cells": GOOD + "4" + ",5" * 2_000_000,
    "rows": GOOD + "4,0.1,0.1\n" * 300_000,
    "long profile": "r,value,sigma\n" + "".join(f"{i},1,1\n" for i in range(1, 19_000)),
    "many replicates": "r," + ",".join(f"value{i}" for i in range(1, 1000)) + "\n" + ("1" + ",1" * 999 + "\n") * 2000,
}


@pytest.mark.slow
@pytest.mark.parametrize("text", LONG.values(), ids=LONG)
def test_no_file_takes_long(table, text):
    """All of them as long as a file may be, or nearly so; the slowest reads half a million numbers."""
    started = time.process_time()
    try:
        table(text)
    except InputError as error:
        said = str(error)
        assert (len(said) < 500, "\n" in said) == (True, False)
    assert time.process_time() - started < 5


def test_the_most_columns_are_read(table):
    replicates = ",".join(f"value{i}" for i in range(1, 1000))
    rows = "".join(f"{r}," + ",".join(str(1 / r + i % 7 / 100) for i in range(999)) + "\n" for r in (1, 2, 3, 4))
    assert table(f"r,{replicates}\n{rows}").errors.startswith("standard errors of the means of 999 replicates")


BAD = {
    f"r,{','.join(f'value{i}' for i in range(1, 1001))}\n": r":1: expected at most 1000 columns, got 1001$",
    "r;value;sigma\n" + "0,5;0,12;0,01\n" * 3: r":2: column r: expected a decimal point, as in .* comma '0,5'",
    "r,value,sigma\n" + '1,"1,5e-3",1\n' * 3: r":2: column value: expected a decimal point, .* comma '1,5e-3'",
    "r,value,sigma\n0,5,0,12,0,01\n": r":2: expected 3 .*, got 6: if its numbers have decimal commas, write 0.5",
    "r,value,sigma\n1,2,3,x\n": r":2: expected 3 cells .*, got 4$",
    "r value sigma\n1 2\n": r":2: expected 3 cells between spaces, as the header has, got 2",
    "r,value1,value2,value3\n" + "1,2,,3\n" * 3: r":2: column value2: expected a finite number, since every row has",
    "r,value1,value2,value3\n1,1,2,3\n1,2,3,4\n2,1,1,2\n": r":3: column r: .*: replicates stand in one row, as value1,",
    "r,rho,value,sigma\n": r":1: expected each column once, got 'r' 2 times",
    "r [1/mm^2],value,sigma\n1,1,1\n2,1,1\n3,1,1\n": r":1: r must be in nm, .*, got '1/mm\^2'",
    f"r,{'v' * 1000},sigma\n": r":1: .*, got the column 'v{37}\.\.\.'$",
    GOOD.replace(
        "0.2", "1e300"
    ): r":3: column value: expected a number between 1e-100 and 1e\+100 in size, or 0, got '1e300'",
    GOOD.replace("0.2", "9" * 400): r":3: column value: expected a finite number, got '9+\.\.\.'$",
    "#" + "x" * 2**22: r": expected a profile of at most 4194304 bytes, got a longer file",
    "": r": expected a header and rows .*, got an empty file",
    "# only words\n": r": expected a header and rows .*, got an empty file",
    "r,value\n1,2\n": r":1: expected a header of r .*, got no column sigma",
    "value,sigma\n1,2\n": r":1: .*, got no column r$",
    "r,sigma\n1,2\n": r":1: .*, got no column value$",
    "r_in,value,sigma\n1,2,3\n": r":1: .*, got one of r_in and r_out without the other",
    "r,r_in,r_out,value,sigma\n": r":1: .*, got both r and r_in",
    "r,value [a\x1b],sigma\n": r":1: .*, got the column 'value \[a\\x1b\]'",
    "r,value1,value2\n": r":1: .*, got 2 replicates",
    "r,value,value1,value2,value3\n": r":1: .*, got replicates beside value or sigma",
    "1,2,3\n4,5,6\n": r":1: expected a header of r .*, got the column '1'",
    "angle [deg],value\n1,2\n": r"got the column 'angle'; a phase function is fitted with `--kind phase`",
    "r,value,sigma\n1,2,.1\n2,1,.1\n": r": expected at least 3 rows under the header, got 2",
    GOOD + "4,0.05\n": r":5: expected 3 cells between commas, as the header has, got 2",
    **{
        GOOD.replace("0.2", cell): f":3: column value: expected a finite number, got '{cell}'"
        for cell in ("1e400", "zero", "nan", "", "inf", "1_0")
    },
    **{
        GOOD.replace("0.2,0.01", f"0.2,{error}"): f":3: column sigma: expected a standard error > 0, got {error}"
        for error in ("0", "-0.01")
    },
    "r,value1,value2,value3\n1,-1,0,1\n2,-1,0,1\n3,-1,0,1\n4,-1,0,1\n": r": expected a value above 0, got none",
    GOOD.replace("\n2,", "\n0.5,"): r":3: column r: expected r to rise above 1, got 0.5",
    GOOD.replace("\n2,", "\n1,"): r":3: column r: expected r to rise above 1, got 1",
    GOOD.replace("\n1,", "\n0,"): r":2: column r: expected a radius > 0, since the profile is infinite at 0, got 0",
    GOOD.replace("\n1,", "\n-1,"): r":2: column r: expected a radius > 0",
    GOOD.replace("0.5", "-1").replace("0.2", "-1").replace("0.1", "0"): r": expected a value above 0, got none",
    "r_in,r_out,value,sigma\n1,1,2,.1\n2,3,1,.1\n3,4,1,.1\n": r":2: column r_out: expected more than r_in 1, got 1",
    "r_in,r_out,value,sigma\n0,2,2,.1\n1,3,1,.1\n3,4,1,.1\n": r":3: column r_in: expected at least the r_out 2 before",
    "r,value1,value2,value3\n1,2,2,2\n2,1,1,1\n3,1,1,1\n": r":2: column value1: expected replicates that differ, here",
    "r,value [1/mm^2],sigma\n1,1,1\n2,1,1\n3,1,1\n": r":1: column r: expected a unit, as value has one",
    'r,value,sigma\n1,"2,3\n2,1,1\n3,1,1\n': r":2: expected cells between commas, got: unexpected end of data",
    b"\x89PNG\r\n\x1a\n\x00\x00": r":1: expected text in UTF-8, got the byte 0x89",
    b"r,value,sigma\n1,2\x00,3\n": r":2: expected text in UTF-8, got the byte 0x00",
    b"\xef\xbb\xbfr,value,sigma\n1,2\xff,3\n": r":2: expected text in UTF-8, got the byte 0xff",
}


@pytest.mark.parametrize(("text", "message"), BAD.items(), ids=[f"{i}" for i in range(len(BAD))])
def test_faults_are_one_line_with_file_row_and_column(table, tmp_path, text, message):
    assert refused(message, table, text).startswith(str(tmp_path / "data.csv"))


def test_units_that_contradict(table):
    refused(":1: column r: expected one unit, here and in `unit`, got cm, mm", table, "r [mm]" + GOOD[1:], unit="cm")
    refused(r"^unit must be one of nm, .*, got 'ell'", table, GOOD, unit="ell")
    mixed = GOOD.replace("value", "value [1/mm^2]").replace("sigma", "sigma [%]")
    refused(r":1: column sigma: expected the unit of value, \[1/mm\^2\], or none, got", table, mixed, unit="mm")


def test_a_pipe_is_read_once(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    writer = threading.Thread(target=pipe.write_text, args=(GOOD,))
    writer.start()
    np.testing.assert_array_equal(read(pipe).value, [0.5, 0.2, 0.1])
    writer.join()


def test_a_file_that_is_not_there(tmp_path):
    refused(r"nothing.csv: expected a file that can be read, got: No such file", read, tmp_path / "nothing.csv")
    refused(r"expected a file that can be read, got: Is a directory", read, tmp_path)


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
def test_what_is_wrong_in_records_is_named(tls, given, colour, scaled, message):
    refused(rf"skin\.txt.*{message}", read, tls(**given), None, scaled, colour)


def test_another_table_has_no_colour(table):
    refused("colour must be left out but for records of a TLS850, got 'red'", table, GOOD, unit="mm", colour="red")


DATA = Path(__file__).parents[3] / "examples"


def test_rings_are_merged_until_each_holds_enough_photons():
    edges, photons = np.arange(9.0), np.array([500, 400, 60, 60, 0, 99, 2, 0])
    np.testing.assert_array_equal(merged(edges, photons), [0, 1, 2, 4])
    np.testing.assert_array_equal(merged(edges, np.zeros(8)), [])
    fine = np.linspace(0, 1, 1001)
    starts = merged(fine, np.full(1000, 1e6))
    outer = np.append(fine[starts[1:]], 1.0)
    assert np.all(outer - fine[starts] > 0.999 * NARROWEST * outer)
    assert starts.size < 200


def test_an_mco_has_bounds_for_errors_and_no_last_ring():
    found, raw = read(DATA / "half_space.mco"), read_mco(DATA / "half_space.mco")
    assert (found.unit, found.counted, found.bounded, found.rings) == ("cm", True, True, True)
    assert found.outer[-1] == pytest.approx(raw.run.grid.r_edges[-2])
    areas = np.pi * (found.outer**2 - found.inner**2)
    energy = (raw.reflectance_r * raw.run.grid.r_areas)[:-1].sum()
    assert np.sum(found.value * areas) == pytest.approx(energy), "no light is lost where rings are merged"
    counts = found.value * areas * raw.run.photons
    assert counts.min() > FEWEST_PHOTONS
    photons = raw.run.photons
    assert found.photons == photons
    np.testing.assert_allclose((found.sigma / found.value) ** 2, 1 / counts - 1 / (photons - 1))
    assert found.notes[0] == "the last of 120 annuli, which holds all light beyond it, is left out"
    assert "119 annuli merged into" in found.notes[1]


def test_an_npz_has_its_own_errors_and_keeps_every_ring():
    """The same run as the .mco."""
    exact, bound = read(DATA / "half_space.npz"), read(DATA / "half_space.mco")
    assert (exact.counted, exact.bounded, exact.outer[-1]) == (True, False, pytest.approx(1.2))
    assert exact.medium is not None
    assert (exact.medium.layers[0].mu_s, exact.photons) == (9.0, bound.photons)
    same = slice(0, 30)  # not merged yet
    np.testing.assert_allclose(exact.value[same], bound.value[same], rtol=1e-4)
    assert np.all(exact.sigma[same] < bound.sigma[same]), "a bound is one"
    assert exact.inner.size < 120, "the empty tail belongs to the last ring"
    with pytest.raises(InputError, match=r"^unit must be cm or left out for .npz, whose lengths are in cm, got 'mm'"):
        read(DATA / "half_space.npz", unit="mm")


TOO_MUCH = "expected annuli of reflectance >= 0 that add up to at most 1"


def test_light_that_no_run_gives_is_one_line(tmp_path):
    text = (DATA / "half_space.mco").read_text()
    head, mark, rest = text.partition("\nRd_r #")
    for name, changed_text, message in (
        ("few", text.replace("2097152 \t", "50 \t"), r"expected at least 3 annuli .*, got \d\d in"),
        ("bright", head + mark + rest.replace(rest.split("\n")[1], "1E+20", 1), TOO_MUCH),
        ("mirror", re.sub(r"0\s*\t#Spec", "1 \t#Spec", text), "expected a specular reflectance below 1, got 1$"),
    ):
        (tmp_path / f"{name}.mco").write_text(changed_text)
        refused(f"{name}.mco: {message}", read, tmp_path / f"{name}.mco")
    (tmp_path / "bad.npz").write_bytes(b"PK")
    refused(r"bad.npz: expected results of mcml_sim, got: not a whole .npz file", read, tmp_path / "bad.npz")
    with np.load(DATA / "half_space.npz") as whole:
        arrays = dict(whole)

    def changed(name, times):
        np.savez(tmp_path / "bad.npz", **{**arrays, name: arrays[name] * times})
        return tmp_path / "bad.npz"

    for name, times, message in (
        ("reflectance_r", 1e300, TOO_MUCH),
        ("reflectance_r", -1, "expected annuli of reflectance >= 0"),
        ("reflectance_r_standard_error", 1e300, "expected standard errors of no more than all of the light"),
        ("reflectance_r_standard_error", 0, r"expected a standard error > 0 of the light from r = [\d.]+ to [\d.]+$"),
    ):
        refused(f"bad.npz: {message}", read, changed(name, times))
    header = json.loads(str(arrays["header"])) | {"photons": 1}
    np.savez(tmp_path / "bad.npz", **{**arrays, "header": np.array(json.dumps(header))})
    refused(r"bad.npz: expected two photons or more, .*, got 1", read, tmp_path / "bad.npz")
    assert read(changed("reflectance_r", 1)).photons > 2


def test_rows_can_be_chosen():
    data = read(DATA / "phantom.csv")
    near = data.within(None, 1.0)
    assert near.r.max() <= 1.0
    assert near.notes == ("12 of 20 rows left out, by `r_min` and `r_max`",)
    assert data.within(0.1, 100.0) is data
    refused(r"no row is left between `r_min` and `r_max`: r goes from 0.2 to 12", data.within, 20.0, None)
    assert replace(data, unit="m").relative_error == pytest.approx(0.02, rel=0.1)


def points(rows):
    """Light that falls as 1 / r^2, known to 2 %."""
    r = np.geomspace(0.1, 10.0, rows)
    return Measured("made up", "", r, r, r**-2, 0.02 * r**-2, np.full(rows, np.inf), "as given", "mm")


def test_what_can_be_worked_with_passes_and_too_many_rows_name_the_way_out():
    require_workable(points(MOST_ROWS))
    dark = points(20)
    require_workable(replace(dark, value=np.where(dark.r > 5, 0.0, dark.value)))
    with pytest.raises(InputError, match=r"at most 500 rows, got 501: average neighbours over annuli .* or .* `r_min`"):
        require_workable(points(MOST_ROWS + 1))


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


def test_lengths_come_in_the_unit_of_the_data():
    assert (length("l", "1.2mm", "mm"), length("l", "1.2 mm", "cm")) == (1.2, pytest.approx(0.12))
    assert (length("l", "30um", "mm"), length("l", "1e-3", "m")) == (pytest.approx(0.03), 1e-3)
    assert (length("l", "2", ""), length("l", "500nm", "mm")) == (2.0, pytest.approx(5e-4))
    assert length("l", "1 inch", "cm") == pytest.approx(2.54)
    assert factor("in", "mm") == pytest.approx(25.4)
    for text in ("", "mm", "-1mm", "0", "1.2.3", "1 ft", "nan", "1mm2"):
        refused(r"^held l must be a length > 0 such as 1.2mm \(units: nm, .*\), got", length, "held l", text, "mm")
    refused("l must be without a unit where the data has none", length, "l", "1mm", "")


OF_AREA = ("1/mm^2", "1/mm2", "1 / mm ^2", "mm^-2", "mm-2", "1/mm²", "/mm²", "1/(mm^2)", "mm⁻²", "mm^(-2)", "1/mm**2")
NOT_OF_AREA = ("a.u.", "1/mm", "mm^2", "1/mile^2", "")


@pytest.mark.parametrize(("text", "unit"), [*((one, "mm") for one in OF_AREA), *((one, None) for one in NOT_OF_AREA)])
def test_units_of_area(text, unit):
    assert area_unit(text) == unit

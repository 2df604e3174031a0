"""Tables of measured light: every form that is read, and every fault by file, row and column."""

import numpy as np
import pytest

from profilefit.errors import InputError
from profilefit.measured.table_file import read_table

GOOD = "r,value,sigma\n1,0.5,0.01\n2,0.2,0.01\n3,0.1,0.01\n"


@pytest.fixture
def table(tmp_path):
    """Read a table of this text."""

    def read(text, **options):
        path = tmp_path / "data.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_table(path, **options)

    return read


def test_points(table):
    found = table(GOOD)
    assert not found.rings
    np.testing.assert_array_equal(found.r, [1, 2, 3])
    np.testing.assert_array_equal(found.value, [0.5, 0.2, 0.1])
    np.testing.assert_array_equal(found.sigma, 0.01)
    assert (found.unit, found.errors) == ("", "as given")
    assert np.all(np.isinf(found.freedom))


@pytest.mark.parametrize("delimiter", [",", ";", "\t", " , "])
def test_delimiters_comments_blank_lines_and_marks(table, delimiter):
    text = "\ufeff# a phantom\r\n\r\n" + GOOD.replace(",", delimiter).replace("\n", " # seen\r\n")
    np.testing.assert_array_equal(table(text).value, table(GOOD).value)


def test_columns_may_stand_in_any_order_and_case(table):
    text = 'Sigma,R [mm],"value [1/mm^2]"\n.01,1,.5\n.01,2,.2\n.01,3,.1\n'
    found = table(text)
    np.testing.assert_array_equal(found.value, [0.5, 0.2, 0.1])
    assert found.unit == "mm"


def test_rings(table):
    found = table("r_in,r_out,value,sigma\n0,1,.5,.01\n1,2,.2,.01\n4,5,.1,.01\n", unit="um")
    assert found.rings
    np.testing.assert_array_equal(found.inner, [0, 1, 4])
    np.testing.assert_array_equal(found.outer, [1, 2, 5])
    assert found.unit == "um"


def test_values_per_another_area_are_converted(table):
    found = table("r [mm],value [1/cm^2],sigma\n1,50,1\n2,20,1\n3,10,1\n")
    np.testing.assert_allclose(found.value, [0.5, 0.2, 0.1])
    np.testing.assert_allclose(found.sigma, 0.01)


def test_any_measure_will_do_if_the_scale_is_free(table):
    text = "r [mm],value [a.u.],sigma\n1,50,1\n2,20,1\n3,10,1\n"
    np.testing.assert_array_equal(table(text, scaled=True).value, [50, 20, 10])
    with pytest.raises(InputError, match=r":1: column value: expected light per area .*, got \[a.u.\]"):
        table(text)


def test_replicates(table):
    found = table("r,value1,value2,value3\n1,.4,.5,.6\n2,.2,.3,.25\n3,.1,.12,.11\n4,.05,.06,.04\n")
    np.testing.assert_allclose(found.value, [0.5, 0.25, 0.11, 0.05])
    assert np.all(found.sigma > 0)
    assert np.all(found.freedom >= 2)
    assert found.errors.startswith("standard errors of the means of 3 replicates")


BAD = {
    "": r": expected a header and rows .*, got an empty file",
    "# only words\n": r": expected a header and rows .*, got an empty file",
    "r,value\n1,2\n": r":1: expected a header of r .*, got no column sigma",
    "value,sigma\n1,2\n": r":1: .*, got no column r$",
    "r,sigma\n1,2\n": r":1: .*, got no column value$",
    "r_in,value,sigma\n1,2,3\n": r":1: .*, got one of r_in and r_out without the other",
    "r,r_in,r_out,value,sigma\n": r":1: .*, got both r and r_in",
    "r,value,sigma,colour\n": r":1: .*, got the column 'colour'",
    "r,value,value,sigma\n": r":1: expected each column once, got 'value' 2 times",
    "r,value1,value2\n": r":1: .*, got 2 replicates",
    "r,value,value1,value2,value3\n": r":1: .*, got replicates beside value or sigma",
    "1,2,3\n4,5,6\n": r":1: expected a header of r .*, got the column '1'",
    "r,value,sigma\n1,2,.1\n2,1,.1\n": r": expected at least 3 rows under the header, got 2",
    GOOD + "4,0.05\n": r":5: expected 3 cells between commas, as the header has, got 2",
    GOOD.replace("0.2", "zero"): r":3: column value: expected a finite number, got 'zero'",
    GOOD.replace("0.2", "nan"): r":3: column value: expected a finite number, got 'nan'",
    GOOD.replace("0.2", ""): r":3: column value: expected a finite number, got ''",
    GOOD.replace("0.2", "inf"): r":3: column value: expected a finite number, got 'inf'",
    GOOD.replace("0.2", "1_0"): r":3: column value: expected a finite number, got '1_0'",
    GOOD.replace("0.2", "x" * 90): r":3: column value: expected a finite number, got 'x+\.\.\.'$",
    GOOD.replace("0.2,0.01", "0.2,-0.01"): r":3: column sigma: expected a standard error > 0, got -0.01",
    GOOD.replace("0.2,0.01", "0.2,0"): r":3: column sigma: expected a standard error > 0, got 0",
    GOOD.replace("\n2,", "\n0.5,"): r":3: column r: expected r to rise above 1, got 0.5",
    GOOD.replace("\n2,", "\n1,"): r":3: column r: expected r to rise above 1, got 1",
    GOOD.replace("\n1,", "\n0,"): r":2: column r: expected a radius > 0, since the profile is infinite at 0, got 0",
    GOOD.replace("\n1,", "\n-1,"): r":2: column r: expected a radius > 0",
    GOOD.replace("0.5", "-1").replace("0.2", "-1").replace("0.1", "0"): r": expected some light, got no value above 0",
    "r_in,r_out,value,sigma\n1,1,2,.1\n2,3,1,.1\n3,4,1,.1\n": r":2: column r_out: expected more than r_in 1, got 1",
    "r_in,r_out,value,sigma\n0,2,2,.1\n1,3,1,.1\n3,4,1,.1\n": r":3: column r_in: expected at least the r_out 2 before",
    "r,value1,value2,value3\n1,2,2,2\n2,1,1,1\n3,1,1,1\n": r":2: column value1: expected replicates that differ, got 0",
    "r [furlong],value,sigma\n1,1,1\n2,1,1\n3,1,1\n": r":1: column r: expected a unit of um, .*, got 'furlong'",
    "r,value [1/mm^2],sigma\n1,1,1\n2,1,1\n3,1,1\n": r":1: column r: expected a unit, as value has one",
    'r,value,sigma\n1,"2,3\n2,1,1\n3,1,1\n': r":2: expected cells between commas, got: unexpected end of data",
    b"\x89PNG\r\n\x1a\n\x00\x00": r":1: expected text in UTF-8, got the byte 0x89",
    b"r,value,sigma\n1,2\x00,3\n": r":2: expected text in UTF-8, got the byte 0x00",
}


@pytest.mark.parametrize(("text", "message"), BAD.items(), ids=range(len(BAD)))
def test_faults_are_one_line_with_file_row_and_column(table, tmp_path, text, message):
    with pytest.raises(InputError, match=message) as error:
        table(text)
    assert str(error.value).startswith(str(tmp_path / "data.csv"))
    assert "\n" not in str(error.value)


def test_units_that_contradict(table):
    with pytest.raises(InputError, match=r":1: column r: expected one unit, here and in --unit, got cm, mm"):
        table(GOOD.replace("r,", "r [mm],"), unit="cm")
    with pytest.raises(InputError, match=r"--unit must be a unit of length .*, got 'ell'"):
        table(GOOD, unit="ell")
    mixed = GOOD.replace("value", "value [1/mm^2]").replace("sigma", "sigma [%]")
    with pytest.raises(InputError, match=r":1: column sigma: expected the unit of value, \[1/mm\^2\], or none, got"):
        table(mixed, unit="mm")


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match=r"nothing.csv: expected a file that can be read, got: No such file"):
        read_table(tmp_path / "nothing.csv")
    with pytest.raises(InputError, match=r"expected a file that can be read, got: Is a directory"):
        read_table(tmp_path)

"""MCML's input files: what V1 accepts is read, and what nobody should accept is one line that says where and why."""

import contextlib
import math
import re
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from mcml_sim import Grid, InputError, Layer
from mcml_sim.results.mci import MAX_BYTES, MAX_CELLS, parse_mci, read_mci
from tests.fixtures import refused

DATA = Path(__file__).parent / "data"

# A line for each value, so that a test can break them one at a time.
SMALL = """1.0
1
out.mco A
1000
0.01 0.02
3 4 5
2
1.1
1.4 1 90 0.9 0.1
1.5 2 80 0.8 0.3
1.2
"""


def written(tmp_path, text: str | bytes) -> Path:
    path = tmp_path / "small.mci"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def with_line(number: int, line: str) -> str:
    lines = SMALL.splitlines()
    lines[number - 1] = line
    return "\n".join(lines) + "\n"


def test_reads_the_runs_of_the_template_and_the_example(tmp_path):
    first, second = read_mci(DATA / "template.mci")
    assert (first.output, first.format, first.photons) == ("temp1.mco", "A", 10)
    assert (first.dz, first.dr, first.nz, first.nr, first.na) == (20e-4, 20e-4, 10, 20, 30)
    assert first.medium.layers == (Layer(1.3, 20, 200, 0.7, 0.01), Layer(1.4, 10, 200, 0.9, 1e8))
    assert not first.medium.is_half_space, "1E8 cm stays a length, as in V1"
    assert (second.output, second.photons, second.medium.layers) == ("temp2.mco", 20, (Layer(1.4, 10, 200, 0.7, 1e8),))
    assert second.grid == Grid(20e-4, 80, 20e-4, 80, na=30)
    # And the three layers of the example.
    (run,) = read_mci(str(DATA / "example.mci"))
    rows = [(1.37, 1, 100, 0.9, 0.1), (1.37, 1, 10, 0, 0.1), (1.37, 2, 10, 0.7, 0.2)]
    assert (run.medium.layers, run.medium.n_above, run.medium.n_below) == (tuple(Layer(*row) for row in rows), 1, 1)
    assert (run.photons, run.grid) == (1_000_000, Grid(0.01, 50, 0.01, 40, na=1))
    # Depths and rings are not mixed up.
    (run,) = read_mci(written(tmp_path, SMALL))
    assert (run.medium.n_above, run.medium.n_below) == (1.1, 1.2)
    np.testing.assert_allclose(run.grid.z_edges, [0, 0.01, 0.02, 0.03])
    np.testing.assert_allclose(run.grid.r_edges, [0, 0.02, 0.04, 0.06, 0.08])
    assert run.grid.angles == 5


@pytest.mark.parametrize(
    "text",
    [
        SMALL.replace("\n", "\r\n"),
        SMALL.replace("\n", "\r"),
        SMALL.replace("\n", "\n\n  \t\n# a comment 1 2 3\n"),
        SMALL.replace("\n", "# right after the value\n"),
        SMALL.replace("\n", " and more words, 1 2 3\n"),
        SMALL.replace(" ", "\t \t"),
        "\ufeff" + SMALL,
        "# \u00b5\n" + SMALL + "\nwhat follows the last run is not read, as in V1\n",
        SMALL.removesuffix("\n"),
        SMALL + "\x1a",
        SMALL.replace("0.01 0.02", "+1e-2 .2E-1").replace("1.1\n", "1.1e+0\n").replace("1000", "+1000"),
        # Comments may have any bytes.
        SMALL.encode().replace(b"1000\n", b"1000 \xb5 photons # \xe9t\xe9\n").replace(b"1.2\n", b"1.2\n# \xff\n"),
    ],
)
def test_form_does_not_matter(tmp_path, text):
    assert read_mci(written(tmp_path, text)) == read_mci(written(tmp_path, SMALL))


@pytest.mark.parametrize(
    ("line", "form"), [("A", "A"), ("B", "B"), ("b", "B"), ("binary", "B"), ("ASCII", "A"), ("", "A"), ("# x", "A")]
)
def test_format_is_the_first_letter_as_in_v1(tmp_path, line, form):
    (run,) = read_mci(written(tmp_path, with_line(3, f"out.mco {line}")))
    assert (run.output, run.format) == ("out.mco", form)


def test_last_layer_may_be_endless_and_any_clear_glass(tmp_path):
    for word in ("inf", "Inf", "INFINITY", "+inf"):
        (run,) = read_mci(written(tmp_path, with_line(10, f"1.5 2 80 0.8 {word}")))
        assert run.medium.layers[-1].thickness == math.inf
        assert run.medium.is_half_space
    with pytest.raises(InputError, match=r"small.mci:9: expected thickness of layer 1 of 2 in cm, .*, got 'inf'"):
        read_mci(written(tmp_path, with_line(9, "1.4 1 90 0.9 inf")))
    # Clear glass may have any mean cosine up to one.
    (run,) = read_mci(written(tmp_path, with_line(9, "1.5 0 0 1 0.1")))
    assert run.medium.layers[0] == Layer(1.5, 0, 0, 1, 0.1)


@pytest.mark.parametrize(
    ("number", "line", "expected", "got"),
    [
        (1, "mcmli_3.0", "the file version, 1.0 or mcmli2.0", "'mcmli_3.0'"),
        (2, "0", "the number of runs, a whole number from 1 to 10000", "'0'"),
        (2, "10001", "the number of runs, a whole number from 1 to 10000", "'10001'"),
        (2, "2", "the name of an output file, and A or B", "the end of the file"),
        (3, "a" * 256, "the name of an output file, at most 255 printable characters", f"'{'a' * 37}...'"),
        (4, "0", "the number of photons, a whole number from 1 to 10000000000000", "'0'"),
        (4, "1e6", "the number of photons, .*", "'1e6'"),
        (4, "10000000000001", "the number of photons, .*", "'10000000000001'"),
        (4, "1_000", "the number of photons, .*", "'1_000'"),
        (4, "\u0661\u0662", "the number of photons, .*", "'\u0661\u0662'"),
        (4, "9" * 5000, "the number of photons, .*", f"'{'9' * 37}...'"),
        (5, "0.01", "2 values, dz and dr", "1: '0.01'"),
        (5, "0 0.02", "dz in cm, a number from 1e-12 to 1e[+]12", "'0'"),
        (5, "0.01 nan", "dr in cm, .*", "'nan'"),
        (5, "0.01 1e999", "dr in cm, .*", "'1e999'"),
        (6, "3 4", "3 values, nz, nr and na", "2: '3 4'"),
        (6, "3 4.5 5", "nr, a number of bins, a whole number from 1 to 65536", "'4.5'"),
        (6, "3 4 65537", "na, a number of bins, .*", "'65537'"),
        (6, "65536 65536 1", f"nr nz, the cells of a table, to be at most {MAX_CELLS}", "4294967296"),
        (6, "1 65536 33", "nr na, the cells .*", "2162688"),
        (7, "1001", "the number of layers, a whole number from 1 to 1000", "'1001'"),
        (7, "3", "5 values, n, mu_a, mu_s, g and thickness of layer 3 of 3", "1: '1.2'"),
        (3, "my file.mco A", r"A or B after the name \(a name holds no spaces\)", "'file.mco'"),
        (3, "a band.mco", r"A or B after the name .*", "'band.mco'"),
        (3, "out.mco x", r"A or B after the name .*", "'x'"),
        (3, "out.mco A 7", "the name of an output file, and A or B alone", "3 values"),
        (4, "1000 5", "the number of photons alone", "2 values"),
        (5, "0.01 0.02 1e-3 mm", "dz and dr alone", "3 values"),
        (7, "1", "n below the layers alone", "5 values"),
        (9, "1.4 1 90 0.9 0.1 .5", "n, mu_a, mu_s, g and thickness of layer 1 of 2 alone", "6 values"),
        (9, "1.4 1e-38 90 0.9 0.1", "mu_a of layer 1 of 2 in 1/cm, 0 or a number .*", "'1e-38'"),
        (8, "0", "n above the layers, a number from 0.01 to 100", "'0'"),
        (9, "1.4 1 90 0.9", "5 values, n, mu_a, mu_s, g and thickness of layer 1 of 2", "4: '1.4 1 90 0.9'"),
        (9, "1.4 -1 90 0.9 0.1", "mu_a of layer 1 of 2 in 1/cm, 0 or a number from 1e-12 to 1e[+]12", "'-1'"),
        (9, "1.4 1 1e13 0.9 0.1", "mu_s of layer 1 of 2 in 1/cm, .*", "'1e13'"),
        (9, "1.4 1 90 1 0.1", "g of layer 1 of 2 between -1 and 1, or 1 where nothing scatters", "'1'"),
        (9, "1.4 0 0 -1 0.1", "g of layer 1 of 2 between -1 and 1, or 1 where nothing scatters", "'-1'"),
        (9, "1.4 1 90 1.1 0.1", "g of layer 1 of 2, a number from -1 to 1", "'1.1'"),
        (10, "1.5 2 80 0.8 0", "thickness of layer 2 of 2 in cm, .*", "'0'"),
        (10, "1.5 0 0 0 inf", "mu_a or mu_s of layer 2 of 2 above 0 where it has no end", "'0' and '0'"),
        (11, "1.2.3", "n below the layers, .*", "'1.2.3'"),
        (11, "# 1.2", "n below the layers", "the end of the file"),
    ],
)
def test_a_broken_line_is_named(tmp_path, number, line, expected, got):
    text = refused("expected", read_mci, written(tmp_path, with_line(number, line)))
    found = re.fullmatch(rf"(.*)small\.mci:([0-9]+): expected {expected}, got (.*)", text)
    assert found, text
    assert found[3] == got
    # Line 12 is after the last line's end.
    at = {"the end of the file": 12}.get(got, {"3": 11, "1": 10}.get(line, number))
    assert int(found[2]) == at


def test_two_runs_cannot_have_one_output(tmp_path):
    run = SMALL.split("\n", 2)[2]
    for again in ("out.mco", "./out.mco"):
        text = f"1.0\n2\n{run}{run.replace('out.mco', again)}"
        refused(rf"small.mci:12: expected an output file that no .*, got '{again}'", read_mci, written(tmp_path, text))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", r":1: expected the file version, 1.0 or mcmli2.0, got the end of the file"),
        (b"\n# only this\n", r":3: expected the file version, 1.0 or mcmli2.0, got the end of the file"),
        (b"1.0\r\n1\r\nout\x00.mco A\n", r":3: expected text in UTF-8, got the byte 0x00"),
        (SMALL.encode().replace(b"out", b"\xb5"), r":3: expected text in UTF-8, got the byte 0xb5"),
        (SMALL.encode().replace(b"90", b"9\xff"), r":9: expected text in UTF-8, got the byte 0xff"),
        (SMALL.encode("utf-16"), r":1: expected text in UTF-8, got the byte 0x00"),
        (b"#" * (MAX_BYTES + 1), r": expected a .mci file of at most 2097152 bytes, got a longer one"),
    ],
)
def test_what_is_no_text_is_said(tmp_path, content, message):
    refused(message, read_mci, written(tmp_path, content))


def test_what_cannot_be_opened_is_said(tmp_path):
    with pytest.raises(InputError, match=r"none.mci: expected a file that can be read, got: No such file or directory"):
        read_mci(tmp_path / "none.mci")
    for path in (tmp_path, "a\x00b", 3, None):
        with pytest.raises(InputError, match="expected a file that can be read"):
            read_mci(path)


@pytest.mark.slow
def test_no_file_takes_much_memory():
    """Those that hold the most of something; `tests/unit/hostile` reads mutants."""
    contents = [
        b"1.0\n10000\n" + SMALL.split("\n", 2)[2].encode(),
        with_line(6, "32 65536 32").encode(),
        b"1.0\n20\n"
        + b"".join(b"%d A\n9\n1 1\n1 1 1\n1000\n1\n" % at + b"1 1 1 0 1\n" * 1000 + b"1\n" for at in range(20)),
        *(word * (MAX_BYTES // 10) for word in (b"9", b"\n", b"1 ", b"1\n")),
        b"1.0\n1\na A\n1\n1 " + b"9" * (MAX_BYTES - 100) + b"x\n",
    ]
    tracemalloc.start()
    try:
        for content in contents:
            with contextlib.suppress(InputError):
                parse_mci(content, "a.mci")
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 200 * 2**20, f"{peak / 2**20:.0f} MiB"


# Written after the format of MCML 2, since its own examples may not be passed on.
SECOND = """####
# Lengths are in cm
####
mcmli2.0				# file version

# name	n	mua	mus	g
  air	1.0	0	0	0
  glass	1.5	0	0	0
  skin	1.4	1	100	0.9
end #of media

one.mco	A				# output filename, ASCII/Binary
  air
  glass	0.1
  skin	0.2
  air
end #of layers
pencil					# src type: pencil/isotropic
0					# starting z position of source
0.01	0.02	0.1			# dz, dr, dt
3	4	1	5			# nz, nr, nt, na
Rd_r A_rz
1E3	10:00				# no. of photons | time
1E-4					# threshold weight
7					# random number seed

two.mco	B
  glass
  skin	1E8
  air
end
pencil
0 skin
1E-3	1E-3	0.1
1	2	3	1
Td_ra rd_a \\
a_z
20000
0
0
end #of all runs
what follows is not read
"""


SKIN, LONG = "  skin\t1.4\t1\t100\t0.9", "9" * 5000


def parsed_2(text: str):
    return parse_mci(text.encode(), "two.mci")


def test_both_runs_of_mcml_2_are_read():
    first, second = parsed_2(SECOND)
    assert (first.output, first.format, first.photons, first.seed, first.limit) == ("one.mco", "A", 1000, 7, "10:00")
    assert first.medium.layers == (Layer(1.5, 0, 0, 0, 0.1), Layer(1.4, 1, 100, 0.9, 0.2))
    assert (first.medium.n_above, first.medium.n_below, first.grid) == (1.0, 1.0, Grid(0.02, 4, 0.01, 3, na=5))
    assert (second.output, second.format, second.photons, second.seed, second.limit) == ("two.mco", "B", 20_000, 0, "")
    assert second.medium.layers == (Layer(1.4, 1, 100, 0.9, 1e8),)
    assert (second.medium.n_above, second.medium.n_below) == (1.5, 1.0)
    assert parsed_2(SECOND.replace("\n", "\r\n").replace("\t", " ")) == (first, second)
    (_, endless) = parsed_2(SECOND.replace("1E8", "inf"))
    assert endless.medium.layers[0].thickness == math.inf


@pytest.mark.parametrize(
    ("old", "new", "line", "told"),
    [
        (SKIN, SKIN.replace("0.9", "1"), 9, "g of 'skin' between -1 and 1, or 1 where nothing"),
        (SKIN, SKIN.removesuffix("\t0.9"), 9, "a medium's name, n, mu_a, mu_s and g, 1000 media"),
        ("  glass	1.5", "  air	1.5", 8, "each medium once, got 'air' again"),
        ("  skin	0.2", "  bone	0.2", 15, "one of the media air, glass, skin, got 'bone'"),
        ("  skin	0.2", "  skin", 17, "a medium above, layers with their thickness, and a medium below, got 4 lines"),
        ("  glass	0.1", "  glass	inf", 17, "thickness of layer 1 of 2 in cm, a number from"),
        ("  skin	0.2", "  air	inf", 17, "mu_a or mu_s of layer 2 of 2 above 0 where it has no end"),
        ("pencil					", "isotropic ", 18, "a pencil beam, pencil, got 'isotropic'"),
        ("0					# starting", "0.1 # starting", 19, "light that starts at the surface, 0, got '0.1'"),
        ("0.01	0.02	0.1	", "0.01	0.02	0", 20, "dt in ps, a number from"),
        ("3	4	1	5", "3	4	1", 21, "4 values, nz, nr, nt and na, got 3"),
        ("Rd_r A_rz", "Rd_r A_rzt", 22, "quantities of Rd_r, .*, A_rz, none resolved in time, got 'A_rzt'"),
        ("a_z\n", "rd_t\n", 37, "quantities of .*none resolved in time, got 'rd_t'"),
        ("1E3	10:00", "10:00	", 23, "the number of photons, a whole number from 1 to 10+, got '10:00'"),
        ("1E3	10:00", "1.5", 23, "the number of photons, a whole number"),
        ("1E3	10:00", LONG, 23, f"the number of photons, .*, got '{'9' * 37}\\.\\.\\.'"),
        ("1E-4	", "2	", 24, "the threshold weight, a number from 0 to 1, got '2'"),
        ("7					#", "-7 #", 25, "the seed, a whole number from 0 to 2147483647, got '-7'"),
        ("two.mco	B", "./one.mco	B", 27, "an output file that no other run has"),
        ("two.mco	B", "end", None, None),
        ("one.mco	A", "end", 12, "the name of an output file, and A or B, got 'end'"),
        ("end #of all runs\nwhat follows is not read\n", "", 41, "the name of an output file, .*, or end, got the end"),
    ],
)
def test_what_is_wrong_in_mcml_2_is_named(old, new, line, told):
    assert SECOND.count(old) == 1
    text = SECOND.replace(old, new)
    if told is None:
        assert len(parsed_2(text)) == 1, "what follows the end is not read"
        return
    assert len(refused(rf"^two\.mci:{line}: expected {told}", parsed_2, text)) < 400

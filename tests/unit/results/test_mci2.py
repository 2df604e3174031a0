"""Input files of MCML 2, written here after its format, since its own examples may not be passed on."""

import math
import re

import pytest

from mcml_sim import Grid, InputError, Layer
from mcml_sim.results.mci import parse_mci

TEXT = """####
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


def parsed(text: str):
    return parse_mci(text.encode(), "two.mci")


def test_both_runs_are_read():
    first, second = parsed(TEXT)
    assert (first.output, first.format, first.photons, first.seed, first.limit) == ("one.mco", "A", 1000, 7, "10:00")
    assert first.medium.layers == (Layer(1.5, 0, 0, 0, 0.1), Layer(1.4, 1, 100, 0.9, 0.2))
    assert (first.medium.n_above, first.medium.n_below) == (1.0, 1.0)
    assert first.grid == Grid(0.02, 4, 0.01, 3, na=5)
    assert (second.output, second.format, second.photons, second.seed, second.limit) == ("two.mco", "B", 20_000, 0, "")
    assert second.medium.layers == (Layer(1.4, 1, 100, 0.9, 1e8),)
    assert (second.medium.n_above, second.medium.n_below) == (1.5, 1.0)
    assert parsed(TEXT.replace("\n", "\r\n").replace("\t", " ")) == (first, second)
    (_, endless) = parsed(TEXT.replace("1E8", "inf"))
    assert endless.medium.layers[0].thickness == math.inf


@pytest.mark.parametrize(
    ("old", "new", "line", "told"),
    [
        (
            "  skin	1.4	1	100	0.9",
            "  skin	1.4	1	100	1",
            9,
            "g of 'skin' between -1 and 1, or 1 where nothing",
        ),
        (
            "  skin	1.4	1	100	0.9",
            "  skin	1.4	1	100",
            9,
            "a medium's name, n, mu_a, mu_s and g, 1000 media",
        ),
        (
            "  skin	1.4	1",
            "  skin	1.4	" + "9" * 5000,
            9,
            f"mu_a of 'skin' in 1/cm, .*, got '{'9' * 37}\\.\\.\\.'",
        ),
        ("  glass	1.5", "  air	1.5", 8, "each medium once, got 'air' again"),
        ("  skin	0.2", "  bone	0.2", 15, "one of the media air, glass, skin, got 'bone'"),
        ("  skin	0.2", "  skin", 17, "a medium above, layers with their thickness, and a medium below, got 4 lines"),
        ("  glass	0.1", "  glass	inf", 17, "thickness of layer 1 of 2 in cm, a number from"),
        ("  skin	0.2", "  air	inf", 17, "mu_a or mu_s of layer 2 of 2 above 0 where it has no end"),
        ("pencil					", "isotropic ", 18, "a pencil beam, pencil, got 'isotropic'"),
        ("0					# starting", "0.1 # starting", 19, "light that starts at the surface, 0, got '0.1'"),
        ("0.01	0.02	0.1	", "0.01	0.02	0", 20, "dt in ps, a number from"),
        ("3	4	1	5", "3	4	1", 21, "4 values, nz, nr, nt and na, got 3"),
        ("3	4	1	5", "65536	65536	1	5", 21, "nr nz, the cells of a table, to be at most"),
        ("Rd_r A_rz", "Rd_r A_rzt", 22, "quantities of Rd_r, .*, A_rz, none resolved in time, got 'A_rzt'"),
        ("a_z\n", "rd_t\n", 37, "quantities of .*none resolved in time, got 'rd_t'"),
        ("1E3	10:00", "10:00	", 23, "the number of photons, a whole number from 1 to 10+, got '10:00'"),
        ("1E3	10:00", "1.5", 23, "the number of photons, a whole number"),
        ("1E3	10:00", "9" * 5000, 23, f"the number of photons, .*, got '{'9' * 37}\\.\\.\\.'"),
        ("1E-4	", "2	", 24, "the threshold weight, a number from 0 to 1, got '2'"),
        ("7					#", "-7 #", 25, "the seed, a whole number from 0 to 2147483647, got '-7'"),
        ("two.mco	B", "./one.mco	B", 27, "an output file that no other run has"),
        ("two.mco	B", "end", None, None),
        ("one.mco	A", "end", 12, "the name of an output file, and A or B, got 'end'"),
        ("end #of all runs\nwhat follows is not read\n", "", 41, "the name of an output file, .*, or end, got the end"),
    ],
)
def test_what_is_wrong_is_named(old, new, line, told):
    assert TEXT.count(old) == 1
    text = TEXT.replace(old, new)
    if told is None:
        assert len(parsed(text)) == 1, "what follows the end is not read"
        return
    with pytest.raises(InputError, match=rf"^two\.mci:{line}: expected {told}") as error:
        parsed(text)
    assert len(str(error.value)) < 400
    assert not re.search(r"[\n\t]", str(error.value))

"""MCML's output read back: our own, V1's, and what is none."""

from pathlib import Path

import numpy as np
import pytest

from mcml_sim import Grid, InputError, Layer, Medium, read_mco, write_mco
from mcml_sim.results.mco import parse_mco
from mcml_sim.results.tally import Tally
from mcml_sim.tracing.deposits import Deposits, shapes

# From the parameters to Rd_r as V1 prints them, its report of the time included.
V1 = """A1 \t# Version number of the file format.

####
# Data categories include:
# InParm, RAT,
# A_l, A_z, Rd_r, Rd_a, Tt_r, Tt_a,
# A_rz, Rd_ra, Tt_ra
####

# User time: 102 sec = 0.03 hr.  Simulation time of this run.

InParm \t\t\t# Input parameters. cm is used.
sample.mco \tA\t\t# output file name, ASCII.
1000 \t\t\t# No. of photons
0.01\t0.02\t\t# dz, dr [cm]
2\t3\t1\t# No. of dz, dr, da.

1\t\t\t\t\t# Number of layers
#n\tmua\tmus\tg\td\t# One line for each layer
1\t\t\t\t\t# n for medium above
1.37\t1\t100\t0.9\t1E+08\t# layer 1
1\t\t\t\t\t# n for medium below

RAT #Reflectance, absorption, transmission.
0.0243729      \t#Specular reflectance [-]
0.237826       \t#Diffuse reflectance [-]
0.641779       \t#Absorbed fraction [-]
0.0960224      \t#Transmittance [-]

A_l #Absorption as a function of layer. [-]
      0.6418

A_z #A[0], [1],..A[nz-1]. [1/cm]
  2.0000E+01
  1.0000E+01

Rd_r #Rd[0], [1],..Rd[nr-1]. [1/cm2]
  3.0000E+01
  2.0000E+00
  1.0000E-03

Rd_a #Rd[0], [1],..Rd[na-1]. [sr-1]
"""


def test_v1_is_read():
    found = parse_mco(V1.encode(), "sample.mco")
    assert found.run.photons == 1000
    assert found.run.medium == Medium((Layer(1.37, 1.0, 100.0, 0.9, 1e8),))
    assert (found.run.grid.rings, found.run.dr) == (3, 0.02)
    assert (found.specular_reflectance, found.diffuse_reflectance) == (0.0243729, 0.237826)
    np.testing.assert_array_equal(found.reflectance_r, [30.0, 2.0, 1e-3])


def test_what_was_written_comes_back(tmp_path):
    medium = Medium((Layer(1.3, 20, 200, 0.7, 0.01), Layer(1.4, 10.123456789, 200, 0.9)), n_above=1.1)
    grid = Grid(0.03, 40, 0.02, 3, na=7)
    draw = np.random.default_rng(5)
    sums = {name: 1 + draw.random(shape) for name, shape in shapes(grid, 2).items()}
    sums["absorbed_z"] = sums["absorbed_rz"].sum(axis=0)
    tally = Tally(medium, grid, 1000, 3, Deposits(**{**sums, "started": 1000}))
    write_mco(tally, tmp_path / "out.mco")
    found = read_mco(tmp_path / "out.mco")
    assert found.run.medium.layers[0] == medium.layers[0]
    assert found.run.medium.layers[1].thickness == 1e8
    assert found.run.grid == grid
    np.testing.assert_allclose(found.reflectance_r[:-1], tally.reflectance_r.value[:-1], rtol=5.1e-5)  # as printed
    assert found.diffuse_reflectance == pytest.approx(float(tally.diffuse_reflectance), rel=5.1e-6)
    assert found.reflectance_r @ grid.r_areas == pytest.approx(found.diffuse_reflectance, rel=1e-4), "overflow and all"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("A1", "B2"), r"x.mco:1: expected the file version, A1 or mcmloA2.0, got 'B2'"),
        (("A1", "1.0"), r"x.mco:1: expected the file version, A1 or mcmloA2.0, got '1.0'"),
        (("\nInParm \t", "\nInput \t"), r"x.mco:\d+: expected the section InParm, got 'Input'"),
        (("3.0000E+01", "-nan"), r"x.mco:38: expected number 1 of 3 of Rd_r, got '-nan'"),
        (("2.0000E+00", "-2.0"), r"x.mco:39: expected number 2 of 3 of Rd_r, a number from 0 to 1e\+30, got '-2.0'"),
        (("  1.0000E-03\n", ""), r"x.mco:41: expected number 3 of 3 of Rd_r, got 'Rd_a'"),
        (("2\t3\t1", "2\t0\t1"), r"x.mco:16: expected nr, a number of bins"),
        (("1.37\t1", "1.37\tone"), r"x.mco:21: expected mu_a of layer 1 of 1"),
    ],
)
def test_faults_are_named_by_line(change, message):
    with pytest.raises(InputError, match=message):
        parse_mco(V1.replace(*change, 1).encode(), "x.mco")


def test_what_is_no_mco(tmp_path):
    with pytest.raises(InputError, match=r"x.mco:.*: expected the section Rd_r, got the end of the file"):
        parse_mco(V1.partition("\nRd_r #")[0].encode(), "x.mco")
    for content in (b"", b"\x00\xff", b"\x89PNG"):
        with pytest.raises(InputError, match=r"x.mco:\d+: expected"):
            parse_mco(content, "x.mco")
    with pytest.raises(InputError, match=r"nothing.mco: expected a file that can be read, got: No such file"):
        read_mco(Path(tmp_path) / "nothing.mco")

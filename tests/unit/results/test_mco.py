"""Output files of MCML: read back, by ours and as V1 does, and held against V1's own scaling, term by term."""

import math
import os
import re
from pathlib import Path

import numpy as np
import pytest

from mcml_sim import Grid, InputError, Layer, Medium, read_mco, write_mco
from mcml_sim.errors import OutputError
from mcml_sim.results.mci import read_mci
from mcml_sim.results.mco import begins_mco, parse_mco
from mcml_sim.results.tally import Tally
from mcml_sim.tracing.deposits import Deposits, shapes
from tests.fixtures import refused
from tests.unit.results.test_mci import SECOND as INPUT

DATA = Path(__file__).parent / "data"
ROUNDING = {"table": 5.1e-5, "A_l": 5.1e-4, "RAT": 5.1e-6}  # relative, of %12.4E, %12.4G and %-14.6G
# What V1 wrote into the .mco that came with it for example.mci, from the parameters to the first total.
V1_PARAMETERS = """InParm \t\t\t# Input parameters. cm is used.
example.mco \tA\t\t# output file name, ASCII.
1000000 \t\t\t# No. of photons
0.01\t0.01\t\t# dz, dr [cm]
40\t50\t1\t# No. of dz, dr, da.

3\t\t\t\t\t# Number of layers
#n\tmua\tmus\tg\td\t# One line for each layer
1\t\t\t\t\t# n for medium above
1.37\t1\t100\t0.9\t0.1\t# layer 1
1.37\t1\t10\t0\t0.1\t# layer 2
1.37\t2\t10\t0.7\t0.2\t# layer 3
1\t\t\t\t\t# n for medium below

RAT #Reflectance, absorption, transmission. """
# The other lines that readers count or look for, of V1's same file.
V1_TITLES = """A_l #Absorption as a function of layer. [-]
A_z #A[0], [1],..A[nz-1]. [1/cm]
Rd_r #Rd[0], [1],..Rd[nr-1]. [1/cm2]
Rd_a #Rd[0], [1],..Rd[na-1]. [sr-1]
Tt_r #Tt[0], [1],..Tt[nr-1]. [1/cm2]
Tt_a #Tt[0], [1],..Tt[na-1]. [sr-1]
# A[r][z]. [1/cm3]
# A[0][0], [0][1],..[0][nz-1]
# A[1][0], [1][1],..[1][nz-1]
# ...
# A[nr-1][0], [nr-1][1],..[nr-1][nz-1]
A_rz
# Rd[r][angle]. [1/(cm2sr)].
# Rd[0][0], [0][1],..[0][na-1]
# Rd[1][0], [1][1],..[1][na-1]
# ...
# Rd[nr-1][0], [nr-1][1],..[nr-1][na-1]
Rd_ra
# Tt[r][angle]. [1/(cm2sr)].
# Tt[0][0], [0][1],..[0][na-1]
# Tt[1][0], [1][1],..[1][na-1]
# ...
# Tt[nr-1][0], [nr-1][1],..[nr-1][na-1]
Tt_ra""".splitlines()


def made_up(medium: Medium, grid: Grid, photons: int = 1000) -> Tally:
    """A tally of random sums: what is written must be those, whatever they are."""
    draw = np.random.default_rng(5)
    sums = {name: 1 + draw.random(shape) for name, shape in shapes(grid, len(medium.layers)).items()}
    sums["absorbed_z"] = sums["absorbed_rz"].sum(axis=0)
    return Tally(medium, grid, photons, 3, Deposits(**{**sums, "started": photons}))


@pytest.fixture
def tally():
    """Two layers between unequal media, so that no two numbers of anything agree."""
    medium = Medium((Layer(1.3, 20, 200, 0.7, 0.01), Layer(1.4, 10.123456789, 200, 0.9)), n_above=1.1, n_below=1.2)
    return made_up(medium, Grid(0.03, 4, 0.02, 3, na=7))


def by_lines(path: Path) -> dict:
    """The numbers, found by counting lines as the MATLAB readers of MCML's own site do; it knows no keywords."""
    lines = iter(path.read_text().split("\n"))

    def skip(number):
        return [next(lines) for _ in range(number)][-1]

    def first(line):
        return [float(word) for word in re.match(r"[-+.\deEINF\s]*", line)[0].split()]

    def column(number):
        return np.array([float(next(lines)) for _ in range(number)])

    def table(rows, columns):
        numbers = []
        while len(numbers) < rows * columns:
            numbers += map(float, next(lines).split())
        if rows * columns % 5 == 0:  # V1 ends the table's last line, then the table
            assert next(lines) == ""
        return np.array(numbers).reshape(rows, columns)

    found = {}
    (found["photons"],) = first(skip(14))
    found["dz"], found["dr"] = first(skip(1))
    nz, nr, na = map(int, first(skip(1)))
    (number,) = map(int, first(skip(2)))
    (found["n_above"],) = first(skip(2))
    found["layers"] = [tuple(first(next(lines).partition("#")[0])) for _ in range(number)]
    (found["n_below"],) = first(skip(1))
    skip(2)
    found["RAT"] = [float(next(lines).split()[0]) for _ in range(4)]
    skip(2)
    found["A_l"] = column(number)
    for name, size in (("A_z", nz), ("Rd_r", nr), ("Rd_a", na), ("Tt_r", nr), ("Tt_a", na)):
        skip(2)
        found[name] = column(size)
    skip(1)
    for name, size in (("A_rz", nz), ("Rd_ra", na), ("Tt_ra", na)):
        skip(6)
        found[name] = table(nr, size)
    assert list(lines) == [""], "the file ends there"
    return found


def by_keywords(path: Path) -> dict:
    """The same found as CONV does: data lines are those that are neither blank nor begin with #, keywords begin one."""
    lines = [line for line in path.read_text().split("\n") if line.strip() and not line.lstrip().startswith("#")]
    at = lines.index(next(line for line in lines if line.startswith("InParm")))
    nz, nr, na = map(int, lines[at + 4].split()[:3])
    sizes = {"A_l": int(lines[at + 5].split()[0]), "A_z": nz, "Rd_r": nr, "Rd_a": na, "Tt_r": nr, "Tt_a": na}
    sizes |= {"A_rz": nr * nz, "Rd_ra": nr * na, "Tt_ra": nr * na}
    found = {}
    for key, size in sizes.items():
        at = next(place for place in range(at, len(lines)) if lines[place].startswith(key)) + 1
        found[key] = np.array(" ".join(lines[at:]).split()[:size], float)
    return found


def v1(tally: Tally) -> dict:
    """V1's sums and scales (Sum2DRd, Sum2DA, ScaleRdTt, ScaleA of mcmlio.c), bin by bin, from the same weights."""
    grid, sums = tally.grid, tally.deposits
    nr, nz, na = grid.rings, grid.depths, grid.angles
    dr, dz, da = grid.r_edges[1], grid.z_edges[1], math.pi / 2 / na
    weight = (1 - float(tally.specular_reflectance)) / tally.photons
    shape = {"Rd_ra": (nr, na), "Tt_ra": (nr, na), "A_rz": (nr, nz), "Rd_r": nr, "Tt_r": nr, "Rd_a": na, "Tt_a": na}
    out = {key: np.zeros(size) for key, size in {**shape, "A_z": nz}.items()}
    out["RAT"] = [float(tally.specular_reflectance), 0.0, 0.0, 0.0]
    for side, total, weights in (("Rd", 1, sums.reflected), ("Tt", 3, sums.transmitted)):
        for (at, ia), one in np.ndenumerate(weights):
            light = one * weight + (sums.ballistic * weight if side == "Tt" and at == ia == 0 else 0)
            ir = min(at, nr - 1)
            out[f"{side}_ra"][ir, ia] += (
                light / (4 * math.pi**2 * dr * math.sin(da / 2) * dr) / ((ir + 0.5) * math.sin(2 * (ia + 0.5) * da))
            )
            out[f"{side}_r"][ir] += light / (2 * math.pi * dr * dr) / (ir + 0.5)
            out[f"{side}_a"][ia] += light / (2 * math.pi * da) / math.sin((ia + 0.5) * da)
            out["RAT"][total] += light
    for (at, down), one in np.ndenumerate(sums.absorbed_rz):
        ir, iz = min(at, nr - 1), min(down, nz - 1)
        out["A_rz"][ir, iz] += one * weight / (2 * math.pi * dr * dr * dz) / (ir + 0.5)
    for down, one in enumerate(sums.absorbed_z):
        out["A_z"][min(down, nz - 1)] += one * weight / dz
    out["A_l"] = sums.absorbed[:-1] * weight
    out["RAT"][2] = sums.absorbed[-1] * weight
    return out


def test_v1_readers_find_v1_numbers(tally, tmp_path):
    path = tmp_path / "out.mco"
    write_mco(tally, path)
    found, expected = by_lines(path), v1(tally)
    for name, numbers in expected.items():
        np.testing.assert_allclose(found[name], numbers, rtol=ROUNDING.get(name, ROUNDING["table"]), err_msg=name)
    for name, numbers in by_keywords(path).items():
        np.testing.assert_array_equal(numbers, np.ravel(found[name]), err_msg=name)
    totals = (tally.specular_reflectance, tally.diffuse_reflectance, tally.absorbed, tally.transmittance)
    np.testing.assert_allclose(found["RAT"], [float(one) for one in totals], rtol=1e-5)
    assert found["photons"] == 1000
    assert (found["dz"], found["dr"], found["n_above"], found["n_below"]) == (0.02, 0.03, 1.1, 1.2)
    assert found["layers"] == [(1.3, 20, 200, 0.7, 0.01), (1.4, 10.123456789, 200, 0.9, 1e8)], "no digit is lost"


def test_parameters_and_titles_are_those_of_v1(tmp_path):
    (run,) = read_mci(DATA / "example.mci")
    path = tmp_path / run.output
    write_mco(made_up(run.medium, run.grid, run.photons), path)
    text = path.read_text()
    assert text.startswith("A1 \t# Version number of the file format.\n")
    assert text.split("\n\n", 2)[1].startswith("####\n# Data categories include: \n# InParm, RAT, \n")
    assert text.split("\n").index("InParm \t\t\t# Input parameters. cm is used.") == 11
    assert V1_PARAMETERS in text
    assert [line for line in text.split("\n") if line in V1_TITLES] == V1_TITLES
    assert re.search(r"\nRAT .*\n0\.0243729      \t#Specular reflectance \[-\]\n", text)
    assert re.search(r"\nA_rz\n((  \d\.\d{4}E[+-]\d\d ){5}\n){400}\n# Rd", text)
    by_lines(path)


def test_totals_are_the_sums_of_the_tables(tally, tmp_path):
    """With V1's own measures: whoever integrates a table gets the total back, overflow and ballistic light included."""
    write_mco(tally, tmp_path / "out.mco")
    found = by_lines(tmp_path / "out.mco")
    areas = 2 * math.pi * (np.arange(4) + 0.5) * 0.03**2
    da = math.pi / 2 / 7
    angles = (np.arange(7) + 0.5) * da
    for side, total in (("Rd", found["RAT"][1]), ("Tt", found["RAT"][3])):
        assert found[f"{side}_r"] @ areas == pytest.approx(total, rel=1e-4)
        assert found[f"{side}_a"] @ np.sin(angles) * 2 * math.pi * da == pytest.approx(total, rel=1e-4)
    np.testing.assert_allclose(areas @ found["A_rz"], found["A_z"], rtol=1e-4)
    # Angles that are not resolved are one bin.
    write_mco(made_up(tally.medium, Grid(0.03, 4, 0.02, 3)), tmp_path / "out.mco")
    found = by_lines(tmp_path / "out.mco")
    assert found["Rd_ra"].shape == (4, 1)
    assert found["Rd_a"] * 2 * math.pi * math.sin(math.pi / 4) * math.pi / 2 == pytest.approx(found["RAT"][1], rel=1e-4)


def test_arguments_may_come_in_either_order(tally, tmp_path):
    write_mco(tally, tmp_path / "a.mco")
    write_mco(str(tmp_path / "a.mco"), tally)
    write_mco(tmp_path / "b.mco", tally)
    assert (tmp_path / "b.mco").read_text() == (tmp_path / "a.mco").read_text().replace("a.mco", "b.mco")
    # A name with blanks stays one word.
    write_mco(tally, tmp_path / "my #1\n.mco")
    assert by_lines(tmp_path / "my #1\n.mco")["photons"] == 1000
    assert "\nmy__1_.mco \tA\t\t# output file name" in (tmp_path / "my #1\n.mco").read_text()


@pytest.mark.parametrize(
    ("grid", "message"),
    [
        (Grid(0.1, 3), "grid must resolve depths for an .mco, give it dz and nz"),
        (Grid.from_edges(r=[0, 1, 3], z=[0, 1]), "grid must have rings of equal width for an .mco, got .* from 1 to 2"),
        (Grid.from_edges(r=[0, 1], z=[0, 1, 1.5]), "grid must have depths of equal width .*, got .* from 0.5 to 1"),
    ],
)
def test_grids_that_an_mco_cannot_say(tally, tmp_path, grid, message):
    refused(message, write_mco, made_up(tally.medium, grid), tmp_path / "out.mco")
    assert not list(tmp_path.iterdir())


def test_misuse_is_named(tally, tmp_path):
    for given, path, message in (
        (3, tmp_path / "out.mco", "tally must be what simulate gave, got 3"),
        ("a.mco", "b.mco", r"tally must be what simulate gave, got 'a.mco'"),
        (tally, tally, "path must be the name of a file, got Tally"),
        (tally, 3, "path must be the name of a file, got 3"),
    ):
        refused(message, write_mco, given, path)


def test_a_file_that_cannot_be_written_leaves_the_old_one(tally, tmp_path, monkeypatch):
    path = tmp_path / "out.mco"
    path.write_text("old")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    refused(r"cannot write .*out.mco: No space left on device", write_mco, tally, path, error=OutputError)
    assert [one.name for one in tmp_path.iterdir()] == ["out.mco"]
    assert path.read_text() == "old"


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
    assert (found.run.photons, found.run.medium) == (1000, Medium((Layer(1.37, 1.0, 100.0, 0.9, 1e8),)))
    assert (found.run.grid.rings, found.run.dr) == (3, 0.02)
    assert (found.specular_reflectance, found.diffuse_reflectance) == (0.0243729, 0.237826)
    np.testing.assert_array_equal(found.reflectance_r, [30.0, 2.0, 1e-3])


def test_what_was_written_comes_back(tally, tmp_path):
    tally = made_up(tally.medium, Grid(0.03, 40, 0.02, 3, na=7))
    write_mco(tally, tmp_path / "out.mco")
    found = read_mco(tmp_path / "out.mco")
    assert (found.run.medium.layers[0], found.run.medium.layers[1].thickness) == (tally.medium.layers[0], 1e8)
    assert found.run.grid == tally.grid
    np.testing.assert_allclose(found.reflectance_r[:-1], tally.reflectance_r.value[:-1], rtol=5.1e-5)  # as printed
    assert found.diffuse_reflectance == pytest.approx(float(tally.diffuse_reflectance), rel=5.1e-6)
    total = found.reflectance_r @ tally.grid.r_areas  # overflow and all
    assert total == pytest.approx(found.diffuse_reflectance, rel=1e-4)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("A1", "B2"), r"x.mco:1: expected the file version, A1 or mcmloA2.0, got 'B2'"),
        (("\nInParm \t", "\nInput \t"), r"x.mco:\d+: expected the section InParm, got 'Input'"),
        (("3.0000E+01", "-nan"), r"x.mco:38: expected number 1 of 3 of Rd_r, got '-nan'"),
        (("2.0000E+00", "-2.0"), r"x.mco:39: expected number 2 of 3 of Rd_r, a number from 0 to 1e\+30, got '-2.0'"),
        (("  1.0000E-03\n", ""), r"x.mco:41: expected number 3 of 3 of Rd_r, got 'Rd_a'"),
        (("2\t3\t1", "2\t0\t1"), r"x.mco:16: expected nr, a number of bins"),
        (("1.37\t1", "1.37\tone"), r"x.mco:21: expected mu_a of layer 1 of 1"),
    ],
)
def test_faults_are_named_by_line(change, message):
    refused(message, parse_mco, V1.replace(*change, 1).encode(), "x.mco")


def test_what_is_no_mco(tmp_path):
    with pytest.raises(InputError, match=r"x.mco:.*: expected the section Rd_r, got the end of the file"):
        parse_mco(V1.partition("\nRd_r #")[0].encode(), "x.mco")
    for content in (b"", b"\x00\xff", b"\x89PNG"):
        refused(r"x.mco:\d+: expected", parse_mco, content, "x.mco")
    refused(r"nothing.mco: expected a file that can be read, got: No such file", read_mco, tmp_path / "nothing.mco")


# Written after the format of MCML 2, since its own examples may not be passed on: the input, whose first run it is, and
# what it gave.
SECOND = f"""mcmloA2.0 	# Version number of the file format.

####
# Data categories include:
# InParam, RAT,
####

{INPUT.partition("two.mco")[0].replace("Rd_r A_rz", "Rd_r A_rz Rd_t")}end #of runs

# status of the random number generator:
     750441026       66686981     722072254     238289497     799924214

RAT #Reflectance, absorption, transmittance.
0.027778      				#Rsp: Specular reflectance.
0.027778      	0                0.00%	#Rb: Ballistic reflectance.
0.237859       	0.000311708      0.13%	#Rd: Diffuse reflectance.
0.641547       	0.000293194      0.05%	#A:  Absorbed fraction.
9.75627E-07    	9.75627E-07    100.00%	#Tb: Ballistic transmittance.
0.0962202      	0.000185941      0.19%	#Td: Diffuse transmittance.

# A[r][z]. [1/cm3]
A_rz
  1.3382E+03   2.3384E+03   2.2381E+03   1.7552E+03   1.2469E+03
  8.3705E+02   5.5107E+02

Rd_r #Rd[0], [1],..Rd[nr-1]. [1/cm2]
  1.2500E+01
  3.2500E+00
  1.5000E+00
  2.5000E-01

Rd_t #Rd[0], [1],..Rd[nt-1]. [1/ps]
  4.6507E-03
"""


def test_mcml_2_is_read(tmp_path):
    (tmp_path / "one.mco").write_text(SECOND)
    found = read_mco(tmp_path / "one.mco")
    assert (found.specular_reflectance, found.diffuse_reflectance) == (0.027778, 0.237859)
    assert (found.run.photons, found.run.dr, found.run.nr, found.run.medium.n_above) == (1000, 0.02, 4, 1.0)
    assert found.run.medium.layers == (Layer(1.5, 0, 0, 0, 0.1), Layer(1.4, 1, 100, 0.9, 0.2))
    np.testing.assert_array_equal(found.reflectance_r, [12.5, 3.25, 1.5, 0.25])
    assert not begins_mco(tmp_path / "one.mco"), "a run of V1 replaces none but its own"


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("mcmli2.0", "mcmli1.0", r":11: expected the input's version, mcmli2.0, got 'mcmli1.0'"),
        ("skin	0.2", "bone	0.2", r":22: expected one of the media air, glass, skin, got 'bone'"),
        ("Rd_r A_rz", "A_rz", r":29: expected Rd_r among what was scored, got 'A_rz Rd_t'"),
        ("1.4	1	100	0.9", "1.4	1	100	1", r":16: expected g of 'skin' between -1 and 1"),
        ("  2.5000E-01\n", "", r":57: expected number 4 of 4 of Rd_r, a number from 0 to 1e\+30, got 'Rd_t'"),
    ],
)
def test_what_is_wrong_in_mcml_2_is_named(old, new, told):
    assert old in SECOND
    refused(re.escape("one.mco") + told, parse_mco, SECOND.replace(old, new).encode(), "one.mco")

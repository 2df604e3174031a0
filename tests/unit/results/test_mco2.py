"""Output files of MCML 2, written here after its format, since its own examples may not be passed on."""

import re

import numpy as np
import pytest

from mcml_sim import read_mco
from mcml_sim.errors import InputError
from mcml_sim.results.mco import begins_mco

RINGS = [12.5, 3.25, 1.5, 0.25]
TEXT = """mcmloA2.0 	# Version number of the file format.

####
# Data categories include:
# InParam, RAT,
####

mcmli2.0 			# file version

# Specify media
#	name		n	mua	mus	g
	air 		1	0	0	0
	skin 		1.4	1	100	0.9
	fat 		1.44	0.5	10	0
end #of media

one.mco 	A			# output file name, format.
	air
	skin 		0.1
	fat 		2
	air
end #of layers

pencil 					# src type: pencil/isotropic.
0					# starting position of source.

0.01	0.02	0.1			# dz, dr, dt.
3	4	100	1		# nz, nr, nt, na.

Rd_r 	A_rz 	Rd_t
1000000  	1:54				# no. of photons | time
0.0001					# threshold weight.
1					# random number seed.
end #of runs

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


@pytest.fixture
def written(tmp_path):
    def write(text):
        path = tmp_path / "one.mco"
        path.write_text(text)
        return path

    return write


def test_it_is_read(written):
    found = read_mco(written(TEXT))
    assert (found.specular_reflectance, found.diffuse_reflectance) == (0.027778, 0.237859)
    assert (found.run.photons, found.run.dr, found.run.nr, found.run.medium.n_above) == (1_000_000, 0.02, 4, 1.0)
    first, second = found.run.medium.layers
    assert (first.n, first.mu_a, first.mu_s, first.g, first.thickness) == (1.4, 1.0, 100.0, 0.9, 0.1)
    assert (second.n, second.thickness) == (1.44, 2.0)
    np.testing.assert_array_equal(found.reflectance_r, RINGS)
    assert not begins_mco(written(TEXT)), "a run of V1 replaces none but its own"


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("mcmli2.0", "mcmli1.0", r":8: expected the input's version, mcmli2.0, got 'mcmli1.0'"),
        ("skin 		0.1", "bone 		0.1", r":19: expected one of the media air, skin, fat, got 'bone'"),
        ("skin 		0.1", "skin", r":22: expected a medium above, layers with their thickness, and a medium below"),
        ("pencil", "isotropic", r":24: expected a pencil beam, pencil, got 'isotropic'"),
        (
            "0					# starting",
            "0.1	# starting",
            r":25: expected light that starts at the surface, 0, got '0.1'",
        ),
        ("Rd_r 	A_rz", "A_rz", r":30: expected Rd_r among what was scored, got 'A_rz Rd_t'"),
        ("1000000", "1.5", r":31: expected the number of photons, a whole number from 1"),
        ("1.4	1	100	0.9", "1.4	1	100	1", r":13: expected g of 'skin' between -1 and 1"),
        ("  2.5000E-01\n", "", r":57: expected number 4 of 4 of Rd_r, a number from 0 to 1e\+30, got 'Rd_t'"),
        (
            "3	4	100	1",
            "3	99999999	100	1",
            r":28: expected nr, a number of bins, a whole number from 1 to",
        ),
    ],
)
def test_what_is_wrong_is_named(written, old, new, told):
    assert old in TEXT
    with pytest.raises(InputError, match=re.escape("one.mco") + told):
        read_mco(written(TEXT.replace(old, new)))

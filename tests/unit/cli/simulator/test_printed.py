"""What is printed of a number and its error, and of speed."""

import math
from dataclasses import replace

import pytest

from mcml_sim import Estimate, Grid, Layer, Medium
from mcml_sim.cli import printed
from mcml_sim.results.tally import Results


@pytest.mark.parametrize(
    ("value", "error", "samples", "text"),
    [
        (0.237834, 0.000421, 9, "0.23783 ± 0.00042"),
        (1.0, 0.0, math.inf, "1"),
        (0.0, 0.0, math.inf, "0"),
        (0.0, 0.0, 0.0, "0 (no photon seen)"),
        (0.5, math.inf, 1, "0.5 ± unknown"),
        (9.83e-7, 9.83e-7, 1, "9.8e-07 ± 9.8e-07"),
        (1.23456e-6, 1.2e-9, 9, "1.2346e-06 ± 1.2e-09"),
        (2e-7, 3e-6, 1, "2e-07 ± 3.0e-06"),
        (12.3, 4.56, 9, "12.3 ± 4.6"),
        (1.0, 1e-15, 9, "1.000000000000 ± 0.000000000000"),
    ],
)
def test_a_value_with_two_digits_of_its_error(value, error, samples, text):
    assert printed.with_error(Estimate(value, error, samples)) == text


@pytest.mark.parametrize(
    ("photons", "seconds", "compiling", "text"),
    [
        (10**6, 8.0, 3.9, "4.1 s and 3.9 s to compile, 0.244 M photons/s"),
        (10**6, 4.1, 0.0, "4.1 s, 0.244 M photons/s"),
        (20_000, 10.0, 0.01, "10.0 s, 2002 photons/s"),
        (20_000, 1.0, 1.0, "0.0 s and 1.0 s to compile, 20 M photons/s"),
    ],
)
def test_speed_leaves_out_compiling(photons, seconds, compiling, text):
    assert printed.speed(photons, seconds, compiling) == text


def test_light_that_was_cut_is_a_line_of_the_sum():
    part = Estimate(0.2, 0.01, 99)
    kept = Results(
        medium=Medium((Layer(1, 1, 1, 0, 1),)),
        grid=Grid(1, 1),
        photons=9,
        seed=0,
        version="",
        cut=0.1234,
        estimates=dict.fromkeys((*printed.TOTALS, "energy"), part),
    )
    lines = list(printed.totals(kept))
    assert lines[-2:] == ["at scattering limit    0.12", "all of these           0.200 ± 0.010"]
    assert len(list(printed.totals(replace(kept, cut=0.0)))) == len(lines) - 1

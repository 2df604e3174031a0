"""The tables of costs and errors."""

import numpy as np

import profilefit
from benchmarks import laws
from profilefit.studies.tradeoff import contenders
from profilefit.studies.tradeoff.laws import PARTS, ContenderResult, counts
from profilefit.studies.tradeoff.stopwatch import Ratio


def test_many_functions_are_summed():
    (dipole,) = contenders.with_samplers("dipole", profilefit.load("dipole", "published"))
    ratios = {part: Ratio(2.0, 1.0, 3.0) for part in PARTS}
    row = ContenderResult(dipole, counts(dipole), {}, ratios, None, np.array([0.1]), np.array([0.2]))
    assert laws.as_cells(row)[1:4] == ("0", "2 exp, 2 sqrt", "162 in all")
    assert laws.as_errors(row) == ("dipole", "0.1", "0.1", "0.2", "0.2")

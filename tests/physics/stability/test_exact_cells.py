"""Exact light keeps its promises in every cell, judged by nodes that it does not share; and a wrong number is seen."""

import numpy as np
import pytest

from mcml_sim import Setting, exact
from profilefit.studies.stability import exact_cells
from profilefit.studies.stability.cells import CDF, Verdict, absolute, judged

X, ALPHA = np.array([0.0, 1e-3, 0.1, 1.0, 10.0, 1e3, np.inf]), np.array([0.0, 1e-6, 0.5, 1.0])


def classes(cdf):
    finer = exact_cells.finer_cdf(X, ALPHA, Setting())[..., 0]
    bound = exact_cells.BOUNDS[CDF]
    return judged(cdf, finer, absolute(cdf, finer), bound, np.ones(cdf.shape, bool), np.float64)


def test_the_cdf_is_right_and_a_wrong_one_is_not():
    cdf = exact.cdf(X, ALPHA[:, None])
    assert np.all(classes(cdf) == Verdict.RIGHT)
    off = exact.cdf(X * (1.0 + 1e-7), ALPHA[:, None])  # negative control: a mean free path that is 1e-7 off
    assert np.any(classes(off) == Verdict.INACCURATE)


@pytest.mark.slow
def test_plates_are_right_and_others_are_not(monkeypatch):
    monkeypatch.setattr(exact_cells, "PLATE_ALPHA", (0.0, 0.5, 0.9, 1.0 - 1e-6, 1.0))
    assert np.all(exact_cells.plates(1.0).codes == Verdict.RIGHT)
    solve = exact.solve  # negative control: a millionth of the light is absorbed where nothing should be
    monkeypatch.setattr(exact, "solve", lambda medium, **rest: solve(exact_cells.plate(1.0 - 1e-6, 1.0, 1.0), **rest))
    assert np.any(exact_cells.plates(1.0).codes == Verdict.INACCURATE)


@pytest.mark.slow
def test_no_cell_is_red_where_something_is_promised():
    cells = list(exact_cells.refracting_cells())
    assert {one.quantity for one in cells} == {"R_d", "cdf", "A(α)"}
    assert sum(int(np.sum(one.codes == Verdict.RIGHT)) for one in cells) > 1500
    for one in cells:
        assert not np.any(one.failures), one.subject

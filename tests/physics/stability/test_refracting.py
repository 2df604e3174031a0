"""Exact light where surfaces refract, and in stacks, keeps its promises in every cell; and a wrong number is seen."""

import numpy as np
import pytest

from mcml_sim import exact
from profilefit.studies.stability import refracting
from profilefit.studies.stability.cells import Verdict


@pytest.mark.slow
def test_plates_are_right_and_others_are_not(monkeypatch):
    monkeypatch.setattr(refracting, "PLATE_ALPHA", (0.0, 0.5, 0.9, 1.0 - 1e-6, 1.0))
    assert np.all(refracting.plates(1.0).codes == Verdict.RIGHT)
    solve = exact.solve  # negative control: a millionth of the light is absorbed where nothing should be
    monkeypatch.setattr(exact, "solve", lambda medium, **rest: solve(refracting.plate(1.0 - 1e-6, 1.0, 1.0), **rest))
    assert np.any(refracting.plates(1.0).codes == Verdict.INACCURATE)


@pytest.mark.slow
def test_no_cell_is_red_where_something_is_promised():
    found = list(refracting.cells_of())
    assert {one.quantity for one in found} == {"R_d", "cdf", "A(α)"}
    assert sum(int(np.sum(one.codes == Verdict.RIGHT)) for one in found) > 1500
    for one in found:
        assert not np.any(one.failures), one.subject

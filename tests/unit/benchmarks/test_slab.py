"""Few paths through the slab, and that a wrong answer would show."""

import numpy as np
import pytest

pytest.importorskip("mitsuba", reason="mitsuba is not installed: no second opinion on the step edge")

from benchmarks import slab


@pytest.mark.parametrize("illumination", slab.ILLUMINATIONS)
def test_paths_agree_with_the_integral(illumination):
    """Near the edge only: farther away few paths see light, and their spread is not yet known."""
    found = slab.compared(0.5, illumination, rays=1500, seed=2, pixels=6, reach=1.5)
    assert found.chance > 1e-3
    (other,) = set(slab.ILLUMINATIONS) - {illumination}
    solved = slab.solved(0.5, other, slab.edges(6, 1.5))
    assert slab.Comparison(0.5, other, found.traced, found.standard_error, solved, 0.0).chance < 1e-6


def test_directions_are_cosine_weighted():
    """Of u uniform on [0, 1], sin^2 of the angle to the normal is u."""
    down = np.array([slab.downward_cosine(a, 0.3) for a in (0.0, 0.25, 1.0)])
    np.testing.assert_allclose(down[:, 2], -np.sqrt([1.0, 0.75, 0.0]))
    np.testing.assert_allclose(np.sum(down**2, axis=1), 1.0)


def test_command_prints_both_tables(capsys, monkeypatch):
    monkeypatch.setattr(slab, "ALPHAS", (0.5,))
    slab.main(["--rays", "300"])
    printed = capsys.readouterr().out
    assert [one for one in ("chi2", "searchlight 0.5", "+3.8") if one not in printed] == []

"""Errors of finite rings: the square of the width where middles stand for averages, next to none for integrals."""

import numpy as np
import pytest

from profilefit.fitting.estimate import fit, rings_of
from profilefit.fitting.profiles import Profiles
from profilefit.recipes.checks import by_width, discretisation_error, widened

pytestmark = pytest.mark.slow

ALPHA = 1.0 - np.linspace(0.9, 0.3, 7) ** 2
FREE = ("b1", "c3")


def profiles_of(law, edges):
    """Energies of (7) itself, integrated over rings: a truth that its own middles miss by the square of the width."""
    inside = np.asarray(law.unscaled_energy(edges, ALPHA[:, None]))
    energy = np.diff(inside, axis=1)
    zero, many = np.zeros_like(energy), np.full_like(energy, np.inf)
    return Profiles(ALPHA, edges, energy, zero, many, np.zeros(ALPHA.size), "exact", law.setting)


@pytest.fixture(scope="module")
def fits(liang):
    """The same law fitted by ring middles and by ring integrals, rings of 0.05."""
    edges = np.linspace(0.0, 1.8, 37)
    truth = profiles_of(liang, edges)
    return {objective: fit(truth, liang, objective, FREE, jackknife=False) for objective in ("radial", "energy")}


def test_middles_are_wrong_by_the_square_of_the_width_and_it_is_known(fits, liang):
    one = fits["radial"]
    true = liang.vector(FREE)
    off = one.solution.parameters - true
    moved = by_width(one)
    by_square = [(moved[k] - moved[1]) / (k**2 - 1) for k in (2, 3)]
    np.testing.assert_allclose(by_square[0], by_square[1], rtol=0.2)
    # What it says is what it is, to a fourth: terms beyond the square, of the rings next to the source.
    np.testing.assert_allclose(discretisation_error(one), np.abs(off), rtol=0.25)
    assert np.all(np.abs(off / true) > 1e-6)


def test_integrals_have_next_to_none(fits, liang):
    one = fits["energy"]
    np.testing.assert_allclose(one.solution.parameters, liang.vector(FREE), rtol=1e-6)
    assert np.all(discretisation_error(one) < 1e-3 * discretisation_error(fits["radial"]))


def test_wide_rings_are_the_sums_of_narrow_ones(fits):
    rings = fits["radial"].rings
    wide = widened(rings, 5)
    assert wide.energy.shape == rings.energy.shape
    holds = wide.energy[0] > 0
    assert holds.sum() == 8  # seven of five, and the one that is left over
    np.testing.assert_allclose(wide.energy[:, holds][:, 0], rings.energy[:, :5].sum(axis=1), rtol=1e-13)
    np.testing.assert_allclose(wide.energy.sum(axis=1), rings.energy.sum(axis=1), rtol=1e-13)
    place = np.flatnonzero(holds)
    np.testing.assert_allclose(wide.r_edges[place], rings.r_edges[[0, 5, 10, 15, 20, 25, 30, 35]], atol=1e-9)
    np.testing.assert_array_equal(wide.r_edges[place + 1], rings.r_edges[[5, 10, 15, 20, 25, 30, 35, 36]])
    assert np.all(np.diff(wide.r_edges) > 0)
    np.testing.assert_array_equal(widened(rings, 1).energy, rings.energy)


def test_a_wide_ring_counts_only_with_all_its_parts(fits):
    one = fits["radial"]
    used = np.ones((ALPHA.size, 36))
    used[2, 7] = 0.0
    rings = rings_of(profiles_of(one.law, np.asarray(one.rings.r_edges)), used > 0)
    wide = widened(rings, 3)
    kept = wide.used[:, wide.energy[0] > 0]
    assert kept.sum() == 12 * 7 - 1
    assert kept[2, 2] == 0.0


def test_one_ring_has_no_width_to_tell(white_run, normalisation):
    one = fit(Profiles.from_orders(white_run.merged([0.0, white_run.grid.r_edges[-1]]), ALPHA), normalisation)
    np.testing.assert_array_equal(discretisation_error(one), np.zeros(3))

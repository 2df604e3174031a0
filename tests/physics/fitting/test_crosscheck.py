"""The same fit to two truths: agreement within the photons' noise, and what a difference looks like.

Then errors of finite rings: the square of the width where middles stand for averages, next to none for integrals.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, kstest

from mcml_sim import Grid, Setting, simulate_orders
from profilefit import load
from profilefit.fitting.estimate import fit, rings_of
from profilefit.fitting.profiles import Profiles
from profilefit.recipes import checks
from profilefit.recipes.checks import AGREE, DIFFER, by_width, compared, crosscheck, mahalanobis, widened

pytestmark = pytest.mark.slow

EDGES = np.concatenate([[0.0], np.geomspace(0.02, 30.0, 25)])
FREE = ("k", "h")


def test_chi2_by_hand():
    covariance = np.array([[4.0, 0.0], [0.0, 9.0]])
    assert mahalanobis(np.array([2.0, 3.0]), covariance) == (pytest.approx(2.0), 2)
    turned = np.array([[2.0, 1.0], [1.0, 2.0]])
    difference = np.array([1.0, -2.0])
    assert mahalanobis(difference, turned)[0] == pytest.approx(difference @ np.linalg.inv(turned) @ difference)
    # Two constants that photons move together, in any units, are one direction.
    lengths = np.array([1e-3, 1.0, 1e3])
    covariance = np.outer(lengths, lengths) * np.array([[1, 1, 0], [1, 1, 0], [0, 0, 1]])
    distance, rank = mahalanobis(lengths * np.array([1.0, 1.0, 2.0]), covariance)
    assert rank == 2
    assert distance == pytest.approx(1 + 4)


@pytest.fixture(scope="module")
def exactly(toy, tallies):
    """The toy's energies without noise, and a fit to them that is no truth: h alone, k 2 % too large."""
    energy = tallies.energy(tallies.chance.reshape(tallies.edges.size - 1, -1) * tallies.photons)
    none = np.zeros_like(energy)
    photons = tallies.profiles(tallies.draw(1, 1)[0])
    profiles = replace(photons, energy=energy, standard_error=none, source="exact", covariance=None)
    return fit(profiles, replace(toy, q=0.52), free=FREE)


def test_replicates_scatter_as_their_errors_say(toy, tallies, exactly):
    """chi2 of 60 runs of photons is chi2 of two degrees of freedom, for a law that is not the truth too."""
    found = [fit(tallies.profiles(one), exactly.law, free=FREE) for one in tallies.draw(7, 60)]
    told = [compared(exactly, one, tallies.photons, 0, 0) for one in found]
    distances = np.array([check["chi2"] for check in told])
    assert {check["rank"] for check in told} == {2}
    assert kstest(distances, chi2(2).cdf).pvalue > 1e-3
    assert kstest(1.5 * distances, chi2(2).cdf).pvalue < kstest(distances, chi2(2).cdf).pvalue
    assert sum(check["result"] == AGREE for check in told) >= 58
    np.testing.assert_allclose(told[0]["chance"], chi2.sf(distances[0], 2))


def test_photons_of_another_truth_differ_and_a_failed_fit_is_told(toy, tallies, exactly):
    profiles = tallies.profiles(tallies.draw(7, 1)[0])
    louder = replace(profiles, energy=1.02 * profiles.energy)  # the tally's error of A is 0.2 %
    check = compared(exactly, fit(louder, exactly.law, free=FREE), tallies.photons, 0, 0)
    assert (check["result"], list(check["constants"])) == (DIFFER, ["k", "h"])
    assert check["constants"]["k"]["z"] > 5
    assert check["photons"] == tallies.photons
    good = fit(tallies.profiles(tallies.draw(7, 1)[0]), exactly.law, free=FREE)
    failed = replace(good, solution=replace(good.solution, result="no convergence"))
    for pair, which in (((failed, good), "exact"), ((exactly, failed), "photon")):
        check = compared(*pair, tallies.photons, 0, 0)
        assert check["result"] == f"the {which} fit failed: no convergence"
        assert np.isnan(check["chi2"])
    for statistical in (None, np.full((2, 2), np.nan)):
        check = compared(exactly, replace(good, statistical=statistical), tallies.photons, 0, 0)
        assert check["result"].startswith("the photon fit has no finite errors")
        assert np.isnan(check["chi2"])


ALPHA = np.array([0.2, 0.5, 0.8, 0.9, 0.97, 0.99999])


def test_exact_light_and_a_million_photons_agree_and_not_a_wrong_count(normalisation, white_run):
    profiles = Profiles.from_exact(ALPHA, [0.0, 30.0])
    own = fit(profiles, normalisation, "reflectance", free=("b", "c"))
    check = crosscheck(own, profiles, white_run)
    assert (check["result"], check["rank"], list(check["constants"])) == (AGREE, 2, ["b", "c"])
    assert check["photons"] == white_run.photons
    # At .99999 light is lost after 8192 scatterings.
    assert (check["albedos_left_out"], check["rings_left_out"]) == (1, 0)
    wrong = replace(white_run, photons=int(white_run.photons / 1.02))
    assert crosscheck(own, profiles, wrong)["result"] == DIFFER


@pytest.mark.parametrize("setting", [Setting(), Setting("diffuse")], ids=str)
def test_profiles_agree_ring_by_ring(setting):
    """The whole of a recipe's fit, a law that is 5 % off, on two million photons."""
    light = simulate_orders(Grid.from_edges(r=EDGES), 2**21, seed=6, setting=setting, progress=False)
    profiles = Profiles.from_exact(ALPHA, EDGES, setting)
    law = load("burley", "published" if setting == Setting() else "published:diffuse")
    free = ("s0", "s1", "s2")  # a square in A has no fourth
    own = fit(profiles, law, free=free)
    check = crosscheck(own, profiles, light)
    assert (check["result"], check["rank"], check["albedos_left_out"]) == (AGREE, 3, 1)
    assert check["rings_left_out"] > 0
    doubled = replace(light, photons=int(light.photons / 1.02))
    assert crosscheck(own, profiles, doubled)["result"] == DIFFER


# Finite rings

FEW = 1.0 - np.linspace(0.9, 0.3, 7) ** 2
TWO = ("b1", "c3")


def profiles_of(law, edges):
    """Energies of (7) itself, integrated over rings: a truth that its own middles miss by the square of the width."""
    inside = np.asarray(law.unscaled_energy(edges, FEW[:, None]))
    energy = np.diff(inside, axis=1)
    zero, many = np.zeros_like(energy), np.full_like(energy, np.inf)
    return Profiles(FEW, edges, energy, zero, many, np.zeros(FEW.size), "exact", law.setting)


@pytest.fixture(scope="module")
def fits(liang):
    """The same law fitted by ring middles and by ring integrals, rings of 0.05."""
    edges = np.linspace(0.0, 1.8, 37)
    truth = profiles_of(liang, edges)
    return {objective: fit(truth, liang, objective, TWO, jackknife=False) for objective in ("radial", "energy")}


def test_middles_are_wrong_by_the_square_of_the_width_and_integrals_by_next_to_nothing(fits, liang):
    one = fits["radial"]
    true, moved = liang.vector(TWO), by_width(one)
    off = one.solution.parameters - true
    by_square = [(moved[k] - moved[1]) / (k**2 - 1) for k in (2, 3)]
    np.testing.assert_allclose(by_square[0], by_square[1], rtol=0.2)
    # What it says is what it is, to a fourth: terms beyond the square, of the rings next to the source.
    np.testing.assert_allclose(checks.discretisation_error(one), np.abs(off), rtol=0.25)
    assert np.all(np.abs(off / true) > 1e-6)
    one = fits["energy"]
    np.testing.assert_allclose(one.solution.parameters, liang.vector(TWO), rtol=1e-6)
    assert np.all(checks.discretisation_error(one) < 1e-3 * checks.discretisation_error(fits["radial"]))


def test_wide_rings_are_the_sums_of_narrow_ones(fits, white_run, normalisation):
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
    # A wide ring counts only with all its parts.
    used = np.ones((FEW.size, 36))
    used[2, 7] = 0.0
    rings = rings_of(profiles_of(fits["radial"].law, np.asarray(rings.r_edges)), used > 0)
    wide = widened(rings, 3)
    kept = wide.used[:, wide.energy[0] > 0]
    assert kept.sum() == 12 * 7 - 1
    assert kept[2, 2] == 0.0
    one = fit(Profiles.from_orders(white_run.merged([0.0, white_run.grid.r_edges[-1]]), FEW), normalisation)
    np.testing.assert_array_equal(checks.discretisation_error(one), np.zeros(3))

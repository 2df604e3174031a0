"""Profiles from photons and from the exact solution, and the closed form of their covariance."""

import numpy as np
import pytest

from benchmarks.refits import drawn_noise
from mcml_sim import Grid, Setting, SettingError, exact, simulate_orders
from profilefit.fitting.profiles import COVARIANCE_RANK, FEWEST_EFFECTIVE_SAMPLES, Covariance, Profiles
from tests.fixtures import refused

ALPHAS = [0.3, 0.6, 0.9, 0.97]


@pytest.fixture(scope="module")
def photons(white_run):
    return Profiles.from_orders(white_run, ALPHAS)


@pytest.fixture(scope="module")
def truth(white_run):
    return Profiles.from_exact(ALPHAS, white_run.grid.r_edges)


@pytest.mark.slow
def test_photons_and_the_exact_solution_agree(photons, truth, sidak):
    keep = photons.trusted
    z = ((photons.energy - truth.energy) / np.where(keep, photons.standard_error, 1.0))[keep]
    assert keep.mean() > 0.6
    # Albedos share their photons: fewer independent numbers than rings, so the correction is on the safe side.
    assert np.abs(z).max() < sidak(keep.sum())
    # Negative control: the profiles of an albedo higher by one percent.
    other = Profiles.from_exact(np.array(ALPHAS) * 1.01, truth.r_edges)
    assert np.abs((photons.energy - other.energy)[keep] / photons.standard_error[keep]).max() > 2 * sidak(keep.sum())


def test_exact_rings_are_differences_of_the_cdf(truth):
    for row, alpha in enumerate(ALPHAS):
        inside = exact.reflectance(alpha) * exact.cdf(truth.r_edges, alpha)
        np.testing.assert_allclose(truth.energy[row], np.diff(inside), rtol=1e-12, atol=1e-16)
        assert truth.reflectance[row] == pytest.approx(exact.reflectance(alpha), rel=1e-14)
        np.testing.assert_allclose(truth.cdf[row], exact.cdf(truth.r_edges, alpha), atol=1e-14)
    assert (truth.source, truth.covariance, truth.photons) == ("exact", None, None)
    assert np.all(truth.standard_error == 0)
    assert np.all(truth.trusted)
    found = Profiles.from_exact([0.5], [0.0, 1.0], Setting("diffuse"))
    assert found.setting == Setting("diffuse")
    assert found.reflectance[0] == pytest.approx(exact.reflectance(0.5, Setting("diffuse")))
    refused("n >= 1 where g = 0", Profiles.from_exact, [0.5], [0.0, 1.0], Setting(n=0.9), error=SettingError)


def test_energy_light_beyond_trust_and_covariance_of_photons(photons, white_run):
    np.testing.assert_allclose(photons.value * photons.r_areas, photons.energy, rtol=1e-14)
    np.testing.assert_allclose(photons.value, white_run.profile(ALPHAS).value, rtol=1e-12)
    np.testing.assert_allclose(photons.r_areas, white_run.grid.r_areas, rtol=1e-12)
    np.testing.assert_allclose(photons.r, 0.5 * (photons.r_edges[1:] + photons.r_edges[:-1]))
    np.testing.assert_allclose(photons.reflectance, white_run.reflectance(ALPHAS).value, rtol=1e-12)
    assert np.all(photons.cdf[:, 0] == 0)
    np.testing.assert_allclose(1 - photons.cdf[:, -1], photons.beyond / photons.reflectance, atol=1e-14)
    np.testing.assert_array_equal(photons.trusted, photons.effective_samples >= 50)
    assert FEWEST_EFFECTIVE_SAMPLES == 50
    assert not photons.trusted[0, -1]  # alpha = .3 beyond 20 mfp
    variance = np.sum(photons.covariance.factor**2, axis=2).T
    # Rank 4 holds it all, and both divide by N (N - 1); what is left of a photon with weight .3^40 is rounding.
    np.testing.assert_allclose(np.sqrt(variance)[:, :-1], photons.standard_error, rtol=1e-9, atol=1e-18)
    assert photons.covariance.rank == len(ALPHAS)
    many = Profiles.from_orders(white_run, np.linspace(0.1, 0.99, 20)).covariance
    assert many.rank == COVARIANCE_RANK == 8
    assert 0 < many.dropped < 1e-3
    assert Profiles.from_orders(white_run, ALPHAS, correlated=False).covariance is None


def test_merged_rings_hold_the_same_energy_and_covariance(white_run, photons):
    edges = white_run.grid.r_edges[[0, 3, 4, 12, 25]]
    merged = Profiles.from_orders(white_run.merged(edges), ALPHAS)
    sums = np.add.reduceat(photons.energy, [0, 3, 4, 12], axis=1)
    np.testing.assert_allclose(merged.energy, sums, rtol=1e-12)
    np.testing.assert_allclose(merged.beyond, photons.beyond, rtol=1e-12)
    # Fewer rings than the run has: what lies beyond the last one moves into `beyond`.
    inner = Profiles.from_orders(white_run.merged(edges[:3]), ALPHAS)
    np.testing.assert_allclose(inner.reflectance, photons.reflectance, rtol=1e-12)
    refused("r_edges must be edges of the run's own grid", white_run.merged, [0.0, 0.0123, 1.0])
    # Two routes to the error of a sum of rings: tally the sum, or add the parts with their negative covariance.
    groups = [(0, 3), (3, 4), (4, 12), (12, 25)]
    parts = np.zeros((len(ALPHAS) * 4, len(ALPHAS), 25))
    whole = np.zeros((len(ALPHAS) * 4, len(ALPHAS), 4))
    for row, (a, g) in enumerate(np.ndindex(len(ALPHAS), 4)):
        parts[row, a, slice(*groups[g])] = 1.0
        whole[row, a, g] = 1.0
    added = photons.covariance.sandwich(parts)
    np.testing.assert_allclose(added, merged.covariance.sandwich(whole), rtol=1e-9, atol=1e-20)


def test_sandwich_and_draws_have_the_dense_closed_form(sidak):
    """(delta_ij sum_n (ab)^n H_in / N - E_i(a) E_j(b)) / (N - 1), every pair of rings and albedos written out."""
    one, dense = dense_covariance()
    gain = np.random.default_rng(11).standard_normal((4, 2, 3))
    expected = np.einsum("pai,aibj,qbj->pq", gain, dense, gain)
    np.testing.assert_allclose(one.sandwich(gain), expected, rtol=1e-10)
    # Negative control: without what is between rings it is another matrix.
    within = np.einsum("pai,iak,ibk,qbi->pq", gain, one.factor, one.factor, gain)
    assert np.max(np.abs(within - expected)) > 1e-2 * np.max(np.abs(expected))
    # Ten thousand draws against the closed form, pair by pair (Wishart).
    number, closed = 10_000, dense.reshape(6, 6)
    drawn = drawn_noise(one, number, seed=3).reshape(number, 6)
    error = np.sqrt((closed**2 + np.outer(np.diag(closed), np.diag(closed))) / (number - 1))
    assert np.abs((np.cov(drawn, rowvar=False) - closed) / error).max() < sidak(21)
    assert np.abs(drawn.mean(axis=0) / np.sqrt(np.diag(closed) / number)).max() < sidak(6)
    # Negative control: rings that do not share out their photons.
    alone = np.where(np.eye(3, dtype=bool)[None, :, None, :], dense, 0.0).reshape(6, 6)
    assert np.abs((np.cov(drawn, rowvar=False) - alone) / error).max() > 2 * sidak(21)


def dense_covariance():
    """500 photons, two albedos, three rings: the covariance, and all of it written out (2, 3, 2, 3)."""
    rng = np.random.default_rng(10)
    photons, alphas, orders = 500, np.array([0.5, 0.9]), np.arange(1, 6)
    weights = alphas[:, None] ** orders
    counts = rng.multinomial(photons, np.append(np.full(15, 0.05), 0.25))[:-1].reshape(3, 5)
    energy = (counts @ weights.T).T / photons
    dense = np.empty((2, 3, 2, 3))
    for a, i, b, j in np.ndindex(2, 3, 2, 3):
        same = np.sum(weights[a] * weights[b] * counts[i]) / photons if i == j else 0.0
        dense[a, i, b, j] = (same - energy[a, i] * energy[b, j]) / (photons - 1)
    value, vector = np.linalg.eigh(np.stack([dense[:, i, :, i] for i in range(3)]))
    return Covariance(vector * np.sqrt(np.maximum(value, 0.0))[:, None], energy, photons, 0.0), dense


def test_draws_scatter_as_the_sandwich_where_many_rings_hold_few_photons(white_run):
    """Sums over all rings and of some, whose variance lives on what rings take from each other; twenty albedos."""
    one = Profiles.from_orders(white_run, 1.0 - np.linspace(0.98, 0.05, 20) ** 2).covariance
    gain = np.zeros((3, 20, 26))
    gain[0], gain[1, 19], gain[2, 5, 3:9] = 1.0, 1.0, 1.0
    number = 4000
    sums = np.einsum("pai,rai->rp", gain, drawn_noise(one, number, seed=4))
    # A standard deviation of 4000 is known to 1.1 %: four of these.
    np.testing.assert_allclose(sums.std(axis=0) / np.sqrt(np.diag(one.sandwich(gain))), 1.0, atol=0.045)


@pytest.mark.slow
def test_rank_eight_loses_nothing_of_a_sum_and_rank_four_does(white_run):
    """What the truncation drops of a ring's variance shows in constants."""
    alphas = 1.0 - np.linspace(0.98, 0.05, 20) ** 2
    gain = np.random.default_rng(5).standard_normal((4, 20, 26)) * Profiles.from_orders(white_run, alphas).energy.max()
    errors, dropped = {}, {}
    for rank in (4, 8, 20):
        factor, dropped[rank] = white_run.covariance_factor(alphas, rank, overflow=True)
        whole = Covariance(factor, np.zeros((20, 26)), white_run.photons, dropped[rank])
        errors[rank] = np.sqrt(np.diag(whole.sandwich(gain)))
    assert dropped[8] < 1e-3 < 1e-2 < dropped[4]
    np.testing.assert_allclose(errors[8] / errors[20], 1.0, atol=1e-3)
    assert np.max(np.abs(errors[4] / errors[20] - 1.0)) > 1e-3


def test_sandwich_is_the_scatter_of_synthetic_tallies(tallies, sidak):
    """Sums over many rings of 2000 tallies: the negative terms between rings make up much of their variance."""
    number = 2000
    one = tallies.profiles(tallies.draw(20, 1)[0])
    energy = tallies.energy(tallies.draw(21, number))
    gain = np.zeros((3, *one.energy.shape))
    gain[0, 4] = 1.0  # all light at the highest albedo
    gain[1, 1, :6] = 1.0  # the inner light at a low one
    gain[2, 3, 6:] = 1.0  # the outer light at a high one
    sums = np.einsum("pai,rai->rp", gain, energy)
    predicted = one.covariance.sandwich(gain)
    error = np.sqrt((predicted**2 + np.outer(np.diag(predicted), np.diag(predicted))) / (number - 1))
    scatter = np.cov(sums, rowvar=False)
    # `predicted` has the noise of its own 200 000 photons too, 1 / sqrt(2e5 * .5) = .3 % of 3 %.
    assert np.abs((scatter - predicted) / error).max() < sidak(6)
    alone = np.einsum("pai,iak,ibk,qbi->pq", gain, one.covariance.factor, one.covariance.factor, gain)
    assert np.abs((scatter - alone) / error).max() > 2 * sidak(6)


@pytest.mark.parametrize("alpha", [0.0, -0.1, 1.1, [0.5, np.nan], [[0.5]]])
def test_albedos_must_be_a_list_above_zero(alpha, white_run):
    for make in (lambda: Profiles.from_orders(white_run, alpha), lambda: Profiles.from_exact(alpha, [0.0, 1.0])):
        refused(r"alpha must be a list of albedos in \(0, 1\], got", make)


def test_forward_orders_are_refused_and_white_media_and_numbers_allowed(white_run):
    # Rings of forward orders are in 1 / (mu_s + mu_a), which is another share of l* for each albedo.
    run = simulate_orders(Grid(1.0, 3), 100, seed=1, setting=Setting(g=0.5))
    refused(r"orders must be of light that scatters isotropically, got g = 0\.5", Profiles.from_orders, run, [0.5])
    run = simulate_orders(Grid(1.0, 3), 1000, seed=1)
    assert Profiles.from_orders(run, [0.5, 1.0]).reflectance[1] > 0.9
    assert Profiles.from_orders(white_run, 0.5).energy.shape == (1, 25)
    assert Profiles.from_exact(0.5, [0.0, 1.0]).energy.shape == (1, 1)

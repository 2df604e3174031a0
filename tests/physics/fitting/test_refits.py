"""Refits: intervals hold the true constants as often as they say; batches scatter as the closed form says."""

import numpy as np
import pytest
from scipy.stats import binom, norm

from benchmarks import refits as module
from benchmarks.refits import LEVELS, Bootstrap, binomial_band, bootstrap, counted, coverage, drawn_noise, refits
from mcml_sim import Grid, InputError, Setting, simulate_orders
from profilefit.fitting.chains import posterior
from profilefit.fitting.estimate import fit
from profilefit.fitting.profiles import FEWEST_EFFECTIVE_SAMPLES, Profiles
from profilefit.laws.rational import Rational
from tests.fixtures import refused

REPLICATES = 2000


def with_beyond(energy):
    """Energies (..., n) with a column for the light beyond the last ring: Toy has none there."""
    return np.concatenate([energy, np.zeros((*energy.shape[:-1], 1))], axis=-1)


def expected_energy(tallies):
    chance = tallies.chance.reshape(tallies.edges.size - 1, -1)
    return with_beyond((chance @ tallies.weights.T).T)


def refitted(tallies, law, free=None):
    """Refits of a law to 2000 runs of normal noise, and the covariance that made it."""
    profiles = tallies.profiles(tallies.draw(0, 1)[0])
    one = fit(profiles, law, "energy", free, jackknife=False)
    noise = with_beyond(drawn_noise(profiles.covariance, REPLICATES, seed=21))
    return one, profiles.covariance, refits(one, expected_energy(tallies), noise)


@pytest.mark.slow
def test_intervals_of_the_true_law_cover_and_wrong_ones_do_not(tallies, toy):
    one, covariance, again = refitted(tallies, toy)
    assert again.failed == 0
    np.testing.assert_allclose(again.truth, [1.0, 0.5, 0.5], rtol=1e-6)
    off, error = again.found - again.truth, again.sandwich_errors(covariance)
    found = coverage(one.free, off, error)
    assert found.share.shape == (2, 3)
    assert found.honest
    # Its own gain is that of the one fit that `estimate` made, near enough.
    np.testing.assert_allclose(error.mean(axis=0), one.statistical.diagonal() ** 0.5, rtol=0.05)
    # Negative controls: albedos share their photons; and what the band can see.
    found = coverage(one.free, off, again.independent_errors(covariance))
    assert not np.any(found.inside)
    assert np.all(found.share[0] < 0.5)
    assert not coverage(one.free, off, 0.9 * error).honest
    assert not coverage(one.free, off, 1.12 * error).honest


@pytest.mark.slow
def test_whole_photons_are_covered_too(tallies, toy):
    """Multinomial counts in place of normal noise, each with the covariance of its own counts."""
    one = fit(tallies.profiles(tallies.draw(0, 1)[0]), toy, "energy", jackknife=False)
    counts, truth = tallies.draw(22, REPLICATES), expected_energy(tallies)
    again = refits(one, truth, with_beyond(tallies.energy(counts)) - truth)
    covariances = [tallies.profiles(one).covariance for one in counts]
    errors = [np.sqrt(np.diag(c.sandwich(g))) for c, g in zip(covariances, again.gain, strict=True)]
    assert coverage(one.free, again.found - again.truth, np.array(errors)).honest
    with pytest.raises(InputError, match=r"energy must let Toy converge without noise, got one where it does not"):
        refits(one, np.full((5, 15), np.nan), np.zeros((1, 5, 15)))


@pytest.mark.slow
def test_a_law_that_is_not_the_truth_covers_its_pseudo_true_constants(tallies, burley):
    """By the sandwich; not with the residuals taken for noise, nor with the photons' noise taken for independent."""
    one, covariance, again = refitted(tallies, burley, ("s0", "s1", "s2"))
    off = again.found - again.truth
    assert coverage(one.free, off, again.sandwich_errors(covariance)).honest
    misfit = coverage(one.free, off, np.sqrt(np.diag(one.misfit)))
    assert not np.any(misfit.inside)
    assert np.all(misfit.share > 0.99)
    assert not coverage(one.free, off, again.independent_errors(covariance)).honest


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_posteriors_cover_too(tallies, toy):
    """200 runs of photons, each with a fit and a chain of its own; not if intervals are a third too narrow.

    Of rings that hold enough photons, in expectation: Toy trusts one of a single photon, and to drop it only where it
    happens to be empty picks runs by their noise (intervals of 95 % then held in 78 %).
    """
    truth, within, narrow = np.array([1.0, 0.5, 0.5]), [], []
    used = tallies.photons * expected_energy(tallies)[:, :-1] >= FEWEST_EFFECTIVE_SAMPLES
    for seed, counts in enumerate(tallies.draw(23, 200)):
        one = fit(tallies.profiles(counts), toy, "energy", used=used, jackknife=False)
        chain = posterior(one, "statistical", seed)
        assert chain.result == "converged"
        ends = np.stack([chain.interval(level) for level in LEVELS])
        middle = ends.mean(axis=2, keepdims=True)
        for held, (low, high) in (
            (within, np.moveaxis(ends, 2, 0)),
            (narrow, np.moveaxis(middle + (ends - middle) / 1.5, 2, 0)),
        ):
            held.append((low <= truth) & (truth <= high))
    assert counted(one.free, np.stack(within, axis=1)).honest
    assert not counted(one.free, np.stack(narrow, axis=1)).honest


def test_shares_bands_and_scatter_by_hand():
    off = np.array([[0.5, -3.0], [1.5, 0.0], [-0.9, 1.0], [2.5, 0.1]])
    found = coverage(("a", "b"), off, np.array([1.0, 1.0]))
    # Within .994 of zero: 0.5 and -0.9 of a; 0, 0.1 of b. Within 1.96: one more of each.
    np.testing.assert_array_equal(found.share, [[0.5, 0.5], [0.75, 0.75]])
    assert found.replicates == 4
    assert counted(("a",), np.ones((2, 2000, 1), bool)).honest is False
    # Ends of Clopper and Pearson turned round: all but 1 % of honest tables of six shares lie within.
    low, high = binomial_band(0.68, 2000, 6)
    inside = binom.cdf(round(high * 2000), 2000, 0.68) - binom.cdf(round(low * 2000) - 1, 2000, 0.68)
    assert 0.99 <= inside**6 < 0.994
    width = norm.isf((1 - 0.99 ** (1 / 6)) / 2) * np.sqrt(0.68 * 0.32 / 2000)
    assert high - 0.68 == pytest.approx(width, rel=0.05)
    assert binomial_band(0.5, 4, 1) == (0.0, 1.0)
    # B of B drawn with replacement have (B - 1)/B of the variance.
    values = np.random.default_rng(3).standard_normal((500, 2))
    plain = np.cov(values, rowvar=False)
    np.testing.assert_allclose(Bootstrap(("a", "b"), values, 0, 10).covariance, plain * 10 / 9, rtol=1e-12)


BATCHES, PHOTONS = 48, 2**14
ALPHA = 1.0 - np.linspace(0.9, 0.25, 6) ** 2


@pytest.fixture(scope="module")
def batches():
    grid = Grid.from_edges(r=[0.0, 1.0, 1000.0])
    return [simulate_orders(grid, PHOTONS, seed=500 + batch, progress=False) for batch in range(BATCHES)]


@pytest.fixture(scope="module")
def one(batches, normalisation):
    profiles = Profiles.from_orders(batches[0].merged([0.0, 1000.0]), ALPHA)
    return fit(profiles, normalisation, "reflectance", ("b", "c"), jackknife=False)


@pytest.mark.slow
def test_the_scatter_of_batches_is_the_closed_form_and_batches_must_be_alike(batches, one):
    """A run of all batches has the error of one over sqrt(48); 48 batches know it to a tenth."""
    found = bootstrap(batches, one, number=400, seed=1)
    assert (found.failed, found.constants.shape) == (0, (400, 2))
    ratio = found.standard_error * np.sqrt(BATCHES) / np.sqrt(np.diag(one.statistical))
    # Four of 1/sqrt(2 * 48), and 3.5 % for each of the 400 resamples' own scatter and the one batch's covariance.
    np.testing.assert_allclose(ratio, 1.0, atol=0.45)
    # Negative control: the misfit taken for noise is another number.
    wrong = np.sqrt(np.diag(one.misfit) / BATCHES)
    assert np.all(np.abs(found.standard_error / wrong - 1.0) > 0.45)
    found = module.energies(batches, one)
    assert found.shape == (BATCHES, ALPHA.size, 2)
    np.testing.assert_allclose(found[3].sum(axis=1), batches[3].reflectance(ALPHA).value, rtol=1e-12)
    refused("batches must be at least 10, got 3", bootstrap, batches[:3], one)
    refused("batches must be of different seeds, got one twice", bootstrap, [*batches, batches[0]], one)
    small = simulate_orders(batches[0].grid, 1000, seed=1, progress=False)
    refused("batches must be of equally many photons, got different ones", bootstrap, [*batches, small], one)
    diffuse = [simulate_orders(batches[0].grid, 1000, s, Setting("diffuse"), progress=False) for s in range(10)]
    refused(r"batches must belong to searchlight.*got another setting", bootstrap, diffuse, one)
    assert isinstance(one.law, Rational)

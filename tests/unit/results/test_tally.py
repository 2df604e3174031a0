import numpy as np
import pytest

from mcml_sim.results.estimate import Estimate, covariance_factor, estimate
from mcml_sim.tracing.order_bins import Counts


def photon_by_photon(counts, weights, photons):
    """Weights of every photon of one row: the tally undone."""
    return np.concatenate([np.repeat(weights, counts), np.zeros(photons - counts.sum())])


def test_estimate_is_mean_and_error_of_the_photons_one_by_one():
    counts, weights, photons = np.array([[5, 0, 30], [1, 2, 3]]), np.array([0.9, 0.5, 0.25]), 100
    found = estimate(counts, weights, photons)
    for row in range(2):
        each = photon_by_photon(counts[row], weights, photons)
        assert found.value[row] == pytest.approx(each.mean())
        assert found.standard_error[row] == pytest.approx(each.std(ddof=1) / np.sqrt(photons))
        assert found.effective_samples[row] == pytest.approx(each.sum() ** 2 / np.sum(each**2))


def test_empty_bins_have_no_samples_and_no_nan():
    found = estimate(np.zeros((1, 3), np.int64), np.ones(3), 10)
    assert (found.value[0], found.standard_error[0], found.effective_samples[0]) == (0, 0, 0)
    assert not found.is_sampled()[0]


def test_equal_weights_count_as_themselves():
    found = estimate(np.array([[99], [101]]), np.array([0.1]), 1000)
    np.testing.assert_allclose(found.effective_samples, [99, 101])
    np.testing.assert_array_equal(found.is_sampled(), [False, True])
    np.testing.assert_array_equal(found.is_sampled(at_least=50), [True, True])


def test_only_scalar_estimates_are_floats():
    assert float(Estimate(0.25, 0.1, 7.0)) == 0.25
    with pytest.raises(TypeError, match=r"this one has shape \(2,\)"):
        float(Estimate(np.zeros(2), np.zeros(2), np.zeros(2)))


def test_counts_beyond_float32_stay_exact():
    one = Counts(np.full((1, 1), 2**60 + 1), 0, 0, 2**60 + 1)
    assert (one + one).exits[0, 0] == 2**61 + 2


def test_a_lost_photon_is_found():
    good = Counts(np.array([[2, 3]]), 4, 1, 10)
    good.require_closed()
    assert not Counts(good.exits, 4, 1, 11).is_closed
    with pytest.raises(RuntimeError, match="lost"):
        Counts(good.exits, 4, 1, 11).require_closed()


def test_full_rank_factor_is_the_covariance_of_the_photons_one_by_one():
    counts = np.array([[5, 0, 30], [1, 2, 3], [0, 0, 0]])
    weights, photons = np.array([[0.9, 0.5, 0.25], [0.3, 0.2, 0.1], [1.0, 1.0, 1.0]]), 100
    factors, dropped = covariance_factor(counts, weights, photons, rank=3)
    assert dropped == 0
    for row in range(3):
        each = np.array([photon_by_photon(counts[row], w, photons) for w in weights])
        np.testing.assert_allclose(factors[row] @ factors[row].T, np.cov(each) / photons, atol=1e-15)


def test_truncation_says_what_it_drops():
    counts, weights = np.array([[5, 7, 30]]), np.array([[0.9, 0.5, 0.25], [0.3, 0.2, 0.1], [1.0, 0.1, 0.0]])
    full, _ = covariance_factor(counts, weights, 100, rank=3)
    short, dropped = covariance_factor(counts, weights, 100, rank=1)
    assert short.shape == (1, 3, 1)
    assert dropped == pytest.approx(np.max(1 - np.sum(short**2, axis=2) / np.sum(full**2, axis=2)))
    assert dropped > 0


def test_a_weak_weighting_keeps_its_variance_beside_a_strong_one():
    """Small albedos far out carry a millionth of the energy, and their errors are asked for all the same."""
    rng = np.random.default_rng(2)
    counts = rng.integers(0, 50, (6, 40))
    weights = np.array([[0.05], [0.3], [0.9], [0.99]]) ** np.arange(1, 41)
    full, _ = covariance_factor(counts, weights, 10_000, rank=4)
    short, dropped = covariance_factor(counts, weights, 10_000, rank=3)
    lost = 1 - np.sum(short**2, axis=2) / np.sum(full**2, axis=2)
    assert np.max(lost) == pytest.approx(dropped)
    assert dropped < 0.05

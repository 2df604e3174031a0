import numpy as np
import pytest

from mcml_sim.tracing import order_bins as bins
from mcml_sim.tracing.isotropic_event import MAX_ORDER, roulette_weight

ALPHAS = np.concatenate([[0.0, 1e-3], np.linspace(0.05, 0.95, 19), 1 - np.geomspace(0.04, 1e-6, 20), [1.0]])


def test_bins_hold_every_order_once():
    held = [np.arange(a, b + 1) for a, b in zip(bins.FIRST_ORDERS, bins.LAST_ORDERS, strict=True)]
    np.testing.assert_array_equal(np.concatenate(held), np.arange(1, MAX_ORDER + 1))
    assert all(len(held[n]) == 1 for n in range(256))
    assert np.all(bins.BIN_OF_ORDER[bins.LAST_ORDERS - 1] == np.arange(len(bins.LAST_ORDERS)))


def test_roulette_weight_is_one_number_in_each_bin():
    assert np.all(roulette_weight(bins.FIRST_ORDERS) == bins.ROULETTE_WEIGHTS)
    assert np.all(roulette_weight(bins.LAST_ORDERS) == bins.ROULETTE_WEIGHTS)


def test_weights_are_powers_where_orders_are_exact():
    expected = bins.ROULETTE_WEIGHTS[:256] * ALPHAS[:, None] ** np.arange(1, 257)
    np.testing.assert_allclose(bins.weights(ALPHAS)[:, :256], expected, rtol=1e-13, atol=1e-300)


def test_weights_at_the_ends_of_alpha():
    assert np.all(bins.weights(np.array(0.0)) == 0)
    np.testing.assert_allclose(bins.weights(np.array(1.0)), bins.ROULETTE_WEIGHTS, rtol=1e-13)
    assert bins.weight_derivatives(np.array(0.0))[0] == 1
    np.testing.assert_allclose(bins.weight_derivatives(np.array(1.0)), bins.ROULETTE_WEIGHTS * bins.MEAN_ORDERS)


def test_derivative_is_that_of_the_weights():
    alpha, step = np.linspace(0.1, 0.999, 10), 1e-7
    slope = (bins.weights(alpha + step) - bins.weights(alpha - step)) / (2 * step)
    np.testing.assert_allclose(bins.weight_derivatives(alpha), slope, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("exponent", [-6.0, -3.0, 0.0, 6.0])
def test_a_bin_is_off_by_no_more_than_stated_if_its_density_is_another(exponent):
    alphas = ALPHAS[2:-1]
    truth, binned = (bins.bin_mean(alphas[:, None] ** bins.ORDERS, p) for p in (exponent, bins.LONG_PATHS))
    decay = -bins.MEAN_ORDERS * np.log(alphas)[:, None]
    slope = abs(exponent - bins.LONG_PATHS)
    seen = decay < 10  # beyond, a photon counts for e^-10
    assert np.all((np.abs(binned - truth) <= (1.6e-5 * slope * decay + 1e-13) * truth)[seen])
    assert np.abs(binned - truth).max() < 6e-6 * slope

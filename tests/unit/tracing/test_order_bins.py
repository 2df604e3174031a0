"""Bins of the kernels against those of the grid's own edges, and bins of the order of scattering."""

import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import Grid, Setting, phase
from mcml_sim.tracing import deposits, order_bins
from mcml_sim.tracing.order_bins import OrderBins

bins = OrderBins()

ALPHAS = np.concatenate([[0.0, 1e-3], np.linspace(0.05, 0.95, 19), 1 - np.geomspace(0.04, 1e-6, 20), [1.0]])
VALUES = np.random.default_rng(0).exponential(2, 10**5).astype(np.float32)


def test_uneven_bins_are_found_exactly_and_even_ones_but_for_rounding_at_an_edge():
    edges = np.geomspace(1, 9, 11) - 1
    found = deposits.axis(edges, 1.5)
    assert not found.even
    expected = np.searchsorted(edges[1:] / 1.5, VALUES.astype(float), "right")
    np.testing.assert_array_equal(found.index(jnp.asarray(VALUES)), expected)
    found = deposits.axis(Grid(0.3, 10).r_edges, 1.5)
    assert found.even
    assert found.bins == 10
    expected = np.minimum(np.floor(VALUES * 1.5 / 0.3), 10)
    assert np.mean(np.asarray(found.index(jnp.asarray(VALUES))) != expected) < 1e-5


def test_what_is_outside_falls_into_the_nearest_bin_and_rounding_up_keeps_float32_values_on_their_side():
    for edges in (0.5 * np.arange(4), np.array([0, 0.5, 1.25, 2])):
        found = deposits.axis(edges, 1.0).index(jnp.asarray([-3.0, 0.0, 1e30], jnp.float32))
        np.testing.assert_array_equal(found, [0, 0, 3])
    edge = np.array([0.1, 1 / 3, 1.0])
    rounded = deposits.rounded_up(edge)
    assert rounded.dtype == np.float32
    assert np.all(rounded >= edge)
    assert np.all(np.nextafter(rounded, np.float32(0)) < edge)


def test_large_tables_and_few_photons_get_fewer_groups():
    assert deposits.groups(Grid(0.1, 50, 0.1, 40), 10**5, most=32) == 32
    assert deposits.groups(Grid(1, 1000, 1, 500), 10**5, most=32) == 16
    assert deposits.groups(Grid(1, 1000, 1, 2000), 10**5, most=32) == deposits.FEWEST_GROUPS
    assert deposits.groups(Grid(0.1, 50, 0.1, 40), 640, most=32) == 10
    assert deposits.groups(Grid(0.1, 50, 0.1, 40), 1, most=32) == 1


@pytest.mark.parametrize("reach", [1, 2, 16])
def test_bins_hold_every_order_once(reach):
    bins = OrderBins(reach)
    held = [np.arange(a, b + 1) for a, b in zip(bins.first_orders, bins.last_orders, strict=True)]
    np.testing.assert_array_equal(np.concatenate(held), np.arange(1, 8192 * reach + 1))
    assert all(len(held[n]) == 1 for n in range(256))
    assert np.all(bins.bin_of_order[bins.last_orders - 1] == np.arange(len(bins.last_orders)))
    # The roulette's weight is one number in each.
    assert np.all(bins.roulette_weight(bins.first_orders) == bins.roulette_weights)
    assert np.all(bins.roulette_weight(bins.last_orders) == bins.roulette_weights)


def test_roulette_weight_doubles_just_after_each_toss():
    passed = np.searchsorted(bins.stops[:-1], bins.orders)  # a photon that leaves at n has not tossed at n
    np.testing.assert_array_equal(bins.roulette_weight(bins.orders), 2**passed)
    assert (bins.roulette_weight(64), bins.roulette_weight(65), bins.roulette_weight(8192)) == (1, 2, 128)


def test_light_that_turns_slowly_has_more_orders():
    def reach(*args, **kwargs):
        return order_bins.bins_of(Setting(*args, **kwargs)).reach

    assert [reach(g=g) for g in (-0.9, 0.0, 0.2, 0.5, 0.8, 0.9, 0.95, 0.999)] == [1, 1, 1, 2, 4, 8, 16, 64]
    assert reach("diffuse", 1.4, phase=phase.HenyeyGreenstein(0.9)) == 8
    assert order_bins.bins_of(Setting(g=0.9)).stops[[0, -1]].tolist() == [512, 65536]


def test_weights_are_powers_where_orders_are_exact_and_have_derivatives():
    expected = bins.roulette_weights[:256] * ALPHAS[:, None] ** np.arange(1, 257)
    np.testing.assert_allclose(bins.weights(ALPHAS)[:, :256], expected, rtol=1e-13, atol=1e-300)
    assert np.all(bins.weights(np.array(0.0)) == 0)
    np.testing.assert_allclose(bins.weights(np.array(1.0)), bins.roulette_weights, rtol=1e-13)
    assert bins.weight_derivatives(np.array(0.0))[0] == 1
    np.testing.assert_allclose(bins.weight_derivatives(np.array(1.0)), bins.roulette_weights * bins.mean_orders)
    alpha, step = np.linspace(0.1, 0.999, 10), 1e-7
    slope = (bins.weights(alpha + step) - bins.weights(alpha - step)) / (2 * step)
    np.testing.assert_allclose(bins.weight_derivatives(alpha), slope, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("exponent", [-6.0, -3.0, 0.0, 6.0])
def test_a_bin_is_off_by_no_more_than_stated_if_its_density_is_another(exponent):
    alphas = ALPHAS[2:-1]
    truth, binned = (bins.mean(alphas[:, None] ** bins.orders, p) for p in (exponent, order_bins.LONG_PATHS))
    decay = -bins.mean_orders * np.log(alphas)[:, None]
    slope = abs(exponent - order_bins.LONG_PATHS)
    seen = decay < 10  # beyond, a photon counts for e^-10
    assert np.all((np.abs(binned - truth) <= (1.6e-5 * slope * decay + 1e-13) * truth)[seen])
    assert np.abs(binned - truth).max() < 6e-6 * slope

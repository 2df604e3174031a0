"""Bins of the kernels against those of the grid's own edges."""

import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import Grid
from mcml_sim.tracing import deposits as bins

VALUES = np.random.default_rng(0).exponential(2, 10**5).astype(np.float32)


def test_uneven_bins_are_found_exactly():
    edges = np.geomspace(1, 9, 11) - 1
    found = bins.axis(edges, 1.5)
    assert not found.even
    expected = np.searchsorted(edges[1:] / 1.5, VALUES.astype(float), "right")
    np.testing.assert_array_equal(found.index(jnp.asarray(VALUES)), expected)


def test_even_bins_are_found_but_for_rounding_at_an_edge():
    found = bins.axis(Grid(0.3, 10).r_edges, 1.5)
    assert found.even
    assert found.bins == 10
    expected = np.minimum(np.floor(VALUES * 1.5 / 0.3), 10)
    assert np.mean(np.asarray(found.index(jnp.asarray(VALUES))) != expected) < 1e-5


@pytest.mark.parametrize("edges", [0.5 * np.arange(4), np.array([0, 0.5, 1.25, 2])])
def test_what_is_outside_falls_into_the_nearest_bin(edges):
    found = bins.axis(edges, 1.0).index(jnp.asarray([-3.0, 0.0, 1e30], jnp.float32))
    np.testing.assert_array_equal(found, [0, 0, 3])


def test_rounding_up_keeps_float32_values_on_their_side():
    edge = np.array([0.1, 1 / 3, 1.0])
    rounded = bins.rounded_up(edge)
    assert rounded.dtype == np.float32
    assert np.all(rounded >= edge)
    assert np.all(np.nextafter(rounded, np.float32(0)) < edge)


def test_large_tables_and_few_photons_get_fewer_groups():
    assert bins.groups(Grid(0.1, 50, 0.1, 40), 10**5, most=32) == 32
    assert bins.groups(Grid(1, 1000, 1, 500), 10**5, most=32) == 16
    assert bins.groups(Grid(1, 1000, 1, 2000), 10**5, most=32) == bins.FEWEST_GROUPS
    assert bins.groups(Grid(0.1, 50, 0.1, 40), 640, most=32) == 10
    assert bins.groups(Grid(0.1, 50, 0.1, 40), 1, most=32) == 1

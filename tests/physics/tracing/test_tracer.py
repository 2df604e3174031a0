"""The fast tracer against a slow obvious one, and against itself in other shapes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import Grid, Setting, exact
from mcml_sim.results.estimate import estimate
from mcml_sim.tracing import half_space_event, orders_batch, pool, rng
from mcml_sim.tracing.order_bins import FIRST_ROULETTE, MAX_ORDER, OrderBins
from tests.physics.tracing.test_half_space_event import slow_twin

STOPS = OrderBins().stops
PHOTONS = 200_000
LANES = pool.LANES


def traced(photons, lanes=LANES):
    """Ends of the first photons of batch 0, seed 0."""
    return orders_batch.trace(jnp.asarray(rng.batch_key(0, 0)), jnp.int32(photons), STOPS, lanes=lanes)


@pytest.fixture(scope="module")
def ends():
    """Ends of the first photons of batch 0, seed 0, as numpy arrays."""
    found = traced(PHOTONS)
    return np.asarray(found.rho)[:PHOTONS], np.asarray(found.order)[:PHOTONS]


def table(rho, order):
    """Counts by 8 radii and 7 groups of orders to 64."""
    left = (order >= 1) & (order <= 64)
    radii = [0, 0.1, 0.3, 0.6, 1, 2, 4, 8, np.inf]
    return np.histogram2d(rho[left], order[left], bins=[radii, [1, 2, 3, 5, 9, 17, 33, 65]])[0].ravel()


def test_tracer_agrees_with_its_slow_twin_in_every_ring_and_order(ends, sidak):
    fast, slow = table(*ends), table(*slow_twin(Setting(), PHOTONS, 64, seed=3))
    enough = fast + slow > 25
    # Difference of two Poisson counts.
    z = (fast - slow)[enough] / np.sqrt((fast + slow)[enough])
    assert enough.sum() > 40
    assert np.abs(z).max() < sidak(enough.sum())


def test_the_comparison_sees_a_twin_that_is_off_by_5_percent(ends, sidak):
    rho, order = slow_twin(Setting(), PHOTONS, 64, seed=3)
    fast, slow = table(*ends), table(1.05 * rho, order)
    enough = fast + slow > 25
    assert np.abs((fast - slow)[enough] / np.sqrt((fast + slow)[enough])).max() > sidak(enough.sum())


def test_every_photon_ends_and_none_at_a_place_that_is_no_number(ends):
    rho, order = ends
    assert np.all(order != 0)
    assert np.all(np.isfinite(rho))
    assert np.all(rho >= 0)


def test_photons_end_inside_at_roulettes_and_at_the_cap_only(ends):
    assert set(-ends[1][ends[1] < 0]) <= set(STOPS)


def test_first_roulette_stops_half_of_those_that_reach_it(ends):
    stopped, went_on = np.sum(ends[1] == -FIRST_ROULETTE), np.sum(np.abs(ends[1]) > FIRST_ROULETTE)
    assert abs(stopped - went_on) < 4 * np.sqrt(stopped + went_on)


def test_photons_that_were_not_asked_for_are_not_started():
    found = traced(100)
    assert np.all(np.asarray(found.order)[:100] != 0)
    assert np.all(np.asarray(found.order)[100:] == 0)


@pytest.mark.slow
@pytest.mark.parametrize("lanes", [512, 16384])
def test_the_number_of_lanes_does_not_change_a_bit(ends, lanes):
    found = traced(PHOTONS, lanes)
    np.testing.assert_array_equal(np.asarray(found.rho)[:PHOTONS], ends[0])
    np.testing.assert_array_equal(np.asarray(found.order)[:PHOTONS], ends[1])


def test_a_shorter_batch_holds_the_first_photons_of_a_longer_one(ends):
    found = traced(5000)
    np.testing.assert_array_equal(np.asarray(found.rho)[:5000], ends[0][:5000])


@pytest.mark.slow
def test_double_precision_elsewhere_in_the_program_does_not_change_a_bit(ends):
    with jax.enable_x64(True):
        found = traced(PHOTONS)
    np.testing.assert_array_equal(np.asarray(found.rho)[:PHOTONS], ends[0])
    assert found.rho.dtype == np.float32


def test_rings_are_those_of_float64_edges(ends):
    """Edges that float32 cannot hold, some of them exactly where photons left."""
    rho = np.unique(ends[0].astype(np.float64))
    at = np.sort(np.random.default_rng(0).choice(rho[rho > 0], 50, replace=False))
    grid = Grid.from_edges(r=np.unique(np.concatenate([[0.0], at, at * (1 + 1e-5), np.geomspace(1e-3, 9, 30)])))
    counts = orders_batch.trace_batch(grid, 0, 0, PHOTONS)
    left = ends[1] > 0
    expected = np.bincount(
        np.searchsorted(grid.r_edges, ends[0][left].astype(float), "right") - 1, minlength=grid.rings + 1
    )
    np.testing.assert_array_equal(counts.exits.sum(axis=1), expected)


RADII = np.concatenate([[0.0], np.geomspace(0.03, 5, 12)])
EXACT_ALPHAS = np.array([0.3, 0.7, 0.9, 0.97])


@pytest.fixture(scope="module", params=["searchlight", "diffuse"])
def lit(request):
    """Half a million photons of either light."""
    grid = Grid.from_edges(r=RADII)
    return request.param, orders_batch.trace_batch(grid, 2, 0, 2**19, setting=Setting(request.param))


def deviations(counts, illumination):
    """z of the energy in every ring and beyond the last, (alphas, rings + 1)."""
    got = estimate(counts.exits, OrderBins().weights(EXACT_ALPHAS), counts.started)
    setting = Setting(illumination)
    alphas = EXACT_ALPHAS[:, None]
    within = exact.cdf(np.append(RADII, np.inf), alphas, setting=setting) * exact.reflectance(alphas, setting)
    return (got.value - np.diff(within, axis=1)) / got.standard_error


def test_every_ring_agrees_with_the_exact_answer_under_either_light(lit, sidak):
    illumination, counts = lit
    assert np.abs(deviations(counts, illumination)).max() < sidak(4 * 13)


def test_the_exact_answer_to_the_other_light_is_told_apart(lit, sidak):
    illumination, counts = lit
    other = {"searchlight": "diffuse", "diffuse": "searchlight"}[illumination]
    assert np.abs(deviations(counts, other)).max() > 3 * sidak(4 * 13)


@pytest.mark.slow
def test_the_general_kernel_agrees_where_the_fast_one_serves(lit, sidak):
    illumination, counts = lit
    where = half_space_event.half_space(Setting(illumination))
    ends = orders_batch.trace(jnp.asarray(rng.batch_key(3, 0)), jnp.int32(2**18), STOPS, where)
    rings = np.append(RADII, np.inf)
    general = np.histogram(np.asarray(ends.rho)[np.asarray(ends.order) == 3], bins=rings)[0] / 2**18
    fast = counts.exits[:, 2] / 2**19
    error = np.sqrt(general / 2**18 + fast / 2**19)
    assert np.abs((general - fast) / error).max() < sidak(13)


@pytest.mark.slow
def test_other_settings_take_the_general_kernel():
    glass = orders_batch.trace_batch(Grid(1.0, 3), 0, 0, 20_000, setting=Setting(n=1.4))
    free = orders_batch.trace_batch(Grid(1.0, 3), 0, 0, 20_000)
    assert glass.is_closed
    # Under glass fewer than half of those that come up leave.
    assert glass.exits[:, 0].sum() < 0.6 * free.exits[:, 0].sum()


def test_histogram_keeps_every_order_below_256(ends):
    counts = orders_batch.trace_batch(Grid(1.0, 1), 0, 0, PHOTONS)
    expected = np.bincount(ends[1][ends[1] > 0], minlength=257)[1:257]
    np.testing.assert_array_equal(counts.exits.sum(axis=0)[:256], expected)
    assert counts.is_closed
    assert counts.cut == np.sum(ends[1] == -MAX_ORDER)

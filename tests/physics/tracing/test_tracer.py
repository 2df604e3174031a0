"""The fast tracer, and its event, against slow obvious ones, and against itself in other shapes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import Grid, Setting
from mcml_sim.results.estimate import estimate
from mcml_sim.tracing import half_space_event, orders_batch, pool, rng
from mcml_sim.tracing.half_space_event import OrderLanes
from mcml_sim.tracing.order_bins import FIRST_ROULETTE, MAX_ORDER, OrderBins
from tests.fixtures import slow
from tests.physics.exact.test_exact_tracer import energy
from tests.physics.tracing.test_half_space_event import deviations, slow_twin, table

STOPS = OrderBins().stops
PHOTONS = 200_000
LANES = pool.LANES
EDGES = np.concatenate([[0.0], np.geomspace(0.03, 5, 12), [np.inf]])
EXACT_ALPHAS = np.array([0.3, 0.7, 0.9, 0.97])
KEY = jnp.asarray(rng.batch_key(0, 0))
ENTER = jax.jit(half_space_event.enter, static_argnames="illumination")
FLY = jax.jit(half_space_event.fly, static_argnames="events")


def traced(photons, lanes=LANES):
    """Ends of the first photons of batch 0, seed 0."""
    return orders_batch.trace(jnp.asarray(rng.batch_key(0, 0)), jnp.int32(photons), STOPS, lanes=lanes)


@pytest.fixture(scope="module")
def ends():
    found = traced(PHOTONS)
    return np.asarray(found.rho)[:PHOTONS], np.asarray(found.order)[:PHOTONS]


def test_tracer_agrees_with_its_slow_twin_in_every_ring_and_order(ends, sidak):
    rho, order = slow_twin(Setting(), PHOTONS, 64, seed=3)
    z, off = (deviations(table(*ends, 64), table(scale * rho, order, 64)) for scale in (1.0, 1.05))
    assert z.size > 40
    assert np.abs(z).max() < sidak(z.size)
    assert np.abs(off).max() > sidak(off.size)


def test_every_photon_ends_at_a_place_and_inside_at_roulettes_and_the_cap_only(ends):
    """And the first roulette stops half of those that reach it."""
    rho, order = ends
    assert np.all(order != 0)
    assert np.all(np.isfinite(rho))
    assert np.all(rho >= 0)
    assert set(-order[order < 0]) <= set(STOPS)
    stopped, went_on = np.sum(order == -FIRST_ROULETTE), np.sum(np.abs(order) > FIRST_ROULETTE)
    assert abs(stopped - went_on) < 4 * np.sqrt(stopped + went_on)


@pytest.mark.parametrize(
    ("photons", "lanes", "x64"),
    [(5000, LANES, False), *slow((PHOTONS, 512, False), (PHOTONS, 16384, False), (PHOTONS, LANES, True))],
    ids=["a shorter batch", "few lanes", "many lanes", "double precision elsewhere"],
)
def test_no_bit_changes_with(ends, photons, lanes, x64):
    with jax.enable_x64(x64):
        found = traced(photons, lanes)
    np.testing.assert_array_equal(np.asarray(found.rho)[:photons], ends[0][:photons])
    np.testing.assert_array_equal(np.asarray(found.order)[:photons], ends[1][:photons])
    assert np.all(np.asarray(found.order)[photons:] == 0), "they were not asked for, and not started"
    assert found.rho.dtype == np.float32


def test_rings_are_those_of_float64_edges(ends):
    """Edges that float32 cannot hold, some of them exactly where photons left."""
    rho = np.unique(ends[0].astype(np.float64))
    at = np.sort(np.random.default_rng(0).choice(rho[rho > 0], 50, replace=False))
    grid = Grid.from_edges(r=np.unique(np.concatenate([[0.0], at, at * (1 + 1e-5), np.geomspace(1e-3, 9, 30)])))
    counts = orders_batch.trace_batch(grid, 0, 0, PHOTONS)
    left = ends[1] > 0
    ring = np.searchsorted(grid.r_edges, ends[0][left].astype(float), "right") - 1
    expected = np.bincount(ring, minlength=grid.rings + 1)
    np.testing.assert_array_equal(counts.exits.sum(axis=1), expected)
    # And every order below 256 has its own bin.
    counts = orders_batch.trace_batch(Grid(1.0, 1), 0, 0, PHOTONS)
    expected = np.bincount(ends[1][ends[1] > 0], minlength=257)[1:257]
    np.testing.assert_array_equal(counts.exits.sum(axis=0)[:256], expected)
    assert counts.is_closed
    assert counts.cut == np.sum(ends[1] == -MAX_ORDER)


@pytest.fixture(scope="module", params=["searchlight", "diffuse"])
def lit(request):
    grid = Grid.from_edges(r=EDGES[:-1])
    return request.param, orders_batch.trace_batch(grid, 2, 0, 2**19, setting=Setting(request.param))


def from_exact(counts, illumination):
    """z of the energy in every ring and beyond the last, (alphas, rings + 1)."""
    got = estimate(counts.exits, OrderBins().weights(EXACT_ALPHAS), counts.started)
    return (got.value - energy(EXACT_ALPHAS[:, None], EDGES, Setting(illumination))) / got.standard_error


def test_every_ring_agrees_with_the_exact_answer_under_either_light(lit, sidak):
    illumination, counts = lit
    other = {"searchlight": "diffuse", "diffuse": "searchlight"}[illumination]
    assert np.abs(from_exact(counts, other)).max() > 3 * sidak(4 * 13)
    assert np.abs(from_exact(counts, illumination)).max() < sidak(4 * 13)


def test_azimuth_cosine_is_the_sine_to_5e_7_and_never_beyond_one():
    """At all corners of the range and a million points between."""
    near = np.arange(2**17)
    between = np.random.default_rng(0).integers(0, 2**32, 10**6)
    words = np.concatenate([2**31 - 1 - near, 2**31 + near, near, 2**32 - 1 - near, between]).astype(np.uint32)
    cosine = np.asarray(jax.jit(half_space_event.azimuth_cosine)(words), np.float64)
    exact = np.sin(np.pi * (words.view(np.int32) + 0.5) / 2.0**32)
    assert np.abs(cosine - exact).max() < 5e-7
    assert np.abs(cosine).max() <= 1
    # It is that of a uniform angle.
    words = np.random.default_rng(1).integers(0, 2**32, 10**6).astype(np.uint32)
    angle = np.arccos(np.asarray(half_space_event.azimuth_cosine(jnp.asarray(words)), np.float64)) / np.pi
    # Kolmogorov-Smirnov: 1.95 / sqrt(N) has a chance of 1e-3.
    rank = (np.arange(10**6) + 0.5) / 10**6
    assert np.abs(np.sort(angle) - rank).max() < 1.95e-3


def test_displacement_is_that_of_the_plane():
    source = np.random.default_rng(2)
    rho, path = 10 ** source.uniform(-3, 2, 10**5), 10 ** source.uniform(-3, 1, 10**5)
    angle, sine = source.uniform(0, 6.3, 10**5), source.uniform(0, 1, 10**5)
    exact = np.hypot(rho + path * sine * np.cos(angle), path * sine * np.sin(angle))
    fast = half_space_event.displaced(*(jnp.asarray(v, jnp.float32) for v in (rho, path, sine**2, np.cos(angle))))
    np.testing.assert_allclose(fast, exact, atol=3e-7 * (rho + path).max(), rtol=2e-6)


def placed(z, order, last=MAX_ORDER, count=2**14):
    place = jnp.full(count, 1 + 1j * z, jnp.complex64)
    numbers = (jnp.full(count, n, jnp.int32) for n in (order, last))
    return OrderLanes(place, None, *numbers, jnp.arange(count, dtype=jnp.uint32))


def test_diffuse_light_enters_in_all_directions_weighted_by_their_cosine():
    place = ENTER(KEY, jnp.arange(2**18, dtype=jnp.uint32), STOPS, illumination="diffuse").place
    rho, z = np.asarray(place.real, np.float64), np.asarray(place.imag, np.float64)
    path, square = np.hypot(rho, z), np.sort(z**2 / (rho**2 + z**2))
    assert abs(path.mean() - 1) < 4 / 2**9
    # Kolmogorov-Smirnov: 1.95 / sqrt(N) has a chance of 1e-3.
    assert np.abs(square - (np.arange(2**18) + 0.5) / 2**18).max() < 1.95 / 2**9
    assert abs(np.corrcoef(path, z / path)[0, 1]) < 4 / 2**9


def test_deep_photons_stay_and_walk_isotropically():
    after = FLY(KEY, placed(100.0, 0), 1)
    step = np.asarray(after.place.imag, np.float64) - 100
    # z moves by t mu: mean 0, variance E[t^2] E[mu^2] = 2/3.
    assert abs(step.mean()) < 4 * np.sqrt(2 / 3 / step.size)
    # rho^2 grows by E[t^2] E[sin^2] = 4/3, with variance 40 * 8/15 + ... < 30 for rho = 1.
    assert abs(np.mean(np.asarray(after.place.real, np.float64) ** 2) - 1 - 4 / 3) < 4 * np.sqrt(30 / step.size)
    assert np.all(after.order == 1)


def test_photons_at_the_surface_leave_half_the_time():
    after = FLY(KEY, placed(1e-6, 0), 1)
    left = np.asarray(after.ended)
    assert not np.any(np.asarray(after.stopped)[left])
    assert abs(left.mean() - 0.5) < 4 * 0.5 / np.sqrt(left.size)
    # Straight above where they were, but for grazing ones.
    assert np.median(np.abs(np.asarray(after.place.real)[left] - 1)) < 1e-5


@pytest.mark.parametrize("events", [2, 5, 16])
def test_many_events_at_once_are_those_one_by_one(events):
    at_once = FLY(KEY, placed(1.5, 20, last=30), events)
    pool, ended = placed(1.5, 20, last=30), np.zeros(2**14, bool)
    for event in range(events):
        pool = pool._replace(order=jnp.full(2**14, 20 + event, jnp.int32))
        pool = FLY(KEY, pool, 1)
        new = np.asarray(pool.ended) & ~ended
        ended |= new
        np.testing.assert_array_equal(np.asarray(at_once.order)[new], 21 + event)
        np.testing.assert_array_equal(np.asarray(at_once.stopped)[new], np.asarray(pool.stopped)[new])
    np.testing.assert_array_equal(at_once.ended, ended)
    # A compiler may contract other products and sums in one go than in another.
    np.testing.assert_allclose(at_once.place.real, pool.place.real, rtol=1e-5, atol=1e-5)
    flying = ~ended
    np.testing.assert_allclose(np.asarray(at_once.place.imag)[flying], np.asarray(pool.place.imag)[flying], rtol=1e-4)


def test_photons_are_stopped_at_their_last_order_and_nowhere_else():
    for last in (20, 21, 35, 36):
        after = FLY(KEY, placed(1e3, 19, last), 16)
        assert np.all(np.asarray(after.ended & after.stopped) == (last < 36))
        assert np.all(np.asarray(after.order) == min(last, 35))


def test_half_the_photons_win_each_toss_independently_of_the_depth_it_is_drawn_with():
    entered = ENTER(KEY, jnp.arange(2**18, dtype=jnp.uint32), STOPS)
    # First scatterings lie straight below at exponential depths.
    assert np.all(entered.place.real == 0)
    assert np.all(entered.order == 0)
    assert abs(np.mean(entered.place.imag[: 2**16]) - 1) < 4 / 2**8
    z, last = np.asarray(entered.place.imag, np.float64), np.asarray(entered.last)
    counts = np.array([np.sum(last == stop) for stop in STOPS])
    expected = 2**18 * np.append(0.5 ** np.arange(1, 8), 0.5**7)
    assert counts.sum() == 2**18
    assert STOPS[-1] == MAX_ORDER
    assert np.all(np.abs(counts - expected) < 4 * np.sqrt(expected))
    loses = last == FIRST_ROULETTE
    assert abs(z[loses].mean() - z[~loses].mean()) < 4 * np.sqrt(4 / 2**18)

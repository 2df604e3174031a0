import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim.tracing import half_space_event, rng
from mcml_sim.tracing.half_space_event import OrderLanes
from mcml_sim.tracing.order_bins import FIRST_ROULETTE, MAX_ORDER, OrderBins

STOPS = OrderBins().stops


def azimuth_words():
    """All corners of the range and a million points between."""
    near_ends = np.concatenate(
        [np.arange(2**31 - 2**17, 2**31 + 2**17), np.arange(2**17), 2**32 - 1 - np.arange(2**17)]
    )
    between = np.random.default_rng(0).integers(0, 2**32, 10**6)
    return np.concatenate([near_ends, between]).astype(np.uint32)


def test_azimuth_cosine_is_the_sine_to_5e_7_and_never_beyond_one():
    words = azimuth_words()
    cosine = np.asarray(jax.jit(half_space_event.azimuth_cosine)(words), np.float64)
    exact = np.sin(np.pi * (words.view(np.int32) + 0.5) / 2.0**32)
    assert np.abs(cosine - exact).max() < 5e-7
    assert np.abs(cosine).max() <= 1


def test_azimuth_cosine_is_that_of_a_uniform_angle():
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


def lanes(z, order, last=MAX_ORDER, count=2**14):
    place = jnp.full(count, 1 + 1j * z, jnp.complex64)
    numbers = (jnp.full(count, n, jnp.int32) for n in (order, last))
    return OrderLanes(place, None, *numbers, jnp.arange(count, dtype=jnp.uint32))


KEY = jnp.asarray(rng.batch_key(0, 0))
ENTER = jax.jit(half_space_event.enter, static_argnames="illumination")
FLY = jax.jit(half_space_event.fly, static_argnames="events")


def test_first_scatterings_lie_straight_below_at_exponential_depths():
    pool = ENTER(KEY, jnp.arange(2**16, dtype=jnp.uint32), STOPS)
    assert np.all(pool.place.real == 0)
    assert np.all(pool.order == 0)
    assert abs(np.mean(pool.place.imag) - 1) < 4 / 2**8


def test_diffuse_light_enters_in_all_directions_weighted_by_their_cosine():
    place = ENTER(KEY, jnp.arange(2**18, dtype=jnp.uint32), STOPS, illumination="diffuse").place
    rho, z = np.asarray(place.real, np.float64), np.asarray(place.imag, np.float64)
    path, square = np.hypot(rho, z), np.sort(z**2 / (rho**2 + z**2))
    assert abs(path.mean() - 1) < 4 / 2**9
    # Kolmogorov-Smirnov: 1.95 / sqrt(N) has a chance of 1e-3.
    assert np.abs(square - (np.arange(2**18) + 0.5) / 2**18).max() < 1.95 / 2**9
    assert abs(np.corrcoef(path, z / path)[0, 1]) < 4 / 2**9


def test_deep_photons_stay_and_walk_isotropically():
    after = FLY(KEY, lanes(100.0, 0), 1)
    step = np.asarray(after.place.imag, np.float64) - 100
    # z moves by t mu: mean 0, variance E[t^2] E[mu^2] = 2/3.
    assert abs(step.mean()) < 4 * np.sqrt(2 / 3 / step.size)
    # rho^2 grows by E[t^2] E[sin^2] = 4/3, with variance 40 * 8/15 + ... < 30 for rho = 1.
    assert abs(np.mean(np.asarray(after.place.real, np.float64) ** 2) - 1 - 4 / 3) < 4 * np.sqrt(30 / step.size)
    assert np.all(after.order == 1)


def test_photons_at_the_surface_leave_half_the_time():
    after = FLY(KEY, lanes(1e-6, 0), 1)
    left = np.asarray(after.ended)
    assert not np.any(np.asarray(after.stopped)[left])
    assert abs(left.mean() - 0.5) < 4 * 0.5 / np.sqrt(left.size)
    # Straight above where they were, but for grazing ones.
    assert np.median(np.abs(np.asarray(after.place.real)[left] - 1)) < 1e-5


@pytest.mark.parametrize("events", [2, 5, 16])
def test_many_events_at_once_are_those_one_by_one(events):
    at_once = FLY(KEY, lanes(1.5, 20, last=30), events)
    pool, ended = lanes(1.5, 20, last=30), np.zeros(2**14, bool)
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
        after = FLY(KEY, lanes(1e3, 19, last), 16)
        assert np.all(np.asarray(after.ended & after.stopped) == (last < 36))
        assert np.all(np.asarray(after.order) == min(last, 35))


def test_half_the_photons_win_each_toss():
    last = np.asarray(ENTER(KEY, jnp.arange(2**18, dtype=jnp.uint32), STOPS).last)
    counts = np.array([np.sum(last == stop) for stop in STOPS])
    expected = 2**18 * np.append(0.5 ** np.arange(1, 8), 0.5**7)
    assert counts.sum() == 2**18
    assert STOPS[-1] == MAX_ORDER
    assert np.all(np.abs(counts - expected) < 4 * np.sqrt(expected))


def test_tosses_are_independent_of_the_depth_they_are_drawn_with():
    pool = ENTER(KEY, jnp.arange(2**18, dtype=jnp.uint32), STOPS)
    z, loses = np.asarray(pool.place.imag, np.float64), np.asarray(pool.last) == FIRST_ROULETTE
    assert abs(z[loses].mean() - z[~loses].mean()) < 4 * np.sqrt(4 / 2**18)

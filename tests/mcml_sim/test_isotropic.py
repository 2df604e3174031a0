import jax
import jax.numpy as jnp
import numpy as np

from mcml_sim import isotropic, rng
from mcml_sim.isotropic import FIRST_ROULETTE, MAX_ORDER, Lanes


def azimuth_words():
    """All corners of the range and a million points between."""
    near_ends = np.concatenate(
        [np.arange(2**31 - 2**17, 2**31 + 2**17), np.arange(2**17), 2**32 - 1 - np.arange(2**17)]
    )
    between = np.random.default_rng(0).integers(0, 2**32, 10**6)
    return np.concatenate([near_ends, between]).astype(np.uint32)


def test_azimuth_cosine_is_the_sine_to_5e_7_and_never_beyond_one():
    words = azimuth_words()
    cosine = np.asarray(jax.jit(isotropic.azimuth_cosine)(words), np.float64)
    exact = np.sin(np.pi * (words.view(np.int32) + 0.5) / 2.0**32)
    assert np.abs(cosine - exact).max() < 5e-7
    assert np.abs(cosine).max() <= 1


def test_azimuth_cosine_is_that_of_a_uniform_angle():
    words = np.random.default_rng(1).integers(0, 2**32, 10**6).astype(np.uint32)
    angle = np.arccos(np.asarray(isotropic.azimuth_cosine(jnp.asarray(words)), np.float64)) / np.pi
    # Kolmogorov-Smirnov: 1.95 / sqrt(N) has a chance of 1e-3.
    rank = (np.arange(10**6) + 0.5) / 10**6
    assert np.abs(np.sort(angle) - rank).max() < 1.95e-3


def test_displacement_is_that_of_the_plane():
    source = np.random.default_rng(2)
    rho, step, angle = (
        10 ** source.uniform(-3, 2, 10**5),
        10 ** source.uniform(-3, 1, 10**5),
        source.uniform(0, 6.3, 10**5),
    )
    exact = np.hypot(rho + step * np.cos(angle), step * np.sin(angle))
    fast = isotropic.displaced(*(jnp.asarray(v, jnp.float32) for v in (rho, step, np.cos(angle))))
    np.testing.assert_allclose(fast, exact, atol=3e-7 * (rho + step).max(), rtol=2e-6)


def lanes(z, order, count=2**14):
    place = jnp.full(count, 1 + 1j * z, jnp.complex64)
    return Lanes(place, jnp.full(count, order, jnp.int32), jnp.arange(count, dtype=jnp.uint32))


KEY = jnp.asarray(rng.batch_key(0, 0))
SCATTER = jax.jit(isotropic.scatter)


def test_first_scatterings_lie_straight_below_at_exponential_depths():
    pool = isotropic.enter(KEY, jnp.arange(2**16, dtype=jnp.uint32))
    assert np.all(pool.place.real == 0)
    assert np.all(pool.order == 0)
    assert abs(np.mean(pool.place.imag) - 1) < 4 / 2**8


def test_deep_photons_stay_and_walk_isotropically():
    after = SCATTER(KEY, lanes(100.0, 0))
    step = np.asarray(after.place.imag, np.float64) - 100
    # z moves by t mu: mean 0, variance E[t^2] E[mu^2] = 2/3.
    assert abs(step.mean()) < 4 * np.sqrt(2 / 3 / step.size)
    # rho^2 grows by E[t^2] E[sin^2] = 4/3, with variance 40 * 8/15 + ... < 30 for rho = 1.
    assert abs(np.mean(np.asarray(after.place.real, np.float64) ** 2) - 1 - 4 / 3) < 4 * np.sqrt(30 / step.size)
    assert np.all(after.order == 1)


def test_photons_at_the_surface_leave_half_the_time():
    after = SCATTER(KEY, lanes(1e-6, 0))
    left = np.asarray(after.place.imag) == isotropic.OUT
    assert abs(left.mean() - 0.5) < 4 * 0.5 / np.sqrt(left.size)
    # Straight above where they were, but for grazing ones.
    assert np.median(np.abs(np.asarray(after.place.real)[left] - 1)) < 1e-5


def test_ended_photons_stay_as_they_are():
    for depth in (isotropic.OUT, isotropic.INSIDE):
        before = lanes(depth, 7)
        for a, b in zip(before, SCATTER(KEY, before), strict=True):
            np.testing.assert_array_equal(a, b)


def test_roulette_stops_half_at_every_doubling_and_nobody_elsewhere():
    for order in (63, 64, 65, 127, 128, 129, 4096, 8191):
        stopped = np.asarray(SCATTER(KEY, lanes(1e3, order - 1)).place.imag) == isotropic.INSIDE
        if order in (64, 128, 4096):
            assert abs(stopped.mean() - 0.5) < 4 * 0.5 / np.sqrt(stopped.size)
        else:
            assert not stopped.any()
    assert np.all(np.asarray(SCATTER(KEY, lanes(1e3, MAX_ORDER - 1)).place.imag) == isotropic.INSIDE)


def test_roulette_weight_doubles_just_after_each_toss():
    orders = np.arange(1, MAX_ORDER + 1)
    tosses = np.cumsum(np.asarray(isotropic.is_roulette(jnp.asarray(orders))))
    passed = np.concatenate([[0], tosses[:-1]])  # a photon that leaves at n has not tossed at n
    np.testing.assert_array_equal(isotropic.roulette_weight(orders), 2**passed)
    assert isotropic.roulette_weight(FIRST_ROULETTE) == 1
    assert isotropic.roulette_weight(FIRST_ROULETTE + 1) == 2
    assert isotropic.roulette_weight(MAX_ORDER) == 128


def test_toss_is_fair_and_independent_of_the_direction_it_shares_a_word_with():
    words = np.random.default_rng(3).integers(0, 2**32, 10**6).astype(np.uint32)
    loses = np.asarray(isotropic.loses_toss(jnp.asarray(words)))
    cosine = np.asarray(rng.symmetric(jnp.asarray(words)), np.float64)
    assert abs(loses.mean() - 0.5) < 4 * 0.5e-3
    assert abs(cosine[loses].mean() - cosine[~loses].mean()) < 4 * np.sqrt(4 / 3 / 10**6)

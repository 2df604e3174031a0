from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import kstest

from mcml_sim import Layer, Medium
from mcml_sim.media.medium import fresnel
from mcml_sim.tracing import layered_event, rng
from mcml_sim.tracing.layered_event import CUT, EVENTS_PER_TURN, FIRST_TOSS, MAX_EVENTS, REFLECTED, ROULETTED, THRESHOLD

KEY = jnp.asarray(rng.batch_key(5, 0))
GO = jnp.bool_(True)
NUMBER = 2**14
# Layers 1 and 2 are matched; 3 is denser; above and below is air.
STACK = layered_event.stack(Medium((Layer(1.4, 1, 9, 0.8, 5), Layer(1.4, 0, 2, -0.5, 1), Layer(1.6, 1, 1, 0, 2))), 1.0)
ENDLESS = STACK._replace(thickness=np.full(3, np.inf, np.float32))  # from deep inside its layers nobody waits


def lanes(direction=(0.0, 0.0, 1.0), z=0.5, layer=1, weight=1.0, event=0):
    """Many photons in one state; negative weights wait."""
    pool = layered_event.enter(KEY, jnp.arange(NUMBER, dtype=jnp.uint32), layer, jnp.empty(0), 0)
    ux, uy, uz = direction
    return pool._replace(
        down=jnp.full(NUMBER, z + 1j * uz, jnp.complex64),
        heading=jnp.full(NUMBER, ux + 1j * uy, jnp.complex64),
        weight=jnp.full(NUMBER, weight, jnp.float32),
        event=jnp.full(NUMBER, event, jnp.uint32),
    )


@jax.jit
def scatter(pool, event=0):
    return layered_event.scatter(GO, KEY, pool, pool.event + jnp.uint32(event), layered_event.optics(STACK, pool.layer))


@jax.jit
def settle(pool):
    return layered_event.settle(GO, KEY, STACK, pool, pool.event + jnp.uint32(EVENTS_PER_TURN - 1))


def direction_of(pool):
    return np.stack([pool.heading.real, pool.heading.imag, pool.down.imag]).astype(float)


def unit(*components):
    return tuple(np.asarray(components) / np.linalg.norm(components))


def test_azimuth_is_cosine_and_sine_to_5e_7():
    v = np.linspace(-1, 1, 100_001, dtype=np.float32)
    cosine, sine = (np.asarray(a, float) for a in jax.jit(layered_event.azimuth)(v))
    np.testing.assert_allclose(cosine, np.cos(np.pi * v.astype(float)), atol=5e-7)
    np.testing.assert_allclose(sine, np.sin(np.pi * v.astype(float)), atol=5e-7)
    np.testing.assert_allclose(np.hypot(cosine, sine), 1, atol=5e-7)


@pytest.mark.slow
@pytest.mark.parametrize(
    "direction", [(0, 0, 1), (0, 0, -1), (1, 0, 0), unit(1, 2, 3), unit(-2, 0.1, -1), unit(1e-4, 0, -1)]
)
@pytest.mark.parametrize(("layer", "g"), [(1, 0.8), (2, -0.5), (3, 0.0)])
def test_scattering_turns_by_g_and_evenly_around(direction, layer, g):
    pool = lanes(direction, z=1e6, layer=layer)
    after, _ = layered_event.scatter(GO, KEY, pool, pool.event, layered_event.optics(ENDLESS, pool.layer))
    turned = direction_of(after)
    np.testing.assert_allclose(np.linalg.norm(turned, axis=0), 1, atol=2e-6)
    along = turned.T @ np.asarray(direction, float)
    assert abs(along.mean() - g) < 4 * along.std() / np.sqrt(NUMBER)
    # At right angles to the old direction nothing is preferred, neither to one side nor along one axis.
    aside = turned - np.outer(direction, along)
    one = np.cross(direction, unit(3, -1, 0.5))
    one /= np.linalg.norm(one)
    azimuth = np.arctan2(np.cross(direction, one) @ aside, one @ aside)
    assert kstest(azimuth, "uniform", (-np.pi, 2 * np.pi)).pvalue > 1e-3


def test_free_paths_are_exponential_and_end_where_the_photon_is():
    direction = unit(1, 2, -2)
    pool = lanes(direction, z=1e3, layer=2)
    after, left = layered_event.scatter(GO, KEY, pool, pool.event, layered_event.optics(ENDLESS, pool.layer))
    assert not np.any(left)
    paths = np.abs(np.asarray(after.place, complex)) / np.hypot(*direction[:2])
    assert kstest(paths, "expon", (0, 0.5)).pvalue > 1e-3
    np.testing.assert_allclose(after.place, paths * (direction[0] + 1j * direction[1]), rtol=1e-5)
    np.testing.assert_allclose(after.down.real - 1e3, paths * direction[2], atol=1e-4)


def test_each_interaction_takes_its_share_and_waiting_takes_none():
    after, left = scatter(lanes())
    # Layer 1 is 5 thick, the photons are at .5 and fly down with 10 interactions a unit: next to all stay inside.
    np.testing.assert_allclose(after.weight, 0.9, rtol=1e-6)
    np.testing.assert_allclose(left, 0.1, rtol=1e-6)
    after, left = scatter(lanes(direction=(0, 0, -1), z=0.1))
    flew = np.asarray(after.weight) > 0
    np.testing.assert_array_equal(np.asarray(left) > 0, flew)
    assert abs(flew.mean() - (1 - np.exp(-1))) < 4 * 0.5 / np.sqrt(NUMBER)
    np.testing.assert_array_equal(np.asarray(after.weight)[~flew], -1)
    np.testing.assert_array_equal(np.asarray(after.down)[~flew], np.complex64(0.1 - 1j))
    # Those who wait or have ended stay as they are.
    before = lanes(unit(1, 0, 1), weight=-0.3)
    after, left = scatter(before)
    assert not np.any(left)
    for old, new in zip(jax.tree.leaves(before), jax.tree.leaves(after), strict=True):
        np.testing.assert_array_equal(old, new)


def test_a_matched_interface_lets_everyone_through_without_bending():
    direction = unit(3, 0, 1)
    after = settle(lanes(direction, z=4, layer=1, weight=-1))
    assert np.all(after.layer == 2)
    np.testing.assert_allclose(direction_of(after), np.outer(direction, np.ones(NUMBER)), atol=1e-6)
    np.testing.assert_array_equal(after.down.real, 0)
    np.testing.assert_allclose(after.place, 3, rtol=1e-6)  # one unit further down at this slope


def test_an_interface_reflects_by_fresnel_and_bends_by_snell():
    direction = unit(1, 1, -1)
    after = settle(lanes(direction, z=0.5, layer=3, weight=-1))
    reflectance, cosine = fresnel(1.6, 1.4, -direction[2])
    reflected = np.asarray(after.layer) == 3
    assert abs(reflected.mean() - reflectance) < 4 * np.sqrt(reflectance / NUMBER)
    up, down = direction_of(after)[:, ~reflected], direction_of(after)[:, reflected]
    np.testing.assert_allclose(down, np.outer(unit(1, 1, 1), np.ones(down.shape[1])), atol=1e-6)
    np.testing.assert_allclose(up[2], -cosine, rtol=1e-6)
    np.testing.assert_allclose(up[:2], 1.6 / 1.4 * direction[0], rtol=1e-6)
    np.testing.assert_array_equal(np.asarray(after.layer)[~reflected], 2)
    np.testing.assert_array_equal(np.asarray(after.down.real)[~reflected], 1)  # the bottom of layer 2


def test_total_reflection_lets_nobody_out_and_the_normal_lets_most():
    assert np.all(settle(lanes(unit(2, 0, -1), layer=1, weight=-1)).layer == 1)
    for uz, layer, beyond, share, most in ((-1, 1, REFLECTED, 0.4 / 2.4, 0.03), (1, 3, 4, 0.6 / 2.6, 0.06)):
        out = np.mean(np.asarray(settle(lanes((0, 0, uz), layer=layer, weight=-1)).layer) == beyond)
        assert abs(1 - out - share**2) < 4 * np.sqrt(most / NUMBER)


def test_what_has_left_is_marked_and_stays_as_it_is():
    after = settle(lanes(unit(0.3, 0.4, -1), layer=1, weight=-0.7))
    out = np.asarray(after.layer) == REFLECTED
    np.testing.assert_array_equal(after.ended, out)
    np.testing.assert_array_equal(np.asarray(after.weight)[out], np.float32(-0.7))
    for old, new in zip(jax.tree.leaves(after), jax.tree.leaves(settle(scatter(after)[0])), strict=True):
        np.testing.assert_array_equal(np.asarray(old)[out], np.asarray(new)[out])


@pytest.mark.parametrize(
    ("weight", "event", "chance"), [(0.1, 0, 0.5), (1.0, FIRST_TOSS - 2, 0.5), (0.1, 4 * FIRST_TOSS - 1, 0.25)]
)
def test_roulette_keeps_the_weight_of_all(weight, event, chance):
    after = settle(lanes(weight=weight, event=event))
    goes_on = ~np.asarray(after.ended)
    assert abs(goes_on.mean() - chance) < 4 * np.sqrt(chance * (1 - chance) / NUMBER)
    np.testing.assert_allclose(np.asarray(after.weight)[goes_on], weight / chance, rtol=1e-6)
    assert np.all(np.asarray(after.layer)[~goes_on] == ROULETTED)


def test_nothing_ends_for_good_but_by_weight_zero_and_the_cap():
    # Long paths toss once an octave, and not where they are cut.
    events = np.arange(0, MAX_EVENTS + EVENTS_PER_TURN, EVENTS_PER_TURN, dtype=np.uint32) + EVENTS_PER_TURN - 1
    assert np.sum(np.asarray(layered_event.is_late(jnp.asarray(events)))) == np.log2(MAX_EVENTS // FIRST_TOSS)
    above = settle(lanes(weight=1.01 * THRESHOLD))  # which is left alone
    assert not np.any(above.ended)
    np.testing.assert_array_equal(above.weight, np.float32(1.01 * THRESHOLD))
    assert np.all(settle(lanes(weight=0.0)).layer == ROULETTED)
    for turn in range(EVENTS_PER_TURN):  # wherever in a turn the last event falls
        stopped = settle(lanes(weight=1.0, event=MAX_EVENTS - turn + EVENTS_PER_TURN))
        assert np.all(stopped.layer == CUT)
        np.testing.assert_array_equal(stopped.weight, -1)


def test_many_layers_are_gathered_as_few_are_selected():
    layer = jnp.asarray(np.r_[1:9, 3], jnp.int32)
    for values in (jnp.arange(8.0), jnp.arange(20.0)):
        np.testing.assert_array_equal(layered_event.pick(values, layer), layer - 1)


@pytest.mark.slow
def test_directions_keep_their_length_over_a_thousand_turns():
    @partial(jax.jit, static_argnames="turns")
    def walk(pool, turns):
        def turn(_, pool):
            here = layered_event.optics(ENDLESS, pool.layer)
            for number in range(EVENTS_PER_TURN - 1):
                pool, _ = layered_event.scatter(GO, KEY, pool, pool.event + number, here)
            pool = layered_event.settle(GO, KEY, ENDLESS, pool, pool.event + EVENTS_PER_TURN - 1)
            return pool._replace(event=pool.event + EVENTS_PER_TURN, weight=jnp.ones_like(pool.weight))

        return jax.lax.fori_loop(0, turns, turn, pool)

    after = walk(lanes(z=1e4, layer=2), 1000)
    flying = np.asarray(after.layer) == 2
    assert flying.any()
    np.testing.assert_allclose(np.linalg.norm(direction_of(after)[:, flying], axis=0), 1, atol=3e-6)

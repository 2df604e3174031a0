"""The pool by itself, with photons whose ends are known beforehand."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim.tracing import pool


class Timers(NamedTuple):
    """Photons that end after a number of turns that depends on their number only."""

    place: jax.Array
    turns: jax.Array
    photon: jax.Array

    @property
    def ended(self):
        return self.place.imag < 0


def life(photon):
    """Turns, between 1 and 40, most of them few."""
    hashed = (photon * np.uint32(2654435761)) >> 16
    return 1 + (hashed & 3) + jnp.where(hashed % 64 == 0, 36, 0)


def enter(photon):
    return Timers(jnp.full(photon.shape, 1j, jnp.complex64), jnp.zeros(photon.shape, jnp.int32), photon)


def turn(flying, seen):
    turns = flying.turns + 1
    ends = ~flying.ended & (turns >= life(flying.photon))
    place = jnp.where(flying.ended | ends, jnp.complex64(-1j), flying.place)
    return Timers(place, turns, flying.photon), seen.at[flying.photon].add(jnp.where(ends, turns, 0), mode="drop")


def followed(photons, lanes, turn=turn):
    seen = jnp.zeros(pool.BATCH_PHOTONS, jnp.int32)
    return np.asarray(jax.jit(lambda n: pool.follow(enter, turn, seen, n, lanes))(jnp.int32(photons)))


@pytest.mark.slow
@pytest.mark.parametrize("lanes", [64, 512, 8192])
@pytest.mark.parametrize("photons", [1, 100, 20_000])
def test_every_photon_lives_once_to_its_end_and_no_other_is_started(photons, lanes):
    expected = np.asarray(life(jnp.arange(photons, dtype=jnp.uint32)))
    seen = followed(photons, lanes)
    np.testing.assert_array_equal(seen[:photons], expected)
    assert np.all(seen[photons:] == 0)


def test_an_end_is_seen_once_and_no_photons_are_no_work():
    def counting(flying, seen):
        after, _ = turn(flying, seen)
        return after, seen.at[flying.photon].add(jnp.where(after.ended, 1, 0), mode="drop")

    assert np.all(followed(5000, 512, counting)[:5000] == 1)
    assert np.all(followed(0, 64) == 0)


def test_rank_is_the_cumulative_sum():
    flags = np.random.default_rng(0).random(4096) < 0.3
    np.testing.assert_array_equal(pool.ranks(jnp.asarray(flags)), np.cumsum(flags))
    np.testing.assert_array_equal(pool.ranks(jnp.ones(16384, bool)), np.arange(1, 16385))

"""The generator where the tracer uses it: words of (seed, batch, photon, event) in every neighbourhood of each other.

All inputs are fixed, so each test is passed or failed for good; thresholds are Sidak's for a chance of 1e-3.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import chi2

from mcml_sim.tracing import rng

PHOTONS, EVENTS = 4096, 64
DRAWS = {"four": jax.jit(rng.draw), "three": jax.jit(rng.draw_three)}


@pytest.fixture(params=DRAWS)
def draw(request):
    """Either generator, as (key, photon, event) -> words."""
    return DRAWS[request.param]


def words(draw, seed=0, batch=0, photons=PHOTONS, events=EVENTS):
    """uint32 (photons, events, 3 or 4)."""
    photon, event = np.indices((photons, events), dtype=np.uint32)
    return np.stack(draw(jnp.asarray(rng.batch_key(seed, batch)), photon, event), axis=-1)


def correlation(a, b):
    """z of the correlation of two sets of uniform words."""
    a, b = (w.ravel() / 2.0**32 - 0.5 for w in (a, b))
    return float(np.mean(a * b) * 12 * np.sqrt(a.size))


def avalanche(draw, keys, sidak):
    """Largest |z|, over its threshold, of flips of any output bit by any bit of photon (20) or event (13)."""
    source = np.random.default_rng(0)
    photon, event = source.integers(0, 2**20, 2**14, np.uint32), source.integers(0, 8192, 2**14, np.uint32)
    base = np.stack(draw(keys, photon, event))
    worst = 0.0
    flips = [(1 << b, 0) for b in range(20)] + [(0, 1 << b) for b in range(13)]
    for a, b in flips:
        changed = np.stack(draw(keys, photon ^ np.uint32(a), event ^ np.uint32(b))) ^ base
        bits = np.unpackbits(np.ascontiguousarray(changed.T).view(np.uint8), axis=1)
        worst = max(worst, float(np.abs(bits.mean(axis=0) - 0.5).max() * 2 * np.sqrt(len(bits))))  # z for fair bits
    return worst / sidak(len(flips) * 32 * len(base))


@pytest.mark.parametrize("shift", [0, 12, 24])
def test_low_middle_and_high_bits_are_uniform(draw, shift):
    bytes_ = (words(draw) >> np.uint32(shift)) & 255
    for word in range(bytes_.shape[-1]):
        counts = np.bincount(bytes_[..., word].ravel(), minlength=256)
        expected = bytes_[..., word].size / 256
        assert 1e-3 / 12 < chi2.sf(np.sum((counts - expected) ** 2 / expected), 255) < 1 - 1e-3 / 12


def test_words_do_not_correlate_with_any_neighbour(draw, sidak):
    here = words(draw)
    drawn = range(here.shape[-1])
    neighbours = {
        "next event": (here[:, :-1], here[:, 1:]),
        "next photon": (here[:-1], here[1:]),
        "next batch": (here, words(draw, batch=1)),
        "next seed": (here, words(draw, seed=1)),
        "256 photons on": (here[:-256], here[256:]),
        "32 events on": (here[:, :-32], here[:, 32:]),
    }
    for name, (a, b) in neighbours.items():
        z = [correlation(a[..., i], b[..., j]) for i in drawn for j in drawn]
        assert np.abs(z).max() < sidak(16 * len(neighbours)), name
    z = [correlation(here[..., i], here[..., j]) for i in drawn for j in range(i)]
    assert np.abs(z).max() < sidak(6)
    # A weak generator is seen.
    photon, event = np.indices((PHOTONS, EVENTS), dtype=np.uint32)
    weak = (photon * np.uint32(rng.MULTIPLIER) + event) * np.uint32(rng.MULTIPLIER) + np.uint32(rng.INCREMENT)
    assert abs(correlation(weak[:, :-1], weak[:, 1:])) > sidak(96)


def test_pairs_of_successive_events_fill_the_square(draw):
    top = words(draw)[..., 0] >> np.uint32(27)
    counts = np.bincount((top[:, :-1] * 32 + top[:, 1:]).ravel(), minlength=1024)
    expected = counts.sum() / 1024
    assert 1e-3 < chi2.sf(np.sum((counts - expected) ** 2 / expected), 1023) < 1 - 1e-3


@pytest.mark.parametrize("seed", [0, 1, 2**40])
def test_every_input_bit_flips_every_output_bit_half_the_time(draw, seed, sidak):
    assert avalanche(draw, jnp.asarray(rng.batch_key(seed, 0)), sidak) < 1


def test_avalanche_test_sees_a_generator_without_its_last_shift(draw, sidak):
    def unfinished(key, photon, event):
        # x ^ (x >> 16) is its own inverse on 32 bits.
        return [w ^ (w >> 16) for w in draw(key, photon, event)]

    assert avalanche(unfinished, jnp.asarray(rng.batch_key(0, 0)), sidak) > 5


@pytest.mark.slow
def test_words_repeat_as_often_as_birthdays_say(draw):
    for drawn in np.moveaxis(words(draw, photons=2**14), -1, 0).reshape(-1, 2**14 * EVENTS):
        expected = drawn.size**2 / 2**33
        repeats = drawn.size - len(np.unique(drawn))
        # 128 repeats expected, Poisson; 4 standard deviations.
        assert abs(repeats - expected) < 4 * np.sqrt(expected)


def test_keys_of_seeds_and_batches_all_differ():
    assert len({rng.batch_key(seed, batch).tobytes() for seed in range(64) for batch in range(64)}) == 64**2


def test_uniform_is_inside_its_interval_and_fine_near_zero():
    u = np.asarray(rng.uniform(jnp.array([0, 1, 2, 2**31, 2**32 - 1], jnp.uint32)))
    assert u.dtype == np.float32
    np.testing.assert_allclose(u[:4], np.array([0.5, 1.5, 2.5, 2.0**31]) / 2**32, rtol=1e-6)
    assert u[4] < 1
    assert 22 < -np.log(u[0]) < 23


def test_exponential_is_the_logarithm_of_uniforms_from_end_to_end():
    ends = np.concatenate([np.arange(2**17), 2**32 - 1 - np.arange(2**17), 2 ** np.arange(32), 2 ** np.arange(32) - 1])
    drawn = np.concatenate([ends, np.random.default_rng(0).integers(0, 2**32, 10**6)]).astype(np.uint32)
    paths = np.asarray(jax.jit(rng.exponential)(drawn), np.float64)
    rounded = np.minimum((drawn | 1).astype(np.float32), np.float32(rng.LARGEST_WORD)).astype(np.float64)
    np.testing.assert_allclose(paths, -np.log(rounded / 2.0**32), rtol=4e-7)
    assert paths.min() > 0
    assert 22 < paths.max() < 23


@pytest.mark.parametrize("path", [rng.exponential, lambda w: -jnp.log(rng.uniform(w))])
def test_free_paths_are_exponential_to_their_end(draw, path):
    paths = np.asarray(path(jnp.asarray(words(draw, photons=2**16)[..., 1].ravel())), np.float64)
    for length in (0.1, 1.0, 5.0, 10.0, 12.0):
        expected = paths.size * np.exp(-length)
        assert abs(np.sum(paths > length) - expected) < 4 * np.sqrt(expected)
    assert paths.max() > 14  # of 4 million, the longest is 15.3 +- 1.3


def test_symmetric_is_uniform_in_minus_one_to_one_and_never_zero(draw):
    ends = np.asarray(rng.symmetric(jnp.array([0, 2**31 - 1, 2**31, 2**32 - 1], jnp.uint32)))
    np.testing.assert_allclose(ends, [2.0**-32, 1, -1, -(2.0**-32)], rtol=1e-6)
    assert np.all(np.abs(ends) <= 1)
    values = np.asarray(rng.symmetric(jnp.asarray(words(draw)[..., 0].ravel())), np.float64)
    assert abs(values.mean()) < 4 * np.sqrt(1 / 3 / values.size)
    assert abs(np.mean(values**2) - 1 / 3) < 4 * np.sqrt(4 / 45 / values.size)

"""Every phase function of the shelf: one value there is one line of SHELF here."""

from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import eval_legendre
from scipy.stats import chi2

from mcml_sim.media.phase import HenyeyGreenstein, Isotropic
from mcml_sim.tracing import rng
from tests.fixtures import refused

SHELF = [Isotropic(), *(HenyeyGreenstein(g) for g in (-0.9, -0.3, 0.0, 1e-9, 0.5, 0.9, 0.99))]
ENDS = np.array([-1 + 1e-7, -0.5, 0.0, 0.5, 1 - 1e-7])

every_phase = pytest.mark.parametrize("phase", SHELF, ids=str)


def integral(f, start=-1.0, end=1.0):
    """Over the directions whose cosines lie between [sr]; in parts, since a phase function may peak at either end."""
    parts = np.unique(np.clip([start, -0.9, 0.9, end], start, end))
    return 2 * np.pi * sum(quad(f, *part, epsabs=1e-11)[0] for part in pairwise(parts))


@every_phase
def test_moments_and_shares_are_those_of_the_density(phase):
    assert integral(phase.pdf) == pytest.approx(1, abs=1e-9)
    for order in range(7):
        expected = integral(lambda c, order=order: phase.pdf(c) * eval_legendre(order, c))
        assert phase.moment(order) == pytest.approx(expected, abs=1e-9)
    assert phase.mean_cosine == pytest.approx(integral(lambda c: c * phase.pdf(c)), abs=1e-9)
    for cosine in (-0.99, -0.5, 0.0, 0.7, 0.999):
        assert phase.invert(cosine) == pytest.approx(integral(phase.pdf, end=cosine), abs=1e-8)


@every_phase
def test_inversion_undoes_the_sample(phase):
    xi = np.linspace(0, 1, 1001)
    cosine = phase.sample(xi)
    np.testing.assert_allclose(phase.invert(cosine), xi, atol=1e-11)
    np.testing.assert_allclose(cosine[[0, -1]], [-1, 1], atol=1e-14)
    assert np.all(np.diff(cosine) > 0)


def cosines(phase, number=10**6):
    """What a kernel would draw in single precision."""
    words = np.random.default_rng(3).integers(0, 2**32, number).astype(np.uint32)
    draw = jax.jit(lambda phase, words: 1 - phase.deflection(rng.symmetric(words))[0])
    return np.asarray(draw(phase.for_kernel(), words), np.float64)


def excess(drawn, phase, bins=50):
    """chi-squared of the counts in bins of equal probability by the density."""
    edges = phase.sample(np.linspace(0, 1, bins + 1))
    shares = [integral(phase.pdf, *ends) for ends in pairwise(edges)]
    counts, _ = np.histogram(np.clip(drawn, -1, 1), edges)
    expected = drawn.size * np.array(shares)
    return np.sum((counts - expected) ** 2 / expected)


@every_phase
def test_cosines_are_distributed_as_the_density_says(phase):
    drawn = cosines(phase)
    assert np.all(np.abs(drawn) <= 1 + 1e-6)
    assert excess(drawn, phase) < chi2.isf(1e-3, 49)
    # <c^2> = (1 + 2 <P_2>) / 3.
    error = np.sqrt(((1 + 2 * phase.moment(2)) / 3 - phase.mean_cosine**2) / drawn.size)
    assert abs(drawn.mean() - phase.mean_cosine) < 4 * error + 1e-7


@pytest.mark.parametrize(
    ("drawn", "phase"),
    [(HenyeyGreenstein(0.905), HenyeyGreenstein(0.9)), (HenyeyGreenstein(0.005), Isotropic())],
    ids=str,
)
def test_the_distribution_test_sees_another_phase_function(drawn, phase):
    assert excess(cosines(drawn), phase) > chi2.isf(1e-3, 49)


@every_phase
def test_both_differences_from_one_are_precise_at_the_ends(phase):
    """Against the same number and the same v in double precision, in units of the small difference itself."""
    coarse, v = jax.tree.map(np.float32, phase), ENDS.astype(np.float32)
    exact = jax.tree.map(float, coarse).deflection(v.astype(float))
    for fast, slow in zip(coarse.deflection(v), exact, strict=True):
        assert fast.dtype == np.float32
        assert np.all(slow > 0)
        np.testing.assert_allclose(fast, slow, rtol=3e-5)
    np.testing.assert_allclose(exact[0] + exact[1], 2, rtol=1e-12)


@every_phase
def test_numbers_and_arrays_stay_what_they_are(phase):
    for method in (phase.pdf, phase.sample, phase.invert):
        assert isinstance(method(0.25), float)
        assert method(np.float32([0.25, 0.5])).dtype == np.float32
        assert isinstance(method(jnp.array([0.25, 0.5])), jax.Array)
        np.testing.assert_allclose(method(jnp.array([0.25, 0.5])), method(np.array([0.25, 0.5])), rtol=1e-4, atol=1e-7)
    assert all(isinstance(one, float) for one in (*phase.deflection(0.25), phase.moment(2), phase.mean_cosine))


@every_phase
def test_a_phase_function_is_a_value_that_jax_carries(phase):
    leaves, tree = jax.tree.flatten(phase)
    again = jax.tree.unflatten(tree, leaves)
    assert again == phase
    assert hash(again) == hash(phase)
    assert jax.jit(lambda phase: phase.moment(2))(phase) == pytest.approx(phase.moment(2), rel=1e-6)


def test_jax_differentiates_by_g_and_maps_over_it():
    slope = jax.grad(lambda phase: phase.moment(3))(HenyeyGreenstein(jnp.float32(0.5)))
    assert slope.g == pytest.approx(3 * 0.5**2)
    many = HenyeyGreenstein(jnp.array([0.1, 0.5]))
    np.testing.assert_allclose(jax.vmap(lambda phase: phase.mean_cosine)(many), [0.1, 0.5])


@pytest.mark.parametrize("g", [0.0, 1e-9, 0.3, 0.9, 0.99])
def test_backwards_is_forwards_seen_from_behind(g):
    forwards, backwards = HenyeyGreenstein(g), HenyeyGreenstein(-g)
    for one, other in zip(forwards.deflection(ENDS), backwards.deflection(-ENDS)[::-1], strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_allclose(backwards.pdf(-ENDS), forwards.pdf(ENDS), rtol=1e-10)
    np.testing.assert_allclose(backwards.invert(-ENDS), 1 - forwards.invert(ENDS), atol=1e-10)
    assert [backwards.moment(order) for order in range(3)] == [1, -g, g * g]


def test_without_g_it_is_isotropic():
    isotropic, limit = Isotropic(), HenyeyGreenstein(0.0)
    for one, other in zip(isotropic.deflection(ENDS), limit.deflection(ENDS), strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(isotropic.pdf(ENDS), limit.pdf(ENDS))
    np.testing.assert_allclose(isotropic.invert(ENDS), limit.invert(ENDS), atol=1e-15)
    assert [isotropic.moment(order) for order in range(4)] == [limit.moment(order) for order in range(4)]


@pytest.mark.parametrize("sign", [-1, 1])
def test_towards_the_limits_light_goes_straight_on_or_straight_back(sign):
    """1 - |g| = 1e-6: the cosine differs from +-1 by its square over that of a typical v, nowhere by its digits."""
    phase = HenyeyGreenstein(sign * (1 - 1e-6))
    off = phase.deflection(0.5 * ENDS)[0 if sign > 0 else 1]
    assert np.all((off > 0) & (off < 1e-11))
    assert phase.mean_cosine == pytest.approx(sign, abs=1e-5)
    assert [phase.moment(order) for order in (2, 3)] == pytest.approx([1, sign], abs=1e-5)
    assert phase.pdf(0.0) < 1e-6 < 1e10 < phase.pdf(float(sign))


@pytest.mark.parametrize(
    "g", [1, -1.0, 1.5, float("nan"), True, "0.5", None, [0.5], np.array([0.5, 1.0]), np.array([np.nan])], ids=str
)
def test_g_must_be_a_mean_cosine(g):
    refused(r"g must be a mean cosine in \(-1, 1\), got", HenyeyGreenstein, g)

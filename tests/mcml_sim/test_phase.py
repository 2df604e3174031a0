import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import chi2

from mcml_sim.media import phase
from mcml_sim.tracing import rng

every_g = pytest.mark.parametrize("g", [-0.9, -0.3, 0.0, 1e-9, 0.5, 0.9, 0.99])


def cosines(g, number=10**6):
    """What the kernel would draw in single precision."""
    words = np.random.default_rng(3).integers(0, 2**32, number).astype(np.uint32)
    sample = jax.jit(lambda w: 1 - phase.deflection(jnp.float32(g), rng.symmetric(w))[0])
    return np.asarray(sample(words), np.float64)


@every_g
def test_mean_cosine_is_g(g):
    drawn = cosines(g)
    assert np.all(np.abs(drawn) <= 1 + 1e-6)
    # The second moment of Henyey-Greenstein is (1 + 2 g^2) / 3.
    error = np.sqrt(((1 + 2 * g * g) / 3 - g * g) / drawn.size)
    assert abs(drawn.mean() - g) < 4 * error + 1e-7


@every_g
def test_density_integrates_to_one_and_to_its_mean(g):
    def integral(f):
        return sum(quad(f, *ends, epsabs=1e-11)[0] for ends in ((-1, -0.9), (-0.9, 0.9), (0.9, 1)))

    assert integral(lambda c: phase.pdf_henyey_greenstein(g, c)) == pytest.approx(1, abs=1e-9)
    assert integral(lambda c: c * phase.pdf_henyey_greenstein(g, c)) == pytest.approx(g, abs=1e-9)


@every_g
def test_cumulative_distribution_is_the_integral_of_the_density(g):
    for cosine in (-0.99, -0.5, 0.0, 0.7, 0.999):
        integral = quad(lambda c: phase.pdf_henyey_greenstein(g, c), -1, cosine, epsabs=1e-11, points=(-0.9, 0.9))[0]
        assert phase.invert_henyey_greenstein(g, cosine) == pytest.approx(integral, abs=1e-8)


@every_g
def test_inversion_undoes_the_sample(g):
    xi = np.linspace(0, 1, 1001)
    cosine = phase.sample_henyey_greenstein(g, xi)
    np.testing.assert_allclose(phase.invert_henyey_greenstein(g, cosine), xi, atol=1e-11)
    np.testing.assert_allclose(cosine[[0, -1]], [-1, 1], atol=1e-14)
    assert np.all(np.diff(cosine) > 0)


def excess(drawn, g, bins=50):
    """chi-squared of the counts in bins of equal probability."""
    edges = phase.sample_henyey_greenstein(g, np.linspace(0, 1, bins + 1))
    counts, _ = np.histogram(np.clip(drawn, -1, 1), edges)
    expected = drawn.size / bins
    return np.sum((counts - expected) ** 2 / expected)


@every_g
def test_cosines_are_distributed_as_the_density_says(g):
    assert excess(cosines(g), g) < chi2.isf(1e-3, 49)


def test_the_distribution_test_sees_a_g_that_is_off_by_half_a_percent():
    assert excess(cosines(0.905), 0.9) > chi2.isf(1e-3, 49)


def test_without_g_scattering_is_isotropic():
    assert phase.pdf_henyey_greenstein(0.0, np.array([-1.0, 0.3, 1.0])) == pytest.approx([0.5] * 3)
    np.testing.assert_allclose(phase.sample_henyey_greenstein(0.0, np.array([0.0, 0.25, 1.0])), [-1, -0.5, 1])


@every_g
def test_both_differences_from_one_are_precise_at_the_ends(g):
    v = np.array([-1 + 1e-7, -0.5, 0.0, 0.5, 1 - 1e-7])
    single = phase.deflection(np.float32(g), v.astype(np.float32))
    exact = phase.deflection(float(np.float32(g)), v.astype(np.float32).astype(float))
    for fast, slow in zip(single, exact, strict=True):
        assert fast.dtype == np.float32
        np.testing.assert_allclose(fast, slow, rtol=3e-5)
    np.testing.assert_allclose(exact[0] + exact[1], 2, rtol=1e-12)

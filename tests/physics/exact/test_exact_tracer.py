"""The exact half space against photons: integrals over rings, and their derivatives in albedo."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import chi2

from mcml_sim import Grid, Setting, exact, simulate_orders
from mcml_sim.exact.by_albedo import BLOCK

ALPHAS = np.array([0.3, 0.7, 0.9, 0.97])
CHANCE = 1e-3  # that a right answer fails one of the tests of one of the albedos
EDGES = np.concatenate([[0.0], np.geomspace(0.01, 20.0, 30)])


def energy(alpha, edges, setting=exact.SEARCHLIGHT):
    """Integral of 2 pi r R_d over each ring, (rings,) or for alpha of shape (alphas, 1) (alphas, rings)."""
    within = exact.cdf(edges, alpha, setting=setting) * exact.reflectance(alpha, setting)
    return within[..., 1:] - within[..., :-1]


def is_likely(run, setting, alphas, wrong=0.0):
    """Whether neither tail of chi-square is too unlikely at any albedo; `wrong` takes that share of the loss.

    Over rings that enough photons reached, which are independent but for 1/N of themselves.
    """
    p = []
    for alpha in alphas:
        found, expected = run.energy(alpha), energy(alpha + wrong * (1 - alpha), run.grid.r_edges, setting)
        z = ((found.value - expected) / found.standard_error)[found.is_sampled()]
        assert z.size > 10
        p.append(chi2.cdf(np.sum(z**2), z.size))
    return CHANCE / len(p) < min(p) and max(p) < 1 - CHANCE / len(p)


@pytest.mark.slow
def test_the_derivative_in_albedo_is_that_of_the_order_series(sidak):
    """sum over n of n alpha^(n-1) R_n, in standard errors, ring by ring."""
    run = simulate_orders(Grid.from_edges(r=EDGES), 2**20, seed=3)

    @jax.jit
    def with_slope(alphas):
        return jax.jvp(lambda a: energy(a, EDGES), (alphas,), (jnp.ones_like(alphas),))

    with jax.enable_x64(True):
        light, slope = (np.asarray(values) for values in with_slope(jnp.asarray(ALPHAS[:, None])))
    assert ALPHAS.size * EDGES.size > BLOCK  # more than one turn of the traced route
    np.testing.assert_allclose(light, energy(ALPHAS[:, None], EDGES), rtol=1e-9, atol=1e-13)
    found = run.profile_derivative(ALPHAS).scaled(run.grid.r_areas)
    sampled = found.is_sampled()
    z = ((found.value - slope) / found.standard_error)[sampled]
    assert z.size > 40
    assert np.abs(z).max() < sidak(z.size)
    # Negative control: the light itself is not its derivative.
    assert np.abs(((light - slope) / found.standard_error)[sampled]).max() > 20


@pytest.mark.slow
@pytest.mark.parametrize(("illumination", "other"), [("searchlight", "diffuse"), ("diffuse", "searchlight")])
def test_a_hundred_million_photons_agree_in_chi_square(illumination, other):
    """Over a hundred rings from 0.003 to 40 mfp; 0.1 % less loss, and the other illumination, are distinguished."""
    setting = Setting(illumination)
    edges = np.concatenate([[0.0], np.geomspace(0.003, 40.0, 100)])
    run = simulate_orders(Grid.from_edges(r=edges), 10**8, seed=6, setting=setting)
    alphas = np.array([0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.97])
    assert is_likely(run, setting, alphas)
    assert not is_likely(run, setting, alphas, wrong=1e-3)
    assert not is_likely(run, Setting(other), alphas)

"""The closed decay rate against the root that it stands for."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import exact
from profilefit.laws.escape import NEAR_WHITE, decay_rate

ALPHA = np.unique(np.concatenate([1 - np.linspace(0, 1, 201) ** 2, 1 - np.geomspace(1e-10, 1, 60)]))


def test_it_is_the_root_to_the_stated_error(x64):
    inner = ALPHA[ALPHA < 1]
    error = np.asarray(decay_rate(jnp.asarray(inner))) / exact.decay_rate(inner) - 1
    assert np.max(np.abs(error)) < 2.5e-5
    assert np.max(np.abs(error)) > 1e-6  # a looser statement than this would say nothing


def test_ends():
    assert decay_rate(jnp.float32(1.0)) == 0.0
    assert decay_rate(jnp.float32(0.0)) == 1.0


def test_near_white_it_is_the_diffusion_length(x64):
    """kappa^2 = 3 q (1 - 4 q / 5), q = 1 - alpha: the first two terms of the root's own series."""
    q = np.geomspace(1e-8, 1e-3, 6)
    kappa = np.asarray(decay_rate(jnp.asarray(1 - q)))
    np.testing.assert_allclose(kappa**2 / (3 * q), 1 - 0.8 * q, rtol=0, atol=1e-7)  # 1 - q has 1e-16 / q digits


def test_the_two_pieces_meet_and_it_falls_all_the_way(x64):
    edge = 1 - NEAR_WHITE
    below, above = np.asarray(decay_rate(jnp.array([np.nextafter(edge, 0), np.nextafter(edge, 1)])))
    assert below == pytest.approx(above, rel=4e-5)
    kappa = np.asarray(decay_rate(jnp.asarray(ALPHA)))
    assert np.all(np.diff(kappa[kappa < 1 - 1e-12]) < 0)


@pytest.mark.slow
def test_single_precision_and_derivative():
    single = np.asarray(decay_rate(jnp.asarray(ALPHA, jnp.float32)), float)
    given = np.asarray(jnp.asarray(ALPHA, jnp.float32), float)
    inside = given < 1
    np.testing.assert_allclose(single[inside], exact.decay_rate(given[inside]), rtol=4e-5)
    slopes = jax.vmap(jax.grad(decay_rate))(jnp.linspace(0.0, 0.999, 50))
    assert np.all(np.isfinite(slopes))

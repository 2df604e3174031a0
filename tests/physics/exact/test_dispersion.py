"""The dispersion function and its root, against the formulas as they stand."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import exact
from mcml_sim.exact.special_functions import LEAST_ALBEDO, SMALL_SQUARE, dispersion, squared_decay_rate

pytestmark = pytest.mark.usefixtures("x64")


def test_dispersion_is_its_formula():
    root = np.multiply.outer(np.geomspace(0.1, 1e8, 60), np.exp(1j * np.linspace(0.0, 0.8, 5)))
    found, plain = jax.jit(dispersion)(0.7, root**2), 1 - 0.7 * np.arctan(root) / root
    np.testing.assert_allclose(found, plain, rtol=1e-14)
    # On the imaginary axis, before the branch point.
    assert dispersion(jnp.float64(0.7), jnp.array(-0.25 + 0j)) == pytest.approx(
        1 - 0.7 * np.arctanh(0.5) / 0.5, rel=1e-14
    )


def test_small_arguments_keep_their_digits():
    square = np.array([1e-30, 1e-9, SMALL_SQUARE * (1 - 1e-9), SMALL_SQUARE * (1 + 1e-9)]) + 0j
    found = np.asarray(dispersion(jnp.float64(1.0), square)).real
    np.testing.assert_allclose(found[:2], square[:2].real / 3, rtol=1e-8)
    assert found[3] == pytest.approx(found[2], rel=1e-8)


@pytest.mark.parametrize("alpha", [0.1, 0.5, 0.7, 0.9, 0.97, 0.999])
def test_decay_rate_is_the_root(alpha):
    kappa = exact.decay_rate(alpha)
    # Where kappa is nearly 1, artanh makes 1e-16 of it e^{1 / alpha} times as large
    assert alpha * np.arctanh(kappa) / kappa == pytest.approx(1.0, rel=1e-12 if alpha > 0.1 else 1e-7)


def test_decay_rate_at_its_ends():
    assert exact.decay_rate(1.0) == 0.0
    assert exact.decay_rate(0.0) == exact.decay_rate(0.01) == 1.0  # 1 - kappa = 2 e^-200
    assert exact.decay_rate(0.1) == pytest.approx(1 - 2 * np.exp(-20), abs=1e-12)
    assert exact.decay_rate(1 - 1e-8) == pytest.approx(np.sqrt(3e-8), rel=1e-7)
    assert exact.decay_rate([0.5, 0.9]).shape == (2,)
    around = exact.decay_rate(LEAST_ALBEDO * np.array([1 - 1e-9, 1 + 1e-9]))
    assert around[0] == around[1]


def test_the_square_is_smooth_up_to_alpha_1():
    """Its slope is -3 there; kappa's is infinite."""
    slope = jax.vmap(jax.grad(squared_decay_rate))(jnp.array([0.0, 0.5, 1 - 1e-6, 1.0]))
    h = 1e-6
    middle = (exact.decay_rate(0.5 + h) ** 2 - exact.decay_rate(0.5 - h) ** 2) / (2 * h)
    np.testing.assert_allclose(slope, [0.0, middle, -3.0, -3.0], rtol=1e-5)

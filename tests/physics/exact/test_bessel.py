"""K0 and K1 of complex argument against scipy's, and their derivatives against each other."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import hankel1, kv

from mcml_sim.exact.special_functions import SERIES_RADIUS, bessel_k

ORDERS = pytest.mark.parametrize("order", [0, 1])


compiled = jax.jit(bessel_k, static_argnums=0)


pytestmark = pytest.mark.usefixtures("x64")


def wedge():
    """|arg z| <= pi/4, its edges included, from 1e-13 to where K is 1e-300, densest where the two forms meet."""
    moduli = np.concatenate([np.geomspace(1e-13, 600.0, 400), SERIES_RADIUS * np.linspace(0.9, 1.1, 41)])
    return np.multiply.outer(moduli, np.exp(1j * np.linspace(-0.25, 0.25, 21) * np.pi))


@ORDERS
def test_both_forms_are_scipys(order):
    z = wedge()
    np.testing.assert_allclose(compiled(order, z), kv(order, z), rtol=1e-13)


@ORDERS
def test_the_hankel_function_of_the_contour(order):
    """H_v^(1)(z) = (2 / (pi i)) e^{-i pi v / 2} K_v(-i z), for z between 45 and 135 degrees."""
    z = 1j * wedge()
    factor = -2j / np.pi if order == 0 else -2 / np.pi
    np.testing.assert_allclose(factor * compiled(order, -1j * z), hankel1(order, z), rtol=1e-13)


def test_all_decays_in_the_end():
    assert np.all(compiled(0, jnp.array([800.0 + 800j, 1e9 + 1e3j, 1e300 + 0j])) == 0)


@ORDERS
def test_derivatives_are_central_differences(order):
    z, step = np.array([0.3 + 0.2j, 2.9 - 1.0j, 20.0 + 20.0j]), 1e-4
    slope = jax.jit(jax.vmap(jax.grad(lambda z: bessel_k(order, z), holomorphic=True)))
    far, near = (kv(order, z + h) - kv(order, z - h) for h in (2 * step, step))
    np.testing.assert_allclose(slope(z), (8 * near - far) / (12 * step), rtol=1e-8)

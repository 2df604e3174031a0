"""Special functions: complex ones by numpy, K0 and K1 by scipy, the dispersion function by its formula."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import hankel1, kv

from mcml_sim import exact
from mcml_sim.exact import special_functions as special
from tests.physics.exact.test_exact_derivatives import difference

ORDERS = pytest.mark.parametrize("order", [0, 1])
compiled = jax.jit(special.bessel_k, static_argnums=0)
pytestmark = pytest.mark.usefixtures("x64")


def rays(first, last, moduli=(1e-30, 1e-12, 1e-3, 0.3, 0.99, 1.5, 30.0, 1e11)):
    """Numbers at nine angles between two [degrees]."""
    return np.multiply.outer(moduli, np.exp(1j * np.radians(np.linspace(first, last, 9))))


def test_square_root_and_logarithm():
    z = rays(-179.0, 180.0)
    np.testing.assert_allclose(special.square_root(z), np.sqrt(z), rtol=1e-15)
    assert special.square_root(np.array(-4.0 + 0j)) == 2j
    slope = jax.grad(special.square_root, holomorphic=True)(-3.0 + 4.0j)
    assert slope == pytest.approx(0.5 / (1 + 2j), rel=1e-15)
    z = rays(-170.0, 170.0)
    np.testing.assert_allclose(special.logarithm(z), np.log(z), rtol=1e-13)  # ln |z| is small where |z| is nearly 1
    assert jax.grad(special.logarithm, holomorphic=True)(3.0 - 4.0j) == pytest.approx(1 / (3 - 4j), rel=1e-15)


def test_arctangent_and_hyperbolic_functions():
    z = rays(-80.0, 80.0)
    np.testing.assert_allclose(special.arctangent(z), np.arctan(z), rtol=1e-14)
    below = np.array([0.0, 0.3j, 0.81j])  # on the imaginary axis, before the branch point at i
    np.testing.assert_allclose(special.arctangent(below), np.arctan(below), rtol=1e-14)
    z = np.concatenate([rays(0.0, 80.0), [[0.3j] * 4 + [0.9j] * 5]])
    np.testing.assert_allclose(special.inverse_sinh(z, np.sqrt(1 + z * z)), np.arcsinh(z), rtol=2e-15)
    z = rays(0.0, 90.0, (1e-30, 1e-12, 1e-3, 0.3, 0.99, 1.5, 20.0))
    sinh, cosh = special.sinh_and_cosh(z)
    np.testing.assert_allclose(sinh, np.sinh(z), rtol=1e-14)
    np.testing.assert_allclose(cosh, np.cosh(z), rtol=1e-14)


@ORDERS
def test_both_forms_are_scipys(order):
    """And H_v^(1)(z) = (2 / (pi i)) e^{-i pi v / 2} K_v(-i z), for z between 45 and 135 degrees."""
    # |arg z| <= pi/4, its edges included, from 1e-13 to where K is 1e-300, densest where the two forms meet.
    moduli = np.concatenate([np.geomspace(1e-13, 600.0, 400), special.SERIES_RADIUS * np.linspace(0.9, 1.1, 41)])
    z = np.multiply.outer(moduli, np.exp(1j * np.linspace(-0.25, 0.25, 21) * np.pi))
    np.testing.assert_allclose(compiled(order, z), kv(order, z), rtol=1e-13)
    assert np.all(compiled(0, jnp.array([800.0 + 800j, 1e9 + 1e3j, 1e300 + 0j])) == 0), "all decays in the end"
    z = 1j * z
    factor = -2j / np.pi if order == 0 else -2 / np.pi
    np.testing.assert_allclose(factor * compiled(order, -1j * z), hankel1(order, z), rtol=1e-13)


@ORDERS
def test_derivatives_are_central_differences(order):
    z = np.array([0.3 + 0.2j, 2.9 - 1.0j, 20.0 + 20.0j])
    slope = jax.jit(jax.vmap(jax.grad(lambda z: special.bessel_k(order, z), holomorphic=True)))
    np.testing.assert_allclose(slope(z), difference(lambda z: kv(order, z), z, 1e-4), rtol=1e-8)


def test_dispersion_is_its_formula_and_keeps_the_digits_of_small_arguments():
    root = np.multiply.outer(np.geomspace(0.1, 1e8, 60), np.exp(1j * np.linspace(0.0, 0.8, 5)))
    found, plain = jax.jit(special.dispersion)(0.7, root**2), 1 - 0.7 * np.arctan(root) / root
    np.testing.assert_allclose(found, plain, rtol=1e-14)
    # On the imaginary axis, before the branch point.
    below = special.dispersion(jnp.float64(0.7), jnp.array(-0.25 + 0j))
    assert below == pytest.approx(1 - 0.7 * np.arctanh(0.5) / 0.5, rel=1e-14)
    square = np.array([1e-30, 1e-9, special.SMALL_SQUARE * (1 - 1e-9), special.SMALL_SQUARE * (1 + 1e-9)]) + 0j
    found = np.asarray(special.dispersion(jnp.float64(1.0), square)).real
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
    around = exact.decay_rate(special.LEAST_ALBEDO * np.array([1 - 1e-9, 1 + 1e-9]))
    assert around[0] == around[1]
    # Its square is smooth up to alpha = 1: the slope is -3 there; kappa's is infinite.
    slope = jax.vmap(jax.grad(special.squared_decay_rate))(jnp.array([0.0, 0.5, 1 - 1e-6, 1.0]))
    h = 1e-6
    middle = (exact.decay_rate(0.5 + h) ** 2 - exact.decay_rate(0.5 - h) ** 2) / (2 * h)
    np.testing.assert_allclose(slope, [0.0, middle, -3.0, -3.0], rtol=1e-5)

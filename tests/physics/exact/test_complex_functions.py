"""Complex functions against numpy's, all the way to numbers that only keep their digits if nothing is added to them."""

import jax
import numpy as np
import pytest

from mcml_sim.exact.special_functions import arctangent, inverse_sinh, logarithm, sinh_and_cosh, square_root

pytestmark = pytest.mark.usefixtures("x64")


def rays(first, last, moduli=(1e-30, 1e-12, 1e-3, 0.3, 0.99, 1.5, 30.0, 1e11)):
    """Numbers at nine angles between two [degrees]."""
    return np.multiply.outer(moduli, np.exp(1j * np.radians(np.linspace(first, last, 9))))


def test_square_root():
    z = rays(-179.0, 180.0)
    np.testing.assert_allclose(square_root(z), np.sqrt(z), rtol=1e-15)
    assert square_root(np.array(-4.0 + 0j)) == 2j
    slope = jax.grad(square_root, holomorphic=True)(-3.0 + 4.0j)
    assert slope == pytest.approx(0.5 / (1 + 2j), rel=1e-15)


def test_logarithm():
    z = rays(-170.0, 170.0)
    np.testing.assert_allclose(logarithm(z), np.log(z), rtol=1e-13)  # ln |z| is small where |z| is nearly 1
    assert jax.grad(logarithm, holomorphic=True)(3.0 - 4.0j) == pytest.approx(1 / (3 - 4j), rel=1e-15)


def test_arctangent():
    z = rays(-80.0, 80.0)
    np.testing.assert_allclose(arctangent(z), np.arctan(z), rtol=1e-14)
    below = np.array([0.0, 0.3j, 0.81j])  # on the imaginary axis, before the branch point at i
    np.testing.assert_allclose(arctangent(below), np.arctan(below), rtol=1e-14)


def test_inverse_sinh():
    z = np.concatenate([rays(0.0, 80.0), [[0.3j] * 4 + [0.9j] * 5]])
    np.testing.assert_allclose(inverse_sinh(z, np.sqrt(1 + z * z)), np.arcsinh(z), rtol=2e-15)


def test_sinh_and_cosh():
    z = rays(0.0, 90.0, (1e-30, 1e-12, 1e-3, 0.3, 0.99, 1.5, 20.0))
    sinh, cosh = sinh_and_cosh(z)
    np.testing.assert_allclose(sinh, np.sinh(z), rtol=1e-14)
    np.testing.assert_allclose(cosh, np.cosh(z), rtol=1e-14)

"""The rational map between alpha and A: exact ends, closed both ways."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import Grid, Setting, exact, simulate_orders
from profilefit.laws.rational import Rational
from tests.physics.laws import surface


@pytest.mark.parametrize("constants", [(0.45058, 2.35857, 1.36799), (0.5, 2.0, 1.0), (-0.2, 0.3, 0.1)])
def test_ends_are_exact_whatever_the_constants(constants):
    law = Rational(Setting(), *constants)
    assert law.reflectance(0.0) == 0.0
    assert law.reflectance(1.0) == 1.0
    assert law.alpha(0.0) == pytest.approx(0.0, abs=1e-15)
    assert law.alpha(1.0) == 1.0


def test_by_hand(normalisation):
    """s = 1/2 at alpha = 3/4: 0.5 * (1 + 0.22529) / (1 + 1.179285 + 0.3419975) = 0.612645 / 2.5212825."""
    assert normalisation.reflectance(0.75) == pytest.approx(0.612645 / 2.5212825, rel=1e-14)


def test_the_inverse_goes_back(normalisation):
    reflectance = np.linspace(0.0, 1.0, 401)
    alpha = normalisation.alpha(reflectance)
    # alpha rounds at 1e-16, and dA/dalpha = 2.9 / (2 s) is 2e3 at the last step before A = 1.
    np.testing.assert_allclose(normalisation.reflectance(alpha), reflectance, rtol=0, atol=3e-13)
    assert np.all(np.diff(alpha) > 0)
    # alpha near 1 and the loss there: 1 - alpha keeps its digits through s.
    s = np.geomspace(1e-5, 0.5, 20)
    back = np.sqrt(1 - normalisation.alpha(normalisation.reflectance(1 - s**2)))
    np.testing.assert_allclose(back, s, rtol=1e-4)  # 1 - alpha = 1e-10 has six digits in float64


def test_with_these_constants_it_is_the_exact_map(normalisation):
    """3.0e-6 at best for this form; five digits a constant cost a tenth of that."""
    alpha = 1 - np.linspace(0, 1, 201) ** 2
    assert np.max(np.abs(normalisation.reflectance(alpha) - exact.reflectance(alpha))) < 3.4e-6
    assert np.max(np.abs(normalisation.reflectance(alpha) - exact.reflectance(alpha, Setting("diffuse")))) > 0.05


def test_types(normalisation):
    assert type(normalisation.reflectance(0.5)) is float
    assert type(normalisation.alpha(0.5)) is float
    assert normalisation.alpha([0.1, 0.2]).dtype == np.float64
    single = jax.jit(normalisation.alpha)(jnp.float32(0.5))
    assert single.dtype == jnp.float32
    assert float(single) == pytest.approx(normalisation.alpha(0.5), rel=1e-6)
    slopes = jax.vmap(jax.grad(normalisation.reflectance))(jnp.linspace(0.0, 0.99, 12))
    assert np.all(np.isfinite(slopes) & (np.asarray(slopes) > 0))


ALPHA = np.array([0.2, 0.5, 0.8, 0.95, 0.99])


def test_the_twin_is_the_exact_half_space_where_nothing_refracts():
    for setting in (Setting(), Setting("diffuse")):
        twin = [surface.reflectance(alpha, setting) for alpha in ALPHA]
        np.testing.assert_allclose(twin, exact.reflectance(ALPHA, setting=setting), rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("setting", [Setting(n=1.4), Setting("diffuse", n=1.4)], ids=str)
def test_photons_leave_specular_light_out(setting):
    light = simulate_orders(Grid.from_edges(r=[0.0, 1000.0]), 2**19, seed=4, setting=setting, progress=False)
    found = light.reflectance(ALPHA)
    twin = np.array([surface.reflectance(alpha, setting) for alpha in ALPHA])
    z = (np.asarray(found.value) - twin) / np.asarray(found.standard_error)
    assert np.max(np.abs(z)) < 3.6  # five albedos of the same photons, at 0.3 % if they were independent
    with_specular = (np.asarray(found.value) + 1 - light.entered - twin) / np.asarray(found.standard_error)
    assert np.min(with_specular) > 20

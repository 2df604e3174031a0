"""Chiang, Kutz and Burley's exponential of a cubic."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import Setting
from profilefit.fitting.quality import albedo_quality
from profilefit.laws import published
from profilefit.laws.printed_maps import Chiang

LAW = Chiang(Setting("diffuse"), **published.constants("chiang_albedo"))


# Exact A under diffuse light, to six digits (mcml_sim.exact), at these albedos.
ALPHA = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99])
EXACT = np.array(
    [0.021698, 0.046265, 0.074451, 0.107335, 0.146544, 0.194716, 0.256557, 0.341867, 0.478024, 0.596669, 0.794564]
)


def test_by_hand():
    """At A = 0.5: -2.54703 + 0.65297 - 0.53975625 = -2.43381625."""
    assert LAW.alpha(0.5) == pytest.approx(1 - math.exp(-2.43381625), rel=1e-13)


def test_its_error():
    """0.007 in alpha under diffuse light, and 0.005 in A at these albedos; nothing maps beyond 0.9989."""
    assert np.max(np.abs(LAW.alpha(EXACT) - ALPHA)) == pytest.approx(0.0069, abs=2e-4)
    assert np.max(np.abs(LAW.reflectance(ALPHA) - EXACT)) == pytest.approx(0.0047, abs=1e-4)
    assert LAW.alpha(1.0) == pytest.approx(1 - math.exp(-6.80023), rel=1e-12)


@pytest.mark.slow
def test_its_error_everywhere():
    quality = albedo_quality(LAW)
    assert quality.delta_alpha == pytest.approx(0.00695, abs=1e-5)
    assert quality.delta_A == pytest.approx(0.0737, abs=1e-4)
    assert quality.monotone


def test_the_inverse_goes_back():
    reflectance = np.linspace(0, 1, 801)
    # alpha rounds at 1e-16, and dA/dalpha is 70 at A = 1.
    np.testing.assert_allclose(LAW.reflectance(LAW.alpha(reflectance)), reflectance, rtol=0, atol=2e-14)
    np.testing.assert_allclose(LAW.reflectance([0.9995, 1.0]), 1.0, rtol=1e-15)


def test_the_inverse_is_steadily_found_for_other_constants():
    """A fit moves the constants: a straight line, and a cubic whose slope changes threefold."""
    even = np.linspace(0, 1, 101)
    for constants in ((-3.0, 0.0, 0.0), (-3.0, 2.0, -1.0)):
        law = Chiang(Setting("diffuse"), *constants)
        np.testing.assert_allclose(law.reflectance(law.alpha(even)), even, rtol=0, atol=1e-13)


def test_types_and_slopes():
    assert type(LAW.reflectance(0.5)) is float
    single = jax.jit(LAW.reflectance)(jnp.float32(0.7))
    assert single.dtype == jnp.float32
    assert float(single) == pytest.approx(LAW.reflectance(0.7), rel=1e-5)
    with jax.enable_x64(True):
        slopes = jax.jit(jax.vmap(jax.grad(LAW.reflectance)))(jnp.array([0.0, 0.3, 0.99]))
        back = jax.jit(jax.vmap(jax.grad(LAW.alpha)))(jnp.asarray(LAW.reflectance([0.0, 0.3, 0.99])))
    np.testing.assert_allclose(slopes * back, 1.0, rtol=1e-10)

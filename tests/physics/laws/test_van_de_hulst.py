"""Kulla and Conty's inversion of van de Hulst."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import Setting
from profilefit.fitting.quality import albedo_quality
from profilefit.laws import published
from profilefit.laws.printed_maps import VanDeHulst

LAW = VanDeHulst(Setting("diffuse"), **published.constants("van_de_hulst_albedo"))


# Exact A under diffuse light, to six digits (mcml_sim.exact), at these albedos.
ALPHA = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99])
EXACT = np.array(
    [0.021698, 0.046265, 0.074451, 0.107335, 0.146544, 0.194716, 0.256557, 0.341867, 0.478024, 0.596669, 0.794564]
)


def test_by_hand():
    """At A = 0.5: s = 6.201435 - sqrt(9.59217 + 20.8404 + 4.42815)."""
    s = 6.201435 - math.sqrt(34.86072)
    assert LAW.alpha(0.5) == pytest.approx(1 - s**2, rel=1e-13)


def test_the_error_it_is_known_for():
    """0.0021 in A under diffuse light, near A = 0.18."""
    error = np.abs(LAW.reflectance(ALPHA) - EXACT)
    assert 0.0019 < error.max() < 0.0021
    assert ALPHA[error.argmax()] in (0.5, 0.6)


@pytest.mark.slow
def test_the_error_everywhere():
    quality = albedo_quality(LAW)
    assert quality.delta_A == pytest.approx(0.00206, abs=2e-5)
    assert quality.monotone
    assert albedo_quality(VanDeHulst(Setting(), **LAW.constants())).delta_A > 0.06  # not meant for a searchlight


def test_the_inverse_goes_back():
    """The printed digits put s = 0 at A = 0.99998 and s < 1 at A = 0: there the way back is cut, or has two ends."""
    reflectance = np.linspace(0.001, 0.999, 400)
    np.testing.assert_allclose(LAW.reflectance(LAW.alpha(reflectance)), reflectance, rtol=0, atol=1e-11)
    assert LAW.reflectance(0.0) == 0.0
    assert LAW.reflectance(1.0) == pytest.approx(1.0, abs=2e-5)
    assert LAW.alpha([0.0, 1.0]) == pytest.approx([0.0, 1.0], abs=6e-6)


def test_types():
    assert type(LAW.alpha(0.5)) is float
    single = jax.jit(LAW.reflectance)(jnp.float32(0.7))
    assert single.dtype == jnp.float32
    assert float(single) == pytest.approx(LAW.reflectance(0.7), rel=1e-5)

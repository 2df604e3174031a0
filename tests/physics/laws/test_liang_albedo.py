"""Equation (8) and where it folds."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import Setting
from profilefit.laws.printed_maps import LiangAlbedo

PRINTED = LiangAlbedo(Setting(), 5.67, 3.84, 0.84)


def test_by_hand():
    """5.67 * 0.5 / (0.25 + 1.92 + 0.84) = 2.835 / 3.01."""
    assert PRINTED.alpha(0.5) == pytest.approx(2.835 / 3.01, rel=1e-15)


def test_ends():
    assert PRINTED.alpha(0.0) == 0.0
    assert PRINTED.reflectance(0.0) == 0.0
    assert PRINTED.alpha(1.0) == pytest.approx(5.67 / 5.68, rel=1e-15)
    assert round(PRINTED.alpha(1.0), 5) == 0.99824


def test_the_inverse_is_the_rising_branch():
    reflectance = np.linspace(0.0, 0.9, 91)
    np.testing.assert_allclose(PRINTED.reflectance(PRINTED.alpha(reflectance)), reflectance, rtol=1e-11, atol=1e-15)


def test_it_folds_at_the_root_of_w():
    assert PRINTED.fold == pytest.approx(0.9165, abs=5e-5)
    near = PRINTED.alpha(PRINTED.fold + np.array([-1e-3, 0.0, 1e-3]))
    assert near[1] > max(near[0], near[2])
    assert near[1] == pytest.approx(0.99947, abs=5e-6)
    # 0.84 / 1 on the one side and 1 on the other: two reflectances, one albedo.
    assert PRINTED.alpha(0.84) == pytest.approx(PRINTED.alpha(1.0), rel=1e-15)


def test_above_its_peak_there_is_no_reflectance():
    assert np.isnan(PRINTED.reflectance(0.9995))
    assert np.isnan(PRINTED.reflectance(1.0))
    assert not np.isnan(PRINTED.reflectance(0.9994))


def test_types():
    assert type(PRINTED.alpha(0.5)) is float
    assert PRINTED.alpha([[0.5]]).shape == (1, 1)
    single = jax.jit(PRINTED.reflectance)(jnp.float32(0.7))
    assert single.dtype == jnp.float32
    assert float(single) == pytest.approx(PRINTED.reflectance(0.7), rel=1e-5)
    slopes = jax.vmap(jax.grad(PRINTED.alpha))(jnp.linspace(0.0, 0.9, 10))
    assert np.all(np.asarray(slopes) > 0)

"""The forms have the limits that they claim, and the fits find what was put in."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import profilefit
from benchmarks import forms
from benchmarks.survival import FORMS, HAZARD

pytestmark = pytest.mark.slow

NEAR, FAR = 1.2, 0.6


@pytest.fixture(autouse=True)
def _double():
    with jax.enable_x64(True):
        yield


@pytest.mark.parametrize("form", FORMS, ids=lambda form: form.name)
def test_both_limits_are_built_in(form):
    shapes = jnp.exp(jnp.array(form.start))
    ends = jnp.array([1e-9, 1e3, 2e3])
    left, density = form.curve(ends[:1], shapes, NEAR, FAR)
    np.testing.assert_allclose(left, 1.0, atol=1e-7)
    np.testing.assert_allclose(density, NEAR, rtol=1e-3)
    depth = form.cumulative(ends[:2] / 5, shapes, NEAR, FAR)
    np.testing.assert_allclose(jnp.diff(depth) / jnp.diff(ends[:2] / 5), FAR, rtol=0.1)


def test_hazard_form_is_the_law():
    law = profilefit.load("hazard")
    x, alpha = jnp.geomspace(1e-3, 20.0, 40), jnp.array([[0.3], [0.9]])

    @jax.jit
    def both(shape):
        shapes = (shape.h, shape.a, shape.b, shape.c)
        return (
            HAZARD.curve(x, shapes, shape.source, shape.kappa),
            law.scaled_cdf(x, alpha),
            law.scaled_density(x, alpha),
        )

    (left, density), cdf, expected = both(jax.jit(law.shape)(alpha))
    np.testing.assert_allclose(1 - left, cdf, atol=1e-9)
    np.testing.assert_allclose(density, expected, rtol=1e-6)


def made_truth(law, constants):
    """A truth made by the hazard law's form itself."""
    near, far = jnp.linspace(0.7, 2.5, 4)[:, None], jnp.full((4, 1), 0.4)
    x = jnp.tile(jnp.geomspace(0.01, 6.0, 40), (4, 1))
    blank = forms.Truth(near, near, near, far, x, x, x, x > 0)
    shapes = law.shapes(jnp.asarray(constants), [jnp.asarray(basis) for basis in law.bases(blank)])
    left, density = HAZARD.curve(x, shapes, near, far)
    return forms.Truth(*(np.asarray(part) for part in blank._replace(left=left, density=density)))


def test_free_fit_and_coefficient_laws_find_what_was_put_in():
    small, law = (forms.CoefficientLaw("lambda_0", degrees) for degrees in ((0, 1, 0, 0), (1, 1, 0, 0)))
    put_in = np.array([0.5, -0.2, 0.6, 0.1, 0.2, 0.7])
    truth = made_truth(law, put_in)
    free, errors = forms.fit_free(HAZARD, truth, 3)
    assert errors.worst < 1e-5
    less, constants = forms.fit_laws([small, law], free, truth, 2)
    np.testing.assert_allclose(constants, put_in, rtol=1e-5)
    assert forms.judge_law(law, constants, truth).ks < 1e-9 < 1e-4 < forms.judge_law(small, less, truth).ks
    assert (small.constants, law.constants) == (5, 6)


def test_a_coefficient_law_starts_from_those_before_it():
    """Their shapes are polynomials of a larger law, too, so that it cannot end worse."""
    small, large = (forms.CoefficientLaw("lambda_0", (0, 1, 0, 0), with_kappa=kappa) for kappa in ("", "h"))
    constants = np.array([0.5, 0.6, 0.1, 0.2, 0.7])
    truth = made_truth(small, constants)
    start = large.start(forms.law_shapes(small, constants, truth)[..., 0], large.bases(truth))
    np.testing.assert_allclose(forms.law_shapes(large, start, truth), forms.law_shapes(small, constants, truth))
    np.testing.assert_allclose(start[2:], constants[1:])

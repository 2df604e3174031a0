"""Functions counted by hand."""

from collections import Counter

import jax
import jax.numpy as jnp
import pytest

import profilefit
from profilefit.laws.burley import BurleySampler
from profilefit.studies.tradeoff.contenders import with_samplers
from profilefit.studies.tradeoff.counting import count, described


def test_counts_what_the_answer_needs_once_for_each_point_or_material():
    def function(x, alpha):
        jnp.tanh(x)  # not needed
        nodes = jnp.log(jnp.arange(1.0, 4.0)) + alpha
        return jnp.where(x > 0, jnp.exp(jnp.sqrt(alpha) * x), 0.0) + jnp.sum(jnp.cos(x[:, None] * nodes), axis=1)

    found = count(function)
    assert found.point == Counter(exp=1, cos=3)
    assert found.material == Counter(sqrt=1, log=3)
    assert found.transcendental == 4


def test_counts_each_step_of_a_loop():
    found = count(lambda x, alpha: jax.lax.fori_loop(0, 5, lambda _, y: jnp.sqrt(jnp.log(y + alpha)), x))
    assert (found.point, found.transcendental) == (Counter(log=5, sqrt=5), 5)
    with pytest.raises(ValueError, match="no loop of unknown length"):
        count(lambda x, _: jax.lax.while_loop(lambda y: y.sum() > 1, lambda y: y / 2, x))


def test_normalized_diffusion_takes_two_exponentials_or_one():
    law = profilefit.load("burley", "published")
    assert count(law.scaled_profile).point == Counter(exp=2)
    assert count(BurleySampler(law).scaled_sample).point == Counter(cbrt=1, log=1, sqrt=1)
    exact, xie = with_samplers("normalized diffusion", law)
    assert count(exact.profile).point == Counter(exp=1)
    assert count(exact.sample).point == Counter(exp=1, log=2, sqrt=1)
    assert count(xie.sample).point == Counter(log=1)


def test_hazard_takes_what_its_docstring_says():
    one, two = with_samplers("hazard", profilefit.load("hazard"))
    assert count(one.profile).point == Counter(exp=1, log=1)
    assert count(one.sample).point == Counter(log=3)
    assert count(two.sample).point == Counter(log=5)


def test_described():
    assert described(Counter(log=2, exp=1)) == "exp, 2 log"
    assert described(Counter()) == "–"

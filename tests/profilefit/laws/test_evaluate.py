"""Numbers in, float64 numpy out; jax in, jax out."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from profilefit.laws.evaluate import evaluated


class Doubler:
    @evaluated
    def twice(self, x, y=0.0):
        """Twice x, and y."""
        return 2.0 * x + y


class Halver(Doubler):
    """A law whose own constant is a jax array: something is being traced or fitted."""

    def __init__(self, constant):
        self.constant = constant


jax.tree_util.register_pytree_node(Halver, lambda h: ((h.constant,), None), lambda _, leaves: Halver(*leaves))


@pytest.mark.parametrize("x", [3, 3.0, np.float32(3.0), np.array(3)])
def test_numbers_give_a_float(x):
    assert type(Doubler().twice(x)) is float
    assert Doubler().twice(x) == 6.0


@pytest.mark.parametrize("x", [[1, 2], (1.0, 2.0), np.array([1, 2]), np.array([1, 2], np.float32)])
def test_lists_and_arrays_give_float64(x):
    out = Doubler().twice(x, y=np.array([[1.0], [2.0]]))
    assert isinstance(out, np.ndarray)
    assert not isinstance(out, jax.Array)
    assert out.dtype == np.float64
    assert out.shape == (2, 2)


def test_double_precision_survives():
    assert Doubler().twice(0.1) == 0.2
    assert not jax.config.jax_enable_x64


@pytest.mark.parametrize("where", ["argument", "keyword", "constant"])
def test_jax_anywhere_stays_jax(where):
    one = jnp.float32(1.0)
    out = {
        "argument": lambda: Doubler().twice(one),
        "keyword": lambda: Doubler().twice(1.0, y=one),
        "constant": lambda: Halver(one).twice(jnp.float32(1.0)),
    }[where]()
    assert isinstance(out, jax.Array)
    assert out.dtype == jnp.float32


def test_a_method_keeps_its_name_and_words():
    assert Doubler.twice.__name__ == "twice"
    assert Doubler.twice.__doc__ == "Twice x, and y."

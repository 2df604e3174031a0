"""Numbers in, float64 numpy out; jax in, jax out."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import InputError
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


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ({"r": 0.5, "alpha": 1.5}, r"alpha must be in \[0, 1\], got 1.5"),
        ({"r": 0.5, "alpha": np.nan}, r"alpha must be in \[0, 1\], got nan"),
        ({"r": [0.5, -1.0], "alpha": 0.5}, "r must be >= 0, got -1"),
        ({"r": 0.5, "alpha": 0.5, "mfp": 0.0}, r"mfp must be > 0, from 1e-100 to 1e\+100, got 0"),
        ({"r": "far", "alpha": 0.5}, "r must be a number or an array of numbers, got 'far'"),
        ({"r": "0.5", "alpha": 0.5}, "r must be a number or an array of numbers, got '0.5'"),
        ({"r": np.array([1j]), "alpha": 0.5}, r"r must be a number or an array of numbers, got array\(\[0.\+1.j\]\)"),
        ({"r": 10**400, "alpha": 0.5}, r"r must be a number or an array of numbers, got 1000000"),
        ({"r": [[1.0], [1.0, 2.0]], "alpha": 0.5}, r"r must be a number or an array of numbers, got \[\[1.0\], "),
        (
            {"r": np.array([0.5, None]), "alpha": 0.5},
            r"r must be a number .*, got array\(.* dtype=object\)",
        ),
        ({"r": np.ma.masked_greater([0.5, 9.0], 1.0), "alpha": 0.5}, "r must be .*, got an array with masked values"),
    ],
)
def test_numbers_out_of_range_are_named(burley, words, said):
    with pytest.raises(InputError, match=said):
        burley.profile(**words)
    with pytest.raises(InputError, match=said):
        burley.profile(*words.values())


def test_what_is_not_masked_is_an_array_like_any_other(burley):
    whole = np.ma.masked_greater([0.5, 0.7], 1.0)
    np.testing.assert_array_equal(burley.profile(whole, 0.5), burley.profile([0.5, 0.7], 0.5))


def test_samplers_and_maps_name_theirs(burley, liang_printed):
    with pytest.raises(InputError, match=r"xi must be in \[0, 1\], got 2"):
        burley.sampler.sample(2.0, 0.5)
    with pytest.raises(
        InputError, match=r"xi must be .*, got an array with masked values: fill them or leave them out"
    ):
        burley.sampler.sample(np.ma.masked_less([0.1, 0.5], 0.3), 0.5)
    with pytest.raises(InputError, match=r"reflectance must be in \[0, 1\], got 1.2"):
        burley.albedo.alpha(1.2)
    with pytest.raises(InputError, match=r"alpha must be in \[0, 1\], got -0.1"):
        liang_printed.largest_radius(-0.1)

"""Numbers in, float64 numpy out; jax in, jax out."""

import subprocess
import sys
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import InputError
from mcml_sim.runs.input_runs import Compiling
from profilefit.laws.evaluate import BLOCKS, evaluated


class Doubler(eqx.Module):
    @evaluated
    def twice(self, x, y=0.0):
        """Twice x, and y."""
        return 2.0 * x + y


class Halver(Doubler):
    """A law with a constant of its own; a jax array where it is being traced or fitted."""

    constant: float


def test_numbers_give_a_float_and_arrays_float64():
    for x in (3, 3.0, np.float32(3.0), np.array(3)):
        assert type(Doubler().twice(x)) is float
        assert Doubler().twice(x) == 6.0
    for x in ([1, 2], (1.0, 2.0), np.array([1, 2]), np.array([1, 2], np.float32)):
        out = Doubler().twice(x, y=np.array([[1.0], [2.0]]))
        assert type(out) is np.ndarray
        assert (out.dtype, out.shape) == (np.float64, (2, 2))
    assert Doubler().twice(0.1) == 0.2
    assert not jax.config.jax_enable_x64
    assert (Doubler.twice.__name__, Doubler.twice.__doc__) == ("twice", "Twice x, and y.")


def test_constants_may_be_many(burley):
    """As the draws of a posterior are: a row a draw."""
    draws = replace(burley, s0=np.array([[1.8], [1.9]]))
    expected = [replace(burley, s0=s0).profile([0.1, 1.0, 3.0], 0.9) for s0 in (1.8, 1.9)]
    np.testing.assert_allclose(draws.profile([0.1, 1.0, 3.0], 0.9), expected, rtol=1e-12)


def test_jax_anywhere_stays_jax():
    one = jnp.float32(1.0)
    for out in (Doubler().twice(one), Doubler().twice(1.0, y=one), Halver(one).twice(jnp.float32(1.0))):
        assert isinstance(out, jax.Array)
        assert out.dtype == jnp.float32


def jitted(method, *arguments):
    """The method of a law compiled for its arguments as they are: the twin of what goes by blocks."""
    with jax.enable_x64(True):
        return np.asarray(jax.jit(method)(*map(jnp.asarray, arguments)))


@pytest.mark.slow
@pytest.mark.parametrize("size", [0, 1, 63, 64, 65, 1024, 1025, 2 * BLOCKS[-1] + 1])
def test_every_length_is_that_of_one_call(burley, size):
    """To rounding: a vector's last numbers may be worked out by other instructions."""
    r, alpha = np.geomspace(1e-3, 30.0, size), np.linspace(0.1, 1.0, size)
    for albedos in (alpha, 0.9):
        found = burley.profile(r, albedos)
        assert found.shape == (size,)
        np.testing.assert_allclose(found, jitted(burley.profile, r, albedos), rtol=1e-14)


def test_a_grid_keeps_its_shape(burley):
    r, alpha, mfp = np.geomspace(1e-3, 30.0, 40), np.linspace(0.1, 1.0, 9)[:, None], np.full((2, 1, 1), 1.5)
    found = burley.profile(r, alpha, mfp)
    assert found.shape == (2, 9, 40)
    np.testing.assert_array_equal(found[0], found[1])
    for row, a in zip(found[0], alpha[:, 0], strict=True):
        np.testing.assert_allclose(row, burley.profile(r, a, 1.5), rtol=1e-14)
    assert burley.profile(1.0, [0.5]).shape == (1,)


def test_no_length_and_no_constant_compiles_anew(burley):
    """Once for each size of block; jax's own listener counts."""
    for size in BLOCKS:
        burley.profile(np.ones(size), 0.9)
        burley.sampler.sample(np.full(size, 0.5), 0.9)
    with Compiling() as again:
        for size in range(1, 2000, 7):
            law = replace(burley, s0=1.0 + size)
            law.profile(np.ones(size), 0.5)
            law.sampler.sample(np.full(size, 0.5), 1.0 / size)
    assert again.seconds == 0.0


GROWTH = """
import mmap
import numpy as np, profilefit
from pathlib import Path

law = profilefit.load("hazard")
pages = lambda: int(Path("/proc/self/statm").read_text().split()[1])
law.profile(1.0, 0.9), law.sampler.sample(0.5, 0.9)
before = pages()
for size in range(1, 1001):
    law.profile(np.full(size, 1.0), 0.9), law.sampler.sample(np.full(size, 0.5), 0.9)
print((pages() - before) * mmap.PAGESIZE)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_a_thousand_lengths_take_no_memory():
    """They took 35 MB each."""
    done = subprocess.run([sys.executable, "-c", GROWTH], capture_output=True, text=True, check=True)
    assert int(done.stdout) < 200e6


A_NUMBER = "r must be a number or an array of numbers, got"
OUT_OF_RANGE = [
    ({"r": [1.0, 2.0, 3.0], "alpha": [0.5, 0.6]}, r"arguments must broadcast to one, got r \(3,\), alpha \(2,\)"),
    ({"r": 0.5, "alpha": 1.5}, r"alpha must be in \[0, 1\], got 1.5"),
    ({"r": 0.5, "alpha": np.nan}, r"alpha must be in \[0, 1\], got nan"),
    ({"r": 0.5, "alpha": 0.5, "mfp": 0.0}, r"mfp must be > 0, from 1e-100 to 1e\+100, got 0"),
    *(
        ({"r": given, "alpha": 0.5}, said)
        for given, said in (
            ([0.5, -1.0], "r must be >= 0, got -1"),
            ("far", f"{A_NUMBER} 'far'"),
            ("0.5", f"{A_NUMBER} '0.5'"),
            (np.array([1j]), rf"{A_NUMBER} array\(\[0.\+1.j\]\)"),
            (10**400, f"{A_NUMBER} one of 401 digits"),
            ([[1.0], [1.0, 2.0]], rf"{A_NUMBER} \[\[1.0\], "),
            (np.array([0.5, None]), r"r must be a number .*, got array\(.* dtype=object\)"),
            (np.ma.masked_greater([0.5, 9.0], 1.0), "r must be .*, got an array with masked values"),
        )
    ),
]


@pytest.mark.parametrize(("words", "said"), OUT_OF_RANGE, ids=[said[-40:] for _, said in OUT_OF_RANGE])
def test_numbers_out_of_range_are_named(burley, words, said):
    with pytest.raises(InputError, match=said):
        burley.profile(**words)
    with pytest.raises(InputError, match=said):
        burley.profile(*words.values())


def test_samplers_and_maps_name_theirs(burley, liang_printed):
    whole, masked = np.ma.masked_greater([0.5, 0.7], 1.0), np.ma.masked_less([0.1, 0.5], 0.3)
    np.testing.assert_array_equal(burley.profile(whole, 0.5), burley.profile([0.5, 0.7], 0.5))
    for evaluate, given, said in (
        (burley.sampler.sample, (2.0, 0.5), r"xi must be in \[0, 1\], got 2"),
        (
            burley.sampler.sample,
            (masked, 0.5),
            "xi must be .*, got an array with masked values: fill them or leave them",
        ),
        (burley.albedo.alpha, (1.2,), r"reflectance must be in \[0, 1\], got 1.2"),
        (liang_printed.largest_radius, (-0.1,), r"alpha must be in \[0, 1\], got -0.1"),
    ):
        with pytest.raises(InputError, match=said):
            evaluate(*given)

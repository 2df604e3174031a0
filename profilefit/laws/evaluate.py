"""Laws are written once over jax.numpy, and evaluated in float64 numpy outside of jit, traced inside."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from functools import lru_cache, wraps
from itertools import repeat
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from mcml_sim.errors import InputError
from mcml_sim.exact.by_albedo import blocks
from mcml_sim.exact.compiled import jit
from mcml_sim.media.arrays import Floats, checked_numbers, require_one_shape, require_own_process

# Numbers at a time: a length compiles nothing new, and at most three quarters of a block are filling.
BLOCKS = (64, 256, 1024, 4096, 16384)
# Compiled methods that are kept, those of other settings and laws go: a program takes a megabyte and thirty memory maps
# of the 65 thousand that Linux gives a process.
PROGRAMS = 256

# What an argument of this name may be, wherever it occurs. A mean free path beyond these, in whatever unit, has no
# square in float64; jax arrays of single precision need it within 1e-12 and 1e12, which cannot be checked for them.
SHARE, ANY_LENGTH, POSITIVE = (0.0, 1.0), (0.0, np.inf), (1e-100, 1e100)
RANGES = {"alpha": SHARE, "reflectance": SHARE, "xi": SHARE, "r": ANY_LENGTH, "thickness": ANY_LENGTH, "mfp": POSITIVE}
ACCEPTED = {SHARE: "in [0, 1]", ANY_LENGTH: ">= 0", POSITIVE: "> 0, from 1e-100 to 1e+100"}


def evaluated(method: Callable) -> Callable:
    """Let a method of a law take numbers, lists or numpy arrays and answer in float64: a float for scalars.

    Arguments that are jax arrays (concrete or traced) keep their type, so that a law can be jitted, vmapped and
    differentiated in whatever precision its caller chose. Numbers out of range, and shapes that do not broadcast, raise
    InputError; None for what may be left out leaves it out. The method is compiled for blocks of a few sizes, whatever
    the lengths and the law's constants. Constants may be arrays, too, which broadcast with the arguments.
    """
    signature = inspect.signature(method)
    spare = {name for name, parameter in signature.parameters.items() if parameter.default is None}

    @wraps(method)
    def call(law, *arguments, **named):
        leaves, form = jax.tree.flatten(law)
        if any(isinstance(value, jax.Array) for value in (*leaves, *arguments, *named.values())):
            return method(law, *arguments, **named)
        given = list(signature.bind(law, *arguments, **named).arguments.items())[1:]
        checked = {name: _checked(name, value) for name, value in given if not (value is None and name in spare)}
        if any(np.ndim(leaf) for leaf in leaves):  # many laws at once, as a posterior's draws
            with jax.enable_x64(True):
                return np.asarray(method(law, **{name: jnp.asarray(value) for name, value in checked.items()}))
        out = _in_blocks(_program(method, form, tuple(checked)), [np.asarray(leaf, float) for leaf in leaves], checked)
        return float(out) if out.ndim == 0 else out

    return call


@lru_cache(maxsize=PROGRAMS)
def _program(method: Callable, form: Any, names: tuple[str, ...]) -> Callable:
    """Return the method of a law of this class and setting, compiled: its constants are arguments like any other."""

    def run(leaves: list[jax.Array], *values: jax.Array) -> jax.Array:
        out = method(jax.tree.unflatten(form, leaves), **dict(zip(names, values, strict=True)))
        return jnp.broadcast_to(out, values[0].shape)

    return jit(run)


def _in_blocks(program: Callable, leaves: list[Floats], arguments: dict[str, Floats]) -> Floats:
    """Return the program on arguments broadcast to one shape: a block at a time, but single numbers as they are."""
    arrays = list(arguments.values())
    require_one_shape(**arguments)
    shape = np.broadcast_shapes(*(one.shape for one in arrays))
    count = math.prod(shape)
    size = next((one for one in BLOCKS if count <= one), BLOCKS[-1])
    pieces = [
        repeat(one.reshape(())) if one.size == 1 and at else blocks(np.broadcast_to(one, shape).ravel(), size)
        for at, one in enumerate(arrays)
    ]
    with jax.enable_x64(True):
        parts = [program(leaves, *piece) for piece in zip(*pieces, strict=False)]  # all, before the first is waited for
    return np.concatenate([np.empty(0), *parts])[:count].reshape(shape)


def _checked(name: str, value: Any) -> np.ndarray:
    require_own_process()
    numbers = checked_numbers(name, value, "a number or an array of numbers")
    low, high = span = RANGES.get(name, (-np.inf, np.inf))
    outside = ~((numbers >= low) & (numbers <= high))
    if name in RANGES and np.any(outside):
        raise InputError(f"{name} must be {ACCEPTED[span]}, got {numbers[outside].flat[0]:g}")
    return numbers

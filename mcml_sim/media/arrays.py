"""Arguments: arrays of numpy and jax, which of the two computes with them, and the checks that everything shares."""

from __future__ import annotations

import math
import operator
import os
import sys
from pathlib import Path
from types import ModuleType
from typing import Any, TypeGuard

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from mcml_sim.errors import ForkError, InputError

Floats = NDArray[np.float64]
MAX_PHOTONS = 10**13  # weeks on the largest machines; more is a slip of the pen
MAX_WORKERS = 4096
LONGEST_SHOWN = 60  # characters of a value in a message


def namespace(*values: Any) -> ModuleType:
    """Return jax.numpy if any of the values is a jax array, else numpy."""
    return jnp if any(isinstance(value, jax.Array) for value in values) else np


def scalar_or_array(values: Any) -> Any:
    """Return a result as jax gave it, or else a float for scalars and a numpy array."""
    if isinstance(values, jax.Array):
        return values
    return float(values) if np.ndim(values) == 0 else np.asarray(values)


def shown(value: object) -> str:
    """Return a value for a message: one line, shortened. A whole number can have as many digits as a file."""
    try:
        text = repr(value)
    except ValueError:  # Python spells no whole number beyond 4300 digits
        return "one of more than 4300 digits"
    if isinstance(value, int) and len(text) > LONGEST_SHOWN:
        return f"one of {len(text)} digits"
    text = " ".join(text.split())  # an array's has lines
    return text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]}..."


def is_number(value: object) -> TypeGuard[float]:
    """Return True for a real number, infinite ones included; not for nan, True, or what is beyond floating point."""
    if isinstance(value, int):
        return not isinstance(value, bool) and abs(value) <= sys.float_info.max
    return isinstance(value, (float, np.integer, np.floating)) and not math.isnan(value)


def require(holds: object, name: str, accepted: str, value: object) -> None:
    """Raise InputError unless that holds of an argument: `NAME must be ACCEPTED, got VALUE`."""
    if not holds:
        raise InputError(f"{name} must be {accepted}, got {shown(value)}")


def as_number(text: str) -> float:
    """Return the number that a text says, NaN where it says none."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def require_index(name: str, value: object) -> None:
    """Raise InputError unless that is a refractive index."""
    require(is_number(value) and math.isfinite(value) and value > 0, name, "a refractive index > 0", value)


def checked_numbers(name: str, value: object, accepted: str) -> Floats:
    """Return real numbers as float64, of any shape; `accepted` says what they are.

    InputError on text, complex numbers, other objects, ragged lists and what is masked: none is silently made a number.
    """
    if np.ma.is_masked(value):
        raise InputError(f"{name} must be {accepted}, got an array with masked values: fill them or leave them out")
    try:
        numbers = np.asarray(value)
        if numbers.dtype.kind in "biuf" or numbers.size == 0:
            return np.asarray(numbers, np.float64)
    except (TypeError, ValueError):
        pass
    raise InputError(f"{name} must be {accepted}, got {shown(value)}")


def checked_range(name: str, value: object, accepted: str, low: float, high: float = math.inf) -> Floats:
    """Return numbers as `checked_numbers` does; InputError on the first that is not within bounds, both included."""
    numbers = checked_numbers(name, value, accepted)
    if np.any(outside := ~((numbers >= low) & (numbers <= high))):
        raise InputError(f"{name} must be {accepted}, got {float(numbers[outside].flat[0])}")
    return numbers


def checked_finite(name: str, value: object, accepted: str = "finite") -> Floats:
    """Return numbers as `checked_numbers` does; InputError on the first that is not finite."""
    return checked_range(name, value, accepted, -sys.float_info.max, sys.float_info.max)


def require_all(name: str, values: NDArray[np.floating], good: NDArray[np.bool_], accepted: str) -> None:
    """Raise InputError where values are not good, with the first of those."""
    if not np.all(good):
        raise InputError(f"{name} must be {accepted}, got {values[~good].flat[0]:g}")


def require_one_shape(**arrays: Any) -> None:
    """Raise InputError unless the arguments broadcast to one shape."""
    try:
        np.broadcast_shapes(*(np.shape(array) for array in arrays.values()))
    except ValueError:
        got = ", ".join(f"{name} {np.shape(array)}" for name, array in arrays.items())
        raise InputError(f"the shapes of the arguments must broadcast to one, got {got}") from None


_worked_in: int | None = None  # the process whose JAX has worked


def require_own_process() -> None:
    """Raise ForkError in a fork of a process that had called this, since the threads of JAX were not forked.

    A process that was forked before may go on, as may one that was spawned.
    """
    global _worked_in
    if _worked_in is None:
        _worked_in = os.getpid()
    elif _worked_in != os.getpid():
        raise ForkError(
            "this process was forked after JAX had worked in its parent, and would wait for threads that were not "
            "forked: start it by multiprocessing.get_context('spawn')"
        )


def checked_whole(name: str, number: object, lowest: int, highest: int | None = None) -> int:
    """Return a whole number, 1e6 included; InputError on anything else."""
    accepted = f"a whole number >= {lowest}" + (f" and <= {highest:g}" if highest else "")
    try:
        whole = int(number) if isinstance(number, float) and number.is_integer() else operator.index(number)  # type: ignore[arg-type]
    except TypeError:
        whole = lowest - 1
    is_inside = lowest <= whole and (highest is None or whole <= highest)
    require(is_inside and not isinstance(number, bool), name, accepted, number)
    return whole


def checked_workers(workers: int | None, scheduler: str | None = None) -> int | None:
    """Return a number of threads, or None for one per core; a scheduler has workers of its own."""
    accepted = "None where a scheduler is given, whose workers they are"
    require(workers is None or scheduler is None, "workers", accepted, workers)
    return None if workers is None else checked_whole("workers", workers, lowest=1, highest=MAX_WORKERS)


def checked_folder(store: str | os.PathLike[str] | None) -> Path | None:
    """Return the folder of a store, or None."""
    require(store is None or isinstance(store, (str, os.PathLike)), "store", "the path of a folder", store)
    return None if store is None else Path(store)

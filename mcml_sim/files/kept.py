"""Arrays that take seconds to make, in the user's cache folder, where the next process finds them.

A file that is damaged is named in a warning and made anew; where none can be written, there is none.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import warnings
from collections.abc import Callable, Collection
from pathlib import Path

import numpy as np
import platformdirs
from numpy.typing import NDArray

from mcml_sim.errors import Notice, OutputError
from mcml_sim.files.npz import read_npz
from mcml_sim.files.whole_file import read_whole, write_whole

Arrays = dict[str, NDArray[np.float64]]
MOST_BYTES = 1 << 26  # of a file that is read


def kept(name: str, arrays: Collection[str], make: Callable[[], Arrays]) -> Arrays:
    """Return the arrays of that name from the cache, else from `make`. The file's name says all that they depend on."""
    path = file_of(name)
    if path.is_file():
        try:
            return _read(read_whole(path, MOST_BYTES), arrays)
        except ValueError as error:
            warnings.warn(f"{path} is damaged ({error}) and made anew", Notice, stacklevel=2)
    new = make()
    with contextlib.suppress(OutputError, OSError):  # no folder to write into
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, _content(new))
    return new


def file_of(name: str) -> Path:
    """Return the path of the file that keeps arrays of that name."""
    return platformdirs.user_cache_path("mcml_sim") / f"{name}.npz"


def _read(content: bytes, names: Collection[str]) -> Arrays:
    """Return the wanted arrays of a file; ValueError where its content is not that of `_content`."""
    arrays = read_npz(content, MOST_BYTES, text=("sha256",))
    if not {"sha256", *names} <= arrays.keys():
        raise ValueError("an array is missing")
    chosen = {name: arrays[name] for name in names}
    if str(arrays["sha256"]) != _digest(chosen):
        raise ValueError("its numbers are not those that were written")
    return chosen


def _content(arrays: Arrays) -> bytes:
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, sha256=_digest(arrays), **arrays)
    return file.getvalue()


def _digest(arrays: Arrays) -> str:
    return hashlib.sha256(b"".join(np.ascontiguousarray(part).tobytes() for part in arrays.values())).hexdigest()

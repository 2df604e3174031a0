"""Tables by refractive index: in memory, and in the user's cache folder, where the next process finds them.

A table takes seconds to make and is a megabyte. A file of another version, or of another number of nodes, has another
name. One that is damaged is named in a warning and made anew; where none can be written, there is none.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import warnings
from dataclasses import astuple
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import platformdirs

from mcml_sim.errors import Notice, OutputError
from mcml_sim.exact.table import Complexes, Table, made, shapes
from mcml_sim.exact.transform import Rule
from mcml_sim.files.npz import read_npz
from mcml_sim.files.whole_file import read_whole, write_whole

LEAST = 1.0 + 1e-9  # n of the least surface that refracts
VERSION = 2  # of what `table.made` puts into a table
MOST_BYTES = 1 << 26  # of a file that is read


@lru_cache(maxsize=16)
def table(n: float, rule: Rule, slope: bool = False) -> Table:
    """Of the half space of index n > 1, or its derivative by n."""
    path = file_of(n, rule, slope)
    if path.is_file():
        try:
            return _table(read_whole(path, MOST_BYTES))
        except ValueError as error:
            warnings.warn(f"{path} is damaged ({error}) and made anew", Notice, stacklevel=2)
    new = made(n, rule, slope)
    with contextlib.suppress(OutputError, OSError):  # no folder to write into
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, _content(new))
    return new


def file_of(n: float, rule: Rule, slope: bool = False) -> Path:
    """Where the table of n is kept."""
    nodes, kind = "-".join(map(str, astuple(rule)[3:])), "-slope" if slope else ""
    return platformdirs.user_cache_path("mcml_sim") / f"half-space-n{n!r}-{nodes}{kind}-v{VERSION}.npz"


@partial(jax.custom_jvp, nondiff_argnums=(1,))
def traced_table(n: jax.Array, rule: Rule) -> Table:
    """Of an n that may be traced and is differentiable, n >= 1; nan below. At n = 1 it is that of LEAST."""
    return _called(n, rule, False)


@traced_table.defjvp
def _traced_table_jvp(rule: Rule, primals: tuple, tangents: tuple) -> tuple[Table, Table]:
    slopes = _called(primals[0], rule, True)
    return traced_table(primals[0], rule), jax.tree.map(lambda slope: slope * tangents[0], slopes)


def _called(n: jax.Array, rule: Rule, slope: bool) -> Table:
    def found(n: Any) -> Table:
        whole = table(max(float(n), LEAST), rule, slope)
        return whole if n >= 1 else jax.tree.map(lambda part: np.full_like(part, np.nan), whole)

    if isinstance(n, jax.core.Tracer):
        return jax.pure_callback(found, shapes(rule), n, vmap_method="sequential")
    return jax.tree.map(jnp.asarray, found(n))


def _table(content: bytes) -> Table:
    """ValueError where the content is not `_content`."""
    arrays = read_npz(content, MOST_BYTES, text=("sha256",))
    if not {"sha256", *Table._fields} <= arrays.keys():
        raise ValueError("an array is missing")
    found = Table(*(arrays[name].view(complex)[..., 0] for name in Table._fields))
    if str(arrays["sha256"]) != _digest(found):
        raise ValueError("its numbers are not those that were written")
    return found


def _content(table: Table) -> bytes:
    file = io.BytesIO()
    parts = {name: part[..., None].view(float) for name, part in zip(Table._fields, map(_whole, table), strict=True)}
    np.savez(file, allow_pickle=False, sha256=_digest(table), **parts)
    return file.getvalue()


def _digest(table: Table) -> str:
    return hashlib.sha256(b"".join(_whole(part).tobytes() for part in table)).hexdigest()


def _whole(part: Complexes) -> Complexes:
    return np.ascontiguousarray(part, dtype=complex)

"""Tables by refractive index: in memory, and in the user's cache folder, where the next process finds them.

A table takes seconds to make and is a megabyte. A file of another version, or of another number of nodes, has another
name.
"""

from __future__ import annotations

from dataclasses import astuple
from functools import lru_cache, partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from mcml_sim.exact.table import Complexes, Table, made, shapes
from mcml_sim.exact.transform import Rule
from mcml_sim.files.kept import kept
from mcml_sim.media.arrays import Floats

LEAST = 1.0 + 1e-9  # n of the least surface that refracts
VERSION = 2  # of what `table.made` puts into a table


@lru_cache(maxsize=16)
def table(n: float, rule: Rule, slope: bool = False) -> Table:
    """Return the table of the half space of index n > 1, or its derivative by n."""
    nodes, kind = "-".join(map(str, astuple(rule)[3:])), "-slope" if slope else ""
    found = kept(
        f"half-space-n{n!r}-{nodes}{kind}-v{VERSION}",
        Table._fields,
        lambda: {name: _reals(part) for name, part in made(n, rule, slope)._asdict().items()},
    )
    return Table(*(found[name].view(complex)[..., 0] for name in Table._fields))


@partial(jax.custom_jvp, nondiff_argnums=(1,))
def traced_table(n: jax.Array, rule: Rule) -> Table:
    """Return the table of an n that may be traced, n >= 1; nan below. At n = 1 it is that of LEAST."""
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


def _reals(part: Complexes) -> Floats:
    """Return real and imaginary parts along one more axis."""
    return np.ascontiguousarray(part, dtype=complex)[..., None].view(float)

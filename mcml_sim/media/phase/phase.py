"""Signature of a phase function, the one of this shelf."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import fields
from functools import partial
from typing import Any, Self

import jax
import jax.numpy as jnp


class Phase(ABC):
    """Distribution of the cosine c of the angle of scattering, -1 ... 1; the azimuth is uniform.

    A frozen dataclass, and a pytree whose leaves are its fields: jax carries it into a kernel, differentiates by it
    and maps over it. The fields, and every argument, are numbers, numpy arrays or jax arrays, which broadcast, and
    keep their precision. A kernel needs `deflection` alone.
    """

    def __init_subclass__(cls) -> None:
        """Register every phase function as a pytree."""
        super().__init_subclass__()
        jax.tree_util.register_pytree_node(cls, _leaves, partial(_from_leaves, cls))

    @classmethod
    def of(cls, **leaves: Any) -> Self:
        """Return a phase function of these fields, unchecked: arrays that a kernel needs in place of numbers."""
        names = (field.name for field in fields(cls))  # type: ignore[arg-type]
        return _from_leaves(cls, None, [leaves[name] for name in names])

    @abstractmethod
    def pdf(self, cosine: Any) -> Any:
        """Return the density p(c) of the direction [1/sr]: over all directions its integral, 2 pi int p dc, is 1."""

    @abstractmethod
    def invert(self, cosine: Any) -> Any:
        """Return the `xi` in [0, 1] whose sample is `cosine`: the cumulative distribution [-]."""

    @abstractmethod
    def deflection(self, v: Any) -> tuple[Any, Any]:
        """Return 1 - c and 1 + c [-] for the sample of xi = (1 + v) / 2, v in [-1, 1], accurate at both ends."""

    @abstractmethod
    def moment(self, l: int) -> Any:  # noqa: E741 - the field's letter
        """Return the Legendre moment [-] of the order l >= 0: 2 pi int p(c) P_l(c) dc. That of order 0 is 1."""

    @property
    def simplest(self) -> Phase:
        """Equal phase function without what it does not need: a mixture without empty terms."""
        return self

    def for_kernel(self) -> Phase:
        """Return the phase function as a kernel draws from it: float32."""
        return jax.tree.map(jnp.float32, self)

    def sample(self, xi: Any) -> Any:
        """Return the cosine [-] below which lies the share `xi` in [0, 1] of all scatterings."""
        below_one, _ = self.deflection(2 * xi - 1)
        return 1 - below_one

    @property
    def mean_cosine(self) -> Any:
        """Mean of the cosine [-], also called anisotropy g: the moment of order 1."""
        return self.moment(1)


def _leaves(phase: Phase) -> tuple[tuple[Any, ...], None]:
    return tuple(getattr(phase, field.name) for field in fields(phase)), None  # type: ignore[arg-type]


def _from_leaves(cls: Any, _: None, leaves: Sequence[Any]) -> Any:
    """Return a phase function of these leaves, unchecked: jax puts in place of numbers whatever it needs."""
    phase = object.__new__(cls)
    for field, leaf in zip(fields(cls), leaves, strict=True):
        object.__setattr__(phase, field.name, leaf)
    return phase

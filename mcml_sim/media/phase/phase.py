"""Base class of phase functions; Henyey and Greenstein's, and isotropic scattering."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import partial
from typing import Any, Self

import jax
import jax.numpy as jnp
import numpy as np

from mcml_sim.media.arrays import is_number, namespace, require


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


@dataclass(frozen=True)
class HenyeyGreenstein(Phase):
    """Density (1 - g^2) / (4 pi (1 + g^2 - 2 g c)^(3/2)) [1/sr] (Henyey & Greenstein, Astrophys. J. 93, 70, 1941).

    g  mean cosine of the scattering angle [-], -1 < g < 1; InputError beyond, but not of a jax array, which nobody can
       look into while jax compiles

    All forms here are free of the usual division by g and of its cancellation: g = 0 is no special case, and 1 - c and
    1 + c keep their relative precision near c = 1 and -1.
    """

    g: Any

    def __post_init__(self) -> None:
        is_real = is_number(self.g) or isinstance(self.g, np.ndarray)
        is_cosine = isinstance(self.g, jax.Array) or (is_real and np.all(np.abs(self.g) < 1))
        require(is_cosine, "g", "a mean cosine in (-1, 1)", self.g)

    def pdf(self, cosine: Any) -> Any:
        xp = namespace(self.g, cosine)
        square = self._square(cosine)
        return (1 - self.g * self.g) / (2 * square * xp.sqrt(square)) / (2 * np.pi)

    def invert(self, cosine: Any) -> Any:
        xp, g = namespace(self.g, cosine), self.g
        distance = xp.sqrt(self._square(cosine))
        return 0.5 + 0.5 * (2 * cosine - 3 * g + g * g * g) / (distance * (1 - g * g + distance))

    def deflection(self, v: Any) -> tuple[Any, Any]:
        """Return 1 - c and 1 + c [-] for the sample of xi = (1 + v) / 2; both >= 0, and g -> -g, v -> -v swaps them."""
        g = self.g
        reciprocal = 1 / (1 + g * v)
        half_square = 0.5 * reciprocal * reciprocal
        below_one = (1 - g) * (1 - g) * half_square * ((1 - v) * (2 + g * (1 + v)))
        above_minus_one = (1 + g) * (1 + g) * half_square * ((1 + v) * (2 - g * (1 - v)))
        return below_one, above_minus_one

    def moment(self, l: int) -> Any:  # noqa: E741 - the field's letter
        return self.g**l

    def _square(self, cosine: Any) -> Any:
        """Return 1 + g^2 - 2 g c, without cancellation at c = 1."""
        g = self.g
        return (1 - g) * (1 - g) + 2 * g * (1 - cosine)


@dataclass(frozen=True)
class Isotropic(Phase):
    """Uniform density in all directions: p(c) = 1 / (4 pi) [1/sr].

    Henyey and Greenstein's phase function of g = 0, to the last bit of `deflection`: the cosine is v itself, which is
    what the kernels of the matched half space draw.
    """

    def pdf(self, cosine: Any) -> Any:
        return 0.0 * cosine + 1 / (4 * np.pi)

    def invert(self, cosine: Any) -> Any:
        return 0.5 * (1 + cosine)

    def deflection(self, v: Any) -> tuple[Any, Any]:
        """Return 1 - v and 1 + v [-]."""
        return 1 - v, 1 + v

    def moment(self, l: int) -> Any:  # noqa: E741 - the field's letter
        return 1.0 * (l == 0)

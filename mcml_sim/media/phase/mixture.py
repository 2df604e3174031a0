"""Sums of phase functions: a few terms can follow what one cannot."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np

from mcml_sim.errors import InputError
from mcml_sim.media.arrays import is_number, namespace, require
from mcml_sim.media.phase.phase import Phase

MOST_TERMS = 64
ROUNDING = 1e-9  # by which weights that a reader typed may miss 1
HALVINGS = 60  # of [-1, 1], until float64 has no number between


@dataclass(frozen=True)
class Mixture(Phase):
    """Sum p(c) = sum over i of w_i p_i(c) [1/sr]: a share w_i of all scatterings turns the light as p_i does.

    weights  w_i >= 0, which sum to 1
    phases   p_i, as many

    A term is drawn by the share of `xi` that is its own, stretched to the whole: one number a scattering, and that of a
    term of weight 1 to the last bit. So `deflection`, which the tracer calls, does not rise with its argument; `sample`
    does, and is slower.
    """

    weights: tuple[Any, ...]
    phases: tuple[Phase, ...]

    def __post_init__(self) -> None:
        for name in ("weights", "phases"):
            value = getattr(self, name)
            require(isinstance(value, (Sequence, np.ndarray)) and not isinstance(value, str), name, "a list", value)
            object.__setattr__(self, name, tuple(value))
        if not 1 <= len(self.weights) == len(self.phases) <= MOST_TERMS:
            raise InputError(
                f"a mixture must have 1 to {MOST_TERMS} phases and a weight for each, "
                f"got {len(self.weights)} weights and {len(self.phases)} phases"
            )
        for phase in self.phases:
            require(isinstance(phase, Phase), "phases", "phase functions", phase)
        for weight in self.weights:
            require(is_number(weight) and 0 <= weight <= 1, "weights", "shares in [0, 1]", weight)
        if abs(math.fsum(self.weights) - 1) > ROUNDING:
            raise InputError(f"weights must sum to 1, got {math.fsum(self.weights):.12g}")

    def pdf(self, cosine: Any) -> Any:
        return self._mean([phase.pdf(cosine) for phase in self.phases])

    def invert(self, cosine: Any) -> Any:
        return self._mean([phase.invert(cosine) for phase in self.phases])

    def sample(self, xi: Any) -> Any:
        """Return the cosine [-] below which lies the share `xi` in [0, 1] of all scatterings, by bisection."""
        xp = namespace(xi, *self.weights)
        low = 0.0 * xi - 1.0
        high = -low
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            is_below = self.invert(middle) < xi
            low, high = xp.where(is_below, middle, low), xp.where(is_below, high, middle)
        return 0.5 * (low + high)

    def deflection(self, v: Any) -> tuple[Any, Any]:
        """Return 1 - c and 1 + c [-] of the term that owns xi = (1 + v) / 2."""
        xp = namespace(v, *self.weights)
        begin, sample = -1.0, (0.0 * v, 0.0 * v)
        for weight, phase in zip(self.weights, self.phases, strict=True):
            end = begin + 2.0 * weight
            # An empty share would be stretched by a division by zero; nothing is drawn from it.
            width = xp.where(weight > 0, end - begin, 1.0)
            own = phase.deflection(xp.clip((2.0 * v - (begin + end)) / width, -1.0, 1.0))
            is_own = (v >= begin) & (weight > 0)
            sample = xp.where(is_own, own[0], sample[0]), xp.where(is_own, own[1], sample[1])
            begin = end
        return sample

    def moment(self, l: int) -> Any:  # noqa: E741 - the field's letter
        return self._mean([phase.moment(l) for phase in self.phases])

    @property
    def simplest(self) -> Phase:
        """Mixture without terms of weight 0, or its only term."""
        kept = [(weight, phase.simplest) for weight, phase in zip(self.weights, self.phases, strict=True) if weight > 0]
        return kept[0][1] if len(kept) == 1 else Mixture(*zip(*kept, strict=True))

    def for_kernel(self) -> Mixture:
        """Return float32 weights, and each term as a kernel draws from it: of some that is a table."""
        return self.of(
            weights=tuple(jnp.float32(weight) for weight in self.weights),
            phases=tuple(phase.for_kernel() for phase in self.phases),
        )

    def _mean(self, values: list[Any]) -> Any:
        total = self.weights[0] * values[0]
        for weight, value in zip(self.weights[1:], values[1:], strict=True):
            total = total + weight * value
        return total

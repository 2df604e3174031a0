"""What a check found, of a law or of a map alike."""

from __future__ import annotations

from dataclasses import dataclass

from profilefit.inventory import Named
from profilefit.shader.check.bounds import Bound, ModelError
from profilefit.shader.check.grid import Count


@dataclass(frozen=True)
class Verdict:
    """One law or map, judged.

    rounding  errors that float32 makes, worst, by the names of `quality` [-]; measured of the GPU against the exact
    inside    what must not be, where the law says that it holds; outside elsewhere
    """

    of: Named
    model: ModelError
    rounding: dict[str, float]
    measured: dict[str, float]
    inside: Count
    outside: Count
    bounds: tuple[Bound, ...]

    @property
    def broken(self) -> tuple[Bound, ...]:
        return tuple(bound for bound in self.bounds if bound.broken)

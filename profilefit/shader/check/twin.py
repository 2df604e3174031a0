"""A law's text in float64: the same lines, translated into numpy, where rounding is out of sight."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from profilefit.shader.check import grid
from profilefit.shader.check.evaluate import ShaderLaw
from profilefit.shader.check.grid import XI, Arguments, Spread
from profilefit.shader.languages import translated

Floats = NDArray[np.float64]
# Half the width of the difference quotient, of xi or 1 - xi: its error is a hundred-millionth, rounding's less.
STEP = 1e-4
NEAREST_XI, FARTHEST_XI = 1e-4, 1.0 - 1e-5


class Twin:
    """The numpy twin of a text with names of that prefix."""

    def __init__(self, name: str, text: str) -> None:
        self._names: dict[str, Any] = {}
        exec(compile(translated(text, "python"), f"{name}.py", "exec"), self._names)
        self._name = name

    def radius(self, xi: Floats, alpha: Floats) -> Floats:
        """x = r/l at xi, as the text draws it."""
        shape = self._names[f"{self._name}_shape"](alpha)
        return np.asarray(self._names[f"{self._name}_radius"](xi, shape))

    def mismatch(self, shader: ShaderLaw, alpha: Floats, lowest: float = 0.0) -> Spread | None:
        """|P_pdf dx/dxi - 1| of the GPU's P_pdf at the radii of the text's own map, where one xi draws a radius.

        alpha  (m,) [-]; lowest the least xi that is judged [-]
        """
        if alpha.size == 0:
            return None
        inner = (max(NEAREST_XI, lowest) < XI) & (XI < FARTHEST_XI)
        xi, albedo = np.broadcast_arrays(XI[None, :], alpha[:, None])
        x = self.radius(xi, albedo)
        rest = np.minimum(xi, 1.0 - xi)
        slope = (self.radius(xi + STEP * rest, albedo) - self.radius(xi - STEP * rest, albedo)) / (2.0 * STEP * rest)
        earlier, later = np.maximum.accumulate(x, axis=1), np.minimum.accumulate(x[:, ::-1], axis=1)[:, ::-1]
        single = np.zeros(x.shape, bool)
        single[:, 1:-1] = (x[:, 1:-1] > earlier[:, :-2]) & (x[:, 1:-1] < later[:, 2:])
        error = np.abs(shader.values(x, xi, albedo).pdf * slope - 1.0)
        at = Arguments(albedo, x, xi, np.array(1.0))
        return grid.spread(error, single & inner, at, of_share=True)

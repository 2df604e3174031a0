"""Techniques to compare with, for layers: samples of exact light by tables, and of sums of Gaussians."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from profilefit.laws.gaussians import MediumGaussians
from profilefit.materials import CHANNELS
from profilefit.scenes.layers.law import Plate
from profilefit.scenes.layers.passes import StackGather
from profilefit.scenes.layers.truth import LEFT, StackTable
from profilefit.scenes.stage.exact_law import columns, row, table_text
from profilefit.scenes.stage.technique import LAW, LawText
from profilefit.shader.stack_text import gaussians_text

Floats = NDArray[np.float64]
ROWS = 32  # thicknesses of a table of exact light


def of_table(table: StackTable, plates: Sequence[Plate]) -> StackGather:
    """Return samples of exact light by tables, of the nearest of ROWS thicknesses at each pixel."""
    values = np.repeat(np.linspace(0.0, 1.0, ROWS), len(CHANNELS))
    curves, (t, x) = table.curves(values), columns()
    every = np.broadcast_to(x, (values.size, x.size))
    shares = np.maximum.accumulate(curves.share(every), axis=1)
    rings = 2.0 * np.pi * x * curves.density(every)
    rows = [row(_radii(t, x, share), ring, share) for share, ring in zip(shares, rings, strict=True)]
    drawn, known = (np.stack(column) for column in zip(*rows, strict=True))
    text = table_text(LAW, curves.reflectance)
    shape = f"{LAW}_Shape(c + {len(CHANNELS)} * int(surface.r * {ROWS - 1}.0 + 0.5))"
    textures = {f"{LAW}_drawn": drawn, f"{LAW}_known": known}
    return StackGather(LawText("table", text, textures, shape, f"{LAW}_reflectance(shape)"), tuple(plates))


def _radii(t: Floats, x: Floats, share: Floats) -> Floats:
    """Return x at which all but e^-t of the light is within; beyond what a table tells, as it goes on."""
    depth = -np.log(np.maximum(1.0 - share, LEFT))
    told = np.searchsorted(depth, depth[-1])  # the first column with all that is told
    ln = np.interp(t, depth[: told + 1], np.log(x[: told + 1]))
    first = t < depth[0]  # R_d is as good as even there, or as 1 / r: next to none of the light
    far = t > depth[told]
    before = np.searchsorted(depth, depth[told] - 1.0)
    rate = (x[told] - x[before]) / (depth[told] - depth[before])
    return np.where(far, x[told] + rate * (t - depth[told]), np.where(first, x[0] * t / depth[0], np.exp(ln)))


def of_gaussians(sums: Sequence[MediumGaussians], plates: Sequence[Plate]) -> StackGather:
    """Return samples of sums of Gaussians, of red, green and blue, which are of one thickness everywhere."""
    text = gaussians_text(sums, name=LAW)
    law = LawText("gaussians", text, {}, f"{LAW}_shape(float(c))", f"{LAW}_reflectance(shape)")
    return StackGather(law, tuple(plates))

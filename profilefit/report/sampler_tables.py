"""How good each sampler is: what it never reaches, what its inverse gets wrong, how much its weights scatter."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from rich.console import RenderableType

from profilefit.report.columns import column_table
from profilefit.report.digits import on_the_point, significant
from profilefit.sampling import SamplerQuality

INFINITE = "∞"
NEGLIGIBLE = 5e-6  # a draw from 2^24 steps and the quadrature know no better
# Header and measure; the two "by law" are of a shader that takes the law's density for the sampler's.
COLUMNS = {
    "inversion": "inversion_error",
    "atom": "atom",
    "even\nown": "bias",
    "even\nlaw": "bias_by_law_pdf",
    "edge\nown": "edge_bias",
    "edge\nlaw": "edge_bias_by_law_pdf",
    "variance": "variance",
}
CAPTION = (
    "inversion: max |cdf(r(ξ)) − ξ|, ξ ≤ 0.999; atom: share of samples at one radius; even, edge: relative error of "
    "even light and of light beyond a straight edge, with the sampler's own pdf or the law's; variance: of the weight "
    "of one sample, with its own"
)


def sampler_tables(qualities: Mapping[str, SamplerQuality]) -> list[RenderableType]:
    """A table a sampler, by albedo, the worst last; what the columns are stands under the last."""
    names = list(qualities)
    return [_table(name, qualities[name], CAPTION if name == names[-1] else "") for name in names]


def _table(name: str, quality: SamplerQuality, caption: str) -> RenderableType:
    columns = {"α": [*(f"{alpha:.3f}" for alpha in quality.alpha), "worst"]}
    for header, measure in COLUMNS.items():
        values: NDArray[np.float64] = getattr(quality, measure)
        worst = values[np.argmax(np.abs(values))]
        columns[header] = on_the_point([sampler_number(float(value)) for value in [*values, worst]])
    return column_table(f"Sampler: {name}", columns, caption, left=("α",))


def sampler_number(value: float) -> str:
    """A measure of a sampler as text."""
    if abs(value) < NEGLIGIBLE:
        return "0"
    if math.isinf(value):
        return INFINITE if value > 0 else f"-{INFINITE}"
    return significant(value)

"""Corner plots: how the constants of one fit trade against each other."""

from __future__ import annotations

from pathlib import Path

import corner
import numpy as np
from matplotlib.ticker import FuncFormatter, MaxNLocator

from profilefit.report.canvas import BLUE, ORANGE, VERMILION, canvas, save, styled
from profilefit.report.source import Source

MEANING = {
    "discrepancy": "the law's misfit taken for independent noise",
    "statistical": "photon noise",
}
QUANTILES = (0.16, 0.5, 0.84)


@styled
def corner_figure(
    source: Source, out: Path, record_name: str, kind: str = "discrepancy", name: str = ""
) -> list[Path]:
    """The posterior draws of a record's constants, each pair and each alone; `kind` of error as in `posterior`."""
    fitted = source.fitted(record_name)
    assert fitted is not None  # `figures` draws only what its records are there for
    samples = fitted.arrays[f"samples_{kind}"].astype(float)
    names = fitted.content["covariance"]["names"]
    best = [fitted.content["constants"][constant]["regenerated"] for constant in names]
    size = len(names)
    figure = canvas(8.0, layout="none")
    corner.corner(
        samples, fig=figure, bins=24, color=BLUE, levels=(0.393, 0.865), smooth=0.8, max_n_ticks=2 if size > 5 else 4,
        plot_datapoints=False, plot_density=False, fill_contours=True, hist_kwargs={"linewidth": 1.0},
        contour_kwargs={"linewidths": 0.7},
    )  # fmt: skip
    return save(figure, out, name or f"corner-{record_name}")

"""How good each law is: the relative error of R_d and the largest error of the cdf, over the albedos."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from profilefit.report.canvas import (
    BLUE,
    GREEN,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    albedo_axis,
    canvas,
    legend_below,
    plain_log,
    save,
    styled,
)
from profilefit.report.content import SETS, converged, measures
from profilefit.report.source import Source

MEASURES = {
    "rel": "mean |R$_d$ / exact − 1| [-]",
    "ks": "max |cdf − exact cdf| [-]",
}
# Colour and marker by (record or law, set of constants): never by colour alone.
LOOKS: Mapping[tuple[str, str], dict[str, Any]] = {
    ("liang", "published"): {"color": VERMILION, "marker": "x", "linestyle": "--"},
    ("liang", "corrected"): {"color": ORANGE, "marker": "+", "linestyle": "--"},
    ("liang-as-published", "regenerated"): {"color": GREEN, "marker": "s", "linestyle": "-"},
    ("liang-whole", "regenerated"): {"color": BLUE, "marker": "o", "linestyle": "-"},
    ("burley", "published"): {"color": PURPLE, "marker": "v", "linestyle": "--"},
    ("burley-whole", "regenerated"): {"color": SKY, "marker": "^", "linestyle": "-"},
}
SPARE = {"color": "#000000", "marker": ".", "linestyle": ":"}  # a record that is new here


@styled
def quality_figure(source: Source, out: Path, name: str = "quality") -> list[Path]:
    """rel and ks [-] of every profile law and set of constants against alpha [-], at albedos that were not fitted."""
    figure = canvas(4.6)
    axes = list(figure.subplots(1, 2))
    drawn: set[str] = set()
    for record_name in source.paths:
        content = source.content(record_name)
        if not measures(content, "rel"):
            continue
        quality = content["quality"]
        for which in SETS:
            if which not in quality:
                continue
            regenerated = which == "regenerated"
            owner = record_name if regenerated else content["law"]
            label = f"{owner}, {which}"
            if label in drawn or (regenerated and not converged(content)):
                continue
            drawn.add(label)
            look = LOOKS.get((owner, which), SPARE)
            for ax, key in zip(axes, MEASURES, strict=True):
                ax.plot(quality["alpha"], quality[which][key], label=label, markersize=3.5, **look)
    for ax, title in zip(axes, MEASURES.values(), strict=True):
        albedo_axis(ax)
        ax.set(yscale="log", title=title)
        plain_log(ax.yaxis)
    legend_below(figure, axes)
    return save(figure, out, name)

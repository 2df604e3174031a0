"""How far each inverse cdf is from the exact one, over the albedos: one error, every form, both lights."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from profilefit.recipes.pipelines import inversion_error
from profilefit.report.figures.canvas import (
    BLACK,
    BLUE,
    ORANGE,
    PUBLISHED,
    PURPLE,
    albedo_axis,
    canvas,
    legend_below,
    plain_log,
    save,
    styled,
)
from profilefit.report.records import Fitted, Source

Floats = NDArray[np.float64]
Points = tuple[Floats, Floats]
# Under each light the records that are drawn. The paper has one light only.
RECORDS = {
    "searchlight": ("liang-inverse-whole", "hazard", "quantile"),
    "diffuse light": ("hazard-diffuse", "quantile-diffuse"),
}
# Of each form: never told apart by colour alone.
LOOKS: dict[str, tuple[str, Any]] = {
    "liang": ("(19)-(21) regenerated", {"color": ORANGE, "marker": "s", "linestyle": "-"}),
    "quantile": ("rational in −ln(1 − ξ)", {"color": BLUE, "marker": "o", "linestyle": "-"}),
    "hazard": ("escape hazard, its cdf inverted in one step", {"color": PURPLE, "marker": "^", "linestyle": "-."}),
}
DOUBTED = (0.4, 0.6)  # where the paper's authors find their inverse weakest
REQUIRED = 1e-3


@styled
def inversion_figure(source: Source, out: Path, name: str = "inversion-error") -> list[Path]:
    """max |cdf(g(xi)) - xi| [-], xi in [0, 0.999], against alpha [-]: the paper's inverse and others, by light."""
    figure = canvas(4.6)
    axes = list(figure.subplots(1, 2, sharey=True))
    for ax, (light, records) in zip(axes, RECORDS.items(), strict=True):
        for record in records:
            _draw(ax, source, record)
        ax.axhline(REQUIRED, color=BLACK, linewidth=0.8, linestyle=":", label="one in a thousand")
        albedo_axis(ax)
        ax.set(yscale="log", title=light)
        plain_log(ax.yaxis)
    axes[0].axvspan(*DOUBTED, color=BLACK, alpha=0.07, linewidth=0, label="α that the paper calls worst")
    axes[0].set_ylabel("max |cdf(g(ξ)) − ξ| [-]")
    if caption := _caption(source):
        figure.suptitle(caption, fontsize=9.0)
    legend_below(figure, axes)
    return save(figure, out, name)


def _draw(ax: Axes, source: Source, record: str) -> None:
    fitted = source.usable(record)
    if fitted is None:
        return
    if printed := _printed(source, record):
        ax.plot(*printed, label="(19)-(21) as printed", marker="x", markersize=3.5, **PUBLISHED)
    label, look = LOOKS[fitted.content["law"]]
    ax.plot(*_points(fitted), label=label, markersize=3.5, **look)


def _points(fitted: Fitted) -> Points:
    """alpha and the error of the regenerated law: as its record says, or measured now."""
    quality = fitted.content["quality"]
    alpha = np.asarray(quality["alpha"], float)
    if "inversion_error" in quality["regenerated"]:
        return alpha, np.asarray(quality["regenerated"]["inversion_error"], float)
    return alpha, inversion_error(fitted.law, alpha)


def _printed(source: Source, record: str) -> Points | None:
    """The same of the printed constants, where the record has judged them."""
    quality = source.content(record)["quality"]
    found = quality.get("published", {}).get("inversion_error")
    return None if found is None else (np.asarray(quality["alpha"], float), np.asarray(found, float))


def _caption(source: Source) -> str:
    """How bad the printed inverse is where its authors doubt it, and on either side of that."""
    name = "liang-inverse-whole"
    printed = _printed(source, name) if name in source.paths else None
    if printed is None:
        return ""
    alpha, error = printed
    low, high = DOUBTED
    inside = (alpha >= low) & (alpha <= high)
    said = []
    for where in (alpha < low, alpha > high):
        if np.any(where):
            worst = np.argmax(np.where(where, error, -np.inf))
            said.append(f"{error[worst]:.2g} at α = {alpha[worst]:.2g}")
    doubted = f"up to {error[inside].max():.2g}" if np.any(inside) else "nothing was measured"
    return (
        f"(19)-(21) as printed: {doubted} for α in [{low:g}, {high:g}], which the paper calls worst; {', '.join(said)}"
    )

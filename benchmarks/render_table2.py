"""Table 2 of Liang et al.: a frame at 1920 x 1080 with a face that covers a quarter, a half, three quarters of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from benchmarks.render_laws import Contender
from benchmarks.table import show
from profilefit.scenes.skin.chart import covered, covering
from profilefit.scenes.skin.scene import Head
from profilefit.scenes.stage.stage import PASSES, Stage
from profilefit.studies.choose.cost import COVERED, PUBLISHED, YARDSTICK_TAPS
from profilefit.studies.tradeoff.stopwatch import Ratio

Floats = NDArray[np.float64]
YARDSTICK = "separable"
KEYS = ("separable", "burley", "liang", "hazard", "quantile")


@dataclass(frozen=True)
class Timed:
    """Milliseconds by passes, "scatter" or "frame", and law, (turns,), where a share `covered` of the screen is [-]."""

    covered: float
    milliseconds: dict[str, dict[str, Floats]]

    def ratio(self, passes: str, key: str) -> Ratio:
        """Return times over the yardstick's, turn by turn."""
        ratios = self.milliseconds[passes][key] / self.milliseconds[passes][YARDSTICK]
        return Ratio(float(np.median(ratios)), float(ratios.min()), float(ratios.max()))


def timed(
    context: moderngl.Context,
    scene: Head,
    works: Mapping[str, Contender],
    size: tuple[int, int],
    turns: int,
    shares: Sequence[float] = COVERED,
) -> list[Timed]:
    """Time all laws in turns; the scene is as near as it must be to cover each share of the screen."""
    return [_timed(context, covering(context, scene, share, size), works, size, turns) for share in shares]


def _timed(
    context: moderngl.Context, scene: Head, works: Mapping[str, Contender], size: tuple[int, int], turns: int
) -> Timed:
    mfp = scene.material.mfp
    found = {passes: {key: np.empty(turns) for key in works} for passes in PASSES}
    with Stage(context, size) as stage:
        stage.draw(scene)
        reached = covered(stage, scene)
        for turn in range(turns):
            for passes, by_law in found.items():
                for key, values in by_law.items():
                    one = works[key]
                    values[turn] = stage.time(one.law, mfp, one.drawn(YARDSTICK_TAPS), repeats=1, passes=passes)[0]
    return Timed(reached, found)


def report(title: str, works: Mapping[str, Contender], found: list[Timed]) -> None:
    """Print milliseconds, and ratios to the separable filter beside those of the paper."""
    shares = [f"{100 * one.covered:.1f} %" for one in found]
    for passes in PASSES:
        rows = []
        for key in found[0].milliseconds[passes]:
            cells = [f"{one.milliseconds[passes][key].min():.0f}" for one in found]
            cells += [str(one.ratio(passes, key)) for one in found]
            rows.append((works[key].label, *cells, *_published(key)))
        columns = (
            "law",
            *(f"ms, {s}" for s in shares),
            *(f"ratio, {s}" for s in shares),
            *(["paper"] * len(shares)),
        )
        show(f"{title}: {passes}, least ms, median ratio", columns, rows)


def _published(key: str) -> list[str]:
    if key not in PUBLISHED:
        return ["-"] * len(COVERED)
    return [f"{ms / base:.2f}" for ms, base in zip(PUBLISHED[key], PUBLISHED[YARDSTICK], strict=True)]


def as_json(found: list[Timed]) -> list[dict]:
    return [
        {
            "covered": one.covered,
            "milliseconds": {p: {k: v.tolist() for k, v in laws.items()} for p, laws in one.milliseconds.items()},
        }
        for one in found
    ]

"""Cost of a frame in milliseconds: an estimate from a published frame, measured ratios and stated speeds of GPUs.

    ms = published(screen_share) x pixels / 1080p x ratio(option) x 1.862 / TFLOPS

published  a frame with the separable filter on a GTX 1050 (Liang et al., Table 2): 3.5, 5.9, 8.6 ms where the face
           covers 25, 50 and 75 % of 1920 x 1080, here the straight line through them
ratio      a frame by the option over one by the separable filter with 17 taps, as this project's renderer measured it
TFLOPS     what the maker states of the GPU, float32

Its range holds two unknowns. Memory, not arithmetic, may be what a GPU waits for: the frame is scaled by either. And
ratios that were measured elsewhere may lie `spread` times nearer to 1 or farther from it on the user's GPU, as far as
those shipped are from the same table's frames with normalized diffusion.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib import resources

import moderngl
import numpy as np

from mcml_sim.media.arrays import require
from profilefit.laws.base import ProfileLaw
from profilefit.scenes.skin.chart import covering
from profilefit.scenes.skin.passes import SeparableFilter
from profilefit.scenes.skin.scene import Head, head_scene
from profilefit.scenes.stage.pattern import Sampling
from profilefit.scenes.stage.stage import By, Stage
from profilefit.shader.context import renderer
from profilefit.shader.emit import source
from profilefit.studies.choose.case import Option

COVERED = (0.25, 0.50, 0.75)  # share of the screen [-]
# ms a frame on a GTX 1050: the paper's own law is `liang`, normalized diffusion inverts by Golubev.
PUBLISHED = {"separable": (3.5, 5.9, 8.6), "burley": (4.2, 6.9, 10.6), "liang": (3.9, 6.6, 9.8)}
PUBLISHED_PIXELS = 1920 * 1080
# float32 TFLOPS (shaders x 2 x boost clock) and memory bandwidth [GB/s] as their makers state them.
GPUS = {
    "switch": (0.393, 25.6),
    "steam-deck": (1.6, 88.0),
    "gtx-1050": (1.862, 112.0),
    "gtx-1660": (5.03, 192.0),
    "ps5": (10.3, 448.0),
    "rtx-3060": (12.7, 360.0),
    "rtx-4070": (29.1, 504.0),
    "rtx-4090": (82.6, 1008.0),
}
YARDSTICK = "gtx-1050"
SHIPPED = "ratios.json"
YARDSTICK_TAPS = 17  # and samples, of the paper's Figure 14; its Table 2 does not say
TAPS = (9, 33)
SAMPLES = (16, 64)
SHARE, SIZE = 0.5, (640, 360)  # of the screen that is covered while it is measured [-], and its size [pixels]
TURNS = 5


@dataclass(frozen=True)
class Ratios:
    """Frames over one by the separable filter with 17 taps: `base` + `fixed` + `each` x taps or samples.

    device  that was measured;  base  of a frame without scattering;  fixed, each  of its scatter pass, by the filter
    ("separable") or law;  spread  how many times as far from 1 a ratio may be on the user's GPU: 1 if it was measured
    """

    device: str
    base: float
    fixed: Mapping[str, float]
    each: Mapping[str, float]
    spread: float = 1.0

    def knows(self, option: Option) -> bool:
        """Return whether its cost was measured."""
        return option.kind == "nothing" or _key(option) in self.each

    def of(self, option: Option) -> float:
        """Return the frame of an option over the yardstick's [-]."""
        if option.kind == "nothing":
            return self.base
        key = _key(option)
        require(key in self.each, "option", f"one whose cost was measured ({', '.join(self.each)})", key)
        return self.base + option.count * (self.fixed[key] + self.each[key] * option.number)


def _key(option: Option) -> str:
    """Return the filter, or the law."""
    return "separable" if option.law is None else source(option.law)


@dataclass(frozen=True)
class Milliseconds:
    """Time of a frame [ms]: an estimate, and the range that it lies in by what is not known of the GPU."""

    estimate: float
    least: float
    most: float


def milliseconds(
    option: Option, ratios: Ratios, gpu: str = YARDSTICK, screen_share: float = 0.5, pixels: int = PUBLISHED_PIXELS
) -> Milliseconds:
    """Return a frame by an option."""
    require(gpu in GPUS, "gpu", f"one of {', '.join(GPUS)}", gpu)
    slope, base = np.polyfit(COVERED, PUBLISHED["separable"], 1)
    whole = float(base + slope * screen_share) * pixels / PUBLISHED_PIXELS
    arithmetic, memory = (whole * old / new for old, new in zip(GPUS[YARDSTICK], GPUS[gpu], strict=True))
    ratio = ratios.of(option)
    low, high = sorted(max(1.0 + (ratio - 1.0) * by, 0.0) for by in (ratios.spread, 1.0 / ratios.spread))
    return Milliseconds(arithmetic * ratio, min(arithmetic, memory) * low, max(arithmetic, memory) * high)


@cache
def shipped() -> Ratios:
    """Return the ratios that were measured for this release, in software."""
    content = json.loads((resources.files("profilefit.studies.choose") / SHIPPED).read_text(encoding="utf-8"))
    ratios = Ratios(**content)
    own = ratios.base + ratios.fixed["burley"] + ratios.each["burley"] * YARDSTICK_TAPS
    hardware = np.divide(PUBLISHED["burley"], PUBLISHED["separable"])
    return replace(ratios, spread=float(np.max(hardware - 1.0)) / (own - 1.0))


def measured(context: moderngl.Context, laws: Mapping[str, ProfileLaw], size: tuple[int, int] = SIZE) -> Ratios:
    """Measure ratios on this machine's renderer, a head over half of the screen: the least of some turns."""
    scene = covering(context, head_scene(), SHARE, size)
    with Stage(context, size) as stage:
        stage.draw(scene)
        frame = _least(stage, scene, SeparableFilter(), Sampling(YARDSTICK_TAPS), "frame")
        works: list[tuple[str, By, tuple[int, int]]] = [("separable", SeparableFilter(), TAPS)]
        works += [(source(law), law, SAMPLES) for law in laws.values()]
        fixed: dict[str, float] = {}
        each: dict[str, float] = {}
        for key, law, numbers in works:
            times = [_least(stage, scene, law, Sampling(number), "scatter") / frame for number in numbers]
            each[key] = max((times[1] - times[0]) / (numbers[1] - numbers[0]), 0.0)
            fixed[key] = max(times[0] - each[key] * numbers[0], 0.0)
    scatter = fixed["separable"] + YARDSTICK_TAPS * each["separable"]
    return Ratios(renderer(context), max(1.0 - scatter, 0.0), fixed, each)


def _least(stage: Stage, scene: Head, law: By, sampling: Sampling, passes: str) -> float:
    return min(stage.time(law, scene.material.mfp, sampling, repeats=TURNS, passes=passes))

"""Where light in water may fail: hits on an uneven floor, e^-ct for a beam, and the integral over a view's segment."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from profilefit.scenes.sea import law
from profilefit.scenes.sea.hits import first_hit, wrong_shares
from profilefit.scenes.sea.law import beam_share, failing_depth, segment_integral
from profilefit.scenes.sea.scene import PHASE, lobes_of
from profilefit.scenes.sea.waves import Waves, random_floor
from profilefit.shader.emit import text_beside
from profilefit.shader.sea_file import segment_text
from profilefit.studies.stability.causes_of_sea import (
    ALBEDO,
    BEAM,
    DEPTH,
    EYE,
    FLOOR,
    LENGTH,
    NEAR,
    SEGMENT,
    SHARE,
    SLOPE,
    STEEP,
    WAY,
    WAYS,
    holds_to,
)
from profilefit.studies.stability.cells import NAME, Cells, RoundedText, absolute, judged_cells, relative
from profilefit.studies.stability.layout import FLOAT32, FLOAT64, TEXT32, ArgumentAxis

Floats = NDArray[np.float64]
STEEPNESSES = (0.5, 0.9, 1.5, 3.0, 5.0, 10.0)  # slope x tangent
RAYS, WRONG = 600, 0.01  # a floor, and the share of them that may be off
OURS = 3  # of `WAYS`, the first; the others were published
# Level and nearly level floors: rms slope [-], depth [m], and the eye's height above the highest place [m].
SLOPES = (0.0, 1e-9, 1e-7, 1e-5, 1e-3)
FLOORS = (0.1, 1.0, 4.0, 5.0, 10.0, 100.0, 1000.0)
EYES = (0.01, 0.03, 0.1, 0.2, 0.5, 1.0)
VIEWS, STEPS = 20, 16  # rays per cell, steps of the search
GRAZING, OFF = 0.01, 1e-6  # least cosine of a ray to the vertical; height [depths] beyond which a hit is wrong
RADIUS, DARKER = 0.1, 0.1  # cw, and the share of e^-ct by which there may be more light
ALBEDOS = (0.05, 0.1, 0.2, 0.4, 0.6, 0.8)
DEPTHS = (0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0, 2.0, 4.0)  # as far as photons were compared
TURNS = (0.0, 2.0**-24, 2.0**-23, 2.0**-20, 1e-5, 1e-4, 1e-3, 0.01, 0.1, 0.5, 1.0, 2.0)  # 1 + m: m = -1 ... 1
LENGTHS = (1e-4, 1e-2, 0.1, 1.0, 10.0, 1e3)  # c t1
RATES = (1e-3, 0.3, 2.0)  # c [1/m]
BEFORE, BACK = 1.0, 0.5  # s0, t0 [m]
DIGITS = 1e-6  # relative: a few roundings in float32


def cells_of() -> Iterator[Cells]:
    """Hits over S, a narrow beam over albedo and depth, a segment over direction, length and attenuation."""
    yield from of_hits()
    yield of_level_floors()
    yield of_beam()
    yield from of_segment()


def of_hits() -> Iterator[Cells]:
    """Rays whose hit is off by more than 1 % of the depth: our ways, and those that were published."""
    found = wrong_shares(list(WAYS.values()), STEEPNESSES, RAYS)
    for own, rows in ((True, slice(0, OURS)), (False, slice(OURS, None))):
        places, value = np.arange(len(WAYS))[rows], found[rows]
        axes = (
            ArgumentAxis(WAY, "-", places.astype(float), tuple(WAYS)[rows]),
            ArgumentAxis(STEEP, "-", np.array(STEEPNESSES)),
        )
        right = np.zeros_like(value)
        inside = np.array(STEEPNESSES) < holds_to(places)[:, None]
        name = "hits" if own else "hits, as published"
        yield judged_cells(name, own, SHARE, FLOAT64, axes, value, right, absolute(value, right), WRONG, inside)


def of_level_floors() -> Cells:
    """Share of views whose hit on a level or nearly level floor is wrong in float32, over slope, depth and eye."""
    axes = (
        ArgumentAxis(SLOPE, "-", np.array(SLOPES)),
        ArgumentAxis(FLOOR, "m", np.array(FLOORS)),
        ArgumentAxis(EYE, "m", np.array(EYES)),
    )
    value = np.array([[[_missed(slope, depth, eye) for eye in EYES] for depth in FLOORS] for slope in SLOPES])
    right, everywhere = np.zeros_like(value), np.ones(value.shape, bool)
    return judged_cells("level floors", True, SHARE, FLOAT32, axes, value, right, value, WRONG, everywhere)


def _missed(slope: float, depth: float, eye: float) -> float:
    """Share of `VIEWS` random rays whose hit in float32 is missing, or off in height by more than `OFF` depths."""
    rng = np.random.default_rng(0)
    floor = random_floor(slope, 2.0 * depth, depth) if slope else Waves(2.0 * depth, mean=-depth)
    down, turn = rng.uniform(GRAZING, 1.0, VIEWS), rng.uniform(0.0, 2.0 * np.pi, VIEWS)
    level = np.sqrt(1.0 - down * down)
    ray = np.column_stack([level * np.cos(turn), level * np.sin(turn), -down]).astype(np.float32)
    origin = np.column_stack([rng.uniform(0.0, 2.0 * depth, (VIEWS, 2)), np.full(VIEWS, floor.highest + eye)])
    given = floor.height, origin.astype(np.float32), ray, floor.lowest, floor.highest, STEPS, floor.slope
    single, double = (np.asarray(first_hit(*given, precision=one)) for one in (np.float32, np.float64))
    return float(np.mean(~(np.abs(single - double) * down <= OFF * depth)))


def of_beam() -> Cells:
    """e^-ct for what of a beam is found within a small radius, in water as Petzold's."""
    lobes = lobes_of(PHASE)
    albedo, depth = np.array(ALBEDOS)[:, None], np.array(DEPTHS)
    right = beam_share(albedo, depth, RADIUS, lobes)
    value = np.broadcast_to(np.exp(-depth), right.shape)
    inside = albedo * depth < failing_depth(albedo, RADIUS, lobes, DARKER)
    axes = ArgumentAxis(ALBEDO, "-", np.array(ALBEDOS)), ArgumentAxis(DEPTH, "-", np.array(DEPTHS))
    bound = DARKER / (1.0 + DARKER)  # of all that is there
    return judged_cells("e^-ct", True, BEAM, FLOAT64, axes, value, right, relative(value, right), bound, inside)


def of_segment() -> Iterator[Cells]:
    """The integral in float32: its text, the function in Python, and the formula as it is mostly written."""
    text = RoundedText(segment_text(text_beside(law.__name__, "glsl/segment.glsl"), "python", NAME), np.float32)
    yield _segment(SEGMENT, True, TEXT32, lambda *given: text.call("integral", *given))
    yield _segment(SEGMENT, True, FLOAT32, segment_integral)
    yield _segment("segment, plain", False, FLOAT32, plain_integral)


def plain_integral(c: Floats, s0: Floats, t0: Floats, m: Floats, t1: Floats) -> Floats:
    """e^{-c (s0 + t0)} (1 - e^-x) / x t1, x = c (1 + m) t1, as it stands."""
    with np.errstate(all="ignore"):
        x = c * (1 + m) * t1
        return np.exp(-c * (s0 + t0)) * ((1 - np.exp(-x)) / x) * t1


def _segment(name: str, own: bool, arithmetic: str, function: Callable[..., Floats]) -> Cells:
    axes = (
        ArgumentAxis(NEAR, "-", np.array(TURNS)),
        ArgumentAxis(LENGTH, "-", np.array(LENGTHS)),
        ArgumentAxis("c", "1/m", np.array(RATES)),
    )
    m, far, c = np.meshgrid(np.array(TURNS) - 1.0, LENGTHS, RATES, indexing="ij")
    given = [one.astype(np.float32) for one in (c, np.full(c.shape, BEFORE), np.full(c.shape, BACK), m, far / c)]
    value = np.asarray(function(*given), float)
    right = segment_integral(*(one.astype(float) for one in given))
    everywhere = np.ones(value.shape, bool)
    return judged_cells(name, own, SEGMENT, arithmetic, axes, value, right, relative(value, right), DIGITS, everywhere)

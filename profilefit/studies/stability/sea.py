"""Light in water: hits on an uneven floor, e^-ct for a beam, and the integral over a view's segment."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from profilefit.scenes.sea.law import beam_share, failing_depth, segment_integral
from profilefit.scenes.sea.scene import PHASE, lobes_of
from profilefit.scenes.sea.source import segment_text
from profilefit.scenes.sea.waves import Waves, first_hit, random_floor, wrong_shares
from profilefit.studies.stability.cells import NAME, Cells, RoundedText, judged_cells, relative
from profilefit.studies.stability.layout import FLOAT32, FLOAT64, TEXT32, ArgumentAxis

Floats = NDArray[np.float64]
SHARE, BEAM, SEGMENT = "rays with a wrong hit", "beam, cw 0.1", "segment"  # quantities
# Searches of a hit, as `waves.wrong_shares` calls them, 3 iterations each; the first three are ours.
WAYS: dict[str, int | str] = {
    "16 steps": 16,
    "8 steps": 8,
    "Newton's": "newton",
    "Newton's from 1 m, as published": "newton_1m",
    "Shah et al.'s": "shah",
}
OURS = 3
SEVERAL = 1.0  # S from which on a ray may cross the floor more than once
# S below which each is promised to be right: beyond, iterations alone find another crossing, or none.
LIMITS: dict[int | str, float] = {16: np.inf, 8: 3.0, "newton": SEVERAL, "newton_1m": SEVERAL, "shah": SEVERAL}
OF_HITS = (
    f"take equal steps before Newton's iteration, 8 for S from {SEVERAL:g} to {LIMITS[8]:g} and 16 beyond, and begin "
    "at the floor's mean plane"
)
OF_BEAM = (
    "use profilefit.scenes.sea.beam_share, or the Gaussians of profilefit export SEA.toml: light turned by small "
    "angles stays in the beam"
)
OF_SEGMENT = "use profilefit.scenes.sea.segment_integral or profilefit export sea-segment, which keep digits at m = -1"
STEEPNESSES = (0.5, 0.9, 1.5, 3.0, 5.0, 10.0)  # slope x tangent
RAYS, WRONG = 600, 0.01  # a floor, and the share of them that may be off
# Level and nearly level floors: rms slope [-], depth [m], and the eye's height above the highest place [m].
SLOPES = (0.0, 1e-9, 1e-7, 1e-5, 1e-3)
FLOORS = (0.1, 1.0, 4.0, 5.0, 10.0, 100.0, 1000.0)
EYES = (0.01, 0.03, 0.1, 0.2, 0.5, 1.0)
VIEWS, STEPS = 20, 16  # rays per cell, steps of the search
GRAZING, HEIGHT_BOUND = 0.01, 1e-6  # least cosine of a ray to the vertical; depths that a hit may miss by
RADIUS, DARKER = 0.1, 0.1  # cw, and the share of e^-ct by which there may be more light
ALBEDOS = (0.05, 0.1, 0.2, 0.4, 0.6, 0.8)
DEPTHS = (0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0, 2.0, 4.0)  # as far as photons were compared
TURNS = (0.0, 2.0**-24, 2.0**-23, 2.0**-20, 1e-5, 1e-4, 1e-3, 0.01, 0.1, 0.5, 1.0, 2.0)  # 1 + m: m = -1 ... 1
LENGTHS = (1e-4, 1e-2, 0.1, 1.0, 10.0, 1e3)  # c t1
RATES = (1e-3, 0.3, 2.0)  # c [1/m]
BEFORE, BACK = 1.0, 0.5  # s0, t0 [m]
DIGITS = 1e-6  # relative: a few roundings in float32


def cells_of() -> Iterator[Cells]:
    """Yield hits over S, a narrow beam over albedo and depth, a segment over direction, length and attenuation."""
    yield from of_hits()
    yield of_level_floors()
    yield of_beam()
    yield from of_segment()


def of_hits() -> Iterator[Cells]:
    """Yield the share of rays whose hit misses by more than 1 % of the depth, by our searches and published ones."""
    shares = wrong_shares(list(WAYS.values()), STEEPNESSES, RAYS)
    for name, own, rows in (("hits", True, slice(0, OURS)), ("hits, as published", False, slice(OURS, None))):
        value, limits = shares[rows], np.array(list(LIMITS.values()))[rows, None]
        axes = (
            ArgumentAxis("way", "-", np.arange(len(value), dtype=float), tuple(WAYS)[rows]),
            ArgumentAxis("S", "-", np.array(STEEPNESSES)),
        )
        inside = np.array(STEEPNESSES) < limits
        yield judged_cells(name, own, SHARE, FLOAT64, axes, value, np.zeros(()), value, WRONG, inside, advice=OF_HITS)


def of_level_floors() -> Cells:
    """Return the share of views whose hit on a level or nearly level floor is wrong in float32."""
    axes = (
        ArgumentAxis("slope", "-", np.array(SLOPES)),
        ArgumentAxis("depth", "m", np.array(FLOORS)),
        ArgumentAxis("eye above the floor", "m", np.array(EYES)),
    )
    value = np.array([[[_missed(slope, depth, eye) for eye in EYES] for depth in FLOORS] for slope in SLOPES])
    return judged_cells("level floors", True, SHARE, FLOAT32, axes, value, np.zeros(()), value, WRONG, advice=OF_HITS)


def _missed(slope: float, depth: float, eye: float) -> float:
    """Return the share of `VIEWS` random rays whose hit in float32 is missing or misses by `HEIGHT_BOUND` depths."""
    rng = np.random.default_rng(0)
    floor = random_floor(slope, 2.0 * depth, depth) if slope else Waves(2.0 * depth, mean=-depth)
    down, turn = rng.uniform(GRAZING, 1.0, VIEWS), rng.uniform(0.0, 2.0 * np.pi, VIEWS)
    level = np.sqrt(1.0 - down * down)
    ray = np.column_stack([level * np.cos(turn), level * np.sin(turn), -down]).astype(np.float32)
    origin = np.column_stack([rng.uniform(0.0, 2.0 * depth, (VIEWS, 2)), np.full(VIEWS, floor.highest + eye)])
    given = floor.height, origin.astype(np.float32), ray, floor.lowest, floor.highest, STEPS, floor.slope
    single, double = (np.asarray(first_hit(*given, precision=one)) for one in (np.float32, np.float64))
    return float(np.mean(~(np.abs(single - double) * down <= HEIGHT_BOUND * depth)))


def of_beam() -> Cells:
    """Return e^-ct for the light of a beam within a small radius, in water as Petzold's."""
    lobes = lobes_of(PHASE)
    albedo, depth = np.array(ALBEDOS)[:, None], np.array(DEPTHS)
    share = beam_share(albedo, depth, RADIUS, lobes)
    value = np.broadcast_to(np.exp(-depth), share.shape)
    inside = albedo * depth < failing_depth(albedo, RADIUS, lobes, DARKER)
    axes = ArgumentAxis("ω", "-", np.array(ALBEDOS)), ArgumentAxis("ct", "-", np.array(DEPTHS))
    bound = DARKER / (1.0 + DARKER)  # of all that is there
    error = relative(value, share)
    return judged_cells("e^-ct", True, BEAM, FLOAT64, axes, value, share, error, bound, inside, advice=OF_BEAM)


def of_segment() -> Iterator[Cells]:
    """Yield the integral in float32: by its shader source, the function in Python, and the usual formula."""
    text = RoundedText(segment_text("python", NAME), np.float32)
    yield _segment(SEGMENT, True, TEXT32, lambda *given: text.call("integral", *given))
    yield _segment(SEGMENT, True, FLOAT32, segment_integral)
    yield _segment("segment, plain", False, FLOAT32, plain_integral)


def plain_integral(c: Floats, s0: Floats, t0: Floats, m: Floats, t1: Floats) -> Floats:
    """Return e^{-c (s0 + t0)} (1 - e^-x) / x t1, x = c (1 + m) t1, as it stands."""
    with np.errstate(all="ignore"):
        x = c * (1 + m) * t1
        return np.exp(-c * (s0 + t0)) * ((1 - np.exp(-x)) / x) * t1


def _segment(name: str, own: bool, arithmetic: str, function: Callable[..., Floats]) -> Cells:
    axes = (
        ArgumentAxis("1+m", "-", np.array(TURNS)),
        ArgumentAxis("c t1", "-", np.array(LENGTHS)),
        ArgumentAxis("c", "1/m", np.array(RATES)),
    )
    m, far, c = np.meshgrid(np.array(TURNS) - 1.0, LENGTHS, RATES, indexing="ij")
    given = [one.astype(np.float32) for one in (c, np.full(c.shape, BEFORE), np.full(c.shape, BACK), m, far / c)]
    value = np.asarray(function(*given), float)
    exactly = segment_integral(*(one.astype(float) for one in given))
    error = relative(value, exactly)
    return judged_cells(name, own, SEGMENT, arithmetic, axes, value, exactly, error, DIGITS, advice=OF_SEGMENT)

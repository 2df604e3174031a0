"""A bracket of exposures as one picture: counts a second by Bayer plane, with variances; what is clipped is left out.

An exposure of relative time t records y = t x + noise of variance y / gain + read^2 [steps^2] (photon transfer). Times
are fitted, not believed: of each pair of neighbours the ratio is that of the sums over pixels that both record well.
Gain and read noise are fitted to the scatter of those pixels about it. The picture is the mean of y / t by inverse
variance, at a light that neighbouring pixels share: by its own noise, a pixel that is dark by chance would count for
more. Clipped pixels and their neighbours do not count, nor does what spills along a column of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, uniform_filter

from profilefit.errors import InputError
from profilefit.measured.photo.exposure import BayerPlane, Exposure

Floats = NDArray[np.float64]
Plane = NDArray[np.float32]
FULL = 0.9  # of the range between black and white, from where a pixel counts as clipped
REACH = 2  # pixels of a plane about a clipped one that are left out, too
SHARED = 5  # pixels across, over which light is shared for the weights
DIM, UNCLIPPED = 0.02, 0.7  # of the range, between which a pixel says something of ratios
LEAST_PAIRS = 50  # pixels, for a ratio or a bin
BINS = 24  # of light, for photon transfer
BRIGHTER = 1.2  # times the light of another exposure, that one of a shorter time, or of the same, may have
ROUNDED = 1.0 / 12.0  # steps^2, variance of a count that has no other


@dataclass(frozen=True)
class Sensor:
    """gain [electrons a step], read noise [steps]; each with its standard error where the bracket tells."""

    gain: float
    read: float


@dataclass(frozen=True)
class Picture:
    """One Bayer plane of a bracket: light [steps a unit of time] and its variance, nan where no exposure has it.

    offset  (row, column) of the plane's first pixel in the whole picture, step between its pixels
    """

    light: Plane
    variance: Plane
    offset: tuple[int, int]
    step: int


class Times(NamedTuple):
    """Times of exposures (m,), relative to the longest, and the covariance (m, m) of their logarithms."""

    value: Floats
    covariance: Floats


def times(shots: Sequence[Exposure]) -> Times:
    """Estimate times from what the exposures record; InputError where neighbours share no pixels."""
    stated = [one.seconds or 0.0 for one in shots]
    light = [sum(float(each.counts.mean()) for each in one.planes) for one in shots]
    order = np.lexsort((light, stated)) if all(stated) else np.argsort(light)
    value, covariance = np.ones(len(shots)), np.zeros((len(shots),) * 2)
    for at in range(len(shots) - 2, -1, -1):
        shorter, longer = order[at], order[at + 1]
        ratio, error = _ratio(shots[shorter], shots[longer])
        value[shorter] = value[longer] * ratio
        covariance[np.ix_(order[: at + 1], order[: at + 1])] += error**2
    return Times(value, covariance)


def _ratio(shorter: Exposure, longer: Exposure) -> tuple[float, float]:
    """Return the ratio of two exposures' times, the shorter one's first, and its relative error.

    Pixels are chosen by what their neighbourhood records: by their own, those that are bright by chance would be.
    """
    above = below = pairs = 0.0
    chosen = []
    for one, other in zip(shorter.planes, longer.planes, strict=True):
        level = uniform_filter(other.counts, SHARED, mode="nearest")
        good = (level < UNCLIPPED * other.range) & (level > DIM * other.range) & _unclipped(other, REACH)
        chosen.append((one.counts[good].astype(float), other.counts[good].astype(float)))
        above += float(chosen[-1][0].sum())
        below += float(chosen[-1][1].sum())
        pairs += int(good.sum())
    longer_is_stated = shorter.seconds and longer.seconds and shorter.seconds < longer.seconds
    if pairs >= LEAST_PAIRS and above > BRIGHTER * below:
        raise InputError(
            f"{shorter.source}: expected less light than {longer.source} has, which "
            f"{'states a longer time' if longer_is_stated else 'is brighter on the whole'}, got "
            f"{above / below:.3g} times as much"
        )
    if pairs < LEAST_PAIRS or not above > 0:
        raise InputError(
            f"{shorter.source}: expected a scene that {longer.source} shares with it, neither dark nor clipped, in "
            f"{LEAST_PAIRS} pixels, got {pairs if above > 0 else 0:.0f}; take exposures in steps of a factor of eight "
            "or less"
        )
    ratio = above / below
    scatter = sum(float(np.sum((one - ratio * other) ** 2)) for one, other in chosen)
    return ratio, float(np.sqrt(scatter)) / above


def shares(light: Floats, relative: Floats, own: Sensor, most: Floats) -> Floats:
    """Return shares (n, m) of exposures (m,) in a picture of light (n,), where more than `most` steps (m,) clip."""
    steps = np.maximum(np.multiply.outer(light, relative), 0.0)
    weight = np.where(steps < most, relative**2 / (steps / own.gain + own.read**2), 0.0)
    total = weight.sum(axis=1, keepdims=True)
    return np.asarray(np.divide(weight, total, out=np.zeros_like(weight), where=total > 0), float)


def sensor(shots: Sequence[Exposure], relative: Floats) -> Sensor:
    """Photon transfer: the variance of y_a - (t_a / t_b) y_b over bins of light, against what electrons would have."""
    rows, squares, weights = [], [], []
    order = np.argsort(relative)
    for a, b in pairwise(order):
        ratio = relative[a] / relative[b]
        for one, other in zip(shots[a].planes, shots[b].planes, strict=True):
            good = (other.counts < FULL * other.range) & (other.counts > 0)
            if np.count_nonzero(good) < LEAST_PAIRS:
                continue
            light, residual = other.counts[good], one.counts[good] - ratio * other.counts[good]
            edges = np.unique(np.quantile(light, np.linspace(0.0, 1.0, BINS + 1)))
            at = np.clip(np.searchsorted(edges, light, side="right") - 1, 0, edges.size - 2)
            for each in range(edges.size - 1):
                inside = residual[at == each]
                if inside.size < LEAST_PAIRS:
                    continue
                middle = float(light[at == each].mean())
                rows.append((ratio * middle + ratio**2 * middle, 1.0 + ratio**2))
                squares.append(max(float(np.mean((inside - inside.mean()) ** 2)), ROUNDED * (1.0 + ratio**2)))
                weights.append(np.sqrt(inside.size) / squares[-1])
    if len(rows) < 2:
        return Sensor(1.0, 1.0)
    matrix, weight = np.array(rows), np.array(weights)
    best, *_ = np.linalg.lstsq(matrix * weight[:, None], np.array(squares) * weight, rcond=None)
    return Sensor(1.0 / max(float(best[0]), 1e-9), float(np.sqrt(max(best[1], ROUNDED))))


def merged(shots: Sequence[Exposure], relative: Floats, own: Sensor) -> list[Picture]:
    """Return the planes of a bracket, light in steps of the longest exposure."""
    pictures = []
    for at, plane in enumerate(shots[0].planes):
        total = np.zeros(plane.counts.shape, np.float32)
        precision = np.zeros(plane.counts.shape, np.float32)
        light = _rough(shots, relative, at)
        for shot, time in zip(shots, relative, strict=True):
            one = shot.planes[at]
            good = _unclipped(one, REACH)
            variance = np.maximum(light * time, 0.0) / own.gain + own.read**2
            weight = np.where(good, time**2 / variance, 0.0).astype(np.float32)
            total += weight * one.counts / np.float32(time)
            precision += weight
        with np.errstate(divide="ignore", invalid="ignore"):
            pictures.append(Picture(total / precision, 1.0 / precision, plane.offset, plane.step))
    return pictures


def _unclipped(plane: BayerPlane, reach: int) -> NDArray[np.bool_]:
    """Pixels so far from those that clip."""
    return ~binary_dilation(plane.counts >= FULL * plane.range, iterations=reach)


def _rough(shots: Sequence[Exposure], relative: Floats, at: int) -> Plane:
    """Light that neighbouring pixels share, of the longest exposure that has it."""
    rough: Plane = np.full(shots[0].planes[at].counts.shape, np.nan, np.float32)
    for shot, time in sorted(zip(shots, relative, strict=True), key=lambda pair: pair[1]):
        one = shot.planes[at]
        good = _unclipped(one, REACH + SHARED // 2)
        smooth = uniform_filter(one.counts, SHARED, mode="nearest") / np.float32(time)
        rough = np.where(good | np.isnan(rough), smooth, rough)
    return rough

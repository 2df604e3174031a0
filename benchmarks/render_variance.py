"""Squared bias and variance of the self-normalised estimator on the flat step edge, on the GPU, channel by channel.

Every pixel of a column of the edge is an estimate by its own shift of the lattice. Beside it the plain estimator, the
mean of w E where (22) divides by the sum of w, in float64 with the same lattice: it has no bias of its own, and the
variance of its weights.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

import profilefit
from benchmarks.planes import step_edge
from benchmarks.table import show
from mcml_sim import exact
from profilefit.fitting.sampling import LawTarget
from profilefit.laws.base import ProfileLaw
from profilefit.scenes.skin.material import translucent
from profilefit.scenes.stage.exact_law import DIFFUSE, ExactLaw
from profilefit.scenes.stage.pattern import Sampling
from profilefit.scenes.stage.reference.step_edge import LAST_XI, shifted_points, step_response
from profilefit.scenes.stage.stage import Stage

Floats = NDArray[np.float64]
SIZE = (256, 128)  # [pixels]: 19 mfp of red beside the places, 8 above and below the rows
PLACES, ROWS = 32, 32  # columns within the reach, and rows, that are judged: so many estimates a column and picture
SHORTEST = 3.0  # mean free path [pixels] of blue
CHANNELS = ("red", "green", "blue")
PLAIN_TRIALS = 768  # of each place, as many as 24 pictures have


@dataclass(frozen=True)
class Row:
    """Way to gather, by samples (n,) and channel (3,): means over places of shares of A squared [-].

    bias2  squared mean error, less what the noise of the mean adds, so that it may be below 0;  bias2_error  its
    standard error;  variance  of one estimate
    """

    label: str
    samples: tuple[int, ...]
    bias2: Floats
    bias2_error: Floats
    variance: Floats


def measured(context: moderngl.Context, samples: Sequence[int], seeds: int) -> list[Row]:
    """Measure exact and hazard, uniform and importance, on the GPU; the plain twin of the last in float64."""
    material = translucent("skin1")
    mfp = SHORTEST * np.array(material.mfp) / min(material.mfp)
    x = np.arange(PLACES) - 0.5 * (PLACES - 1)
    truth = np.stack(
        [step_response(x / length, a, setting=DIFFUSE) for a, length in zip(material.alpha, mfp, strict=True)]
    )
    laws = {"exact": ExactLaw(material.alpha), "hazard": profilefit.load("hazard", setting=DIFFUSE)}
    ways = [(name, kind, "longest") for name in laws for kind in ("uniform", "importance")]
    ways.append(("hazard", "importance", "mixture"))
    rows = []
    with Stage(context, SIZE, shadow_side=16) as stage:
        stage.upload(step_edge(SIZE, 1.0, exact.reflectance(np.array(material.alpha), DIFFUSE)))
        for name, kind, channels in ways:
            drawn = [
                _on_gpu(stage, laws[name], mfp, material.alpha, Sampling(n, kind, channels), seeds) for n in samples
            ]
            rows.append(_row(f"{name}, {kind}, {channels}", samples, drawn, truth))
    plain = [_plain(laws["hazard"], mfp, material.alpha, x, n) for n in samples]
    rows.append(_row("hazard, longest, plain", samples, plain, truth))
    return rows


def _on_gpu(stage: Stage, law, mfp: Floats, alpha: Sequence[float], sampling: Sampling, seeds: int) -> Floats:
    """Return (3, places, estimates) shares of A."""
    reflectance = exact.reflectance(np.array(alpha), DIFFUSE)
    columns = slice((SIZE[0] - PLACES) // 2, (SIZE[0] + PLACES) // 2)
    rows = slice((SIZE[1] - ROWS) // 2, (SIZE[1] + ROWS) // 2)
    found = []
    for seed in range(seeds):
        one = Sampling(sampling.samples, sampling.kind, sampling.channels, seed=seed)
        found.append(stage.scatter(law, mfp, one, fixed_alpha=alpha)[rows, columns] / reflectance)
    return np.moveaxis(np.concatenate(found).astype(float), (0, 1, 2), (2, 1, 0))


def _plain(law: ProfileLaw, mfp: Floats, alpha: Sequence[float], x: Floats, samples: int) -> Floats:
    """Return the mean of w E, radii of red: (3, places, trials)."""
    points = shifted_points(samples, PLAIN_TRIALS * len(x), 1).reshape(len(x), PLAIN_TRIALS, samples, 2)
    target, sampler = LawTarget(law), law.sampler
    own = np.asarray(sampler.sample(np.minimum(points[..., 0].ravel(), LAST_XI), alpha[0]))
    density = np.asarray(sampler.pdf(own, alpha[0])) / mfp[0]
    across = (mfp[0] * own).reshape(points.shape[:3]) * np.cos(2.0 * np.pi * points[..., 1])
    found = []
    for a, length in zip(alpha, mfp, strict=True):
        weight = np.asarray(target.density(own * mfp[0] / length, a)) / length / density
        lit = x[:, None, None] + across > 0
        found.append(np.mean(weight.reshape(lit.shape) * lit, axis=2))
    return np.array(found)


def _row(label: str, samples: Sequence[int], drawn: Sequence[Floats], truth: Floats) -> Row:
    parts = [parts_of(estimates, truth) for estimates in drawn]
    return Row(label, tuple(samples), *(np.array(values) for values in zip(*parts, strict=True)))


def parts_of(estimates: Floats, truth: Floats) -> tuple[Floats, Floats, Floats]:
    """Return bias2, its standard error and variance, by channel (3,).

    Of a place with the mean error m, known to s: m^2 - s^2 is right on average, its variance 4 M^2 s^2 + 2 s^4, where
    M is the true one; M^2 is taken to be m^2 - s^2, summed over the places and not below 0.
    """
    error = estimates.mean(axis=2) - truth
    variance = estimates.var(axis=2, ddof=1)
    s2 = variance / estimates.shape[2]
    by_bias = np.maximum(np.sum((error**2 - s2) * s2, axis=1), 0.0)
    spread = np.sqrt(4.0 * by_bias + 2.0 * np.sum(s2**2, axis=1)) / error.shape[1]
    return (error**2 - s2).mean(axis=1), spread, variance.mean(axis=1)


def report(rows: Sequence[Row]) -> None:
    """Print root mean squares: of the bias, with its standard error, and of the noise."""
    for channel, name in enumerate(CHANNELS):
        samples = rows[0].samples
        columns = ("radii", *(f"bias², noise² at {n}" for n in samples))
        cells = [
            (
                one.label,
                *(
                    f"{b[channel]:.1e} ±{e[channel]:.0e}, {v[channel]:.1e}"
                    for b, e, v in zip(one.bias2, one.bias2_error, one.variance, strict=True)
                ),
            )
            for one in rows
        ]
        show(f"Step edge, {name}: squared bias with its standard error, and variance, over A²", columns, cells)


def as_json(rows: Sequence[Row]) -> dict:
    names = ("bias2", "bias2_error", "variance")
    return {one.label: {"samples": one.samples, **{n: getattr(one, n).tolist() for n in names}} for one in rows}

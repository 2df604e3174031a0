"""Samplers: nanoseconds of a radius with its weight, against the noise and the bias of what is gathered with them.

The estimator is (22) of Liang et al., sum of w E over sum of w with w = R_d / p2, on a flat step edge. Noise: its
mean square error with 16 random points, over that with radii from the exact quantile and the same random numbers; mean
over places by the edge, then geometric mean and worst over the albedos; its spread is that of blocks of trials. The
ratio of the variances alone stands beside it in the data: a law that is too narrow has less of that. Bias: where
it tends to with the number of points, less the exact step response, as a share of A; by quadrature, without random
numbers, root mean square and worst over edges and albedos.

Every sampler is weighed by its own density. One that does not invert its law's cdf comes a second time, weighed by the
law's density instead, as shaders do. Times are those of a radius and R_d there, and of the sampler's own density where
it is not the law's: that of Liang et al. must be searched for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from jax import Array

from mcml_sim.media.arrays import Floats
from profilefit.fitting.sampling import ExactTarget, LawTarget, edge_light, sampler_quality
from profilefit.laws.base import ProfileLaw, Sampler
from profilefit.laws.hazard import Hazard
from profilefit.scenes.stage.reference import step_edge
from profilefit.scenes.stage.reference.step_edge import EdgeGather, by_law
from profilefit.studies.tradeoff import laws, stopwatch
from profilefit.studies.tradeoff.laws import SPECS, YARDSTICK, Contender, contenders, count
from profilefit.studies.tradeoff.points import Panel, Point, TradeoffPart, WithSpread
from profilefit.studies.tradeoff.stopwatch import Track

SAMPLES = 16  # of one estimate
BLOCKS = 5  # of trials: how far the variance itself is known
PLACES = np.array([-3.0, -1.0, -0.3, -0.1])  # on the dark side of the edge [l*]
APART = 1e-3  # a bias that distinguishes a sampler's density from its law's
ROUNDING = 1e-6  # share of A: what xi beyond 1 - 2^-24, never drawn, and the quadrature leave unknown
QUICKLY = (YARDSTICK, "quantile")
# Other constants of a law whose sampler is here already, or a sum of Gaussians between two others.
LIKE_OTHERS = (
    "normalized diffusion, refitted",
    "normalized diffusion, by its own mfp",
    "Liang, printed",
    "4 Gaussians",
)
COST = "time of a radius and its weight, one core, float32 [ns]"
# Name, title and axis of error of each panel.
PANELS = (
    ("noise", f"{SAMPLES} samples by a step edge", "mean square error over the exact quantile's [-]"),
    ("bias", "bias that no number of samples takes away", "error of light beyond an edge, share of A [-]"),
)


@dataclass(frozen=True)
class SamplerSizes:
    """Reduced albedos, distances of edges [l*], trials of a block; points of one timed call, of a costly law; turns."""

    alphas: tuple[float, ...] = (0.3, 0.8, 0.97)
    edges: tuple[float, ...] = (0.3, 1.0, 3.0)
    trials: int = 400
    points: int = 1_000_000
    costly: int = 20_000
    turns: int = 15


FULL, QUICK = SamplerSizes(), SamplerSizes((0.8,), (1.0,), 40, 100_000, 1000, 5)


class UniformSampler(Sampler):
    """Radii uniform up to that within which 99.5 % of the light leaves: what is drawn where no inverse is at hand."""

    law: ProfileLaw

    def farthest(self, alpha: Array) -> Array:
        """Return the radius x within which `UNIFORM_SHARE` of the light leaves [mfp]."""
        return self.law.sampler.scaled_sample(jnp.full_like(alpha, step_edge.UNIFORM_SHARE), alpha)

    def scaled_sample(self, xi: Array, alpha: Array) -> Array:
        return xi * self.farthest(alpha)

    def scaled_pdf(self, x: Array, alpha: Array) -> Array:
        last = self.farthest(alpha)
        return jnp.where(x < last, 1.0 / last, 0.0)


@dataclass(frozen=True)
class WeighedSampler:
    """Sampler with a weight: ratios of square error and variance (2, albedos, blocks), biases (albedos, edges) [A].

    searched  whether the weight takes a density that is not the law's
    """

    name: str
    owner: Contender
    noise: Floats
    bias: Floats
    searched: bool = False

    def weighed(self, xi: Array, alpha: Array) -> tuple[Array, ...]:
        """Return a radius, and what its weight is made of: what is timed."""
        x, value = self.owner.both(xi, alpha)
        return (x, value, self.owner.sampler.scaled_pdf(x, alpha)) if self.searched else (x, value)


def measure(sizes: SamplerSizes = FULL, folder: Path | None = None, track: Track = stopwatch.silent) -> TradeoffPart:
    """Time every sampler, and judge it both ways."""
    quick = sizes.trials <= QUICK.trials
    specs = [one for one in SPECS if (one.label in QUICKLY if quick else one.label not in LIKE_OTHERS)]
    contestants, left_out = contenders(folder, specs)
    hazards = [one.law for one in contestants if isinstance(one.law, Hazard) and not one.another]
    uniform = [(law, UniformSampler(law), law.shape) for law in hazards]
    contestants += [Contender("uniform radii, hazard", *each, another=True) for each in uniform]
    counted = {one.name: laws.counts(one)["both"].transcendental for one in contestants}
    timed = [one for one in contestants if counted[one.name] <= laws.TOO_MANY]
    dear = [f"left out: {one.name}: a sample takes thousands of functions" for one in contestants if one not in timed]
    judged = [way for i in track(range(len(timed)), "noise and bias") for way in ways_of(timed[i], sizes)]

    def calls(way: WeighedSampler) -> int:
        return sizes.points if count(way.weighed).transcendental <= laws.MANY else sizes.costly

    works = {one.name: laws.timed(one.weighed, False, calls(one)) for one in judged}
    rates = stopwatch.take_turns(works, sizes.turns, track, "samplers")
    points = [point for one in judged for point in points_of(one, laws.nanoseconds(rates, one.name, YARDSTICK))]
    panels = tuple(
        Panel(name, title, COST, error, tuple(p for p in points if p.panel == name)) for name, title, error in PANELS
    )
    notes = (*(f"left out: {line}" for line in left_out), *dear)
    return TradeoffPart("samplers", "Samplers: time of a radius against noise and bias", panels, notes)


def ways_of(contender: Contender, sizes: SamplerSizes) -> list[WeighedSampler]:
    """Return a sampler weighed by its own density; and by its law's, where that is another."""
    sampler = contender.sampler
    biases = np.array([[asymptotic_bias(sampler, a, edge) for edge in sizes.edges] for a in sizes.alphas])
    apart = bool(np.max(np.abs(biases[..., 1] - biases[..., 0])) >= APART)
    found = [WeighedSampler(contender.name, contender, noise_ratios(by_law, sampler, sizes), biases[..., 0], apart)]
    if apart and not isinstance(sampler, UniformSampler):
        by_own, name = noise_ratios(unweighted, sampler, sizes), f"{contender.name}, law's density"
        found.append(WeighedSampler(name, contender, by_own, biases[..., 1]))
    return found


def asymptotic_bias(sampler: Sampler, alpha: float, edge: float) -> tuple[float, float]:
    """Return light beyond an edge that infinitely many samples find, less the exact, as shares of A [-].

    With weights by the sampler's own density, and by its law's. alpha is the reduced albedo, the edge in l*.
    """
    quality = sampler_quality(sampler, alpha, edge=edge)
    of_law = edge_light(LawTarget(sampler.law), alpha, edge)
    truth = edge_light(ExactTarget(sampler.law.setting), alpha, edge)
    own = of_law * (1.0 + quality.edge_bias[0]) / (1.0 + quality.bias[0])
    by_law_density = of_law * (1.0 + quality.edge_bias_by_law_pdf[0]) / (1.0 + quality.bias_by_law_pdf[0])
    return float(own - truth), float(by_law_density - truth)


def unweighted(law: ProfileLaw, alpha: float, sampler: Sampler) -> EdgeGather:
    """Return a gather weighted by the law's own density: all weights are 1."""
    return EdgeGather(by_law(law, alpha, sampler).sample, np.ones_like)


def noise_ratios(gathered, sampler: Sampler, sizes: SamplerSizes) -> Floats:
    """Return square error by the edge and variance, over those of the exact quantile (2, m, blocks)."""
    rows = []
    for alpha in sizes.alphas:
        ways = gathered(sampler.law, alpha, sampler), step_edge.by_quantile(alpha, sampler.law.setting)
        rows.append([error_ratios(*ways, alpha, sampler.law, block, sizes.trials) for block in range(BLOCKS)])
    return np.moveaxis(np.array(rows), 2, 0)


def error_ratios(
    way: EdgeGather, over: EdgeGather, alpha: float, law: ProfileLaw, block: int, trials: int
) -> tuple[float, float]:
    """Return the mean square error and the variance of a gather at an edge, over those of another."""
    points = step_edge.random_points(SAMPLES, trials, seed=block + 1)
    mine, best = (step_edge.edge_estimate(g, points, PLACES, alpha, law.setting) for g in (way, over))
    square = np.mean(mine.rmse**2) / np.mean(best.rmse**2)
    return float(square), float(mine.variance.mean() / best.variance.mean())


def points_of(way: WeighedSampler, cost: WithSpread) -> Sequence[Point]:
    """Return a sampler's points in the panels of noise and of bias."""
    square, variance = way.noise
    worst = square[np.argmax(np.median(square, axis=1))]
    middle = np.exp(np.log(square).mean(axis=0))
    facts = {"samples": SAMPLES, "variance": float(np.exp(np.log(variance).mean()))}
    rms, largest = (
        WithSpread(float(value), max(float(value) - ROUNDING, 0.1 * ROUNDING), float(value) + ROUNDING)
        for value in (np.sqrt(np.mean(way.bias**2)), np.max(np.abs(way.bias)))
    )
    return (
        Point("noise", way.name, "", cost, WithSpread.of(middle), WithSpread.of(worst), facts),
        Point("bias", way.name, "", cost, rms, largest, facts),
    )

"""The weights of (22): their mean is 1 in every channel, and they make the law's own moments of any radii.

Even light cannot tell, for the sum of the weights divides it; nor can a law that draws its own radii, whose weights are
equal.
"""

from dataclasses import replace

import numpy as np
import pytest

from profilefit.scenes.stage.buffers import flat
from profilefit.scenes.stage.pattern import CHANNELS, KINDS, Sampling
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.step_edge import UNIFORM_SHARE, by_law
from tests.physics.scenes import edges

ALPHA, MFP = np.array([0.9, 0.8, 0.6]), np.array([3.0, 2.0, 1.5])  # 1 mm is a pixel
SIZE, MIDDLE = (96, 96), slice(32, 64)
EVERY = [(kind, channels) for kind in KINDS for channels in CHANNELS]
WRONG_WEIGHTS = [
    ("shape[c]) / mfp[c];\n        light", "shape[c]);\n        light", "longest"),
    ("drawn_density(r / mfp[c], c) / mfp[c]", "drawn_density(r / mfp[c], c)", "mixture"),
    ("return float((samples - (c - longest + 3) % 3 + 2) / 3) / float(samples);", "return 1.0 / 3.0;", "mixture"),
]
WRONG_MOMENTS = [
    ("area * r / (", "area / (", "longest"),
    ("shape[c]) / mfp[c];\n        light", "shape[longest]) / mfp[c];\n        light", "mixture"),
    ("drawn_density(r / mfp[c], c) / mfp[c]", "drawn_density(r / mfp[c], c)", "mixture"),
]


def mean_weight(context, alter, law, kind, channels):
    """Sum of the weights over the number of samples (3,), and its standard error, from 16 seeds of 4 samples."""
    alter("vec4(light / weight,", "vec4(weight / float(samples) - OWN,")
    with Stage(context, SIZE, shadow_side=16) as stage:
        stage.upload(flat(SIZE, 1.0, 1.0))
        runs = [stage.scatter(law, MFP, Sampling(4, kind, channels, seed=seed), ALPHA) for seed in range(16)]
    means = np.array(runs)[:, MIDDLE, MIDDLE].mean(axis=(1, 2), dtype=float)
    return means.mean(axis=0), means.std(axis=0, ddof=1) / 4


@pytest.mark.parametrize(("kind", "channels"), EVERY)
def test_mean_weight_is_one(context, alter, burley, sidak, kind, channels):
    """And where radii are uniform, the energy that they reach: 99.5 % of the longest channel's, more of others."""
    expected = np.ones(3)
    if kind == "uniform":
        farthest = burley.sampler.sample(UNIFORM_SHARE, ALPHA[0]) * MFP[0]
        expected = burley.cdf(farthest / MFP, ALPHA)
    mean, error = mean_weight(context, alter, burley, kind, channels)
    # t with 15 degrees of freedom: 4.4 where a normal deviate has 3.6; float32 and what 11 mfp of screen cut off: 1e-3
    assert np.all(np.abs(mean - expected) < 1.25 * sidak(3) * error + 1e-3)
    assert np.all(error < 0.01)


@pytest.mark.parametrize(("right", "wrong", "channels"), WRONG_WEIGHTS)
def test_mean_weight_tells_what_is_wrong(context, alter, burley, right, wrong, channels):
    alter(right, wrong)
    mean, _ = mean_weight(context, alter, burley, "importance", channels)
    assert np.max(np.abs(mean - 1.0)) > 0.05  # and where all is right, by as much as 0.005


def second_moment(context, law, channels, depth=None):
    """<x^2> [pixels^2] of each channel (3,) from E = x^2 where x is least, and its standard error, from 8 seeds."""
    buffers, x = edges.aslant(SIZE, 1.0, 1.0, 0.0, depth)
    light = np.broadcast_to((x**2)[..., None], (*x.shape, 3)).astype(np.float32)
    with Stage(context, SIZE, shadow_side=16) as stage:
        stage.upload(replace(buffers, irradiance=light))
        runs = [stage.scatter(law, MFP, Sampling(256, "importance", channels, seed=seed), ALPHA) for seed in range(8)]
    means = np.array(runs)[:, MIDDLE, 47:49].mean(axis=(1, 2), dtype=float) - 0.25
    return means.mean(axis=0), means.std(axis=0, ddof=1) / np.sqrt(8)


@pytest.fixture(scope="module")
def own_moment(burley):
    """The same of the law (3,), in float64: x in whole pixels, as the light of a pixel is one."""
    xi, angle = np.meshgrid((np.arange(4000) + 0.5) / 4000, (np.arange(256) + 0.5) / 256 * 2 * np.pi, indexing="ij")
    found = []
    for alpha, mfp in zip(ALPHA, MFP, strict=True):
        gather = by_law(burley, alpha)
        r = gather.sample(xi[:, 0])
        x = np.round(mfp * r[:, None] * np.cos(angle))
        found.append(np.average(np.mean(x**2, axis=1), weights=gather.weight(r)))
    return np.array(found)


@pytest.mark.slow
@pytest.mark.parametrize("depth", [None, 150.0])
@pytest.mark.parametrize("channels", CHANNELS)
def test_second_moment_is_the_law_s_own(context, burley, own_moment, sidak, channels, depth):
    """Of three laws by radii of one or of all; the ratio of two sums has a bias of order 1/n: below 1 % at n = 256."""
    found, error = second_moment(context, burley, channels, depth)
    # t with 7 degrees of freedom: 5.9 where a normal deviate has 3.6
    assert np.all(np.abs(found - own_moment) < 1.65 * sidak(3) * error + 0.01 * own_moment)
    assert np.all(error < 0.01 * own_moment)


@pytest.mark.slow
@pytest.mark.parametrize(("right", "wrong", "channels"), WRONG_MOMENTS)
def test_second_moment_tells_what_is_wrong(context, alter, burley, own_moment, right, wrong, channels):
    alter(right, wrong)
    found, _ = second_moment(context, burley, channels)
    assert np.max(np.abs(found / own_moment - 1.0)) > 0.15  # where all is right, 0.0075

"""The estimator: what it conserves, what it guards against, and that its mean is the integral."""

from dataclasses import replace

import numpy as np
import pytest

from mcml_sim import exact
from profilefit.errors import InputError
from profilefit.scenes.skin.passes import SeparableFilter
from profilefit.scenes.stage.buffers import flat, step_edge
from profilefit.scenes.stage.exact_law import ExactLaw
from profilefit.scenes.stage.pattern import CHANNELS, KINDS, Sampling
from profilefit.scenes.stage.stage import Stage
from tests.physics.scenes import edges

ALPHA = 0.8
A = exact.reflectance(ALPHA, edges.DIFFUSE)
SKIN = (0.95, 0.84, 0.68), (4.0, 3.0, 2.5)  # alpha, mfp [pixels]
EVERY = [(kind, channels) for kind in KINDS for channels in CHANNELS]


@pytest.fixture
def small(context):
    """24 x 24 pixels."""
    with Stage(context, (24, 24), shadow_side=16) as stage:
        yield stage


@pytest.mark.parametrize(("kind", "channels"), EVERY)
@pytest.mark.parametrize("samples", [1, 2, 64])
def test_even_light_is_conserved(small, burley, kind, channels, samples):
    """At A = 0, 1/2 and 1, at the borders too, where radii up to 1e7 mfp leave the screen; white where it is lit."""
    reflectance = np.array([0.0, 0.5, 1.0])
    small.upload(flat((24, 24), 1.0, reflectance))
    light = small.scatter(burley, 3.0, Sampling(samples, kind, channels))
    np.testing.assert_allclose(light, np.broadcast_to(reflectance, light.shape), atol=1e-5)
    small.upload(step_edge((24, 24), 1.0, reflectance))
    assert np.ptp(small.scatter(burley, 3.0, Sampling(samples, kind, channels))[..., 2]) > 0.5


@pytest.mark.parametrize("samples", [1, 4, 64])
def test_a_pixel_alone_is_lambert(small, burley, samples):
    """All samples fall on pixels that do not count: the sum of weights is that of the pixel itself."""
    mask = np.zeros((24, 24), np.float32)
    mask[12, 12] = 1.0
    bright = flat((24, 24), 1.0, 0.5, irradiance=np.where(mask == 1, 1.0, 100.0)[..., None])
    small.upload(replace(bright, mask=mask))
    light = small.scatter(burley, 8.0, Sampling(samples))
    np.testing.assert_allclose(light[12, 12], 0.5, rtol=1e-5)
    np.testing.assert_allclose(light[0, 0], 50.0)  # off the mask nothing scatters


@pytest.mark.slow
@pytest.mark.parametrize("law", ["burley", SeparableFilter()], ids=["burley", "separable"])
@pytest.mark.parametrize(("gap", "bleeds"), [(50.0, False), (0.2, True)])
def test_light_does_not_cross_a_gap(stage, burley, law, gap, bleeds):
    """A dark plane before or behind a bright one, `gap` mfp away."""
    edge = step_edge((128, 128), 1.0, 0.8)
    for side in (-1.0, 1.0):
        position = edge.position.copy()
        position[:, 64:, 2] += side * gap * 4.0
        stage.upload(replace(edge, position=position))
        for samples in (4, 64):
            light = stage.scatter(burley if law == "burley" else law, 4.0, Sampling(samples, channels="mixture"))
            assert (light[:, :64].max() > 0.1) == bleeds
            assert bleeds or light[:, :64].max() < 2e-3


def test_channels_and_kinds_agree_in_the_mean(small, burley, sidak):
    """Three albedos and lengths: every way to draw radii has the same expectation, to the ratio's bias of 1/n."""
    fixed_alpha, mfp = SKIN
    small.upload(step_edge((24, 24), 1.0, 1.0))

    def columns(kind, channels):
        runs = [small.scatter(burley, mfp, Sampling(128, kind, channels, seed=seed), fixed_alpha) for seed in range(8)]
        return np.mean(np.array(runs)[:, 8:16, 4:20], axis=1)

    base = columns("importance", "mixture")
    for kind, channels in EVERY:
        other = columns(kind, channels)
        error = np.sqrt((base.var(axis=0, ddof=1) + other.var(axis=0, ddof=1)) / 8)
        cut = 0.005 if kind == "uniform" else 0.002  # uniform radii end at 99.5 % of the energy
        assert np.all(np.abs(base.mean(axis=0) - other.mean(axis=0)) < 2 * sidak(48) * error + cut), (kind, channels)


def test_blue_noise_is_finer_than_white(stage, burley):
    """Of the mean over 4 x 4 pixels, 0.79 is left, measured with 16 seeds; of a single pixel, all."""
    stage.upload(step_edge((128, 128), 1.0, 1.0))

    def noise(kind, side):
        runs = [stage.scatter(burley, 6.0, Sampling(16, kind, seed=seed))[:, 56:72, 0] for seed in range(4)]
        blocks = np.array(runs).reshape(-1, 128 // side, side, 16 // side, side).mean(axis=(2, 4))
        return (blocks - blocks.mean(axis=(0, 1))).std()

    assert noise("importance blue", 4) < 0.9 * noise("importance", 4)
    assert noise("importance blue", 1) > 0.95 * noise("importance", 1)


def test_reflectance_sets_alpha(small, burley):
    """A pixel's own A picks its albedo, unless one is given; a brighter medium blurs further."""
    edge = step_edge((24, 24), 1.0, A)
    small.upload(edge)
    by_reflectance = small.scatter(burley, 4.0, Sampling(64))
    alpha = float(burley.albedo.alpha(A))
    np.testing.assert_allclose(by_reflectance, small.scatter(burley, 4.0, Sampling(64), alpha), atol=1e-4)
    assert np.abs(by_reflectance - small.scatter(burley, 4.0, Sampling(64), 0.99)).max() > 0.02


def test_bad_options_are_named():
    with pytest.raises(InputError, match=r"samples must be a whole number >= 1 and <= 256, got 257"):
        Sampling(257)
    with pytest.raises(InputError, match="kind must be one of uniform, importance, importance blue, got 'blue'"):
        Sampling(kind="blue")
    with pytest.raises(InputError, match="channels must be one of longest, mixture, got 'all'"):
        Sampling(channels="all")
    with pytest.raises(InputError, match="area must be True or False, got 1"):
        Sampling(area=1)
    with pytest.raises(InputError, match=r"alpha must be 1 ... 16 albedos in \(0, 1\], got \(0.0,\)"):
        ExactLaw((0.0,))
    with pytest.raises(InputError, match=r"even number of columns.* got 5"):
        step_edge((5, 4), 1.0, 0.5)

"""Both parts of a kernel and their balance: light is counted once; random scenes, and a balance found again."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import heart_trials as trials
from benchmarks.heart_fit import SplitLight, errors, fitted
from mcml_sim import Setting
from profilefit.laws.gaussians import MediumGaussians
from profilefit.scenes.heart import crossover_of
from profilefit.scenes.heart.atlas import BLURRED, Atlas
from profilefit.scenes.heart.law import Kernel
from profilefit.scenes.heart.meshes import ball, bumps, heart
from profilefit.scenes.heart.passes import ATLAS, SCREEN, Balanced, gather_of, kernel_of
from profilefit.scenes.heart.truth import surface_blur
from profilefit.scenes.stage.pattern import Sampling
from profilefit.scenes.stage.reference.surface import sees, world
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.world import Camera, Light, Part, Scene
from tests.unit.scenes.scenes import refused

WEIGHTS = np.stack([[0.2, 0.5, 0.3], [0.3, 0.5, 0.2], [0.5, 0.3, 0.2]], axis=1)
KERNEL = Kernel(np.array([0.1, 0.8, 5.0]), WEIGHTS)
COLOUR = np.array([0.8, 0.6, 0.3], np.float32)
SAMPLES, UNITS = Sampling(64), (1.0, 1.0, 1.0)
STAGE = (64, 64), 512
NARROWER = Kernel(np.array([0.04, 0.5, 4.0]), WEIGHTS)
WHITE = np.ones((1, 1, 3), np.float32)


def drawn(stage, mesh, camera, light=(1.0, 1.0, 1.0), ambient=(0.0, 0.0, 0.0)):
    part = Part(mesh, np.broadcast_to(COLOUR, (2, 2, 3)).copy())
    stage.draw(Scene((part,), Light((-0.6, 0.3, 0.74), light), ambient, camera))
    return part


@pytest.mark.parametrize("crossover", [0.0, 0.5, 2.0, 99.0])
@pytest.mark.parametrize("threshold", [ATLAS, 0.9, SCREEN])
def test_a_furnace(stage, crossover, threshold):
    """Even light on a ball comes back as its colour, over seam and pole, whatever takes which part."""
    part = drawn(stage, ball(8.0), Camera((0.0, 500.0, 300.0), height=20.0), (0.0,) * 3, (1.0, 1.0, 1.0))
    with Atlas(stage.context, (120, 72), 12) as atlas:
        atlas.draw(stage, part)
        found = stage.scatter(Balanced.of(atlas, part, KERNEL, crossover, threshold, UNITS), 1.0, SAMPLES)
    inside = stage.buffers().mask > 0.5
    np.testing.assert_allclose(found[inside], np.broadcast_to(COLOUR, found[inside].shape), rtol=2e-5)
    assert inside.mean() > 0.3


def test_ends_are_one_method_alone(stage):
    part = drawn(stage, bumps(10.0, 2.0, 24.0), Camera((300.0, 0.0, 400.0), height=12.0))
    with Atlas(stage.context, (112, 112), 16) as atlas:
        atlas.draw(stage, part)
        screen = stage.scatter(gather_of(KERNEL, UNITS), 1.0, SAMPLES) * stage.buffers().reflectance
        alone, texture, seen, both = (
            stage.scatter(Balanced.of(atlas, part, KERNEL, *ends, UNITS), 1.0, SAMPLES)
            for ends in ((99.0, ATLAS), (0.0, ATLAS), (0.0, SCREEN), (0.6, ATLAS))
        )
    np.testing.assert_allclose(alone, screen, atol=1e-6)
    assert np.max(np.abs(texture - screen)) > 0.02
    np.testing.assert_allclose(seen, screen, atol=1e-6)  # all is far, and from the screen
    assert np.max(np.abs(both - screen)) > 0.003 < np.max(np.abs(both - texture))


def test_hidden_light_comes_from_the_atlas(stage):
    """On bumps seen aslant the screen misses what lies behind them: atlas and split are nearer to the truth."""
    camera = Camera((450.0, 0.0, 370.0), height=8.0)
    part = drawn(stage, bumps(10.0, 2.0, 24.0), camera)
    with Atlas(stage.context, (160, 160), 20) as atlas:
        atlas.draw(stage, part)
        place, stretch, light = (atlas.read(name) for name in ("position_map", "stretch_map", "irradiance_map"))
        inside = place[..., 3] > 0.5
        surface = place[inside][:, :3], np.prod(stretch[inside][:, :2], axis=1), light[inside][:, :3]
        buffers = stage.buffers()
        chosen = tuple(np.argwhere(buffers.mask > 0.5)[::37].T)
        at = world(buffers, camera)[chosen]
        wide = Kernel(np.array([0.1, 5.0]), np.repeat([[0.3], [0.7]], 3, axis=1))
        known = surface_blur(*surface, wide.variances, wide.weights, at=at)

        def rms(crossover, threshold):
            by = Balanced.of(atlas, part, wide, crossover, threshold, UNITS)
            found = stage.scatter(by, 1.0, Sampling(256))[chosen] / COLOUR
            return float(np.sqrt(np.mean((found - known) ** 2)))

        screen, texture, both = rms(99.0, ATLAS), rms(0.0, ATLAS), rms(1.0, 0.97)
    assert both < 0.7 * screen
    assert both < 1.3 * texture


def test_a_kernel_of_sums_that_share_their_variances():
    units = (0.5, 2.0)
    sums = [
        MediumGaussians(Setting(), 0.3, (0.4 / u**2, 3.0 / u**2), (w, 1.0 - w))
        for u, w in zip(units, (0.2, 0.7), strict=True)
    ]
    kernel = kernel_of(sums, units)
    np.testing.assert_allclose(kernel.variances, [0.4, 3.0])
    np.testing.assert_allclose(kernel.weights, [[0.2, 0.7], [0.8, 0.3]])
    np.testing.assert_allclose(kernel.energy, 1.0)


@pytest.mark.slow
def test_a_trial_is_what_the_passes_draw(context):
    """Near, far and atlas of each split are put together to the picture of the technique itself."""
    (trial,) = trials.drawn([NARROWER], 1, 5)
    found = trials.measured(context, trial)
    side = round(trial.camera.height / found.pixel)
    size, margin = trials.atlas_size(trial.mesh, trial.texel, trials.LARGEST)
    part = Part(trial.mesh, WHITE)
    scene = Scene((part,), Light(trial.lamp, (trials.LIGHT,) * 3), (trials.AMBIENT,) * 3, trial.camera)
    with Stage(context, (side, side), trials.SHADOWS) as stage, Atlas(context, size, margin) as atlas:
        stage.draw(scene)
        picture = stage.scatter(Balanced.of(atlas, part, NARROWER, 0.5, 0.9), 1.0, Sampling(trials.SAMPLES))
        inside = stage.buffers().mask > 0.5
    assert trial.stripes == 0
    chosen = trials._chosen(trial, inside, np.zeros((*inside.shape, 3)))
    np.testing.assert_allclose(found.light(0.5, 0.9), picture[chosen], atol=2e-5)
    assert found.rms(found.light(0.5, 0.9)) < found.rms(found.lambert)


def test_a_heart_of_six_charts_is_a_furnace(context):
    """Even light stays even over its seams, and they are no steps for the light of a lamp."""
    part = Part(heart(8.0, 24), WHITE)
    size, margin = trials.atlas_size(part.mesh, 0.3, 150)
    with Stage(context, (16, 16), 64) as stage, Atlas(context, size, min(margin, 4)) as atlas:
        scene = Scene((part,), ambient=(0.5,) * 3, camera=Camera(height=40.0), light=Light(irradiance=(0.0,) * 3))
        stage.draw(replace(scene, has_occlusion=False))  # else the heart is in its own way
        atlas.draw(stage, part)
        atlas.blur(NARROWER)
        found = atlas.read(BLURRED)
        inside = atlas.read("position_map")[..., 3] > 0.5
    assert np.count_nonzero(inside) > 3000
    np.testing.assert_allclose(found[inside][:, :3], 0.5, atol=1e-5)


def test_an_atlas_has_the_sky_of_the_screen(context):
    """As much of it as the screen has where that shows a texel, and all of it elsewhere."""
    part = Part(heart(8.0, 24), WHITE)
    size, margin = trials.atlas_size(part.mesh, 0.3, 150)
    with Stage(context, (64, 64), 64) as stage, Atlas(context, size, min(margin, 4)) as atlas:
        camera = Camera(height=24.0)
        stage.draw(Scene((part,), ambient=(0.5,) * 3, camera=camera, light=Light(irradiance=(0.0,) * 3)))
        atlas.draw(stage, part)
        place, light = (atlas.read(name).astype(float) for name in ("position_map", "irradiance_map"))
        buffers = stage.buffers()
    inside = place[..., 3] > 0.5
    shown = sees(buffers, camera, place[inside][:, :3])
    share, screen = light[inside][:, 0] / 0.5, buffers.irradiance[buffers.mask > 0.5][:, 0] / 0.5
    assert 0.2 < shown.mean() < 0.8
    np.testing.assert_allclose(share[~shown].mean(), 1.0, atol=1e-3)
    assert screen.min() < 0.95
    assert abs(share[shown].min() - screen.min()) < 0.02
    assert share[~shown].mean() > share[shown].mean() + 1e-3


def test_an_atlas_of_the_side_asked_for(context):
    part = Part(heart(8.0, 24), WHITE)
    size, margin = trials.atlas_size(part.mesh, 0.4, 400)
    with Stage(context, (16, 16), 64) as stage, Atlas(context, size, margin) as atlas:
        stage.draw(Scene((part,)))
        atlas.draw(stage, part)
        assert atlas.texel == pytest.approx(0.4, rel=0.1)


def test_trials_are_those_of_their_seed():
    one, again, other = (trials.drawn([NARROWER], 3, seed) for seed in (1, 1, 2))
    assert [(a.size, a.lamp, a.texel) for a in one] == [(a.size, a.lamp, a.texel) for a in again]
    assert one[0].size != other[0].size


def test_a_balance_is_found_again():
    """Scenes whose light is right at one split only: the constant is that of the split, and its refits say so."""
    random = np.random.default_rng(3)
    sigma = np.geomspace(0.02, 5.0, 24)
    scenes = []
    for _ in range(20):
        texel, pixel = random.uniform(0.2, 0.6), random.uniform(0.1, 0.3)
        right = np.count_nonzero(sigma < crossover_of(texel, pixel, 0.8))
        off = 0.01 * (1.0 + np.abs(np.arange(25) - right))[:, None, None] * np.ones((25, 6, 3))
        ones, light = np.ones((6, 3)), (0 * off, 2.0 + off, 1.0 + off, np.ones((25, 6)))
        scenes.append(SplitLight(ones, ones, *light, ones[:, 0], texel, pixel, sigma, 0 * ones, np.inf))
    best, refits = fitted(errors(scenes))
    assert best.constant == pytest.approx(0.8, rel=0.1)
    assert best.threshold > 1.0  # the screen's far light is wrong everywhere
    assert np.ptp(refits[:, 0]) < 0.2


def test_a_blend_in_hindsight():
    """Truth that is a blend is found; by the angle alone it is not."""
    random = np.random.default_rng(2)
    texture, screen = random.random((2, 50, 3))
    facing, ones = random.random(50), np.ones((50, 3))
    truth = texture + (0.2 + 0.5 * facing)[:, None] * (screen - texture)
    far, atlas = np.stack([screen] * 5), np.stack([texture] * 5)
    one = SplitLight(truth, ones, 0 * far, far, atlas, np.ones((5, 50)), facing, 0.1, 0.1, np.ones(4), 0 * ones, np.inf)
    assert one.rms(one.blended(np.ones(50), facing)) < 1e-12
    assert 0.01 < one.rms(one.blended(np.ones(50))) < one.rms(texture)


def test_the_crossover():
    assert crossover_of(0.4, 0.1, 0.5) == pytest.approx(0.4)
    refused(r"texel and pixel must be lengths > 0, got 0\.4 and nan", crossover_of, 0.4, np.nan)

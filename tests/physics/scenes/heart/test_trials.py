"""Random scenes: what is kept of them is what the passes draw, a balance is found again; a heart of six charts."""

import numpy as np
import pytest

from benchmarks import heart_trials as trials
from benchmarks.heart_fit import SplitLight, errors, fitted
from profilefit.errors import InputError
from profilefit.scenes.heart import crossover_of
from profilefit.scenes.heart.atlas import BLURRED, Atlas
from profilefit.scenes.heart.law import Kernel
from profilefit.scenes.heart.meshes import heart
from profilefit.scenes.heart.passes import Balanced
from profilefit.scenes.stage.pattern import Sampling
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.world import Camera, Light, Part, Scene

WEIGHTS = np.stack([[0.2, 0.5, 0.3], [0.3, 0.5, 0.2], [0.5, 0.3, 0.2]], axis=1)
KERNEL = Kernel(np.array([0.04, 0.5, 4.0]), WEIGHTS)


@pytest.mark.slow
def test_a_trial_is_what_the_passes_draw(context):
    """Near, far and atlas of each split are put together to the picture of the technique itself."""
    (trial,) = trials.drawn([KERNEL], 1, 5)
    found = trials.measured(context, trial)
    mesh, camera = trial.mesh, trial.camera
    side = round(camera.height / found.pixel)
    size, margin = trials.atlas_size(mesh, trial.texel, trials.LARGEST)
    part = Part(mesh, np.ones((1, 1, 3), np.float32))
    scene = Scene((part,), Light(trial.lamp, (trials.LIGHT,) * 3), (trials.AMBIENT,) * 3, camera)
    with Stage(context, (side, side), trials.SHADOWS) as stage, Atlas(context, size, margin) as atlas:
        stage.draw(scene)
        by = Balanced.of(atlas, part, KERNEL, 0.5, 0.9)
        picture = stage.scatter(by, 1.0, Sampling(trials.SAMPLES))
        inside = stage.buffers().mask > 0.5
    assert trial.stripes == 0
    chosen = trials._chosen(trial, inside, np.zeros((*inside.shape, 3)))
    np.testing.assert_allclose(found.light(0.5, 0.9), picture[chosen], atol=2e-5)
    assert found.rms(found.light(0.5, 0.9)) < found.rms(found.lambert)


def test_a_heart_of_six_charts_is_a_furnace(context):
    """Even light stays even over its seams, and they are no steps for the light of a lamp."""
    part = Part(heart(8.0, 24), np.ones((1, 1, 3), np.float32))
    size, margin = trials.atlas_size(part.mesh, 0.3, 150)
    with Stage(context, (16, 16), 64) as stage, Atlas(context, size, min(margin, 4)) as atlas:
        stage.draw(Scene((part,), ambient=(0.5,) * 3, camera=Camera(height=40.0), light=Light(irradiance=(0.0,) * 3)))
        atlas.draw(stage, part)
        atlas.blur(KERNEL)
        found = atlas.read(BLURRED)
        inside = atlas.read("position_map")[..., 3] > 0.5
    assert np.count_nonzero(inside) > 3000
    np.testing.assert_allclose(found[inside][:, :3], 0.5, atol=1e-5)


def test_an_atlas_of_the_side_asked_for(context):
    part = Part(heart(8.0, 24), np.ones((1, 1, 3), np.float32))
    size, margin = trials.atlas_size(part.mesh, 0.4, 400)
    with Stage(context, (16, 16), 64) as stage, Atlas(context, size, margin) as atlas:
        stage.draw(Scene((part,)))
        atlas.draw(stage, part)
        assert atlas.texel == pytest.approx(0.4, rel=0.1)


def test_trials_are_those_of_their_seed():
    one, again, other = (trials.drawn([KERNEL], 3, seed) for seed in (1, 1, 2))
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
        ones, none = np.ones((6, 3)), np.zeros((25, 6, 3))
        scenes.append(
            SplitLight(
                ones,
                ones,
                none,
                2.0 + off,
                1.0 + off,
                np.ones((25, 6)),
                ones[:, 0],
                texel,
                pixel,
                sigma,
                0 * ones,
                np.inf,
            )
        )
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
    with pytest.raises(InputError, match=r"texel and pixel must be lengths > 0, got 0\.4 and nan"):
        crossover_of(0.4, np.nan)

"""Random scenes: what is kept of them is what the passes draw; a heart of six charts."""

import numpy as np
import pytest

from benchmarks import heart_trials as trials
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

"""Both parts of a kernel and their balance: light is counted once, and each end is one method alone."""

import numpy as np
import pytest

from mcml_sim import Setting
from profilefit.laws.gaussians import MediumGaussians
from profilefit.scenes.heart.atlas import Atlas
from profilefit.scenes.heart.law import Kernel
from profilefit.scenes.heart.meshes import ball, bumps
from profilefit.scenes.heart.passes import ATLAS, SCREEN, Balanced, gather_of, kernel_of
from profilefit.scenes.heart.truth import surface_blur
from profilefit.scenes.stage.pattern import Sampling
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.world import Camera, Light, Part, Scene

WEIGHTS = np.stack([[0.2, 0.5, 0.3], [0.3, 0.5, 0.2], [0.5, 0.3, 0.2]], axis=1)
KERNEL = Kernel(np.array([0.1, 0.8, 5.0]), WEIGHTS)
COLOUR = np.array([0.8, 0.6, 0.3], np.float32)
SAMPLES, UNITS = Sampling(64), (1.0, 1.0, 1.0)


@pytest.fixture
def stage(context):
    with Stage(context, (64, 64), shadow_side=512) as stage:
        yield stage


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
        alone = stage.scatter(Balanced.of(atlas, part, KERNEL, 99.0, ATLAS, UNITS), 1.0, SAMPLES)
        np.testing.assert_allclose(alone, screen, atol=1e-6)
        texture = stage.scatter(Balanced.of(atlas, part, KERNEL, 0.0, ATLAS, UNITS), 1.0, SAMPLES)
        assert np.max(np.abs(texture - screen)) > 0.02
        seen = stage.scatter(Balanced.of(atlas, part, KERNEL, 0.0, SCREEN, UNITS), 1.0, SAMPLES)
        np.testing.assert_allclose(seen, screen, atol=1e-6)  # all is far, and from the screen
        both = stage.scatter(Balanced.of(atlas, part, KERNEL, 0.6, ATLAS, UNITS), 1.0, SAMPLES)
        assert np.max(np.abs(both - screen)) > 0.003 < np.max(np.abs(both - texture))


def test_hidden_light_comes_from_the_atlas(stage):
    """On bumps seen aslant the screen misses what lies behind them: atlas and split are nearer to the truth."""
    camera = Camera((450.0, 0.0, 370.0), height=8.0)
    part = drawn(stage, bumps(10.0, 2.0, 24.0), camera)
    with Atlas(stage.context, (160, 160), 20) as atlas:
        atlas.draw(stage, part)
        place, stretch, light = (atlas.read(name) for name in ("position_map", "stretch_map", "irradiance_map"))
        inside = place[..., 3] > 0.5
        areas = (stretch[..., 0] * stretch[..., 1])[inside]
        buffers = stage.buffers()
        chosen = np.argwhere(buffers.mask > 0.5)[::37]
        view = camera.view()
        at = (buffers.position[tuple(chosen.T)].astype(float) - view[:3, 3]) @ view[:3, :3]
        wide = Kernel(np.array([0.1, 5.0]), np.repeat([[0.3], [0.7]], 3, axis=1))
        known = surface_blur(place[inside][:, :3], areas, light[inside][:, :3], wide.variances, wide.weights, at=at)

        def rms(crossover, threshold):
            found = (
                stage.scatter(Balanced.of(atlas, part, wide, crossover, threshold, UNITS), 1.0, Sampling(256)) / COLOUR
            )
            return float(np.sqrt(np.mean((found[tuple(chosen.T)] - known) ** 2)))

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

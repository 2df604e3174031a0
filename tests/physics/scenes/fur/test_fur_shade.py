"""Radiance of hits in OpenGL against the same, written out in float64; lobes' energy; and where gamma belongs."""

import numpy as np
import pytest

from benchmarks.fur_feet import shared_shadow
from profilefit.scenes.fur.ball import NOTHING, SKIN, FurView, random_ball
from profilefit.scenes.fur.law import lobe_mean, occlusion, shadow
from profilefit.scenes.fur.passes import BACKGROUND, HITS, Coat, Shading
from profilefit.scenes.stage.renderer import Renderer
from profilefit.scenes.stage.world import Camera, Light
from tests.fixtures import slow

SIZE = 20, 15
DENSITY, RADIUS, LENGTH, FORCE = 0.5, 0.5, 4.0, (0.1, -0.3, 0.2)
COLOUR, BARE, AMBIENT = (0.55, 0.38, 0.22), (0.35, 0.22, 0.16), (0.2, 0.25, 0.3)
LIGHT = Light((-0.7, 0.3, 0.6), (3.0, 2.8, 2.5))


def drawn(context, shading, hits, view):
    ball = random_ball(50, 10.0, RADIUS, LENGTH, FORCE, 3)
    coat = Coat(ball, DENSITY, COLOUR, BARE, LIGHT, AMBIENT, shading)
    with Renderer(context, SIZE) as renderer:
        renderer.write(HITS, hits)
        return renderer.image(coat.shade(view))[..., :3].astype(float)


def written_out(shading, hit, to_eye):
    """Of one hit: diffuse in the fur's shadow, even light as far as it is open, rim, and two lobes."""
    if hit[3] == NOTHING:
        return np.array(BACKGROUND)
    n, z, force = hit[:3], max(hit[3], 0.0), np.array(FORCE)
    to_light = np.array(LIGHT.direction) / np.linalg.norm(LIGHT.direction)
    lean = (force - n * (force @ n)) / (1.0 + force @ n)
    tall = LENGTH * (1.0 + force @ n)
    onto = n @ to_light
    lit = 0.0
    if onto > 0:
        lamp, eye = ((one - n * (n @ one)) / max(n @ one, 1e-4) - lean for one in (to_light, to_eye))
        turn = np.arccos(np.clip(lamp @ eye / np.linalg.norm(lamp) / np.linalg.norm(eye), -1.0, 1.0))
        angles = (float(np.arctan(np.linalg.norm(one))) for one in (eye, lamp))
        own = shadow(RADIUS, tall, np.arctan(np.linalg.norm(lamp)))
        lit = np.exp(-DENSITY * (1.0 - z) ** 2 * (own - shared_shadow(RADIUS, tall, *angles, float(turn))))
    open_ = occlusion(DENSITY, RADIUS, LENGTH, z * LENGTH, float(np.linalg.norm(lean)))
    colour = np.array(BARE if hit[3] == SKIN else COLOUR)
    bias, scale, power = shading.rim
    edge = min(max(bias + scale * (1.0 - max(n @ to_eye, 0.0)) ** power, 0.0), 1.0)
    seen = colour / np.pi * (np.array(LIGHT.irradiance) * max(onto, 0.0) * lit + np.array(AMBIENT) * open_)
    seen += edge * open_ * np.array(AMBIENT) / np.pi
    if hit[3] >= 0:
        axis, half = n + force, to_eye + to_light
        angle = np.arccos(axis @ half / np.linalg.norm(axis) / np.linalg.norm(half))
        for p, shift, strength, tint in zip(
            shading.exponents, shading.shifts, shading.strengths, (np.ones(3), np.array(COLOUR)), strict=True
        ):
            peak = strength / lobe_mean(p) / (4.0 * np.pi) if shading.normalised else strength
            seen += lit * np.array(LIGHT.irradiance) * tint * peak * abs(np.sin(angle - np.arctan(shift))) ** p
    return seen


@pytest.mark.parametrize("normalised", [True, *slow(False)])
def test_the_shader_says_what_is_written_out(context, normalised):
    shading = Shading(rim=(0.1, 0.6, 3.0), normalised=normalised)
    view = FurView.of(Camera((0.0, 0.0, 100.0), (0.0, 0.0, 0.0), 32.0), SIZE)
    rng = np.random.default_rng(6)
    up = rng.normal(size=(*SIZE[::-1], 3))
    up[..., 2] = np.abs(up[..., 2])
    to_light = np.array(LIGHT.direction) / np.linalg.norm(LIGHT.direction)
    up[0] = to_light * rng.uniform(0.5, 1.0, (SIZE[0], 1)) + 0.2 * up[0]  # the lamp at one's back
    height = rng.random(SIZE[::-1])
    height[1], height[2] = SKIN, NOTHING
    hits = np.concatenate([up / np.linalg.norm(up, axis=-1, keepdims=True), height[..., None]], axis=-1)
    found = drawn(context, shading, hits, view)
    _, way = view.rays(SIZE)
    expected = np.array(
        [[written_out(shading, *pair) for pair in zip(*row, strict=True)] for row in zip(hits, -way, strict=True)]
    )
    # The table of occlusion is linear between its 64 heights and 12 leans.
    np.testing.assert_allclose(found, expected, atol=2e-3 * expected.max(), rtol=2e-3)
    assert expected.std() > 0.2 * expected.mean()
    other = drawn(context, Shading(rim=shading.rim, normalised=not normalised), hits, view)
    assert np.abs(other - expected).max() > 0.02 * expected.max()


def test_a_lobe_is_as_bright_at_every_exponent():
    """Its mean over directions, drawn evenly over the sphere; as published it falls as the root of the exponent."""
    cosine = np.random.default_rng(3).uniform(-1.0, 1.0, 400_000)
    for p in (0.0, 4.0, 60.0, 400.0):
        lobe = (1.0 - cosine**2) ** (0.5 * p)
        assert abs(lobe.mean() - lobe_mean(p)) < 4.0 * lobe.std() / cosine.size**0.5 + 1e-12
    assert lobe_mean(400.0) == pytest.approx(lobe_mean(100.0) / 2.0, rel=0.01)


@pytest.mark.slow
def test_rays_are_averaged_before_they_are_encoded(context):
    """The picture is the mean of linear radiance: one of encoded rays is darker where a pixel has contrast."""
    from profilefit.scenes.fur import scene
    from profilefit.scenes.stage.picture import srgb_codes, to_srgb

    small = {"scene": "fur", "camera": {"resolution": [24, 18]}, "technique": {"supersampling": 4}}
    with scene.reference_render(context, scene.read("fur.toml", small)) as found:
        judge, white = found.judge, found.judge.exposure
        once = srgb_codes(white * judge.reference)
        each = scene.averaged(srgb_codes(white * found.fine), 4)
        assert np.all(each <= once + 1e-6)
        assert np.mean((once - each)[judge.mask]) > 2.0
        np.testing.assert_array_equal(to_srgb(judge.reference, white), np.round(once))

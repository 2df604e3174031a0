"""The four passes together: light, shadow, thickness, what is seen where; and what a G-buffer must be."""

from dataclasses import replace

import moderngl
import numpy as np
import pytest

from benchmarks.planes import flat, step_edge
from profilefit.scenes.skin.chart import covered, covering
from profilefit.scenes.skin.passes import SeparableFilter
from profilefit.scenes.skin.scene import head_scene
from profilefit.scenes.stage.judge import srgb_codes, to_srgb
from profilefit.scenes.stage.pattern import Sampling
from profilefit.scenes.stage.reference.surface import world
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.technique import EXITANCE, RADIANCE
from profilefit.scenes.stage.world import NUMBERS, SURFACE, VECTORS, Camera
from tests.unit.scenes.scenes import RADIUS, ball, refused, scene

SIZE = 64, 48
STAGE = SIZE, 512


@pytest.mark.parametrize("kind", ["orthographic", "perspective"])
def test_ball_is_seen_where_it_is(stage, kind):
    """Position and normal are those of a ball, the right way up; a pixel's ray goes through its point."""
    stage.draw(scene((0.0, 1.0, 0.0), kind=kind))
    seen = stage.buffers()
    inside = seen.mask > 0.5
    from_centre = seen.position[inside] + np.array([0.0, 0.0, 100.0])
    np.testing.assert_allclose(np.linalg.norm(from_centre, axis=1), RADIUS, atol=0.03)  # facets
    np.testing.assert_allclose(seen.normal[inside], from_centre / RADIUS, atol=0.02)
    depth = -seen.position[..., 2] if kind == "perspective" else 1.0
    x = (np.arange(SIZE[0]) + 0.5 - SIZE[0] / 2) * seen.pixel * depth
    np.testing.assert_allclose(seen.position[..., 0][inside], np.broadcast_to(x, inside.shape)[inside], atol=1e-3)
    assert seen.irradiance[34:, :, 0].sum() > 2 * seen.irradiance[:14, :, 0].sum()  # lit from above, row 0 below
    np.testing.assert_allclose(seen.reflectance[inside], np.broadcast_to([0.8, 0.5, 0.3], (inside.sum(), 3)), rtol=1e-6)
    assert not np.any(seen.irradiance[~inside])


def test_irradiance_is_light_times_cosine(stage):
    stage.draw(scene((0.6, 0.0, 0.8)))
    seen = stage.buffers()
    cosine = np.maximum(seen.normal @ np.array([0.6, 0.0, 0.8]), 0.0)
    lit = (seen.mask > 0.5) & (cosine > 0.15)
    np.testing.assert_allclose(seen.irradiance[lit][:, 0], cosine[lit] + 0.1, atol=2e-3)


def test_thickness_is_the_way_of_the_light(stage):
    """Light from straight behind: the chord of the ball, 2 sqrt(R^2 - x^2 - y^2), away from the rim."""
    stage.draw(scene((0.0, 0.0, -1.0)))
    seen = stage.buffers()
    rest = RADIUS**2 - np.sum(seen.position[..., :2] ** 2, axis=-1)
    thick = (seen.mask > 0.5) & (rest > 0.2 * RADIUS**2)
    np.testing.assert_allclose(seen.thickness[thick], 2 * np.sqrt(rest[thick]), atol=0.25)


def test_shadow_falls_behind(stage):
    """A small ball takes the light from the middle of a large one, and from nowhere else."""
    toward = np.array([0.0, 0.6, 0.8])
    small = ball(20.0 * toward, 3.0)
    stage.draw(replace(scene(tuple(toward), ball(), small), camera=Camera(eye=(0, -60, 80), height=30.0)))
    seen = stage.buffers()
    place = world(seen, Camera(eye=(0, -60, 80)))
    ray = np.linalg.norm(np.cross(place, toward), axis=-1)
    large = (seen.mask > 0.5) & (np.abs(np.linalg.norm(place, axis=-1) - RADIUS) < 0.1)
    shaded = large & (ray < 2.7)
    assert shaded.sum() > 10
    np.testing.assert_allclose(seen.irradiance[shaded], 0.1, atol=1e-3)
    facing = place @ toward > 0
    assert np.all(seen.irradiance[large & facing & (ray > 3.3) & (ray < 6.0)] > 0.4)


def test_thin_parts_shine_through(stage, burley):
    """A ball lit from behind is bright at its rim, where it is thin, and ambient in its middle."""
    stage.draw(scene((0.0, 0.0, -1.0)))
    image = stage.render(burley, 1.0, Sampling(16))
    ambient = stage.scatter(burley, 1.0, Sampling(16)) / np.pi
    extra = (image - ambient)[24, :, 0]
    seen = np.flatnonzero(stage.buffers().mask[24] > 0.5)
    assert extra[seen].max() > 20 * abs(extra[32])
    assert abs(seen[np.argmax(extra[seen])] - 32) > 0.7 * len(seen) / 2


def test_radiance_has_a_highlight_where_it_must(stage, burley):
    """Lambert's part is exitance over pi; the mirror's is largest half way between light and eye."""
    stage.draw(scene((0.8, 0.0, 0.6)))
    image = stage.render(burley, 0.01, Sampling(1))
    mirror = image - stage.scatter(burley, 0.01, Sampling(1)) / np.pi
    assert mirror.min() > -1e-6
    bright = stage.buffers().normal[np.unravel_index(np.argmax(mirror[..., 0]), mirror.shape[:2])]
    assert bright @ np.array([0.8, 0.0, 0.6]) < 0.99
    assert bright @ np.array([0.8, 0.0, 1.6]) / np.hypot(0.8, 1.6) > 0.97


@pytest.mark.slow
@pytest.mark.parametrize("law", ["burley", SeparableFilter()], ids=["burley", "separable"])
def test_buffers_come_back_as_they_went(stage, burley, law):
    """Drawn, read, uploaded: the same pixels and the same light."""
    stage.draw(scene((0.6, 0.5, 0.6), kind="perspective"))
    seen, law = stage.buffers(), burley if law == "burley" else law
    drawn = stage.scatter(law, 2.0, Sampling(8))
    stage.upload(seen)
    again = stage.buffers()
    for name in VECTORS + NUMBERS:
        np.testing.assert_array_equal(getattr(seen, name), getattr(again, name))
    np.testing.assert_array_equal(stage.scatter(law, 2.0, Sampling(8)), drawn)


@pytest.mark.slow
def test_leaves_the_state_as_it_was(context, burley):
    """Target and viewport of the owner's, and the pixels of its target."""
    own = context.simple_framebuffer((8, 8))
    own.use()
    own.clear(0.25, 0.5, 0.75)
    own.viewport = (0, 0, 4, 4)
    before = own.read()
    with Stage(context, SIZE, shadow_side=16) as stage:
        stage.draw(scene((0.0, 1.0, 0.0)))
        stage.render(burley, 2.0, Sampling(4))
        stage.render(SeparableFilter(), 2.0, Sampling(4))
    assert context.fbo is own
    assert own.viewport == context.viewport == (0, 0, 4, 4)
    assert own.read() == before


def test_times_and_compiles_once(stage, burley):
    stage.draw(scene((0.0, 1.0, 0.0)))
    assert len(stage.time(burley, 2.0, Sampling(4), repeats=3)) == 3
    assert all(0 < one < 1e4 for one in stage.time(burley, 2.0, Sampling(4), repeats=2, passes="frame"))
    of_scene = ["shadow", "surface", "back", "occlusion", "ambient"]
    assert stage.renderer.compiled == [*of_scene, "scatter burley", "combine burley"]


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.25, 0.5])
def test_covering_zooms_to_a_share(context, burley, share):
    """And covered pixels gather: one that does not is Lambert's to the last bit, as are those in even shade."""
    found = covering(context, scene((0.0, 1.0, 0.0)), share, size=(160, 90))
    with Stage(context, (160, 90), shadow_side=16) as stage:
        assert abs(covered(stage, found) - share) < 0.02
        seen = stage.buffers()
        light = stage.scatter(burley, 3.0 * seen.pixel, Sampling(16))
    blurred = np.any(light != seen.reflectance * seen.irradiance, axis=-1)
    assert not np.any(blurred & (seen.mask < 0.5))
    assert np.mean(blurred[seen.mask > 0.5]) > 0.9


def test_head_is_lit_and_covers_what_it_must(context, burley):
    """With mean free paths eight times as long as skin's: 1.2 to 2.3 pixels."""
    with Stage(context, (64, 64), shadow_side=512) as stage:
        made = head_scene(columns=256)
        stage.draw(made)
        mfp = 8.0 * np.array(made.material.mfp)
        image = stage.render(burley, mfp, Sampling(4))
        assert 0.3 < covered(stage, made) < 0.5
        seen, blurred = stage.buffers(), stage.scatter(burley, mfp, Sampling(64))
    assert np.all(np.isfinite(image))
    assert image.min() >= 0
    left, right = image[20:40, 18:32].mean(axis=(0, 1)), image[20:40, 36:46].mean(axis=(0, 1))
    assert left[0] > 2 * right[0]  # the light is on the left
    assert left[0] > left[1] > left[2]
    inside = seen.mask > 0.5
    moved = np.abs(blurred - seen.reflectance * seen.irradiance)[inside].mean(axis=0)
    assert np.all(moved > 0.03 * blurred[inside].mean(axis=0))  # of the light, away from where it went in


def test_srgb():
    np.testing.assert_array_equal(to_srgb([0.0, 0.0025, 0.18, 1.0, 7.0]), [0, 8, 118, 255, 255])
    np.testing.assert_array_equal(to_srgb(0.09, exposure=2.0), 118)
    np.testing.assert_allclose(srgb_codes([0.0, 0.18, 1.0]), [0.0, 117.65, 255.0], atol=0.005)  # unrounded
    refused("exposure must be a factor > 0, got 0", to_srgb, 0.5, exposure=0)


def test_bad_input_is_named(stage, burley):
    refused("draw or upload comes first", stage.scatter, burley, 1.0)
    stage.upload(flat(SIZE, 1.0, 0.5))
    refused("law must be a profile law, an ExactLaw or a technique, got 'blur'", stage.scatter, "blur", 1.0)
    refused(r"mfp must be lengths > 0 \[mm\], got 0", stage.scatter, burley, 0)
    refused(r"mfp must be one number or three, got \(1, 2\)", stage.scatter, burley, (1, 2))
    refused(r"fixed_alpha must be albedos in \[0, 1\], got 1.5", stage.scatter, burley, 1.0, fixed_alpha=1.5)
    refused(r"buffers must be \(64, 48\) pixels.* got \(8, 8\)", stage.upload, flat((8, 8), 1.0, 0.5))
    refused("passes must be one of scatter, frame, got 'all'", stage.time, burley, 1.0, passes="all")
    refused("scatter where no scene was drawn", stage.time, burley, 1.0, passes="frame")
    refused(r"width must be a whole number >= 1.* got 0", Stage, stage.context, (0, 4))
    for side in (0, 2.5):
        refused(f"shadow_side must be a whole number >= 1.* got {side}", Stage, stage.context, SIZE, shadow_side=side)


def test_release_frees_the_gpu(context, burley):
    stage = Stage(context, SIZE, shadow_side=16)
    stage.upload(step_edge(SIZE, 1.0, 0.5))
    unlit = stage.render(burley, 2.0, Sampling(4))
    ambient = stage.scatter(burley, 2.0, Sampling(4)) / np.float32(np.pi)
    np.testing.assert_array_equal(unlit, ambient)  # no scene, no light
    textures = [stage.renderer.map(name) for name in (*SURFACE, EXITANCE, RADIANCE)]
    stage.release()
    assert all(isinstance(texture.mglo, moderngl.InvalidObject) for texture in textures)
    for use, *given in (
        (stage.upload, step_edge(SIZE, 1.0, 0.5)),
        (stage.draw, scene((0.0, 1.0, 0.0))),
        (stage.scatter, burley, 2.0),
        (stage.render, SeparableFilter(), 2.0),
        (stage.time, burley, 2.0),
        (stage.buffers,),
    ):
        refused("stage must not be used after it was released", use, *given)
    stage.release()  # twice is once


def spoilt(name, value, mask=1.0):
    """A plane with one bad pixel, and the mask there."""
    plane = replace(flat((4, 3), 1.0, 0.5), visibility=np.ones((3, 4)), roughness=np.ones((3, 4)))
    array, inside = np.array(getattr(plane, name)), np.array(plane.mask)
    array[1, 2], inside[1, 2] = value, mask
    return replace(plane, mask=inside, **({} if name == "mask" else {name: array}))


@pytest.mark.parametrize("name", [one for one in VECTORS + NUMBERS if one != "mask"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_all_are_finite_where_light_scatters(name, value):
    refused(rf"{name} must be finite where mask > 0.5, got {value}", spoilt, name, value)
    assert spoilt(name, value, mask=0.5).size == (4, 3)


@pytest.mark.parametrize("value", [-0.1, 1.5])
def test_reflectance_is_a_share(value):
    refused(rf"reflectance must be in \[0, 1\] where mask > 0.5, got {value}", spoilt, "reflectance", value)
    assert spoilt("reflectance", value, mask=0.0).size == (4, 3)
    assert spoilt("reflectance", np.float32(1.0) + np.finfo(np.float32).eps).size == (4, 3)  # a filter's rounding


def test_misuse():
    plane = flat((4, 3), 1.0, 0.5)
    refused("mask must be finite, got nan", replace, plane, mask=np.full((3, 4), np.nan))
    refused(r"pixel must be a length > 0 \[mm\], got 0", replace, plane, pixel=0.0)
    wanted = r"normal must have shape \(3, 4, 3\), as mask has, got \(4, 4, 3\)"
    refused(wanted, replace, plane, normal=np.zeros((4, 4, 3), np.float32))
    refused(r"even number of columns.* got 5", step_edge, (5, 4), 1.0, 0.5)

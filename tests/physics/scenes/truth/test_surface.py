"""Footprints against rays through the corners of pixels, and what a G-buffer must be."""

from dataclasses import replace

import numpy as np
import pytest

from profilefit.errors import InputError
from profilefit.scenes.stage import buffers
from profilefit.scenes.stage.surface import LEAST_COSINE, Surface, View, seen

RIGHT, UP, FORWARD = np.diag([1.0, 1.0, -1.0])
NORMAL = np.array([0.5, -0.3, np.sqrt(1.0 - 0.34)])
THROUGH = np.array([0.2, 0.1, -40.0])


def hit(view, column, row):
    """Where the ray at so many pixels from the middle meets the plane through THROUGH."""
    across, along = column * view.pixel * view.right, row * view.pixel * view.up
    origin, ray = (across + along, view.forward) if view.eye is None else (view.eye, view.forward + across + along)
    return origin + ray * ((THROUGH - origin) @ NORMAL / (ray @ NORMAL))


@pytest.mark.parametrize("eye", [None, np.array([3.0, -2.0, 5.0])], ids=["orthographic", "perspective"])
def test_footprint_joins_the_corners_of_a_pixel(eye):
    view = View(RIGHT, UP, FORWARD, 0.5 if eye is None else 0.002, eye)
    across, along = view.footprint(hit(view, 7, 4), NORMAL)
    half = 1e-3  # of a pixel: in perspective a footprint is a parallelogram to first order only
    np.testing.assert_allclose(across, (hit(view, 7 + half, 4) - hit(view, 7 - half, 4)) / (2 * half), rtol=1e-5)
    np.testing.assert_allclose(along, (hit(view, 7, 4 + half) - hit(view, 7, 4 - half)) / (2 * half), rtol=1e-5)
    np.testing.assert_allclose([across @ NORMAL, along @ NORMAL], 0.0, atol=1e-12)
    if eye is None:
        assert np.linalg.norm(np.cross(across, along)) == pytest.approx(0.25 / NORMAL[2])


def test_an_outline_has_a_bounded_footprint():
    across, along = View(RIGHT, UP, FORWARD, 2.0).footprint(np.zeros(3), RIGHT)
    assert np.linalg.norm(np.cross(across, along)) <= 1.01 * 4.0 / LEAST_COSINE


def test_background_at_the_eye_has_no_footprint():
    """A render's positions and normals are 0 there; a 0 / 0 would warn, which is an error here."""
    position, normal = np.stack([THROUGH, np.zeros(3)]), np.stack([NORMAL, np.zeros(3)])
    view = View(RIGHT, UP, FORWARD, 0.002, np.zeros(3))
    across, along = view.footprint(position, normal)
    np.testing.assert_array_equal(np.stack([across[1], along[1]]), 0.0)
    np.testing.assert_array_equal(across[0], view.footprint(THROUGH, NORMAL)[0])


def _plane(h, w, **changed):
    fields = {name: np.full((h, w, 3), 0.5) for name in ("position", "irradiance", "reflectance")}
    fields["normal"] = np.broadcast_to([0.0, 0.0, 1.0], (h, w, 3))
    return Surface(**{**fields, "mask": np.ones((h, w), bool), **changed})


def test_coarsened_is_the_mean_of_blocks():
    light = np.arange(48.0).reshape(4, 4, 3)
    mask = np.ones((4, 4), bool)
    mask[0, 0] = False
    coarse = _plane(4, 4, irradiance=light, mask=mask).coarsened(2)
    np.testing.assert_array_equal(coarse.mask, [[False, True], [True, True]])
    np.testing.assert_allclose(coarse.irradiance[1, 1], light[2:, 2:].mean(axis=(0, 1)))
    assert View(RIGHT, UP, FORWARD, 0.5).coarsened(2).pixel == 1.0


def test_seen_is_the_render_in_view_space():
    surface, view = seen(buffers.step_edge((6, 4), 0.5, [0.2, 0.5, 1.0]))
    across, along = view.footprint(surface.position, surface.normal)
    np.testing.assert_allclose(across[1, 2], surface.position[1, 3] - surface.position[1, 2])
    np.testing.assert_allclose(along[1, 2], surface.position[2, 2] - surface.position[1, 2])
    assert surface.mask.all()
    assert view.eye is None


def test_seen_is_what_the_shaders_take_for_inside():
    plane = buffers.flat((4, 1), 0.5, 0.5)
    mask = np.array([[0.0, 0.5, np.nextafter(np.float32(0.5), np.float32(1.0)), 1.0]], np.float32)
    np.testing.assert_array_equal(seen(replace(plane, mask=mask))[0].mask, [[False, False, True, True]])


def test_misuse():
    with pytest.raises(InputError, match="right, up, forward must be three orthonormal axes"):
        View(RIGHT, RIGHT, FORWARD, 1.0)
    with pytest.raises(InputError, match="pixel must be a length > 0, got 0"):
        View(RIGHT, UP, FORWARD, 0.0)
    with pytest.raises(InputError, match=r"position must be \(2, 3, 3\) as the mask, got \(2, 3\)"):
        _plane(2, 3, position=np.zeros((2, 3)))
    with pytest.raises(InputError, match=r"mask must be .* with a visible pixel"):
        _plane(2, 3, mask=np.zeros((2, 3), bool))
    with pytest.raises(InputError, match="irradiance must be finite"):
        _plane(2, 3, irradiance=np.full((2, 3, 3), np.nan))
    with pytest.raises(InputError, match=r"reflectance must be in \[0, 1\], got 2"):
        _plane(2, 3, reflectance=np.full((2, 3, 3), 2.0))
    with pytest.raises(InputError, match="normal must have length 1, got one of 0"):
        _plane(2, 3, normal=np.zeros((2, 3, 3)))
    with pytest.raises(InputError, match="factor must divide 2 and 3, got 2"):
        _plane(2, 3).coarsened(2)

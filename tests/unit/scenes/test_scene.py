"""Geometry, textures, materials and cameras of the render, before any GPU sees them."""

from dataclasses import replace

import numpy as np
import pytest

from mcml_sim import Setting, exact
from profilefit.scenes.skin import paint
from profilefit.scenes.skin.material import translucent
from profilefit.scenes.skin.scene import head_scene
from profilefit.scenes.stage.subject import head
from profilefit.scenes.stage.world import Camera, deformed, normals, parameters, sheet, unit
from tests.unit.scenes.scenes import outward, refused


def test_normals_of_a_ball_point_outwards():
    u, v = parameters(40, 60)
    mesh = sheet(10.0 * head.ball(u, v), u, v, closed=True)
    np.testing.assert_allclose(mesh.normal, mesh.position / 10.0, atol=0.02)  # facets of 6 degrees; measured 0.0195


def fine_ball():
    """A sphere of radius 10 with its own normals, and the shape of its grid."""
    u, v = parameters(100, 150)
    direction = head.ball(u, v)
    return replace(sheet(10.0 * direction, u, v, closed=True), normal=direction.reshape(-1, 3)), u.shape


def shear(points):
    x, y, z = points.T
    return np.stack([x + 0.7 * y - 0.2 * z, y, z + 0.3 * x], axis=-1)


def twist(points):
    x, y, z = points.T
    cosine, sine = np.cos(0.1 * y), np.sin(0.1 * y)
    return np.stack([cosine * x + sine * z, y, cosine * z - sine * x], axis=-1)


def test_a_rotation_turns_normals():
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    ball, _ = fine_ball()
    moved = deformed(ball, lambda points: points @ turn.T + [300.0, 0.0, -50.0])
    np.testing.assert_allclose(moved.position, ball.position @ turn.T + [300.0, 0.0, -50.0], rtol=1e-15)
    np.testing.assert_allclose(moved.normal, ball.normal @ turn.T, atol=1e-9)
    np.testing.assert_array_equal(moved.uv, ball.uv)
    np.testing.assert_array_equal(moved.triangles, ball.triangles)


@pytest.mark.parametrize("move", [shear, twist])
def test_normals_of_a_deformed_ball_are_those_of_its_faces(move):
    ball, grid = fine_ball()
    moved = deformed(ball, move)
    faces = normals(moved.position.reshape(*grid, 3), closed=True).reshape(-1, 3)
    # Facets of 2.4 degrees; measured 0.0084 beside the poles, and half of it with facets of half the side.
    np.testing.assert_allclose(moved.normal, faces, atol=0.01)
    as_a_way = unit(move(ball.position + 1e-6 * ball.normal) - moved.position)  # the comparison can fail
    assert np.max(np.abs(as_a_way - faces)) > 0.3


def test_a_map_that_is_none_of_space_is_refused():
    ball, _ = fine_ball()
    wanted = r"move must keep orientation, with a determinant > 0 of its derivatives, got {} at \(.*, -10, .*\)"
    for move, got in ((lambda p: p * [1, 1, -1], "-1"), (lambda p: p * [1, 1, 0], "0"), (np.sqrt, "nan")):
        refused(wanted.format(got), deformed, ball, move)
    wanted = r"move must return an array of shape \(15251, 3\), .* got \(15251, 2\)"
    refused(wanted, deformed, ball, lambda p: p[:, :2])


def test_meshes_of_the_head_are_sound():
    """Triangles turn as their normals, vertices are finite; and the band floats before the brow."""
    scene = head_scene(columns=256)
    for part in scene.parts:
        assert outward(part.mesh) > 0.98
        vertices = part.mesh.vertices()
        assert np.all(np.isfinite(vertices))
        np.testing.assert_allclose(np.linalg.norm(part.mesh.normal, axis=1), 1.0, atol=1e-6)
        assert part.mesh.triangles.max() < len(vertices)
    face, band = scene.parts[0].mesh.position, scene.parts[-1].mesh.position
    brow = face[np.abs(face - [0, 50, 0])[:, :2].max(axis=1) < 6][:, 2].max()
    assert band[np.abs(band[:, 0]) < 6][:, 2].max() - brow > 10 * max(scene.material.mfp)


def test_texture_is_skin_with_fine_detail():
    reflectance = translucent("skin1").reflectance
    face = paint.skin(reflectance, columns=512)
    assert face.shape == (256, 512, 3)
    assert 0 < face.min() < face.max() < 1
    middle = face[60:170, 170:342]  # from the chin to the brow
    np.testing.assert_allclose(np.median(middle, axis=(0, 1)), reflectance, rtol=0.05)
    np.testing.assert_array_equal(face, paint.skin(reflectance, columns=512))
    cheek = face[115:125, 200:300]
    assert np.ptp(cheek[..., 1]) > 0.3 * reflectance[1]


def test_material_has_the_exact_reflectance():
    skin = translucent("skin1")
    np.testing.assert_allclose(skin.mfp, [1 / 0.772, 1 / 1.05, 1 / 1.49])
    np.testing.assert_allclose(skin.reflectance, exact.reflectance(np.array(skin.alpha), Setting("diffuse")))


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_pixel_is_that_of_the_projection(kind):
    """A point a pixel aside at the target moves by 2 / rows in clip space."""
    camera = Camera(eye=(10.0, 5.0, 400.0), target=(0.0, 2.0, 0.0), height=80.0, kind=kind)
    view = camera.view()
    depth = camera.distance
    aside = camera.pixel(100) * (depth if kind == "perspective" else 1.0)
    at = camera.projection(1.5, 10.0, 900.0) @ np.array([0.0, aside, -depth, 1.0])
    np.testing.assert_allclose((view @ [0.0, 2.0, 0.0, 1.0])[:3], [0, 0, -depth], atol=1e-9)
    np.testing.assert_allclose(at[1] / at[3], 2 / 100)


def test_bad_input_is_named():
    refused(r"material must be one of apple.*got 'skin9'", translucent, "skin9")
    refused("kind must be one of perspective, orthographic, got 'fisheye'", Camera, kind="fisheye")
    refused(r"height must be a length > 0 .* got -1", Camera, height=-1)
    refused("detail must be a whole number >= 1, got 0", head_scene, detail=0)

"""Head of formulas: solids against their own formulas, meshes that are closed and smooth, features at their places."""

import numpy as np
import pytest

from profilefit.scenes.skin import paint
from profilefit.scenes.stage.subject import eye, head, solid
from profilefit.scenes.stage.subject.head import COLUMNS, ROWS
from profilefit.scenes.stage.world import parameters, unit
from tests.unit.scenes.scenes import outward

PARTS = {
    "head": head.head,
    "ear": lambda: head.ear(1),
    "other ear": lambda: head.ear(-1),
    "band": head.band,
    "strap": head.strap,
    "eye": lambda: eye.eye(1),
}


def rays(rows=60, columns=90):
    return head.ball(*parameters(rows, columns))


def test_rays_end_at_a_turned_ellipsoid():
    radii, turn = (30.0, 20.0, 10.0), (20.0, -35.0, 50.0)
    way = rays()
    distance = solid.ends(lambda p: solid.ellipsoid(p, (2.0, -1.0, 3.0), radii, turn), way, 100.0)
    a, b, c = np.radians(turn)
    x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    z = np.array([[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], [0, 0, 1]])
    own = (way * distance[..., None] - [2.0, -1.0, 3.0]) @ (z @ y @ x) / radii
    np.testing.assert_allclose(np.linalg.norm(own, axis=-1), 1.0, atol=1e-6)


def test_a_rod_is_two_balls_and_what_is_between():
    p = np.random.default_rng(1).uniform(-30.0, 30.0, (3, 500))
    first, last = np.array([-5.0, 0.0, 2.0]), np.array([8.0, 3.0, -4.0])
    found = solid.rod(p, first, last, (4.0, 4.0))
    shares = np.linspace(0.0, 1.0, 2001)
    on = first[:, None] + (last - first)[:, None] * shares
    nearest = np.min(np.linalg.norm(p[:, :, None] - on[:, None, :], axis=0), axis=1) - 4.0
    np.testing.assert_allclose(found, nearest, atol=1e-4)


def test_seams_are_as_wide_as_they_say():
    first, second = np.random.default_rng(2).uniform(-10.0, 10.0, (2, 1000))
    union, rest = solid.joined(first, second, 3.0), solid.carved(first, second, 3.0)
    far = np.abs(first - second) > 3.0
    np.testing.assert_array_equal(union[far], np.minimum(first, second)[far])
    assert np.all(union <= np.minimum(first, second))
    assert np.max(np.minimum(first, second) - union) == pytest.approx(0.75, abs=0.01)  # a quarter of the width
    far = np.abs(first + second) > 3.0
    np.testing.assert_array_equal(rest[far], np.maximum(first, -second)[far])
    assert np.all(rest >= np.maximum(first, -second))


@pytest.mark.parametrize("part", PARTS)
def test_parts_are_closed_and_turn_outward(part):
    """Each edge has a triangle on either side, by position; the volume that triangles enclose is above 0."""
    mesh = PARTS[part]()
    assert outward(mesh) > 0.99
    _, place = np.unique(np.round(mesh.position, 6), axis=0, return_inverse=True)
    corners = place.reshape(-1)[mesh.triangles]
    corners = corners[
        (corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2]) & (corners[:, 2] != corners[:, 0])
    ]
    edges = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    one_way = {tuple(edge) for edge in edges.tolist()}
    assert len(one_way) == len(edges)  # no edge is passed twice in one direction
    assert all((b, a) in one_way for a, b in one_way)
    a, b, c = (mesh.position[mesh.triangles[:, i]] for i in range(3))
    assert np.sum(a * np.cross(b, c)) > 0


def test_a_silhouette_is_smooth():
    """Of chords over two edges of a mesh, 98 in 100 are off their arc by less than 0.05 mm, a quarter of a pixel.

    The others are at the edges of lids and lips, of which the skin makes a step.
    """
    grid = head.head().position.reshape(ROWS + 1, COLUMNS + 1, 3)
    for mesh in (grid, head.ear(1).position.reshape(129, 193, 3), head.band().position.reshape(193, 49, 3)):
        for axis in (0, 1):
            points = np.moveaxis(mesh, axis, 0)
            bend, chord = points[2:] - 2.0 * points[1:-1] + points[:-2], unit(points[2:] - points[:-2] + 1e-12)
            aside = bend - np.sum(bend * chord, axis=-1, keepdims=True) * chord
            assert np.quantile(np.linalg.norm(aside, axis=-1) / 8.0, 0.98) < 0.05


def test_the_head_is_even_on_both_sides():
    grid = head.head().position.reshape(ROWS + 1, COLUMNS + 1, 3)
    np.testing.assert_allclose(grid[:, ::-1] * [-1.0, 1.0, 1.0], grid, atol=1e-9)


def test_the_surface_is_where_the_solid_ends():
    """Along the rays of the mesh, up to a hundredth of a millimetre but at edges."""
    points = head.head().position
    off = head._head(points.T)
    assert np.quantile(np.abs(off), 0.999) < 0.01
    assert np.median(np.abs(off)) < 1e-6


def test_eyes_are_seen_between_lids():
    """In front of the skin inside the lids, behind it outside; they look at the camera."""
    points = head.head().position
    x, y, z = points.T
    across, top, bottom = eye.lids(x, y, z)
    height = y * eye.FISSURE / z
    before = (x > 0) & (z > 60.0)
    inside = before & (height < top - 1.0) & (height > bottom + 1.0) & (across > 24.0) & (across < 47.0)
    lid = before & (height > top + 1.0) & (height < top + 3.0) & (across > 28.0) & (across < 43.0)
    from_eye = np.linalg.norm(points - np.array(eye.EYE), axis=1)
    assert np.all(from_eye[inside] < eye.EYEBALL)
    assert np.all(from_eye[lid] > eye.EYEBALL)
    ball = eye.eye(1)
    ahead = unit(ball.position[ball.uv[:, 1] == 1.0].mean(axis=0) - eye.EYE)
    assert ahead[2] > 0.9
    assert ahead[0] < 0.0


def test_lips_and_hair_have_their_colours():
    face, points = paint.face(1024), head.texels(1024)
    red, _ = head.lips(points)
    cheek = (np.abs(np.abs(points[0]) - 45.0) < 8.0) & (np.abs(points[1] + 15.0) < 8.0) & (points[2] > 30.0)
    lips, even, hair = (np.median(face[where], axis=0) for where in (red > 0.9, cheek, head.crop(points) > 0.99))
    assert lips[1] / lips[0] < 0.7 * even[1] / even[0]
    assert hair.max() < 0.5 * even.min()
    assert eye.iris()[-8:].max() < 0.02  # the pupil is at the pole

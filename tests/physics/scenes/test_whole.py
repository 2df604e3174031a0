"""Reference over a whole surface: triangles against exact integrals, light by the shader, relief, hidden parts."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from mcml_sim import Setting
from profilefit.scenes.heart.truth import sphere_blur
from profilefit.scenes.stage.exact_law import DIFFUSE, exact_table
from profilefit.scenes.stage.judge import surface_judge, whole_judge
from profilefit.scenes.stage.reference.step_edge import step_response
from profilefit.scenes.stage.reference.surface import Surface, View, gathered
from profilefit.scenes.stage.reference.surface_sum import Elements, gaussian_sums
from profilefit.scenes.stage.reference.whole import _cut, whole_elements
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.world import INSIDE, Camera, Light, Mesh, Part, Scene
from tests.unit.scenes.scenes import RADIUS, ball, scene


def mesh_of(shape, uv=None):
    uv = np.zeros((len(shape.vertices), 2)) if uv is None else np.asarray(uv, float)
    return Mesh(np.array(shape.vertices), np.array(shape.vertex_normals), uv, np.array(shape.faces, np.int32))


def square(side, tangent=None):
    """Return a square in z = 0 that faces +z, u along x and v along y."""
    corners = 0.5 * side * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    normal, uv = np.tile([0.0, 0.0, 1.0], (4, 1)), corners[:, :2] / side + 0.5
    return Mesh(corners, normal, uv, np.array([[0, 1, 2], [0, 2, 3]], np.int32), tangent)


@pytest.mark.parametrize("length", [3.0, 0.7])
def test_cut_triangles_are_the_triangle(length):
    corners = np.array([[0.0, 0.0, 0.0], [5.0, 1.0, 0.0], [1.0, 4.0, 2.0]])
    one = Mesh(corners, np.tile([0.0, 0.0, 1.0], (3, 1)), corners[:, :2], np.array([[0, 1, 2]], np.int32))
    cut, (first, second) = _cut(one, length)
    areas = 0.5 * np.linalg.norm(np.cross(first, second), axis=1)
    whole = 0.5 * np.linalg.norm(np.cross(corners[1] - corners[0], corners[2] - corners[0]))
    assert areas.sum() == pytest.approx(whole, rel=1e-12)
    np.testing.assert_allclose(areas, areas[0])
    np.testing.assert_allclose(cut.position.mean(axis=0), corners.mean(axis=0), atol=1e-12)
    np.testing.assert_allclose(cut.uv, cut.position[:, :2], atol=1e-12)
    assert np.max(np.linalg.norm([first, second, first - second], axis=-1)) < 1.0001 * length
    places = np.array([cut.position + a * first + b * second for a, b in ((-1 / 3, -1 / 3), (2 / 3, -1 / 3))])
    weights = np.linalg.solve(
        np.array([*corners[:, :2].T, [1.0, 1.0, 1.0]]), [*places[..., :2].T.reshape(2, -1), np.ones(2 * len(areas))]
    )
    assert np.min(weights) > -1e-9  # corners of the pieces lie in the triangle


def test_triangles_of_a_step_edge_are_the_integral():
    """Of a plane that ends 16 mfp away, lit on one half, whose triangles have sides of a third to a half of a mfp."""
    plane, (first, second) = _cut(square(32.0), 32.0 * 2.0**0.5 / 91.9)
    light = np.repeat((plane.position[:, :1] > 0).astype(float), 3, axis=1)
    elements = Elements.of_triangles(plane.position, np.stack([first, second]), light)
    x = np.linspace(-2.0, 2.0, 9) + 0.25
    at = np.stack([x, 0.1 * np.ones(9), np.zeros(9)], axis=1)
    lit = np.repeat((x > 0).astype(float)[:, None], 3, axis=1)
    a = np.broadcast_to([0.1, 0.3, 0.5], (9, 3))
    surface = Surface(at[None], np.broadcast_to([0.0, 0.0, 1.0], (1, 9, 3)), lit[None], a[None], np.ones((1, 9), bool))
    found = gathered(surface, View(0.5), np.ones(3), DIFFUSE, whole=elements)
    alpha = exact_table(DIFFUSE).curves([0.1, 0.3, 0.5]).alpha
    truth = step_response(x[:, None], alpha, setting=DIFFUSE)
    assert np.max(np.abs(found.light[0] / a - truth)) < 3e-4
    assert np.max(np.abs(found.light[0] / a - step_response(x[:, None] + 0.02, alpha, setting=DIFFUSE))) > 1e-3


def test_triangles_of_a_sphere_blur_its_light():
    """Gaussians of the chord under E = 1 + cosine have a closed form on a sphere."""
    shape = trimesh.creation.icosphere(5, RADIUS)
    pieces, sides = _cut(mesh_of(shape), 0.5)
    cosine = pieces.normal[:, 2]
    elements = Elements.of_triangles(pieces.position, sides, 1.0 + cosine[:, None])
    at = np.array([[0.0, 0.0, RADIUS], [RADIUS, 0.0, 0.0], [0.0, 0.6 * RADIUS, -0.8 * RADIUS]])
    sigmas = np.array([0.4, 1.0, 3.0])
    for sigma, sums in zip(sigmas, gaussian_sums(elements, at, 1.0 + at[:, 2:] / RADIUS, sigmas), strict=True):
        truth = sphere_blur(RADIUS, at[:, 2] / RADIUS, [sigma**2], [1.0])
        np.testing.assert_allclose(sums[:, 1], truth, atol=2e-3)
        assert np.max(np.abs(sums[:, 1] - sphere_blur(RADIUS, at[:, 2] / RADIUS, [1.1 * sigma**2], [0.98]))) > 4e-3


@pytest.mark.slow
def test_irradiance_at_points_is_that_of_the_picture(context):
    lit = scene((-0.5, 0.3, 0.8), ball(), ball((-4.0, 3.0, 12.0), 4.0))
    with Stage(context, (64, 64)) as stage:
        stage.draw(lit)
        buffers = stage.true_buffers()
        seen = buffers.mask > INSIDE
        position = buffers.position[seen] + np.array([0.0, 0.0, 100.0])  # from the eye, which looks along -z
        normal = buffers.normal[seen]
        points = Mesh(position, normal, np.zeros((len(position), 2)), np.zeros((0, 3), np.int32))
        [found] = stage.irradiance([(lit.parts[0], points)])
        np.testing.assert_allclose(found, buffers.irradiance[seen], atol=2e-3)
        assert np.ptp(found) > 0.5
        [own] = whole_elements(stage, lit, 1.0)
    area = 4.0 * np.pi * (RADIUS**2 + 4.0**2)
    assert own.areas.sum() == pytest.approx(area, rel=0.005)
    assert np.average(own.points[:, 2], weights=own.areas) == pytest.approx(-100.0 + 12.0 * 16.0 / 116.0, abs=0.3)


def test_a_relief_turns_the_normal(context):
    """A square whose relief leans by a slope toward +x has the light of a square that leans as much."""
    lean = np.array([0.6, 0.0, 0.8])
    relief = np.array([[[*lean, 1.0]]], np.float32)
    light, camera = Light((0.8, 0.0, 0.6), (1.0, 1.0, 1.0)), Camera((0.0, 0.0, 100.0), height=10.0, kind="orthographic")
    tangent = np.tile([1.0, 0.0, 0.0, 1.0], (4, 1))
    a = np.full((1, 1, 3), 0.5, np.float32)

    def drawn(part):
        with Stage(context, (8, 8)) as stage:
            stage.draw(Scene((part,), light, (0.0, 0.0, 0.0), camera))
            return stage.buffers(), stage.irradiance([(part, part.mesh)])[0]

    bent, at_corners = drawn(Part(square(40.0, tangent), a, 0.5, relief=relief))
    np.testing.assert_allclose(bent.irradiance, 0.96, atol=1e-6)
    np.testing.assert_allclose(bent.normal, np.broadcast_to(lean, (8, 8, 3)), atol=1e-6)
    np.testing.assert_allclose(at_corners, 0.96, atol=1e-6)
    across = np.array([[[0.0, 0.6, 0.8, 0.5]]], np.float32)
    other, _ = drawn(Part(square(40.0, tangent), a, 0.5, relief=across))
    np.testing.assert_allclose(other.normal[0, 0], [0.0, 0.6, 0.8], atol=1e-6)
    np.testing.assert_allclose(other.roughness, 0.25, atol=1e-6)
    even, _ = drawn(Part(square(40.0), a, 0.5, relief=relief))  # no tangent
    np.testing.assert_allclose(even.irradiance, 0.6, atol=1e-6)


@pytest.mark.slow
def test_hidden_light_counts(context):
    """Lit from behind, a ball glows at its outline from light that no pixel sees; from the front the sums agree."""
    mfp = np.array([2.0, 1.5, 1.0])
    with Stage(context, (48, 48)) as stage:
        for toward, alike in (((0.0, 0.2, -1.0), False), ((0.0, 0.2, 1.0), True)):
            lit = replace(scene(toward), ambient=(0.02, 0.02, 0.02))
            stage.draw(lit)
            whole, seen = whole_judge(stage, lit, mfp, DIFFUSE), surface_judge(stage, lit, mfp, DIFFUSE, False)
            middle = np.zeros((48, 48), bool)
            middle[16:32, 16:32] = True
            rim = whole.mask & ~middle
            ratio = np.sum(whole.reference[rim]) / np.sum(seen.reference[rim])
            assert ratio == pytest.approx(1.0, abs=0.05) if alike else ratio > 1.3
            assert whole.truth_error.rms < 0.01


def test_even_light_on_a_closed_surface_is_conserved(context):
    even = replace(scene((0.0, 0.0, 1.0)), light=Light((0.0, 0.0, 1.0), (0.0, 0.0, 0.0)), ambient=(0.5, 0.5, 0.5))
    with Stage(context, (16, 16)) as stage:
        stage.draw(even)
        judge = whole_judge(stage, even, np.full(3, 2.0), Setting("diffuse"))
        reflectance = stage.buffers().reflectance.astype(float)
    np.testing.assert_allclose(judge.reference[judge.mask], 0.5 * reflectance[judge.mask], rtol=1e-6)

"""Light in texture space, and the sum over a whole surface, against what is known: a sphere, a plane, one point."""

from contextlib import contextmanager
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.ndimage import binary_erosion
from scipy.special import erf

from profilefit.scenes.heart import screen_share, split, surface_blur
from profilefit.scenes.heart.atlas import BLURRED, Atlas, atlas_size, links
from profilefit.scenes.heart.law import Kernel, balance
from profilefit.scenes.heart.meshes import CHARTS_END, ball, bumps, heart
from profilefit.scenes.heart.truth import Elements, sphere_blur, summed
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.world import Mesh, Part, Scene
from tests.unit.scenes.scenes import refusals, refused

VARIANCES, WEIGHTS = np.array([0.3, 2.0, 9.0]), np.array([0.2, 0.5, 0.3])
BALL, COUNT = 3.0, 20_000


def spiral(count: int = COUNT) -> tuple[np.ndarray, np.ndarray]:
    """Points on spirals of even area, and their areas."""
    z = 1.0 - 2.0 * (np.arange(count) + 0.5) / count
    turn = np.pi * (1.0 + np.sqrt(5.0)) * np.arange(count)
    across = np.sqrt(1.0 - z * z)
    points = BALL * np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)
    return points, np.full(count, 4.0 * np.pi * BALL**2 / count)


def test_a_sphere_is_its_oracle():
    points, areas = spiral()
    at = points[:: COUNT // 40]
    found = surface_blur(points, areas, 1.0 + points[:, 2] / BALL, VARIANCES, WEIGHTS, at=at)
    np.testing.assert_allclose(found, sphere_blur(BALL, at[:, 2] / BALL, VARIANCES, WEIGHTS), atol=1e-5)
    # Negative control: distances along the surface, or light that is renormalised, are something else.
    wider = sphere_blur(BALL, at[:, 2] / BALL, 1.02 * VARIANCES, WEIGHTS)
    assert np.max(np.abs(found - wider)) > 1e-3


def test_many_gaussians_are_summed_apart():
    """As all at once, though each takes the points together as wide as it can; those narrower than points stay."""
    points, areas = spiral()
    at = points[:: COUNT // 40]
    light = 1.0 + (points[:, :2] > 0)
    own = 1.0 + (at[:, :2] > 0)
    spacing = float(np.sqrt(areas[0]))
    variances, weights = np.append(1e-6, VARIANCES), np.array([[0.1, 0.2], [0.3, 0.1], [0.2, 0.3], [0.4, 0.4]])
    found = summed(Elements(points, areas, light, spacing), variances, weights, at, own)
    expected = weights[0] * own + surface_blur(points, areas, light, VARIANCES, weights[1:], at=at)
    np.testing.assert_allclose(found, expected, atol=4e-3)
    assert rms(found - expected) < 2e-3
    assert rms(own - expected) > 0.1


def test_the_oracle_of_little_and_of_great_curvature():
    """Of a plane nothing is lost, and of a grain next to nothing is left."""
    assert sphere_blur(1e4, 0.5, VARIANCES, WEIGHTS) == pytest.approx(1.5, rel=1e-6)
    area = 4.0 * np.pi * 1e-6
    expected = area * np.sum(WEIGHTS / (2.0 * np.pi * VARIANCES))
    assert sphere_blur(1e-3, 0.5, VARIANCES, WEIGHTS) == pytest.approx(expected, rel=1e-4)


def test_one_point_and_channels():
    """A point gives the kernel itself; three channels of light take weights of their own."""
    r = np.array([0.0, 0.7, 4.0])
    at = np.stack([r, 0 * r, 0 * r], axis=1)
    weights = np.stack([WEIGHTS, 2.0 * WEIGHTS, WEIGHTS[::-1]], axis=1)
    found = surface_blur(np.zeros((1, 3)), [0.5], [[1.0, 3.0, 2.0]], VARIANCES, weights, at=at)
    kernel = np.exp(-(r[:, None] ** 2) / (2 * VARIANCES)) / (2 * np.pi * VARIANCES)
    np.testing.assert_allclose(found, 0.5 * kernel @ weights * np.array([1.0, 3.0, 2.0]), rtol=1e-12)


def test_light_is_counted_once():
    points, areas = spiral(6000)
    surface = points, areas, 1.0 + points[:, 0] / BALL
    whole = surface_blur(*surface, VARIANCES, WEIGHTS, at=points[:50])
    for crossover in (0.0, 1.0, 1.5, 9.0):
        parts = [part for part in split(Kernel(VARIANCES, WEIGHTS), crossover) if part.variances.size]
        assert sum(part.variances.size for part in parts) == 3
        light = sum(surface_blur(*surface, part.variances, part.weights, at=points[:50]) for part in parts)
        np.testing.assert_allclose(light, whole, rtol=1e-12)
    refused("crossover must be a length >= 0, got nan", split, Kernel(VARIANCES, WEIGHTS), np.nan)


def test_the_share_of_the_screen():
    """Half of a sphere is seen: all that its pole gathers, half of what its rim does, next to nothing behind."""
    points, areas = spiral(6000)
    at = BALL * np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    share = screen_share(points, areas, points[:, 2] > 0, Kernel(VARIANCES[:1], np.ones(1)), at)
    np.testing.assert_allclose(share, [1.0, 0.5, 0.0], atol=0.01)
    np.testing.assert_array_equal(balance(0.0, 1.0, 2.0, share, 0.97), [1.0, 2.0, 2.0])


POINTS, ONES = np.eye(3)[:2], [1.0, 1.0]
test_bad_sums = refusals(
    partial(surface_blur, points=POINTS, areas=ONES, irradiance=ONES, variances=ONES[:1], weights=ONES[:1]),
    ({"points": np.zeros((2, 2))}, r"points must have shape \(n, 3\), got \(2, 2\)"),
    ({"areas": [1.0, -1.0]}, "areas must be 2 numbers >= 0"),
    ({"irradiance": [np.nan, 1.0]}, "irradiance must be finite, got nan"),
    ({"irradiance": [1.0]}, r"irradiance must be of shape \(2,\)"),
    ({"variances": [0.0]}, "variances must be a list of numbers > 0"),
    ({"weights": [1.0, 2.0]}, "weights must be one for each of 1 variances"),
    ({"areas": "much"}, "areas must be numbers, got 'much'"),
)


KERNEL = Kernel(np.array([0.02, 0.1, 0.5, 2.0, 6.0]), np.array([0.1, 0.2, 0.3, 0.25, 0.15]))
RADIUS, SIZE, MARGIN = 8.0, (240, 144), 24
WHITE = np.ones((1, 1, 3), np.float32)
STAGE = (32, 32), 64


@contextmanager
def laid_out(stage: Stage, mesh: Mesh, size: tuple[int, int], margin: int):
    part = Part(mesh, WHITE)
    stage.draw(Scene((part,)))
    with Atlas(stage.context, size, margin) as atlas:
        atlas.draw(stage, part)
        yield atlas


@pytest.fixture
def sphere(stage):
    with laid_out(stage, ball(RADIUS), SIZE, MARGIN) as atlas:
        yield atlas


def lit(atlas: Atlas, light: np.ndarray) -> None:
    """Irradiance (rows, columns) of the atlas, in place of the scene's."""
    atlas.renderer.write("irradiance_map", np.repeat(light[..., None], 4, axis=-1))


def blurred(atlas: Atlas, light: np.ndarray, kernel: Kernel = KERNEL) -> np.ndarray:
    lit(atlas, light)
    atlas.blur(kernel)
    return atlas.read(BLURRED)[..., 0].astype(float)


def cosine(atlas: Atlas, direction=(0.6, 0.64, 0.48)) -> np.ndarray:
    return atlas.read("normal_map")[..., :3].astype(float) @ np.array(direction)


def rms(off: np.ndarray, weight: np.ndarray | None = None) -> float:
    return float(np.sqrt(np.average(off**2, weights=weight)))


def test_an_atlas_of_a_sphere_is_its_oracle(sphere):
    place, towards = sphere.read("position_map"), cosine(sphere)
    known = sphere_blur(RADIUS, towards, KERNEL.variances, KERNEL.weights)
    off = blurred(sphere, 1.0 + towards) - known
    height = np.where(place[..., 3] > 0.5, np.abs(place[..., 1]) / RADIUS, 2.0)
    area = np.sqrt(np.clip(1.0 - height**2, 0.0, 1.0))
    assert rms(off, np.where(height < np.sin(np.radians(60.0)), area, 0.0)) < 0.0015
    assert rms(off, np.where(height <= 1.0, area, 0.0)) < 0.006
    # Negative control: a blur by half of the variances.
    half = blurred(sphere, 1.0 + towards, Kernel(0.5 * KERNEL.variances, KERNEL.weights))
    assert rms(half - known, np.where(height < 0.8, area, 0.0)) > 0.004


def test_a_furnace(sphere):
    """Even light stays even: over seams, poles and what is outside of all charts; weights need not sum to 1."""
    inside = sphere.read("position_map")[..., 3] > 0.5
    found = blurred(sphere, np.full(inside.shape, 2.0), Kernel(KERNEL.variances, 0.5 * KERNEL.weights))
    np.testing.assert_allclose(found[inside], 1.0, atol=1e-6)


def test_no_step_at_the_seam(sphere):
    """An edge of light along it is blurred as that on the other side of the sphere is; unlinked it would stay."""
    place = sphere.read("position_map")
    inside = place[..., 3] > 0.5
    rows, columns = (slice(MARGIN + 24, -MARGIN - 24), slice(MARGIN, -MARGIN))
    half = (place[..., 0] > 0).astype(float)

    def steps():
        found = blurred(sphere, half, Kernel(np.array([0.5]), np.ones(1)))[rows, columns]
        return np.abs(found[:, 0] - found[:, -1]).max(), np.abs(np.diff(found, axis=1)).max()

    across, within = steps()
    assert across < 1.2 * within
    sphere._links = np.where(inside[..., None], sphere._links, 0.0).astype(np.float32)
    across, within = steps()
    assert across > 2.0 * within


def test_an_open_sheet_ends_at_its_edge(stage):
    """No light comes from beyond, and none is lost: half lit, the sum stays what it was, next to the edge as well."""
    with laid_out(stage, bumps(10.0, 0.0, 20.0), (120, 120), 20) as atlas:
        assert np.all(atlas._links[:20, :, 2] == 0.0)
        place = atlas.read("position_map")
        found = blurred(atlas, (place[..., 0] > 0).astype(float), Kernel(np.array([1.0]), np.ones(1)))
        inside = place[..., 3] > 0.5
        far = inside & (np.abs(place[..., 0]) > 5.0)
        np.testing.assert_allclose(found[far], place[far, 0] > 0, atol=1e-5)
        expected = 0.5 + 0.5 * erf(place[..., 0] / np.sqrt(2.0))
        np.testing.assert_allclose(found[inside], expected[inside], atol=0.01)
        np.testing.assert_array_equal(found[~inside], 0.0)


def test_links_of_a_sphere():
    """A row goes on at its other end, a meridian at the one opposite, and nowhere without a seam to cross."""
    rows, columns, margin = 24, 48, 8
    turn, height = 2 * np.pi * (np.arange(columns) + 0.5) / columns, np.pi * ((np.arange(rows) + 0.5) / rows - 0.5)
    across = np.cos(height)[:, None]
    points = np.stack([across * np.sin(turn), np.sin(height)[:, None] + 0 * turn, across * np.cos(turn)], axis=-1)
    position = np.pad(points, ((margin, margin), (margin, margin), (0, 0)))
    inside = np.pad(np.ones((rows, columns), bool), margin)
    found = links(position, inside, margin)
    own = np.stack(np.meshgrid(np.arange(columns + 2 * margin), np.arange(rows + 2 * margin)), axis=-1)
    np.testing.assert_allclose(found[inside][:, :2], own[inside])
    wrapped = found[margin : margin + rows, :margin]
    np.testing.assert_allclose(wrapped[..., 0], own[margin : margin + rows, :margin, 0] + columns, atol=0.4)
    np.testing.assert_allclose(wrapped[..., 1], own[margin : margin + rows, :margin, 1], atol=0.1)
    over = found[:margin, margin : margin + columns]
    opposite = margin + (own[:margin, margin : margin + columns, 0] - margin + columns // 2) % columns
    np.testing.assert_allclose(over[..., 0], opposite, atol=0.1)
    np.testing.assert_allclose(over[..., 1], 2 * margin - 1 - own[:margin, margin : margin + columns, 1], atol=0.4)
    cut = inside & (own[..., 0] < margin + columns // 2)
    alone = links(np.where(cut[..., None], position, 0.0), cut, margin)  # half a sphere, that ends at its rim
    assert np.all(alone[margin + 6 : margin + rows - 6, :margin, 2] == 0.0)


def test_bad_input(stage):
    part, other = (Part(ball(RADIUS), WHITE) for _ in range(2))
    stage.draw(Scene((part,)))
    with Atlas(stage.context, (64, 48), 8) as atlas:
        refused("part must be one of the scene", atlas.draw, stage, other)
    refused("margin must be texels from 1 to less than half of 48, got 24", Atlas, stage.context, (64, 48), 24)


def area_of(mesh) -> float:
    a, b, c = (mesh.position[mesh.triangles[:, one]] for one in range(3))
    return 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())


def test_elements_are_the_surface(stage):
    """Texels of skewed charts are smaller than their sides make them; of a ball, where they are not, as large."""
    for mesh, skewed in ((heart(RADIUS, 32), True), (ball(RADIUS), False)):
        with laid_out(stage, mesh, *atlas_size(mesh, 0.0, 10 * CHARTS_END, CHARTS_END)) as atlas:
            found, stretch = atlas.elements(), atlas.read("stretch_map")
        assert found.areas.sum() == pytest.approx(area_of(mesh), rel=0.003)
        sides = np.prod(stretch[stretch[..., 2] > 0.5][:, :2], axis=1).sum()
        assert (sides > 1.015 * area_of(mesh)) == skewed


@pytest.mark.slow
@pytest.mark.parametrize("apart", [4, 1])
def test_a_heart_is_blurred_as_its_sum(stage, apart):
    """All of it, and next to the seams of six charts; where they lie nearer than margins are wide, that is refused."""
    part = Part(heart(3.0 * RADIUS), WHITE)
    stage.draw(Scene((part,)))
    size, margin = atlas_size(part.mesh, 0.25, 400)
    finest, least = atlas_size(part.mesh, 0.0, 12 * CHARTS_END, CHARTS_END)
    kernel = Kernel(np.array([0.1, 0.4]), np.array([0.6, 0.4]))
    with (
        Atlas(stage.context, size, margin) as atlas,
        Atlas(stage.context, finest, least) as fine,
        Atlas(stage.context, size, 3 * margin) as wide,
    ):
        for one in (atlas, fine):
            one.draw(stage, part)
            lit(one, 1.0 + cosine(one))
        inside = atlas.read("position_map")[..., 3] > 0.5
        atlas.blur(kernel)
        found = atlas.read(BLURRED)[..., 0].astype(float)[inside]
        own, seams = atlas.elements(), (inside & ~binary_erosion(inside, np.ones((3, 3))))[inside]
        for chosen, bound in ((slice(None, None, 51 * apart), 0.008), (np.flatnonzero(seams)[:: 4 * apart], 0.01)):
            light = own.irradiance[chosen]
            expected = summed(fine.elements(), kernel.variances, kernel.weights, own.points[chosen], light)[:, 0]
            assert rms(found[chosen] - expected, own.areas[chosen]) < bound
            assert rms(light[:, 0] - expected, own.areas[chosen]) > 1.5 * bound
        refused(f"charts must lie {6 * margin + 1} texels apart, .* some of 6 that", wide.draw, stage, part)


SHEET = bumps(10.0, 0.0, 20.0, 8)
COLLAPSED = np.where(SHEET.uv == SHEET.uv.max(), SHEET.uv[-2, 0], SHEET.uv)


@pytest.mark.parametrize(
    ("uv", "message"),
    [
        (np.zeros((81, 0)), r"mesh must have a finite uv at each of 81 vertices, got an array of \(81, 0\)"),
        (SHEET.uv * np.nan, "mesh must have a finite uv at each of 81 vertices"),
        (2.0 * SHEET.uv, r"uv must be in \[0, 1\], got "),
        (0.0 * SHEET.uv, "triangles must have an area in the atlas, got 0 of triangle 0 of 128"),
        (COLLAPSED, "triangles must have an area in the atlas, got 0 of triangle 7 of 128"),
        (np.abs(SHEET.uv - 0.5), "charts must not overlap, nor triangles turn over: they cover 6400 texels"),
    ],
)
def test_a_mesh_that_cannot_be_laid_out(stage, uv, message):
    part = Part(replace(SHEET, uv=uv), WHITE)
    stage.draw(Scene((part,)))
    with Atlas(stage.context, (100, 100), 10) as atlas:
        refused(message, atlas.draw, stage, part)

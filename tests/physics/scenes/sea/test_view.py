"""Views under the sea: what a pixel shows against its optics by numpy, the light of sky and floor, and the truth."""

from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import eval_legendre

from mcml_sim.files.whole_file import read_toml
from profilefit.scenes.sea import passes as views
from profilefit.scenes.sea.caustics import Splat
from profilefit.scenes.sea.haze import BROADENED, KINDS, SCALED, SINGLE, sunlit_haze
from profilefit.scenes.sea.passes import SeaPasses, axes, glow, mirrored
from profilefit.scenes.sea.paths import Sunlight, followed
from profilefit.scenes.sea.scene import WHITE, halves_of, lobes_of, read, reference_render
from profilefit.scenes.sea.water import World
from profilefit.scenes.sea.waves import Waves, random_floor, random_sea, refracted
from profilefit.scenes.stage.judge import Judge
from profilefit.scenes.stage.renderer import Renderer
from profilefit.scenes.stage.world import Camera, unit
from tests.fixtures import CLEAR_SEA, EXAMPLES, slow

TILE, N, DEPTH = 5.0, 1.34, 4.0
EDGE = np.sqrt(1.0 - 1.0 / N**2)  # cosine of Snell's window
NONE, PETZOLD = (0.0,) * 3, lobes_of("petzold")
CALM, LEVEL = Waves(TILE), Waves(TILE, mean=-DEPTH)


def absorbing(tilt, reflectance=(0.6, 0.5, 0.3), sun=(3.0, 2.0, 1.0)):
    """Water that only absorbs, calm over a level floor."""
    a, sky = (0.03, 0.2, 0.4), (0.3, 0.4, 0.5)
    return World(a, NONE, ((1.0, 0.9),), N, CALM, LEVEL, reflectance, tilt, sun, sky)


def reflected(cosine):
    """Fresnel's share from below."""
    outside = np.sqrt(np.maximum(1.0 - N * N * (1.0 - cosine * cosine), 0.0))
    across = (N * cosine - outside) / (N * cosine + outside + 1e-300)
    along = (cosine - N * outside) / (cosine + N * outside + 1e-300)
    return np.where(outside > 0.0, 0.5 * (across**2 + along**2), 1.0)


def entering(cosine):
    """Share of what comes from above that goes in, and its cosine there."""
    inside = np.sqrt(1.0 - (1.0 - cosine * cosine) / N**2)
    return 1.0 - reflected(inside), inside


def integral(f):
    return quad(f, 0.0, EDGE)[0] + quad(f, EDGE, 1.0)[0]


def of_floor(world, to_and_fro=True):
    """Radiance (3,) that its floor sends out: sun, sky, and what the surface mirrors of the floor's own light."""
    share, inside = entering(np.cos(world.tilt))
    a, rho = np.array(world.a), np.array(world.reflectance)

    def sky(rate):
        def ring(u):
            went, cosine = entering(u)
            return 2.0 * u * went * np.exp(-rate * DEPTH / cosine)

        return quad(ring, 0.0, 1.0)[0]

    back = [integral(lambda u, k=k: 2.0 * u * reflected(u) * np.exp(-2.0 * k * DEPTH / max(u, 1e-9))) for k in a]
    sunlit = np.array(world.sun) * share * np.cos(world.tilt) * np.exp(-a * DEPTH / inside)
    lit = sunlit + np.array(world.sky) * [sky(rate) for rate in a]
    return rho / np.pi * lit / (1.0 - rho * np.array(back) * to_and_fro)


def optics(world, eye, way, to_and_fro=True):
    """Radiance (..., 3) that comes from directions (..., 3)."""
    a, floor, up = np.array(world.a), of_floor(world, to_and_fro), way[..., 2:]
    down = floor * np.exp(-a * (eye[2] + DEPTH) / np.maximum(-up, 1e-12))
    share, rises = reflected(np.clip(up, 0.0, 1.0)), np.maximum(up, 1e-12)
    sky = (1.0 - share) * N**2 * np.array(world.sky) / np.pi * np.exp(a * eye[2] / rises)
    return np.where(up < 0.0, down, sky + share * floor * np.exp(-a * (DEPTH - eye[2]) / rises))


def directions(camera, size):
    """(rows, columns, 3) through the middles of pixels, row 0 at the bottom."""
    right, up, forward = axes(camera, size)  # which `test_axes` holds
    x, y = ((2.0 * np.arange(n) + 1.0) / n - 1.0 for n in size)
    return unit(forward + x[None, :, None] * right + y[:, None, None] * up)


@contextmanager
def drawn(context, world, splat=Splat.FACES, texels=16):
    """A world with its maps of light, as a function from camera, size, kind and pieces to radiance."""
    with Renderer(context, (1, 1)) as renderer:
        passes = SeaPasses(renderer, world, splat, texels, texels, 4)
        for own in passes.light.values():
            renderer.run(*own)
        yield lambda *view: renderer.image(passes.view(*view, 16))[..., :3].astype(float)


@pytest.fixture
def few_depths(monkeypatch):
    """Of the light of sky and floor that water scatters, where there is none, or where it need not be right."""
    monkeypatch.setattr(views, "DEPTHS", 2)


@pytest.fixture
def few_directions(few_depths, monkeypatch):
    """The same, where the floor has no such light either."""
    monkeypatch.setattr(views, "CONE", 8)


def toward(eye, direction, height):
    return Camera(tuple(eye), tuple(np.add(eye, direction)), float(height * np.linalg.norm(direction)))


@pytest.mark.parametrize("kind", KINDS)
def test_a_calm_sea_that_scatters_nothing(context, few_depths, kind):
    """Floor, its mirror image, and the sky in Snell's window, to 2e-3; without light to and fro it would be off."""
    world, size = absorbing(0.5), (48, 40)
    camera = toward((1.0, 2.0, -1.5), (1.0, 0.6, -0.1), 2.6)
    with drawn(context, world) as view:
        found = view(camera, size, kind, 8)
    way = directions(camera, size)
    expected, once = (optics(world, camera.eye, way, to_and_fro) for to_and_fro in (True, False))
    bright, up = expected.max(axis=(0, 1)), way[..., 2]
    assert np.all(np.abs(found - expected) < 3e-3 * bright)
    for part, least in ((up < -0.15, 400), ((up > 0.15) & (up < EDGE), 400), (up > EDGE + 0.01, 30)):
        assert part.sum() > least
        np.testing.assert_allclose(found[part], expected[part], rtol=2e-3)
    assert np.max(np.abs(found - once) / bright) > 0.1


@pytest.mark.parametrize("above", [1.0, 0.2, 0.01])
def test_a_level_floor_from_near_it(context, few_depths, above):
    """No pixel is black, down to a centimetre above the floor."""
    world = absorbing(0.5)
    camera = toward((0.0, 2.5, above - DEPTH), (1.0, 0.0, -0.2), 1.2)
    with drawn(context, world) as view:
        found = view(camera, (24, 20), SINGLE, 8)
    way = directions(camera, (24, 20))
    down = way[..., 2] < -0.05
    assert down.sum() > 200
    np.testing.assert_allclose(found[down], optics(world, camera.eye, way)[down], rtol=2e-3)


def test_the_truth_where_nothing_is_scattered():
    world, eye = absorbing(0.5), np.array([1.0, 2.0, -1.5])
    up = np.array([-0.95, -0.8, -0.6, -0.4, -0.2, 0.2, 0.4, 0.6, 0.72, 0.8, 0.9, 0.98])
    azimuth = np.linspace(0.0, 6.0, up.size)
    side = np.sqrt(1.0 - up**2)
    way = np.column_stack([side * np.cos(azimuth), side * np.sin(azimuth), up])
    light, paths = Sunlight(world, levels=4, pixels=16, rays=32), 4000
    ways = np.repeat(way, paths, axis=0)
    each = followed(world, light, np.tile(eye, (len(ways), 1)), ways, np.random.default_rng(0)).reshape(-1, paths, 3)
    value, error = each.mean(axis=1), each.std(axis=1) / np.sqrt(paths)
    expected, once = (optics(world, eye, way, to_and_fro) for to_and_fro in (True, False))
    off, short = np.abs(value - expected) / error, np.sum(value - once, axis=0) / np.linalg.norm(error, axis=0)
    assert np.all(off < 4.0)
    assert np.all((error / expected).max(axis=0) < (0.05, 0.12, 0.15))
    assert short[0] > 8.0


def test_snells_window(context, few_depths):
    """Over a black floor: the sky, n^2 times as bright, within 48 degrees of the vertical, and nothing beyond."""
    world, size = absorbing(0.0, NONE), (41, 41)
    camera = toward((1.0, 2.0, -1.5), (0.05, 0.0, 1.0), 3.2)
    with drawn(context, world) as view:
        found = view(camera, size, SINGLE, 8)
    up = directions(camera, size)[..., 2]
    inside, outside = up > EDGE + 0.005, up < EDGE - 0.005
    cosine, sky = up[inside, None], N**2 * np.array(world.sky) / np.pi
    expected = sky * (1.0 - reflected(cosine)) * np.exp(-1.5 * np.array(world.a) / cosine)
    np.testing.assert_allclose(found[inside], expected, rtol=1e-4)
    assert min(inside.sum(), outside.sum()) > 500
    assert np.all(np.abs(found[outside]) < 1e-6)
    assert found[20, 20, 2] > 0.9 * sky[2] * np.exp(-1.5 * world.a[2])


@pytest.mark.parametrize(("kind", "most"), [(BROADENED, 0.01), (SCALED, 2e-3), (SINGLE, 2e-3)])
def test_the_haze_of_a_view_is_that_of_its_quadrature(context, few_directions, kind, most):
    """In a deep, calm sea, by 24 pieces; level, up and down. Four are as good where ways are linear in lengths."""
    omega, c = np.array([0.2, 0.5, 0.8]), np.array([0.5, 1.0, 1.3])
    sun, size = (3.0, 2.0, 1.0), (3, 5)
    deep = Waves(TILE, mean=-60.0)
    world = World(tuple(c * (1 - omega)), tuple(c * omega), PETZOLD, 1.0001, CALM, deep, NONE, 0.0, sun, NONE)
    camera = toward((1.0, 2.0, -1.5), (1.0, 0.6, 0.0), 2.0)
    up = directions(camera, size)[:, 1, 2]
    expected = np.array([[sun[i] * sunlit_haze(omega[i], 1.5 * c[i], -u, PETZOLD, kind) for i in range(3)] for u in up])
    each = (kind, 24), (kind, 4), (SCALED if kind == SINGLE else SINGLE, 24)
    with drawn(context, world) as view:
        found, few, other = (view(camera, size, one, pieces)[:, 1] for one, pieces in each)
    off, coarse, far = (np.abs(one / expected - 1.0) for one in (found, few, other))
    assert np.all(off < most)
    assert (coarse.max() > 3.0 * most) == (kind == BROADENED)
    assert np.all(far.max(axis=1) > 0.2)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("lobes", [((0.7, 0.8), (0.3, -0.4)), *slow((((1.0, 0.8),),), (PETZOLD,))])
def test_the_light_of_sky_and_floor_is_all_turned(kind, lobes):
    """Without loss, over all views: scalar irradiance of the sky's window, and of a floor twice what it sends out."""
    world = World(NONE, (1e-9,) * 3, lobes, N, CALM, LEVEL, NONE, 0.0, NONE, NONE)
    depths, light, nothing = np.array([0.0, 2.0, DEPTH]), np.array([1.0, 0.5, 0.2]), np.zeros(3)
    cosine = np.linspace(-1.0, 1.0, views.GLOW)

    def turned(sky, floor):
        found = np.exp(-glow(world, kind, depths, sky, floor)[..., :3].astype(float))
        return 2.0 * np.pi * np.trapezoid(found, cosine, axis=1)

    into, window = (
        quad(lambda u, p=power: 2.0 * u * entering(u)[0] * entering(u)[1] ** p, 0.0, 1.0)[0] for power in (0, -1)
    )
    np.testing.assert_allclose(turned(light, nothing), np.tile(light * window / into, (3, 1)), rtol=1e-3)
    mirror = 2.0 * integral(reflected)
    np.testing.assert_allclose(turned(nothing, light), np.tile(light * (2.0 + mirror), (3, 1)), rtol=3e-3)
    assert mirror > 0.5
    np.testing.assert_allclose(mirrored(world, kind), integral(lambda u: 2.0 * u * reflected(u)), rtol=8e-3)
    # The sky's light goes on down, the floor's on up, where a lobe is forward.
    each = (light, nothing), (nothing, light)
    up, down = (np.exp(-glow(world, kind, depths[:1], *one)[0, [-1, 0], 0]) for one in each)
    assert up[0] > 2.0 * up[1]
    assert down[1] > down[0]


def test_light_that_the_water_takes_away_glows_less():
    world = World((0.2,) * 3, (0.1,) * 3, ((1.0, 0.8),), N, CALM, LEVEL, NONE, 0.0, NONE, NONE)
    depths, light, nothing = np.linspace(0.0, DEPTH, 3), np.ones(3), np.zeros(3)
    for kind in KINDS:
        sky, floor = (glow(world, kind, depths, *one)[..., 0] for one in ((light, nothing), (nothing, light)))
        assert np.all(np.diff(sky, axis=0) > 0.0)
        assert np.all(np.diff(floor, axis=0)[:, :40] < 0.0)


@pytest.mark.parametrize("kind", KINDS)
def test_every_view_of_water_that_only_scatters(context, few_directions, kind):
    """Finite and lit, close to the floor and to the surface, and along the sun's beam to the last digit."""
    sea, floor = random_sea(0.12, TILE, 4), random_floor(0.2, TILE, DEPTH, 2)
    lights = (3.0, 2.0, 1.0), (0.3, 0.4, 0.5)
    world = World(NONE, (0.05, 0.2, 1.0), PETZOLD, N, sea, floor, (1.0, 0.5, 0.0), 0.5, *lights)
    around = [(-1, 0, 0), (0, 1, 0), (0.01, 0, 1), (0.01, 0, -1), (1, 1, 1e-9)]
    with drawn(context, world, Splat.CELLS, 32) as view:
        for level in (floor.highest + 1e-3, -2.0, sea.lowest - 1e-3):
            for way in (*around, world.beam, -world.beam):
                found = view(toward((1.0, 2.0, level), way, 2.0), (9, 9), kind, 8)
                assert np.all(np.isfinite(found))
                assert np.all(found[..., :2] > 0.0)
            sunward = view(toward((1.0, 2.0, level), -world.beam, 0.2), (9, 9), kind, 8).sum(axis=-1)
            assert np.argmax(sunward) == 40  # the middle, straight into the beam
    with drawn(context, replace(world, sun=NONE, sky=NONE), Splat.CELLS, 32) as dark:
        np.testing.assert_allclose(dark(toward((1.0, 2.0, -2.0), (1, 0, 0), 2.0), (9, 9), kind, 8), 0.0, atol=1e-20)


@pytest.mark.parametrize(("a", "b"), [((20.0, 0.05, 0.03), (0.05,) * 3), (NONE, (0.01, 0.01, 100.0))])
def test_water_that_lets_next_to_nothing_through_in_one_colour(context, few_directions, a, b):
    sea, floor = random_sea(0.12, TILE, 4), random_floor(0.08, TILE, DEPTH, 2)
    world = World(a, b, PETZOLD, N, sea, floor, (0.4,) * 3, 0.5, (3.0,) * 3, (0.3,) * 3)
    with drawn(context, world, Splat.CELLS, 32) as view:
        for kind in KINDS:
            found = view(toward((1.0, 2.0, -2.0), (-1, 0, 0.1), 1.2), (9, 9), kind, 8)
            assert np.all(np.isfinite(found)), kind
            assert np.all(found >= 0.0)


@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (-1.0, 2.0, 0.7), (0.0, -3.0, -5.0), (0.01, 0.0, 1.0)])
def test_axes(direction):
    """Right-handed, half a picture's sides at a distance of 1; up is up, right is level."""
    right, up, forward = axes(toward((1.0, 2.0, -2.0), direction, 1.2), (30, 20))
    np.testing.assert_allclose(np.linalg.norm(forward), 1.0, rtol=1e-12)
    np.testing.assert_allclose(forward, np.array(direction) / np.linalg.norm(direction), rtol=1e-12)
    np.testing.assert_allclose([np.linalg.norm(right), np.linalg.norm(up)], [0.9, 0.6], rtol=1e-12)
    np.testing.assert_allclose(np.cross(right, up), -0.54 * forward, atol=1e-12)
    assert up[2] > 0.0
    np.testing.assert_allclose([right[2], right @ forward, up @ forward, right @ up], 0.0, atol=1e-12)


def test_the_phase_function_behind_waves():
    """Moments are those of the terms, times those of Gaussian angles; rays drawn around it see its mean."""
    world = World((0.1,) * 3, (0.1,) * 3, PETZOLD, N, random_sea(0.17, TILE, 7), LEVEL, NONE, 0.6, NONE, NONE)
    angle = np.pi * np.linspace(0.0, 1.0, 4096) ** 4
    found = views.blurred_phase(world, 4096)
    for order in (0, 1, 2, 8, 30):
        moment = 2.0 * np.pi * np.trapezoid(found * eval_legendre(order, np.cos(angle)) * np.sin(angle), angle)
        own = sum(weight * g**order for weight, g in PETZOLD)
        np.testing.assert_allclose(moment, own * np.exp(-0.25 * order * (order + 1) * world.spread**2), atol=1e-5)
    rays = np.random.default_rng(0).normal(0.0, world.spread / np.sqrt(2.0), (2, 400_000))
    for one in (0.0, 0.02, 0.1, 0.5):
        mean = np.mean(world.phase.pdf(np.cos(np.hypot(rays[0] - one, rays[1]))))
        np.testing.assert_allclose(np.interp(one, angle, found), mean, rtol=0.02)
    assert found[0] < 0.1 * world.phase.pdf(1.0)
    calm = replace(world, sea=CALM)
    np.testing.assert_allclose(views.blurred_phase(calm, 64), world.phase.pdf(np.cos(angle[::65])), rtol=1e-12)
    assert calm.spread < 1e-12
    ways = refracted(world.tilt, world.sea.slope(*np.random.default_rng(1).uniform(0.0, TILE, (2, 50_000))), N)
    rms = np.sqrt(np.average((ways[0] - world.calm[0]) ** 2 + ways[1] ** 2, weights=ways[2]))
    assert 0.7 * rms < world.spread < rms


def test_views_of_a_pixel_share_its_pieces(context, few_directions):
    """Four views that look at different places of a piece see the shafts as four times as many pieces do.

    So do four looks of one view.
    """
    world = World((0.1,) * 3, (0.2,) * 3, PETZOLD, N, random_sea(0.17, TILE, 7), LEVEL, NONE, 0.6, (3.0,) * 3, NONE)
    camera = toward((1.0, 2.0, -3.0), (-1.0, 0.1, 0.3), 1.2)
    with Renderer(context, (1, 1)) as renderer:
        passes = SeaPasses(renderer, world, Splat.CELLS, 64, 64, 8)
        for own in passes.light.values():
            renderer.run(*own)

        def picture(pieces, number, looks=1):
            view = passes.view(camera, (64, 48), BROADENED, pieces, 16, number, looks)
            return renderer.image(view)[..., 0].astype(float).reshape(24, 2, 32, 2).mean(axis=(1, 3))

        true, *pictures = picture(512, 1), picture(8, 1), picture(8, 2), picture(8, 1, 4)
    plain, shared, looked = (np.sqrt(np.mean((one - true) ** 2)) / true.mean() for one in pictures)
    assert shared < 0.75 * plain
    assert looked < 0.5 * plain


def test_errors_leave_the_truths_own_noise_out():
    """Of a picture that is off by 0.3 of the mean, judged by halves whose noise is larger; a mean of them is biased."""
    rng = np.random.default_rng(3)
    truth = rng.uniform(0.5, 1.5, (96, 128, 3))
    halves = truth + 0.8 * rng.standard_normal((2, *truth.shape))
    found = Judge.of_halves(halves, WHITE)
    picture = truth + 0.3 * rng.standard_normal(truth.shape)
    judged = found.rmse(picture)
    biased = np.sqrt(np.mean((picture - found.reference) ** 2))
    square = np.mean(found.relative_error(picture) ** 2)
    assert abs(judged - 0.3) < 0.02
    assert biased > 0.6
    assert abs(np.sqrt(square) - judged) < 0.03
    assert found.relative_error(picture).shape == (96, 128)
    assert found.rmse(truth) < 0.1
    # The map shows where: a square that is off by 2 stands out of what is right.
    spoiled = truth.copy()
    spoiled[40:60, 50:80] += 2.0
    where = found.relative_error(spoiled)
    assert np.median(where) < 0.3 < 1.8 < where[50, 65]
    np.testing.assert_allclose(found.truth_error.rms, 0.8 / np.sqrt(2.0), rtol=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "paths", "pieces", "scaled", "single"),
    [("clear", 300_000, 24, 3.5, 4.5), ("example", 900_000, 64, 2.5, 7.0)],
)
def test_seas_beside_their_truth(context, name, paths, pieces, scaled, single):
    """Broadened light is nearest to the truth; more pieces change little, and left is not right."""
    content = CLEAR_SEA if name == "clear" else read_toml(Path(EXAMPLES["sea.toml"]))
    example = read("sea.toml", content).changed(camera_table={"resolution": (32, 24)})
    with reference_render(context, example, paths=paths) as drawn:
        found = drawn.judge
        errors = {kind: found.rmse(drawn.picture(kind, pieces)) for kind in KINDS}
        picture, more = (drawn.picture(BROADENED, samples) for samples in (pieces, 4 * pieces))
        other = halves_of(example, drawn.request.world, paths, seed=1)
        swapped, upside_down = found.rmse(picture[:, ::-1]), found.rmse(picture[::-1])
        means = picture.mean(axis=(0, 1)) / found.reference.mean(axis=(0, 1))
        assert errors[BROADENED] < 0.17
        assert errors[SCALED] > scaled * errors[BROADENED]
        assert errors[SINGLE] > max(errors[SCALED], single * errors[BROADENED])
        assert abs(found.rmse(more) - errors[BROADENED]) < 0.01
        assert min(swapped, upside_down) > 1.8 * errors[BROADENED]
        np.testing.assert_allclose(means, 1.0, atol=0.08)
        # The picture of another seed errs by its own noise, which is that of two independent halves.
        noise = np.sqrt(np.mean((other[0] - other[1]) ** 2)) / 2.0 / found.mean
        judged = found.rmse(other.mean(axis=0))
        biased = np.sqrt(np.mean((other.mean(axis=0) - found.reference) ** 2)) / found.mean
        square = np.sqrt(np.mean(found.relative_error(picture) ** 2))
        assert 0.6 < judged / noise < 1.5
        assert biased > 1.15 * noise
        assert abs(square / errors[BROADENED] - 1.0) < 0.2

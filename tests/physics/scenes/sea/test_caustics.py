"""Caustics: exact in one dimension, by photons of a lattice, and maps by OpenGL, against each other."""

from functools import cache, partial
from itertools import product

import numpy as np
import pytest

from benchmarks.sea_boxes import SUN, caustic_boxes
from benchmarks.sea_filter import adaptive_filter, sigma
from mcml_sim.media.medium import fresnel
from profilefit.scenes.sea.caustics import Caustics, Splat, caustic_map, focus, splat_for
from profilefit.scenes.sea.truth import caustic_irradiance, caustic_photons, misfit, photons
from profilefit.scenes.sea.waves import Waves, first_hit, random_floor, random_sea, refracted
from profilefit.scenes.stage.renderer import Renderer
from tests.fixtures import slow
from tests.unit.scenes.scenes import refusals, refused

TILE, DEPTH, N = 10.0, 5.0, 1.34
STEP = 2.0 * np.pi / TILE
SIDE = 256  # pixels: the size that errors and fragments are stated for
BEFORE, BEYOND = 0.32, 1.18  # F, of which the first fold is at 1
CHEAPEST = (BEFORE, 256, 7e4, 0.008), (BEYOND, 192, 3e5, 0.025)  # F, vertices, most fragments and rms
PERIOD = 2.0
EDGES = np.linspace(0.0, PERIOD, 65)
SUNS = [(1.5, 0.0), (5.0, 0.4)]  # depth, tilt


@cache
def sea(f, seed=1):
    """A random sea whose most curved crest has this F."""
    one = random_sea(0.15, TILE, seed)
    return one.scaled(f / focus(one, DEPTH))


@cache
def truth(f, seed=1, tilt=0.0, pixels=SIDE):
    """By 2048^2 photons, within 0.0007 rms of 4096^2."""
    return caustic_photons(sea(f, seed), DEPTH, tilt, N, pixels, 2048)


def assert_right(found, fragments, most, rms):
    assert fragments <= most
    assert found.rms < rms
    assert max(abs(found.bright), abs(found.dark)) < 0.005


@pytest.mark.parametrize(("amplitude", "tilt"), [(0.05, 0.0), (0.15, 0.0), (0.1, 0.6), (0.05, -0.0)])
def test_photons_and_cells_are_exact_in_one_dimension(context, amplitude, tilt):
    """Ridges: each row is the exact flux between edges, before and beyond folds, and under a low sun."""
    waves = Waves(TILE, [amplitude, 0.3 * amplitude], [[2 * STEP, 0.0], [5 * STEP, 0.0]], [0.4, 1.9])
    exact = caustic_boxes(lambda x: waves.height(x, 0.0), np.linspace(0.0, TILE, 65), DEPTH, tilt, N)
    reference = caustic_photons(waves, DEPTH, tilt, N, 64, 1024)
    drawn = caustic_map(context, waves, Splat.CELLS, 256, 64, DEPTH, tilt)
    np.testing.assert_allclose(reference, np.tile(exact, (64, 1)), rtol=0.01)
    np.testing.assert_allclose(drawn.light * drawn.entered, np.tile(exact, (64, 1)), rtol=0.02, atol=0.004)
    assert exact.std() > 0.1


def pixel_of(sent, pixels):
    """Pixels, in one row, that photons come to."""
    column, row = (np.mod(np.floor(one * pixels / TILE).astype(int), pixels) for one in (sent.x, sent.y))
    return (row * pixels + column).ravel()


@pytest.mark.slow
def test_photons_in_boxes_against_photons_at_points():
    """4096^2 photons, each in the pixel that it meets, agree within their lattice's noise; a deeper floor doesn't."""
    waves, pixels, side = sea(BEYOND), 64, 4096
    x = (np.arange(side) + 0.5) * TILE / side
    plain, deeper = np.zeros((2, pixels * pixels))
    for first in range(0, side, 512):
        for depth, found in ((DEPTH, plain), (1.01 * DEPTH, deeper)):
            sent = photons(waves, x, x[first : first + 512], depth, 0.0, N)
            found += np.bincount(pixel_of(sent, pixels), sent.flux.ravel(), found.size) * (pixels / side) ** 2
    boxes = caustic_photons(waves, DEPTH, 0.0, N, pixels, 1024)
    off, wrong = (float(np.sqrt(np.mean((one - boxes.ravel()) ** 2))) for one in (plain, deeper))
    np.testing.assert_allclose(plain.mean(), boxes.mean(), rtol=1e-6)
    assert off < 0.003
    assert wrong > 3.0 * off


def test_photons_keep_the_light():
    waves = sea(BEYOND)
    x = (np.arange(512) + 0.5) * TILE / 512
    entered = refracted(0.0, waves.lattice(x, x)[1:], N)[2].mean()
    np.testing.assert_allclose(caustic_photons(waves, DEPTH, 0.0, N, SIDE, SIDE).mean(), entered, rtol=1e-10)


@pytest.mark.parametrize("f", [BEFORE, BEYOND])
def test_light_that_is_conserved(context, f):
    """Points, weighted edges and cells to float32; faces only before folds; a product of lengths nowhere."""
    for splat in (Splat.POINTS, Splat.WIREFRAME_ENERGY, Splat.CELLS):
        for vertices in (96, 256):
            assert abs(caustic_map(context, sea(f), splat, vertices, SIDE, DEPTH).light.mean() - 1.0) < 1e-6
    faces = caustic_map(context, sea(f), Splat.FACES, SIDE, SIDE, DEPTH).light.mean() - 1.0
    lengths = caustic_map(context, sea(f), Splat.DERIVATIVES, SIDE, SIDE, DEPTH).light.mean() - 1.0
    assert (abs(faces) < 1e-3) == (f < 1.0)
    assert lengths > (0.1 if f > 1.0 else 0.002)


@pytest.mark.slow
def test_errors_against_fragments(context):
    """The table of splats at 256^2 pixels: rms, and light that is missing where it is bright and dark."""
    table = {}
    for f, splat, vertices in product((BEFORE, BEYOND), Splat, (128, 192, 256)):
        drawn = caustic_map(context, sea(f), splat, vertices, SIDE, DEPTH)
        table[f, splat, vertices] = misfit(drawn.light, truth(f)), drawn.fragments
    for f, vertices, most, rms in CHEAPEST:
        assert_right(*table[f, splat_for(f), vertices], most, rms)
    # As published the wireframe is biased however fine it is, and as much of the light moves from bright to dark.
    for vertices in (128, 256):
        assert table[BEYOND, Splat.WIREFRAME, vertices][0].bright < -0.3
        assert table[BEYOND, Splat.WIREFRAME, vertices][0].dark > 0.3
        assert abs(table[BEYOND, Splat.WIREFRAME_ENERGY, vertices][0].bright) < 0.02
    # Faces win before folds and fail beyond them.
    assert table[BEFORE, Splat.FACES, 256][0].rms < 0.1 * table[BEFORE, Splat.WIREFRAME_ENERGY, 256][0].rms
    assert table[BEYOND, Splat.FACES, 256][0].rms > table[BEYOND, Splat.POINTS, 256][0].rms
    assert table[BEYOND, Splat.DERIVATIVES, 256][0].rms > 5.0


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2, 3, 4])
def test_the_way_that_is_chosen_on_other_seas(context, seed):
    for f, vertices, most, rms in (*CHEAPEST, (2.0, 160, 3e5, 0.1)):
        drawn = caustic_map(context, sea(f, seed), splat_for(f), vertices, SIDE, DEPTH)
        assert_right(misfit(drawn.light, truth(f, seed)), drawn.fragments, most, rms)


@pytest.mark.slow
def test_a_low_sun(context):
    """Its F is larger: at 1 rad faces of a sea whose F under an overhead sun is 0.32 lie over one another."""
    low = 1.0
    np.testing.assert_allclose(focus(sea(BEFORE), DEPTH), BEFORE)
    assert focus(sea(BEFORE), DEPTH, tilt=low) > 0.9
    for tilt in (0.5, low):
        expected = truth(BEFORE, 1, tilt)
        splats = Splat.FACES, Splat.CELLS
        faces, cells = (caustic_map(context, sea(BEFORE), splat, 192, SIDE, DEPTH, tilt) for splat in splats)
        np.testing.assert_allclose(cells.entered, expected.mean(), rtol=1e-6)
        assert misfit(cells.light, expected).rms < 0.01
        assert (misfit(faces.light, expected).rms < 0.01) == (tilt < low)


def test_constant_lines_have_a_closed_form(context):
    """One brightness a fragment draws sum |M t_i| / |det M|, lengths as OpenGL counts them, not 1 / |det M|."""
    waves, pixels = sea(BEFORE), 32
    step = TILE / 512
    x = (np.arange(512) + 0.5) * step
    sent = photons(waves, x, x, DEPTH, 0.0, N)
    right, up = (np.stack([np.gradient(one, step, axis=axis) for one in (sent.x, sent.y)]) for axis in (1, 0))
    lines = sum(np.abs(edge).max(axis=0) for edge in (right, up, right + up))
    at = pixel_of(sent, pixels)
    # Photons are as many as 1 / |det M| in a place: the mean of the lines' length over them is their sum over the area.
    expected = np.bincount(at, lines.ravel(), pixels**2).reshape(pixels, pixels)
    drawn = caustic_map(context, waves, Splat.WIREFRAME, 512, 512, DEPTH).light
    drawn = drawn.reshape(pixels, 16, pixels, 16).mean(axis=(1, 3))
    true = truth(BEFORE, pixels=pixels) / truth(BEFORE, pixels=pixels).mean()
    biased, off = (np.sqrt(np.mean((drawn - one / one.mean()) ** 2)) for one in (expected, true))
    assert biased < 0.02
    assert off > 3.0 * biased


def test_the_tile_repeats(context):
    """A sea moved by 48 pixels has its map moved by as many, on all sides."""
    waves = sea(BEYOND)
    shift = np.array([48, 80]) * TILE / SIDE
    moved = Waves(TILE, waves.amplitudes, waves.vectors, waves.phases - waves.vectors @ shift)
    one, other = (caustic_map(context, each, Splat.CELLS, 64, SIDE, DEPTH).light for each in (waves, moved))
    np.testing.assert_allclose(np.roll(one, (80, 48), (0, 1)), other, atol=0.02)
    assert np.abs(one - other).max() > 1.0


def test_hits_on_an_uneven_floor(context):
    """Those of the shader's lattice are those of float64, at S about 1; the light is all there."""
    floor, tilt, vertices = random_floor(0.4, TILE, DEPTH, seed=3), 0.9, 48
    waves = sea(BEFORE)
    with Renderer(context, (1, 1)) as renderer:
        drawn = Caustics(renderer, waves, vertices, 64, DEPTH, tilt, N, floor)
        hits, drift = drawn.hits(), drawn.drift * TILE / 64
        light = drawn.light(Splat.CELLS)
    x = (np.arange(vertices) + 0.5) * TILE / vertices
    z, zx, zy = waves.lattice(x, x)
    across, aside, flux = refracted(tilt, (zx, zy), N)
    ray = np.stack([across, aside, -np.ones_like(z)], axis=-1) / np.sqrt(1.0 + across**2 + aside**2)[..., None]
    origin = np.stack([*np.meshgrid(x, x), z], axis=-1)
    k = first_hit(floor.height, origin, ray, floor.lowest, floor.highest, slope=floor.slope)
    expected = np.stack([k * ray[..., 0] - drift, k * ray[..., 1], flux, k], axis=-1)
    np.testing.assert_allclose(hits, expected, atol=1e-6 * DEPTH * 2.0)
    np.testing.assert_allclose(light.light.mean(), 1.0, atol=1e-6)


@pytest.mark.slow
def test_the_published_filter_gains_light(context):
    """By its own brightness a map gathers more than there is; spread by it, all stays. Peaks are real beyond folds."""
    for f in (BEFORE, BEYOND):
        drawn = caustic_map(context, sea(f), Splat.WIREFRAME_ENERGY, SIDE, SIDE, DEPTH).light
        gathered, scattered = adaptive_filter(drawn), adaptive_filter(drawn, scatter=True)
        raw, soft, kept = (misfit(one, truth(f)) for one in (drawn, gathered, scattered))
        assert 0.002 < soft.energy < 0.1
        assert abs(kept.energy - raw.energy) < 1e-12
        assert (soft.rms < 0.5 * raw.rms) == (f < 1.0)
    np.testing.assert_allclose(adaptive_filter(np.full((9, 7), 3.0)), 3.0, rtol=1e-12)
    np.testing.assert_allclose([sigma(3), sigma(5), sigma(7)], [0.8, 1.1, 1.4])


def test_the_switch():
    assert [splat_for(f) for f in (0.0, 0.99, 1.0, 3.0)] == [Splat.FACES, Splat.FACES, Splat.CELLS, Splat.CELLS]
    one = Waves(TILE, [0.1], [[4 * STEP, 0.0]], [0.0])
    np.testing.assert_allclose(focus(one, DEPTH), (1.0 - 1.0 / N) * DEPTH * 0.1 * (4 * STEP) ** 2, rtol=1e-3)


def test_refusals(context):
    waves = sea(BEFORE)
    for given, message in (
        ({"vertices": 1}, "vertices must be a whole number >= 2 and <= 4096, got 1"),
        ({"pixels": 0.5}, "pixels must be a whole number >= 1 and <= 4096, got 0.5"),
        ({"depth": 0.01}, "floor must be below the sea's lowest trough"),
        ({"tilt": 45.0}, r"tilt must be in \[0, pi / 2\), in radians, got 45.0"),
        ({"floor": random_floor(0.1, 5.0, DEPTH)}, "floor must have the sea's tile of 10 m, got 5"),
        ({"splat": "faces"}, "splat must be one of Splat.POINTS, .*, got 'faces'"),
    ):
        good = {"splat": Splat.FACES, "vertices": 16, "pixels": 16}
        refused(f"^{message}", caustic_map, context, waves, **{**good, **given})
    refused(r"^F must be a number >= 0, got nan$", splat_for, np.nan)
    refused(r"^side must be a multiple of pixels = 48, got 64$", caustic_photons, waves, DEPTH, 0.0, N, 48, 64)
    facing = r"^tilt must be one at which no wave faces away .*, got 1.5 radians$"
    refused(facing, caustic_photons, waves, DEPTH, 1.5, N, 16, 64)
    refused(r"^light must be finite numbers \(rows, columns\), got shape \(3,\)$", adaptive_filter, np.ones(3))


def ridge_height(x):
    return 0.06 * np.cos(np.pi * x + 0.3) + 0.02 * np.cos(3.0 * np.pi * x + 1.0)


def ridge_slope(x):
    return -0.06 * np.pi * np.sin(np.pi * x + 0.3) - 0.06 * np.pi * np.sin(3.0 * np.pi * x + 1.0)


def calm(x):
    return 0.0 * x


@pytest.mark.parametrize("tilt", [0.0, 0.5, 1.2])
def test_below_a_calm_sea(tilt):
    """T(tilt) cos(tilt), whatever the depth; nothing is reflected between like media."""
    known = (1.0 - float(fresnel(1.0, N, np.cos(tilt))[0])) * np.cos(tilt)
    np.testing.assert_allclose(caustic_irradiance(calm, np.linspace(-3.0, 3.0, 5), 5.0, tilt, N), known, rtol=1e-13)
    np.testing.assert_allclose(caustic_boxes(calm, EDGES, 0.3, tilt, N), known, rtol=1e-10)
    np.testing.assert_allclose(caustic_irradiance(ridge_height, 0.7, 5.0, tilt, 1.0), np.cos(tilt), rtol=1e-10)
    assert isinstance(caustic_irradiance(calm, 0.7, 5.0, tilt, N), float)


def test_under_a_crest():
    """Where the slope is 0: T(0) / |1 - (1 - 1/n) (D + a) kappa|, before the focus and, with two more rays, beyond."""
    height, k = 0.05, 2.0
    crest = lambda x: height * np.cos(k * x)  # noqa: E731
    normal = 1.0 - ((N - 1.0) / (N + 1.0)) ** 2
    for depth in (2.0, 5.0, 30.0):
        ray = normal / abs(1.0 - (1.0 - 1.0 / N) * (depth + height) * height * k**2)
        found = caustic_irradiance(crest, 0.0, depth, 0.0, N)
        assert found == pytest.approx(ray, rel=1e-7) if depth < 30.0 else found > 1.2 * ray


@pytest.mark.parametrize(("depth", "tilt"), [(1.5, 0.0), (5.0, 0.4), (5.0, 1.2)])
def test_no_light_is_lost(depth, tilt):
    """A period of the floor has what entered through a period of the sea, shaded waves and folds included."""
    x = np.arange(2**16) * PERIOD / 2**16
    across = x * np.cos(tilt) + ridge_height(x) * np.sin(tilt)
    twice = np.concatenate([across - PERIOD * np.cos(tilt), across])
    lit = across >= np.maximum.accumulate(twice)[x.size :]
    entered = np.mean(np.where(lit, refracted(tilt, (ridge_slope(x), calm(x)), N)[2], 0.0))
    np.testing.assert_allclose(caustic_boxes(ridge_height, EDGES, depth, tilt, N).mean(), entered, rtol=2e-4)
    # Between like media each place has cos(tilt), though crests shade a part of the sea.
    np.testing.assert_allclose(caustic_boxes(ridge_height, EDGES, depth, tilt, 1.0), np.cos(tilt), rtol=1e-8)


@pytest.mark.parametrize(("depth", "tilt"), SUNS)
def test_places_and_boxes_are_one_function(depth, tilt):
    """A box of 1e-6 m has what its middle has; differences of eighth order are as good as given derivatives."""
    x = np.random.default_rng(2).uniform(0.0, PERIOD, 40)
    places = caustic_irradiance(ridge_height, x, depth, tilt, N)
    boxes = np.array([caustic_boxes(ridge_height, [one - 5e-7, one + 5e-7], depth, tilt, N)[0] for one in x])
    np.testing.assert_allclose(places, boxes, rtol=1e-4)

    def bend(x):
        return -0.06 * np.pi**2 * (np.cos(np.pi * x + 0.3) + 3.0 * np.cos(3.0 * np.pi * x + 1.0))

    given = caustic_irradiance(ridge_height, x, depth, tilt, N, slope=ridge_slope, curvature=bend)
    np.testing.assert_allclose(places, given, rtol=1e-6)
    np.testing.assert_allclose(places, caustic_irradiance(ridge_height, x, depth, tilt, N, spacing=0.002), rtol=1e-6)


@pytest.mark.parametrize("batches", [2, *slow(60)])
@pytest.mark.parametrize(("depth", "tilt"), SUNS)
def test_against_photons(sidak, depth, tilt, batches):
    """2e6 photons tell a floor that is 1 % deeper apart where light folds, and no difference from the exact one.

    6e7 do so everywhere, within 1 %. They enter at random over a period of the sea; where they land counts within it.
    """
    rng = np.random.default_rng(4 if batches == 2 else 5)
    exact, deeper = (caustic_boxes(ridge_height, EDGES, deep, tilt, N) for deep in (depth, 1.01 * depth))
    count = 1_000_000
    first, second = np.zeros((2, EDGES.size - 1))
    for _ in range(batches):
        x = rng.uniform(0.0, PERIOD, count)
        across, _, flux = refracted(tilt, (ridge_slope(x), calm(x)), N)
        box = (np.mod(x + (depth + ridge_height(x)) * across, PERIOD) * (first.size / PERIOD)).astype(int) % first.size
        first += np.bincount(box, flux, first.size)
        second += np.bincount(box, flux**2, first.size)
    scale = first.size / (count * batches)
    found, error = scale * first, scale * np.sqrt(second)
    off, wrong = (exact - found) / error, (deeper - found) / error
    assert np.abs(off).max() < sidak(off.size)
    if batches == 2:
        assert 0.7 < np.sqrt(np.mean(off**2)) < 1.3
    else:
        assert np.abs(exact / found - 1.0).max() < 0.01
    if batches > 2 or depth > 2.0:
        assert np.abs(wrong).max() > 2.0 * sidak(off.size)


@pytest.mark.slow
def test_a_fold_is_infinite_under_a_point_sun_only():
    """Toward a fold irradiance grows without end, as 1 / sqrt of the distance; pixels and a sun's disc bound it."""
    places = caustic_irradiance(ridge_height, np.linspace(0.0, PERIOD, 20001), 5.0, 0.0, N)
    edges = [np.linspace(0.0, PERIOD, n + 1) for n in (64, 1024)]
    fine = [caustic_boxes(ridge_height, one, 5.0, 0.0, N) for one in edges]
    sunny = [caustic_boxes(ridge_height, one, 5.0, 0.0, N, sun=SUN) for one in edges]
    assert places.max() > 20.0
    assert fine[1].max() > 2.5 * fine[0].max()
    assert sunny[1].max() < 1.5 * sunny[0].max()
    np.testing.assert_allclose([one.mean() for one in sunny], fine[0].mean(), rtol=1e-4)
    # The disc is as wide as SUN / n each way, times the depth: light is 0.7 % of the depth wide.
    np.testing.assert_allclose(2.0 * SUN / N, 0.007, rtol=0.02)


test_what_no_floor_has = refusals(
    partial(caustic_irradiance, surface=ridge_height, x=[0.0, 1.0], depth=5.0, tilt=0.0, n=N),
    ({"depth": -1.0}, "^depth must be a length > 0 \\[m\\], got -1.0$"),
    ({"depth": 0.05}, "^depth must be below the deepest trough, 0\\.07\\d* m, got 0.05$"),
    ({"tilt": 30.0}, "^tilt must be in \\[0, pi / 2\\), in radians, got 30.0$"),
    ({"tilt": -0.1}, "^tilt must be in \\[0, pi / 2\\), in radians, got -0.1$"),
    ({"tilt": np.nan}, "^tilt must be in \\[0, pi / 2\\), in radians, got nan$"),
    ({"n": 0.0}, "^n must be a refractive index > 0, got 0.0$"),
    ({"n": "water"}, "^n must be a refractive index > 0, got 'water'$"),
    ({"x": [0.0, np.nan]}, "^x must be finite numbers \\[m\\], got nan$"),
    ({"surface": lambda x: x + np.nan}, "^surface must be finite, got nan$"),
    ({"surface": 3.0}, "^surface must be a function of an array of x \\[m\\], got 'float' object is not callable$"),
    ({"spacing": 0.0}, "^spacing must be a length > 0 \\[m\\], got 0.0$"),
)

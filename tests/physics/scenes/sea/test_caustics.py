"""Caustic maps by OpenGL and by photons of a lattice, against each other and against one dimension exactly."""

from functools import cache

import numpy as np
import pytest

from benchmarks.sea_boxes import caustic_boxes
from benchmarks.sea_filter import adaptive_filter, sigma
from profilefit.errors import InputError
from profilefit.scenes.sea.caustics import Caustics, Splat, caustic_map, focus, splat_for
from profilefit.scenes.sea.truth import caustic_photons, misfit, photons
from profilefit.scenes.sea.waves import Waves, first_hit, random_floor, random_sea, refracted
from profilefit.scenes.stage.renderer import Renderer

TILE, DEPTH, N = 10.0, 5.0, 1.34
STEP = 2.0 * np.pi / TILE
SIDE = 256  # pixels: the size that errors and fragments are stated for
BEFORE, BEYOND = 0.32, 1.18  # F, of which the first fold is at 1


@cache
def sea(f, seed=1):
    """A random sea whose most curved crest has this F."""
    one = random_sea(0.15, TILE, seed)
    return one.scaled(f / focus(one, DEPTH))


@cache
def truth(f, seed=1, tilt=0.0, pixels=SIDE):
    """By 2048^2 photons, within 0.0007 rms of 4096^2."""
    return caustic_photons(sea(f, seed), DEPTH, tilt, N, pixels, 2048)


def ridges(amplitude):
    """Waves along x alone."""
    return Waves(TILE, [amplitude, 0.3 * amplitude], [[2 * STEP, 0.0], [5 * STEP, 0.0]], [0.4, 1.9])


@pytest.mark.parametrize(("amplitude", "tilt"), [(0.05, 0.0), (0.15, 0.0), (0.1, 0.6), (0.05, -0.0)])
def test_photons_and_cells_are_exact_in_one_dimension(context, amplitude, tilt):
    """Ridges: each row is the exact flux between edges, before and beyond folds, and under a low sun."""
    waves = ridges(amplitude)
    exact = caustic_boxes(lambda x: waves.height(x, 0.0), np.linspace(0.0, TILE, 65), DEPTH, tilt, N)
    reference = caustic_photons(waves, DEPTH, tilt, N, 64, 1024)
    drawn = caustic_map(context, waves, Splat.CELLS, 256, 64, DEPTH, tilt)
    np.testing.assert_allclose(reference, np.tile(exact, (64, 1)), rtol=0.01)
    np.testing.assert_allclose(drawn.light * drawn.entered, np.tile(exact, (64, 1)), rtol=0.02, atol=0.004)
    assert exact.std() > 0.1


@pytest.mark.slow
def test_photons_in_boxes_against_photons_at_points():
    """4096^2 photons, each in the pixel that it meets, agree within their lattice's noise; a deeper floor doesn't."""
    waves, pixels, side = sea(BEYOND), 64, 4096
    x = (np.arange(side) + 0.5) * TILE / side
    plain, deeper = np.zeros((2, pixels * pixels))
    for first in range(0, side, 512):
        for depth, found in ((DEPTH, plain), (1.01 * DEPTH, deeper)):
            sent = photons(waves, x, x[first : first + 512], depth, 0.0, N)
            column, row = (np.mod(np.floor(one * pixels / TILE).astype(int), pixels) for one in (sent.x, sent.y))
            found += np.bincount((row * pixels + column).ravel(), sent.flux.ravel(), found.size) * (pixels / side) ** 2
    boxes = caustic_photons(waves, DEPTH, 0.0, N, pixels, 1024)
    off, wrong = (float(np.sqrt(np.mean((one - boxes.ravel()) ** 2))) for one in (plain, deeper))
    np.testing.assert_allclose(plain.mean(), boxes.mean(), rtol=1e-6)
    assert off < 0.003
    assert wrong > 3.0 * off


def test_photons_keep_the_light():
    """What enters comes to the floor."""
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
    for f in (BEFORE, BEYOND):
        for splat in Splat:
            for vertices in (128, 192, 256):
                drawn = caustic_map(context, sea(f), splat, vertices, SIDE, DEPTH)
                found = misfit(drawn.light, truth(f))
                table[f, splat, vertices] = found, drawn.fragments
    for f, vertices, most, rms in ((BEFORE, 256, 70_000, 0.008), (BEYOND, 192, 300_000, 0.025)):
        found, fragments = table[f, splat_for(f), vertices]
        assert fragments <= most
        assert found.rms < rms
        assert max(abs(found.bright), abs(found.dark)) < 0.005
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
    for f, vertices, most, rms in ((BEFORE, 256, 7e4, 0.008), (BEYOND, 192, 3e5, 0.025), (2.0, 160, 3e5, 0.1)):
        drawn = caustic_map(context, sea(f, seed), splat_for(f), vertices, SIDE, DEPTH)
        found = misfit(drawn.light, truth(f, seed))
        assert drawn.fragments <= most
        assert found.rms < rms
        assert max(abs(found.bright), abs(found.dark)) < 0.005


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
    fine = 512
    x = (np.arange(fine) + 0.5) * TILE / fine
    sent = photons(waves, x, x, DEPTH, 0.0, N)
    step = TILE / fine
    right, up = (np.stack([np.gradient(one, step, axis=axis) for one in (sent.x, sent.y)]) for axis in (1, 0))
    lines = sum(np.abs(edge).max(axis=0) for edge in (right, up, right + up))
    column, row = (np.mod(np.floor(one * pixels / TILE).astype(int), pixels) for one in (sent.x, sent.y))
    # Photons are as many as 1 / |det M| in a place: the mean of the lines' length over them is their sum over the area.
    expected = np.bincount((row * pixels + column).ravel(), lines.ravel(), pixels**2).reshape(pixels, pixels)
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
    for f, least in ((BEFORE, 0.002), (BEYOND, 0.002)):
        drawn = caustic_map(context, sea(f), Splat.WIREFRAME_ENERGY, SIDE, SIDE, DEPTH).light
        gathered, scattered = adaptive_filter(drawn), adaptive_filter(drawn, scatter=True)
        raw, soft, kept = (misfit(one, truth(f)) for one in (drawn, gathered, scattered))
        assert least < soft.energy < 0.1
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
        with pytest.raises(InputError, match=f"^{message}"):
            caustic_map(
                **{"context": context, "waves": waves, "splat": Splat.FACES, "vertices": 16, "pixels": 16, **given}
            )
    with pytest.raises(InputError, match=r"^F must be a number >= 0, got nan$"):
        splat_for(np.nan)
    with pytest.raises(InputError, match=r"^side must be a multiple of pixels = 48, got 64$"):
        caustic_photons(waves, DEPTH, 0.0, N, 48, 64)
    with pytest.raises(InputError, match=r"^tilt must be one at which no wave faces away .*, got 1.5 radians$"):
        caustic_photons(waves, DEPTH, 1.5, N, 16, 64)
    with pytest.raises(InputError, match=r"^light must be finite numbers \(rows, columns\), got shape \(3,\)$"):
        adaptive_filter(np.ones(3))

"""Photographs of a spot: what is simulated by another way, each step against what it must find, and the whole."""

from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from benchmarks import photo as bench
from profilefit.fitting.solver import CONVERGED, Solution, lowest
from profilefit.materials import CHANNELS
from profilefit.measured import model
from profilefit.measured.model import exact_light, u_of
from profilefit.measured.photo import exposure as bracket
from profilefit.measured.photo import medium, rings, setup, simulated, workflow
from profilefit.measured.photo.exposure import BayerPlane, Exposure, Picture
from profilefit.measured.photo.medium import Beliefs, Shot, halo, ring_means, ring_weights
from profilefit.measured.photo.rings import PixelScale, SpotRings, pixel_scale
from profilefit.measured.photo.simulated import SpotCamera, SpotOptics
from profilefit.measured.problem import Known
from profilefit.report.tables.fit_tables import photo_lines
from tests.fixtures import refused, slow

SETTING = bench.SETTING
OPTICS = SpotOptics()
ALPHA, LENGTH = 1.0 / 1.05, 1.0 / 1.05  # mu_s' 1, mu_a .05 per mm
PITCH = 0.06
SQUARE = PixelScale(np.diag([PITCH, PITCH, 1.0]), "known")
CAMERA = SpotCamera(sides=(800, 600), pitch=PITCH, centre=(13.3, -7.7), corner=0.0, speckle=0.05)


@pytest.fixture(scope="module")
def light():
    radii = simulated.radii(bench.FARTHEST, OPTICS)
    return radii, simulated.light(ALPHA, LENGTH, SETTING, OPTICS, radii)


def taken(light, times, seed, camera=CAMERA, electrons=1.0):
    return simulated.exposures_of(dict.fromkeys(CHANNELS, light), camera, electrons, times, seed)


def late(brightest, phase=0.0, camera=CAMERA):
    """Times of five exposures, by those that the camera states; the first fills half of its range."""
    first = 0.5 * camera.gain * (camera.white - camera.black) / brightest
    return {first * 4.0**step: first * 4.0**step * (1.0 + 0.05 * np.sin(step + phase)) for step in range(5)}


@pytest.fixture(scope="module")
def shots(light):
    times = late(light[1][0])
    return [bench.as_read(one, str(at)) for at, one in enumerate(taken(light, times, 3))], np.array([*times.values()])


def pictured(light):
    """Light of a plane of 300 x 400 pixels about its middle."""
    row, column = np.indices((300, 400))
    return np.interp(2.0 * PITCH * np.hypot(row - 150.0, column - 200.0), *light).astype(np.float32)


def found_in(picture):
    return rings.spot([Picture(picture, np.ones_like(picture), (0, 0), 2)], (800, 600), SQUARE, "shot")


def test_a_halos_mean_over_a_circle_is_that_of_points():
    turn = 2.0 * np.pi * (np.arange(4000) + 0.5) / 4000
    for d, rho in ((0.0, 1.0), (2.0, 0.5), (3.0, 3.0)):
        r2 = d * d + rho * rho - 2.0 * d * rho * np.cos(turn)
        expected = np.mean(3.0 * 4.0**3 / (2.0 * np.pi * (r2 + 16.0) ** 2.5))
        assert halo(4.0, np.array(d), np.array(rho)) == pytest.approx(expected, rel=1e-9)


def test_a_marker_gives_scale_and_tilt():
    """Printed in the plane of the spot, seen by 25 degrees aslant."""
    pixel, side, slant = 0.1, 20.0, np.cos(np.radians(25.0))
    marker = cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50), 7, 200)
    far = 400.0  # mm, of the camera
    places = [(x, y) for x, y in ((-30.0, -10.0), (-10.0, -10.0), (-10.0, 10.0), (-30.0, 10.0))]

    def seen(x, y):
        """Pixels of a place on the object, in perspective."""
        away = 1.0 + y * np.sin(np.radians(25.0)) / far
        return np.array([400.0 + x / pixel / away, 300.0 + y * slant / pixel / away], np.float32)

    corners = np.array([seen(*place) for place in places])
    to = cv2.getPerspectiveTransform(np.array([[0, 0], [200, 0], [200, 200], [0, 200]], np.float32), corners)
    picture = cv2.warpPerspective(marker, to, (800, 600), borderMode=cv2.BORDER_CONSTANT, borderValue=255)
    plane = BayerPlane("grey", picture.astype(np.float32), 255.0, (0, 0), 1)
    plate = pixel_scale("scale", f"aruco:{side:g}mm", [Exposure("marker", (plane,), (800, 600), 1.0, True)])
    at = np.array([seen(*place) for place in ((0.0, 0.0), (15.0, 0.0), (0.0, 15.0), (-12.0, -9.0))])
    x, y = plate.from_centre(at[:, 0], at[:, 1], tuple(at[0].tolist()))
    np.testing.assert_allclose(np.hypot(x, y), [0.0, 15.0, 15.0, 15.0], rtol=0.02, atol=1e-4)
    flat = PixelScale(np.diag([pixel, pixel, 1.0]), "")
    x, y = flat.from_centre(at[:, 0], at[:, 1], tuple(at[0].tolist()))
    assert np.hypot(x, y)[2] < 0.93 * 15.0, "a negative control: the tilt not known"


@pytest.mark.parametrize(("mu_s", "mu_a", "beam"), [(0.1, 0.01, 0.5), *slow((1.0, 0.05, 0.5), (0.2, 0.02, 0.2))])
def test_light_by_rings_is_that_by_hankels_integrals(mu_s, mu_a, beam):
    """Thin rings from the axis to 30 mm; weak scatterers under narrow beams, where J_0 turns fast, too."""
    optics = replace(OPTICS, falling=2.5, beam=beam)  # as a halo of the fit
    albedo, length = mu_s / (mu_s + mu_a), 1.0 / (mu_s + mu_a)
    r = np.geomspace(0.02, 30.0, 60)
    inner, outer = r * (1.0 - 1e-3), r * (1.0 + 1e-3)
    thin = SpotRings(inner, outer, np.zeros(r.size), np.eye(r.size))
    rho, weights, _ = ring_weights(optics.sigma, [optics.width], thin)
    point = np.array([u_of(albedo), np.log(length), 0.0])
    seen = weights @ model.Model(exact_light(SETTING)).density(point, rho)[0][:-1]
    share = np.array([1.0 - optics.glare, optics.glare])
    own, _ = ring_means(optics.sigma, [optics.width], thin)
    found = share @ (seen + optics.surface * own)
    np.testing.assert_allclose(found, simulated.light(albedo, length, SETTING, optics, r), rtol=3e-5)
    without = (seen + optics.surface * own)[0]
    assert np.abs(without / found - 1.0).max() > 0.01, "a negative control: no glare"


def test_a_brackets_times_gain_light_and_centre_are_those_of_the_camera(shots, light):
    exposures, real = shots
    times, _ = bracket.times(exposures)
    np.testing.assert_allclose(times / times[-1], real / real[-1], rtol=5e-3)
    own = bracket.sensor(exposures, times)
    assert own.gain == pytest.approx(CAMERA.gain, rel=0.1)
    assert own.read == pytest.approx(CAMERA.read / CAMERA.gain, rel=0.25)
    planes = bracket.merged(exposures, times, own)
    merged = planes[0]
    row, column = np.indices(merged.light.shape) * 2.0
    r = PITCH * np.hypot(column - 399.5 - CAMERA.centre[0], row - 299.5 - CAMERA.centre[1])
    expected = np.interp(r, *light) * real[-1] / CAMERA.gain
    far = (r > 6.0) & np.isfinite(merged.light)
    off = (merged.light - expected)[far] / np.sqrt(merged.variance[far] + ((CAMERA.speckle * expected[far]) ** 2))
    assert abs(off.mean()) < 0.05
    assert off.std() == pytest.approx(1.0, abs=0.08)
    found = rings.spot(planes[1:3], exposures[0].sides, SQUARE, "shot")
    assert found.centre == pytest.approx((399.5 + 13.3, 299.5 - 7.7), abs=0.5)


@pytest.mark.slow
def test_what_spills_out_of_full_pixels_does_not_change_times():
    """A card's spot is so steep that pixels that count lie beside those that overflow."""
    off = []
    for seed in range(6):
        optics = SpotOptics(core=0.0)
        radii = simulated.radii(bench.FARTHEST, optics)
        light = simulated.card(optics, radii)
        camera = replace(CAMERA, well=2.0e4)
        times = late(light[0], seed, camera)
        found = bracket.times([bench.as_read(one, "card") for one in taken((radii, light), times, seed, camera)])
        real = np.array(list(times.values()))
        errors = np.sqrt(np.diag(found.covariance))[:-1]
        assert np.all(errors < 0.03)
        off.append((np.log(found.value[:-1] / found.value[-1]) - np.log(real[:-1] / real[-1])) / errors)
    assert np.sqrt(np.mean(np.square(off))) < 1.6
    assert abs(np.mean(off)) < 1.2


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda light: np.zeros_like(light), "a spot of light, got darkness"),
        (lambda light: np.maximum(light, np.roll(light, 150, axis=1)), "one spot of light, got 2, apart"),
        (lambda light: np.roll(light, 190, axis=1), "from every border, got"),
        (lambda light: np.where(light > 0.2 * np.nanmax(light), np.nan, light), "does not clip, got"),
        (lambda light: np.full_like(light, np.nan), "does not clip, got 120000 pixels"),
    ],
    ids=["dark", "two", "border", "clipped", "all clipped"],
)
def test_pictures_that_cannot_be_measured_are_refused_in_a_line(light, change, said):
    refused(said, found_in, change(pictured(light)))


def test_a_stuck_pixel_elsewhere_is_left_out(light):
    (row, column), picture = np.indices((300, 400)), pictured(light)
    picture[np.hypot(row - 40.0, column - 90.0) <= 2.0] = np.nan
    assert found_in(picture).centre == pytest.approx((400.0, 300.0), abs=0.1)


def test_exposures_of_one_time_are_a_bracket(light):
    """Chance makes one of them the brighter."""
    first = min(late(light[1][0]))
    for seed in range(4):
        two = (*taken(light, {first: first}, seed), *taken(light, {first: first}, seed + 50))
        found = bracket.times([bench.as_read(one, str(at)) for at, one in enumerate(two)])
        np.testing.assert_allclose(found.value, 1.0, rtol=0.02)


def test_stated_times_of_one_value_have_any_order_and_those_that_pictures_contradict_are_named(shots):
    """A grey filter before the lens, say."""
    alike = [replace(one, seconds=0.1) for one in shots[0]]
    forth, back = bracket.times(alike), bracket.times(alike[::-1])
    np.testing.assert_array_equal(forth.value, back.value[::-1])
    assert forth.value[0] < 0.01
    (short, long, *_), _ = shots
    said = r"^1: expected less light than 0 has, which states a longer time, got 3\.94 times"
    refused(said, bracket.times, [replace(short, seconds=2.0), replace(long, seconds=1.0)])


def test_colours_are_in_order_however_the_sensor_has_them(shots):
    (short, *rest), _ = shots
    turned = [replace(one, planes=one.planes[::-1]) for one in (short, *rest)]
    assert [one.colour for one in turned[0].planes] == ["blue", "green", "green", "red"]
    assert workflow.bracketed(turned, SQUARE).colours == ("red", "green", "blue")


def test_rings_err_as_they_say(light):
    """Of twelve pictures, the scatter of each ring over its stated error; the mean of the ratios' squares."""
    edges, camera = rings.edges_of(15.0, 2 * PITCH), replace(CAMERA, grain=2.5)
    found = []
    for seed in range(12):
        (one,) = taken(light, {1.0: 2000.0 / light[1][0]}, seed, camera)
        exposure = bench.as_read(one, "one")
        greens = bracket.merged([exposure], np.ones(1), bracket.Sensor(camera.gain, 0.75))[1:3]
        found.append(rings.rings(greens, (399.5 + 13.3, 299.5 - 7.7), edges, SQUARE))
    values = np.array([one.value for one in found])
    stated = np.mean([np.diag(one.covariance) for one in found], axis=0)
    squares = values.var(axis=0, ddof=1) / stated
    assert 0.6 < squares.mean() < 1.5
    assert 0.4 < squares[:2].mean() < 2.4, "though a grain of speckle is wider than a sector there"


def made(*cards) -> tuple[Shot, np.ndarray]:
    """A shot of rings without noise, and its coordinates."""
    return setup.noiseless(SETTING, 1.0, 0.05, rings.edges_of(20.0, 0.1), cards, Beliefs(beam=BEAM))


def photographed(radii, light, camera, rng, colour, size):
    """Rings of one colour in photographs of the light, and of a white and a grey card."""
    card = simulated.card(OPTICS, radii)
    spot, white, grey = (
        workflow.bracketed(bench.exposures(radii, one, camera, rng), size) for one in (light, 0.9 * card, 0.18 * card)
    )
    cards = tuple(workflow.carded(one, colour, size, known, spot) for one, known in ((white, None), (grey, GREY)))
    return Shot(workflow.ringed(spot, colour, size), cards, exact_light(SETTING), Beliefs(beam=BEAM))


BEAM = Known(0.5, 0.05)
GREY = Known(0.18, 0.005)


@pytest.fixture(scope="module")
def carded():
    """A shot with both cards, and its coordinates."""
    return made(None, GREY)


@pytest.fixture(scope="module")
def fit(carded):
    return medium.fitted(carded[0])


def lines_of(fit):
    """What is said of a fit of red light."""
    shot = SimpleNamespace(spot=SimpleNamespace(centre=(1.0, 2.0)), sources=("one",))
    return photo_lines(SimpleNamespace(shot=shot, plate=SQUARE, notes=(), cards=(1,), fits={"red": fit}))


def test_derivatives_are_differences(carded):
    shot, x = carded
    slopes = shot.residuals(x)[1]
    up, down = (np.stack([shot.residuals(x + step * way)[0] for way in np.eye(x.size)]) for step in (1e-5, -1e-5))
    np.testing.assert_allclose((up - down).T / 2e-5, slopes, rtol=1e-3, atol=1e-4 * np.abs(slopes).max())


def test_light_without_noise_gives_its_medium(carded, fit):
    assert fit.converged
    assert (fit.values["mu_s'"], fit.values["mu_a"]) == (pytest.approx(1.0, rel=1e-4), pytest.approx(0.05, rel=1e-4))
    assert fit.chi2 < 1e-3
    np.testing.assert_allclose(fit.x, carded[1], atol=1e-3)


def test_a_search_that_does_not_end_is_said(monkeypatch, carded):
    monkeypatch.setattr(medium, "MAX_STEPS", 2)
    assert f"red: NO ANSWER: {medium.UNENDED}" in lines_of(medium.fitted(carded[0]))


def test_media_that_fit_as_well_are_named_and_no_answer(monkeypatch, carded, fit):
    """Another minimum beyond the intervals, its chi-square a little higher."""
    shot, x = carded
    assert (fit.rivals, fit.result) == ((), CONVERGED)
    rows, slopes = shot.residuals(x)
    ends = [Solution(x + at * np.eye(x.size)[0], rows + 0.1 * at, slopes, 1, CONVERGED) for at in (1, 0)]
    monkeypatch.setattr(Shot, "starts", range(2))
    monkeypatch.setattr(medium, "_descended", lambda shot, at: ends[at])
    fit = medium.fitted(replace(shot))
    assert (fit.x[0], fit.result, len(fit.rivals)) == (x[0], medium.RIVALLED, 1)
    assert fit.rivals[0].chi2 - fit.chi2 < medium.RIVAL
    ends[0] = Solution(ends[0].parameters, np.append(rows, np.sqrt(medium.RIVAL)), slopes, 1, CONVERGED)
    assert medium.fitted(replace(shot)).rivals == (), "negative control: a chance of 1 in 1000"
    assert any(line.startswith("red: ANOTHER MEDIUM FITS, TOO: mu_s' 0.855 1/mm") for line in lines_of(fit))


def test_the_lowest_chi_square_is_kept_though_its_descent_did_not_end():
    low, high = (
        Solution(np.full(3, at), np.full(2, at), np.eye(2, 3), 1, result)
        for at, result in ((1.0, "no convergence"), (2.0, CONVERGED))
    )
    kept = lowest([high, low])
    assert (kept.cost, kept.others) == (low.cost, (high,))


def test_a_beam_of_two_pixels_gives_its_medium():
    """Red pixels, of which few lie in the beam: the middle ring counts, and the search starts near the truth."""
    camera, rng = SpotCamera(sides=(300, 225), pitch=0.25), np.random.default_rng(4)
    radii, size = simulated.radii(60.0, OPTICS), PixelScale(np.diag([0.25, 0.25, 1.0]), "known")
    light = simulated.light(1.2 / 1.22, 1.0 / 1.22, SETTING, OPTICS, radii)
    fit = medium.fitted(photographed(radii, light, camera, rng, "red", size))
    for name, truth in (("mu_s'", 1.2), ("mu_a", 0.02)):
        assert fit.errors[name] < 0.15 * fit.values[name]
        assert abs(np.log(fit.values[name] / truth)) < 3.0 * fit.errors[name] / fit.values[name]


def test_cards_are_worth_what_is_said_and_glare_costs_it(carded):
    shot, x = made()
    alone, both = medium.fisher(shot, x), medium.fisher(*carded)
    assert both["mu_s'"] < 0.7 * alone["mu_s'"]
    assert both["mu_a"] < 0.6 * alone["mu_a"]
    blind = replace(shot, beliefs=replace(shot.beliefs, glare=Known(1e-6, 1e-6)))
    off = medium.fitted(blind).values["mu_a"] / 0.05 - 1.0
    assert off < -0.25, "glare that is not thought of reads as less absorption"


@pytest.mark.slow
@pytest.mark.parametrize("cards", [False, True])
def test_whole_photographs_give_their_medium(cards):
    """Twelve with every nuisance: errors over the stated ones."""
    found = [bench.outcome(cards, False, at) for at in range(12)]
    z = np.array([np.log1p(one.off) / one.stated for one in found])
    assert np.abs(z).max() < 4.0
    assert np.sqrt(np.mean(z**2)) < 1.5


@pytest.mark.slow
def test_few_photons_are_a_picture_too():
    optics = replace(OPTICS, glare=1e-9)
    radii = simulated.radii(bench.FARTHEST, optics)
    light = simulated.light(ALPHA, LENGTH, SETTING, optics, radii, photons=1000)
    assert CubicSpline(radii, light)(np.linspace(0.0, radii[-1], 100_000)).min() < 0.0, "a control"
    (one,) = taken((radii, light), {1.0: 1.0}, 3, electrons=1e4 / light[0])
    assert np.median(one.counts) == CAMERA.black < CAMERA.black + 2000 < one.counts.max()


@pytest.mark.slow
def test_photons_that_a_camera_sees_give_their_medium():
    """Light that no table knows: traced, of a medium whose g is the fit's, photographed with cards."""
    radii = simulated.radii(bench.FARTHEST, OPTICS)
    traced = simulated.light(ALPHA, LENGTH, SETTING, OPTICS, radii, photons=2**23, seed=7)
    shot = photographed(radii, traced, CAMERA, np.random.default_rng(5), "green", SQUARE)
    fit = medium.fitted(shot)
    for name, truth in (("mu_s'", 1.0), ("mu_a", 0.05)):
        assert fit.errors[name] < 0.06 * fit.values[name]
        assert abs(fit.values[name] - truth) < 3.0 * fit.errors[name]
    wrong = medium.fitted(replace(shot, light=exact_light(replace(SETTING, g=0.0))))
    assert wrong.chance < 1e-6, "a negative control: light of another g"


@pytest.mark.parametrize("sigma", [4.2, 0.5])
def test_light_of_a_ring_is_expected_where_its_pixels_lie(sigma):
    middle = (50.0, 50.0)  # pixels of a plane
    y, x = np.mgrid[:101, :101]
    light = np.exp(-0.5 * ((x - middle[0]) ** 2 + (y - middle[1]) ** 2) / sigma**2).astype(np.float32)
    edges = rings.edges_of(12.0, 1.0)
    found = rings.rings([Picture(light, light, (0, 0), 1)], middle, edges, PixelScale(np.eye(3), "told"))
    bright = found.value > 1e-3
    assert bright[0], "the middle, where no sector but four has pixels"
    expected, even = (
        2.0 * np.pi * sigma**2 * ring_means(sigma, [], one)[0][0] for one in (found, replace(found, pixels=None))
    )
    assert found.value[bright] == pytest.approx(expected[bright], rel=2e-3)
    assert np.any(np.abs(even / expected - 1.0)[bright] > 0.03), "a negative control: pixels taken for even by area"

"""Error of an option at a step edge; light on a plane, around a cylinder, of filters and of gathers, against sums."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.special import ndtr

from mcml_sim import Setting
from profilefit.scenes.skin.law import Separable
from profilefit.scenes.stage.reference.step_edge import by_law, edge_estimate, shifted_points, step_response
from profilefit.studies.choose import error as module
from profilefit.studies.choose.case import NOTHING, STEEPEST, Case, Option, Within
from profilefit.studies.choose.choice import laws
from profilefit.studies.choose.error import ReferenceLight, beyond, error, estimates, filtered, response
from tests.fixtures import refused
from tests.physics.choose.conftest import DIFFUSE, MFP

WITHIN = Within()


def test_nothing_leaves_the_whole_step_and_each_part_is_named(light, case):
    """What Lambert misses is the light from beyond the edge: here by hand, of the brightest channel."""
    found = error(NOTHING, case, light, WITHIN)
    missed = light.beyond(case.reflectance[0])(case.places(0, WITHIN))
    assert (found.model, found.channel) == (pytest.approx(0.6 * np.sqrt(np.mean(missed**2)), rel=1e-3), 0)
    assert found.noise == found.curvature == 0.0
    assert found.total == pytest.approx(found.model, rel=0.02)
    # Large pixels and curves are named.
    far = error(Option("separable", 17), replace(case, pixel=4.0), light, WITHIN)
    assert far.pixel > far.model
    bent = error(Option("separable", 33), replace(case, radius=2.0), light, WITHIN)
    assert bent.curvature > bent.model


@pytest.mark.slow
def test_own_law_has_noise_only(light, case, hazard):
    """The truth is the law itself: what is left falls with the samples, and pixels are small."""
    found = [error(Option("sampled", n, law=hazard), case, light, WITHIN) for n in (8, 64)]
    assert found[0].model == found[1].model == pytest.approx(0.0, abs=1e-12)
    assert found[0].noise > 3.0 * found[1].noise
    assert found[1].total == pytest.approx(np.hypot(found[1].noise, found[1].pixel), rel=0.2)


@pytest.mark.slow
def test_light_under_a_surface_is_exact(case):
    """The law of its index misses what its record says of it; one of a matched surface ten times that."""
    setting = Setting("diffuse", n=1.37)
    light, found = ReferenceLight(setting), laws(setting)
    own, matched = (
        error(Option("sampled", 64, law=found[name]), case, light, WITHIN)
        for name in ("hazard-diffuse-refracting", "quantile-diffuse")
    )
    assert own.model < 5e-4 < 5e-3 < matched.model
    x = np.array([0.1, 1.0])
    dark = 1.0 - step_response(x, light.alpha(0.6), setting=setting)
    np.testing.assert_allclose(light.beyond(0.6)(x), dark, atol=2e-5)
    assert ReferenceLight(setting).alpha(1.0) == 1.0  # no surface that refracts is white
    refused(r"index must be a refractive index in \[1, 1.6\], got 1.61", ReferenceLight, Setting(n=1.61))


def test_places():
    flat = Case((0.5, 0.5, 0.5), (1.0, 0.5, 0.02), pixel=0.1)
    np.testing.assert_allclose(flat.places(1, WITHIN)[[0, -1]], [0.05, 1.95])
    np.testing.assert_allclose(flat.places(2, WITHIN), [0.05, 0.15])  # two pixels at the least
    assert replace(flat, radius=2.0).places(0, WITHIN).max() <= 2.0 * np.sin(STEEPEST)
    refused(r"within.mfp must be a number of mean free paths in \(0, 100\], got 0", Within, mfp=0)
    refused(r"within.pixels must be a whole number in 1 ... 100, got 1000", Within, pixels=1000)


X = np.array([0.125, 0.625, 1.625])


def test_gaussians_are_found_again():
    weight, sigma = np.array([0.3, 0.7]), np.array([2.0, 0.4])
    u = np.linspace(0.0, np.arcsinh(module.FARTHEST / module.NEAR), 400)
    tail = ndtr(-module.NEAR * np.sinh(u)[:, None] / sigma) @ weight
    found = np.array(module.fitted(module.Beyond(CubicSpline(u, np.log(np.maximum(tail, 1e-15)))), 2))
    np.testing.assert_allclose(found[:, np.argsort(found[1])], [[0.7, 0.3], [0.4, 2.0]], rtol=1e-3)


def test_taps_of_a_gaussian():
    taps = module.OneGaussian(sigma=(2.0, 1.0, 0.5)).taps(33, np.array([2.0, 1.0, 0.5]))
    np.testing.assert_allclose(taps[:, :3].sum(axis=0), 1.0, rtol=1e-6)
    np.testing.assert_allclose(np.sqrt(taps[:, 3] ** 2 @ taps[:, :3]), [2.0, 1.0, 0.5], rtol=0.05)


@pytest.mark.parametrize("count", [2, 3, 4])
def test_more_gaussians_are_nearer(light, case, count):
    """On a plane; of so many taps that they do not matter."""

    def missed(number):
        share = light.beyond(case.reflectance[0])
        found = filtered(Option("gaussians", 255, number), case, light, 0, X)
        return np.max(np.abs(found - response(share, X, 1.0, np.inf)))

    assert missed(count) < missed(1)
    assert missed(count) < (0.02, 0.006, 0.004)[count - 2]


@pytest.mark.slow
def test_the_separable_kernel_is_as_wide_as_the_stage_makes_it(light, case):
    """At its quartile a step edge has risen to 3/4, within what 255 taps tell."""
    ((_, kernel, stretches),) = module.passes(Option("separable", 255), case, light)
    assert isinstance(kernel, Separable)
    alpha = np.array([light.alpha(a) for a in case.reflectance])
    np.testing.assert_allclose(stretches, kernel.stretches(alpha, np.array(case.mfp)), rtol=3e-3)
    quartile = np.array([light.beyond(case.reflectance[0]).quartile])
    assert filtered(Option("separable", 255), case, light, 0, quartile) == pytest.approx(0.75, abs=0.02)


def test_taps_are_lost_with_depth(light, case):
    """Light from around the cylinder is replaced by the point's own."""
    flat, wide, narrow = (
        filtered(Option("separable", 33), replace(case, radius=radius), light, 0, X) for radius in (np.inf, 1e4, 2.0)
    )
    np.testing.assert_allclose(wide, flat, atol=1e-3)
    assert np.all(narrow >= flat)
    assert np.max(narrow - flat) > 0.01


ALPHA = (0.9, 0.8, 0.7)
SAMPLES = 16


@pytest.mark.slow
def test_plane_is_the_plain_estimator(hazard, case):
    """Root mean square error of the longest channel; 4 % is what 1024 estimates tell."""
    x = np.array([0.2, 0.9, 2.0])
    found = estimates(hazard, ALPHA, SAMPLES, case, 0, x)
    plain = edge_estimate(by_law(hazard, 0.9), shifted_points(SAMPLES, 1024, 7), x, 0.9, DIFFUSE)
    truth = response(beyond(0.9, DIFFUSE, hazard), x, 1.0, np.inf)
    noise = np.sqrt(np.mean((found - truth[:, None]) ** 2))
    expected = np.sqrt(np.mean(plain.rmse**2))
    assert abs(noise / expected - 1.0) < 0.12  # three deviates of both
    fewer = estimates(hazard, ALPHA, 8, case, 0, x)
    assert abs(np.sqrt(np.mean((fewer - truth[:, None]) ** 2)) / expected - 1.0) > 0.12


@pytest.mark.slow
def test_cylinder_is_the_obvious_loop(hazard, case):
    curved = replace(case, radius=3.0, window=(20.0, 2.0))
    x, channel = 0.625, 1
    found = estimates(hazard, ALPHA, SAMPLES, curved, channel, np.array([x]))[0, 5]
    radii, known, angle = (one[5] for one in module.drawn(hazard, ALPHA[0], SAMPLES))
    lit, total = module.OWN * SAMPLES, module.OWN * SAMPLES
    for r, p, phi in zip(radii, known, angle, strict=True):
        across, up = x + r * math.cos(phi), r * math.sin(phi)
        middle = (math.floor(across / 0.25) + 0.5) * 0.25
        if abs(middle) >= 3.0 or abs(up) >= 2.0:
            continue
        normal = np.array([middle, math.sqrt(9.0 - middle**2)]) / 3.0  # of the pixel's plane; how high a ray meets it
        height = 3.0 * normal[1] - (across - middle) * normal[0] / normal[1]
        distance = math.hypot(r, height - math.sqrt(9.0 - x**2))
        profile = float(hazard.profile(distance, ALPHA[channel], MFP[channel])) * 2.0 * math.pi * r
        share = float(hazard.cdf(1e6, ALPHA[channel]))
        weight = profile / share / p / max(normal[1], module.LEAST_COSINE)
        weight /= float(hazard.albedo.reflectance(ALPHA[channel]))
        lit, total = lit + weight * (across > 0), total + weight
    assert abs(found - lit / total) < 1e-4


def test_short_paths_fade_to_lambert(hazard, case):
    """Below a twentieth of a pixel nothing is blurred; between that and a tenth a part is."""
    for pixel, is_blurred in ((30.0, False), (12.0, True)):
        found = estimates(hazard, ALPHA, 4, replace(case, pixel=pixel), 0, 0.05 * np.array([10.0]))
        assert np.any(found < 1.0) == is_blurred


ALBEDO = 0.85
PLACES = np.array([0.05, 0.4, 1.3, 3.0])


@pytest.fixture(scope="module")
def share(hazard):
    return beyond(ALBEDO, DIFFUSE, hazard)


def over_the_cylinder(law, place, radius):
    """Lit over visible, each a sum of the profile over strips in arc and height, closer together at the place."""
    at = np.arcsin(place / radius)
    steps = np.concatenate([[0.0], np.geomspace(1e-4, np.pi, 240)])
    edges = np.sort(np.clip(np.concatenate([at - steps, at + steps, [0.0]]), -np.pi / 2, np.pi / 2))
    height = np.concatenate([[0.0], np.geomspace(1e-4, 60.0, 240)])
    arc, up = 0.5 * (edges[1:] + edges[:-1]), 0.5 * (height[1:] + height[:-1])
    chord = 2.0 * radius * np.sin(0.5 * np.abs(arc - at))
    distance = np.hypot(chord[:, None], up)
    strips = law.profile(np.maximum(distance, 1e-9), ALBEDO) @ np.diff(height) * np.diff(edges)
    return strips[arc > 0].sum() / strips.sum()


def test_plane_is_the_integral_and_has_its_quartile(hazard, share):
    assert share(np.array(share.quartile)) == pytest.approx(0.25, abs=1e-9)
    expected = step_response(PLACES, ALBEDO, law=hazard)
    for mfp in (1.0, 3.0):
        np.testing.assert_allclose(response(share, mfp * PLACES, mfp, np.inf), expected, atol=2e-5)


@pytest.mark.parametrize("radius", [2.0, 8.0])
def test_cylinder_is_the_sum_over_its_surface(hazard, share, radius):
    """Straight through; 1e-3 is what the strips next to the source leave open."""
    places = PLACES[0.9 * radius > PLACES]
    found = response(share, places, 1.0, radius)
    expected = [over_the_cylinder(hazard, place, radius) for place in places]
    np.testing.assert_allclose(found, expected, atol=1e-3)
    assert radius > 4 or np.max(np.abs(response(share, places, 1.0, np.inf) - expected)) > 2.5e-3


def test_a_wide_cylinder_is_a_plane_and_a_window_takes_away_what_it_does_not_show(share):
    """Both ends far: nothing; near: the rest weighs more, and adds up to the same light."""
    whole = response(share, PLACES, 1.0, np.inf)
    np.testing.assert_allclose(response(share, PLACES, 1.0, 1e4), whole, atol=1e-4)
    np.testing.assert_allclose(response(share, PLACES, 1.0, np.inf, 1e3), whole, atol=1e-12)
    cut = response(share, PLACES, 1.0, np.inf, 4.0)
    lit = 1.0 - share(PLACES) - share(4.0 - PLACES)
    np.testing.assert_allclose(cut, lit / (lit + share(PLACES) - share(4.0 + PLACES)), rtol=1e-12)
    assert np.max(np.abs(cut - whole)) > 1e-3


@pytest.mark.parametrize("radius", [np.inf, 6.0])
def test_average_is_the_mean_over_the_pixel(share, radius):
    pixel = 0.8
    middles = pixel * (np.arange(3) + 0.5)
    fine = middles[:, None] + pixel * ((np.arange(20000) + 0.5) / 20000 - 0.5)
    expected = response(share, fine, 1.0, radius).mean(axis=1)
    np.testing.assert_allclose(module.averaged(share, middles, pixel, 1.0, radius), expected, atol=1e-5)
    assert abs(response(share, middles[:1], 1.0, radius) - expected[0])[0] > 1e-3

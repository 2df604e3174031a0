"""A surface that is seen, and the gather over it: footprints, exact curves, a double loop, conservation, gaps."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import planes
from mcml_sim import Setting, exact
from profilefit.errors import SettingError
from profilefit.scenes.skin.law import Separable
from profilefit.scenes.stage.exact_law import DIFFUSE, ExactLaw, exact_table
from profilefit.scenes.stage.reference.step_edge import step_response
from profilefit.scenes.stage.reference.surface import LEAST_COSINE, Surface, View, exitance_of, gathered, refined, seen
from tests.fixtures import slow
from tests.unit.scenes.scenes import refused

FORWARD = np.array([0.0, 0.0, -1.0])
NORMAL = np.array([0.5, -0.3, np.sqrt(1.0 - 0.34)])
THROUGH = np.array([0.2, 0.1, -40.0])
VIEW = View(0.5)
MFP = np.array([1.5, 0.8, 2.2])
NODES, WEIGHTS = np.polynomial.legendre.leggauss(10)
REFLECTANCES = np.concatenate([np.linspace(0.013, 0.987, 24), [1e-4, 2e-3, 0.9991, 0.99993]])
SKIN, REFRACTED = Setting("diffuse", n=1.4), np.concatenate([np.linspace(0.013, 0.905, 24), [1e-4, 2e-3, 0.922]])
RADII = np.geomspace(1.1e-5, 2.9e3, 41)


def hit(view, column, row):
    """Where the ray at so many pixels from the middle meets the plane through THROUGH."""
    aside = np.array([column * view.pixel, row * view.pixel, 0.0])
    origin, ray = (np.zeros(3), FORWARD + aside) if view.is_perspective else (aside, FORWARD)
    return origin + ray * ((THROUGH - origin) @ NORMAL / (ray @ NORMAL))


@pytest.mark.parametrize("view", [View(0.5), View(0.002, True)])
def test_footprint_joins_the_corners_of_a_pixel(view):
    across, along = view.footprint(hit(view, 7, 4), NORMAL)
    half = 1e-3  # of a pixel: in perspective a footprint is a parallelogram to first order only
    np.testing.assert_allclose(across, (hit(view, 7 + half, 4) - hit(view, 7 - half, 4)) / (2 * half), rtol=1e-5)
    np.testing.assert_allclose(along, (hit(view, 7, 4 + half) - hit(view, 7, 4 - half)) / (2 * half), rtol=1e-5)
    np.testing.assert_allclose([across @ NORMAL, along @ NORMAL], 0.0, atol=1e-12)
    if not view.is_perspective:
        assert np.linalg.norm(np.cross(across, along)) == pytest.approx(0.25 / NORMAL[2])


def test_footprints_of_an_outline_and_of_the_background():
    """One is bounded. A render's positions and normals are 0 in the other; a 0 / 0 would warn, an error here."""
    across, along = View(2.0).footprint(np.zeros(3), np.array([1.0, 0.0, 0.0]))
    assert np.linalg.norm(np.cross(across, along)) <= 1.01 * 4.0 / LEAST_COSINE
    position, normal = np.stack([THROUGH, np.zeros(3)]), np.stack([NORMAL, np.zeros(3)])
    view = View(0.002, True)
    across, along = view.footprint(position, normal)
    np.testing.assert_array_equal(np.stack([across[1], along[1]]), 0.0)
    np.testing.assert_array_equal(across[0], view.footprint(THROUGH, NORMAL)[0])


def test_coarsened_is_the_mean_of_blocks():
    light = np.arange(48.0).reshape(4, 4, 3)
    mask = np.ones((4, 4), bool)
    mask[0, 0] = False
    coarse = flat(4, 4, 0.5)._replace(irradiance=light, mask=mask).coarsened(2)
    np.testing.assert_array_equal(coarse.mask, [[False, True], [True, True]])
    np.testing.assert_allclose(coarse.irradiance[1, 1], light[2:, 2:].mean(axis=(0, 1)))


def test_seen_is_the_render_in_view_space():
    surface, view = seen(planes.step_edge((6, 4), 0.5, [0.2, 0.5, 1.0]))
    across, along = view.footprint(surface.position, surface.normal)
    np.testing.assert_allclose(across[1, 2], surface.position[1, 3] - surface.position[1, 2])
    np.testing.assert_allclose(along[1, 2], surface.position[2, 2] - surface.position[1, 2])
    assert surface.mask.all()
    assert not view.is_perspective
    plane = planes.flat((4, 1), 0.5, 0.5)
    mask = np.array([[0.0, 0.5, np.nextafter(np.float32(0.5), np.float32(1.0)), 1.0]], np.float32)
    np.testing.assert_array_equal(seen(replace(plane, mask=mask))[0].mask, [[False, False, True, True]])


def flat(h, w, reflectance, irradiance=1.0, pixel=0.5):
    return seen(planes.flat((w, h), pixel, reflectance, irradiance))[0]


def hill(h, w, seed=3):
    """A rough, coloured surface with a hole."""
    x, y = np.meshgrid(VIEW.pixel * np.arange(w), VIEW.pixel * np.arange(h))
    position = np.stack([x, y, 0.4 * np.sin(x) + 0.2 * np.cos(1.3 * y)], axis=-1)
    normal = np.stack([-0.4 * np.cos(x), 0.26 * np.sin(1.3 * y), np.ones_like(x)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    random = np.random.default_rng(seed)
    mask = np.ones((h, w), bool)
    mask[1, 2] = False
    return Surface(position, normal, random.random((h, w, 3)), 0.1 + 0.8 * random.random((h, w, 3)), mask)


def patch(side, other, offset, density):
    """Integral of a density of the distance over a parallelogram whose middle is at `offset`."""
    a, b = (0.5 * g.ravel()[:, None] for g in np.meshgrid(NODES, NODES))
    weights = 0.25 * np.outer(WEIGHTS, WEIGHTS).ravel()
    r = np.linalg.norm(offset + a * side + b * other, axis=1)
    return np.linalg.norm(np.cross(side, other)) * weights @ density(r)


def own_patch(side, other, density):
    """The same around the source: four triangles s ((1 - t) p + t q), whose area element s takes the 1/r away."""
    corners = [0.5 * (a * side + b * other) for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1))]
    s, t = (0.5 * (g.ravel() + 1.0) for g in np.meshgrid(NODES, NODES))
    weights = 0.25 * np.outer(WEIGHTS, WEIGHTS).ravel()
    total = 0.0
    for p, q in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        r = s * np.linalg.norm((1 - t)[:, None] * p + t[:, None] * q, axis=1)
        total += np.linalg.norm(np.cross(p, q)) * weights @ (s * density(r))
    return total


def double_loop(surface, view, mfp, setting, pixels):
    """Every pair by itself, with profiles from `exact`."""
    across, along = view.footprint(surface.position, surface.normal)
    alpha = exact_table(setting).curves(surface.reflectance.ravel()).alpha.reshape(surface.reflectance.shape)
    light = np.zeros((len(pixels), 3))
    share = np.zeros((len(pixels), 3))
    for k, o in enumerate(map(tuple, pixels)):
        for c in range(3):

            def density(r, a=alpha[o][c], length=mfp[c], total=surface.reflectance[o][c]):
                return exact.profile(r, a, length, setting=setting) / total

            for i in map(tuple, np.argwhere(surface.mask)):
                offset = surface.position[i] - surface.position[o]
                sides = across[i], along[i]
                weight = own_patch(*sides, density) if i == o else patch(*sides, offset, density)
                light[k, c] += weight * surface.irradiance[i][c]
                share[k, c] += weight
    return surface.reflectance[tuple(np.transpose(pixels))] * light / share, share


@pytest.mark.slow
def test_is_the_double_loop():
    """Also where light and reflectance are random from pixel to pixel, of 0.23 to 0.6 mfp."""
    surface, pixels = hill(3, 16), np.array([[0, 1], [2, 15]])
    light, share = double_loop(surface, VIEW, MFP, DIFFUSE, pixels)
    found = gathered(surface, VIEW, MFP, DIFFUSE, pixels)
    np.testing.assert_allclose(found.light, light, rtol=2e-4)
    np.testing.assert_allclose(found.share, share, rtol=2e-4)
    other = gathered(surface, VIEW, 1.01 * MFP, DIFFUSE, pixels)
    assert np.max(np.abs(other.share / share - 1.0)) > 2e-3


@pytest.mark.slow
def test_an_outline_under_even_light():
    """Where a plane ends, Gaussians hang over its edge also if the light is the same all around."""
    dark = np.where(np.arange(16) < 8, 1.0, 0.2)[None, :, None] * np.ones((10, 1, 3))
    surface, pixels = flat(10, 16, 0.7)._replace(irradiance=dark), np.array([[0, 0], [5, 0], [0, 4], [5, 4]])
    mfp = np.array([2.0, 1.0, 0.5])
    light, share = double_loop(surface, VIEW, mfp, DIFFUSE, pixels)
    found = gathered(surface, VIEW, mfp, DIFFUSE, pixels)
    np.testing.assert_allclose(found.light, light, atol=1e-3 * light.mean())
    np.testing.assert_allclose(found.share, share, atol=2e-3)


@pytest.mark.slow
def test_edges_of_colours_across_merged_elements():
    """Light of one colour begins where another ends: each keeps the first moment of its own."""
    surface, view = seen(planes.step_edge((256, 256), 0.1, [0.5, 0.5, 0.5]))
    lit = surface.irradiance.copy()
    lit[..., 1] = 1.0 - lit[..., 0]
    pixels = np.stack([np.full(17, 128), np.arange(112, 129 + 16, 2)[:17]], axis=1)
    x = surface.position[128, pixels[:, 1], 0]
    found = gathered(surface._replace(irradiance=lit), view, np.ones(3), DIFFUSE, pixels).light / 0.5
    truth = step_response(x, exact_table(DIFFUSE).curves([0.5]).alpha[0], setting=DIFFUSE)
    assert np.max(np.abs(found[:, 0] - truth)) < 3e-4
    assert np.max(np.abs(found[:, 1] - (1.0 - truth))) < 3e-4


@pytest.mark.slow
def test_islands_far_apart():
    """Points of two islands may gather together; neither takes light of the other, nor loses digits."""
    surface = flat(6, 24, 0.7)
    position = surface.position + np.where(np.arange(24) < 11, 0.0, 1500.0)[None, :, None] * np.array([1.0, 0.0, 0.0])
    lit = np.random.default_rng(4).random((6, 24, 3))
    both = surface._replace(position=position, irradiance=lit)
    pixels = np.argwhere(surface.mask)
    found = gathered(both, VIEW, MFP, DIFFUSE, pixels)
    mask = np.broadcast_to(np.arange(24) < 11, (6, 24))
    for island in (mask, ~mask):
        here = island[tuple(pixels.T)]
        own = gathered(both._replace(mask=island), VIEW, MFP, DIFFUSE, pixels[here])
        np.testing.assert_allclose(found.light[here], own.light, rtol=1e-4)
        np.testing.assert_allclose(found.share[here], own.share, rtol=1e-4)


@pytest.mark.parametrize("reflectance", [*slow(0.0), 0.5, *slow(1.0)])
def test_even_light_on_even_skin_is_conserved(reflectance):
    found = gathered(flat(12, 24, reflectance, 0.75), VIEW, MFP)
    np.testing.assert_allclose(found.light, 0.75 * reflectance, rtol=1e-14, atol=0.0)
    assert np.all((found.share > 0.1) & (found.share < 1.0))


@pytest.mark.slow
def test_step_edge_is_the_integral():
    """Of a plane that ends 16 mfp away, with pixels of half a mfp."""
    surface, view = seen(planes.step_edge((64, 64), 0.5, [0.1, 0.3, 0.5]))
    pixels = np.stack([np.full(17, 32), np.arange(24, 41)], axis=1)
    x = surface.position[32, 24:41, 0]
    found = gathered(surface, view, np.ones(3), DIFFUSE, pixels)
    alpha = exact_table(DIFFUSE).curves([0.1, 0.3, 0.5]).alpha
    share = found.light / [0.1, 0.3, 0.5]
    assert np.max(np.abs(share - step_response(x[:, None], alpha, setting=DIFFUSE))) < 1e-4
    assert np.all(np.abs(found.share - 1.0) < 1e-3)
    for wrong in (step_response(x[:, None] + 0.01, alpha, setting=DIFFUSE), step_response(x[:, None], alpha)):
        assert np.max(np.abs(share - wrong)) > 1e-3


def test_many_small_pixels_are_the_integral_too():
    """Sixty-five thousand pixels of an eighth of a mfp, most of which are merged for most of the Gaussians."""
    surface, view = seen(planes.step_edge((256, 256), 0.125, [0.1, 0.3, 0.5]))
    pixels = np.stack([np.full(9, 128), np.arange(112, 145, 4)], axis=1)
    x = surface.position[128, 112:145:4, 0]
    found = gathered(surface, view, np.ones(3), DIFFUSE, pixels)
    alpha = exact_table(DIFFUSE).curves([0.1, 0.3, 0.5]).alpha
    share = found.light / [0.1, 0.3, 0.5]
    assert np.max(np.abs(share - step_response(x[:, None], alpha, setting=DIFFUSE))) < 2e-4
    assert np.max(np.abs(share - step_response(x[:, None] + 0.01, alpha, setting=DIFFUSE))) > 1e-3


@pytest.mark.slow
def test_short_mean_free_path_is_lambert():
    surface = hill(4, 6)
    found = gathered(surface, VIEW, np.full(3, 1e-3))
    lambert = surface.reflectance * surface.irradiance
    np.testing.assert_allclose(found.light[surface.mask], lambert[surface.mask], rtol=1e-3)
    assert not found.light[1, 2].any()


@pytest.mark.slow
def test_no_light_crosses_a_gap_in_depth():
    surface = flat(8, 24, 0.8)
    near = np.broadcast_to(np.arange(24) < 12, (8, 24))
    position = surface.position - np.where(near, 0.0, 60.0)[..., None] * [0.0, 0.0, 1.0]
    lit = np.where(near, 0.0, 1.0)[..., None] * np.ones(3)
    level = surface._replace(irradiance=lit)
    assert np.max(gathered(level._replace(position=position), VIEW, np.ones(3)).light[near]) < 1e-4
    assert np.max(gathered(level, VIEW, np.ones(3)).light[near]) > 0.1


@pytest.mark.slow
def test_refined_says_what_coarse_pixels_cost():
    fine, view = seen(planes.step_edge((48, 48), 0.25, [0.3, 0.5, 0.7]))
    pixels = np.array([[12, 11], [12, 12], [12, 15]])
    light, change = refined(fine, view, np.ones(3), DIFFUSE, pixels)
    coarse = gathered(fine.coarsened(2), view._replace(pixel=0.5), np.ones(3), DIFFUSE, pixels)
    np.testing.assert_allclose(coarse.light - light, change, atol=1e-15)
    assert 1e-4 < np.max(np.abs(change)) < 0.02


@pytest.mark.slow
def test_a_table_of_ones_own():
    """One that knows its curves by (A - 0.1) / 0.8: the same light as of A itself, but for rounding."""

    def stretched(values):
        assert values.size % 3 == 0
        return exact_table(DIFFUSE).curves(0.1 + 0.8 * values)

    surface = hill(4, 6)
    values = surface._replace(reflectance=(surface.reflectance - 0.1) / 0.8)
    itself = surface._replace(reflectance=0.1 + 0.8 * values.reflectance)
    found, truth = gathered(values, VIEW, MFP, SimpleNamespace(curves=stretched)), gathered(itself, VIEW, MFP)
    np.testing.assert_allclose(found.light, truth.light, rtol=1e-12)
    np.testing.assert_allclose(found.share, truth.share, rtol=1e-12)
    assert np.max(np.abs(gathered(values, VIEW, MFP).light - truth.light)) > 0.01  # the comparison can fail
    # In a picture, where nothing scatters inside, the map is A all the same.
    half = SimpleNamespace(curves=lambda values: exact_table(DIFFUSE).curves(0.5 * values))
    mask = np.ones((4, 6), np.float32)
    mask[:, 0] = 0.0
    picture = replace(planes.flat((6, 4), 1.0, 0.8), mask=mask)
    light = exitance_of(picture, np.ones(3), half)
    np.testing.assert_allclose(light[:, 1:], 0.4, rtol=1e-6)  # float32 of 0.8
    np.testing.assert_allclose(light[:, 0], 0.8, rtol=1e-6)


def test_what_cannot_be_gathered():
    surface = flat(4, 6, 0.5)
    refused("table must be a Setting, or have a method curves, got 'diffuse'", gathered, surface, VIEW, MFP, "diffuse")
    refused("mfp must be three lengths > 0", gathered, surface, VIEW, [1.0, 0.0, 1.0])
    refused(r"pixels must be visible ones, got \(4, 0\)", gathered, surface, VIEW, MFP, pixels=[[4, 0]])
    refused("pixels must be pairs", gathered, surface, VIEW, MFP, pixels=[[1.0, 2.0]])
    refused("factor must divide 2 and 3, got 2", flat(2, 3, 0.5).coarsened, 2)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("setting", "values", "same", "faint", "most", "share"),
    [
        (Setting(), REFLECTANCES, 1e-8, 1e-10, 1e-5, {"rtol": 1e-6}),
        (DIFFUSE, REFLECTANCES, 1e-8, 1e-10, 1e-5, {"rtol": 1e-6}),
        (SKIN, REFRACTED, 1e-7, 1e-8, 1e-3, {"rtol": 1e-7, "atol": 1e-7}),
    ],
    ids=["searchlight", "diffuse", "a surface that refracts"],
)
def test_is_the_exact_half_space(setting, values, same, faint, most, share):
    curves = exact_table(setting).curves(values)
    np.testing.assert_allclose(exact.reflectance(curves.alpha, setting), values, rtol=same)
    x, alpha = np.broadcast_to(RADII, (values.size, RADII.size)), curves.alpha[:, None]
    truth, density = exact.profile(RADII, alpha, setting=setting) / values[:, None], curves.density(x)
    bright = RADII**2 * truth > faint
    assert np.max(np.abs(density - truth)[bright] / truth[bright]) < most
    assert np.all(np.isfinite(density))
    np.testing.assert_allclose(curves.share(x), exact.cdf(RADII, alpha, setting=setting), **share)
    if setting.n == 1.0:
        assert np.all(density[~bright] * np.broadcast_to(RADII**2, bright.shape)[~bright] < 1.01 * faint)
        shifted = exact_table(setting).curves(values * 0.9999)  # the comparison can fail
        assert np.max(np.abs(shifted.density(x) - truth)[bright] / truth[bright]) > most


@pytest.mark.slow
def test_ends():
    table = exact_table(DIFFUSE)
    curves = table.curves([0.0, 1.0])
    np.testing.assert_array_equal(curves.alpha, [0.0, 1.0])
    x = np.array([[0.0, 1e9], [0.0, 1e9]])
    assert np.all(np.isfinite(curves.density(x)))
    np.testing.assert_allclose(curves.share(x), [[0.0, 1.0], [0.0, 1.0]], atol=2e-4)
    refused(r"reflectance must be a list of numbers in \[0, 1\]", table.curves, [1.2])


@pytest.mark.parametrize("made", [lambda own: ExactLaw((0.5,), own), exact_table, lambda own: Separable(setting=own)])
def test_scattering_with_a_direction_is_refused(made):
    refused(r"setting must have g = 0, got diffuse, n = 1\.4, g = 0\.8", made, replace(SKIN, g=0.8), error=SettingError)

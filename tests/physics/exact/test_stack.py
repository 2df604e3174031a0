"""Layers solved exactly: against closed forms, adding-doubling, conservation of energy, their own cuts, and photons."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import expn, j0

from mcml_sim import Grid, Layer, Medium, Setting, exact, half_space, simulate
from mcml_sim.exact.single_scattering import entered
from mcml_sim.exact.stack import fluence, quadrature, solution
from mcml_sim.exact.stack.solution import STANDARD
from tests.fixtures import refused, slow
from tests.physics.tracing import adding_doubling
from tests.physics.tracing.test_diffuse import CHANCE, likelihood

BOTH = pytest.mark.parametrize("illumination", ["diffuse", *slow("searchlight")])
RADII = np.geomspace(1e-3, 15.0, 40)

MATCHED = Medium((Layer(1.0, 0.1, 2.0, 0.0, 0.5), Layer(1.0, 0.5, 0.5, 0.0, 0.7), Layer(1.0, 0.05, 1.5, 0.0)))
# Clear and purely absorbing layers, and another index below.
GLAZED = Medium(
    (Layer(1.4, 0.0, 0.0, 0.0, 0.2), Layer(1.4, 0.3, 3.0, 0.0, 0.5), Layer(1.4, 0.5, 0.0, 0.0, 0.1)), n_below=1.2
)
REFRACTING = Medium((Layer(1.4, 0.1, 2.0, 0.0, 0.5), Layer(1.4, 0.5, 0.5, 0.0, 0.7), Layer(1.4, 0.05, 1.5, 0.0)))
PLATE = Medium((Layer(1.4, 0.01, 1.0, 0.0, 0.05), Layer(1.4, 0.1, 1.0, 0.0, 0.05)))
LAYER = Layer(1.3, 1.0, 1.0, 0.0, 1.0)
UNDER_GLASS = Medium((Layer(1.3, 0.1, 2.0, 0.0, 0.3), Layer(1.3, 0.5, 1.5, 0.0, 0.4)), n_above=1.5)


def cut(alpha, n=1.0, change=1e-9):
    """A half space of one mean free path cut into three layers, none quite equal to another."""
    absorbs, scatters = 1 - alpha, alpha
    above = Layer(n, absorbs, scatters, 0.0, 0.3), Layer(n, absorbs * (1 + change), scatters, 0.0, 1.0)
    return Medium((*above, Layer(n, absorbs, scatters * (1 + change), 0.0)))


def random_stack(rng, white=False):
    """Two to four layers between equal media."""
    n, layers = rng.uniform(1.0, 1.5), []
    for _ in range(rng.integers(2, 5)):
        alpha = 1.0 if white else 1 - np.exp(rng.uniform(np.log(1e-3), np.log(0.7)))
        mu_t, optical = np.exp(rng.uniform(np.log(0.1), np.log(10.0))), np.exp(rng.uniform(np.log(0.05), np.log(10.0)))
        layers.append(Layer(n, (1 - alpha) * mu_t, alpha * mu_t, 0.0, optical / mu_t))
    return Medium(tuple(layers))


def absorbed(medium, illumination):
    """Integrals of mu_a phi over layers that all scatter and end."""
    here = quadrature.stack(medium, 0.0, STANDARD)
    light = here.absorbs * fluence.solve(here, 0.0, STANDARD).phi[illumination]
    return np.bincount(np.searchsorted(medium.z_edges[1:-1], here.z), light, minlength=len(medium.layers))


@pytest.mark.parametrize("alpha", [0.3, 0.9, 0.999, 1.0])
@BOTH
def test_one_matched_layer_is_the_exact_half_space(alpha, illumination):
    found = exact.solve(half_space(alpha), illumination)
    assert found.reflectance == pytest.approx(exact.reflectance(alpha, Setting(illumination)), rel=1e-7)
    assert found.transmittance is None
    assert found.error < 1e-5


@pytest.mark.parametrize(
    ("n", "alpha", "illumination", "reflectance"),
    [
        (1.4, 0.5, "searchlight", 0.0523015670),
        (1.4, 0.99, "searchlight", 0.6035892943),
        # Giovanelli, Optica Acta 2, 1955
        (1.5, 0.9, "searchlight", 0.2199185699),
        (1.5, 0.9, "diffuse", 0.2161120812),
    ],
)
def test_half_spaces_that_refract(n, alpha, illumination, reflectance):
    assert exact.solve(half_space(alpha, n=n), illumination).reflectance == pytest.approx(reflectance, rel=3e-9)


@BOTH
@pytest.mark.parametrize("n", [1.0, pytest.param(1.4, marks=pytest.mark.slow)])
def test_a_half_space_may_be_cut(n, illumination):
    setting, found = Setting(illumination, n=n), exact.solve(cut(0.9, n), illumination)
    assert found.reflectance == pytest.approx(exact.reflectance(0.9, setting), rel=5e-9)
    np.testing.assert_allclose(found.profile(RADII), exact.profile(RADII, 0.9, setting=setting), rtol=5e-8)
    np.testing.assert_allclose(found.cdf(RADII), exact.cdf(RADII, 0.9, setting=setting), atol=1e-8)
    # Negative control: a change of 0.1 % in the layers below the first is seen.
    other = exact.solve(cut(0.9, n, 1e-3), illumination)
    assert other.reflectance != pytest.approx(found.reflectance, rel=1e-5)


@pytest.mark.parametrize(("stacks", "seed", "angles"), [(4, 4, 6), *slow((20, 5, 9))])
def test_adding_and_doubling_agrees(stacks, seed, angles):
    rng = np.random.default_rng(seed)
    for _ in range(stacks):
        medium = random_stack(rng)
        reflected = adding_doubling.solve(medium, angles=angles, nodes=8).reflected.sum()
        assert exact.solve(medium).reflectance == pytest.approx(reflected, rel=2e-7)
        if seed == 4:
            swapped = replace(medium, layers=(*medium.layers[1::-1], *medium.layers[2:]))
            assert exact.solve(swapped).reflectance != pytest.approx(reflected, rel=1e-3)


@BOTH
@pytest.mark.parametrize("white", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_no_light_is_lost(white, illumination):
    rng = np.random.default_rng(6)
    for above, below in ((1.0, 1.0), (1.0, 1.6), (1.6, 1.0), (1.6, 1.6)):
        medium = replace(random_stack(rng, white), n_above=above, n_below=below)
        found = exact.solve(medium, illumination)
        total = found.specular + found.reflectance + found.transmittance
        assert total + absorbed(medium, illumination).sum() == pytest.approx(1, abs=2e-9)
        np.testing.assert_allclose(found.absorbed, absorbed(medium, illumination), atol=2e-9)
        assert found.absorbed_error < 1e-7
        if not white:
            assert total + found.absorbed.sum() == pytest.approx(1, abs=1e-14)


@pytest.mark.parametrize("illumination", ["searchlight", "diffuse"])
def test_light_that_layers_absorb(illumination):
    """Layers that do not scatter, as ones that all but don't; else Beer's law; endless ones; white ones, nothing."""
    hazy = replace(GLAZED, layers=tuple(replace(layer, mu_s=layer.mu_s or 1e-9) for layer in GLAZED.layers))
    found = exact.solve(GLAZED, illumination)
    np.testing.assert_allclose(found.absorbed, absorbed(hazy, illumination), atol=2e-9)
    assert found.absorbed[0] == 0
    dark = Medium(
        (Layer(1.3, 0.5, 0.0, 0.0, 1.0), Layer(1.3, 0.0, 0.0, 0.0, 1.0), Layer(1.3, 2.0, 0.0, 0.0)), n_above=1.3
    )
    left = np.exp(-0.5) if illumination == "searchlight" else 2 * expn(3, 0.5)
    np.testing.assert_allclose(exact.solve(dark, illumination).absorbed, [1 - left, 0.0, left], atol=1e-12)
    for medium in (MATCHED, REFRACTING):
        found, same = exact.solve(medium, illumination), exact.solve(replace(medium, layers=(
            *medium.layers[:2], replace(medium.layers[2], thickness=2.0), medium.layers[2])), illumination)  # fmt: skip
        assert found.specular + found.reflectance + found.absorbed.sum() == pytest.approx(1, abs=1e-14)
        np.testing.assert_allclose(found.absorbed, [*same.absorbed[:2], same.absorbed[2:].sum()], atol=2e-9)
    white = Medium((Layer(1.4, 0.0, 1.0, 0.0, 0.5), Layer(1.4, 0.0, 3.0, 0.0, 0.5)))
    np.testing.assert_array_equal(exact.solve(white, illumination).absorbed, [0.0, 0.0])


@pytest.mark.slow
@pytest.mark.parametrize("illumination", ["diffuse", "searchlight"])
def test_the_way_a_thin_plate_is_solved_is_the_other_in_thicker_ones(illumination, monkeypatch):
    """What is taken away from its transform is the half space by mirror and cone, or in layers like its own."""
    r, plate = np.array([0.001, 0.1, 1.0, 5.0]), Medium((replace(PLATE.layers[0], thickness=1.5),))
    thick = exact.solve(plate, illumination).profile(r)
    monkeypatch.setattr(solution, "THIN", 2.0)
    thin = exact.solve(plate, illumination).profile(r)
    np.testing.assert_allclose(thin, thick, rtol=2e-5)
    assert not np.array_equal(thin, thick)


@BOTH
def test_fewer_nodes_state_the_larger_error_that_they_have(illumination):
    right, few = (exact.solve(GLAZED, illumination, nodes) for nodes in (solution.FINE, exact.Nodes(6, 5, 5)))
    assert abs(few.reflectance / right.reflectance - 1) < few.error
    assert few.error > 1e3 * exact.solve(GLAZED, illumination).error
    # A white half space sends all light back.
    medium = Medium((Layer(1.4, 0.0, 1.0, 0.0, 0.5), Layer(1.4, 0.0, 3.0, 0.0)))
    found = exact.solve(medium, illumination)
    assert found.reflectance == pytest.approx(entered(Setting(illumination, n=1.4)), rel=1e-6)


@pytest.mark.parametrize("optical", [1e-3, 1e3])
def test_thin_and_thick_plates(optical):
    """Of white matter: little and nearly all comes back."""
    plate = Medium((Layer(1.0, 0.0, 1.0, 0.0, optical / 2), Layer(1.0, 0.0, 2.0, 0.0, optical / 4)))
    found = exact.solve(plate)
    assert found.reflectance + found.transmittance == pytest.approx(1, abs=1e-7)
    if optical < 1:
        assert found.reflectance == pytest.approx(optical / 2, rel=0.02)
    else:
        # H(1) / sqrt(3) at the front and Milne's extrapolated ends (Chandrasekhar 1950; Case & Zweifel 1967).
        found_at = (2.907810529 / np.sqrt(3)) / (optical + 2 * 0.7104460896)
        assert found.transmittance == pytest.approx(found_at, rel=1e-6)


@BOTH
@pytest.mark.parametrize(
    "medium", [MATCHED, *(pytest.param(replace(GLAZED, n_above=n), marks=pytest.mark.slow) for n in (1.4, 1.0))]
)
def test_the_transform_is_the_profiles(medium, illumination):
    """int_0^R 2 pi r R_d J0(k r) dr by quadrature over radii, with what lies at r = 0."""
    found = exact.solve(medium, illumination)
    edges = np.concatenate(
        [[0.0], np.geomspace(1e-3, 0.3, 12), np.linspace(0.3, 25.0, 120)[1:], np.geomspace(25, 1e4, 30)[1:]]
    )
    x, weight = np.polynomial.legendre.leggauss(10)
    r = (edges[:-1, None] + 0.5 * (1 + x) * np.diff(edges)[:, None]).ravel()
    light = 2 * np.pi * r * found.profile(r) * (0.5 * weight * np.diff(edges)[:, None]).ravel()
    at_source = found.cdf(0.0) * found.reflectance
    assert light.sum() + at_source == pytest.approx(found.reflectance, abs=2e-5)
    for k in (1.0, 3.0):
        # Too coarse for J0 where hardly any light is left.
        assert light @ j0(k * r) + at_source == pytest.approx(found.transform(k), abs=2e-5)


def test_ends():
    found = exact.solve(MATCHED)
    assert found.transform(0.0) == pytest.approx(found.reflectance, rel=1e-12)
    assert found.profile(0.0) == np.inf
    assert found.profile(np.inf) == 0.0
    assert found.cdf(np.inf) == 1.0
    assert found.cdf(1e5) == pytest.approx(1, abs=1e-9)
    assert found.cdf([[0.0, 1.0]]).shape == (1, 2)
    clear = exact.solve(Medium((Layer(1.5, 0.0, 0.0, 0.0, 1.0),)))
    assert clear.reflectance == 0.0
    assert clear.specular + clear.transmittance == pytest.approx(1, abs=1e-15)
    dark = exact.solve(Medium((Layer(1.5, 1.0, 0.0, 0.0, 1.0),)))
    assert dark.reflectance == pytest.approx(0.96**2 * 0.04 * np.exp(-2) / (1 - 0.04**2 * np.exp(-2)), rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("medium", [MATCHED, REFRACTING, GLAZED, UNDER_GLASS, PLATE])
def test_photons_agree_in_chi_square_over_the_rings(medium):
    edges = np.concatenate([[0.0], np.geomspace(0.02, 8.0, 30)])
    tally = simulate(medium, Grid.from_edges(r=edges), 2 * 10**6, seed=9)
    found = exact.solve(medium)
    assert likelihood(tally, found) > CHANCE
    first, second, *others = medium.layers
    milkier = replace(medium, layers=(first, replace(second, mu_s=1.2 * second.mu_s), *others))
    assert likelihood(tally, exact.solve(milkier)) < CHANCE
    totals = tally.diffuse_reflectance, tally.specular_reflectance, tally.absorbed_per_layer
    for seen, known in zip(totals, (found.reflectance, found.specular, found.absorbed), strict=True):
        assert np.all(np.abs(seen.value - known) <= 4 * seen.standard_error + 1e-12)


@pytest.mark.parametrize(
    ("medium", "message"),
    [
        (half_space(0.9, g=0.5), r"must scatter with g = 0, got 0.5 in layer 1"),
        (Medium((LAYER, Layer(1.4, 1.0, 1.0, 0.0))), r"one n in all layers, got 1.3 in layer 1 and 1.4 in layer 2"),
        (Medium((LAYER,) * 21), r"must have at most 20 layers, got 21"),
        (0.9, r"medium must be a mcml_sim.Medium, got 0.9"),
    ],
)
def test_other_media_are_refused_by_name(medium, message):
    refused(message, exact.solve, medium)


def test_other_arguments_are_refused_by_name():
    refused("illumination must be one of searchlight, diffuse, got 'sun'", exact.solve, MATCHED, "sun")
    refused(r"nodes must be a mcml_sim.exact.Nodes, got 20", exact.solve, MATCHED, nodes=20)
    for bad in (0, -1, 101, 2.5, np.nan, "many"):
        refused("slope must be a whole number >= 4 and <= 100, got", exact.Nodes, 20, bad, 24)
    found = exact.solve(MATCHED)
    radius, wave = "r must be a radius >= 0, got", "k must be a finite wave number >= 0, got"
    for bad in (-1.0, np.nan, [1.0, -2.0], "far"):
        for call, message in ((found.profile, radius), (found.cdf, radius), (found.transform, wave)):
            refused(message, call, bad)

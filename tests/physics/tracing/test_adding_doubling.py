"""The adding-doubling twin against published and exact numbers, and the tracer's exit angles against the twin."""

from dataclasses import replace

import numpy as np
import pytest

from mcml_sim import Grid, Layer, Medium, exact, simulate
from tests.physics.tracing import test_published as published
from tests.physics.tracing.adding_doubling import solve

ANGLES = 18
PHOTONS = 2**19
SEED = 21
TWO_LAYERS = Medium((Layer(n=1.4, mu_a=1.0, mu_s=30.0, g=0.8, thickness=0.05), Layer(1.4, 2.0, 10.0, 0.0, 0.1)))


def deviations(tally, answer):
    """z of the light that leaves through each bin of exit angle, above and below."""
    solid_angles = tally.grid.solid_angles
    pairs = ((tally.reflectance_a, answer.reflected), (tally.transmittance_a, answer.transmitted))
    return np.concatenate([(seen.value - light / solid_angles) / seen.standard_error for seen, light in pairs])


@pytest.fixture(
    scope="module",
    params=[
        pytest.param(published.VAN_DE_HULST_SLAB, id="matched slab"),
        pytest.param(TWO_LAYERS, id="two layers", marks=pytest.mark.slow),
    ],
)
def tally(request):
    """Photons through a medium, by exit angle."""
    return simulate(request.param, Grid(1.0, 1, na=ANGLES), PHOTONS, seed=SEED)


def another_phase(medium):
    """With another g in the first layer."""
    first, *others = medium.layers
    return solve(replace(medium, layers=(replace(first, g=first.g + 0.02), *others)), ANGLES)


def one_degree_off(medium):
    """90 bins of a degree, of which the first is left out, put together to 18 of five."""
    fine = solve(medium, 90, nodes=1)
    reflected, transmitted = (
        np.add.reduceat(np.append(light[1:], 0), np.arange(0, 90, 5)) for light in (fine.reflected, fine.transmitted)
    )
    return replace(fine, reflected=reflected, transmitted=transmitted)


@pytest.mark.slow
@pytest.mark.parametrize("wrong", [another_phase, one_degree_off])
def test_light_that_is_slightly_another_is_seen(tally, wrong, sidak):
    z = deviations(tally, wrong(tally.medium))
    assert np.abs(z).max() > sidak(z.size)


@pytest.mark.slow
def test_tracer_sends_light_where_adding_doubling_does(tally, sidak):
    answer = solve(tally.medium, ANGLES)
    z = deviations(tally, answer)
    assert z.size == 2 * ANGLES
    assert np.all(tally.reflectance_a.is_sampled())
    assert np.abs(z).max() < sidak(z.size)
    for seen, light in (
        (tally.diffuse_reflectance, answer.reflected.sum()),
        (tally.diffuse_transmittance, answer.transmitted.sum()),
        (tally.ballistic_transmittance, answer.ballistic),
    ):
        assert abs(seen.value - light) < 4 * seen.standard_error
    assert tally.specular_reflectance.value == pytest.approx(answer.specular)


def test_published_slab():
    answer = solve(published.VAN_DE_HULST_SLAB, ANGLES)
    transmittance = answer.transmitted.sum() + answer.ballistic
    # To half a unit of the last digit printed.
    assert answer.reflected.sum() == pytest.approx(published.ADDING_DOUBLING_REFLECTANCE, abs=5e-7)
    assert transmittance == pytest.approx(published.ADDING_DOUBLING_TRANSMITTANCE, abs=5e-7)
    assert answer.reflected.sum() == pytest.approx(published.VAN_DE_HULST_REFLECTANCE, abs=5.1e-6)
    assert transmittance == pytest.approx(published.VAN_DE_HULST_TRANSMITTANCE, abs=5.1e-6)
    assert answer.ballistic == pytest.approx(np.exp(-2), rel=1e-12)


@pytest.mark.parametrize("alpha", [0.3, 0.9, 0.99])
def test_thick_layer_is_the_exact_half_space(alpha):
    answer = solve(Medium((Layer(1.0, 1 - alpha, alpha, 0.0, 300.0),)))
    assert answer.reflected.sum() == pytest.approx(exact.reflectance(alpha), rel=1e-6)
    assert answer.transmitted.sum() < 1e-15


def test_conservative_layers_lose_no_light_and_indices_that_differ_are_refused():
    conservative = Medium((Layer(1.5, 0.0, 20.0, 0.9, 1.0), Layer(1.5, 0.0, 5.0, -0.3, 0.2)))
    answer = solve(conservative, angles=6)
    total = answer.specular + answer.reflected.sum() + answer.transmitted.sum() + answer.ballistic
    assert total == pytest.approx(1, abs=1e-11)
    with pytest.raises(ValueError, match="share one index"):
        solve(Medium((Layer(1.3, 1, 1, 0, 1), Layer(1.5, 1, 1, 0, 1))))


def test_more_bundles_and_more_layers_change_little():
    coarse, fine = solve(TWO_LAYERS, angles=9, nodes=4), solve(TWO_LAYERS, angles=9, nodes=6)
    np.testing.assert_allclose(coarse.reflected, fine.reflected, rtol=1e-5)
    np.testing.assert_allclose(coarse.transmitted, fine.transmitted, rtol=1e-5)
    # A layer cut in two is the same layer.
    (whole,) = published.VAN_DE_HULST_SLAB.layers
    cut = Medium((replace(whole, thickness=0.005), replace(whole, thickness=0.015)))
    expected = solve(published.VAN_DE_HULST_SLAB, ANGLES).reflected
    np.testing.assert_allclose(solve(cut, ANGLES).reflected, expected, rtol=1e-10)

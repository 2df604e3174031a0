"""Sums of Gaussians of a stack: a sum is found again, and light of a stack is as near as more of them come."""

import numpy as np
import pytest

from mcml_sim import Layer, Medium, Setting
from profilefit.errors import InputError
from profilefit.laws.gaussians import MediumGaussians
from profilefit.recipes.stack import gaussians
from profilefit.recipes.stack.gaussians import SumLight, medium_gaussians

HEART = Medium((Layer(1.4, 0.20, 2.2, 0.0, 0.3), Layer(1.4, 0.80, 1.2, 0.0)))


def rings_of(law: MediumGaussians) -> SumLight:
    edges = np.geomspace(0.01, 20.0, 80)
    energy = np.diff(law.cdf(edges, 0.5)) * law.total_reflectance
    return SumLight(edges, energy, np.full(79, 79**-0.5), law.total_reflectance, np.zeros(79), 0.0)


def sum_of(light: SumLight, best) -> MediumGaussians:
    variances, (weights,) = gaussians.shared_sum(best.parameters)
    return MediumGaussians(Setting(), light.whole, tuple(variances), tuple(weights))


def test_a_sum_is_found_again():
    known = MediumGaussians(Setting(), 0.4, (0.02, 0.5, 6.0), (0.3, 0.5, 0.2))
    light = rings_of(known)
    best = gaussians.fitted([light], 3)
    variances, (weights,) = gaussians.shared_sum(best.parameters)
    np.testing.assert_allclose(variances, known.variance, rtol=1e-4)
    np.testing.assert_allclose(weights, known.weight, rtol=1e-4)
    assert gaussians.fitted([light], 2).cost > 1e4 * best.cost  # two are not three


@pytest.mark.slow
@pytest.mark.parametrize("illumination", ["diffuse", "searchlight"])
def test_more_of_them_are_nearer(illumination):
    light = gaussians.sum_light(HEART, illumination)
    rel = []
    for count in (2, 4, 6):
        law = sum_of(light, gaussians.fitted([light], count))
        assert sum(law.weight) == pytest.approx(1.0)
        assert np.all(np.diff(law.variance) > 0)
        energy = np.diff(law.cdf(light.edges, 0.5)) * law.total_reflectance
        rel.append(float(np.mean(np.abs(energy / light.energy - 1.0))))
    assert rel[0] > 0.4 > rel[1] > 0.1 > rel[2] > 0.02


@pytest.mark.slow
def test_colours_share_their_variances():
    """In one unit of length, though mean free paths differ; each is a little farther from its light than alone."""
    blue = Medium((Layer(1.4, 0.35, 2.6, 0.0, 0.3), Layer(1.4, 1.2, 1.3, 0.0)))
    both = gaussians.shared_gaussians((HEART, blue), "diffuse", 4)
    units = [medium.layers[0].mfp for medium in (HEART, blue)]
    first, second = (np.array(one.variance) * unit**2 for one, unit in zip(both, units, strict=True))
    np.testing.assert_allclose(first, second, rtol=1e-12)
    for medium, one in zip((HEART, blue), both, strict=True):
        light = gaussians.sum_light(medium, "diffuse")
        alone = gaussians.fitted([light], 4).cost
        energy = np.diff(one.cdf(light.edges, 0.5)) * one.total_reflectance
        assert alone < np.sum((light.weight * (energy / light.energy - 1.0)) ** 2) < 1.5 * alone


def test_many_fixed_ones_are_exact_light():
    """Of two colours at once, and far nearer than six that are fitted."""
    blue = Medium((Layer(1.4, 0.35, 2.6, 0.0, 0.3), Layer(1.4, 1.2, 1.3, 0.0)))
    lights = gaussians.lights_of((HEART, blue), "diffuse")
    variances, weights = gaussians.dense(lights)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)
    assert np.all(weights >= 0)
    assert variances.size < 30
    for light, own in zip(lights, weights, strict=True):
        off = gaussians.ring_shares(light.edges, variances) @ own * light.whole / light.energy - 1.0
        assert np.sqrt(np.mean(off**2)) < 1e-3
        assert np.abs(off).max() < 3e-3
    six = gaussians.joint(lights, 6)
    off = gaussians.ring_shares(lights[0].edges, six.variances) @ six.weights[0] * lights[0].whole / lights[0].energy
    assert np.sqrt(np.mean((off - 1.0) ** 2)) > 0.02


def test_counts_are_checked():
    for count in (0, 9, True, 2.5):
        with pytest.raises(InputError, match=f"1 ... 8, got {count!r}"):
            medium_gaussians(HEART, "diffuse", count)


@pytest.mark.slow
def test_light_that_is_traced():
    """Of layers that scatter forward; the similar stack's sum is another."""
    forward = Medium(tuple(Layer(1.4, one.mu_a, 10.0 * one.mu_s, 0.9, one.thickness) for one in HEART.layers))
    light, similar = gaussians.sum_light(forward, "searchlight"), gaussians.sum_light(HEART, "searchlight")
    assert np.mean(light.noise) < 0.05
    best = gaussians.fitted([light], 8)
    counts = light.weight > 0
    assert np.mean(np.abs(best.residuals[counts] / light.weight[counts])) < 0.04
    lost = sum_of(similar, gaussians.fitted([similar], 8))
    energy = np.diff(lost.cdf(light.edges, 0.5)) * lost.total_reflectance
    assert np.mean(np.abs(energy[counts] / light.energy[counts] - 1.0)) > 0.5

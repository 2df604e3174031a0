"""Noise and bias of samplers: quadrature against drawing, and what a wrong density does."""

import numpy as np
import pytest

import profilefit
from mcml_sim import Setting
from profilefit.scenes.stage.step_edge import by_law, by_quantile, edge_estimate, random_points, step_response
from profilefit.studies.tradeoff import samplers
from profilefit.studies.tradeoff.laws import YARDSTICK, with_samplers

ALPHA, EDGE = 0.8, 1.0
SMALL = samplers.SamplerSizes((ALPHA,), (EDGE,), 40)


@pytest.fixture(scope="module")
def uniform():
    return samplers.UniformSampler(profilefit.load("burley", "published"))


def drawn(gather, law, seed=1):
    """The estimator with thousands of samples, whose bias by the ratio of sums is next to none: mean and its error."""
    found = edge_estimate(gather, random_points(4000, 12, seed), [-EDGE], ALPHA, law.setting)
    return found.mean[0] - found.truth[0], found.standard_error[0]


@pytest.mark.slow
def test_bias_is_what_drawing_finds(uniform):
    """With the right density and with a wrong one, which shows: radii are uniform, and the law's are not."""
    law = uniform.law
    own, by_law_density = samplers.asymptotic_bias(uniform, ALPHA, EDGE)
    for bias, gather in ((own, by_law), (by_law_density, samplers.unweighted)):
        found, error = drawn(gather(law, ALPHA, uniform), law)
        assert abs(found - bias) < 3.3 * error  # 1e-3 two-sided
    assert abs(own) < 0.01 < 0.1 < abs(by_law_density)


def test_an_exact_inverse_has_its_laws_bias_only():
    law = profilefit.load("burley", "published")
    own, by_law_density = samplers.asymptotic_bias(law.sampler, ALPHA, EDGE)
    of_law = step_response(-EDGE, ALPHA, law=law) - step_response(-EDGE, ALPHA)
    assert own == pytest.approx(of_law, abs=samplers.ROUNDING)
    assert by_law_density == pytest.approx(own, abs=samplers.ROUNDING)


@pytest.mark.slow
def test_a_law_with_g_is_judged_by_light_that_scatters_forwards():
    law = profilefit.load("hazard", setting=Setting(n=1.4, g=0.8))
    own, by_law_density = samplers.asymptotic_bias(law.sampler, ALPHA, EDGE)
    assert abs(own) < 1e-3  # .08 where its own albedo and the reduced one are mixed
    assert by_law_density == pytest.approx(own, abs=1e-5)  # one step of the inverse, not two


@pytest.mark.slow
def test_noise_is_over_that_of_the_exact_quantile(uniform):
    law = uniform.law
    best = by_quantile(ALPHA)
    assert samplers.error_ratios(best, best, ALPHA, law, 0, 20) == (1.0, 1.0)
    ratios = samplers.noise_ratios(by_law, uniform, SMALL)
    assert ratios.shape == (2, 1, samplers.BLOCKS)
    assert ratios.min() > 1.3
    assert np.ptp(ratios) > 0.0


@pytest.mark.slow
def test_wrong_densities_come_twice(uniform):
    exactly, _ = with_samplers(YARDSTICK, uniform.law)
    (found,) = samplers.ways_of(exactly, SMALL)
    assert found.name == YARDSTICK
    noise, bias = samplers.points_of(found, samplers.WithSpread.exactly(2.0))
    assert (noise.panel, bias.panel) == ("noise", "bias")
    assert noise.error.low < noise.error.value < noise.error.high
    assert bias.error.value == pytest.approx(abs(found.bias[0, 0]))

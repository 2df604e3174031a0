"""Samplers: by hand where a hand can, by random numbers where it cannot, and wrong where they are made wrong."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

import profilefit
from mcml_sim import Setting, exact
from profilefit.fitting import sampling
from profilefit.fitting.sampling import BATCH, ExactTarget, LawTarget, edge_light, lit_beyond_edge, sampler_quality
from profilefit.laws.base import ProfileLaw, Sampler
from profilefit.laws.two_parts import TwoPartSampler
from tests.fixtures import refused

ALPHA = 0.9
STEP = 2.0**-24  # what the last step of xi leaves out
# The exact profile at thousands of radii takes a second each time.
TARGETS = pytest.mark.parametrize("which", ["law", pytest.param("exact", marks=pytest.mark.slow)])


def integral(function, low, high):
    """By Gauss's rule in ln x with BATCH nodes, a shape for which everything is compiled."""
    nodes, weights = np.polynomial.legendre.leggauss(BATCH)
    half = 0.5 * np.log(high / low)
    x = low * np.exp(half * (nodes + 1.0))
    return float(half * np.sum(weights * x * function(x)))


def in_batches(function, values):
    return np.concatenate([np.asarray(function(part)) for part in values.reshape(-1, BATCH)])


class Stretched(Sampler):
    """The exact inverse of its law's cdf, its radii stretched, with the density that they then have."""

    law: ProfileLaw
    stretch: float = eqx.field(static=True)
    wrong: float = eqx.field(static=True, default=1.0)  # what its density is multiplied by

    def scaled_sample(self, xi, alpha):
        return self.stretch * self.law.sampler.scaled_sample(xi, alpha)

    def scaled_pdf(self, x, alpha):
        return self.wrong * self.law.sampler.scaled_pdf(x / self.stretch, alpha) / self.stretch


class Clipped(Sampler):
    """The exact inverse of its law's cdf, clipped."""

    law: ProfileLaw
    farthest: float = eqx.field(static=True)

    def scaled_sample(self, xi, alpha):
        return jnp.minimum(self.law.sampler.scaled_sample(xi, alpha), self.farthest)

    def scaled_pdf(self, x, alpha):
        return jnp.where(x < self.farthest, self.law.sampler.scaled_pdf(x, alpha), 0.0)


class Longer(TwoPartSampler):
    """Radii of both parts a hundredth too long, whatever its density says."""

    def scaled_sample(self, xi, alpha):
        return 1.01 * super().scaled_sample(xi, alpha)


@pytest.mark.slow
def test_a_mixture_is_judged_part_by_part():
    """Against the plainest rule over xi, which knows nothing of parts; radii that are too long are found."""
    law = profilefit.load("hazard", setting=Setting("diffuse", n=1.4))
    found, wrong = (sampler_quality(one, ALPHA) for one in (law.samplers["two steps"], Longer(law, 2)))
    assert found.inversion_error[0] < 2e-8
    assert 1e-3 < wrong.inversion_error[0] < 0.01
    for what in ("bias", "edge_bias", "bias_by_law_pdf", "edge_bias_by_law_pdf"):
        assert abs(getattr(found, what)[0]) < 1e-6
    xi = (np.arange(128 * BATCH) + 0.5) / (128 * BATCH)
    x = in_batches(lambda part: Longer(law, 2).sample(part, ALPHA), xi)
    lit = np.mean(lit_beyond_edge(x, 1.0)) / edge_light(LawTarget(law), ALPHA, 1.0) - 1.0
    assert wrong.edge_bias_by_law_pdf[0] == pytest.approx(lit, abs=2e-5)
    assert lit > 1e-3


def test_an_exact_inverse_has_no_error_and_a_circle_by_hand(burley):
    found = sampler_quality(burley.sampler, [0.3, ALPHA])
    np.testing.assert_array_equal(found.alpha, [0.3, ALPHA])
    assert np.all(found.inversion_error < 1e-14)
    assert np.all(found.atom == 0.0)
    for measure in (found.bias, found.bias_by_law_pdf, found.variance):
        assert np.max(np.abs(measure)) < 1.01 * STEP
    for measure in (found.edge_bias, found.edge_bias_by_law_pdf):
        assert np.max(np.abs(measure)) < 20 * STEP  # the last step is all beyond the edge
    # A circle of twice the distance shows the edge 120 degrees of its 360.
    np.testing.assert_allclose(lit_beyond_edge(np.array([0.0, 0.5, 1.0, 2.0, 1e12]), 1.0), [0, 0, 0, 1 / 3, 0.5])


@TARGETS
def test_light_beyond_an_edge_and_variance_are_plain_integrals(which, burley):
    """Against the plain integral of the density, of a law and of the exact profile."""
    target = ExactTarget() if which == "exact" else LawTarget(burley)
    light = integral(lambda x: target.density(x, ALPHA) * lit_beyond_edge(x, 0.7), 0.7, 90.0)
    assert edge_light(target, ALPHA, 0.7) == pytest.approx(light, abs=1e-7)  # a root at the edge
    assert edge_light(target, ALPHA, 1e-9) == pytest.approx(0.5, abs=1e-6)
    # int f^2 / pdf dr - 1, by another quadrature in another variable.
    sampler = Stretched(burley, 1.1)  # that of another test, which has compiled it
    square = integral(lambda x: target.density(x, ALPHA) ** 2 / sampler.pdf(x, ALPHA), 1e-8, 60.0)
    assert sampler_quality(sampler, ALPHA, target).variance[0] == pytest.approx(square - 1, abs=1e-5)


def test_a_stretch_costs_nothing_and_a_clip_is_an_atom(burley):
    """With the law's it moves the light: what lies beyond the edge is what was beyond edge / 1.1."""
    found = sampler_quality(Stretched(burley, 1.1), ALPHA)
    assert abs(found.bias[0]) < 1e-6
    assert abs(found.edge_bias[0]) < 1e-5
    assert abs(found.bias_by_law_pdf[0]) < 1e-6, "even light shows nothing"
    moved = edge_light(LawTarget(burley), ALPHA, 1 / 1.1) / edge_light(LawTarget(burley), ALPHA, 1.0) - 1
    assert moved > 0.05
    assert found.edge_bias_by_law_pdf[0] == pytest.approx(moved, abs=1e-5)
    x = np.geomspace(0.01, 20, 20_000)
    off = np.max(np.abs(burley.cdf(1.1 * x, ALPHA) - burley.cdf(x, ALPHA)))
    assert found.inversion_error[0] == pytest.approx(off, rel=1e-4)
    # Negative control: 1.1 times too dense, so 1/1.1 of the light.
    found = sampler_quality(Stretched(burley, 1.0, wrong=1.1), ALPHA)
    assert found.bias[0] == pytest.approx(1 / 1.1 - 1, abs=1e-6)
    found = sampler_quality(Clipped(burley, 2.0), ALPHA)
    beyond = 1 - burley.cdf(2.0, ALPHA)
    assert (found.atom[0], found.bias[0]) == (pytest.approx(beyond, rel=1e-10), pytest.approx(-beyond, rel=1e-9))
    assert found.inversion_error[0] == pytest.approx(0.999 - burley.cdf(2.0, ALPHA), rel=1e-10)
    # Divided by the law's density every sample weighs 1, those of the atom too: even light hides it.
    assert found.bias_by_law_pdf[0] == pytest.approx(0.0, abs=1e-6)
    within = integral(lambda x: burley.sampler.pdf(x, ALPHA) * lit_beyond_edge(x, 1.0), 1.0, 2.0)
    light = edge_light(LawTarget(burley), ALPHA, 1.0)
    assert found.edge_bias[0] == pytest.approx(within / light - 1, abs=1e-6)
    assert found.edge_bias_by_law_pdf[0] == pytest.approx((within + beyond / 3) / light - 1, abs=1e-6)


# Clips


@pytest.mark.slow
def test_the_paper_s_clip_is_an_atom_and_loses_light(liang):
    """r = min(|g|, r_max) of (21), found from its radii alone; at 0.5 the law ends beyond the sampler's reach."""
    found = sampler_quality(liang.sampler, [0.1, 0.5, ALPHA])
    for alpha, share in zip(found.alpha[[0, 2]], found.atom[[0, 2]], strict=True):
        with jax.enable_x64(True):
            start = brentq(lambda xi, at=alpha: liang.sampler.unclipped(xi, at) - liang.largest_radius(at), 0.5, 1.0)
        assert share == pytest.approx(1.0 - start, abs=1e-11)
    assert found.atom[0] > 0.01
    assert found.atom[1] == 0.0
    # Its own law's light ends at r_max too: nothing is lost at 0.1 and 0.9, at 0.5 what lies beyond xi = 1.
    reach = liang.sampler.sample(1 - STEP, 0.5)
    np.testing.assert_allclose(found.bias, [0.0, liang.cdf(reach, 0.5) - 1, 0.0], atol=1e-6)
    assert found.bias[1] < -0.01
    assert np.all(np.abs(found.edge_bias_by_law_pdf) > 0.1), "an approximate inverse is no sampler of its law"
    # Of the exact profile: what lies beyond r_max, and a division by zero where the law's density is used.
    found = sampler_quality(liang.sampler, ALPHA, ExactTarget())
    beyond = 1 - exact.cdf(float(liang.largest_radius(ALPHA)), ALPHA)
    assert found.bias[0] == pytest.approx(-beyond, abs=1e-6)
    assert found.bias_by_law_pdf[0] == found.edge_bias_by_law_pdf[0] == np.inf


# By random numbers


@pytest.mark.parametrize("name", ["approximate", pytest.param("paper", marks=pytest.mark.slow)])
def test_means_and_variance_against_random_numbers(name, burley, liang, sidak):
    """Twenty thousand draws, seed 5; three means and a variance to 1e-3 together, by Sidak."""
    sampler = Stretched(burley, 1.1) if name == "approximate" else liang.sampler
    target = LawTarget(sampler.law)
    found = sampler_quality(sampler, ALPHA)
    xi = np.random.default_rng(5).random(40 * BATCH) * -np.expm1(-sampling.LAST)
    x = in_batches(lambda part: sampler.sample(part, ALPHA), xi)
    light, density = target.density(x, ALPHA), in_batches(lambda part: sampler.pdf(part, ALPHA), x)
    own = np.divide(light, density, out=np.zeros_like(x), where=density > 0)  # an atom has no density
    by_law = np.divide(light, LawTarget(sampler.law).density(x, ALPHA), out=np.ones_like(x), where=density > 0)
    lit, light = lit_beyond_edge(x, 1.0), edge_light(target, ALPHA, 1.0)
    squares = (own - own.mean()) ** 2
    pairs = [
        (own, 1 + found.bias[0]),
        (own * lit, light * (1 + found.edge_bias[0])),
        (by_law * lit, light * (1 + found.edge_bias_by_law_pdf[0])),
        (squares, found.variance[0]),
    ]
    z = [(sample.mean() - mean) / (sample.std() / np.sqrt(sample.size)) for sample, mean in pairs]
    assert np.max(np.abs(z)) < sidak(len(pairs))
    # Negative control: the law's density in the place of the sampler's is plainly another estimator.
    error = (by_law * lit).std() / np.sqrt(lit.size)
    assert abs((by_law * lit).mean() - light * (1 + found.edge_bias[0])) > 10 * error


@pytest.mark.slow
def test_targets_are_of_their_setting(burley):
    """Negative control: diffuse light is another target."""
    one, other = (
        sampler_quality(burley.sampler, ALPHA, ExactTarget(Setting(light))).variance[0]
        for light in ("searchlight", "diffuse")
    )
    assert other != pytest.approx(one, rel=0.1)
    density = ExactTarget(Setting("diffuse")).density(np.array([1.0]), ALPHA)
    step = np.diff(exact.cdf([0.999, 1.001], ALPHA, setting=Setting("diffuse"))) / 0.002
    np.testing.assert_allclose(density, step, rtol=1e-5)


@pytest.mark.parametrize(
    ("alpha", "edge", "said"),
    [
        ([0.5, 0.0], 1.0, r"alpha must be in \(0, 1\], got 0"),
        (np.nan, 1.0, r"alpha must be in \(0, 1\], got nan"),
        (0.5, 0.0, "edge must be a distance > 0, got 0"),
    ],
)
def test_bad_numbers_are_named(burley, alpha, edge, said):
    refused(said, sampler_quality, burley.sampler, alpha, edge=edge)

"""Laws: what is timed is what is judged, functions counted by hand, times and errors; noise and bias of samplers."""

from collections import Counter

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import profilefit
from benchmarks.laws import described
from mcml_sim import Setting, exact
from profilefit.fitting.quality import profile_quality
from profilefit.laws.burley import BurleySampler
from profilefit.scenes.stage.reference.step_edge import by_law, by_quantile, edge_estimate, random_points, step_response
from profilefit.studies.tradeoff import laws, samplers
from profilefit.studies.tradeoff.laws import YARDSTICK, LawSpec, count, with_samplers
from profilefit.studies.tradeoff.stopwatch import Rates
from tests.fixtures import refused

BURLEY = profilefit.load("burley", "published")
SMALL = laws.LawSizes(points=2000, costly=200, albedos=1000, turns=3, judged=1)


@pytest.mark.slow
def test_fast_forms_are_the_laws():
    """In float32, as they are timed."""
    alpha = jnp.array([[0.1], [0.8], [0.99]])
    x, xi = jnp.geomspace(0.01, 5.0, 50), jnp.linspace(0.01, 0.99, 50)
    for contender, name in zip(with_samplers(YARDSTICK, BURLEY), ("exact", "xie"), strict=True):
        profile, drawn = jax.jit(lambda c=contender: (c.profile(x, alpha), c.sample(xi, alpha)))()
        np.testing.assert_allclose(profile, BURLEY.scaled_profile(x, alpha), rtol=1e-5)
        sampler = BURLEY.samplers[name]
        np.testing.assert_allclose(drawn, sampler.scaled_sample(xi, alpha), rtol=2e-5, atol=1e-6)
        assert type(contender.sampler) is type(sampler)
    (quantile,) = with_samplers("quantile", profilefit.load("quantile"))
    drawn, profile = jax.jit(lambda: quantile.both(xi, alpha))()
    np.testing.assert_allclose(drawn, jax.jit(lambda: quantile.sample(xi, alpha))(), rtol=1e-6)
    np.testing.assert_allclose(profile, jax.jit(lambda: quantile.profile(drawn, alpha))(), rtol=1e-5)


def test_fast_form_in_diffuse_mean_free_paths(x64):
    law, r = profilefit.load("burley_diffuse_mfp", "published"), np.geomspace(0.01, 5.0, 9)
    (fast,) = with_samplers("own", law)
    np.testing.assert_allclose(fast.profile(r, 0.8), law.profile(r, 0.8), rtol=1e-12)
    assert fast.constants == (3, 0)


def test_what_cannot_be_had_is_left_out_by_name():
    specs = (LawSpec(YARDSTICK, "burley", "published"), LawSpec("absent", "gaussians", "no-such-set"))
    found, left_out = laws.contenders(specs=specs)
    assert [one.name for one in found] == [YARDSTICK, f"{YARDSTICK}, Xie's sampler"]
    (line,) = left_out
    assert line.startswith("absent: constants must be one of")
    refused("laws must have normalized diffusion among them", laws.contenders, specs=specs[1:])


@pytest.mark.slow
def test_table_is_the_exact_profile_to_rounding():
    table = laws.table_contender()
    x = np.geomspace(0.01, 10.0, 40)
    truth = exact.profile(x, laws.MATERIAL)
    looked_up = table.profile(jnp.asarray(x, jnp.float32), jnp.float32(0.0))
    np.testing.assert_allclose(looked_up, truth, rtol=1e-5)
    np.testing.assert_allclose(table.law.profile(x, laws.MATERIAL), truth, rtol=1e-5)
    np.testing.assert_allclose(table.law.cdf(x, laws.MATERIAL), exact.cdf(x, laws.MATERIAL), rtol=1e-5)
    assert np.max(np.abs(looked_up / truth - 1.0)) > 1e-9  # in float32 it is
    assert set(table.parts) == {"profile"}
    assert profile_quality(table.law, laws.judged_albedos(2)).rel.max() < 1e-5


def test_counts_what_the_answer_needs_once_for_each_point_or_material_or_step_of_a_loop():
    def function(x, alpha):
        jnp.tanh(x)  # not needed
        nodes = jnp.log(jnp.arange(1.0, 4.0)) + alpha
        return jnp.where(x > 0, jnp.exp(jnp.sqrt(alpha) * x), 0.0) + jnp.sum(jnp.cos(x[:, None] * nodes), axis=1)

    found = count(function)
    assert (found.point, found.material, found.transcendental) == (Counter(exp=1, cos=3), Counter(sqrt=1, log=3), 4)
    found = count(lambda x, alpha: jax.lax.fori_loop(0, 5, lambda _, y: jnp.sqrt(jnp.log(y + alpha)), x))
    assert (found.point, found.transcendental) == (Counter(log=5, sqrt=5), 5)
    with pytest.raises(ValueError, match="no loop of unknown length"):
        count(lambda x, _: jax.lax.while_loop(lambda y: y.sum() > 1, lambda y: y / 2, x))


def test_functions_of_normalized_diffusion_and_of_hazard():
    """Two exponentials or one; what hazard's docstring says."""
    exact, xie = with_samplers("normalized diffusion", BURLEY)
    one, two = with_samplers("hazard", profilefit.load("hazard"))
    for function, text in (
        (BURLEY.scaled_profile, "2 exp"),
        (BurleySampler(BURLEY).scaled_sample, "cbrt, log, sqrt"),
        (exact.profile, "exp"),
        (exact.sample, "exp, 2 log, sqrt"),
        (xie.sample, "log"),
        (one.profile, "exp, log"),
        (one.sample, "3 log"),
        (two.sample, "5 log"),
    ):
        assert described(count(function).point) == text
    assert described(Counter()) == "–"


def test_costly_samplers_are_not_timed():
    (beam,) = with_samplers("beam", profilefit.load("beam_diffusion", "published"))
    counted = laws.counts(beam)
    assert counted["profile"].transcendental > laws.MANY
    works = laws.works(beam, counted, SMALL)
    assert (set(works), works["profile"](0)) == ({"profile"}, SMALL.costly)


def test_time_is_over_the_yardsticks_in_each_turn():
    """A turn that takes all works twice as long widens nothing."""
    rates = Rates({"both of yard": [1e9, 0.5e9, 1e9], "both of law": [0.5e9, 0.25e9, 0.5e9]})
    found = laws.nanoseconds(rates, "both of law", "both of yard")
    assert (found.value, found.low, found.high) == pytest.approx((2.0, 2.0, 2.0))


@pytest.mark.slow
def test_rows_become_points():
    specs = [one for one in laws.SPECS if one.label in (YARDSTICK, "Liang, corrected")]
    found, _ = laws.contenders(specs=specs)
    rows = laws.measured(found, SMALL)
    profile, both = (laws.points_of(rows, part) for part in laws.TITLES)
    assert [point.method for point in profile] == [one.name for one in found if not one.another]
    assert [point.method for point in both] == [one.name for one in found]
    assert profile[0].facts["times_yardstick"] == 1.0
    liang = profile[1]
    assert liang.facts["constants"] == 18
    assert liang.error.value == pytest.approx(rows[-1].rel.mean())
    assert liang.worst.value >= liang.error.value > 0.05
    assert liang.cost.low <= liang.cost.value <= liang.cost.high
    assert np.isfinite(liang.cost.value)


ALPHA, EDGE = 0.8, 1.0
FEW = samplers.SamplerSizes((ALPHA,), (EDGE,), 40)


UNIFORM = samplers.UniformSampler(BURLEY)


@pytest.mark.slow
def test_bias_is_what_drawing_finds():
    """With the right density and with a wrong one, which shows: radii are uniform, and the law's are not.

    Drawn are thousands of samples, whose bias by the ratio of sums is next to none.
    """
    own, by_law_density = samplers.asymptotic_bias(UNIFORM, ALPHA, EDGE)
    for bias, gather in ((own, by_law), (by_law_density, samplers.unweighted)):
        of = gather(BURLEY, ALPHA, UNIFORM)
        found = edge_estimate(of, random_points(4000, 12, 1), [-EDGE], ALPHA, BURLEY.setting)
        assert abs(found.mean[0] - found.truth[0] - bias) < 3.3 * found.standard_error[0]  # 1e-3 two-sided
    assert abs(own) < 0.01 < 0.1 < abs(by_law_density)


def test_an_exact_inverse_has_its_laws_bias_only():
    own, by_law_density = samplers.asymptotic_bias(BURLEY.sampler, ALPHA, EDGE)
    of_law = step_response(-EDGE, ALPHA, law=BURLEY) - step_response(-EDGE, ALPHA)
    assert own == pytest.approx(of_law, abs=samplers.ROUNDING)
    assert by_law_density == pytest.approx(own, abs=samplers.ROUNDING)


@pytest.mark.slow
def test_a_law_with_g_is_judged_by_light_that_scatters_forwards():
    law = profilefit.load("hazard", setting=Setting(n=1.4, g=0.8))
    own, by_law_density = samplers.asymptotic_bias(law.sampler, ALPHA, EDGE)
    assert abs(own) < 1e-3
    assert by_law_density == pytest.approx(own, abs=1e-5)  # one step of the inverse, not two


@pytest.mark.slow
def test_noise_is_over_that_of_the_exact_quantile():
    best = by_quantile(ALPHA)
    assert samplers.error_ratios(best, best, ALPHA, BURLEY, 0, 20) == (1.0, 1.0)
    ratios = samplers.noise_ratios(by_law, UNIFORM, FEW)
    assert ratios.shape == (2, 1, samplers.BLOCKS)
    assert ratios.min() > 1.3
    assert np.ptp(ratios) > 0.0


@pytest.mark.slow
def test_wrong_densities_come_twice():
    exactly, _ = with_samplers(YARDSTICK, BURLEY)
    (found,) = samplers.ways_of(exactly, FEW)
    assert found.name == YARDSTICK
    noise, bias = samplers.points_of(found, samplers.WithSpread.exactly(2.0))
    assert (noise.panel, bias.panel) == ("noise", "bias")
    assert noise.error.low < noise.error.value < noise.error.high
    assert bias.error.value == pytest.approx(abs(found.bias[0, 0]))

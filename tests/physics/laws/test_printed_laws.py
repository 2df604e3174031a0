"""Published laws: normalized diffusion, its scales and inverses; that of Liang et al. against its own equations."""

import math

import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import Setting, exact
from profilefit.laws import published
from profilefit.laws.burley import UNREAL, XIE, Burley, BurleyDiffuseMfp
from profilefit.laws.rational import Rational

DIFFUSE = Setting("diffuse")
ENDS = np.concatenate([[0.0], np.geomspace(1e-6, 0.5, 40), 1 - np.geomspace(0.49, 1e-9, 40)])


@pytest.fixture(scope="module")
def diffuse():
    # Within 2e-6 of the exact A; its digits are frozen here as those of conftest are.
    albedo = Rational(DIFFUSE, 0.34529, 1.65477, 0.63309)
    return Burley(DIFFUSE, albedo, **published.constants("burley", "diffuse"))


@pytest.fixture(scope="module")
def per_diffuse_mfp(normalisation):
    return BurleyDiffuseMfp(Setting(), normalisation, **published.constants("burley_diffuse_mfp"))


@pytest.mark.parametrize(
    ("name", "scales"),
    [
        # 1.85 - A + 7 |A - 0.8|^3: at A = 0.5 it is 1.35 + 7 * 0.027; without the modulus it would be 1.161.
        ("burley", {0.0: 5.434, 0.5: 1.539, 0.8: 1.05, 1.0: 0.906}),
        # 1.9 - A + 3.5 (A - 0.8)^2: at A = 0.3 it is 1.6 + 3.5 * 0.25.
        ("diffuse", {0.0: 4.14, 0.3: 2.475, 0.8: 1.1, 1.0: 1.04}),
        ("per_diffuse_mfp", {0.33: 3.5, 0.43: 3.51, 0.93: 16.46}),  # 3.5 + 100 (A - 0.33)^4
    ],
)
def test_scales_by_hand(name, scales, request):
    law = request.getfixturevalue(name)
    np.testing.assert_allclose(law.scale(list(scales)), list(scales.values()), rtol=1e-13)
    assert law.seen_by("energy") == law.constant_names()


def test_profile_and_inverses_by_hand(burley):
    """A s (e^-s + e^(-s/3)) / (8 pi) at r = l, with A = 0.5."""
    alpha = burley.albedo.alpha(0.5)
    expected = 0.5 * 1.539 * (math.exp(-1.539) + math.exp(-0.513)) / (8 * math.pi)
    assert burley.profile(1.0, alpha) == pytest.approx(expected, rel=1e-12)
    # The form that the memo's page gives since 2018: h^3 = 9 - 16 u + 8 u^2 + 4 (1 - u) sqrt(5 - 8 u + 4 u^2).
    u = np.linspace(0, 0.99, 100)
    h = np.cbrt(9 - 16 * u + 8 * u**2 + 4 * (1 - u) * np.sqrt(5 - 8 * u + 4 * u**2))
    r = 3 * np.log((1 + 1 / h + h) / (4 * (1 - u))) / burley.falloff_rate(0.7)
    np.testing.assert_allclose(burley.sampler.sample(u, 0.7), r, rtol=1e-11, atol=1e-14)
    # (2 - 2.5715) / 2 - 2 = -2.28575, times ln(1/2) = -0.6931472: 1.5843612 falloff lengths.
    expected = 1.5843612 / burley.falloff_rate(0.7)
    assert burley.samplers["xie"].sample(0.5, 0.7) == pytest.approx(expected, rel=1e-7)
    assert list(burley.samplers) == ["exact", "xie", "unreal"]
    # Its light ends sooner, so weights of an estimator grow without bound: e^(q r (1 / c - 1 / 3)).
    r = np.array([0.0, 1.0, 20.0, 40.0])
    weight = burley.sampler.pdf(r, 0.7) / burley.samplers["xie"].pdf(r, 0.7)
    assert weight[0] == pytest.approx(1.0, rel=1e-12)
    assert weight[1] < 1
    growth = burley.falloff_rate(0.7) * 20 * (1 / XIE - 1 / 3)
    assert weight[3] / weight[2] == pytest.approx(math.exp(growth), rel=1e-6)


def test_diffuse_mean_free_path_by_hand(per_diffuse_mfp):
    """At alpha = 0.8 a diffuse mean free path is sqrt(1.2 / 0.6) = sqrt 2 mean free paths; a radius of one of them."""
    s = 3.5 + 100 * (per_diffuse_mfp.albedo.reflectance(0.8) - 0.33) ** 4
    share = 1 - math.exp(-s) / 4 - 3 * math.exp(-s / 3) / 4
    assert per_diffuse_mfp.cdf(math.sqrt(2), 0.8) == pytest.approx(share, rel=1e-12)
    assert per_diffuse_mfp.cdf(3 * math.sqrt(2), 0.8, mfp=3.0) == pytest.approx(share, rel=1e-12)
    np.testing.assert_allclose(per_diffuse_mfp.cdf([0.0, 1e6, np.inf], 1.0), [0.0, 0.0, 1.0], rtol=0, atol=1e-300)
    np.testing.assert_allclose(per_diffuse_mfp.profile([1.0, np.inf], 1.0), 0.0, atol=1e-300)


@pytest.mark.slow
def test_which_diffuse_mean_free_path_is_meant(per_diffuse_mfp):
    """Grosjean's keeps what the memo reports (7.7 % on average); Jensen's sqrt(3 (1 - alpha)) would not, by far."""
    alpha = 0.2690  # A = 0.05
    r = np.geomspace(0.01, 2.3, 60)  # 99.5 % of the light
    truth = exact.profile(r, alpha)
    assert np.mean(np.abs(per_diffuse_mfp.profile(r, alpha) / truth - 1)) < 0.06
    jensen = math.sqrt(3 * (1 - alpha)) / per_diffuse_mfp.falloff_rate(alpha)
    jensen *= per_diffuse_mfp.scale(per_diffuse_mfp.albedo.reflectance(alpha))
    # Jensen's law at r is this one at the stretched radius.
    assert np.mean(np.abs(per_diffuse_mfp.profile(r * jensen, alpha) * jensen**2 / truth - 1)) > 0.18


@pytest.mark.parametrize("name", ["burley", "diffuse", "per_diffuse_mfp"])
@pytest.mark.parametrize("alpha", [0.05, 0.5, 0.9, 0.999])
def test_sampler_inverts_the_cdf(name, alpha, request):
    law = request.getfixturevalue(name)
    np.testing.assert_allclose(law.cdf(law.sampler.sample(ENDS, alpha), alpha), ENDS, rtol=0, atol=1e-12)
    assert np.all(np.diff(law.sampler.sample(ENDS, alpha)) > 0)


# Approximate inverses


@pytest.mark.parametrize(("name", "c", "worst"), [("xie", XIE, 0.00987), ("unreal", UNREAL, 0.00857)])
def test_approximate_inverses_are_a_hundredth_off_the_cdf_and_have_their_own_density(burley, name, c, worst):
    sampler = burley.samplers[name]
    assert (sampler.c, {"xie": 2.5715, "unreal": 2.6}[name]) == (c, c)
    xi = np.linspace(0, 0.9999, 4001)
    assert np.max(np.abs(burley.cdf(sampler.sample(xi, 0.7), 0.7) - xi)) == pytest.approx(worst, abs=1e-4)
    # Both ways: against the slope of the map, and as an integral.
    sampler, alpha, step = burley.samplers[name], 0.7, 1e-6
    xi = np.linspace(0.01, 0.99, 50)
    slope = (sampler.sample(xi + step, alpha) - sampler.sample(xi - step, alpha)) / (2 * step)
    np.testing.assert_allclose(sampler.pdf(sampler.sample(xi, alpha), alpha), 1 / slope, rtol=1e-8)
    r = np.linspace(0, 80, 400_001)
    assert np.trapezoid(sampler.pdf(r, alpha), r) == pytest.approx(1, abs=1e-7)
    assert sampler.pdf(np.inf, alpha) == 0.0


# Liang et al., worked through by hand at one albedo

ALPHAS = np.array([0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99])


def test_coefficients_profile_cdf_and_radii_by_hand(liang_printed, x64):
    """(11): k2 0.1^(-30 (alpha - 1)) is k2 itself at 1, a tenth of it at 1 - 1/30, and nothing at 0.9."""
    for alpha, share in ((1.0, 1.0), (1 - 1 / 30, 0.1), (0.9, 1e-3)):
        a = float(liang_printed.coefficients(jnp.asarray(alpha))[0])
        assert a + 0.0064 * alpha == pytest.approx(0.00316 * share, rel=1e-12)
    # (7), (9)-(18) at alpha = 0.5, r = 1 and 10, from the printed digits: -0.0064 * 0.5 + 0.00316 * 0.1^15, and in b
    # the power (6.7 * 0.05^2 + 2.6) * 0.5 + 1.3.
    a, b, c = -0.0032 + 0.00316e-15, 0.461 * 0.5**2.608375, 0.0097 * math.exp(2.1) + 0.166
    found = [float(value) for value in liang_printed.coefficients(jnp.asarray(0.5))]
    assert found == pytest.approx([a, b, c], abs=1e-14)
    assert float(liang_printed.source_strength(jnp.asarray(0.5))) == pytest.approx(2 * math.pi * b / c, rel=1e-14)
    farthest = -b / a

    def energy(r):  # A cdf(r) of (17)
        return 2 * math.pi * (a * r + (b - a * c) * math.log(r / c + 1))

    assert liang_printed.largest_radius(0.5) == pytest.approx(farthest, rel=1e-12)
    reflectance = liang_printed.albedo.reflectance(0.5)
    for r in (1.0, 10.0):
        profile = (a * r + b) / (r + c) / r * reflectance / energy(farthest)
        assert liang_printed.profile(r, 0.5) == pytest.approx(profile, rel=1e-12)
        assert liang_printed.cdf(r, 0.5) == pytest.approx(energy(r) / energy(farthest), rel=1e-12)
    # (19)-(21) at alpha = 0.5, xi = 0.25 and 0.9. k1 = 1.504 * 0.5^(2.175 * 0.5^0.7 + 0.19), k2 = 3.993 * 0.5^(3.268 *
    # 0.5 + 0.2838) = 3.993 * 0.5^1.9178
    k1 = 1.504 * 0.5 ** (2.175 * 0.5**0.7 + 0.19)
    k2 = 3.993 * 0.5**1.9178
    for xi in (0.25, 0.9):
        radius = (k1 * xi - k2) * math.sqrt(xi) * math.log(1.01 - xi)
        assert liang_printed.sampler.sample(xi, 0.5) == pytest.approx(radius, rel=1e-12)
    assert k2 == pytest.approx(1.0568, rel=1e-4)


def test_nothing_beyond_the_largest_radius_and_b0_as_printed_breaks_the_energy(liang, liang_printed):
    """r_max = -b/a, where (7) falls through zero."""
    for alpha in (0.2, 0.7, 0.99):
        farthest = float(liang.largest_radius(alpha))
        assert liang.profile(farthest * (1 - 1e-9), alpha) > 0
        assert liang.profile(farthest * (1 + 1e-9), alpha) == 0
        assert liang.cdf(farthest, alpha) == pytest.approx(1.0, abs=1e-15)
        assert liang.profile(0.999 * farthest, alpha) < 1e-2 * liang.profile(0.5 * farthest, alpha)
    # r_max = 0/0: the docstring keeps alpha = 0 out, and nobody gets a plausible wrong value there.
    assert math.isnan(liang.cdf(1.0, 0.0))
    assert not liang.profile(1.0, 0.0) > 0
    # 2 to 13 mean free paths with the corrected b0, 17 to 92 as printed: too far for any light.
    found = np.asarray(liang.largest_radius(ALPHAS))
    np.testing.assert_allclose(found * 0.461 / 0.0641, liang_printed.largest_radius(ALPHAS), rtol=1e-12)
    np.testing.assert_allclose(found[[0, -1]], [2.339, 12.72], rtol=1e-3)
    end = float(liang.sampler.unclipped(np.array(1.0), 0.5))  # (k2 - k1) |ln eps| < r_max here
    assert liang.sampler.pdf(0.999 * end, 0.5) > 0
    assert liang.sampler.pdf(1.001 * end, 0.5) == 0
    assert liang.sampler.pdf(1.001 * float(liang.largest_radius(0.9)), 0.9) == 0
    assert liang.sampler.pdf(0.0, 0.9) == 0
    # cdf(r_max) of (17) before (18), which should be 1.
    for law, low, high in ((liang_printed, 13.5, 15.1), (liang, 0.96, 1.075)):
        ratio = np.asarray(law.unscaled_energy(np.inf, ALPHAS)) / law.albedo.reflectance(ALPHAS)
        assert low < ratio.min()
        assert ratio.max() < high
    assert liang.seen_by("energy") + liang.seen_by("radius") == liang.constant_names()


# The inverse cdf


def test_the_radius_is_negative_below_eps_and_clipped_at_the_largest(liang, x64, liang_printed):
    """g changes sign at xi = eps, where the logarithm does."""
    below, above = (float(liang.sampler.unclipped(jnp.asarray(xi), 0.7)) for xi in (0.0099, 0.0101))
    assert below < 0 < above
    assert liang.sampler.sample(0.0099, 0.7) == pytest.approx(-below, rel=1e-14)
    assert liang.sampler.sample(0.01, 0.7) == pytest.approx(0.0, abs=1e-15)
    xi = (np.arange(100_000) + 0.5) / 100_000
    for alpha in (0.1, 0.9, 0.95):
        drawn = liang.sampler.sample(xi, alpha)
        farthest = float(liang.largest_radius(alpha))
        assert drawn.max() == farthest
        assert np.mean(drawn == farthest) > 1e-3
    for law, alphas in ((liang, 0.5), (liang_printed, ALPHAS)):  # no clip, no atom
        assert np.all(law.sampler.unclipped(1.0, alphas) < law.largest_radius(alphas))

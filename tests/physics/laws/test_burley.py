"""Normalized diffusion: its three published scales, Golubev's closed inverse, and the approximate ones in use."""

import math

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
    error = np.max(np.abs(burley.cdf(sampler.sample(xi, 0.7), 0.7) - xi))
    assert error == pytest.approx(worst, abs=1e-4)
    # Both ways: against the slope of the map, and as an integral.
    sampler, alpha, step = burley.samplers[name], 0.7, 1e-6
    xi = np.linspace(0.01, 0.99, 50)
    slope = (sampler.sample(xi + step, alpha) - sampler.sample(xi - step, alpha)) / (2 * step)
    np.testing.assert_allclose(sampler.pdf(sampler.sample(xi, alpha), alpha), 1 / slope, rtol=1e-8)
    r = np.linspace(0, 80, 400_001)
    assert np.trapezoid(sampler.pdf(r, alpha), r) == pytest.approx(1, abs=1e-7)
    assert sampler.pdf(np.inf, alpha) == 0.0

"""The law by its escape hazard: limits that it has by itself, and how near to the exact profile it is."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import Setting, exact
from profilefit import load, profile_quality
from profilefit.laws.hazard import SERIES, Hazard, HazardSampler, Shape, density, early_share, radius
from profilefit.laws.rational import Rational

SETTINGS = [Setting(), Setting("diffuse")]
ALPHA = 1 - np.linspace(1, 0, 41) ** 2
INNER = ALPHA[1:-1]
R = np.geomspace(1e-4, 300, 200)
# Any constants: what holds by construction must not rest on a fit.
ANY = Hazard(
    Setting(),
    Rational(Setting(), 0.5, 2.3, 1.3),
    **{"h0": 1.2, "h1": -0.3, "h2": 0.1, "a0": 0.5, "a1": -0.2, "a2": 0.03, "b0": 0.2, "b1": -0.2, "b2": 0.06},
    **{"b3": 0.02, "c0": 0.5, "c1": 0.3, "c2": 0.1, "c3": 0.05},
)


@pytest.fixture(scope="module", params=SETTINGS, ids=str)
def law(request):
    return load("hazard", setting=request.param)


def test_source_limit_holds_for_any_constants():
    """2 pi r R_d -> alpha / 2, with an x ln x beside it."""
    r = np.array([1e-6, 1e-8, 1e-10])
    for alpha in (0.1, 0.7, 1.0):
        strength = 2 * np.pi * r * ANY.profile(r, alpha)
        np.testing.assert_allclose(strength, alpha / 2, rtol=1e-4)
        assert strength[-1] == pytest.approx(alpha / 2, rel=1e-7)


def test_decay_rate_holds_for_any_constants():
    """-d ln R_d / dr -> kappa + 2/r: the rational part falls as 1/x, S lambda / x as x^-2 e^{-kappa x}."""
    for alpha in (0.5, 0.9, 0.99):
        kappa = exact.decay_rate(alpha)
        r = np.array([40.0, 40.1]) / kappa
        rate = -np.diff(np.log(ANY.profile(r, alpha)))[0] / np.diff(r)[0]
        assert rate == pytest.approx(kappa + 2 / r.mean(), rel=2e-3)


@pytest.mark.slow
def test_the_profile_is_the_slope_of_the_cdf(law):
    r = np.geomspace(1e-3, 5, 60)  # farther out the cdf has no digits left to take differences of
    step = 1e-5 * r
    for alpha in (0.2, 0.9, 1.0):
        slope = (law.cdf(r + step, alpha) - law.cdf(r - step, alpha)) / (2 * step)
        expected = 2 * np.pi * r * law.profile(r, alpha) / law.albedo.reflectance(alpha)
        np.testing.assert_allclose(slope, expected, rtol=2e-6)


@pytest.mark.slow
def test_scales_with_the_mean_free_path(law):
    np.testing.assert_allclose(law.profile(R, 0.8, 2.5), law.profile(R / 2.5, 0.8) / 2.5**2, rtol=1e-10)
    np.testing.assert_allclose(law.cdf(R, 0.8, 2.5), law.cdf(R / 2.5, 0.8), rtol=1e-10)


@pytest.mark.slow
def test_ends_are_finite_and_right(law):
    for alpha in (0.0, 1e-12, 0.5, 1.0):
        assert law.cdf(0.0, alpha) == 0.0
        assert law.cdf(np.inf, alpha) == 1.0
        assert law.profile(np.inf, alpha) == 0.0
        assert law.sampler.sample(0.0, alpha) == pytest.approx(0.0, abs=1e-20)
        assert law.sampler.sample(1.0, alpha) == np.inf
        assert np.isfinite(law.sampler.pdf(0.0, alpha))
        assert np.all(np.isfinite(law.profile(R, alpha)))
    assert law.profile(0.0, 0.5) == np.inf
    assert law.profile(0.0, 0.0) == 0.0
    assert law.sampler.pdf(0.0, 0.5) == pytest.approx(0.25 / law.albedo.reflectance(0.5), rel=1e-3)


@pytest.mark.slow
def test_monotone_in_radius_and_albedo(law):
    """In alpha up to 1 - 1e-5: nearer to white it may fall by a millionth."""
    alpha = np.unique(np.concatenate([ALPHA, 1 - np.geomspace(1e-5, 0.1, 30)]))
    alpha = alpha[alpha <= 1 - 1e-5]
    profile = law.profile(R, alpha[:, None])
    assert np.all(np.diff(profile[1:], axis=1) < 0)
    assert np.all(np.diff(profile, axis=0) > 0)
    whiter = law.profile(R, 1 - np.geomspace(1e-5, 1e-10, 30)[:, None])
    assert np.min(np.log(law.profile(R, 1.0) / whiter)) > -1e-6
    cdf = law.cdf(R, alpha[:, None])
    assert np.all(np.diff(cdf, axis=1) >= 0)
    assert np.all(np.diff(cdf, axis=0) <= 0)


def test_near_the_exact_profile(law):
    """Twelve held-out albedos; two hundred of them with the slow tests."""
    quality = profile_quality(law, 1 - np.linspace(np.sqrt(0.95), np.sqrt(0.005), 12) ** 2)
    assert np.max(quality.rel) < 0.005
    assert np.max(quality.ks) < 0.0011
    assert np.max(quality.l1) < 0.003


@pytest.mark.slow
def test_near_the_exact_profile_at_two_hundred_albedos(law):
    quality = profile_quality(law, 1 - np.linspace(np.sqrt(0.95), np.sqrt(0.005), 200) ** 2)
    assert np.max(quality.rel) < 0.005
    assert np.max(quality.ks) < 0.0011


def test_another_light_is_seen(law):
    """The same constants under the other light are off by twenty times as much: settings do not mix."""
    other = SETTINGS[law.setting == SETTINGS[0]]
    mixed = Hazard(other, load("hazard", setting=other).albedo, **law.constants())
    assert profile_quality(mixed, [0.5]).rel[0] > 0.02


@pytest.mark.slow
@pytest.mark.parametrize(("steps", "error"), [(1, 1e-4), (2, 1e-7)])
def test_inverse_in_a_fixed_number_of_steps(law, steps, error):
    xi = np.concatenate([np.linspace(0, 0.999, 400), 1 - np.geomspace(1e-3, 1e-6, 20)[1:]])
    sampler = HazardSampler(law, steps)
    missed = np.abs(law.cdf(sampler.sample(xi, ALPHA[:, None]), ALPHA[:, None]) - xi)
    assert np.max(missed) < error
    assert np.max(missed) > error / 1e4  # fewer steps than these are not exact, and the bound says something


@pytest.mark.slow
def test_density_of_the_sampler_is_its_own(law):
    """d xi / dx of the map itself, by differences; the law's own density differs from it by parts in a thousand."""
    xi, step = np.linspace(0.01, 0.99, 99), 1e-6
    for alpha in (0.3, 0.95):
        slope = (law.sampler.sample(xi + step, alpha) - law.sampler.sample(xi - step, alpha)) / (2 * step)
        pdf = law.sampler.pdf(law.sampler.sample(xi, alpha), alpha)
        np.testing.assert_allclose(pdf * slope, 1.0, rtol=1e-5)
        own = 2 * np.pi * law.sampler.sample(xi, alpha) * law.profile(law.sampler.sample(xi, alpha), alpha)
        assert 1e-5 < np.max(np.abs(own / law.albedo.reflectance(alpha) / pdf - 1)) < 1e-2


@pytest.mark.slow
def test_single_precision_costs_less_than_a_tenth_of_the_model_error(law):
    """As a shader runs it: everything that depends on r or xi in float32, the material's shape rounded to float32."""
    with jax.enable_x64(True):
        shape = law.shape(jnp.asarray(INNER)[:, None])
        truth = np.asarray(density(jnp.asarray(R), shape))
        xi = np.arange(1, 2000) / 2000
        x = np.asarray(radius(jnp.asarray(xi), shape, 2))
    single = Shape(*(jnp.asarray(np.asarray(leaf), jnp.float32) for leaf in shape))
    at_32 = np.asarray(density(jnp.asarray(R, jnp.float32), single), float)
    seen = truth > 1e-12  # far beyond the last percent of the energy
    assert np.max(np.abs(at_32 / truth - 1)[seen & (20 / np.asarray(shape.kappa) > R)]) < 3e-4
    drawn = np.asarray(radius(jnp.asarray(xi, jnp.float32), single, 2), float)
    assert np.max(np.abs(law.cdf(drawn, INNER[:, None]) - law.cdf(x, INNER[:, None]))) < 1e-5


def test_series_takes_over_where_the_logarithm_cancels(x64):
    """V and V' on both sides of the switch, against the plain formula in float64 and the limit 1/2 far away."""
    q = np.concatenate([np.geomspace(1e-3, 10, 50), SERIES * np.array([1 - 1e-12, 1 + 1e-12])])
    z = 1 / q
    value, slope = early_share(jnp.asarray(z), jnp.asarray(q), 1.0, jnp.asarray(1 / (1 + q)))
    np.testing.assert_allclose(value, z - z**2 * np.log1p(q), rtol=0, atol=3e-7)
    np.testing.assert_allclose(slope, 1 - 2 * z * np.log1p(q) + 1 / (1 + q), rtol=0, atol=1e-6)
    assert float(early_share(jnp.array(1e6), jnp.array(1e-6), 1.0, jnp.array(1.0))[0]) == pytest.approx(0.5, abs=1e-6)


@pytest.mark.slow
def test_differentiable_in_albedo_and_radius(law):
    with jax.enable_x64(True):
        by_alpha = jax.vmap(jax.grad(lambda a: law.profile(0.5, a)))(jnp.linspace(0.01, 0.99, 9))
        by_radius = jax.vmap(jax.grad(lambda r: law.profile(r, 0.9)))(jnp.asarray(R))
    step = 1e-6
    centre = (law.profile(0.5, 0.5 + step) - law.profile(0.5, 0.5 - step)) / (2 * step)
    assert float(by_alpha[4]) == pytest.approx(centre, rel=1e-6)
    assert np.all(np.asarray(by_alpha) > 0)
    assert np.all(np.asarray(by_radius) < 0)

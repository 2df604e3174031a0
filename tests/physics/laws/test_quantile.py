"""An inverse cdf of its own: the map by hand, its limits, its density, and its error against the exact half space."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import Setting, exact
from profilefit.laws.quantile import FARTHEST, Quantile, depth, radius
from profilefit.laws.surface import decay_rate
from profilefit.recipes import catalogue

# The searchlight's constants, rounded: tests of the form must not move with a record.
ROUNDED = {
    **{"a0": 0.12, "a1": 0.28, "a2": -0.16, "b0": 0.89, "b1": -0.31, "b2": 0.20},
    **{"c0": 0.051, "c1": -0.012, "c2": -0.004},
}
SETTINGS = (Setting(), Setting("diffuse"))
ALBEDOS = np.array([0.0, 1e-6, 0.05, 0.3, 0.6, 0.8, 0.9, 0.95, 0.99, 0.9999, 1.0])
REQUIRED = 1e-3


@pytest.fixture(scope="module")
def law(normalisation):
    return Quantile(Setting(), normalisation, **ROUNDED)


@pytest.fixture(scope="module", params=SETTINGS, ids=lambda setting: setting.illumination)
def shipped(request):
    return catalogue.load("quantile", setting=request.param)


def mapped(law, t, alpha):
    """x and dx/dt in float64."""
    with jax.enable_x64(True):
        return tuple(np.asarray(v) for v in radius(jnp.asarray(t, float), law.curve(jnp.asarray(alpha, float))))


def test_map_by_hand(law):
    """kappa = 0, lambda_0 = 1/2, w = 1, y = 2: a = .12 + .56 - .64, b = .89 - .62 + 1.6, c = 8 (.051 - .012) - .016."""
    t = np.log(2.0)
    m = 1 + 0.04 * t + 1.87 * t / (1 + 2.5 * t) + 0.296 * t**2
    assert law.sampler.sample(0.5, 1.0) == pytest.approx(2 * t * m, rel=1e-12)
    assert law.seen_by("share") == law.seen_by("radius") == law.seen_by("relative_radius") == law.constant_names()
    assert law.seen_by("energy") == ()
    alpha, xi = 0.8, 0.9
    kappa = float(decay_rate(jnp.float32(alpha)))
    y = 2 / float(law.albedo.albedo_over_reflectance(alpha))
    w, t = 1 / (1 - kappa * y) ** 2, -np.log(1 - xi)
    a = w * (0.12 + 0.28 * y - 0.16 * y**2)
    b = 0.89 - 0.31 * y + 0.20 * w * y**3
    c = y**3 * (0.051 - 0.012 * w) - 0.004 * w**3 * y**2
    m = 1 + a * t + b * t / (1 + 2.5 * t) + c * t**2 / (1 + 0.7 * kappa * t)
    assert law.sampler.sample(xi, alpha) == pytest.approx(t * m / (kappa * m + 1 / y - kappa), rel=1e-6)
    xi = np.linspace(0, 0.999, 200, dtype=np.float32)
    alpha = ALBEDOS[:, None].astype(np.float32)
    drawn = jax.jit(law.sampler.sample)(jnp.asarray(xi), jnp.asarray(alpha))
    assert drawn.dtype == jnp.float32
    np.testing.assert_allclose(drawn, law.sampler.sample(xi, alpha), rtol=2e-4, atol=1e-7)


@pytest.mark.slow
def test_limits_at_the_source_and_far_away(law):
    alpha = ALBEDOS[:, None]
    hazard = 0.5 * law.albedo.albedo_over_reflectance(alpha)
    np.testing.assert_allclose(law.sampler.sample(1e-9, alpha), 1e-9 / hazard, rtol=1e-7)
    np.testing.assert_allclose(law.sampler.pdf(0.0, alpha), hazard, rtol=1e-12)
    assert law.source_strength(0.6) == pytest.approx(0.3, rel=1e-14)
    absorbing = ALBEDOS[ALBEDOS < 0.999]
    far, slope = mapped(law, 1e9, absorbing)
    with jax.enable_x64(True):
        kappa = np.asarray(decay_rate(jnp.asarray(absorbing)))
    np.testing.assert_allclose(kappa * far / 1e9, 1.0, rtol=1e-6)
    np.testing.assert_allclose(kappa * slope, 1.0, rtol=1e-6)


@pytest.mark.slow
def test_ends_are_finite_and_the_map_rises_with_xi_and_alpha(shipped):
    alpha, ends = ALBEDOS[:, None], np.ones((ALBEDOS.size, 1))
    np.testing.assert_array_equal(shipped.sampler.sample([0.0, 1.0], alpha), np.tile([0.0, np.inf], ends.shape))
    np.testing.assert_array_equal(shipped.cdf([0.0, np.inf], alpha), ends * [0.0, 1.0])
    np.testing.assert_allclose(shipped.sampler.pdf(np.inf, alpha), 0.0, atol=1e-30)
    profile = shipped.profile([0.0, 1.0, np.inf], alpha)
    np.testing.assert_array_equal(profile[0], 0.0)  # alpha = 0 reflects nothing, not even at the source
    assert np.all(np.isinf(profile[1:, 0]))
    np.testing.assert_array_equal(profile[:, 2], 0.0)
    alpha = 1 - np.linspace(1, 0, 201)[:, None] ** 2
    x, slope = mapped(shipped, np.geomspace(1e-9, 1e6, 400), alpha)
    assert np.all(slope > 0)
    assert np.all(np.diff(x, axis=1) > 0)
    within = shipped.sampler.sample(np.linspace(0, 0.999, 101)[1:], alpha)
    assert np.all(np.diff(within, axis=0) > 0)
    assert np.all(np.isfinite(within) & (within > 0))
    x = np.geomspace(1e-20, FARTHEST, 500)
    with jax.enable_x64(True):
        t = np.asarray(depth(jnp.asarray(x), shipped.curve(jnp.asarray(ALBEDOS)[:, None])))
    np.testing.assert_allclose(mapped(shipped, t, ALBEDOS[:, None])[0], np.tile(x, (ALBEDOS.size, 1)), rtol=1e-13)


def test_cdf_is_the_inverse_of_the_map_and_pdf_its_slope(law):
    """The slow twin: a bracketed root of the map itself."""
    x, alpha = np.array([[1e-6, 0.1, 1.0, 30.0]]), np.array([[0.0], [0.97], [1.0]])
    low, high = np.zeros((3, 4)), 10 * x + 0 * alpha
    for _ in range(60):
        middle = 0.5 * (low + high)
        beyond = mapped(law, middle, alpha)[0] > x
        low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
    np.testing.assert_allclose(law.cdf(x, alpha), -np.expm1(-high), rtol=1e-11)
    xi = np.concatenate([[0.0], np.geomspace(1e-9, 0.5, 50), 1 - np.geomspace(0.49, 1e-9, 50)])
    alpha = ALBEDOS[:, None]
    np.testing.assert_allclose(law.cdf(law.sampler.sample(xi, alpha), alpha), xi + 0 * alpha, rtol=0, atol=2e-14)
    xi, step, alpha = np.linspace(0.01, 0.99, 25), 1e-5, np.array([[0.0], [0.5], [0.95], [1.0]])
    radii = law.sampler.sample([*(xi - step), *xi, *(xi + step), 0.999], alpha)
    low, here, high, end = np.split(radii, [25, 50, 75], 1)
    nodes, weights = np.polynomial.legendre.leggauss(200)
    u = 0.5 * (nodes + 1)  # x = end u^3: dense at the source
    x = np.concatenate([here, end * u**3], axis=1)
    pdf = law.sampler.pdf(x, alpha)
    np.testing.assert_allclose(pdf[:, :25], 2 * step / (high - low), rtol=1e-5)
    inside = np.sum(pdf[:, 25:] * 3 * u**2 * 0.5 * weights, axis=1) * end[:, 0]
    np.testing.assert_allclose(inside, 0.999, rtol=0, atol=1e-8)
    r, whole = np.geomspace(0.01, 20, 12), law.albedo.reflectance(0.7)
    np.testing.assert_allclose(law.sampler.pdf(r, 0.7), 2 * np.pi * r * law.profile(r, 0.7) / whole, rtol=1e-12)
    with jax.enable_x64(True):
        assert float(law.unscaled_energy(jnp.asarray(1e9), jnp.asarray(0.7))) == pytest.approx(whole, rel=1e-14)


def test_error_at_albedos_that_were_not_fitted(shipped):
    """max |cdf(g(xi)) - xi| <= 1e-3; the constants of the other light are no substitute."""
    xi = np.append(np.linspace(0.01, 0.99, 40), 0.999)
    alpha = np.array([0.05, 0.34, 0.66, 0.87, 0.95, 0.995])[:, None]

    def error(law):
        return np.max(np.abs(exact.cdf(law.sampler.sample(xi, alpha), alpha, setting=shipped.setting) - xi))

    other = next(setting for setting in SETTINGS if setting != shipped.setting)
    assert error(shipped) <= REQUIRED
    assert error(catalogue.load("quantile", setting=other)) > 10 * REQUIRED

"""What every profile law promises, and every sampler: energy, cdf, density, units, types."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

ALPHAS = [0.1, 0.3, 0.5, 0.8, 0.95, 0.99]
LAWS = pytest.mark.parametrize("law", ["liang", "liang_printed", "burley"], indirect=True)


@pytest.fixture
def law(request):
    return request.getfixturevalue(request.param)


def reach(law, alpha):
    """A radius that holds all of the light but 1e-15 [mfp]."""
    return float(law.largest_radius(alpha)) if hasattr(law, "largest_radius") else 400.0


def integral(function, edges, nodes=40):
    """Over each interval by Gauss's rule in t, r = low + width sin^2(pi t / 2): roots at either end do no harm."""
    x, w = np.polynomial.legendre.leggauss(nodes)
    t, dt = 0.5 * (x + 1), 0.5 * w
    low, width = np.asarray(edges)[:-1, None], np.diff(edges)[:, None]
    r = low + width * np.sin(np.pi * t / 2) ** 2
    return np.sum(function(r) * width * 0.5 * np.pi * np.sin(np.pi * t) * dt, axis=1)


@LAWS
@pytest.mark.parametrize("alpha", ALPHAS)
def test_profile_and_cdf_have_the_energy_of_the_reflectance(law, alpha):
    edges = np.concatenate([[0.0], np.geomspace(1e-3, reach(law, alpha), 40)])
    total = integral(lambda r: 2 * np.pi * r * law.profile(r, alpha), edges).sum()
    assert total == pytest.approx(law.albedo.reflectance(alpha), rel=1e-10)  # rounding of 1600 nodes
    edges = np.concatenate([[0.0], np.geomspace(1e-3, 1.2 * reach(law, alpha), 30)])
    if hasattr(law, "largest_radius"):
        edges = np.sort(np.append(edges, law.largest_radius(alpha)))  # the profile has a corner there
    rings = integral(lambda r: 2 * np.pi * r * law.profile(r, alpha), edges) / law.albedo.reflectance(alpha)
    np.testing.assert_allclose(np.diff(law.cdf(edges, alpha)), rings, rtol=1e-9, atol=1e-13)
    shares = law.cdf(np.concatenate([[0.0], np.geomspace(1e-6, 1e3, 2000), [np.inf]]), alpha)
    assert shares[0] == 0.0
    assert np.all(np.diff(shares) >= -1e-15)
    assert shares[-1] == pytest.approx(1.0, abs=1e-14)


@pytest.mark.slow
@LAWS
def test_lengths_scale_with_the_mean_free_path(law):
    r, alpha = np.array([0.05, 0.7, 2.0]), np.array([[0.4], [0.9]])
    for mfp in (0.02, 5.0):
        np.testing.assert_allclose(law.profile(r * mfp, alpha, mfp) * mfp**2, law.profile(r, alpha), rtol=1e-12)
        np.testing.assert_allclose(law.cdf(r * mfp, alpha, mfp), law.cdf(r, alpha), rtol=1e-12)
        xi = np.array([0.1, 0.5, 0.9])
        np.testing.assert_allclose(law.sampler.sample(xi, alpha, mfp), mfp * law.sampler.sample(xi, alpha), rtol=1e-12)
        np.testing.assert_allclose(law.sampler.pdf(r * mfp, alpha, mfp) * mfp, law.sampler.pdf(r, alpha), rtol=1e-9)


@LAWS
def test_energy_before_scaling_is_what_a_fit_compares(law):
    """Its shape is the cdf's, and its slope at the source is `source_strength`."""
    with jax.enable_x64(True):
        alpha = jnp.asarray(0.7)
        whole = law.unscaled_energy(jnp.asarray(1e9), alpha)
        share = law.unscaled_energy(jnp.asarray(0.8), alpha) / whole
        slope = law.unscaled_energy(jnp.asarray(1e-7), alpha) / 1e-7
        assert float(share) == pytest.approx(law.cdf(0.8, 0.7), rel=1e-12)
        assert float(slope) == pytest.approx(float(law.source_strength(alpha)), rel=1e-6)  # next term: 1e-7 / c


@LAWS
def test_numbers_give_numbers_and_arrays_broadcast(law):
    for value in (law.profile(1, 0.5), law.cdf(1, 0.5), law.sampler.sample(0.5, 0.5), law.sampler.pdf(1.0, 0.5)):
        assert type(value) is float
    table = law.profile([0.1, 1.0, 2.0], np.array([[0.5], [0.9]]), mfp=[1.0, 2.0, 3.0])
    assert (table.shape, table.dtype) == ((2, 3), np.float64)
    assert table[1, 2] == pytest.approx(law.profile(2.0, 0.9, 3.0), rel=1e-14)  # vector code may round otherwise
    assert law.sampler.pdf([0.1, 1.0, 2.0], [[0.5], [0.9]]).shape == (2, 3)
    outside = law.cdf([0.3, 1.0], 0.9)
    with jax.enable_x64(True):
        np.testing.assert_array_equal(law.cdf([0.3, 1.0], 0.9), outside)
    alphas = jnp.linspace(0.2, 0.9, 8)
    mapped = jax.vmap(lambda a: law.cdf(jnp.float32(0.5), a))(alphas)
    np.testing.assert_allclose(mapped, law.cdf(0.5, np.asarray(alphas, float)), rtol=2e-6)
    names = law.constant_names()
    assert jax.tree.leaves(law) == [law.constants()[name] for name in names]
    moved = law.with_vector(names[:2], [7.0, 8.0])
    assert moved.constants() == {**law.constants(), names[0]: 7.0, names[1]: 8.0}
    np.testing.assert_array_equal(moved.vector(names[:2]), [7.0, 8.0])
    assert moved.setting == law.setting
    with pytest.raises(AttributeError, match="cannot assign"):
        law.setting = None


@pytest.mark.slow
@LAWS
def test_traced_arguments_keep_their_precision(law):
    r, alpha = np.geomspace(0.01, 2.0, 30), 0.8
    single = jnp.asarray(r, jnp.float32)
    for method in (law.profile, law.cdf):
        out = jax.jit(method)(single, jnp.float32(alpha))
        assert out.dtype == jnp.float32
        # float32 rounds at 6e-8; exponents of alpha and 1 - alpha spread it tenfold.
        np.testing.assert_allclose(out, method(r, alpha), rtol=5e-6)
    xi = np.linspace(0.05, 0.95, 19)
    drawn = jax.jit(law.sampler.sample)(jnp.asarray(xi, jnp.float32), jnp.float32(alpha))
    assert drawn.dtype == jnp.float32
    np.testing.assert_allclose(drawn, law.sampler.sample(xi, alpha), rtol=1e-5)


@pytest.mark.slow
@LAWS
@pytest.mark.parametrize("alpha", [0.3, 0.9])
def test_derivatives_are_finite_differences_and_finite_at_both_ends(law, alpha, x64):
    step = 1e-5
    for method in (law.profile, law.cdf):
        for argument in (0, 1):
            at = np.array([0.6, alpha])
            up, down = at.copy(), at.copy()
            up[argument] += step
            down[argument] -= step
            found = jax.grad(method, argnums=argument)(jnp.asarray(at[0]), jnp.asarray(at[1]))
            assert float(found) == pytest.approx((method(*up) - method(*down)) / (2 * step), rel=1e-6)
    # A gradient at r = 0 or beyond all light must not turn a fit into NaN.
    for r in (0.0, 1e9):
        assert np.isfinite(jax.grad(lambda a, r=r: law.cdf(jnp.asarray(r), a))(jnp.asarray(0.7)))


# Samplers


def atom(law, alpha):
    """Share of xi that are clipped: those beyond where g passes the largest radius."""
    if not hasattr(law, "largest_radius"):
        return 0.0
    beyond = lambda xi: law.sampler.unclipped(xi, alpha) - law.largest_radius(alpha)  # noqa: E731
    return 1.0 - brentq(beyond, law.eps, 1.0, xtol=1e-12) if beyond(1.0) > 0 else 0.0


def pieces(law, alpha):
    """Radii between which a sampler's density is smooth."""
    if not hasattr(law, "largest_radius"):
        return np.concatenate([[0.0], np.geomspace(1e-3, 400.0, 60)])
    sampler, farthest = law.sampler, float(law.largest_radius(alpha))
    with jax.enable_x64(True):
        g = np.asarray(sampler.unclipped(jnp.linspace(0.0, 1.0, 2_000_001), alpha))
    dip, end = float(-g.min()), min(farthest, float(g[-1]))
    return np.unique(np.concatenate([[0.0, dip / 2, dip, 1.5 * dip], np.geomspace(2 * dip, end, 40)]))


@pytest.mark.slow
@LAWS
@pytest.mark.parametrize("alpha", [0.1, 0.6, 0.95])
def test_the_density_is_that_of_the_samples(law, alpha):
    """A million evenly spread xi against the integral of the density, ring by ring.

    Where |g| is monotone, even xi fill a ring to within one at either end. At most three branches overlap, so a
    count is off by at most 6: no statistics. The dip of g near xi = eps is known to 1e-6 here, and its density is
    infinite: the two rings beside it get the root of that as slack.
    """
    number = 1_000_000
    edges = pieces(law, alpha)
    drawn = np.asarray(law.sampler.sample((np.arange(number) + 0.5) / number, alpha))
    counted = np.histogram(drawn[drawn < edges[-1]], edges)[0] / number
    expected = integral(lambda r: law.sampler.pdf(r, alpha), edges)
    slack = np.full(counted.size, 7 / number)
    slack[:3] += 3e-5 if hasattr(law, "largest_radius") else 0
    assert np.max(np.abs(counted - expected) / slack) < 1
    # Negative control: the density of the law itself is another one where the sampler only approximates it.
    if hasattr(law, "largest_radius"):
        assert np.max(np.abs(counted - np.diff(law.cdf(edges, alpha))) / slack) > 100


@LAWS
@pytest.mark.parametrize("alpha", [0.1, 0.6, 0.95])
def test_the_density_integrates_to_1_less_the_atom(law, alpha):
    inside = integral(lambda r: law.sampler.pdf(r, alpha), pieces(law, alpha)).sum()
    assert inside + atom(law, alpha) == pytest.approx(1.0, abs=2e-6)

"""The law of Liang et al. against its own printed equations, worked through by hand at one albedo."""

import math

import jax.numpy as jnp
import numpy as np
import pytest

ALPHAS = np.array([0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99])


def test_coefficients_profile_cdf_and_radii_by_hand(liang_printed, x64):
    """(9)-(15) at alpha = 0.5, from the printed digits with a pocket calculator.

    a = -0.0064 * 0.5 + 0.00316 * 0.1^15           = -0.0032
    k = (6.7 * 0.05^2 + 2.6) * 0.5 + 1.3           = 2.608375, b = 0.461 * 0.5^2.608375 = 0.0755965
    c = 0.0097 e^2.1 + 0.166                       = 0.2452118
    """
    a, b, c = (float(value) for value in liang_printed.coefficients(jnp.asarray(0.5)))
    assert a == pytest.approx(-0.0032, abs=1e-14)
    assert b == pytest.approx(0.461 * math.exp(-2.608375 * math.log(2)), rel=1e-14)
    assert b == pytest.approx(0.0755965, rel=1e-5)
    assert float(liang_printed.source_strength(jnp.asarray(0.5))) == pytest.approx(2 * math.pi * b / c, rel=1e-14)
    assert c == pytest.approx(0.2452118, abs=1e-7)
    # (11): k2 0.1^(-30 (alpha - 1)) is k2 itself at 1, a tenth of it at 1 - 1/30, and nothing at 0.9.
    for alpha, share in ((1.0, 1.0), (1 - 1 / 30, 0.1), (0.9, 1e-3)):
        a = float(liang_printed.coefficients(jnp.asarray(alpha))[0])
        assert a + 0.0064 * alpha == pytest.approx(0.00316 * share, rel=1e-12)
    # (7), (16)-(18) at alpha = 0.5, r = 1 and 10, written out without the law's code.
    a, b, c = -0.0032 + 0.00316e-15, 0.461 * 0.5**2.608375, 0.0097 * math.exp(2.1) + 0.166
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


def test_nothing_beyond_the_largest_radius(liang, liang_printed):
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


def test_b0_as_printed_breaks_the_energy_and_a_seventh_of_it_does_not(liang, liang_printed):
    """cdf(r_max) of (17) before (18), which should be 1."""
    for law, low, high in ((liang_printed, 13.5, 15.1), (liang, 0.96, 1.075)):
        ratio = np.asarray(law.unscaled_energy(np.inf, ALPHAS)) / law.albedo.reflectance(ALPHAS)
        assert low < ratio.min()
        assert ratio.max() < high
    profile, inverse = liang.seen_by("energy"), liang.seen_by("radius")
    assert liang.seen_by("radial") == profile
    assert liang.seen_by("share") == inverse
    assert profile + inverse == liang.constant_names()


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

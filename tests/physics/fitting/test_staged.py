"""The paper's protocol on data that it fits without error, and the passage of errors from stage to stage."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import Setting
from profilefit.fitting.profiles import Covariance, Profiles
from profilefit.fitting.staged import PerAlbedo, fit_coefficient_laws, fit_per_albedo, length_exponents, trimmed
from tests.physics.fitting.test_estimate import spread

ALPHAS = np.linspace(0.2, 0.98, 9)
DR = 0.02


def coefficients(law, alpha):
    """a, b, c of (9)-(15) in float64 numpy, written out again."""
    k = law.constants()
    a = k["a1"] * alpha + k["a2"] * 0.1 ** (-k["a3"] * (alpha - 1))
    b = k["b0"] * alpha ** ((k["b1"] * (alpha - k["b2"]) ** 2 + k["b3"]) * alpha + k["b4"])
    return np.stack([a, b, k["c1"] * np.exp(k["c2"] * alpha) + k["c3"]], axis=-1)


def curve_profiles(law, scale=1.0, covariance=None):
    """Ring energies such that value * r is (7) at the ring centre, without noise, in units of `scale` mfp."""
    edges = np.arange(0, 15.0 + DR / 2, DR)
    a, b, c = coefficients(law, ALPHAS)[:, :, None].transpose(1, 0, 2)
    r = 0.5 * (edges[1:] + edges[:-1])
    y = (a * r + b) / (r + c)  # below zero past r_max, where the last stride of (6) may end
    energy = y / r * np.pi * np.diff(edges**2)
    noise, rest = (np.zeros_like(energy), np.full_like(energy, np.inf)), np.zeros(9)
    return Profiles(ALPHAS, edges / scale, energy, *noise, rest, "made", Setting(), 10**6, covariance)


@pytest.fixture(scope="module")
def clean(liang):
    return fit_per_albedo(curve_profiles(liang), liang, 1.0, "r R_d", 0.005)


def test_noise_free_curves_give_their_coefficients_back_from_any_start(clean, liang, liang_printed, x64):
    np.testing.assert_allclose(clean.values, coefficients(liang, ALPHAS), rtol=1e-6)
    assert set(clean.results) == {"converged"}
    assert np.all(clean.rms < 1e-9)
    assert clean.covariance is None
    np.testing.assert_array_equal(clean.standard_error, 0.0)
    for column, value in enumerate(liang.coefficients(jnp.asarray(ALPHAS))):
        np.testing.assert_allclose(np.asarray(value), coefficients(liang, ALPHAS)[:, column], rtol=1e-12)
    found = fit_per_albedo(curve_profiles(liang), liang_printed, 1.0, "r R_d", 0.005)  # b0 seven times too large
    np.testing.assert_allclose(found.values, coefficients(liang, ALPHAS), rtol=1e-6)


def test_the_trimming_keeps_rings_up_to_the_cut_by_strides_of_length(liang):
    profiles = curve_profiles(liang)
    used, cut = trimmed(profiles, "r R_d", 0.005)
    np.testing.assert_array_equal(used, profiles.r <= cut[:, None])
    # (7) falls through 0 at r_max = -b/a: the cut is the first stride at or past .005 of the height, within one stride.
    a, b, _ = coefficients(liang, ALPHAS).T
    assert np.all((cut < -b / a + 1.0) & (cut > 0.9 * -b / a - 1.0))
    whole, ends = trimmed(profiles, "none", 0.005)
    assert whole.all()
    np.testing.assert_array_equal(ends, profiles.r[-1])
    # R_d itself falls much sooner than r R_d.
    assert np.all(trimmed(profiles, "R_d", 0.005)[1] < cut)
    # (6) walks in units of length: at another mean free path it stops at another number of them.
    edges = np.arange(0.0, 12.01, 0.01)
    r = 0.5 * (edges[1:] + edges[:-1])
    energy = (2 * np.pi * np.exp(-r / 0.8) * 0.01)[None]  # r R_d = e^{-r/0.8}, low enough at 4.24
    none = np.zeros_like(energy)
    profiles = Profiles(np.array([0.5]), edges, energy, none, none + np.inf, np.zeros(1), "exact", Setting())
    # 4.24 mfp are 0.424, 0.848, 1.02, 4.24 and 8.48 lengths, where strides are 0.05, 0.1, 0.2, 0.5 and 1.
    expected = {0.1: 0.45, 0.2: 0.9, 0.24: 1.2, 1.0: 4.5, 2.0: 9.0}
    stops = {mfp: mfp * float(trimmed(profiles, "r R_d", 0.005, mfp)[1][0]) for mfp in expected}
    assert stops == pytest.approx(expected)


@pytest.mark.slow
def test_the_coefficient_laws_come_back(clean, liang):
    laws = fit_coefficient_laws(clean, liang.with_vector(("b1", "c2"), [6.0, 4.0]))
    for letter, law in laws.items():
        assert law.solution.converged, letter
        np.testing.assert_allclose(law.solution.parameters, liang.vector(law.names), rtol=1e-4)
        assert law.covariance is None
    names = {"a": ("a1", "a2", "a3"), "b": ("b0", "b1", "b2", "b3", "b4"), "c": ("c1", "c2", "c3")}
    assert {letter: law.names for letter, law in laws.items()} == names
    laws = fit_coefficient_laws(clean, liang, held=("a3",))
    assert laws["a"].names == ("a1", "a2")
    np.testing.assert_allclose(laws["a"].solution.parameters, liang.vector(("a1", "a2")), rtol=1e-4)


def test_length_exponents_are_minus_one_nought_and_one(clean):
    """Rings that scale with l see the same curve in units of l: a ~ 1/l, b ~ 1, c ~ l, to rounding."""

    def exponents(*powers):
        values = {mfp: clean.values * mfp ** np.array(powers) for mfp in (0.5, 1.0, 4.0)}
        rest = None, clean.r_trim, clean.results, clean.rms
        return length_exponents(tuple(PerAlbedo(ALPHAS, mfp, one, *rest) for mfp, one in values.items()))

    assert list(exponents(0, 0, 0)) == ["a", "b", "c"]
    np.testing.assert_allclose(list(exponents(0, 0, 0).values()), [-1.0, 0.0, 1.0], atol=1e-12)
    # Negative control: c that stays where it is in length, and b that doubles with l.
    np.testing.assert_allclose(list(exponents(0, 1, -1).values()), [-1.0, 1.0, 0.0], atol=1e-12)


@pytest.mark.slow
def test_errors_of_the_stages_are_those_of_refitting(liang):
    """Independent noise in every ring: the scatter of a, b, c and of c's constants over 60 refits."""
    base = curve_profiles(liang)
    rng = np.random.default_rng(12)
    size = 2e-4 * base.energy.max() * np.ones_like(base.energy)
    factor = np.zeros((base.energy.shape[1], 9, 9))
    factor[:, np.arange(9), np.arange(9)] = size.T
    huge = 10**12  # so that the terms between rings vanish
    known = replace(base, standard_error=size, photons=huge, covariance=Covariance(factor, base.energy, huge, 0.0))
    one = fit_per_albedo(known, liang, 1.0, "none", 0.005)
    scattered, constants = [], []
    for _ in range(60):
        again = replace(base, energy=base.energy + size * rng.standard_normal(size.shape), standard_error=size)
        points = fit_per_albedo(again, liang, 1.0, "none", 0.005)
        scattered.append(points.values.ravel())
        constants.append(fit_coefficient_laws(points, liang, held=("a3",))["c"].solution.parameters)
    for wrong, seen in ((1.0, False), (1.2, True), (1 / 1.2, True)):
        assert (spread(np.array(scattered), wrong**2 * one.covariance) < 1e-3) == seen
    law = fit_coefficient_laws(one, liang, held=("a3",))["c"]
    assert spread(np.array(constants), law.covariance) > 1e-3
    assert spread(np.array(constants), 2 * law.covariance) < 1e-3
    assert one.standard_error.shape == (9, 3)

"""Sums of Gaussians: with coefficient laws; skin by printed sets, typed again, and what their authors say of them."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import Setting
from profilefit.fitting.estimate import ResidualFunction, rings_of
from profilefit.fitting.profiles import Profiles
from profilefit.fitting.solver import least_squares
from profilefit.laws.gaussians import Gaussians, law_class
from profilefit.materials import CHANNELS
from profilefit.scenes.skin.law import D_EON, separable
from tests.fixtures import refused

# Four Gaussians fitted to the exact profile, rounded.
FOUR = {
    **{"f1": -5.96, "f2": 2.24, "v1": -4.18, "v2": 3.17, "v3": 2.36, "v4": 1.87},
    **{"w20": 1.09, "w21": 0.04, "w30": 1.63, "w31": -0.06, "w40": 1.15, "w41": -0.12},
}


def test_parts_and_profile_by_hand_and_at_both_ends(normalisation):
    """At alpha = 3/4 s = 1/2: ln v_1 = -4.18 - 2.98 + 0.56; one ratio is 1 + e^3.17; weights e^(1.09 + 0.02) : 1."""
    four = law_class(4)(Setting(), normalisation, **FOUR)
    with jax.enable_x64(True):
        variances = np.asarray(four.variances(jnp.asarray(0.75)))
        weights = np.exp(four.log_weights(jnp.asarray(0.75)))
    assert variances[0] == pytest.approx(np.exp(-6.6), rel=1e-13)
    assert variances[1] / variances[0] == pytest.approx(1 + np.exp(3.17), rel=1e-13)
    assert weights[1] / weights[0] == pytest.approx(np.exp(1.11), rel=1e-13)
    assert weights.sum() == pytest.approx(1, rel=1e-14)
    alpha, r = 0.6, np.geomspace(0.01, 5, 3)
    with jax.enable_x64(True):
        variances, weights = np.asarray(four.variances(alpha)), np.exp(four.log_weights(jnp.asarray(alpha)))
    gaussians = [w * np.exp(-(r**2) / (2 * v)) / (2 * np.pi * v) for w, v in zip(weights, variances, strict=True)]
    np.testing.assert_allclose(four.profile(r, alpha), four.albedo.reflectance(alpha) * sum(gaussians), rtol=1e-12)
    share = sum(w * (1 - np.exp(-(r**2) / (2 * v))) for w, v in zip(weights, variances, strict=True))
    np.testing.assert_allclose(four.cdf(r, alpha), share, rtol=1e-11)
    r, alpha = np.array([0.0, 1.0, np.inf]), np.array([[0.0], [0.5], [1.0]])
    with jax.enable_x64(True):
        assert np.all(np.diff(four.variances(jnp.asarray(alpha))) > 0)
    np.testing.assert_allclose(four.cdf(r[[0, 2]], alpha), [[0.0, 1.0]] * 3, rtol=0, atol=1e-15)
    assert np.all(np.isfinite(four.profile(r, alpha)))
    np.testing.assert_array_equal(four.profile(np.inf, alpha), 0.0)
    assert float(four.source_strength(jnp.float32(0.5))) == 0.0


@pytest.mark.parametrize("count", [3, pytest.param(8, marks=pytest.mark.slow)])
def test_sampler_inverts_the_cdf(count, normalisation):
    """At the start of a fit, where three Gaussians are factors of 160 apart in variance, Newton has the most to do."""
    law = law_class(count)(Setting(), normalisation, **law_class(count).start())
    xi = np.concatenate([[0.0], np.geomspace(1e-9, 0.5, 100), 1 - np.geomspace(0.49, 1e-12, 100)])
    r = law.sampler.sample(xi, 0.5)
    np.testing.assert_allclose(law.cdf(r, 0.5), xi, rtol=0, atol=2e-14)
    assert np.all(np.diff(r) > 0)
    assert law.sampler.sample(1.0, 0.5) == np.inf
    near = r[1:-60:7]
    expected = 2 * np.pi * near * law.profile(near, 0.5) / law.albedo.reflectance(0.5)
    np.testing.assert_allclose(law.sampler.pdf(near, 0.5), expected, rtol=1e-12)


@pytest.mark.parametrize("count", [1, 5, 8])
def test_three_constants_a_gaussian(count, normalisation):
    kind = law_class(count)
    assert len(kind.constant_names()) == 3 * count
    assert kind is law_class(count)
    law = kind(Setting(), normalisation, **kind.start())
    assert isinstance(law, Gaussians)
    assert jax.tree.leaves(law) == list(law.constants().values())
    assert law_class() is law_class(6)


@pytest.mark.parametrize("count", [0, 9, 2.0, True, "6"])
def test_other_counts_are_refused(count):
    law_class(1)  # to a dictionary, True is 1 and 2.0 is 2
    law_class(2)
    refused(r"count must be a number of Gaussians in 1 \.\.\. 8, got", law_class, count)


def test_start_spans_the_radii_of_use(normalisation):
    """At white; the fits that are shipped start at constants of their own."""
    law = law_class(5)(Setting(), normalisation, **law_class(5).start())
    with jax.enable_x64(True):
        variances = np.asarray(law.variances(jnp.asarray(1.0)))
    np.testing.assert_allclose(np.sqrt(variances[[0, -1]]), [0.05, 8.0], rtol=1e-12)
    np.testing.assert_allclose(np.diff(np.log(variances)), np.log(160.0**2) / 4, rtol=1e-12)
    assert law_class(4).start().items() >= {"f1": -6.0, "v4": 2.1, "w41": -0.1}.items()


@pytest.mark.slow
def test_a_fit_from_the_start_converges(normalisation):
    """Two Gaussians on a few albedos: the rms misfit of ring energies that dense fits find, 0.07."""
    alpha = np.array([0.2, 0.5, 0.8, 0.95])
    profiles = Profiles.from_exact(alpha, np.concatenate([[0], np.geomspace(0.02, 50, 14)]), Setting())
    kind = law_class(2)
    law = kind(Setting(), normalisation, **kind.start())
    names = kind.constant_names()
    data = law, rings_of(profiles, None, (0.0, 0.0), ())
    solution = least_squares(ResidualFunction("energy", names), law.vector(names), data)
    assert solution.converged
    assert np.sqrt(np.mean(solution.residuals**2)) < 0.12


# d'Eon and Luebke, GPU Gems 3, ch. 14: variance [mm^2], weights of red, green, blue.
PRINTED = """
0.0064  0.233  0.455  0.649
0.0484  0.100  0.336  0.344
0.187   0.118  0.198  0
0.567   0.113  0.007  0.007
1.99    0.358  0.004  0
7.41    0.078  0      0
"""


def test_printed_skin_its_weights_and_its_energy():
    table = np.array([[float(word) for word in line.split()] for line in PRINTED.strip().splitlines()])
    np.testing.assert_array_equal(D_EON.variances, table[:, 0])
    np.testing.assert_array_equal(D_EON.weights, table[:, 1:])
    assert len(CHANNELS) == 3
    # "The Gaussian weights for each profile sum to 1.0": white light stays white.
    np.testing.assert_allclose(energy(D_EON), 1.0, rtol=1e-12)
    # At the origin sum w / (2 pi v).
    assert D_EON.profile(0.0)[0] == pytest.approx(np.sum(table[:, 1] / (2 * math.pi * table[:, 0])), rel=1e-14)
    assert D_EON.profile(np.ones((2, 5))).shape == (2, 5, 3)
    # In every channel, stretched by 0.001 + falloff, by default 1, 0.37, 0.3.
    skin, r = separable(), 0.8
    for channel, falloff in enumerate((1.0, 0.37, 0.3)):
        scaled = r / (0.001 + falloff)
        narrowest = 0.233 * math.exp(-(scaled**2) / (2 * 0.0064)) / (2 * math.pi * 0.0064)
        assert skin.profile(r)[channel] == pytest.approx(D_EON.profile(scaled)[0] - narrowest, rel=1e-12)
    assert energy(skin)[0] == pytest.approx(0.767 * 1.001**2, rel=1e-12)
    r = np.geomspace(1e-5, 30, 4001)
    for skin in (D_EON, separable()):
        total = np.trapezoid(2 * np.pi * r[:, None] ** 2 * skin.profile(r), np.log(r), axis=0)
        np.testing.assert_allclose(total, energy(skin), rtol=1e-5)


def energy(skin):
    """Integral of 2 pi r R over all r, of red, green, blue [-]."""
    return np.sum(skin.weights, axis=0) * np.square(skin.stretches)

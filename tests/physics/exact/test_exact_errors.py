"""How wrong the exact half space is, what it says of that, and what it refuses."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import InputError, Setting, SettingError, exact
from mcml_sim.exact.by_albedo import by_alpha, profile
from mcml_sim.exact.transform import STANDARD, Rule
from tests.fixtures import refused

BOTH = pytest.mark.parametrize("setting", [Setting(), Setting("diffuse")], ids=["searchlight", "diffuse"])
ALPHAS = np.array([[0.05], [0.3], [0.6], [0.9], [0.999], [1.0]])


def sampled(rule, r):
    return by_alpha(profile, r, ALPHAS, exact.SEARCHLIGHT, rule)


@pytest.mark.slow
@BOTH
def test_more_nodes_change_nothing(setting):
    """The documented errors, from the estimate itself."""
    found = exact.error_estimate(np.append(np.geomspace(1e-3, 35.0, 30), 100.0), ALPHAS, setting=setting)
    assert found[:, :-1].max() < 1e-10
    assert found.max() < 2e-7


@pytest.mark.slow
def test_the_estimate_is_the_error():
    """With half the nodes as with all of them: it sees what a quadrature that is too coarse gets wrong."""
    r, rule = np.geomspace(1e-2, 10.0, 12), STANDARD.scaled(0.5)
    coarse, finer, truth = (sampled(which, r) for which in (rule, rule.scaled(1.5), STANDARD))
    error, estimate = np.abs(coarse / truth - 1), np.abs(coarse / finer - 1)
    assert error.max() > 1e-6
    assert estimate.max() == pytest.approx(error.max(), rel=0.5)
    # It has the shape of the profile, and is 0 at its ends.
    assert type(exact.error_estimate(1.0, 0.5)) is float
    np.testing.assert_array_equal(exact.error_estimate([0.0, np.inf], [[0.0], [0.5]]), 0)
    assert exact.error_estimate(2.0, 0.5, 2.0) == exact.error_estimate(1.0, 0.5)


@pytest.mark.slow
@pytest.mark.parametrize("rule", [Rule(112, 24, 40), Rule(224, 6, 40), Rule(224, 24, 16)])
def test_every_quadrature_needs_its_nodes(rule):
    r = np.geomspace(1e-2, 10.0, 12)
    assert np.abs(sampled(rule, r) / sampled(STANDARD, r) - 1).max() > 1e-7


def test_numbers_give_numbers_and_arrays_broadcast():
    for value in (exact.reflectance(0.5), exact.profile(1, 0.5), exact.cdf(1, 0.5), exact.quantile(0.5, 0.5)):
        assert type(value) is float
    assert type(exact.decay_rate(0.5)) is float
    assert exact.reflectance([[0.5, 0.6]]).shape == (1, 2)
    r, alpha, mfp = np.array([0.1, 1.0, 3.0]), np.array([[0.5], [0.9]]), np.array([[[1.0]], [[2.0]]])
    table = exact.profile(r, alpha, mfp)
    assert table.shape == (2, 2, 3)
    assert table[1, 0, 2] == pytest.approx(exact.profile(3.0, 0.5, 2.0), rel=1e-13)
    assert exact.cdf(r, alpha).shape == (2, 3)
    assert exact.quantile(np.array([0.1, 0.5, 0.9]), alpha, 2.0).shape == (2, 3)
    assert exact.profile([], 0.5).shape == exact.reflectance([]).shape == (0,)


# Masked, complex, text, other objects, ragged: numpy would make numbers of the first three.
NO_NUMBERS = (np.ma.masked_less([0.1, 0.5], 0.3), np.array([0.5 + 0j]), "0.5", [None], [[1], [1, 2]])
BY_SETTING = (  # every function of an albedo under a setting
    lambda alpha, setting: exact.reflectance(alpha, setting),
    lambda alpha, setting: exact.profile(1.0, alpha, setting=setting),
    lambda alpha, setting: exact.cdf(1.0, alpha, setting=setting),
    lambda alpha, setting: exact.quantile(0.5, alpha, setting=setting),
    lambda alpha, setting: exact.error_estimate(1.0, alpha, setting=setting),
)


@pytest.mark.parametrize("alpha", [-0.1, 1.1, np.nan, [0.5, 2.0], "half", None, *NO_NUMBERS])
def test_albedo_must_be_in_0_to_1(alpha):
    for call in (*BY_SETTING, lambda alpha, _: exact.decay_rate(alpha)):
        refused(r"alpha must be a reduced albedo in \[0, 1\], got \S", call, alpha, exact.SEARCHLIGHT)


@pytest.mark.parametrize(
    ("call", "values", "said"),
    [
        (lambda r: exact.profile(r, 0.5), [-1.0, np.nan, "far", *NO_NUMBERS], r"r must be a radius >= 0, got \S"),
        (lambda r: exact.profile(r, 0.5), [[1.0, -3.0, -4.0]], r"got -3\.0$"),
        (
            lambda mfp: exact.profile(1.0, 0.5, mfp),
            [0.0, -1.0, np.inf, np.nan, "long"],
            r"mfp must be a transport mean free path > 0, from 1e-100 to 1e\+100, got",
        ),
        (
            lambda xi: exact.quantile(xi, 0.5),
            [-0.1, 1.5, np.nan, "most", *NO_NUMBERS],
            r"xi must be a share of the energy in \[0, 1\], got \S",
        ),
    ],
    ids=["radius", "first offender", "mean free path", "share"],
)
def test_other_arguments_must_be_in_their_ranges(call, values, said):
    for value in values:
        refused(said, call, value)


OUTSIDE = (
    *(Setting(n=n, g=g) for n, g in ((0.9, 0), (1, 0.5), (1.4, 0.97), (1.4, -0.1))),
    Setting("diffuse", 1.5, 0.1),
)


@pytest.mark.parametrize("setting", [*OUTSIDE, "diffuse", None], ids=str)
def test_other_surfaces_are_refused_by_name(setting):
    assert setting not in OUTSIDE or not setting.is_solved
    where = r"n >= 1 where g = 0, and n from 1.33 to 1.45 where .* g is from 0 to 0.95"
    for call in BY_SETTING:
        with pytest.raises(SettingError, match=rf"{where}, got .*: simulate it instead \(mcml_sim.simulate_orders\)"):
            call(0.5, setting)


def test_shapes_that_do_not_broadcast_are_named():
    two, three = np.array([0.1, 0.2]), np.array([0.1, 0.2, 0.3])
    for ask in (exact.profile, exact.cdf, exact.error_estimate):
        refused(r"broadcast to one, got r \(2,\), alpha \(3,\), mfp \(\)", ask, two, three)
    refused(r"broadcast to one, got xi \(2,\), alpha \(\), mfp \(3,\)", exact.quantile, two, 0.5, three)
    with jax.enable_x64(True), pytest.raises(InputError, match=r"got r \(2,\), alpha \(3,\), mfp \(\)"):
        exact.profile(jnp.asarray(two), jnp.asarray(three))

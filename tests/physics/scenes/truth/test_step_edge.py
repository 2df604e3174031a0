"""The step edge against a plane sum that knows nothing of circles, and the estimator on it against a loop."""

import numpy as np
import pytest
from scipy.special import erf
from scipy.stats import chi2

import profilefit
from benchmarks.step_edge import by_uniform
from mcml_sim import Setting, exact
from profilefit.errors import InputError, SettingError
from profilefit.laws.gaussians import law_class
from profilefit.scenes.stage import pattern, step_edge
from profilefit.scenes.stage.pattern import WRAPS
from profilefit.scenes.stage.step_edge import (
    EdgeGather,
    by_law,
    by_quantile,
    edge_estimate,
    random_points,
    shifted_points,
    step_response,
)

SEARCHLIGHT, DIFFUSE = Setting(), Setting("diffuse")
BESIDE = (np.arange(16) - 7.5) / 2.0


def noise(gather, points, alpha, setting):
    return np.sqrt(np.mean(edge_estimate(gather, points, BESIDE, alpha, setting).rmse ** 2))


@pytest.mark.slow
def test_is_the_obvious_loop():
    law = profilefit.load("burley", "published")
    points = random_points(5, 3, seed=4)
    xi, angle = points[..., 0], 2.0 * np.pi * points[..., 1]
    found = []
    for trial in range(3):
        total = lit = 0.0
        for i in range(5):
            r = law.sampler.sample(xi[trial, i], 0.8)
            weight = law.profile(r, 0.8) / (law.sampler.pdf(r, 0.8) / (2.0 * np.pi * r))
            total += weight
            lit += weight * (0.3 + r * np.cos(angle[trial, i]) > 0)
        found.append(lit / total)
    estimate = edge_estimate(by_law(law, 0.8), points, [0.3], 0.8, SEARCHLIGHT)
    assert estimate.mean == pytest.approx(np.mean(found), abs=1e-12)
    assert estimate.variance == pytest.approx(np.var(found, ddof=1), abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("setting", [SEARCHLIGHT, DIFFUSE], ids=str)
def test_exact_quantile_is_binomial(setting, sidak):
    """Of 64 weights of 1 a number is lit that is binomial: mean and variance are known, and it has no bias."""
    trials, chance = 4000, 1e-3
    found = edge_estimate(by_quantile(0.9, setting), random_points(64, trials, seed=7), BESIDE, 0.9, setting)
    limit = sidak(BESIDE.size)
    assert np.max(np.abs(found.bias / found.standard_error)) < limit
    expected = found.truth * (1.0 - found.truth) / 64
    low, high = (
        chi2.ppf(p, trials - 1) / (trials - 1) for p in (chance / BESIDE.size / 2, 1 - chance / BESIDE.size / 2)
    )
    assert np.all((found.variance > low * expected) & (found.variance < high * expected))
    other = edge_estimate(by_quantile(0.85, setting), random_points(64, trials, seed=7), BESIDE, 0.9, setting)
    assert np.max(np.abs(other.bias / other.standard_error)) > limit


def test_quantile_curve():
    xi = np.random.default_rng(1).random(200)
    for alpha in (0.5, 0.99):
        np.testing.assert_allclose(by_quantile(alpha).sample(xi), exact.quantile(xi, alpha), rtol=1e-9)


@pytest.mark.slow
def test_mean_tends_to_the_law_and_not_to_the_truth(sidak):
    law = profilefit.load("liang", "corrected")
    found = edge_estimate(by_law(law, 0.8), random_points(256, 2000, seed=3), BESIDE, 0.8, SEARCHLIGHT)
    of_law = step_response(BESIDE, 0.8, law=law) - found.truth
    # The ratio of two sums has a bias of order 1/n: for weights of this spread below 3e-4 at n = 256.
    assert np.all(np.abs(found.bias - of_law) < sidak(BESIDE.size) * found.standard_error + 3e-4)
    assert np.max(np.abs(found.bias)) > 0.003


@pytest.mark.slow
@pytest.mark.parametrize("setting", [SEARCHLIGHT, DIFFUSE], ids=str)
@pytest.mark.parametrize("alpha", [0.5, 0.99])
def test_project_law_is_as_good_as_the_exact_quantile(alpha, setting):
    """At 64 samples the error is at most 1.1 that of the exact quantile; uniform radii have 1.29 and more."""
    law = profilefit.load("hazard", setting=setting)
    for draw in (random_points, shifted_points):
        points = draw(64, 200, seed=5)
        floor = noise(by_quantile(alpha, setting), points, alpha, setting)
        assert noise(by_law(law, alpha), points, alpha, setting) < 1.1 * floor
        assert noise(by_uniform(alpha, setting), points, alpha, setting) > 1.2 * floor


def test_lattice_beats_random_points():
    gather = by_quantile(0.8, DIFFUSE)
    random, lattice = (noise(gather, draw(64, 500, seed=5), 0.8, DIFFUSE) for draw in (random_points, shifted_points))
    assert lattice < 0.5 * random


def test_nothing_to_gather_leaves_the_point_its_own_light():
    empty = EdgeGather(lambda xi: xi, np.zeros_like)
    found = edge_estimate(empty, random_points(4, 3, seed=1), [-1.0, 1.0], 0.5, SEARCHLIGHT)
    np.testing.assert_array_equal(found.mean, [0.0, 1.0])


def test_atoms_weigh_nothing():
    law = profilefit.load("liang", "corrected")
    gather = by_law(law, 0.95)
    last = gather.sample(np.array([1.0 - 1e-6]))
    np.testing.assert_allclose(last, law.largest_radius(0.95))
    assert gather.weight(last) == 0.0


@pytest.mark.parametrize("samples", [1, 17, 64])
def test_points_by_default_are_the_stage_s(samples):
    """Its lattice, moved as a whole by less than the edges of a cell; of a shift over the torus none is near enough."""
    base, edges = pattern.points(samples), pattern.best(samples).cell

    def shares(shifted):
        moved = (shifted - base + 0.5) % 1.0 - 0.5
        np.testing.assert_allclose((moved - moved[:, :1] + 0.5) % 1.0, 0.5, atol=1e-9)
        places = moved[:, 0, None, None] + WRAPS.reshape(1, -1, 2)  # a shift is one modulo 1
        inside = places @ np.linalg.inv(edges)
        return np.any(np.all((inside > -1e-9) & (inside < 1.0), axis=-1), axis=(1, 2))

    assert np.all(shares(shifted_points(samples, 200, seed=2)))
    torus = shares((base + np.random.default_rng(2).random((200, 1, 2))) % 1.0)
    assert samples == 1 or np.mean(torus) < 0.2


def test_one_trial_has_no_variance():
    with pytest.raises(InputError, match="points must be \\(trials >= 2"):
        edge_estimate(by_quantile(0.5), shifted_points(2, 1, 1), [0.0], 0.5, SEARCHLIGHT)


PLACES = np.array([-30.0, -4.0, -0.5, -1e-3, -1e-7, 0.0, 1e-4, 0.03, 1.0, 4.0])


def plane_sum(distance, alpha, setting):
    """The share from beyond a straight edge: R_d / A over x > distance and all y, by Gauss panels on squares."""
    ends = np.concatenate([[0.0], np.geomspace(0.05, 120.0, 24)])
    nodes, weights = np.polynomial.legendre.leggauss(8)
    along = (ends[:-1, None] + 0.5 * np.diff(ends)[:, None] * (nodes + 1.0)).ravel()
    share = (0.5 * np.diff(ends)[:, None] * weights).ravel()
    r = np.hypot(distance + along[:, None], along)
    profile = exact.profile(r, alpha, setting=setting) / exact.reflectance(alpha, setting)
    return 2.0 * share @ profile @ share


@pytest.mark.slow
@pytest.mark.parametrize("setting", [Setting(), DIFFUSE], ids=str)
def test_is_the_sum_over_the_lit_half_plane(setting):
    found = step_response(-0.5, 0.9, setting=setting)
    assert found == pytest.approx(plane_sum(0.5, 0.9, setting), abs=1e-8)
    assert step_response(0.5, 0.9, setting=setting) == pytest.approx(1.0 - found, abs=1e-15)
    other = DIFFUSE if setting == Setting() else Setting()
    assert abs(found - step_response(-0.5, 0.9, setting=other)) > 1e-3


def test_one_gaussian_is_an_error_function(normalisation):
    law = law_class(1)(Setting(), normalisation, f1=0.0, f2=0.0, v1=np.log(0.7**2))
    x = np.append(PLACES, [-2.1, 0.7])
    np.testing.assert_allclose(step_response(x, 0.5, law=law), 0.5 + 0.5 * erf(x / (0.7 * 2**0.5)), atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(
    "law", [None, ("hazard", "regenerated"), ("liang", "corrected"), ("gaussians:4", "regenerated")]
)
def test_more_nodes_change_nothing(law, monkeypatch):
    alphas = np.array([[1e-6], [0.5], [0.95], [1.0]] if law is None or law[0] != "liang" else [[0.05], [0.95], [1.0]])
    chosen = law and profilefit.load(*law)
    coarse = step_response(PLACES, alphas, law=chosen)
    monkeypatch.setattr(step_edge, "NODES", 2 * step_edge.NODES)
    np.testing.assert_allclose(coarse, step_response(PLACES, alphas, law=chosen), atol=1e-8)
    monkeypatch.setattr(step_edge, "NODES", 1)  # the comparison can fail
    assert np.max(np.abs(coarse - step_response(PLACES, alphas, law=chosen))) > 1e-5


@pytest.mark.slow
def test_ends_symmetry_and_units():
    assert step_response(0.0, 0.8) == 0.5
    assert step_response(-1e6, 0.8) == 0.0
    assert step_response(1e6, 0.8) == 1.0
    # White light falls off as x^-3: beyond 1e7 mfp its last 1e-7 is given up.
    assert step_response(-1e5, 1.0) * 1e5 == pytest.approx(step_response(-1e4, 1.0) * 1e4, rel=1e-3)
    x = np.linspace(-3.0, 3.0, 7)
    found = step_response(x, [[0.3], [0.9]])
    assert found.shape == (2, 7)
    assert np.all(np.diff(found) > 0)
    np.testing.assert_allclose(found + found[:, ::-1], 1.0, atol=1e-15)
    np.testing.assert_allclose(step_response(2.5 * x, 0.9, 2.5), found[1], atol=1e-15)
    assert isinstance(step_response(1.0, 0.5), float)


@pytest.mark.slow
def test_bias_of_the_project_law_is_small():
    """Within 4 mfp of the edge, at most 0.3 % of A; a published law has more."""
    x = np.linspace(-4.0, 4.0, 41)
    alphas = np.array([[0.5], [0.8], [0.95], [0.99]])
    for setting in (Setting(), DIFFUSE, Setting(n=1.4, g=0.8)):
        truth = step_response(x, alphas, setting=setting)
        assert np.max(np.abs(step_response(x, alphas, law=profilefit.load("hazard", setting=setting)) - truth)) < 0.003
    published = profilefit.load("burley", "published")
    assert np.max(np.abs(step_response(x, alphas, law=published) - step_response(x, alphas))) > 0.003


def test_misuse():
    with pytest.raises(InputError, match="alpha must be a single-scattering albedo"):
        step_response(1.0, 1.5)
    with pytest.raises(InputError, match="x must be a finite place, got inf"):
        step_response(np.inf, 0.5)
    with pytest.raises(InputError, match="mfp must be a mean free path > 0, got 0"):
        step_response(1.0, 0.5, 0.0)
    with pytest.raises(SettingError, match="the law belongs to searchlight"):
        step_response(1.0, 0.5, setting=DIFFUSE, law=profilefit.load("hazard"))
    with pytest.raises(SettingError, match="give a law of that setting"):
        step_response(1.0, 0.5, setting=Setting(n=0.9))

"""The step edge: a plane sum that knows no circles, the estimator against a loop, and pictures, also aslant."""

import numpy as np
import pytest
from scipy.special import erf
from scipy.stats import chi2

import profilefit
from benchmarks import planes
from benchmarks.step_edge import by_uniform
from mcml_sim import Setting, exact
from profilefit.errors import SettingError
from profilefit.laws.gaussians import law_class
from profilefit.scenes.stage import pattern
from profilefit.scenes.stage.exact_law import ExactLaw
from profilefit.scenes.stage.pattern import KINDS, WRAPS, Sampling
from profilefit.scenes.stage.reference import step_edge
from profilefit.scenes.stage.reference.step_edge import (
    by_quantile,
    edge_estimate,
    random_points,
    shifted_points,
    step_response,
)
from profilefit.scenes.stage.stage import Stage
from tests.physics.scenes import edges
from tests.unit.scenes.scenes import refused

SETTINGS = SEARCHLIGHT, DIFFUSE = Setting(), Setting("diffuse")
BESIDE = (np.arange(16) - 7.5) / 2.0
PLACES = np.array([-30.0, -4.0, -0.5, -1e-3, -1e-7, 0.0, 1e-4, 0.03, 1.0, 4.0])
LONG = 8.0  # mean free path [mm]
ASLANT, MIDDLE = (64, 128), (slice(48, 80), slice(24, 40))
BOUND = 0.006  # of A: at 85 degrees a pixel is 1.4 mfp, and is lit in its middle or not; standard errors are 0.001


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
    estimate = edge_estimate(step_edge.by_law(law, 0.8), points, [0.3], 0.8, SEARCHLIGHT)
    assert estimate.mean == pytest.approx(np.mean(found), abs=1e-12)
    assert estimate.variance == pytest.approx(np.var(found, ddof=1), abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("setting", SETTINGS, ids=str)
def test_exact_quantile_is_binomial(setting, sidak):
    """Of 64 weights of 1 a number is lit that is binomial: mean and variance are known, and it has no bias."""
    trials, chance = 4000, 1e-3
    found = edge_estimate(by_quantile(0.9, setting), random_points(64, trials, seed=7), BESIDE, 0.9, setting)
    limit = sidak(BESIDE.size)
    assert np.max(np.abs(found.bias / found.standard_error)) < limit
    expected = found.truth * (1.0 - found.truth) / 64
    tail = chance / BESIDE.size / 2
    low, high = chi2.ppf((tail, 1 - tail), trials - 1) / (trials - 1)
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
    found = edge_estimate(step_edge.by_law(law, 0.8), random_points(256, 2000, seed=3), BESIDE, 0.8, SEARCHLIGHT)
    of_law = step_response(BESIDE, 0.8, law=law) - found.truth
    # The ratio of two sums has a bias of order 1/n: for weights of this spread below 3e-4 at n = 256.
    assert np.all(np.abs(found.bias - of_law) < sidak(BESIDE.size) * found.standard_error + 3e-4)
    assert np.max(np.abs(found.bias)) > 0.003


@pytest.mark.slow
@pytest.mark.parametrize("setting", SETTINGS, ids=str)
@pytest.mark.parametrize("alpha", [0.5, 0.99])
def test_project_law_is_as_good_as_the_exact_quantile(alpha, setting):
    """At 64 samples the error is at most 1.1 that of the exact quantile; uniform radii have 1.29 and more."""
    law = profilefit.load("hazard", setting=setting)
    for draw in (random_points, shifted_points):
        points = draw(64, 200, seed=5)
        floor = noise(by_quantile(alpha, setting), points, alpha, setting)
        assert noise(step_edge.by_law(law, alpha), points, alpha, setting) < 1.1 * floor
        assert noise(by_uniform(alpha, setting), points, alpha, setting) > 1.2 * floor


def test_lattice_beats_random_points():
    gather = by_quantile(0.8, DIFFUSE)
    random, lattice = (noise(gather, draw(64, 500, seed=5), 0.8, DIFFUSE) for draw in (random_points, shifted_points))
    assert lattice < 0.5 * random


def test_what_weighs_nothing():
    """Where that is all there is to gather, a point keeps its own light; an atom of a law that ends."""
    empty = step_edge.EdgeGather(lambda xi: xi, np.zeros_like)
    found = edge_estimate(empty, random_points(4, 3, seed=1), [-1.0, 1.0], 0.5, SEARCHLIGHT)
    np.testing.assert_array_equal(found.mean, [0.0, 1.0])
    law = profilefit.load("liang", "corrected")
    gather = step_edge.by_law(law, 0.95)
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
@pytest.mark.parametrize("setting", SETTINGS, ids=str)
def test_is_the_sum_over_the_lit_half_plane(setting):
    found = step_response(-0.5, 0.9, setting=setting)
    assert found == pytest.approx(plane_sum(0.5, 0.9, setting), abs=1e-8)
    assert step_response(0.5, 0.9, setting=setting) == pytest.approx(1.0 - found, abs=1e-15)
    (other,) = {*SETTINGS} - {setting}
    assert abs(found - step_response(-0.5, 0.9, setting=other)) > 1e-3


def test_one_gaussian_is_an_error_function(normalisation):
    law = law_class(1)(Setting(), normalisation, f1=0.0, f2=0.0, v1=np.log(0.7**2))
    x = np.append(PLACES, [-2.1, 0.7])
    np.testing.assert_allclose(step_response(x, 0.5, law=law), 0.5 + 0.5 * erf(x / (0.7 * 2**0.5)), atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("law", [(), ("hazard",), ("liang", "corrected"), ("gaussians:4",)])
def test_more_nodes_change_nothing(law, monkeypatch):
    alphas = np.array([[0.05], [0.95], [1.0]] if "liang" in law else [[1e-6], [0.5], [0.95], [1.0]])
    chosen = profilefit.load(*law) if law else None
    coarse = step_response(PLACES, alphas, law=chosen)
    monkeypatch.setattr(step_edge, "NODES", 2 * step_edge.NODES)
    np.testing.assert_allclose(coarse, step_response(PLACES, alphas, law=chosen), atol=1e-8)
    monkeypatch.setattr(step_edge, "NODES", 1)  # the comparison can fail
    assert np.max(np.abs(coarse - step_response(PLACES, alphas, law=chosen))) > 1e-5


@pytest.mark.slow
def test_ends_symmetry_and_units():
    assert [step_response(x, 0.8) for x in (-1e6, 0.0, 1e6)] == [0.0, 0.5, 1.0]
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
    refused("alpha must be a reduced albedo", step_response, 1.0, 1.5)
    refused("x must be a finite place, got inf", step_response, np.inf, 0.5)
    refused("mfp must be a transport mean free path > 0, got 0", step_response, 1.0, 0.5, 0.0)
    hazard = {"setting": DIFFUSE, "law": profilefit.load("hazard")}
    refused("the law belongs to searchlight", step_response, 1.0, 0.5, **hazard, error=SettingError)
    refused("give a law of that setting", step_response, 1.0, 0.5, setting=Setting(n=0.9), error=SettingError)
    one_trial = shifted_points(2, 1, 1)
    refused(r"points must be \(trials >= 2", edge_estimate, by_quantile(0.5), one_trial, [0.0], 0.5, SEARCHLIGHT)


ALPHA = 0.8
A = exact.reflectance(ALPHA, edges.DIFFUSE)
EXACT = ExactLaw((ALPHA,))
SMALL = 16, 128  # pixels: enough for paths within one


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "channels"), [("importance", "longest"), ("importance blue", "mixture")])
def test_step_edge_is_the_exact_integral(stage, sidak, kind, channels):
    """With the exact profile; all columns within 4 mfp, mean over rows and seeds within its standard error."""
    stage.upload(planes.step_edge((128, 128), 1.0, A))
    runs = [stage.scatter(EXACT, 5.0, Sampling(64, kind, channels, seed=seed))[32:96, 44:84] / A for seed in range(8)]
    column = np.mean(runs, axis=1)[..., 0]  # blue noise makes rows depend on each other, not seeds
    x = (np.arange(44, 84) + 0.5 - 64) / 5.0
    error = column.std(axis=0, ddof=1) / np.sqrt(8) + 2e-4  # and what the screen cuts off, beyond 12 mfp
    z = (column.mean(axis=0) - edges.answer(x, ALPHA)) / error
    assert np.abs(z).max() < 1.6 * sidak(x.size)  # t with 7 degrees of freedom: 5.4 where a normal deviate has 3.3
    off = (column.mean(axis=0) - edges.answer(x, ALPHA - 0.1)) / error
    assert np.abs(off).max() > 2 * 1.6 * sidak(x.size)


def gathered(context, law, alpha, size, seeds, kind="importance blue"):
    """L / A within 4 mfp of the edge, (seeds, 32 rows, columns), by 64 samples, and the exact answer (columns,)."""
    mfp, middle = 5.0, size[0] // 2
    columns = slice(middle - 20, middle + 20)
    with Stage(context, size, shadow_side=16) as stage:
        stage.upload(planes.step_edge(size, 1.0, 1.0))
        runs = [stage.scatter(law, mfp, Sampling(64, kind, seed=seed), alpha) for seed in range(seeds)]
    x = (np.arange(-20, 20) + 0.5) / mfp
    rows = slice(size[1] // 2 - 16, size[1] // 2 + 16)
    return np.array(runs)[:, rows, columns, 0], edges.answer(x, alpha)


def rmse(light, truth):
    return np.sqrt(np.mean((light - truth) ** 2))


@pytest.mark.slow
@pytest.mark.parametrize(("alpha", "size", "seeds"), [(0.8, (128, 96), 8), (0.95, (512, 512), 32)])
def test_our_law_is_as_good_as_the_exact_quantile(context, alpha, size, seeds):
    """The same points: noise at most 1.1 times as large, and a bias of at most 0.3 % of A; uniform radii have more."""
    exact_light, truth = gathered(context, ExactLaw((alpha,)), alpha, size, seeds)
    hazard, other = (profilefit.load("hazard", setting=setting) for setting in (edges.DIFFUSE, Setting()))
    ours, _ = gathered(context, hazard, alpha, size, seeds)
    floor = rmse(exact_light, truth)
    assert rmse(ours, truth) < 1.1 * floor
    # Points in common take most of the noise away: what differs is the laws.
    assert np.abs(np.mean(ours - exact_light, axis=(0, 1))).max() < 0.003
    assert np.abs(np.mean(ours - truth, axis=(0, 1))).max() < 0.003
    uniform, _ = gathered(context, ExactLaw((alpha,)), alpha, size, 2, "uniform")
    assert rmse(uniform, truth) > 1.1 * floor
    searchlight, _ = gathered(context, other, alpha, size, 2)
    assert np.abs(np.mean(searchlight - exact_light[:2], axis=(0, 1))).max() > 0.003


def at_the_edge(small, mfp, kind):
    """Mean of L / A half a pixel on the dark side, over 128 rows and eight seeds, and its standard error."""
    runs = [small.scatter(EXACT, mfp, Sampling(64, kind, seed=seed), ALPHA)[:, 7, 0] for seed in range(8)]
    means = np.mean(runs, axis=1, dtype=float)
    return means.mean(), means.std(ddof=1) / np.sqrt(8)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_short_paths_gather_until_nothing_leaves_a_pixel(small, kind):
    """Right from a fifth of a pixel, where Lambert would be off by 0.02 of A, at 0.6 pixels by 0.14."""
    small.upload(planes.step_edge((16, 128), 1.0, 1.0))
    cut = 0.0025 if kind == "uniform" else 0.0  # of its radii, which end at 99.5 % of the energy; the dark half of that
    for mfp in (0.2, 0.3, 0.6):
        truth = step_response(-0.5 / mfp, ALPHA, setting=edges.DIFFUSE)
        mean, error = at_the_edge(small, mfp, kind)
        assert abs(mean - truth) < 5.4 * error + cut, mfp  # t with 7 degrees of freedom, at a chance of 1e-3
        assert truth > 0.02 > 10 * error


@pytest.mark.slow
def test_short_paths_fade_to_lambert_without_a_seam(small):
    """Between a twentieth and a tenth of a pixel, never more than 0.003 of A off."""
    edge = planes.step_edge((16, 128), 1.0, 1.0)
    small.upload(edge)
    for mfp in (0.001, 0.02, 0.05):
        np.testing.assert_array_equal(small.scatter(EXACT, mfp, Sampling(64), ALPHA), edge.irradiance)
        assert step_response(-0.5 / mfp, ALPHA, setting=edges.DIFFUSE) < 0.001
    lengths = np.linspace(0.05, 0.11, 12)
    light = np.array([at_the_edge(small, mfp, "importance")[0] for mfp in lengths])
    truth = step_response(-0.5 / lengths, ALPHA, setting=edges.DIFFUSE)
    assert np.all((light >= 0) & (np.abs(light - truth) < 0.003))
    assert np.all((np.diff(light) > 0) & (np.diff(light) < 0.006))


def bias(context, degrees, depth, area=True, seeds=4):
    """Largest mean error of the step edge over columns of 32 pixels, seeds and 256 samples, as a share of A."""
    buffers, distance = edges.aslant(ASLANT, 1.0, A, degrees, depth)
    truth = edges.answer(distance[MIDDLE] / LONG, ALPHA)
    with Stage(context, ASLANT, shadow_side=16) as stage:
        stage.upload(buffers)
        runs = [stage.scatter(EXACT, LONG, Sampling(256, area=area, seed=seed)) for seed in range(seeds)]
    return np.abs(np.mean(np.array(runs)[:, *MIDDLE, 0] / A - truth, axis=(0, 1))).max()


@pytest.mark.slow
@pytest.mark.parametrize("depth", [None, 150.0])
@pytest.mark.parametrize("degrees", [60.0, 75.0, 80.0, 85.0])
def test_a_plane_aslant_is_the_same_plane(context, alter, degrees, depth):
    """In parallel and in perspective; not where samples do not stand for their area, or not for all of it."""
    assert bias(context, degrees, depth) < BOUND
    if degrees < 80.0:
        assert bias(context, degrees, depth, area=False, seeds=1) > 2 * BOUND
    else:
        alter("LEAST_COSINE = 0.05;", "LEAST_COSINE = 0.25;")
        assert bias(context, degrees, depth, seeds=1) > 2 * BOUND

"""Over hundreds of replicates: errors cover, noise is not accused, the law's own error is what it is said to be."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats
from scipy.special import expit

from benchmarks import own_data
from mcml_sim import Grid, Layer, Medium, Setting, exact, read_mco, simulate, write_mco, write_results
from profilefit.measured.data import Measured, moderated_variances
from profilefit.measured.fitting import fitted
from profilefit.measured.identifiability import identifiability
from profilefit.measured.instrument import Gaussian, Instrument
from profilefit.measured.model import U, exact_light
from profilefit.measured.noise import origin
from profilefit.measured.problem import FitSpec
from profilefit.measured.reading import read
from profilefit.measured.result import MediumPosterior, judged, moved, posterior, ridge
from profilefit.recipes import catalogue

pytestmark = pytest.mark.slow

DATA = Path(__file__).parents[3] / "examples"
LAW = catalogue.load("hazard")
SPEC = FitSpec(LAW, {"scale": 1.0}, source=origin("hazard", "regenerated", Setting(), catalogue.fits_folder()))
ALPHA, MFP = 0.9, 1.2
R = np.geomspace(0.1, 9.0, 24)
TRUTH = {"A": LAW.albedo.reflectance(ALPHA), "alpha": ALPHA, "l": MFP, "mu_s'": ALPHA / MFP, "mu_a": (1 - ALPHA) / MFP}
REPLICATES = 300
# What the runs behind the stored files were.
HALF_SPACE = Medium((Layer(1.0, 1.0, 9.0, 0.0),)), Grid(0.01, 120, 1.0, 1), 2**21, 11
TWO_LAYERS = Medium((Layer(1.0, 5.0, 10.0, 0.0, 0.03), Layer(1.0, 0.1, 10.0, 0.0))), Grid(0.01, 150, 1.0, 1), 2**20, 12


def points(value, sigma, freedom=np.inf, r=R, pooled=np.inf) -> Measured:
    many = np.full(r.size, freedom) if np.ndim(freedom) == 0 else freedom
    return Measured("made up", "", r, r, value, sigma, many, "as given", "mm", pooled=pooled)


def band(share, count):
    """Counts of successes that binomial trials exceed on either side with a chance of 1e-3, five intervals at once."""
    tail = (1 - (1 - 1e-3) ** (1 / 5)) / 2
    return stats.binom.ppf([tail, 1 - tail], count, share)


@pytest.fixture(scope="module")
def replicates():
    """Fits to light of the law itself with 2 % noise."""
    generator, light = np.random.default_rng(5), LAW.profile(R, ALPHA, MFP)
    draws = light * (1 + 0.02 * generator.standard_normal((REPLICATES, R.size)))
    return [fitted(points(one, 0.02 * light), SPEC) for one in draws]


def covered(replicates, level, wider=1.0):
    """How many of the intervals hold the truth, by quantity."""
    out = dict.fromkeys(TRUTH, 0)
    for found in replicates:
        times = wider * stats.t.ppf(0.5 + level / 2, found.data.pooled)
        errors = found.errors(found.statistical)
        for name, truth in TRUTH.items():
            out[name] += abs(found.values[name] - truth) < times * errors[name]
    return out


@pytest.mark.parametrize("level", [0.68, 0.95])
def test_intervals_cover_and_a_third_too_narrow_do_not(replicates, level):
    low, high = band(level, REPLICATES)
    assert all(low <= count <= high for count in covered(replicates, level).values())
    assert all(count < low for count in covered(replicates, level, 2 / 3).values()), "negative control"


def test_one_layer_is_not_accused(replicates):
    alarms = sum(found.misfit.joined < 0.05 for found in replicates)
    low, high = band(0.05, REPLICATES)
    assert alarms <= high
    assert alarms >= low / 2  # the law's own error is allowed for, which makes the test milder
    assert not any(found.misfit.detected for found in replicates)


@pytest.mark.parametrize(("count", "uneven"), [(3, 0.0), (3, 1.0), (5, 0.0)])
def test_replicates_are_not_accused_and_cover(count, uneven):
    """Errors made from three or five replicates, alike in all rows or scattered by e^1 between them."""
    generator, light = np.random.default_rng(count), LAW.profile(R, ALPHA, MFP)
    found = []
    for _ in range(REPLICATES):
        size = 0.01 * np.sqrt(count) * np.exp(uneven * generator.standard_normal((R.size, 1)))
        one = moderated_variances(light[:, None] * (1 + size * generator.standard_normal((R.size, count))))
        data = points(one.value, one.sigma, one.freedom, pooled=one.pooled)
        found.append(fitted(data, SPEC))
    low, high = band(0.95, REPLICATES)
    assert all(low <= held <= high for held in covered(found, 0.95).values())
    assert sum(one.misfit.detected for one in found) <= 3
    # Negative control: the errors taken for known ones.
    known = stats.norm.ppf(0.975) / found[0].quantile / np.median([np.sqrt(one.widening) for one in found])
    if uneven:  # of equal scatter 92 % hold even so, which three hundred cannot distinguish from 95
        assert min(covered(found, 0.95, known).values()) < low


def test_the_laws_own_error_is_what_moves_a_fit():
    """Exact light without noise, of many albedos and ranges: the shift of alpha and l over the law's stated error."""
    shifts = []
    for name in ("hazard", "burley", "gaussians:4"):
        law = catalogue.load(name)
        known = origin(name, "regenerated", Setting(), catalogue.fits_folder())
        for alpha in (0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99):
            for low, high in ((0.1, 0.99), (0.5, 0.99), (0.1, 0.9)):
                r = np.geomspace(*exact.quantile([low, high], alpha), 16)
                light = np.asarray(exact.profile(r, alpha))
                found = fitted(points(light, 0.01 * light, r=r), FitSpec(law, {"scale": 1.0}, source=known))
                errors, values = found.errors(found.of_law), found.values
                shifts.append([(values["alpha"] - alpha) / errors["alpha"], (values["l"] - 1) / errors["l"]])
    spread = np.sqrt(np.mean(np.square(shifts), axis=0))
    assert np.all(spread > 0.25)
    assert np.all(spread < 1.3)


def test_errors_of_simulations_are_the_scatter_of_seeds(tmp_path):
    """Sixty runs of alpha .99, their alpha and l: rings that share photons know these better than rings apart.

    Sixty seeds know a standard deviation to 9 %: two and a half times that, over two quantities.
    """
    medium, grid = Medium((Layer(1.0, 0.1, 9.9, 0.0),)), Grid(0.02, 150, 1.0, 1)
    found = []
    for seed in range(60):
        tally = simulate(medium, grid, 2**14, seed=seed, progress=False)
        write_results(tally, tmp_path / "a.npz")
        found.append(fitted(read(tmp_path / "a.npz"), SPEC))
    assert all(one.minimum.converged for one in found)
    for name, too_wide in (("alpha", 1.5), ("l", 1.0)):
        scatter = np.std([one.values[name] for one in found], ddof=1)
        stated = np.median([one.errors(one.statistical)[name] for one in found])
        assert stated / scatter == pytest.approx(1.0, abs=0.23), name
        shared = [fitted(replace(one.data, photons=np.inf), one.spec) for one in found[:5]]
        assert np.median([one.errors(one.statistical)[name] for one in shared]) > too_wide * scatter, "negative control"


def test_the_chain_has_the_width_of_the_covariance(replicates):
    walked = posterior(replicates[0])
    assert walked.result == "converged"
    expected = np.sqrt(np.diag(replicates[0].total_covariance))[:2]
    # 4000 thinned draws of tau ten know a standard deviation to 4 %: three of these.
    np.testing.assert_allclose(walked.samples.std(axis=0), expected, rtol=0.12)


def test_a_chain_starts_where_the_data_leave_a_direction_open():
    """Rings under a beam that is taken for a pencil, scale free: by its curvature the fit is open to 1e6 along one
    direction, and the errors of the two others are lost in rounding."""
    one, edges = own_data.Medium(Setting(), 0.969137, 0.249761, 0.0031), np.arange(1.5, 10.1, 0.25)
    data = own_data.rows(one, np.random.default_rng(1), Instrument(Gaussian(0.897)), edges)
    found = fitted(data, FitSpec(exact_light(Setting()), {}))
    assert np.linalg.cond(found.jacobian) > 1e8, "whose square is more than double precision has"
    walked = posterior(found, max_steps=2000)
    spread = np.linalg.svd(np.cov(walked.samples.T))[1]
    curved = np.linalg.svd(found.jacobian)[1] ** -2.0
    assert spread[1] == pytest.approx(curved[1], rel=0.5)
    assert curved[0] < spread[2] < spread[1] < spread[0] < 1e2


def test_a_chain_walks_the_whole_of_a_bent_ridge():
    """Its shares of u between quantiles of the density summed over a grid of the three coordinates.

    The medium 312 of `benchmarks.own_data --beams`, under a beam that is known, scale free.
    """
    one, edges = own_data.Medium(Setting(), 0.715456, 0.676514, 0.00577), np.arange(2.75, 10.1, 0.25)
    seen = Instrument(Gaussian(0.64))
    data = own_data.rows(one, np.random.default_rng(10), seen, edges)
    found = fitted(data, FitSpec(exact_light(Setting()), {}, instrument=seen))
    walked, along = posterior(found), ridge(found)
    u = np.linspace(along.first[0], along.first[-1], 81)
    z = np.stack(np.meshgrid(*[np.linspace(-4.5, 4.5, 19)] * 2), axis=-1).reshape(-1, 2)
    log = []
    for first in u:
        node = moved(found, min(along.nodes, key=lambda one: abs(one.first - first)), first)
        others = node.others + z @ node.root.T
        costs = found.problem.costs(np.column_stack([np.full(len(z), first), others])) - found.minimum.cost
        log.append(np.logaddexp.reduce(-0.5 * costs) + np.sum(np.log(np.diag(node.root))))
    share = np.exp(log - np.max(log)) * expit(u) * expit(-u)
    summed = np.cumsum(share) - 0.5 * share
    levels = np.array([0.005, 0.025, 0.16, 0.5, 0.84, 0.975, 0.995])
    places = np.interp(levels, summed / share.sum(), u)
    error = np.sqrt(levels * (1 - levels) * walked.tau / (walked.steps * walked.walkers))
    assert walked.tau < 10, "in coordinates that are not straight it is 226, and the share .975 ends where .93 does"
    assert np.all(np.abs(np.mean(walked.samples[:, :1] < places, axis=0) - levels) < 4 * error)
    wide = found.point[U] + np.sqrt(found.total_covariance[U, U]) * stats.norm.ppf(levels)
    assert np.max(np.abs(np.interp(wide, u, summed / share.sum()) - levels) / error) > 20, "negative control"


def test_the_stored_runs_can_be_made_again(tmp_path):
    for (medium, grid, photons, seed), name in ((HALF_SPACE, "half_space"), (TWO_LAYERS, "two_layers")):
        tally = simulate(medium, grid, photons, seed=seed, progress=False)
        write_mco(tally, tmp_path / "a.mco")
        made, stored = read_mco(tmp_path / "a.mco"), read_mco(DATA / f"{name}.mco")
        assert made.run.medium == stored.run.medium
        # Another CPU draws the same photons but for rounding: within five standard errors, whichever they are.
        error = np.sqrt(stored.reflectance_r / (stored.run.grid.r_areas * photons))
        assert np.all(np.abs(made.reflectance_r - stored.reflectance_r) <= 5 * np.sqrt(2) * error + 1e-12)


def test_simulated_tissue_and_what_similarity_costs(tmp_path):
    """n = 1.4, mu_a .2 and mu_s' 10 per cm: with g = 0 they come back, with g = .9 they do not.

    The light of g = .9 is .4 times that of g = 0 next to the beam, 1.19 times at two to three reduced mean free paths,
    and the same beyond ten.
    """
    found = {}
    for g, seed in ((0.0, 14), (0.9, 13)):
        medium = Medium((Layer(1.4, 0.2, 10.0 / (1 - g), g),))
        tally = simulate(medium, Grid(0.01, 150, 1.0, 1), 2**19, seed=seed, progress=False)
        write_results(tally, tmp_path / "a.npz")
        data, spec = read(tmp_path / "a.npz"), FitSpec(exact_light(Setting(n=1.4)), {"scale": 1.0})
        for least in (None, 0.2):
            found[g, least] = fitted(data.within(least, None), spec)
    straight = found[0.0, None]
    errors = straight.errors(straight.statistical)
    assert abs(straight.values["mu_a"] - 0.2) < 3 * errors["mu_a"]
    assert abs(straight.values["mu_s'"] - 10.0) < 3 * errors["mu_s'"]
    assert not straight.misfit.detected
    whole, far = found[0.9, None], found[0.9, 0.2]
    assert whole.misfit.detected
    allowed = whole.errors(whole.total_covariance)
    assert abs(whole.values["mu_a"] - 0.2) < 2 * allowed["mu_a"], "by errors with the lack of fit"
    assert abs(whole.values["mu_s'"] - 10.0) < 2 * allowed["mu_s'"]
    assert whole.plain.values["mu_a"] == pytest.approx(0.187, rel=0.03)
    assert whole.plain.values["mu_s'"] == pytest.approx(9.55, rel=0.03)
    assert far.misfit.detected
    assert far.misfit.relative < 0.02, "which a law of larger error would not see"
    assert far.plain.values["mu_a"] == pytest.approx(0.134, rel=0.05)
    assert far.plain.values["mu_s'"] == pytest.approx(12.9, rel=0.05)


def test_a_white_medium_has_an_upper_limit_of_absorption():
    """No absorption at all: in half of the replicates alpha runs to 1, and mu_a has an upper limit and no value."""
    light = np.asarray(exact.profile(R, 1.0, MFP)) * (1 + 0.02 * np.random.default_rng(3).standard_normal(R.size))
    for part in (light, 1.03 * light):
        result = judged(fitted(points(part, 0.02 * light), SPEC))
        assert result.walk is not None
        low, high = result.interval("mu_a")
        assert low is None
        assert 0 < high < 2e-3, "per mm: a five-hundredth of mu_s'"
    assert result.fit.at_edge
    assert result.identified == ()
    assert [result.value(name) for name in ("A", "alpha", "mu_a")] == [None] * 3
    assert result.value("l") == pytest.approx(MFP, rel=0.05)


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("alpha", [0.9998, 0.9995])
def test_limits_at_the_white_end_cover(alpha):
    """As little absorption as 2 % noise tells from none in few and in most of the replicates.

    Limits are quantiles of a posterior that ends at alpha = 1, so they hold in 95 % or more. What a row states, a limit
    or an interval by what the data exclude, holds in 92.5 % at the worst: such a choice costs half of what an interval
    leaves out on one side.
    """
    light, count = LAW.profile(R, alpha, MFP), 40
    generator, held, stated, too_low = np.random.default_rng(11), 0, 0, 0
    for _ in range(count):
        value = light * (1 + 0.02 * generator.standard_normal(R.size))
        found = fitted(points(value, 0.02 * light), FitSpec(LAW, {"scale": 1.0}))
        result = MediumPosterior(found, identifiability(found), None, posterior(found, max_steps=1000))
        truth, limit = (1 - alpha) / MFP, np.quantile(result.draws["mu_a"], 0.95)
        held += truth <= limit
        too_low += truth > limit / 4
        low, high = result.interval("mu_a")
        stated += (low or 0.0) <= truth <= high
        at_end = result.ends("mu_a")[0]
        assert (low is None) == at_end
        assert (result.value("mu_a") is None) == at_end
        if at_end:
            assert high == pytest.approx(limit)
    tail = 1e-3 / 2  # two albedos
    assert held >= stats.binom.ppf(tail, count, 0.95)
    assert stated >= stats.binom.ppf(tail, count, 0.925)
    assert count - too_low < stats.binom.ppf(tail, count, 0.95), "negative control"

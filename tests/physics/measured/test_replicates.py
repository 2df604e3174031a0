"""Errors from three replicates, on data of known variance. Misfit: chances are uniform where there is none, and a wave
that is there is found and sized.
"""

import numpy as np
import pytest
from scipy import stats

from profilefit.fitting.misfit import DETECTED, gaussianised, lack_of_fit, likelihood, misfit, scatter_chance, waves
from profilefit.measured.data import moderated_variances, trend_freedom, widening
from profilefit.measured.noise import WAVE

ROWS, COUNT = 40, 3


def draws(spread, sets=400, seed=0):
    """(sets, rows, replicates) of light that falls over four decades, with 5 % gain noise scattered between rows."""
    generator = np.random.default_rng(seed)
    mean = np.geomspace(1.0, 1e-4, ROWS)
    sigma = 0.05 * mean * np.exp(spread * generator.standard_normal((sets, ROWS)))
    return mean, sigma, mean[:, None] + sigma[..., None] * generator.standard_normal((sets, ROWS, COUNT))


def held(rows, count, spread, sets, widened=True, seed=0):
    """How many of `sets` intervals of 95 % hold each of two coordinates, of a line through rows of known truth."""
    generator, light = np.random.default_rng(seed), np.geomspace(1.0, 1e-2, rows)
    line = light[:, None] * np.stack([np.ones(rows), np.linspace(-1, 1, rows)], axis=1)
    inside = np.zeros(2, int)
    for _ in range(sets):
        sigma = 0.02 * light * np.exp(spread * generator.standard_normal(rows))
        found = moderated_variances(light[:, None] + sigma[:, None] * generator.standard_normal((rows, count)))
        gain = np.linalg.pinv(line / found.sigma[:, None])
        error = np.sqrt(np.sum(gain**2, axis=1) * (widening(found.freedom, 2) if widened else 1.0))
        times = stats.t.ppf(0.975, found.pooled if widened else np.inf)
        inside += np.abs(gain @ ((found.value - light) / found.sigma)) < times * error
    return inside


@pytest.mark.parametrize("spread", [0.0, 1.0])
def test_intervals_from_three_replicates_cover(spread):
    # Counts that intervals of exactly 95 % exceed on either side with a chance of 1e-3, both coordinates at once.
    tail = (1 - (1 - 1e-3) ** (1 / 2)) / 2
    low, high = stats.binom.ppf([tail, 1 - tail], 300, 0.95)
    counts = held(24, 3, spread, 300)
    assert np.all((low <= counts) & (counts <= high))
    if spread == 1.0:  # negative control: the same rows without Meier's factor and Student's quantile
        assert np.all(held(24, 3, spread, 300, widened=False) < low)


@pytest.mark.slow
@pytest.mark.parametrize("spread", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("count", [3, 5, 10])
@pytest.mark.parametrize("rows", [8, 16, 40])
def test_intervals_cover_for_few_and_many(rows, count, spread):
    """1500 sets each: never below 93 %, and above 97.5 % only where ten uneven ones know their own scatter."""
    share = held(rows, count, spread, 1500) / 1500
    assert np.all(share > 0.925)
    assert np.all(share < (0.99 if count == 10 and spread else 0.98))


def test_the_freedom_of_a_trend_is_what_it_rests_on():
    """Of three replicates .61 (k - 1) (rows - 2), and many normal variances really scatter so."""
    assert trend_freedom(24, 2.0) == pytest.approx(0.61 * 2 * 22, rel=0.01)
    levels = np.log(np.random.default_rng(2).chisquare(2.0, (4000, 22))).mean(axis=1)
    # The standard error of a variance from 4000 is 2.2 %, three of these.
    assert 2 / np.var(levels) == pytest.approx(trend_freedom(24, 2.0), rel=0.07)
    found = moderated_variances(draws(0.0, sets=1)[2][0])
    assert found.pooled == trend_freedom(ROWS, 2.0)
    assert found.freedom.max() <= found.pooled + 2
    assert widening(np.full(9, np.inf), 3) == 1.0


def test_a_likelihood_of_an_estimated_scale_is_students():
    x = np.linspace(0, 6, 7)
    expected = stats.t.logpdf(x, 5.0) - stats.t.logpdf(0.0, 5.0)
    np.testing.assert_allclose(likelihood(x**2, 1, 5.0), expected, atol=1e-12)
    np.testing.assert_allclose(likelihood(x**2, 2, np.inf), -0.5 * x**2)


@pytest.mark.parametrize("spread", [0.0, 0.5])
def test_chi_square_has_its_chance(spread):
    """Of true means over moderated errors, 400 sums over 40 rows: one in twenty has a chance below 5 %."""
    mean, _, samples = draws(spread)
    below, too_sure = 0, 0
    for one in samples:
        found = moderated_variances(one)
        residuals = gaussianised((found.value - mean) / found.sigma, found.freedom, found.pooled)
        below += scatter_chance(residuals @ residuals, ROWS, found.pooled) < 0.05
        too_sure += scatter_chance(residuals @ residuals, ROWS, np.inf) < 0.05
    low, high = stats.binom.ppf([5e-4, 1 - 5e-4], len(samples), 0.05)
    assert low / 4 <= below <= high  # the trend's freedom counts for all rows, also where they go their own ways
    assert too_sure > high, "negative control: chi-square with an estimated scale"


def test_students_tails_are_normal_ones_of_equal_chance_however_far_out():
    normal = gaussianised(np.array([-3.0, 2.0, 1e3]), np.array([2.0, 3.0, 4.0]))
    chance = stats.t.sf([3.0, 2.0, 1e3], [2.0, 3.0, 4.0])
    np.testing.assert_allclose(normal, [-1, 1, 1] * stats.norm.isf(chance), rtol=1e-9)
    hopeless = np.array([-50.0, 1e4])
    np.testing.assert_array_equal(gaussianised(hopeless, np.array([1e6, np.inf])), hopeless)


def test_raw_scatter_of_three_is_no_error():
    """Negative control: taken for normal, each row's own scatter makes chi-square diverge."""
    mean, _, samples = draws(0.0)
    value, error = samples.mean(axis=2), samples.std(axis=2, ddof=1) / np.sqrt(COUNT)
    sums = np.sum(((value - mean) / error) ** 2, axis=1)
    assert np.mean(sums > stats.chi2.ppf(0.95, ROWS)) > 0.9


def test_equal_variances_are_pooled_and_unequal_ones_are_not():
    freedom = {}
    for spread in (0.0, 1.5):
        _, sigma, samples = draws(spread, sets=50)
        found = [moderated_variances(one) for one in samples]
        freedom[spread] = np.median([one.freedom.max() for one in found])
        if spread == 0.0:
            ratio = np.stack([one.sigma for one in found]) * np.sqrt(COUNT) / sigma
            # Pooled over 40 rows an error is known to 8 %, its own scatter alone would leave 50 %.
            assert np.sqrt(np.mean((ratio - 1) ** 2)) < 0.25
    assert freedom[0.0] > 20
    assert freedom[1.5] < 5


def test_rows_that_never_differ_keep_their_own():
    found = moderated_variances(np.array([[1.0, 1.0, 1.0], [2.0, 2.0, 2.0], [3.0, 3.0, 3.1]]))
    np.testing.assert_allclose(found.value, [1, 2, 3.0333333])
    assert found.sigma[0] == 0
    np.testing.assert_array_equal(found.freedom, 2)


ANNULI, SETS = 24, 120
R = np.geomspace(0.1, 10.0, ANNULI)
JACOBIAN = np.column_stack([np.ones(ANNULI), np.log(R)]) * 50.0
SHAPE = waves(R, WAVE) * 50.0**2  # a relative error where sigma is 2 %
NONE = np.zeros((ANNULI, ANNULI))


def left(noise):
    """What fits of two coordinates leave of these errors (sets, rows), in standard errors."""
    return noise - noise @ np.linalg.pinv(JACOBIAN).T @ JACOBIAN.T


def judged(noise, law=NONE):
    return [misfit(one, JACOBIAN, law, SHAPE, ANNULI) for one in left(noise)]


@pytest.fixture(scope="module")
def noise():
    return np.random.default_rng(0).standard_normal((SETS, ANNULI))


@pytest.fixture(scope="module")
def null(noise):
    return judged(noise)


@pytest.mark.parametrize("name", ["chance", "scatter", "waves"])
def test_chances_of_noise_are_uniform(null, name):
    assert stats.kstest([getattr(one, name) for one in null], "uniform").pvalue > 1e-3
    assert not any(one.detected for one in null)


def test_noise_has_the_runs_it_should(null):
    assert np.mean([one.runs[0] for one in null]) == pytest.approx(null[0].runs[1], abs=1.0)  # fitting adds some
    assert null[0].freedom == ANNULI - 2
    assert np.median([one.relative for one in null]) < 0.01


def test_a_wave_is_found_and_sized(noise):
    """Three times sigma at its crest, as a layer underneath would leave: 6 % of the light, 4.2 % on average."""
    found = judged(noise[:40] + 3.0 * np.sin(2.0 * np.log(R)))
    assert np.mean([one.detected for one in found]) > 0.95
    assert np.mean([one.along_r for one in found]) > 0.3
    assert np.median([one.relative for one in found]) == pytest.approx(0.042, rel=0.25)


def test_a_wave_too_small_for_chi_square_is_found_by_its_waves(noise):
    found = judged(noise[:60] + 0.9 * np.sin(2.0 * np.log(R)))
    by_waves, by_scatter = (np.mean([getattr(one, name) < 0.01 for one in found]) for name in ("waves", "scatter"))
    assert by_waves > by_scatter + 0.25


def test_what_the_law_itself_may_leave_is_no_misfit(noise):
    """Errors drawn from the law's own: chi-square alone accuses, the joint chance does not."""
    law = 0.06**2 * SHAPE
    root = np.linalg.cholesky(law + 1e-6 * np.eye(ANNULI))
    found = judged(noise[:40] + np.random.default_rng(1).standard_normal((40, ANNULI)) @ root.T, law)
    assert np.mean([one.chance < DETECTED for one in found]) > 0.5
    assert not any(one.detected for one in found)
    assert any(one.within_law for one in found)


def test_a_lack_of_fit_is_likelier_than_none_where_there_is_one(noise):
    """Of noise alone the ratio of likelihoods exceeds k in 1 / k of the sets at most, as its mean there is 1."""

    def estimates(rows):
        return [lack_of_fit(one, JACOBIAN, NONE, SHAPE[None]) for one in left(rows)]

    ratios = np.exp([likelier for _, likelier in estimates(noise)])
    assert np.mean(ratios > 10.0) < 0.1 + 3.0 * np.sqrt(0.1 * 0.9 / SETS)
    assert np.median(ratios) < 1.0
    waved = estimates(noise[:40] + 3.0 * np.sin(2.0 * np.log(R)))
    assert np.median([likelier for _, likelier in waved]) > np.log(1e6)
    assert np.sqrt(np.median([variances[0] for variances, _ in waved])) == pytest.approx(0.042, rel=0.5)

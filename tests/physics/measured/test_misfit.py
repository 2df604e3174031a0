"""Misfit: chances are uniform where there is none, and a wave that is there is found and sized."""

import numpy as np
import pytest
from scipy import stats

from profilefit.fitting.misfit import DETECTED, lack_of_fit, misfit, waves
from profilefit.measured.noise import WAVE

ROWS, SETS = 24, 120
R = np.geomspace(0.1, 10.0, ROWS)
JACOBIAN = np.column_stack([np.ones(ROWS), np.log(R)]) * 50.0
SHAPE = waves(R, WAVE) * 50.0**2  # a relative error where sigma is 2 %
NONE = np.zeros((ROWS, ROWS))


def judged(noise, law=NONE):
    """Fits of two coordinates to these errors (sets, rows), in standard errors."""
    residuals = noise - noise @ np.linalg.pinv(JACOBIAN).T @ JACOBIAN.T
    return [misfit(one, JACOBIAN, law, SHAPE, ROWS) for one in residuals]


@pytest.fixture(scope="module")
def noise():
    return np.random.default_rng(0).standard_normal((SETS, ROWS))


@pytest.fixture(scope="module")
def null(noise):
    return judged(noise)


@pytest.mark.parametrize("name", ["chance", "scatter", "waves"])
def test_chances_of_noise_are_uniform(null, name):
    chances = [getattr(one, name) for one in null]
    assert stats.kstest(chances, "uniform").pvalue > 1e-3
    assert not any(one.detected for one in null)


def test_noise_has_the_runs_it_should(null):
    assert np.mean([one.runs[0] for one in null]) == pytest.approx(null[0].runs[1], abs=1.0)  # fitting adds some
    assert null[0].freedom == ROWS - 2
    assert np.median([one.relative for one in null]) < 0.01


def test_a_wave_is_found_and_sized(noise):
    """Three times sigma at its crest, as a layer underneath would leave: 6 % of the light, 4.2 % on average."""
    found = judged(noise[:40] + 3.0 * np.sin(2.0 * np.log(R)))
    assert np.mean([one.detected for one in found]) > 0.95
    assert np.mean([one.along_r for one in found]) > 0.3
    assert np.median([one.relative for one in found]) == pytest.approx(0.042, rel=0.25)


def test_a_wave_too_small_for_chi_square_is_found_by_its_waves(noise):
    found = judged(noise[:60] + 0.9 * np.sin(2.0 * np.log(R)))
    by_waves = np.mean([one.waves < 0.01 for one in found])
    by_scatter = np.mean([one.scatter < 0.01 for one in found])
    assert by_waves > by_scatter + 0.25


def test_what_the_law_itself_may_leave_is_no_misfit(noise):
    """Errors drawn from the law's own: chi-square alone accuses, the joint chance does not."""
    law = 0.06**2 * SHAPE
    drawn = (
        noise[:40]
        + np.random.default_rng(1).standard_normal((40, ROWS)) @ np.linalg.cholesky(law + 1e-6 * np.eye(ROWS)).T
    )
    found = judged(drawn, law)
    assert np.mean([one.chance < DETECTED for one in found]) > 0.5
    assert not any(one.detected for one in found)
    assert any(one.within_law for one in found)


def test_a_lack_of_fit_is_likelier_than_none_where_there_is_one(noise):
    """Of noise alone the ratio of likelihoods exceeds k in 1 / k of the sets at most, as its mean there is 1."""

    def estimates(rows):
        residuals = rows - rows @ np.linalg.pinv(JACOBIAN).T @ JACOBIAN.T
        return [lack_of_fit(one, JACOBIAN, NONE, SHAPE[None]) for one in residuals]

    ratios = np.exp([likelier for _, likelier in estimates(noise)])
    assert np.mean(ratios > 10.0) < 0.1 + 3.0 * np.sqrt(0.1 * 0.9 / SETS)
    assert np.median(ratios) < 1.0
    waved = estimates(noise[:40] + 3.0 * np.sin(2.0 * np.log(R)))
    assert np.median([likelier for _, likelier in waved]) > np.log(1e6)
    assert np.sqrt(np.median([variances[0] for variances, _ in waved])) == pytest.approx(0.042, rel=0.5)

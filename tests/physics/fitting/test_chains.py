"""Chains on a problem whose posterior is known in closed form."""

import mmap
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mcml_sim import Setting
from mcml_sim.runs.input_runs import Compiling
from profilefit.errors import InputError
from profilefit.fitting.chains import curvature_adjustment, posterior
from profilefit.fitting.estimate import fit
from tests.fixtures import Line, refused, whitened
from tests.physics.fitting.test_estimate import line_profiles

pytestmark = pytest.mark.slow

# A chain of 50 autocorrelation times and 32 walkers holds 1600 independent points, thinned to 1000; 500 to be safe.
INDEPENDENT = 500


def fitted_line(seed, law, free=None):
    """A fit to twelve noisy points whose photon noise is correlated, and nothing like their misfit."""
    rng = np.random.default_rng(seed)
    alpha = np.linspace(0.1, 0.9, 12)
    reflectance = 0.2 + 0.6 * alpha + 0.02 * rng.standard_normal(12)
    factor = 0.01 * rng.standard_normal((1, 12, 12)) * np.linspace(0.2, 2.0, 12)[:, None]
    return fit(line_profiles(reflectance, alpha, factor), law, "reflectance", free=free)


@pytest.fixture(scope="module")
def line_fit():
    return fitted_line(8, Line(Setting()))


def test_one_constant_has_a_chain_too():
    one = fitted_line(8, Line(Setting()), free=("u",))
    found = posterior(one, "misfit")
    assert found.result == "converged"
    assert np.std(found.samples) == pytest.approx(np.sqrt(one.misfit[0, 0]), rel=0.1)


@pytest.mark.parametrize("kind", ["statistical", "misfit"])
def test_chains_have_the_analytic_covariance(line_fit, kind, sidak):
    found = posterior(line_fit, kind, seed=1, max_steps=4000)
    expected = getattr(line_fit, kind)
    assert found.result == "converged"
    assert found.steps >= 50 * found.tau
    assert (found.kind, found.names) == (kind, ("u", "v"))
    assert np.abs(whitened(found.samples, expected, INDEPENDENT)).max() < sidak(3)
    z = (found.samples.mean(axis=0) - line_fit.solution.parameters) / np.sqrt(np.diag(expected) / INDEPENDENT)
    assert np.abs(z).max() < sidak(2)
    # Negative control: the other kind's covariance is not this one.
    other = line_fit.misfit if kind == "statistical" else line_fit.statistical
    assert np.abs(whitened(found.samples, other, INDEPENDENT)).max() > 3 * sidak(3)
    assert np.abs(whitened(found.samples, 2 * expected, INDEPENDENT)).max() > 1.5 * sidak(3)


def test_intervals_and_deviations_are_those_of_a_normal(line_fit):
    found = posterior(line_fit, "statistical", seed=2, max_steps=4000)
    sigma = np.sqrt(np.diag(line_fit.statistical))
    # The deviation of 500 independent draws is known to 1 / sqrt(1000) = 3 %, a 16 % quantile to 5 %; 4 of each.
    np.testing.assert_allclose(found.standard_deviation, sigma, rtol=0.13)
    inner, outer = found.interval(0.68), found.interval(0.95)
    np.testing.assert_allclose(np.diff(inner, axis=1)[:, 0], 2 * 0.9945 * sigma, rtol=0.2)
    assert np.all(outer[:, 0] < inner[:, 0])
    assert np.all(inner[:, 1] < outer[:, 1])
    assert np.all((inner[:, 0] < line_fit.solution.parameters) & (line_fit.solution.parameters < inner[:, 1]))
    assert (found.walkers, found.samples.shape[1]) == (32, 2)
    assert len(found.samples) <= 1000
    assert 0.1 < found.acceptance < 0.9


def test_curvature_adjustment_is_the_identity_it_claims():
    """C^T (J^T J) C / s^2 = V^-1 with det C = 1, for constants of very different size."""
    rng = np.random.default_rng(9)
    for size in (1, 3, 8):
        scale = 10.0 ** rng.uniform(-4, 2, size)
        jacobian = rng.standard_normal((40, size)) / scale
        root = rng.standard_normal((size, size)) * scale[:, None]
        covariance = root @ root.T
        adjust, variance = curvature_adjustment(jacobian.T @ jacobian, covariance)
        identity = adjust.T @ jacobian.T @ jacobian @ adjust / variance @ covariance
        # In scaled constants, where rounding is alike everywhere.
        np.testing.assert_allclose(identity * scale[:, None] / scale, np.eye(size), atol=1e-6)
        assert np.linalg.slogdet(adjust)[1] == pytest.approx(0.0, abs=1e-9)


def test_other_fits_of_a_law_compile_nothing(line_fit):
    """Other data, constants and covariances of one shape: a program for each fit would fill the memory."""
    for kind in ("statistical", "misfit"):
        posterior(line_fit, kind, max_steps=100)
    with Compiling() as again:
        other = fitted_line(9, Line(Setting(), 0.25, 0.55))
        for kind in ("statistical", "misfit"):
            posterior(other, kind, seed=5, max_steps=100)
    assert again.seconds == 0.0
    assert other.constants != line_fit.constants


@pytest.mark.timeout(1800)
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_five_hundred_posteriors_fit_into_a_process(tallies, toy):
    """Each took 5 MB and 156 memory maps, of which Linux gives a process 65530: Python aborted after some hundreds."""
    used = []
    for seed, counts in enumerate(tallies.draw(24, 500)):
        posterior(fit(tallies.profiles(counts), toy, "energy", jackknife=False), seed=seed, max_steps=100)
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        used.append((pages * mmap.PAGESIZE, len(Path("/proc/self/maps").read_text().splitlines())))
    memory, maps = np.subtract(used[-1], used[0])
    assert memory < 500e6
    assert maps < 1000


def test_draws_go_to_arviz_and_back(line_fit):
    """A walker a chain, the log density beside it, and the fit's name on it."""
    pytest.importorskip("arviz_base")
    found = posterior(line_fit, "statistical", seed=2, max_steps=1000)
    tree = found.to_arviz()
    draws = tree["posterior"]
    assert dict(draws.sizes) == {"chain": 32, "draw": 31}
    np.testing.assert_array_equal(draws["u"].values.T.ravel(), found.samples[:, 0])
    np.testing.assert_allclose(draws["v"].mean(), found.samples[:, 1].mean(), rtol=1e-12)
    np.testing.assert_array_equal(tree["sample_stats"]["lp"].values.T.ravel(), found.log_density)
    assert {tree.attrs[key] for key in ("law", "objective", "kind")} == {"Line", "reflectance", "statistical"}
    assert tree.attrs["result"] == "converged"
    # The density is that of the draws: highest where they are nearest to the optimum.
    off = found.samples - line_fit.solution.parameters
    expected = -0.5 * np.sum(off @ np.linalg.inv(line_fit.statistical) * off, axis=1)
    np.testing.assert_allclose(found.log_density, expected, rtol=1e-6, atol=1e-8)


def test_misuse_is_named(line_fit, tallies, liang):
    refused("'misfit', got 'discrepancy', which is called 'misfit' now", posterior, line_fit, "discrepancy")
    refused("kind must be 'statistical' or 'misfit', got 'both'", posterior, line_fit, "both")
    with pytest.raises(InputError, match=r"no photon noise: only kind='misfit' applies, got 'statistical'"):
        posterior(replace(line_fit, statistical=None))
    one = fit(tallies.profiles(tallies.draw(0, 1)[0]), liang, "energy", free=("a1", "g1"))
    refused("a posterior needs a fit that converged, got: degenerate", posterior, one)


def test_photon_noise_of_a_law_that_is_not_the_truth(tallies, burley):
    """The chain has the sandwich's width although residuals are large and curved: there J^T J is not the curvature."""
    one = fit(tallies.profiles(tallies.draw(0, 1)[0]), burley, "energy", ("s0", "s1", "s2"))
    chain = posterior(one, "statistical", seed=4)
    assert chain.result == "converged"
    expected = np.sqrt(np.diag(one.statistical))
    # 1000 thinned draws know a standard deviation to 1/sqrt(2000) = 2.2 %: four of these, and 2 % of curvature.
    np.testing.assert_allclose(chain.standard_deviation / expected, 1.0, atol=0.11)
    # A negative control: with J^T J for the curvature the width is wrong by more than that.
    jacobian = one.solution.jacobian
    short, variance = curvature_adjustment(jacobian.T @ jacobian, one.statistical)
    full, _ = one.second_derivatives
    width = np.sqrt(np.diag(np.linalg.inv(short.T @ full @ short / variance)))
    assert np.max(np.abs(width / expected - 1.0)) > 0.02

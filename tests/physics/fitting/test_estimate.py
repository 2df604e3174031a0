"""Constants and their errors, against the scatter of synthetic photons and against linear algebra."""

from dataclasses import replace

import equinox as eqx
import jax
import numpy as np
import pytest
from scipy.stats import chi2

from mcml_sim import Grid, Setting, SettingError, simulate_orders
from profilefit.fitting import estimate, solver
from profilefit.fitting.estimate import ResidualFunction, fit, followed, residual_structure
from profilefit.fitting.profiles import Covariance, Profiles
from profilefit.fitting.solver import least_squares, solve_batch
from profilefit.laws.printed_maps import LiangAlbedo
from tests.fixtures import Line, refused, whitened

REPLICATES = 200


def refits(tallies, law, free, seed=5):
    """Constants (replicates, p) fitted to photons drawn anew each time."""
    energy = tallies.energy(tallies.draw(seed, REPLICATES))
    start = fit(tallies.profiles(tallies.draw(0, 1)[0]), law, free=free)
    data = jax.tree.map(lambda leaf: np.broadcast_to(leaf, (REPLICATES, *np.shape(leaf))), (law, start.rings))
    data = eqx.tree_at(lambda tree: tree[1].energy, data, energy)
    starts = np.tile(start.solution.parameters, (REPLICATES, 1))
    found = solve_batch(ResidualFunction("energy", start.free), starts, data)
    assert all(one.converged for one in found)
    return start, np.stack([one.parameters for one in found])


def spread(values, covariance):
    """Probability that a scatter at least as far from the covariance as this one is chance: chi^2, either side."""
    off = values - values.mean(axis=0)
    statistic = np.sum(off @ np.linalg.inv(covariance) * off)
    freedom = (len(values) - 1) * values.shape[1]
    return 2 * min(chi2.cdf(statistic, freedom), chi2.sf(statistic, freedom))


# Photon noise


@pytest.mark.slow
def test_constants_of_the_true_law_and_of_another_scatter_as_predicted(tallies, toy, sidak, burley):
    """200 refits of the true law. Halved or doubled covariances have probabilities below 1e-12."""
    one, scattered = refits(tallies, toy, None)
    assert one.free == ("k", "h", "q")
    assert spread(scattered, one.statistical) > 1e-3
    assert np.abs(whitened(scattered, one.statistical, REPLICATES - 1)).max() < sidak(6)
    # A fit of the truth has no bias: 4 standard errors of the mean of 200, for three constants.
    z = (scattered.mean(axis=0) - [1.0, 0.5, 0.5]) / np.sqrt(np.diag(one.statistical) / REPLICATES)
    assert np.abs(z).max() < 4
    for wrong in (0.5, 2.0):
        assert spread(scattered, wrong * one.statistical) < 1e-12
    # Normalized diffusion misses these photons by a tenth, and only the sandwich knows how it scatters.
    one, scattered = refits(tallies, burley, ("s0", "s1", "s2"))
    assert one.structure.rms > 0.02
    assert spread(scattered, one.statistical) > 1e-3
    assert np.abs(whitened(scattered, one.statistical, REPLICATES - 1)).max() < sidak(6)
    # The misfit taken for noise is another question, and no answer to this one.
    assert spread(scattered, one.misfit) < 1e-20


@pytest.mark.slow
def test_sensitivity_is_that_of_refitting(tallies, burley):
    """d constants / d ring energy, by moving single energies of a law that does not fit."""
    profiles = tallies.profiles(tallies.draw(0, 1)[0])
    free = ("s0", "s1", "s2")
    one = fit(profiles, burley, "energy", free)
    problem = ResidualFunction("energy", free)
    found = followed(*one.second_derivatives)
    assert found.shape == (3, 5, profiles.energy.shape[1] + 1)  # and the light beyond the last ring
    for a, i in ((0, 0), (2, 5), (4, 9)):
        ends = []
        for sign in (-1, 1):
            energy = profiles.energy.copy()
            energy[a, i] *= 1 + sign * 1e-3
            rings = eqx.tree_at(lambda r: r.energy, one.rings, energy)
            ends.append(least_squares(problem, one.solution.parameters, (burley, rings)).parameters)
        slope = (ends[1] - ends[0]) / (2e-3 * profiles.energy[a, i])
        # Second order in the step: 1e-6; LM's tolerance of 1e-10 over the step of 1e-3: 1e-7 of the constants.
        np.testing.assert_allclose(found[:, a, i], slope, rtol=1e-3, atol=1e-4 * np.abs(found).max())
    # Negative control: Gauss and Newton's (J^T J)^-1 in place of the full Hessian.
    with jax.enable_x64(True):
        cost = lambda theta: 0.5 * problem.cost(theta, (burley, one.rings))  # noqa: E731
        hessian = np.asarray(jax.hessian(cost)(jax.numpy.asarray(one.solution.parameters)))
    short = np.einsum("pq,qai->pai", np.linalg.inv(one.solution.jacobian.T @ one.solution.jacobian) @ hessian, found)
    assert np.max(np.abs(short - found)) > 1e-2 * np.max(np.abs(found))


def line_profiles(reflectance, alpha, factor=None, photons=1000):
    """One ring that holds all."""
    energy = np.asarray(reflectance, float)[:, None]
    covariance = None if factor is None else Covariance(factor, energy, photons, 0.0)
    noise, rest = (0 * energy, np.full_like(energy, np.inf)), np.zeros(alpha.size)
    return Profiles(alpha, np.array([0.0, 1.0]), energy, *noise, rest, "test", Setting(), photons, covariance)


@pytest.fixture
def line():
    """Twelve points about a line, and their design matrix."""
    alpha = np.linspace(0.1, 0.9, 12)
    reflectance = 0.2 + 0.6 * alpha + 0.02 * np.random.default_rng(4).standard_normal(12)
    return alpha, reflectance, np.stack([np.ones(12), alpha], axis=1)


def test_a_linear_fit_is_linear_algebra_of_the_albedos_that_count(line):
    alpha, reflectance, design = line
    factor = 0.01 * np.random.default_rng(5).standard_normal((1, 12, 12))
    one = fit(line_profiles(reflectance, alpha, factor), Line(Setting()), "reflectance")
    gain = np.linalg.pinv(design)
    np.testing.assert_allclose(list(one.constants.values()), gain @ reflectance, rtol=1e-8)
    assert one.law.constants() == one.constants
    # One ring: what is between rings does not enter.
    np.testing.assert_allclose(one.statistical, gain @ factor[0] @ factor[0].T @ gain.T, rtol=1e-8)
    misfit = reflectance - design @ gain @ reflectance
    np.testing.assert_allclose(one.variance, misfit @ misfit / 10, rtol=1e-8)
    np.testing.assert_allclose(one.misfit, one.variance * np.linalg.inv(design.T @ design), rtol=1e-7)
    assert one.result == "converged"
    counted = np.arange(12) % 3 > 0
    spoilt = np.where(counted, reflectance, 0.9)
    one = fit(line_profiles(spoilt, alpha), Line(Setting()), "reflectance", counted=counted)
    expected = np.linalg.lstsq(design[counted], reflectance[counted])[0]
    np.testing.assert_allclose(list(one.constants.values()), expected, rtol=1e-8)
    misfit = reflectance[counted] - design[counted] @ expected
    np.testing.assert_allclose(one.variance, misfit @ misfit / (8 - 2), rtol=1e-8)


def test_the_jackknife_by_hand(line, monkeypatch):
    """Six groups of two neighbours left out in turn: sqrt(5/6 sum (theta_g - mean)^2)."""
    alpha, reflectance, design = line
    soon = fit(line_profiles(reflectance, alpha), Line(Setting()), "reflectance")
    monkeypatch.setattr(estimate, "JACKKNIFE_WORTH", solver.ROUNDING)
    one = fit(line_profiles(reflectance, alpha), Line(Setting()), "reflectance")
    left = []
    for group in range(6):
        keep = np.setdiff1d(np.arange(12), [2 * group, 2 * group + 1])
        left.append(np.linalg.lstsq(design[keep], reflectance[keep])[0])
    expected = np.sqrt(5 / 6 * np.sum((np.array(left) - np.mean(left, axis=0)) ** 2, axis=0))
    np.testing.assert_allclose(one.jackknife, expected, rtol=1e-6)
    np.testing.assert_allclose(soon.jackknife, expected, rtol=1e-3)
    assert one.statistical is None


@pytest.mark.slow
def test_a_held_constant_stays_and_the_jackknife_sees_misfit_that_repeats_itself(line):
    alpha, reflectance, _ = line
    one = fit(line_profiles(reflectance, alpha), Line(Setting(), u=0.25), "reflectance", free=("v",))
    assert (one.free, one.law.u) == (("v",), 0.25)
    assert one.law.v == pytest.approx(alpha @ (reflectance - 0.25) / (alpha @ alpha), rel=1e-8)
    assert one.statistical is None
    # Points on a parabola: their neighbours agree, so independent noise promises too much.
    many = np.linspace(0.1, 0.9, 60)
    one = fit(line_profiles(0.2 + 0.5 * many**2, many), Line(Setting()), "reflectance")
    assert np.all(one.jackknife > 2 * np.sqrt(np.diag(one.misfit)))
    assert one.structure.along_alpha > 0.8
    # Without enough albedos it is no number.
    few = fit(line_profiles(reflectance[:5], alpha[:5]), Line(Setting()), "reflectance")
    assert few.result == "converged"
    assert np.all(np.isnan(few.jackknife))


@pytest.mark.slow
def test_only_rings_that_are_used_count(tallies, toy):
    profiles = tallies.profiles(tallies.draw(0, 1)[0])
    used = np.ones(profiles.energy.shape, bool)
    used[:, 9:] = False
    beyond = profiles.energy[:, 9:].sum(axis=1) * -2.0  # A stays as it was
    energy = np.where(used, profiles.energy, 3 * profiles.energy)
    spoilt = replace(profiles, energy=energy, beyond=beyond, photons=None, covariance=None)
    clean, other = fit(profiles, toy, used=used), fit(spoilt, toy, used=used)
    np.testing.assert_allclose(other.solution.parameters, clean.solution.parameters, rtol=1e-8)
    assert abs(fit(spoilt, toy).constants["h"] - clean.constants["h"]) > 0.005


def test_no_convergence_is_returned_and_settings_do_not_mix(line, tallies, toy):
    """1 / (1 + u^2) falls for ever."""
    alpha, reflectance, _ = line

    class Runaway(Line):
        def reflectance(self, alpha):
            return 1.0 / (1.0 + self.u**2) + 0.0 * alpha

    one = fit(line_profiles(0.0 * reflectance, alpha), Runaway(Setting()), "reflectance", free=("u",))
    assert one.result.startswith("no convergence in")
    assert np.all(np.isfinite(one.solution.parameters))
    profiles = tallies.profiles(tallies.draw(0, 1)[0])
    with pytest.raises(SettingError, match=r"the law belongs to diffuse.* the profiles to searchlight.* do not mix"):
        fit(profiles, eqx.tree_at(lambda _: (), type(toy)(Setting("diffuse")), ()))


# What is left


def test_structure_of_tables_noise_and_waves():
    """Two albedos, four rings, one of them unused: rms over seven, lag-1 sums by hand."""
    found = residual_structure(np.array([[1.0, 1.0, -1.0, -1.0], [2.0, 2.0, 2.0, 0.0]]))
    assert (found.rms, found.largest) == (pytest.approx(np.sqrt(16 / 7)), 2.0)
    # Products along r: 1 - 1 + 1 + 4 + 4 + 0 = 9; squares of the later ones 3 + 8, of the earlier ones 3 + 12.
    assert found.along_r == pytest.approx(9 / np.sqrt(11 * 15))
    # Along alpha: 2 + 2 - 2 + 0 = 2; squares 12 and 4.
    assert found.along_alpha == pytest.approx(2 / np.sqrt(12 * 4))
    # Stretches of one sign along r: 2 and 1, along alpha: 1, 1, 2, 1.
    assert found.half_waves == pytest.approx(1.5 * 1.25)
    noise = residual_structure(np.random.default_rng(6).standard_normal((20, 100)))
    # Lag-1 of white noise: 1 / sqrt(2000) = .022; 4 of them. Signs change at every other step.
    assert abs(noise.along_r) < 0.09
    assert abs(noise.along_alpha) < 0.09
    assert noise.half_waves == pytest.approx(50.5 * 10.5, rel=0.15)
    wave = residual_structure(np.outer(np.ones(20), np.sin(np.linspace(0.01, 3 * np.pi - 0.01, 100))))
    assert wave.along_r > 0.98
    assert (wave.along_alpha, wave.half_waves) == (pytest.approx(1.0), 3.0)
    found = residual_structure(np.zeros((3, 4)))
    assert (found.rms, found.largest, found.along_r, found.along_alpha, found.half_waves) == (0, 0, 0, 0, 0)


@pytest.mark.slow
def test_noise_of_the_light_beyond_the_last_ring_counts():
    """A fit of A sees one number an albedo; where the rings end cannot matter to its error."""
    law = LiangAlbedo(Setting(), 5.67, 3.84, 0.84)
    alpha = 1.0 - np.linspace(0.9, 0.2, 8) ** 2
    light = simulate_orders(Grid.from_edges(r=[0.0, 0.02, 1.9, 1000.0]), 2**18, seed=3)
    far, near = (fit(Profiles.from_orders(light.merged(edges), alpha), law) for edges in ([0.0, 1000.0], [0.0, 0.02]))
    np.testing.assert_allclose(near.solution.parameters, far.solution.parameters, rtol=1e-6)
    # Eight directions a ring keep all but 1e-6 of the variance; one ring has fewer of them than two.
    np.testing.assert_allclose(np.sqrt(np.diag(near.statistical)), np.sqrt(np.diag(far.statistical)), rtol=1e-2)


@pytest.mark.slow
def test_a_constant_that_moves_nothing_is_a_failed_fit(tallies, liang):
    """Not one with an error of zero, which the inverse of a singular matrix would make of it."""
    one = fit(tallies.profiles(tallies.draw(0, 1)[0]), liang, "energy", free=("a1", "b0", "g1"))
    assert one.result.startswith("degenerate, condition number")
    assert "g1 moves nothing" in one.result
    assert np.all(np.isnan(one.misfit))
    assert np.all(np.isnan(one.statistical))
    assert np.all(np.isnan(one.jackknife))


@pytest.mark.parametrize(
    ("law", "words", "said"),
    [
        ("burley", {"objective": "depth"}, "objective must be one of energy, relative, radial,"),
        ("burley", {"objective": "radial"}, "objective 'radial' does not apply to Burley"),
        ("burley", {"free": ()}, "free must name at least one constant, each once, got \\(none\\)"),
        ("burley", {"free": ("s0", "s0")}, "free must name at least one constant, each once, got s0, s0"),
        ("burley", {"free": ("s9",)}, "free must name constants of the law \\(s0, s1, s2, s3\\), got 's9'"),
        ("liang", {"objective": "share"}, "objective 'share' needs shares xi of the energy, got none"),
    ],
)
def test_misuse_is_named(tallies, request, law, words, said):
    refused(said, fit, tallies.profiles(tallies.draw(0, 1)[0]), request.getfixturevalue(law), **words)

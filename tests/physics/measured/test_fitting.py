"""Fits of one's own data: what they find, what is not identifiable, what they advise; the whitening of rings; and the
model against the law itself. One file, since its tests share one compiled law; those over hundreds of replicates are
in test_coverage.
"""

from dataclasses import replace
from pathlib import Path

import jax
import numpy as np
import pytest

from mcml_sim import Setting
from profilefit.fitting.quality import profile_quality
from profilefit.measured import model
from profilefit.measured.data import Measured
from profilefit.measured.fitting import MediumFit, fitted
from profilefit.measured.identifiability import identifiability, rank_designs, relative_errors
from profilefit.measured.model import BLOCK, Model, alpha_of, exact_light, u_of
from profilefit.measured.noise import BEYOND, RMS, WAVE, noise, origin, relative_error
from profilefit.measured.problem import FARTHEST_LN, LONGEST, FitSpec, Known, held_albedo
from profilefit.measured.reading import read
from profilefit.measured.result import MediumPosterior, judged, posterior
from profilefit.recipes import catalogue
from tests.fixtures import refused

DATA = Path(__file__).parents[3] / "examples"
LAW = catalogue.load("hazard")
SOURCE = origin("hazard", "regenerated", Setting(), catalogue.fits_folder())
ALPHA, MFP = 0.95, 1.1
EDGES = np.geomspace(0.05, 12.0, 25)
TOTAL = LAW.albedo.reflectance(ALPHA)


def light(inner, outer, scale=1.0) -> np.ndarray:
    """What the law itself would give of this medium."""
    return Model(LAW).predicted(np.array([u_of(ALPHA), np.log(MFP), np.log(scale)])[None], inner, outer)[0, :-1]


def measured(inner, outer, value, sigma) -> Measured:
    return Measured("made up", "", inner, outer, value, sigma, np.full(value.size, np.inf), "as given", "mm")


def rings(error=0.02, seed=None, most=np.inf, scale=1.0) -> Measured:
    """Averages over rings, of this relative error, with noise if there is a seed."""
    inner, outer = EDGES[:-1][EDGES[1:] <= most], EDGES[1:][EDGES[1:] <= most]
    value = light(inner, outer, scale)
    sigma = error * value
    if seed is not None:
        value = value + sigma * np.random.default_rng(seed).standard_normal(value.size)
    return measured(inner, outer, value, sigma)


def fit(data, total=None, scale_error=None, **held) -> MediumFit:
    known = None if scale_error is None else Known(1.0, scale_error)
    return fitted(data, FitSpec(LAW, held, total, known, source=SOURCE))


@pytest.fixture(scope="module")
def plain():
    return fit(rings(), scale=1.0)


@pytest.fixture(scope="module")
def unscaled():
    return fit(rings(scale=3.0))


def test_light_without_noise_gives_its_medium(plain, unscaled):
    assert plain.minimum.result == unscaled.minimum.result == "converged"
    expected = {"A": TOTAL, "alpha": ALPHA, "l": MFP, "mu_s'": ALPHA / MFP, "mu_a": (1 - ALPHA) / MFP}
    assert plain.values == pytest.approx({**expected, "scale": 1.0}, rel=1e-6)
    assert unscaled.values == pytest.approx({**expected, "scale": 3.0}, rel=1e-5)
    assert plain.misfit.chi2 < 1e-6


def test_errors_are_those_of_linear_least_squares(plain):
    """A slow, obvious twin: derivatives of the light by differences, and the normal equations.

    The law's own error is a covariance of the rows: rel of it, in waves.
    """
    data, names, step = plain.data, ("u", "ln l"), 1e-5
    columns = []
    for at in range(len(names)):
        ends = plain.point + step * np.outer([1, -1], np.eye(3)[at])
        up, down = Model(LAW).predicted(ends, data.inner, data.outer)[:, :-1]
        columns.append((up - down) / (2 * step))
    jacobian = np.column_stack(columns)
    size = RMS * relative_error(LAW, ALPHA, SOURCE) * data.value * np.where(plain.beyond, BEYOND, 1.0)
    apart = np.subtract.outer(np.log(data.r), np.log(data.r)) / WAVE
    law, noise = np.exp(-np.abs(apart)) * np.outer(size, size), np.diag(data.sigma**2)
    gain = np.linalg.solve(jacobian.T @ np.linalg.solve(law + noise, jacobian), jacobian.T) @ np.linalg.inv(law + noise)
    for found, rows in ((plain.statistical, noise), (plain.of_law, law), (plain.total_covariance, law + noise)):
        np.testing.assert_allclose(found[:2, :2], gain @ rows @ gain.T, rtol=1e-4)
    errors = plain.errors(plain.statistical)
    assert errors["scale"] == 0
    assert 0 < plain.errors(plain.of_law)["l"] < errors["l"], "hazard is ten times nearer than these data"


@pytest.mark.slow
def test_what_is_held_stays_and_what_is_known_counts():
    data = rings(seed=1)
    held = fit(data, scale=1.0, l=1.0)
    assert held.values["l"] == pytest.approx(1.0, rel=1e-12)
    assert held.spec.free == (0,)
    darker = fit(data, total=Known(TOTAL / 2, TOTAL / 1000), scale=1.0)
    assert TOTAL / 2 < darker.values["A"] < 0.6 * TOTAL, "thousandth against 2 % errors"
    assert darker.minimum.residuals.size == data.value.size + 1
    loose, tight = fit(data), fit(data, scale_error=0.01)
    assert tight.errors(tight.statistical)["scale"] == pytest.approx(0.01, rel=0.1)
    assert tight.errors(tight.statistical)["scale"] < 0.5 * loose.errors(loose.statistical)["scale"]


def test_failures_have_names():
    bright = fit(rings(), scale=0.3)  # no medium reflects more than all of the light
    assert "alpha runs to 1" in bright.minimum.result
    refused(r"made up: expected more than 3 rows, one more than is free, got 3", fit, rings().within(None, EDGES[3]))


def test_what_is_held_far_off_ends_in_a_name_or_at_an_edge():
    """Light that underflows, of a length in the wrong unit."""
    slip = fit(read(DATA / "half_space.mco"), scale=1.0, l=1e-4)
    assert np.all(np.isfinite(slip.statistical))
    assert slip.misfit.detected
    for held in ({"l": 1e-300}, {"l": 1e300}, {"l": 1e-9, "alpha": 0.5, "scale": 1e300}):
        failed = fit(rings(), **({"scale": 1.0} | held)).minimum
        assert not failed.converged or failed.cost > 1e3, held


@pytest.mark.slow
def test_light_that_rises_outwards_runs_away():
    data = rings()
    rising = replace(data, value=data.r, sigma=0.02 * data.r)
    assert fit(rising).minimum.result.startswith("a coordinate diverges")
    longest = data.r[-1] * LONGEST * np.exp(FARTHEST_LN)
    assert fit(rising).values["l"] <= longest


def test_a_simulation_is_not_asked_for_its_total_reflectance():
    kinds = {one.kind for one in rank_designs(fit(read(DATA / "half_space.mco"))).candidates}
    assert kinds == {"point", "scale", "repeats"}


def test_a_simulated_half_space_comes_back(sidak):
    """mu_a 1, mu_s 9 per cm: within both errors, of the photons and of the law."""
    found = fit(read(DATA / "half_space.mco"), scale=1.0)
    assert found.minimum.converged
    joint = found.errors(found.statistical + found.of_law)
    for name, truth in (("mu_a", 1.0), ("mu_s'", 9.0), ("A", 0.414947)):
        assert abs(found.values[name] - truth) < sidak(3) * joint[name], name
    assert not found.misfit.detected
    own = fit(read(DATA / "half_space.npz"), scale=1.0)
    assert own.errors(own.statistical)["mu_a"] < found.errors(found.statistical)["mu_a"], "its errors are no bounds"
    assert own.misfit.chance > 1e-3
    assert own.values["mu_a"] == pytest.approx(found.values["mu_a"], rel=0.005)


def test_two_layers_are_no_half_space():
    """A layer of .3 mm that absorbs fifty times as much, fitted with one: 16 % of the light is unexplained."""
    found = fit(read(DATA / "two_layers.mco"), scale=1.0)
    assert found.minimum.converged
    assert found.misfit.detected
    assert found.misfit.along_r > 0.5
    assert 0.1 < found.misfit.relative < 0.25
    statistical, inflated = found.plain.errors(found.plain.statistical), found.errors(found.of_misfit)
    assert inflated["mu_a"] > 20 * statistical["mu_a"]
    assert relative_errors(found, found.of_misfit)["mu_a"] > 0.1


@pytest.mark.slow
def test_near_the_beam_colour_length_and_scale_are_one():
    near = fit(rings(seed=2, most=0.3 * MFP))
    near_to = identifiability(near)
    assert not near_to.all_identified
    assert near_to.trades
    assert abs(near_to.correlation) > 0.99
    assert any(one.is_open for one in near_to.intervals)
    assert set(near_to.loose) == {"mu_s'", "mu_a", "scale"}
    whole = identifiability(fit(rings(seed=2), scale=1.0))
    assert whole.all_identified
    assert whole.loose == {}


def test_intervals_are_where_chi_square_rises(plain):
    """Where the problem is nearly linear the profile likelihood has the width of the covariance."""
    for one in identifiability(plain).intervals:
        half = 1.96 * plain.errors(plain.total_covariance)[one.name]
        assert (one.high - one.low) / 2 == pytest.approx(half, rel=0.05)
        assert one.low < plain.values[one.name] < one.high


def small(generator) -> MediumFit:
    """A fit to a few radii of some medium, often too near, too few or too noisy to tell white from grey."""
    first, noise = generator.choice([0.05, 0.2, 1.0]), generator.choice([0.01, 0.1, 0.3])
    r = np.geomspace(first, first * generator.choice([1.5, 4.0, 20.0]), int(generator.integers(4, 8)))
    value = np.asarray(LAW.profile(r, 1.0 - generator.choice([0.0, 1e-3, 0.05, 0.3]), MFP))
    drawn = value * (1.0 + noise * generator.standard_normal(r.size))
    data = measured(r, r, drawn, noise * value)
    return fit(data, **({} if generator.random() < 0.2 else {"scale": 1.0}))


@pytest.mark.slow
def test_no_value_lies_outside_its_own_interval():
    """Nor is there one, or a symmetric error, where alpha = 1 fits as well: but a limit."""
    at_edge = given = 0
    for seed in range(5):
        found = small(np.random.default_rng(seed))
        if not (found.minimum.converged or found.at_edge):
            continue
        judgement = identifiability(found)
        endless = any(one.open_low or (one.open_high and one.name != "alpha") for one in judgement.intervals)
        result = MediumPosterior(found, judgement, None, None if endless else posterior(found, max_steps=100))
        for name in result.moving:
            value, shown = result.value(name), [result.interval(name), result.whole_interval(name)]
            if any(result.ends(name)):
                at_edge += 1
                assert value is None
                assert name not in result.identified
                assert all(one is None or None in one for one in shown)
            elif value is not None:
                given += 1
                assert all(low <= value <= high for low, high in filter(None, shown))
        outside = found.values["alpha"] > 0.9999
        assert not outside or result.value("alpha") is None, "nothing here tells alpha from 1 so well"
    assert at_edge >= 3
    assert given >= 3


def test_the_advice_does_what_it_predicts_and_what_it_rejects_does_less(unscaled):
    advice = rank_designs(unscaled)
    found = {one.kind: one for one in advice.candidates}
    assert set(found) == {"point", "reflectance", "scale", "repeats"}
    assert advice.now == max(relative_errors(unscaled, unscaled.total_covariance).values())
    best = advice.candidates[0]
    assert best.kind == "reflectance"
    assert best.worst[1] < advice.now / 4

    taken = fitted(unscaled.data, replace(unscaled.spec, total=Known(TOTAL, best.error)))
    real = relative_errors(taken, taken.total_covariance)
    assert real == pytest.approx(best.relative, rel=0.02)

    point = found["point"]
    value = light(np.array([point.inner]), np.array([point.outer]), 3.0)[0]
    assert value == pytest.approx(point.value, rel=1e-5)
    data, row = unscaled.data, (point.inner, point.outer, value, point.error, np.inf)
    names = ("inner", "outer", "value", "sigma", "freedom")
    at = int(np.searchsorted(data.inner, point.inner))
    more = {name: np.insert(getattr(data, name), at, one) for name, one in zip(names, row, strict=True)}
    with_point = fitted(replace(data, **more), unscaled.spec)
    assert relative_errors(with_point, with_point.total_covariance) == pytest.approx(point.relative, rel=0.02)
    assert max(point.relative.values()) > max(real.values())
    four = fit(rings(error=0.01, scale=3.0))
    assert relative_errors(four, four.total_covariance) == pytest.approx(found["repeats"].relative, rel=0.02)


def test_what_is_known_of_a_law():
    assert SOURCE is not None
    assert SOURCE.path.name == "hazard.json"
    assert 0.001 < relative_error(LAW, 0.9, SOURCE) < 0.004
    refracting = catalogue.load("hazard", setting=Setting(n=1.4))
    there = origin("hazard", "regenerated", refracting.setting, catalogue.fits_folder())
    assert 0.001 < relative_error(refracting, 0.9, there) < 0.004
    between = refracting.at(replace(refracting.setting, n=1.37))  # its record is of n = 1.4: measured
    there = origin("hazard", "regenerated", between.setting, catalogue.fits_folder())
    assert there.path.name == "hazard-refracting.json"
    assert relative_error(between, 0.9, there) == profile_quality(between, [0.9]).rel[0]
    dipole = catalogue.load("better_dipole", setting=Setting(n=1.4))
    assert origin("better_dipole", "regenerated", dipole.setting, catalogue.fits_folder()) is None
    assert relative_error(dipole, 0.9, None) > 0.1
    rarer = dipole.at(replace(dipole.setting, n=0.9))  # there is no exact profile
    assert relative_error(rarer, 0.9, None) is None


@pytest.mark.slow
def test_errors_beyond_double_precision_are_the_result_and_nothing_is_told():
    """Values of thirty decades and both signs, with a free scale: numpy warned, and the answer had numbers."""
    r = np.array([0.002, 0.05, 0.2, 0.28, 1.2, 70.0, 990.0])
    value = np.array([-2.4e-11, -2.5e-3, 9.3e18, -8.1e15, 5e-5, 1.2e7, 2.7e-18])
    sigma = np.array([1.6e-15, 1.6e-7, 6.1e14, 5.3e11, 3.3e-9, 770.0, 1.8e-22])
    result = judged(fit(measured(r, r, value, sigma)))
    assert result.fit.minimum.result != "converged"
    assert (result.identifiability, result.identified, result.draws) == (None, (), {})
    assert {result.value(name) for name in result.moving} == {None}


PHOTON_EDGES = np.append(0.0, np.geomspace(0.05, 40.0, 32))
INNER, OUTER = PHOTON_EDGES[:-1], PHOTON_EDGES[1:]
AREAS = np.pi * (OUTER**2 - INNER**2)
PHOTONS = 10**6


def energies(alpha, mfp=1.0) -> np.ndarray:
    """Shares of the photons that leave through each ring (32,), by the law itself."""
    return Model(LAW).predicted(np.array([[u_of(alpha), np.log(mfp), 0.0]]), INNER, OUTER)[0, :-1] * AREAS


def counted(share, photons=PHOTONS) -> Measured:
    """Whole photons, of which these shares came out through the rings."""
    sigma = np.sqrt(share * (1 - share) / (photons - 1)) / AREAS
    many = np.full(share.size, np.inf)
    return Measured("run", "", INNER, OUTER, share / AREAS, sigma, many, "counts", "mm", True, photons=float(photons))


def covariance(share) -> np.ndarray:
    """The slow, obvious twin: a multinomial's, per area."""
    return (np.diag(share) - np.outer(share, share)) / (PHOTONS - 1) / np.outer(AREAS, AREAS)


@pytest.mark.parametrize("alpha", [0.5, 0.99])
def test_whitened_rows_are_independent(alpha):
    share = energies(alpha)
    found = noise(counted(share))
    full = covariance(share)
    np.testing.assert_allclose(found.whitened(found.whitened(full).T), np.eye(share.size), atol=1e-9)
    np.testing.assert_allclose(found.sigma, np.sqrt(np.diag(full)), rtol=1e-12)
    np.testing.assert_allclose(found.whitened(full)[:, 3], found.whitened(full[:, 3]))
    rows = np.arange(share.size, dtype=float)
    assert np.sum(found.whitened(rows) ** 2) == pytest.approx(rows @ np.linalg.solve(full, rows), rel=1e-9)


def test_rows_that_share_nothing_are_divided_by_their_errors():
    data = counted(energies(0.9), np.inf)
    rows = np.ones((data.value.size, 2))
    np.testing.assert_array_equal(noise(counted(energies(0.9))).whitened(rows).shape, rows.shape)
    alone = measured(INNER, OUTER, data.value, np.full(data.value.size, 0.5))
    np.testing.assert_array_equal(noise(alone, widening=4.0).whitened(rows), rows)


@pytest.mark.parametrize(("alpha", "too_wide"), [(0.9, 1.2), (0.99, 1.8), (0.999, 2.0)])
def test_errors_of_a_fit_are_those_of_the_full_covariance(alpha, too_wide):
    """Generalised least squares by hand; negative control: rings without their covariance."""
    data = counted(energies(alpha))
    found = fit(data, scale=1.0)
    assert found.minimum.converged
    slopes = found.predicted[1][:-1, :2]
    photons, law = covariance(energies(alpha)), found.problem.noise.model
    gain = np.linalg.solve(slopes.T @ np.linalg.solve(photons + law, slopes), slopes.T) @ np.linalg.inv(photons + law)
    np.testing.assert_allclose(found.statistical[:2, :2], gain @ photons @ gain.T, rtol=1e-4)
    exact = np.linalg.inv(slopes.T @ np.linalg.solve(photons, slopes))
    weights = 1 / (data.sigma**2 + data.value**2 / PHOTONS)
    apart = np.linalg.inv(slopes.T @ (weights[:, None] * slopes))
    assert np.sqrt(apart[0, 0] / exact[0, 0]) > too_wide
    assert found.misfit.chi2 < 1e-4


@pytest.mark.slow
def test_fits_to_drawn_photons_scatter_as_stated():
    """Sixty multinomial draws at alpha .99: squares of both coordinates over their covariance are chi-square."""
    share = energies(0.99)
    truth = np.array([u_of(0.99), 0.0])
    whole = np.append(share, 1 - share.sum())
    draws = np.random.default_rng(4).multinomial(PHOTONS, whole, 60)[:, :-1] / PHOTONS
    squares, alphas = [], []
    for one in draws:
        found = fit(counted(one), scale=1.0)
        off = found.point[:2] - truth
        squares.append(off @ np.linalg.solve(found.statistical[:2, :2], off))
        alphas.append(off[0] ** 2)
    # Chi-square of 120 degrees of freedom, 99.9 % of it.
    assert 78 < np.sum(squares) < 172
    apart = fit(counted(share), scale=1.0).statistical[0, 0] * 1.8**2
    assert np.sum(alphas) / apart < 33, "negative control: with the errors of rings apart 60, at least 33, is expected"


POINT = np.array([u_of(0.9), np.log(1.3), np.log(0.7)])
R = np.geomspace(0.05, 9.0, BLOCK + 3)  # more than one block


def test_points_are_the_laws_own_and_derivatives_and_flocks_agree_with_them():
    model, step = Model(LAW), 1e-5
    light, slopes = model.linearised(POINT, R, R)
    np.testing.assert_allclose(light[:-1], 0.7 * LAW.profile(R, 0.9, 1.3), rtol=1e-12)
    assert light[-1] == pytest.approx(LAW.albedo.reflectance(0.9), rel=1e-14)
    ways = np.concatenate([POINT + step * np.eye(3), POINT - step * np.eye(3)])
    moved = model.predicted(ways, R, R)
    # Central differences: their own error is step^2 times a third derivative, and rounding over the step.
    np.testing.assert_allclose((moved[:3] - moved[3:]).T / (2 * step), slopes, rtol=1e-7, atol=1e-9 * light.max())
    many = np.repeat(POINT[None], 70, axis=0)
    np.testing.assert_allclose(model.predicted(many, R, R), np.repeat(light[None], 70, axis=0), rtol=1e-12)


def test_rings_are_averages():
    inner, outer = np.array([0.0, 0.5, 3.0]), np.array([0.3, 0.6, 5.0])
    found = Model(LAW).predicted(POINT[None], inner, outer)[0, :-1]
    nodes, weights = np.polynomial.legendre.leggauss(200)
    r = 0.5 * (outer + inner)[:, None] + 0.5 * (outer - inner)[:, None] * nodes
    integral = np.sum(2 * np.pi * r * 0.7 * LAW.profile(r, 0.9, 1.3) * weights, axis=1) * 0.5 * (outer - inner)
    np.testing.assert_allclose(found, integral / (np.pi * (outer**2 - inner**2)), rtol=1e-5)  # r ln r at the source


@pytest.mark.parametrize("alpha", [1e-6, 0.3, 0.9, 1 - 1e-9])
def test_alpha_keeps_its_digits(alpha):
    assert alpha_of(u_of(alpha)) == pytest.approx(alpha, rel=1e-12)
    assert 1.0 / (1.0 + np.exp(-u_of(alpha))) == pytest.approx(np.sqrt(1 - alpha), rel=1e-9)


def test_quantities_and_their_slopes():
    found = model.quantities(POINT[None], np.array([0.4]))
    assert {name: float(value[0]) for name, value in found.items()} == pytest.approx(
        {"A": 0.4, "alpha": 0.9, "l": 1.3, "mu_s'": 0.9 / 1.3, "mu_a": 0.1 / 1.3, "scale": 0.7}
    )
    step, slopes = 1e-6, model.slopes(POINT, np.zeros(3))
    for at in range(3):
        ends = np.stack([POINT + step * np.eye(3)[at], POINT - step * np.eye(3)[at]])
        two = model.quantities(ends, np.zeros(2))
        for name in ("alpha", "l", "mu_s'", "mu_a", "scale"):
            assert (two[name][0] - two[name][1]) / (2 * step) == pytest.approx(slopes[name][at], abs=1e-8)
    names = ("alpha", "mu_a")
    np.testing.assert_allclose(model.correlation(slopes, np.diag([1.0, 0, 0]), names), [[1, -1], [-1, 1]])
    assert (model.unit_of("mu_a", "mm"), model.unit_of("l", "")) == ("1/mm", "unit of r")


def test_a_held_reflectance_is_an_albedo():
    assert held_albedo(LAW, "A", LAW.albedo.reflectance(0.8)) == pytest.approx(0.8, abs=1e-10)
    refracting = catalogue.load("hazard", setting=Setting(n=1.4))
    refused(r"^held A must be a total reflectance in \[.*, 0.97\d+\] of this light", held_albedo, refracting, "A", 0.99)
    refused(r"^held alpha must be a reduced albedo in \(0, 1\), got 1", held_albedo, LAW, "alpha", 1.0)


def test_exact_light_is_kept_for_the_next_process(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    exact_light.cache_clear()
    first = exact_light(Setting())
    (path,) = tmp_path.rglob("light-searchlight-n1.0-*.npz")
    written = path.stat().st_mtime_ns
    exact_light.cache_clear()
    again = exact_light(Setting())
    assert path.stat().st_mtime_ns == written
    assert all(np.array_equal(*pair) for pair in zip(*map(jax.tree.leaves, (first, again)), strict=True))
    exact_light.cache_clear()

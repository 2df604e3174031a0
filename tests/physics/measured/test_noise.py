"""Rings of one run share its photons: the whitening against the full covariance, and what errors follow from it."""

import numpy as np
import pytest

from mcml_sim import Setting
from profilefit.measured.data import Measured
from profilefit.measured.fitting import fitted
from profilefit.measured.model import Model, u_of
from profilefit.measured.noise import noise, origin
from profilefit.measured.problem import FitSpec
from profilefit.recipes import catalogue

LAW = catalogue.load("hazard")
SOURCE = origin("hazard", "regenerated", Setting(), catalogue.fits_folder())
EDGES = np.append(0.0, np.geomspace(0.05, 40.0, 32))
INNER, OUTER = EDGES[:-1], EDGES[1:]
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
    sigma = np.full(data.value.size, 0.5)
    alone = Measured("made up", "", INNER, OUTER, data.value, sigma, data.freedom, "as given", "mm")
    np.testing.assert_array_equal(noise(alone, widening=4.0).whitened(rows), rows)


@pytest.mark.parametrize(("alpha", "too_wide"), [(0.9, 1.2), (0.99, 1.8), (0.999, 2.0)])
def test_errors_of_a_fit_are_those_of_the_full_covariance(alpha, too_wide):
    """Generalised least squares by hand; negative control: rings without their covariance."""
    data = counted(energies(alpha))
    spec = FitSpec(LAW, {"scale": 1.0}, source=SOURCE)
    found = fitted(data, spec)
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
    share, spec = energies(0.99), FitSpec(LAW, {"scale": 1.0}, source=SOURCE)
    truth = np.array([u_of(0.99), 0.0])
    whole = np.append(share, 1 - share.sum())
    draws = np.random.default_rng(4).multinomial(PHOTONS, whole, 60)[:, :-1] / PHOTONS
    squares, alphas = [], []
    for one in draws:
        found = fitted(counted(one), spec)
        off = found.point[:2] - truth
        squares.append(off @ np.linalg.solve(found.statistical[:2, :2], off))
        alphas.append(off[0] ** 2)
    # Chi-square of 120 degrees of freedom, 99.9 % of it.
    assert 78 < np.sum(squares) < 172
    apart = fitted(counted(share), spec).statistical[0, 0] * 1.8**2
    assert np.sum(alphas) / apart < 33, "negative control: with the errors of rings apart 60, at least 33, is expected"

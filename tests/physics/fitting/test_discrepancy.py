"""The process behind a law's residuals: found again where it is known, and not found where there is only noise."""

from dataclasses import replace

import numpy as np
import pytest

from profilefit.fitting import discrepancy
from profilefit.fitting.discrepancy import FOUND, NOT_SEEN, Discrepancy, Residuals, of_residuals
from profilefit.fitting.misfit import apart

U, S = np.linspace(-4.0, 2.5, 14), np.linspace(0.08, 0.97, 12)
AMPLITUDE, LENGTH_U, LENGTH_S, NOISE = 0.03, 1.2, 0.3, 0.002
DRAWS = 8


def kernel(one, other, length):
    d = np.sqrt(3.0) * np.abs(one[:, None] - other) / length
    return (1.0 + d) * np.exp(-d)


def roots():
    """Factors of the process along s and along u."""
    pairs = ((S, LENGTH_S), (U, LENGTH_U))
    return [np.linalg.cholesky(kernel(x, x, length) + 1e-10 * np.eye(x.size)) for x, length in pairs]


def residuals(table, noise=NOISE):
    """A law of two constants whose fit by plain least squares has followed what it could."""
    design = np.stack([np.ones((S.size, U.size)), np.broadcast_to(U, (S.size, U.size))], axis=2)
    flat = design.reshape(-1, 2)
    followed = np.linalg.pinv(flat)
    left = table - (flat @ followed @ table.ravel()).reshape(table.shape)
    factor = noise * np.broadcast_to(np.eye(S.size), (U.size, S.size, S.size))
    influence = followed.reshape(2, S.size, U.size)
    return Residuals(-left, np.ones(left.shape, bool), U, S, design, factor, influence)


@pytest.fixture(scope="module")
def drawn():
    """Residuals of eight draws of a known process with known noise, and what was found in each."""
    rng = np.random.default_rng(12)
    along_s, along_u = roots()
    shape = (DRAWS, S.size, U.size)
    truth = AMPLITUDE * along_s @ rng.standard_normal(shape) @ along_u.T
    tables = truth + NOISE * rng.standard_normal(shape)
    return [of_residuals(residuals(table)) for table in tables]


@pytest.mark.slow
def test_amplitude_lengths_and_scatter_of_constants_are_found_again(drawn):
    """Each within its own error, and all together without bias: four of the scatter's standard errors."""
    assert [one.result for one in drawn] == [FOUND] * DRAWS
    z = [np.log(one.amplitude / AMPLITUDE) / (one.amplitude_error / one.amplitude) for one in drawn]
    assert np.abs(z).max() < 4
    for known, name in ((AMPLITUDE, "amplitude"), (LENGTH_U, "length_r"), (LENGTH_S, "length_s")):
        found = np.log([getattr(one, name) for one in drawn])
        assert abs(found.mean() - np.log(known)) < 4 * found.std(ddof=1) / np.sqrt(DRAWS), name
    assert all(one.rms < AMPLITUDE for one in drawn)
    # The fits' errors over 2000 draws against the covariance at the process's own amplitude and lengths.
    own = true_process()
    rng = np.random.default_rng(13)
    along_s, along_u = roots()
    delta = AMPLITUDE * along_s @ rng.standard_normal((2000, S.size, U.size)) @ along_u.T
    moved = np.einsum("pai,rai->rp", own.influence, delta)
    error = np.sqrt(np.diag(own.covariance))
    # A standard deviation of 2000 is known to 1.6 %: four of these.
    np.testing.assert_allclose(moved.std(axis=0) / error, 1.0, atol=0.065)
    # What was found in single draws says the same to the error of its amplitude.
    found = np.mean([np.sqrt(np.diag(one.covariance)) for one in drawn], axis=0)
    np.testing.assert_allclose(found / error, 1.0, atol=0.5)
    # Negative control: the same misfit taken for independent noise promises far too little.
    design = residuals(delta[0]).slope.reshape(-1, 2)
    white = AMPLITUDE * np.sqrt(np.diag(np.linalg.inv(design.T @ design)))
    assert np.all(white < 0.4 * error)


@pytest.mark.slow
def test_smooth_residuals_are_as_large_as_they_are(monkeypatch):
    """Draws of a process without fine scales, and no noise, as of a law fitted to exact light."""
    rng, roots = np.random.default_rng(16), []
    for x, length in ((S, 0.5), (U, 2.0)):
        value, vector = np.linalg.eigh(np.exp(-0.5 * ((x[:, None] - x) / length) ** 2))
        roots.append(vector * np.sqrt(np.maximum(value, 0.0)))
    delta = AMPLITUDE * roots[0] @ rng.standard_normal((2000, S.size, U.size)) @ roots[1].T
    scatter = np.std(np.einsum("pai,rai->rp", true_process().influence, delta), axis=0)

    def stated():
        found = [of_residuals(residuals(table, noise=0.0)) for table in delta[:DRAWS]]
        z = [(one.amplitude - AMPLITUDE) / one.amplitude_error for one in found]
        return np.sqrt(np.mean([np.diag(one.covariance) for one in found], axis=0)) / scatter, np.abs(z).max()

    errors, farthest = stated()
    np.testing.assert_allclose(errors, 1.0, atol=0.5)
    assert farthest < 4
    # Negative control: what is likeliest alone.
    monkeypatch.setattr(discrepancy, "replace", lambda one, **_: one)
    errors, farthest = stated()
    assert np.all(errors < 0.4)
    assert farthest > 8


def true_process():
    """The process itself, as `discrepancy` would describe it."""
    data = residuals(np.zeros((S.size, U.size)))
    across = data.influence, kernel(S, S, LENGTH_S), kernel(U, U, LENGTH_U), data.influence
    covariance = AMPLITUDE**2 * np.einsum("pai,ab,ij,qbj->pq", *across, optimize=True)
    facts = AMPLITUDE, 0.0, LENGTH_U, LENGTH_S, np.inf, AMPLITUDE, FOUND
    return Discrepancy(*facts, covariance, U, S, data.influence)


def test_the_band_of_a_law_holds_the_truth_where_nothing_was_fitted():
    """Errors of the fitted law at points off the grid, over 2000 draws, have the covariance that is stated."""
    own, number = true_process(), 2000
    u, s = np.array([-3.3, 0.2, 3.0]), np.array([0.5, 0.11, 0.8])
    slope = np.stack([np.ones(3), u], axis=1)
    at_u, at_s = np.concatenate([np.tile(U, S.size), u]), np.concatenate([np.repeat(S, U.size), s])
    joint = AMPLITUDE**2 * kernel(at_u, at_u, LENGTH_U) * kernel(at_s, at_s, LENGTH_S)
    root = np.linalg.cholesky(joint + 1e-10 * AMPLITUDE**2 * np.eye(at_u.size))
    delta = np.random.default_rng(14).standard_normal((number, at_u.size)) @ root.T
    constants = np.einsum("pai,rai->rp", own.influence, delta[:, :-3].reshape(number, S.size, U.size))
    off = constants @ slope.T - delta[:, -3:]
    closed = own.law_covariance(u, s, slope)
    error = np.sqrt((closed**2 + np.outer(np.diag(closed), np.diag(closed))) / number)
    assert np.abs((off.T @ off / number - closed) / error).max() < 4
    # Negative control: as if the fit had not followed.
    assert np.abs((off.T @ off / number - AMPLITUDE**2 * np.eye(3)) / error).max() > 8
    np.testing.assert_array_equal(apart(np.eye(3), np.zeros((1, 3))), np.ones((3, 1)))


@pytest.mark.slow
def test_noise_alone_is_no_discrepancy():
    """White residuals of the stated size: seen in one of twenty at most by chance, so in two of eight hardly ever."""
    rng = np.random.default_rng(15)
    found = [of_residuals(residuals(NOISE * rng.standard_normal((S.size, U.size)))) for _ in range(DRAWS)]
    assert sum(one.result == FOUND for one in found) <= 1
    assert {one.result for one in found} <= {FOUND, NOT_SEEN}
    # Negative control: noise three times as large as stated, and a discrepancy of the size of the noise.
    wide = of_residuals(residuals(3 * NOISE * rng.standard_normal((S.size, U.size))))
    assert wide.result == FOUND
    along_s, along_u = roots()
    small = NOISE * along_s @ rng.standard_normal((S.size, U.size)) @ along_u.T
    both = of_residuals(residuals(small + NOISE * rng.standard_normal(small.shape)))
    assert both.result == FOUND
    assert both.amplitude == pytest.approx(NOISE, rel=0.7)


@pytest.mark.slow
def test_a_record_gives_it_back(drawn):
    one = drawn[0]
    content = {"discrepancy": one.content(), "covariance": {"model": one.covariance.tolist()}}
    again = discrepancy.read(content, one.arrays())
    assert again is not None
    u, s, slope = np.array([0.0]), np.array([0.4]), np.ones((1, 2))
    np.testing.assert_allclose(again.law_covariance(u, s, slope), one.law_covariance(u, s, slope), rtol=1e-12)
    assert discrepancy.read({}, {}) is None
    assert discrepancy.read(content, {}) is None
    failed = {"discrepancy": {**one.content(), "amplitude": None}}
    assert discrepancy.read(failed, one.arrays()) is None
    # A process that knows no radius, that of a map, answers for any.
    flat = replace(one, length_r=np.nan, u=np.zeros(1), influence=one.influence[:, :, :1])
    near, far = (flat.law_covariance(np.array([u]), np.array([0.4]), np.zeros((1, 2)))[0, 0] for u in (-3.0, 9.0))
    assert near == far == pytest.approx(flat.amplitude**2)

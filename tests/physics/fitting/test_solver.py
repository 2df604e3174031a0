"""Least squares against problems whose answer is known, and its failures as results."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy import optimize

from profilefit.fitting import solver
from profilefit.fitting.solver import Solution, covariance, differences, least_squares, minimise, solve, solve_batch

X = np.linspace(0, 3, 20)


def decay(p, data):
    return p[0] * jnp.exp(-p[1] * data["x"]) - data["y"]


def problem(amplitude, rate, noise=0.0, seed=0):
    y = amplitude * np.exp(-rate * X) + noise * np.random.default_rng(seed).standard_normal(X.size)
    return {"x": X, "y": y}


def test_known_parameters_come_back_whatever_scale_start_and_precision():
    found = least_squares(decay, [1.0, 1.0], problem(2.0, 1.7))
    np.testing.assert_allclose(found.parameters, [2.0, 1.7], rtol=1e-9)  # the solver's own tolerance is 1e-10
    assert found.converged
    assert found.result == solver.CONVERGED == "converged"
    assert found.cost < 1e-18
    assert 0 < found.steps < 50
    # Constants that differ by ten decades are found as well as equal ones: they are scaled by their start.
    found = least_squares(decay, [1e-5, 1e-5], {"x": X * 1e5, "y": 2e-5 * np.exp(-1.7 * X)})
    np.testing.assert_allclose(found.parameters, [2e-5, 1.7e-5], rtol=1e-6)
    found = least_squares(decay, [0.0, 0.0], problem(2.0, 1.7))
    np.testing.assert_allclose(found.parameters, [2.0, 1.7], rtol=1e-8)
    found = least_squares(decay, np.ones(2, np.float32), problem(2.0, 1.7, 1e-10))
    assert found.parameters.dtype == found.residuals.dtype == np.float64
    assert 1e-11 < np.sqrt(found.cost / X.size) < 1e-9  # float32 residuals would stop at 1e-8


@pytest.mark.slow
def test_a_linear_problem_is_lstsq():
    """The slow twin: the normal equations."""
    rng = np.random.default_rng(3)
    design, y = rng.standard_normal((30, 4)), rng.standard_normal(30)
    found = least_squares(lambda p, d: d[0] @ p - d[1], np.ones(4), (design, y))
    expected, cost, *_ = np.linalg.lstsq(design, y)
    np.testing.assert_allclose(found.parameters, expected, rtol=1e-8)
    assert found.cost == pytest.approx(cost[0], rel=1e-12)
    np.testing.assert_allclose(found.jacobian, design, rtol=1e-12)
    np.testing.assert_allclose(found.jacobian.T @ found.residuals, 0.0, atol=1e-7)  # stationary
    cases = [problem(2.0, 1.7, 0.01, 1), problem(0.5, 0.3, 0.01, 2), problem(9.0, 4.0, 0.01, 3)]
    starts = [[1.0, 1.0], [1.0, 0.5], [5.0, 2.0]]
    stacked = {key: np.stack([case[key] for case in cases]) for key in ("x", "y")}
    together = solve_batch(decay, starts, stacked)
    for one, start, case in zip(together, starts, cases, strict=True):
        alone = least_squares(decay, start, case)
        np.testing.assert_allclose(one.parameters, alone.parameters, rtol=1e-8)
        assert one.steps == alone.steps
        assert one.converged


def test_failures_are_results():
    found = least_squares(lambda p, _: jnp.exp(-p), [1.0], None)  # falls for ever
    assert not found.converged
    most = solver.MAX_STEPS
    expected = f"no convergence in {most} steps: constants trade against each other; fix one or widen the range"
    assert (found.result, found.steps) == (expected, most)
    good, bad = solve_batch(lambda p, d: jnp.log(p) - d, [[1.0], [-1.0]], np.array([[0.5], [0.5]]))
    assert good.converged
    assert good.parameters[0] == pytest.approx(np.exp(0.5), rel=1e-8)
    assert "not finite" in bad.result
    found = solve(lambda p: (np.full(3, np.nan), np.ones((3, 1))), np.ones(1))
    assert (found.result, found.steps) == (solver.NOT_FINITE, 1)


def solution(jacobian):
    return Solution(np.zeros(2), np.array([3.0, 4.0]), np.asarray(jacobian, float), 1, solver.CONVERGED)


def test_condition_number_and_covariance_of_known_jacobians():
    """Unit columns with cosine c have singular values sqrt(1 + c), sqrt(1 - c), however long the columns are."""
    for scale in (1.0, 1e8):
        jacobian = np.array([[1.0, scale * 0.6], [0.0, scale * np.sqrt(1 - 0.6**2)]])
        assert solution(jacobian).condition_number == pytest.approx(2.0, rel=1e-12)
    assert solution([[1.0, 0.0], [1.0, 0.0]]).condition_number > 1e15, "a blind constant"
    jacobian = np.random.default_rng(2).standard_normal((20, 3)) * [1.0, 1e4, 1e-4]
    np.testing.assert_allclose(covariance(jacobian), np.linalg.inv(jacobian.T @ jacobian), rtol=1e-7)
    assert np.all(np.isinf(covariance(np.array([[np.nan, 1.0], [1.0, 1.0]]))))
    # Two nearly parallel columns, 1e12 apart in size: variances 1 / (size sin)^2.
    sizes, angle = np.array([1e8, 1e-4]), 1e-6
    slopes = np.array([[1.0, np.cos(angle)], [0.0, np.sin(angle)], [0.0, 0.0]]) * sizes
    np.testing.assert_allclose(np.diag(covariance(slopes)), 1.0 / (sizes * np.sin(angle)) ** 2, rtol=1e-6)
    assert covariance(slopes * [1.0, 0.0])[1, 1] > 1e30, "what nothing tells has no small error"


@pytest.mark.slow
def test_a_search_that_stalls_at_the_edge_of_its_domain_has_not_converged():
    """The optimum of sqrt(x) = -1 lies beyond x = 0, where the residual is not finite."""

    def residual(p, data):
        return jnp.array([jnp.sqrt(p[0]) + 1.0, 0.1 * p[0]]) + 0.0 * data

    assert "stalled beside an optimum" in least_squares(residual, [1.0], np.zeros(2)).result
    data = problem(2.0, 1.7, 0.05, seed=4)
    for residual, of_numpy, start, more in (
        (decay, noisy, [1.0, 1.0], data),
        (lambda p, data: valley(p, jnp) + 0.0 * data, valley, [-1.2, 1.0], np.zeros(2)),
    ):
        twin = optimize.least_squares(of_numpy, start, xtol=1e-14, ftol=1e-14, gtol=1e-14)
        found = least_squares(residual, start, more)
        assert found.converged
        np.testing.assert_allclose(found.parameters, twin.x, rtol=1e-6)
        np.testing.assert_allclose(covariance(twin.jac), found.covariance, rtol=1e-4)


def valley(p, xp=np):
    """Rosenbrock's, whose optimum is at (1, 1)."""
    return xp.array([10.0 * (p[1] - p[0] ** 2), 1.0 - p[0]])


def noisy(p):
    data = problem(2.0, 1.7, 0.05, seed=4)
    return p[0] * np.exp(-p[1] * data["x"]) - data["y"]


def test_bounds_hold_an_optimum_release_a_start_and_fix_a_parameter():
    found = least_squares(decay, [1.0, 1.0], problem(2.0, 1.7), ([0.0, 0.0], [1.5, 5.0]))
    assert found.converged
    assert found.parameters[0] == 1.5
    np.testing.assert_array_equal(found.at_bound, [True, False])
    assert found.jacobian[:, 1] @ found.residuals == pytest.approx(0.0, abs=1e-8)
    assert found.jacobian[:, 0] @ found.residuals < 0, "a larger one would fit better"
    found = least_squares(decay, [1.0, 1.0], problem(2.0, 1.7), (1.0, 3.0))
    np.testing.assert_allclose(found.parameters, [2.0, 1.7], rtol=1e-9)
    assert not np.any(found.at_bound)
    found = solve(differences(noisy, 1e-6), np.array([2.5, 1.0]), ([2.5, 0.0], [2.5, 9.0]))
    alone = solve(differences(lambda p: noisy(np.append(2.5, p)), 1e-6), np.array([1.0]))
    assert (found.parameters[0], found.parameters[1]) == (2.5, pytest.approx(alone.parameters[0], rel=1e-8))


@pytest.mark.parametrize("seed", range(5))
def test_bounds_of_a_linear_problem_are_those_of_nnls(seed):
    """Ten columns that are nearly parallel: several of them end at 0."""
    rng = np.random.default_rng(seed)
    design = 1.0 + 0.3 * rng.standard_normal((30, 10))
    y = design @ rng.normal(0.5, 1.0, 10) + 0.1 * rng.standard_normal(30)
    found = solve(lambda p: (design @ p - y, design), np.ones(10), (0.0, np.inf))
    expected, size = optimize.nnls(design, y)
    assert found.converged
    assert found.steps < 20
    assert np.any(expected == 0), "a control"
    np.testing.assert_allclose(found.parameters, expected, atol=1e-8)
    assert found.cost == pytest.approx(size**2, rel=1e-12)
    np.testing.assert_array_equal(found.parameters == 0, found.at_bound)


def test_steps_are_no_longer_than_the_longest():
    seen = []

    def at(p):
        seen.append(p)
        return p - [5.0, 1.0], np.eye(2)

    found = solve(at, np.zeros(2), longest=[0.5, np.inf])
    np.testing.assert_allclose(found.parameters, [5.0, 1.0])
    assert np.max(np.abs(np.diff(seen, axis=0))[:, 0]) == pytest.approx(0.5)
    assert np.max(seen, axis=0)[1] > 0.9
    assert solve(lambda p: (p - [5.0, 1.0], np.eye(2)), np.zeros(2)).steps < found.steps - 4, "a control"
    start = np.array([1.0, 1.0])
    early, late = (solve(differences(noisy, 1e-6), start, gain=gain) for gain in (1e-3, 0.0))
    assert early.converged
    assert early.steps < late.steps
    assert early.cost - late.cost < 1e-3

    def residual(x):
        assert np.all(x <= 1.0)
        return np.array([np.exp(x[0]), x[0] * x[1], x[1] ** 2])

    for x in (np.array([0.3, 0.5]), np.array([1.0, 0.5])):
        here, slopes = differences(residual, 1e-6, 1.0)(x)
        np.testing.assert_array_equal(here, residual(x))
        np.testing.assert_allclose(slopes, [[np.exp(x[0]), 0.0], [x[1], x[0]], [0.0, 2.0 * x[1]]], atol=1e-5)


@pytest.mark.parametrize(("high", "expected"), [(3.0, [1.0, -0.5]), (0.5, [0.5, -0.25])])
def test_a_quadratic_is_minimised_inside_and_at_a_bound(high, expected):
    """x^2 + xy + y^2 - 1.5 x: y follows x by -x / 2."""

    def at(x):
        gradient = np.array([2 * x[0] + x[1] - 1.5, x[0] + 2 * x[1]])
        return float(x[0] ** 2 + x[0] * x[1] + x[1] ** 2 - 1.5 * x[0]), gradient

    bounds = np.array([-2.0, -3.0]), np.array([high, 3.0])
    x, value, converged = minimise(at, np.array([-1.0, 2.0]), bounds, 1e-6, 100)
    assert converged
    np.testing.assert_allclose(x, expected, atol=1e-6)
    assert value == pytest.approx(at(np.array(expected))[0], abs=1e-12)
    assert (x[0] == high) == (high < 1.0)
    assert not minimise(at, np.array([-1.0, 2.0]), bounds, 1e-6, 2)[2]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("residual", "start", "bounds"),
    [
        (noisy, [1.0, 1.0], (-np.inf, np.inf)),
        (noisy, [1.0, 1.0], ([0.0, 0.0], [1.5, 9.0])),
        (valley, [-1.2, 1.0], (-np.inf, np.inf)),
        (valley, [-1.2, 1.0], ([-2.0, -2.0], [0.8, 2.0])),
        (valley, [-1.2, 1.0], ([-2.0, 0.5], [2.0, 0.5])),
    ],
    ids=["free", "at a bound", "valley", "valley at a bound", "valley of one parameter"],
)
def test_the_optimum_is_that_of_a_trust_region(residual, start, bounds):
    """The slow twin: scipy's trust region, reflected at the bounds."""
    start, bounds = np.array(start), tuple(np.broadcast_to(end, 2) for end in bounds)
    loose = bounds[0], np.maximum(bounds[1], bounds[0] + 1e-9)  # scipy needs room between the bounds
    twin = optimize.least_squares(residual, np.clip(start, *loose), bounds=loose, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    found = solve(differences(residual, 1e-7), np.clip(start, *bounds), bounds)
    assert found.converged
    assert found.cost == pytest.approx(2.0 * twin.cost, rel=1e-6, abs=1e-12)
    np.testing.assert_allclose(found.parameters, twin.x, rtol=1e-5)


def test_with_the_curvature_of_residuals_that_stay_large_steps_are_newton_s():
    """Residuals x^2 + c: their own curvature is all that the Hessian has at the optimum, x = 0."""
    start, offsets = np.array([0.3, -0.2]), np.array([1.0, 30.0])

    def at(x):
        return x**2 + offsets, np.diag(2.0 * x), np.diag(6.0 * x**2 + 2.0 * offsets)

    (plain, slope, hessian), (values, jacobian) = at(start), solver.with_curvature(*at(start))
    assert values @ values == pytest.approx(plain @ plain, rel=1e-14)
    np.testing.assert_allclose(jacobian.T @ values, slope.T @ plain, rtol=1e-12)
    np.testing.assert_allclose(jacobian.T @ jacobian, hessian, rtol=1e-12, atol=1e-12)
    for other in (-hessian, 0.0 * hessian, np.full((2, 2), np.inf), 1.0 - 0.5 * np.eye(2), 1e-9 * hessian):
        assert solver.with_curvature(plain, slope, other)[0] is plain
    bent, creeping = solve(lambda x: solver.with_curvature(*at(x)), start), solve(lambda x: at(x)[:2], start)
    assert bent.converged
    assert bent.steps < 10 < creeping.steps
    np.testing.assert_allclose(bent.parameters, 0.0, atol=1e-6)  # beyond, the sum does not see them

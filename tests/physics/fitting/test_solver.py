"""Least squares against problems whose answer is known, and its failures as results."""

import jax.numpy as jnp
import numpy as np
import pytest

from profilefit.fitting.solver import CONVERGED, MAX_STEPS, Solution, least_squares, solve_batch

X = np.linspace(0, 3, 20)


def decay(p, data):
    return p[0] * jnp.exp(-p[1] * data["x"]) - data["y"]


def problem(amplitude, rate, noise=0.0, seed=0):
    y = amplitude * np.exp(-rate * X) + noise * np.random.default_rng(seed).standard_normal(X.size)
    return {"x": X, "y": y}


def test_known_parameters_come_back():
    found = least_squares(decay, [1.0, 1.0], problem(2.0, 1.7))
    np.testing.assert_allclose(found.parameters, [2.0, 1.7], rtol=1e-9)  # the solver's own tolerance is 1e-10
    assert found.converged
    assert found.result == CONVERGED == "converged"
    assert found.cost < 1e-18
    assert 0 < found.steps < 50


def test_scaling_does_not_matter():
    """Constants that differ by ten decades are found as well as equal ones: they are scaled by their start."""
    data = {"x": X * 1e5, "y": 2e-5 * np.exp(-1.7 * X)}
    found = least_squares(decay, [1e-5, 1e-5], data)
    np.testing.assert_allclose(found.parameters, [2e-5, 1.7e-5], rtol=1e-6)


def test_a_start_at_zero_can_move():
    found = least_squares(decay, [0.0, 0.0], problem(2.0, 1.7))
    np.testing.assert_allclose(found.parameters, [2.0, 1.7], rtol=1e-8)


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


@pytest.mark.slow
def test_a_batch_is_its_singles():
    cases = [problem(2.0, 1.7, 0.01, 1), problem(0.5, 0.3, 0.01, 2), problem(9.0, 4.0, 0.01, 3)]
    starts = [[1.0, 1.0], [1.0, 0.5], [5.0, 2.0]]
    stacked = {key: np.stack([case[key] for case in cases]) for key in ("x", "y")}
    together = solve_batch(decay, starts, stacked)
    for one, start, case in zip(together, starts, cases, strict=True):
        alone = least_squares(decay, start, case)
        np.testing.assert_allclose(one.parameters, alone.parameters, rtol=1e-8)
        assert one.steps == alone.steps
        assert one.converged


def test_double_precision_whatever_the_caller_set():
    found = least_squares(decay, np.ones(2, np.float32), problem(2.0, 1.7, 1e-10))
    assert found.parameters.dtype == found.residuals.dtype == np.float64
    assert 1e-11 < np.sqrt(found.cost / X.size) < 1e-9  # float32 residuals would stop at 1e-8


def test_no_minimum_is_a_result():
    """exp(-p) falls for ever."""
    found = least_squares(lambda p, _: jnp.exp(-p), [1.0], None)
    assert not found.converged
    assert (
        found.result
        == f"no convergence in {MAX_STEPS} steps: constants trade against each other; fix one or widen the range"
    )
    assert found.steps == MAX_STEPS


@pytest.mark.slow
def test_not_a_number_is_a_result():
    found = least_squares(lambda p, d: jnp.log(p - d), [1.0], np.array([2.0]))
    assert not found.converged
    assert found.result.startswith("the residual is not finite there: start nearer to the data")


def test_one_bad_problem_leaves_the_others_of_its_batch_alone():
    good, bad = solve_batch(lambda p, d: jnp.log(p) - d, [[1.0], [-1.0]], np.array([[0.5], [0.5]]))
    assert good.converged
    assert good.parameters[0] == pytest.approx(np.exp(0.5), rel=1e-8)
    assert "not finite" in bad.result


def solution(jacobian):
    return Solution(np.zeros(2), np.array([3.0, 4.0]), np.asarray(jacobian, float), 1, CONVERGED)


@pytest.mark.parametrize("scale", [1.0, 1e8])
def test_condition_number_of_a_known_jacobian(scale):
    """Unit columns with cosine c have singular values sqrt(1 + c), sqrt(1 - c), however long the columns are."""
    c = 0.6
    jacobian = np.array([[1.0, scale * c], [0.0, scale * np.sqrt(1 - c**2)]])
    assert solution(jacobian).condition_number == pytest.approx(2.0, rel=1e-12)


def test_condition_number_of_a_blind_constant_is_infinite():
    assert solution([[1.0, 0.0], [1.0, 0.0]]).condition_number > 1e15


def test_cost_is_the_sum_of_squares():
    assert solution(np.eye(2)).cost == 25.0


@pytest.mark.slow
def test_a_search_that_stalls_at_the_edge_of_its_domain_has_not_converged():
    """The optimum of sqrt(x) = -1 lies beyond x = 0, where the residual is not finite."""

    def residual(p, data):
        return jnp.array([jnp.sqrt(p[0]) + 1.0, 0.1 * p[0]]) + 0.0 * data

    assert "stalled beside an optimum" in least_squares(residual, [1.0], np.zeros(2)).result

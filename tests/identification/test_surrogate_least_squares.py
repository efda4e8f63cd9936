"""The bounded Levenberg-Marquardt search against closed forms and scipy."""

from __future__ import annotations

import numpy as np
import scipy.optimize
from hypothesis import given, settings
from hypothesis import strategies as st

from identification.surrogate.least_squares import Minimum, NormalEquations, minimise


def search(residuals, jacobian, start, lower, upper, iterations=200, largest=10.0) -> Minimum:
    """`jacobian` is d residual / d x."""

    def cost(x):
        return float(residuals(x) @ residuals(x))

    def normal_equations(x):
        r, J = residuals(x), jacobian(x)
        return NormalEquations(float(r @ r), -J.T @ r, J.T @ J)

    bounds = (np.asarray(lower, float), np.asarray(upper, float))
    return minimise(cost, normal_equations, np.asarray(start, float), bounds, iterations, 1e-12, largest)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000))
def test_linear_least_squares_in_a_box(seed: int) -> None:
    generator = np.random.default_rng(seed)
    J, target = generator.normal(size=(7, 4)), 3.0 * generator.normal(size=7)
    oracle = scipy.optimize.lsq_linear(J, target, bounds=(-np.ones(4), np.ones(4)), tol=1e-14)
    found = search(lambda x: J @ x - target, lambda x: J, np.zeros(4), -np.ones(4), np.ones(4))
    np.testing.assert_allclose(found.x, oracle.x, atol=1e-5)
    assert np.all(np.abs(found.x) <= 1.0)


def rosenbrock(x):
    return np.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]])


def rosenbrock_jacobian(x):
    return np.array([[-20.0 * x[0], 10.0], [-1.0, 0.0]])


def test_curved_valley() -> None:
    found = search(rosenbrock, rosenbrock_jacobian, [-1.2, 1.0], [-5, -5], [5, 5])
    np.testing.assert_allclose(found.x, [1.0, 1.0], atol=1e-8)
    assert found.converged
    costs = [step.cost for step in found.history]
    assert costs == sorted(costs, reverse=True)


def test_curved_valley_cut_by_a_bound() -> None:
    found = search(rosenbrock, rosenbrock_jacobian, [-1.2, 1.0], [-5, -5], [0.5, 5])
    np.testing.assert_allclose(found.x, [0.5, 0.25], atol=1e-8)


def test_steps_are_cut() -> None:
    found = search(lambda x: x - 100.0, lambda x: np.eye(1), [0.0], [-1e3], [1e3], largest=1.5)
    assert max(step.step for step in found.history) <= 1.5
    np.testing.assert_allclose(found.x, [100.0], atol=1e-6)


def test_the_iteration_limit_is_reported() -> None:
    found = search(rosenbrock, rosenbrock_jacobian, [-1.2, 1.0], [-5, -5], [5, 5], iterations=2)
    assert not found.converged and len(found.history) == 3


def test_a_region_without_a_cost_is_not_entered() -> None:
    def residuals(x):
        return np.array([x[0] - 2.0]) if x[0] < 1.0 else np.array([np.inf])

    found = search(residuals, lambda x: np.eye(1), [0.0], [-5], [5])
    assert 0.5 < found.x[0] < 1.0 and np.isfinite(found.cost)


def test_a_parameter_without_effect_does_not_stop_the_others() -> None:
    J = np.array([[2.0, 0.0], [1.0, 0.0]])
    found = search(lambda x: J @ x - np.array([4.0, 2.0]), lambda x: J, [0.0, 0.3], [-5, -5], [5, 5])
    np.testing.assert_allclose(found.x, [2.0, 0.3], atol=1e-8)


def test_coordinates_that_move_nothing_stay_where_they_are() -> None:
    flat = NormalEquations(2.0, np.zeros(3), np.zeros((3, 3)))
    bounds = np.full(3, -1.0), np.full(3, 1.0)
    with np.errstate(all="raise"):
        found = minimise(lambda x: 2.0, lambda x: flat, np.full(3, 0.25), bounds, 5, 1e-6, 1.0)
    np.testing.assert_array_equal(found.x, np.full(3, 0.25))
    assert found.converged

"""The bounded Levenberg-Marquardt search against closed forms and scipy."""

from __future__ import annotations

import numpy as np
import pytest
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


def test_a_step_may_follow_a_curve() -> None:
    """Rosenbrock's valley is straight in (x, y - x^2): one Gauss-Newton step and what rounding leaves."""

    def moved(x, step):
        first = x[0] + step[0]
        return np.array([first, x[1] - x[0] ** 2 + step[1] - 2.0 * x[0] * step[0] + first**2])

    def normal_equations(x):
        r, J = rosenbrock(x), rosenbrock_jacobian(x)
        return NormalEquations(float(r @ r), -J.T @ r, J.T @ J)

    def found(way):
        box = np.full(2, -5.0), np.full(2, 5.0)
        cost = lambda x: float(rosenbrock(x) @ rosenbrock(x))  # noqa: E731
        start = np.array([-1.2, 1.0])
        return minimise(cost, normal_equations, start, box, 50, 1e-12, 10.0, damping=1e-9, moved=way)

    curved, straight = found(moved), found(np.add)
    np.testing.assert_allclose(curved.x, [1.0, 1.0], atol=1e-6)
    assert len(curved.history) < len(straight.history)
    assert curved.history[1].cost < 1e-10 and curved.history[1].trials == 1


@pytest.mark.parametrize("precision", [1.0, 0.01, 1e-4])
def test_the_search_ends_within_a_fraction_of_the_standard_errors(precision: float) -> None:
    """An exponential with noise; steps are cut, so that every one of them lowers the cost by little only."""
    time, generator = np.linspace(0.0, 3.0, 400), np.random.default_rng(7)
    data = 2.0 * np.exp(-1.3 * time) + generator.normal(scale=0.1, size=400)

    def residuals(x):
        return data - x[0] * np.exp(-x[1] * time)

    def slopes(x):
        decay = np.exp(-x[1] * time)
        return np.column_stack([decay, -x[0] * time * decay])

    def normal_equations(x):
        r, J = residuals(x), slopes(x)
        scores = (J * r[:, None]).reshape(20, 20, 2).sum(axis=1)
        return NormalEquations(float(r @ r), J.T @ r, J.T @ J, scores)

    box = np.full(2, 0.1), np.full(2, 5.0)
    best = scipy.optimize.least_squares(residuals, [2.0, 1.3], xtol=1e-15, ftol=1e-15, gtol=1e-15)
    errors = np.sqrt(np.diag(0.01 * np.linalg.inv(best.jac.T @ best.jac)))
    found = minimise(
        lambda x: float(residuals(x) @ residuals(x)),
        normal_equations,
        *(np.array([2.5, 1.6]), box, 500, 0.5, 0.01),
        precision=precision,
    )
    assert found.converged
    assert np.abs((found.x - best.x) / errors).max() < 3.0 * precision  # mean square, of two that correlate


def test_a_large_coordinate_may_move_by_its_share() -> None:
    def found(relative):
        quadratic = lambda x: NormalEquations(float(x @ x), -x, np.eye(1))  # noqa: E731
        box = np.full(1, -1e4), np.full(1, 1e4)
        return minimise(
            lambda x: float(x @ x), quadratic, np.array([1e3]), box, 2, 1e-12, 0.1, relative=relative
        )

    assert found(0.0).history[1].step == pytest.approx(0.1)
    assert found(1.0).history[1].step == pytest.approx(100.0)

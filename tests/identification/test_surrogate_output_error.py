"""Output-error tuning of a blended chain, and the arithmetic it shares with the kernel."""

from __future__ import annotations

import numpy as np
import pytest

from identification.surrogate.chain import Head
from identification.surrogate.output_error import OutputErrorFit, OutputErrorSettings, fit_output_error
from identification.surrogate.problem import (
    SIGNALS,
    NetworkParameters,
    OutputErrorProblem,
    criterion_weights,
    observation_matrix,
)
from identification.surrogate.recursion import Experiment, Observation
from identification.surrogate.structure import STRUCTURES
from identification.validity import hat_weights
from tolerances import SURROGATE_RECOVERY, SURROGATE_RECURSION

HEAD = Head(m_C=5.609, k_C=10384.8, c_C=32.0, k_E=1e5)
CHAIN7 = STRUCTURES["chain7"]
PLANT = np.array([8.0, 14.0, 25343.9, 25.0, 0.3, 1200.0, 30.0])
THETA = np.stack([PLANT, PLANT * np.array([1.15, 0.85, 0.8, 1.2, 1.1, 1.6, 0.8])])
CENTRES = (1.0, 2.0)
ROWS = 6000


def excitation(rows: int = ROWS, seed: int = 3) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """eta, M_pa - M_0 and weights of two models on a journey from 0.8 to 2.2 m."""
    generator = np.random.default_rng(seed)
    noise = np.convolve(generator.normal(scale=8e-3, size=rows + 40), np.full(40, 1 / 40.0), "valid")[:rows]
    eta = np.linspace(0.8, 2.2, rows) + noise
    torque = np.repeat(generator.uniform(-75.0, 75.0, rows // 100), 100)[:, None]
    return eta, torque, hat_weights(eta, CENTRES, clamped=True)


def problem(theta: np.ndarray = THETA, noise: float = 0.0, experiments: int = 1) -> OutputErrorProblem:
    """Data of the chain itself; noise 1: 1e-5 m on positions, 1e-3 m/s on velocities, forces from them."""
    observation = Observation(observation_matrix(HEAD), np.ones(6))
    found, signals = [], []
    for index in range(experiments):
        inputs = excitation(seed=3 + index)
        empty = Experiment(*inputs, np.zeros((ROWS, 6)))
        z = OutputErrorProblem(CHAIN7, HEAD, 1e-3, [empty], observation).simulate(
            NetworkParameters(theta), empty
        )
        error = np.random.default_rng(9 + index).normal(size=(ROWS, 4)) * [1e-5, 1e-3, 1e-5, 1e-3] * noise
        z = z + error @ observation.matrix[:, :4].T
        signals.append(z)
        found.append(Experiment(*inputs, z))
    weight = criterion_weights(np.concatenate(signals), 1.0)
    return OutputErrorProblem(CHAIN7, HEAD, 1e-3, found, Observation(observation.matrix, weight))


SETTINGS = OutputErrorSettings(iterations=60, tolerance=1e-10)


def fitted(
    case: OutputErrorProblem, theta: np.ndarray, settings: OutputErrorSettings = SETTINGS
) -> OutputErrorFit:
    return fit_output_error(case, NetworkParameters(theta), settings)


def cost(case: OutputErrorProblem, search: np.ndarray) -> float:
    return case.cost(case.from_search(search, NetworkParameters(THETA)))


def test_two_blended_chains_are_recovered_from_noise_free_data() -> None:
    start = THETA * np.array([1.05, 0.95, 1.06, 0.8, 0.96, 0.8, 1.2])
    fit = fitted(problem(), start)
    np.testing.assert_allclose(fit.theta, THETA, rtol=SURROGATE_RECOVERY)
    assert fit.cost_after < 1e-12 * fit.cost_before
    costs = [step.cost for step in fit.history]
    assert costs == sorted(costs, reverse=True)


def test_noise_moves_the_parameters_a_little() -> None:
    fit = fitted(problem(noise=1.0), THETA * 1.02)
    names = CHAIN7.names
    relative = np.abs(fit.theta / THETA - 1.0)
    # Six seconds of data and weak wall forces: masses, k_L and r_M are well determined, k_W and dampers less.
    for name, limit in (("m_H", 5e-3), ("m_M", 1e-2), ("k_L", 5e-3), ("r_M", 1e-2), ("c_L", 0.05)):
        assert relative[:, names.index(name)].max() < limit, name
    assert fit.converged and fit.cost_after < fit.cost_before


def test_the_start_is_kept_where_nothing_is_better() -> None:
    fit = fitted(problem(), THETA)
    np.testing.assert_allclose(fit.theta, THETA, rtol=1e-12)
    assert fit.cost_after <= fit.cost_before


def test_the_bounds_hold_when_the_plant_lies_outside() -> None:
    outside = THETA * np.array([0.45, 1, 1, 1, 3.0, 1, 1])  # m_H 3.6 and 4.1 kg, r_M 0.9 and 1.0 m
    fit = fitted(problem(outside), THETA, OutputErrorSettings(iterations=25, tolerance=1e-5))
    lower = np.array([parameter.lower for parameter in CHAIN7.parameters])
    upper = np.array([parameter.upper for parameter in CHAIN7.parameters])
    assert np.all((fit.theta >= lower) & (fit.theta <= upper))
    for row in fit.theta:
        flags = CHAIN7.at_bound(row)
        assert flags["m_H"] == "lower" and flags["r_M"] == "upper"
    assert fit.cost_after < fit.cost_before


def test_gradient_against_differences_of_the_cost() -> None:
    case = problem(experiments=2)
    search = CHAIN7.to_search(THETA * np.array([1.05, 0.97, 1.02, 1.3, 0.9, 1.5, 0.7])).ravel()
    normal = case.normal_equations(case.from_search(search, NetworkParameters(THETA)))
    assert normal.cost == pytest.approx(cost(case, search), rel=1e-12)
    scale = np.sqrt(np.diag(normal.gram) * normal.cost)
    for index, step in enumerate(1e-5 * np.eye(search.size)):
        slope = (cost(case, search + step) - cost(case, search - step)) / 2e-5
        assert abs(-0.5 * slope - normal.gradient[index]) < 1e-7 * scale[index], index


def test_the_gauss_newton_matrix_against_differences_of_the_signals() -> None:
    case = problem()
    search = CHAIN7.to_search(THETA * 1.1).ravel()

    def signals(x: np.ndarray) -> np.ndarray:
        z = case.simulate(case.from_search(x, NetworkParameters(THETA)), case.experiments[0])
        return (np.sqrt(case.observation.weight) * z).ravel()

    steps = 1e-5 * np.eye(search.size)
    jacobian = np.stack([(signals(search + s) - signals(search - s)) / 2e-5 for s in steps], axis=-1)
    gram = jacobian.T @ jacobian
    scale = np.sqrt(np.outer(np.diag(gram), np.diag(gram)))
    assert np.max(np.abs(case.normal_equations(NetworkParameters(THETA * 1.1)).gram - gram) / scale) < 1e-6


def test_several_experiments_add_up() -> None:
    both = problem(experiments=2)
    here = NetworkParameters(THETA * 1.1)
    single = [OutputErrorProblem(CHAIN7, HEAD, 1e-3, [one], both.observation) for one in both.experiments]
    parts = [one.normal_equations(here) for one in single]
    total = both.normal_equations(here)
    assert total.cost == pytest.approx(parts[0].cost + parts[1].cost, rel=1e-13)
    np.testing.assert_allclose(total.gradient, parts[0].gradient + parts[1].gradient, rtol=1e-12)
    np.testing.assert_allclose(total.gram, parts[0].gram + parts[1].gram, rtol=1e-12)


def test_the_signals_are_the_states_and_the_forces() -> None:
    state = np.array([0.011, -0.3, 0.017, 0.2, 5.0, 7.0])
    seen = dict(zip(SIGNALS, observation_matrix(HEAD) @ state, strict=True))
    assert seen["zeta_dot"] == 0.2 and seen["xi"] == 0.011
    assert seen["F_H"] == pytest.approx(10384.8 * 0.006 + 32.0 * 0.5, rel=SURROGATE_RECURSION)
    assert seen["F_p"] == pytest.approx(1100.0, rel=SURROGATE_RECURSION)  # less k_E eta, which no state moves


def test_weights_balance_kinds_of_signals() -> None:
    generator = np.random.default_rng(1)
    spread = np.array([2e-3, 0.1, 4e-3, 0.3, 150.0, 250.0])
    deviations = 7.0 + generator.normal(size=(20_000, 6)) * spread
    weight = criterion_weights(deviations, contact_force_weight=3.0)
    expected = np.array([3e-3, 0.2, 3e-3, 0.2, 200.0, 200.0]) ** -2.0 * [1, 1, 1, 1, 1, 3]
    np.testing.assert_allclose(weight, expected, rtol=0.03)
    assert weight[0] == weight[2] and weight[1] == weight[3]

"""Standard errors against the scatter over noise, Fisher information against differences and by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.surrogate.certainty import (
    CLOSE,
    LARGEST_CONDITION,
    Certainty,
    certainty,
    coupled_information,
    partial_information,
    told_apart,
)
from identification.surrogate.chain import Head
from identification.surrogate.output_error import OutputErrorSettings, fit_output_error
from identification.surrogate.problem import (
    NetworkParameters,
    OutputErrorProblem,
    criterion_weights,
    observation_matrix,
)
from identification.surrogate.recursion import Experiment, Observation, run
from identification.surrogate.structure import STRUCTURES
from identification.validity import hat_weights
from tolerances import SCATTER, SURROGATE_SENSITIVITY

HEAD = Head(m_C=5.609, k_C=10384.8, c_C=32.0, k_E=1e5)
CHAIN = STRUCTURES["chain8"]
THETA = np.array(
    [[8.0, 14.0, 25000.0, 25.0, 3.3, 0.1, 1200.0, 30.0], [7.0, 10.0, 21000.0, 31.0, 3.0, -0.1, 900.0, 24.0]]
)
ROWS, SEEDS = 9000, 50
NOISE = np.array([1e-5, 1e-3, 1e-5, 1e-3])


def problem(
    errors: np.ndarray | None = None, theta: np.ndarray = THETA, rows: int = ROWS
) -> OutputErrorProblem:
    """Data of two blended chains on a journey, with errors of positions and velocities; forces from them."""
    random = np.random.default_rng(3)
    noise = np.convolve(random.normal(scale=8e-3, size=rows + 39), np.full(40, 1 / 40.0), "valid")
    eta = np.linspace(0.8, 2.2, rows) + noise
    torque = np.repeat(random.uniform(-75.0, 75.0, rows // 100), 100)[:, None]
    observation = Observation(observation_matrix(HEAD), np.ones(6))
    empty = Experiment(eta, torque, hat_weights(eta, (1.0, 2.0), clamped=True), np.zeros((rows, 6)))
    case = OutputErrorProblem(CHAIN, HEAD, 1e-3, [empty], observation)
    z = case.simulate(NetworkParameters(theta), empty)
    weight = criterion_weights(z, 1.0)
    if errors is not None:
        z = z + errors @ observation.matrix[:, :4].T
    return replace(
        case, experiments=[replace(empty, target=z)], observation=Observation(observation.matrix, weight)
    )


def errors_of(seed: int, correlated: bool) -> np.ndarray:
    """White noise, or noise with a time constant of 50 ms and the same size."""
    random = np.random.default_rng((7, seed))
    white = random.standard_normal((ROWS, 4))
    if not correlated:
        return white * NOISE
    pole = np.exp(-1.0 / 50.0)
    found = np.zeros_like(white)
    for k in range(1, ROWS):
        found[k] = pole * found[k - 1] + np.sqrt(1.0 - pole**2) * white[k]
    return found * NOISE


def scattered(correlated: bool) -> tuple[np.ndarray, list[Certainty]]:
    """Estimates of every seed, (seeds, 2, 8), and how sure each says it is."""
    estimates, told = [], []
    settings = OutputErrorSettings(iterations=20, tolerance=1e-8)
    for seed in range(SEEDS):
        case = problem(errors_of(seed, correlated))
        fit = fit_output_error(case, NetworkParameters(THETA), settings)
        estimates.append(fit.theta)
        if seed < 8:
            told.append(certainty(case, fit.parameters))
    return np.array(estimates), told


@pytest.mark.parametrize("correlated", [False, True])
def test_standard_errors_are_the_scatter_over_noise(correlated: bool) -> None:
    estimates, told = scattered(correlated)
    scatter = estimates.std(axis=0, ddof=1)
    robust = np.median([one.standard_errors for one in told], axis=0)
    white = np.median([one.white_errors for one in told], axis=0)
    assert np.abs(np.log(robust / scatter)).max() < SCATTER
    if correlated:
        assert np.median(scatter / white) > 2.0  # the textbook formula is far too sure of itself
    else:
        assert np.abs(np.log(white / scatter)).max() < SCATTER
    assert (np.abs(estimates - THETA) / robust).max() < 4.5  # of 800 numbers
    correlations = np.array([np.corrcoef(estimates[:, k].T) for k in range(2)])
    median = np.median([one.correlations for one in told], axis=0)
    assert np.abs(median - correlations).max() < 0.45  # 50 seeds know a correlation to 0.14


def test_the_coupled_information_against_differences_of_the_states() -> None:
    case, here = problem(rows=1200), NetworkParameters(THETA)
    own = Observation(np.eye(6), np.ones(6))

    def states(theta: np.ndarray) -> np.ndarray:
        return run(
            case.models(NetworkParameters(theta), False), case.experiments[0], own, simulate=True
        ).simulated

    spread = states(THETA).std(axis=0)
    found = coupled_information(case, here)
    for k in range(2):
        for p in range(len(CHAIN.names)):
            step = np.zeros_like(THETA)
            step[k, p] = 1e-5 * abs(THETA[k, p])
            slope = (states(THETA + step) - states(THETA - step)) / (2.0 * step[k, p])
            expected = (slope**2).sum(axis=0) / spread**2
            np.testing.assert_allclose(found[:, k, p], expected, rtol=1e-5, atol=1e-9 * expected.max())


def test_the_partial_information_by_hand() -> None:
    """One local model: psi = dA x~ + dB u with x~ rebased to the height at hand (eq. 5.2)."""
    case, here = problem(rows=600), NetworkParameters(THETA)
    experiment = case.experiments[0]
    alone = replace(experiment, blend=np.tile([1.0, 0.0], (600, 1)))
    case = replace(case, experiments=[alone])
    own = Observation(np.eye(6), np.ones(6))
    states = run(case.models(here, False), alone, own, simulate=True).simulated
    local = CHAIN.discretise(THETA[0], HEAD, 1e-3)
    expected = np.zeros((6, len(CHAIN.names)))
    for k in range(1, 600):
        x = states[k] - local.g * (alone.scheduling[k] - alone.scheduling[k - 1])
        expected += (local.dA @ x + local.dB[:, :, 1] * alone.inputs[k, 0]).T ** 2
    expected /= states.std(axis=0)[:, None] ** 2
    found = partial_information(case, here)
    np.testing.assert_allclose(found[:, 0], expected, rtol=1e-7, atol=SURROGATE_SENSITIVITY * expected.max())
    assert not found[:, 1].any()  # the other model never counts


def test_what_cannot_be_told_apart_is_named_and_gets_no_errors() -> None:
    random = np.random.default_rng(5)
    J = random.standard_normal((500, 4)) * [1.0, 1e-6, 1e3, 1.0]  # sizes alone are no trouble
    free = np.ones(4, dtype=bool)
    condition, remarks = told_apart(J.T @ J, ("a", "b", "c", "d"), free)
    assert condition < 2.0 and remarks == ()
    J[:, 3] = 2.0 * J[:, 0] + 1e-7 * random.standard_normal(500)
    condition, remarks = told_apart(J.T @ J, ("a", "b", "c", "d"), free)
    assert condition > LARGEST_CONDITION
    assert len(remarks) == 1 and remarks[0].startswith("a, d can move together")
    free[3] = False
    assert told_apart(J.T @ J, ("a", "b", "c", "d"), free)[1] == ()
    J[:, 1] = 0.0
    condition, remarks = told_apart(J.T @ J, ("a", "b", "c", "d"), free)
    assert condition == np.inf and remarks == ("b has no influence on these data",)


def test_data_that_excite_too_little_give_no_errors_and_say_why() -> None:
    """Without a torque there is no telling its levers."""
    case = problem(errors_of(1, False))
    still = replace(case.experiments[0], inputs=np.zeros((ROWS, 1)))
    told = certainty(replace(case, experiments=[still]), NetworkParameters(THETA))
    assert np.isnan(told.standard_errors).all() and np.isnan(told.white_errors).all()
    assert any(remark.startswith("b_M[1] has no influence") for remark in told.remarks)


def test_a_parameter_at_a_bound_has_no_standard_error_and_is_named() -> None:
    theta = THETA.copy()
    theta[1, CHAIN.names.index("m_H")] = CHAIN.parameters[0].lower
    told = certainty(problem(errors_of(1, False)), NetworkParameters(theta))
    assert (
        np.isnan(told.standard_errors[1, 0]) and np.isfinite(np.delete(told.standard_errors.ravel(), 8)).all()
    )
    assert "m_H[2] stands at a bound: no standard error" in told.remarks


def test_a_parameter_that_cannot_be_told_from_zero_is_named() -> None:
    theta = THETA.copy()
    theta[0, CHAIN.names.index("k_W")] = 0.05
    told = certainty(problem(errors_of(1, False), theta), NetworkParameters(theta))
    (remark,) = told.remarks
    assert remark.startswith("k_W[1] = 0.05 +- ") and remark.endswith("N/m cannot be told from zero")


def test_pairs_of_different_local_models_are_named_too() -> None:
    """Two models that nearly always count alike are hard to tell apart."""
    case, here = problem(), NetworkParameters(THETA)
    eta = case.experiments[0].scheduling
    share = 0.5 + 0.1 * (eta - eta.mean())
    alike = replace(case.experiments[0], blend=np.stack([share, 1.0 - share], axis=1))
    motion = case.simulate(here, alike)
    seen = replace(alike, target=motion + errors_of(1, False) @ case.observation.matrix[:, :4].T)
    told = certainty(replace(case, experiments=[seen]), here)
    found = {(one, other): value for one, other, value in told.close}
    assert found["k_L[1]", "k_L[2]"] < -CLOSE
    for k in range(2):
        for row, column in zip(*np.triu_indices(len(CHAIN.names), 1), strict=True):
            pair = f"{CHAIN.names[row]}[{k + 1}]", f"{CHAIN.names[column]}[{k + 1}]"
            assert (abs(told.correlations[k, row, column]) >= CLOSE) == (pair in found)


def test_a_network_that_runs_away_is_told_and_nothing_else() -> None:
    theta = THETA.copy()
    theta[:, CHAIN.names.index("c_W")] = -1e4
    told = certainty(problem(errors_of(1, False)), NetworkParameters(theta))
    assert np.isnan(told.standard_errors).all() and told.condition == np.inf and not told.close
    assert len(told.remarks) == 1 and "runs away" in told.remarks[0]


def test_a_parameter_next_to_its_bound_counts_as_one_that_stands_there() -> None:
    theta = THETA.copy()
    theta[1, 0] = CHAIN.parameters[0].lower * (1.0 + 1e-9)
    told = certainty(problem(errors_of(1, False)), NetworkParameters(theta))
    assert (
        np.isnan(told.standard_errors[1, 0]) and "m_H[2] stands at a bound: no standard error" in told.remarks
    )


def test_the_partial_information_has_the_pattern_of_table_5_2() -> None:
    """chain7: what the thesis shows with an exponent is many decades above what it shows with a dash."""
    chain = STRUCTURES["chain7"]
    case = replace(problem(rows=2000), structure=chain)
    theta = np.array(
        [chain.from_coefficients(dict(zip(CHAIN.names, row, strict=True)), HEAD) for row in THETA]
    )
    found = partial_information(case, NetworkParameters(theta)).sum(axis=1)
    told = np.zeros((6, 7), dtype=bool)  # zeta_dot: m_H, k_L, c_L; delta_M_dot: all but m_H
    told[3, [0, 2, 3]] = told[5, 1:] = True
    for column, where in zip(found.T, told.T, strict=True):
        assert column[where].min() > 100.0 * column[~where].max()


def test_sums_over_blocks_are_the_gradient() -> None:
    case = problem(errors_of(1, True))
    models = case.models(NetworkParameters(THETA), True)
    whole = run(models, case.experiments[0], case.observation, block_rows=450)
    assert whole.blocks.shape == (20, models.columns)
    size = np.abs(whole.blocks).sum(axis=0)
    assert (np.abs(whole.blocks.sum(axis=0) - whole.gradient) <= 1e-13 * size).all()
    odd = run(models, case.experiments[0], case.observation, block_rows=4000)
    assert odd.blocks.shape == (2, models.columns)

"""The compiled output-error recursion against a dense simulation in numpy, written from the equations."""

from __future__ import annotations

import ctypes
from dataclasses import replace

import numpy as np
import pytest

from fmu_builder.errors import IdentificationError
from identification.surrogate.recursion import BlendedModels, Experiment, Observation, Pass, run
from tolerances import SURROGATE_RECURSION, SURROGATE_SENSITIVITY

M, N_STATES, OTHERS, SIGNALS, P, ROWS = 3, 5, 2, 4, 2, 160


def network(parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Matrices of M models, each a smooth function of its own P parameters, (M, P), real or complex."""
    generator = np.random.default_rng(11)
    A, A1, A2 = generator.normal(size=(3, M, N_STATES, N_STATES))
    B, B1, B2 = generator.normal(size=(3, M, N_STATES, OTHERS))
    g, g1, g2 = generator.normal(size=(3, M, N_STATES))
    first, second = parameters[:, 0], parameters[:, 1]
    blend = [
        base
        + one * first.reshape(-1, *[1] * (base.ndim - 1)) ** 2
        + two * np.sin(second).reshape(-1, *[1] * (base.ndim - 1))
        for base, one, two in (
            (0.25 * A, 0.02 * A1, 0.03 * A2),
            (B, 0.5 * B1, 0.3 * B2),
            (g, 0.5 * g1, 0.3 * g2),
        )
    ]
    return blend[0], blend[1], blend[2]


PARAMETERS = np.random.default_rng(2).uniform(0.3, 0.9, size=(M, P))


def models(parameters: np.ndarray = PARAMETERS) -> BlendedModels:
    slopes = []
    for index in range(P):
        moved = parameters.astype(complex)
        moved[:, index] += 1e-30j
        slopes.append([matrix.imag / 1e-30 for matrix in network(moved)])
    dA, dB, dg = (np.stack([slope[kind] for slope in slopes], axis=-1) for kind in range(3))
    return BlendedModels(*network(parameters), dA, dB, dg)


def experiment(seed: int = 7, hats: bool = True) -> Experiment:
    generator = np.random.default_rng(seed)
    scheduling = 1.5 + np.cumsum(generator.normal(scale=0.05, size=ROWS))
    centres = np.array([1.2, 1.5, 1.9])
    if hats:
        weights = np.stack([np.interp(scheduling, centres, row) for row in np.eye(M)], axis=-1)
    else:
        weights = np.stack(
            [  # Lagrange: negative and above one, sum one
                np.prod([(scheduling - c) / (centre - c) for c in centres if c != centre], axis=0)
                for centre in centres
            ],
            axis=-1,
        )
        weights = 0.1 * weights + 0.3
    inputs = generator.normal(size=(ROWS, OTHERS))
    return Experiment(scheduling, inputs, weights, generator.normal(size=(ROWS, SIGNALS)))


OBSERVATION = Observation(
    np.random.default_rng(4).normal(size=(SIGNALS, N_STATES)), np.array([1.0, 0.2, 5.0, 2.5])
)


def dense(parameters: np.ndarray, data: Experiment) -> np.ndarray:
    """z, (N, q): row by row from the equations; works with complex parameters."""
    A, B, g = network(parameters)
    w, e, u = data.blend, data.scheduling, data.inputs
    mix = [np.einsum("m,mrc->rc", w[k], A) for k in range(ROWS)]
    drive = [np.einsum("m,mrc->rc", w[k], B) for k in range(ROWS)]
    x = np.linalg.solve(np.eye(N_STATES) - mix[0], drive[0] @ u[0])
    rows = [OBSERVATION.matrix @ x]
    for k in range(ROWS - 1):
        before = max(k - 1, 0)
        x = x - 0.5 * ((w[k] + w[before]) @ g) * (e[k] - e[before])
        x = mix[k] @ x + drive[k] @ u[k]
        rows.append(OBSERVATION.matrix @ x)
    return np.array(rows)


@pytest.mark.parametrize("hats", [True, False])
def test_simulation_and_cost(hats: bool) -> None:
    data = experiment(hats=hats)
    oracle = dense(PARAMETERS, data)
    found = run(models(), data, OBSERVATION, simulate=True)
    size = np.abs(oracle).max()
    np.testing.assert_allclose(found.simulated, oracle, rtol=0, atol=SURROGATE_RECURSION * size)
    cost = np.sum(OBSERVATION.weight * (data.target - oracle) ** 2)
    assert found.cost == pytest.approx(cost, rel=1e-12)


@pytest.mark.parametrize("hats", [True, False])
def test_gradient_and_gauss_newton_matrix(hats: bool) -> None:
    data = experiment(hats=hats)
    columns = []
    for model in range(M):
        for index in range(P):
            moved = PARAMETERS.astype(complex)
            moved[model, index] += 1e-30j
            columns.append(dense(moved, data).imag / 1e-30)
    jacobian = np.stack(columns, axis=-1)  # (N, q, M P), exact
    residual = data.target - dense(PARAMETERS, data)
    gradient = np.einsum("kqj,q,kq->j", jacobian, OBSERVATION.weight, residual)
    gram = np.einsum("kqi,q,kqj->ij", jacobian, OBSERVATION.weight, jacobian)
    found = run(models(), data, OBSERVATION, sensitivities=True)
    np.testing.assert_allclose(
        found.gradient, gradient, rtol=0, atol=SURROGATE_SENSITIVITY * np.abs(gradient).max()
    )
    np.testing.assert_allclose(found.gram, gram, rtol=0, atol=SURROGATE_SENSITIVITY * np.abs(gram).max())


def test_gradient_is_the_slope_of_the_cost() -> None:
    data = experiment()
    found = run(models(), data, OBSERVATION, sensitivities=True)
    for column in range(M * P):
        step = np.zeros((M, P))
        step.flat[column] = 1e-6
        up, down = (run(models(PARAMETERS + sign * step), data, OBSERVATION).cost for sign in (1.0, -1.0))
        scale = np.abs(found.gradient).max()
        assert abs(-(up - down) / 4e-6 - found.gradient[column]) < 1e-8 * scale


def test_one_model_is_the_plain_linear_model() -> None:
    full = models()
    single = BlendedModels(*(getattr(full, name)[:1] for name in ("A", "B", "g", "dA", "dB", "dg")))
    data = experiment()
    data = replace(data, blend=np.ones((ROWS, 1)))
    repeated = replace(data, blend=np.full((ROWS, 2), 0.5))
    twice = BlendedModels(*(getattr(full, name)[[0, 0]] for name in ("A", "B", "g", "dA", "dB", "dg")))
    one, two = (run(*pair, OBSERVATION, sensitivities=True) for pair in ((single, data), (twice, repeated)))
    assert one.cost == pytest.approx(two.cost, rel=1e-12)
    # Halves of the same parameter: their gradients add up.
    np.testing.assert_allclose(one.gradient, two.gradient[:P] + two.gradient[P:], rtol=1e-9)


def test_no_move_of_the_scheduling_input_no_rebase() -> None:
    data = replace(experiment(), scheduling=np.full(ROWS, 1.4))
    moved = run(models(), data, OBSERVATION, simulate=True)
    without_g = replace(models(), g=np.zeros((M, N_STATES)))
    np.testing.assert_array_equal(run(without_g, data, OBSERVATION, simulate=True).simulated, moved.simulated)


def test_with_and_without_sensitivities_the_cost_has_the_same_bits() -> None:
    passes: list[Pass] = [
        run(models(), experiment(), OBSERVATION, sensitivities=flag) for flag in (True, False)
    ]
    assert passes[0].cost == passes[1].cost


def test_the_factor_is_a_root_of_the_weighted_observation() -> None:
    twice = Observation(np.vstack([OBSERVATION.matrix, OBSERVATION.matrix[:2] * 3.0]), np.arange(1.0, 7.0))
    exact = twice.matrix.T @ np.diag(twice.weight) @ twice.matrix
    np.testing.assert_allclose(twice.factor.T @ twice.factor, exact, atol=1e-12 * np.abs(exact).max())
    assert twice.factor.shape == (4, N_STATES)


def test_an_unstable_model_costs_infinitely_much() -> None:
    wild = replace(models(), A=5.0 + 40.0 * models().A)
    longer = experiment()
    assert run(wild, longer, OBSERVATION).cost == np.inf


def test_arrays_that_do_not_fit_are_refused_together() -> None:
    data = replace(experiment(), scheduling=np.zeros(ROWS - 1), blend=np.full((ROWS - 2, M), 1.0 / M))
    with pytest.raises(IdentificationError) as caught:
        run(models(), data, OBSERVATION)
    assert "scheduling" in str(caught.value) and "blend" in str(caught.value)


def test_more_states_than_the_recursion_holds_are_refused() -> None:
    size = 9
    big = BlendedModels.without_slopes(np.zeros((1, size, size)), np.zeros((1, size, 1)), np.zeros((1, size)))
    data = Experiment(np.zeros(4), np.zeros((4, 1)), np.ones((4, 1)), np.zeros((4, 2)))
    with pytest.raises(IdentificationError, match="MAXIMUM_STATES"):
        run(big, data, Observation(np.eye(2, size), np.ones(2)))


def test_sizes_are_passed_as_the_c_long_of_this_platform() -> None:
    from identification.surrogate.recursion import _Problem

    assert _Problem.count.size == ctypes.sizeof(ctypes.c_long)

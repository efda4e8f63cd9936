"""The compiled recursion between nodes, with offsets and with a deviation that schedules, against numpy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fmu_builder.errors import IdentificationError
from identification.surrogate.recursion import BlendedModels, Experiment, Observation, run
from tolerances import SURROGATE_RECURSION, SURROGATE_SENSITIVITY

NODES, MODELS, STATES, INPUTS, PARAMETERS, ROWS, SIGNALS, OFFSET_OUTPUTS, COMMON = 7, 3, 5, 2, 2, 200, 4, 3, 2
GENERATOR = np.random.default_rng(0)
POSITIONS = np.array([1.0, 1.1, 1.35, 1.4, 1.62, 1.9, 2.0])
A = GENERATOR.normal(size=(NODES, STATES, STATES)) * 0.2
B = GENERATOR.normal(size=(NODES, STATES, INPUTS))
G = GENERATOR.normal(size=(NODES, STATES))
SLOPES = (
    GENERATOR.normal(size=(NODES, STATES, STATES, PARAMETERS)) * 0.02,
    GENERATOR.normal(size=(NODES, STATES, INPUTS, PARAMETERS)),
    GENERATOR.normal(size=(NODES, STATES, PARAMETERS)),
)
SHARES = GENERATOR.normal(size=(NODES, MODELS)) * 0.3 + 1.0 / MODELS
DIRECTIONS = GENERATOR.normal(size=(NODES, COMMON, PARAMETERS))
OBSERVATION = Observation(GENERATOR.normal(size=(SIGNALS, STATES)), np.array([1.0, 0.2, 5.0, 2.5]))
DATA = Experiment(
    1.5 + np.cumsum(GENERATOR.normal(scale=0.07, size=ROWS)),  # beyond both ends of the nodes
    GENERATOR.normal(size=(ROWS, INPUTS)),
    np.zeros((0, 0)),
    GENERATOR.normal(size=(ROWS, SIGNALS)),
)
DEVIATION = 2
KAPPA = 0.04


class Point:
    """Everything the recursion differentiates to: theta, u0, y0, common parameters, kappa."""

    def __init__(self, offsets: bool, kappa: float) -> None:
        generator = np.random.default_rng(8)
        self.theta = np.zeros((MODELS, PARAMETERS), dtype=complex)
        self.u0 = generator.normal(size=(MODELS, INPUTS)).astype(complex) * 0.3 * offsets
        self.y0 = generator.normal(size=(MODELS, OFFSET_OUTPUTS)).astype(complex) * 0.3 * offsets
        self.common = np.zeros(COMMON, dtype=complex)
        self.kappa = complex(kappa)


def dense(point: Point) -> np.ndarray:
    """z, (N, q), row by row from the equations; works with complex numbers."""
    moved = SHARES @ point.theta + np.einsum("kcp,c->kp", DIRECTIONS, point.common)
    dA, dB, dg = SLOPES
    mats = (A + np.einsum("krcp,kp->krc", dA, moved), B + np.einsum("krcp,kp->krc", dB, moved))
    g = G + np.einsum("krp,kp->kr", dg, moved)

    def at(r: complex) -> tuple[np.ndarray, ...]:
        inside = r if POSITIONS[0] <= r.real <= POSITIONS[-1] else complex(np.clip(r.real, 1.0, 2.0))
        cell = min(int(np.searchsorted(POSITIONS, inside.real, side="right")) - 1, NODES - 2)
        f = (inside - POSITIONS[cell]) / (POSITIONS[cell + 1] - POSITIONS[cell])
        mixed = [(1 - f) * one[cell] + f * one[cell + 1] for one in (*mats, g, SHARES)]
        return *mixed[:3], mixed[3] @ point.u0, mixed[3] @ point.y0

    e, u = DATA.scheduling, DATA.inputs
    x = np.zeros(STATES, dtype=complex)
    for _ in range(300):
        state, drive, held, u0, y0 = at(e[0] + point.kappa * x[DEVIATION])
        x = np.linalg.solve(np.eye(STATES) - state, drive @ (u[0] - u0))
    rows = []
    for k in range(ROWS):
        rows.append(OBSERVATION.matrix @ (x + np.append(y0, np.zeros(STATES - OFFSET_OUTPUTS))))
        state, drive, shift, u0, y0 = at(e[k] + point.kappa * x[DEVIATION])
        x = x - 0.5 * (shift + held) * (e[k] - e[k - 1] if k else 0.0)
        held = shift
        x = state @ x + drive @ (u[k] - u0)
    return np.array(rows)


def models(offsets: bool, kappa: float, gain_column: bool) -> BlendedModels:
    point = Point(offsets, kappa)
    return BlendedModels(
        *(A, B, G, *SLOPES, SHARES, POSITIONS, kappa, DEVIATION, DIRECTIONS, gain_column),
        input_offsets=point.u0.real if offsets else np.zeros((0, 0)),
        output_offsets=point.y0.real if offsets else np.zeros((0, 0)),
    )


def complex_steps(offsets: bool, kappa: float, gain_column: bool) -> np.ndarray:
    """The Jacobian, (N, q, columns), in the order of the recursion."""
    tiny = 1e-30

    def column(move: Callable[[Point], None]) -> np.ndarray:
        point = Point(offsets, kappa)
        move(point)
        return dense(point).imag / tiny

    def entry(name: str, *index: int) -> Callable[[Point], None]:
        def move(point: Point) -> None:
            getattr(point, name)[index] += 1j * tiny

        return move

    moves = []
    for model in range(MODELS):
        moves += [entry("theta", model, p) for p in range(PARAMETERS)]
        if offsets:
            moves += [entry("u0", model, j) for j in range(INPUTS)]
            moves += [entry("y0", model, j) for j in range(OFFSET_OUTPUTS)]
    moves += [entry("common", c) for c in range(COMMON)]
    if gain_column:
        moves.append(lambda point: setattr(point, "kappa", point.kappa + 1j * tiny))
    return np.stack([column(move) for move in moves], axis=-1)


@pytest.mark.parametrize(
    ("offsets", "kappa", "gain_column"),
    [
        (False, 0.0, False),
        (True, 0.0, False),
        (False, KAPPA, False),
        (False, KAPPA, True),
        (False, 0.0, True),
    ],
)
def test_simulation_and_every_sensitivity(offsets: bool, kappa: float, gain_column: bool) -> None:
    network = models(offsets, kappa, gain_column)
    found = run(network, DATA, OBSERVATION, sensitivities=True, simulate=True, jacobian=True)
    oracle = dense(Point(offsets, kappa)).real
    size = np.abs(oracle).max()
    np.testing.assert_allclose(found.simulated, oracle, rtol=0, atol=SURROGATE_RECURSION * size)
    jacobian = complex_steps(offsets, kappa, gain_column)
    assert found.jacobian.shape == jacobian.shape == (ROWS, SIGNALS, network.columns)
    limit = SURROGATE_SENSITIVITY * np.abs(jacobian).max(axis=(0, 1))
    assert np.all(np.abs(found.jacobian - jacobian) <= limit)
    residual = DATA.target - oracle
    gradient = np.einsum("kqj,q,kq->j", jacobian, OBSERVATION.weight, residual)
    gram = np.einsum("kqi,q,kqj->ij", jacobian, OBSERVATION.weight, jacobian)
    for mine, exact in ((found.gradient, gradient), (found.gram, gram)):
        np.testing.assert_allclose(mine, exact, rtol=0, atol=SURROGATE_SENSITIVITY * np.abs(exact).max())


def test_with_and_without_sensitivities_the_cost_has_the_same_bits() -> None:
    network = models(False, KAPPA, True)
    first, second = (run(network, DATA, OBSERVATION, sensitivities=flag) for flag in (True, False))
    assert first.cost == second.cost


def test_a_deviation_needs_nodes_and_no_offsets() -> None:
    with pytest.raises(IdentificationError, match="needs nodes"):
        run(replace(models(True, 0.0, False), gain=0.1), DATA, OBSERVATION)
    plain = BlendedModels(A[:MODELS], B[:MODELS], G[:MODELS], *(one[:MODELS] for one in SLOPES))
    blend = replace(DATA, blend=np.full((ROWS, MODELS), 1.0 / MODELS))
    with pytest.raises(IdentificationError, match="needs nodes"):
        run(replace(plain, gain_column=True), blend, OBSERVATION, sensitivities=True)
    run(plain, blend, OBSERVATION)

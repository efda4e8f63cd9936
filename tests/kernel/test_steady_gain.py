"""The exact derivative of the steady state, against complex steps through the equations written in NumPy."""

from __future__ import annotations

from typing import Any

import networks
import numpy as np
import pytest

import tolerances
from fmu_builder.kernel import Network
from fmu_builder.parameter_set import ParameterSet

Array = networks.Array
STEP = 1e-30  # of a complex step: far below the last digit of anything


def between(positions: Array, rows: Array, x: complex) -> Array:
    """Straight lines through the rows over the positions, continued by the end segments."""
    k = int(np.clip(np.searchsorted(positions, x.real, side="right") - 1, 0, len(positions) - 2))
    return rows[k] + (rows[k + 1] - rows[k]) * ((x - positions[k]) / (positions[k + 1] - positions[k]))


def weights(parameter_set: ParameterSet, position: complex) -> tuple[Array, Array]:
    """Validities, and weights of the blended models, at a complex position."""
    partition, table = parameter_set.partition, parameter_set.node_table
    low, high = partition.range
    r = low if position.real < low else high if position.real > high else position
    if table is None:
        sigma = partition.k_sigma * np.array(partition.spreads)  # type: ignore[operator]
        mu = np.exp(-0.5 * ((r - np.array(partition.centres)) / sigma) ** 2)
        return mu / mu.sum(), mu / mu.sum()
    positions = np.array(table.positions)
    return between(positions, np.array(table.weights), r), between(positions, np.eye(len(positions)), r)


def at_rest(parameter_set: ParameterSet, u: Array) -> Array:
    """Outputs, derived outputs and validities in the steady state of complex inputs."""
    gain, name = parameter_set.partition.deviation_gain, parameter_set.partition.deviation_output
    deviation: Any = 0.0
    for _ in range(200 if gain else 1):
        result, deviations = rest_of_schedule(parameter_set, u, deviation)
        deviation = deviations[parameter_set.output_names.index(name)] if name and gain else 0.0
    return result


def rest_of_schedule(parameter_set: ParameterSet, u: Array, deviation: complex) -> tuple[Array, Array]:
    kind, s = parameter_set.offsets.kind, parameter_set.scheduling_index
    local = parameter_set.blending == "output"
    models = parameter_set.local_models
    if not local and parameter_set.node_table is not None:
        models = parameter_set.node_table.models
    phi, w = weights(parameter_set, u[s] + parameter_set.partition.deviation_gain * deviation)
    u_op = np.array([signal.operating_point for signal in parameter_set.inputs])
    count = len(parameter_set.outputs)

    def mixed(name: str, share: Array) -> Any:
        return sum(one * np.array(getattr(model, name)) for one, model in zip(share, models, strict=True))

    total: Any = np.zeros(count)
    deviations: Any = np.zeros(count)
    for part, share in zip(np.eye(len(phi)), phi, strict=True) if local else [(w, 1.0)]:
        A, B, C, D = (mixed(letter, part) for letter in "ABCD")
        x0, u0, y0 = (mixed(n, part) for n in ("x0", "u0", "y0")) if kind == "affine" else (0.0, u_op, 0.0)
        drive, direct = u - u0, u - u0
        if kind in ("low_pass", "scheduled_equilibrium"):
            drive = np.where(np.arange(len(u)) == s, 0.0, drive)
        if kind == "low_pass":
            direct = drive
        x = np.linalg.solve(np.eye(len(A)) - A, B @ drive - A @ (x0 + np.zeros(len(A))))
        deviations = deviations + share * (C @ (x - x0))
        total = total + share * (C @ (x - x0) + y0 + D @ direct)
    static_map = parameter_set.offsets.static_map
    if static_map is not None:
        total = total + between(np.array(static_map.positions), np.array(static_map.values), u[s])
    elif kind == "none":
        total = total + np.array([signal.operating_point for signal in parameter_set.outputs])
    derived = [50000.0 * (total[2] - u[1]), total[0] + 2.5 * total[1]]
    return np.array([*total, *derived, *phi]), deviations


def check(parameter_set: ParameterSet, inputs: Array) -> None:
    kernel = Network(parameter_set)
    kernel.start(inputs)
    before = kernel.state.copy()
    shown = np.concatenate([kernel.outputs(inputs), kernel.weights])
    real = at_rest(parameter_set, inputs.astype(complex)).real
    np.testing.assert_allclose(shown, real, rtol=0, atol=tolerances.STEADY_GAIN * np.abs(real).max())
    found = kernel.steady_gain(inputs)
    steps = inputs + 1j * STEP * np.eye(len(inputs))
    expected = np.array([at_rest(parameter_set, row).imag / STEP for row in steps]).T
    assert found.shape == expected.shape
    size = np.maximum(np.abs(expected).max(axis=1, keepdims=True), 1e-6)
    assert (np.abs(found - expected) <= tolerances.STEADY_GAIN * size).all()
    assert (kernel.state == before).all()


@pytest.mark.parametrize("feedthrough", [False, True])
@pytest.mark.parametrize("variant", networks.VARIANTS, ids="-".join)
def test_it_is_the_complex_step(variant: tuple[str, str, str], feedthrough: bool) -> None:
    parameter_set = networks.network(19, *variant, feedthrough)
    for height in (0.2, 0.85, 1.3, 2.05, 2.9):  # 0.2 m and 2.9 m lie beyond the range
        check(parameter_set, np.array([1.1, height, -0.4]))


@pytest.mark.parametrize("gain", [0.02, -0.05])
@pytest.mark.parametrize("seed", range(3))
def test_a_schedule_that_follows_a_deviation_is_followed(seed: int, gain: float) -> None:
    content = networks.network(seed, "scheduled_equilibrium", "parameter", "hat").model_dump()
    content["partition"] |= {"deviation_output": "y_2", "deviation_gain": gain}
    for height in (0.85, 1.3, 2.05):
        check(ParameterSet(**content), np.array([1.35, height, 1.4]))

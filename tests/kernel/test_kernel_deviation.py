"""A schedule that follows an output's deviation: r_n = s_n + kappa (C x)_j of the last tick."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import networks
import numpy as np
import pytest

import tolerances
from fmu_builder.kernel import Network, simulate, specification, tables_header, tables_of, with_validity
from fmu_builder.parameter_set import ParameterSet

Array = networks.Array


def scheduled(seed: int, gain: float, output: str | None = "y_2", feedthrough: bool = True) -> ParameterSet:
    content = networks.network(seed, "scheduled_equilibrium", "parameter", "hat", feedthrough).model_dump()
    content["partition"] |= {"deviation_output": output, "deviation_gain": gain}
    return ParameterSet(**content)


def calm(seed: int) -> Array:
    """Inputs whose free response stays small enough for the random networks to schedule on."""
    rows = networks.inputs_of(seed, 120, 3)
    rows[:, [0, 2]] = 1.3 + 0.1 * np.array([0, 2]) + 0.1 * (rows[:, [0, 2]] - 1.5)
    return rows


@pytest.mark.parametrize("seed", range(6))
def test_without_gain_not_a_bit_changes(seed: int) -> None:
    plain = networks.network(seed, "scheduled_equilibrium", "parameter", "hat")
    rows = networks.inputs_of(seed, 120, 3)
    for output in (None, "y_1"):
        found = simulate(scheduled(seed, 0.0, output), rows)
        assert np.abs(found - simulate(plain, rows)).max() == tolerances.BITS
    expected = np.array(specification.simulate(scheduled(seed, 0.0), rows.tolist()))
    assert np.abs(simulate(plain, rows) - expected).max() == tolerances.BITS


@pytest.mark.parametrize("feedthrough", [False, True])
@pytest.mark.parametrize("gain", [0.02, -0.05])
@pytest.mark.parametrize("seed", range(4))
def test_specification_equals_kernel(seed: int, gain: float, feedthrough: bool) -> None:
    parameter_set, rows = scheduled(seed, gain, feedthrough=feedthrough), calm(seed)
    kernel = simulate(parameter_set, rows)
    expected = np.array(specification.simulate(parameter_set, rows.tolist()))
    assert np.isfinite(kernel).all() and np.abs(kernel - expected).max() == tolerances.BITS
    plain = simulate(scheduled(seed, 0.0, feedthrough=feedthrough), rows)
    assert np.abs(kernel - plain)[:, :3].max() > 1e-3
    again, oracle = Network(parameter_set), specification.Network(parameter_set)
    again.start(rows[0])
    oracle.start(rows[0].tolist())
    assert again.weights.tolist() == oracle.weights and again.states.tolist() == oracle.x[0]


def matrices(parameter_set: ParameterSet, r: float) -> dict[str, Array]:
    """Blended matrices at r, from the node table by np.interp."""
    table = parameter_set.node_table
    assert table is not None
    r = float(np.clip(r, *parameter_set.partition.range))
    hats = np.array([np.interp(r, table.positions, row) for row in np.eye(len(table.positions))])
    return {name: np.tensordot(hats, [getattr(m, name) for m in table.models], 1) for name in "ABCg"}


def by_matrices(parameter_set: ParameterSet, rows: Array) -> Array:
    """The equations of the header once more; no feedthrough."""
    static_map = parameter_set.offsets.static_map
    assert static_map is not None
    positions, values = np.array(static_map.positions), np.array(static_map.values)
    rest = np.array([signal.operating_point for signal in parameter_set.inputs])
    kappa = parameter_set.partition.deviation_gain

    def at_rest(s: float) -> Array:
        k = int(np.clip(np.searchsorted(positions, s) - 1, 0, len(positions) - 2))
        slope = (values[k + 1] - values[k]) / (positions[k + 1] - positions[k])
        return np.asarray(values[k] + slope * (s - positions[k]))

    def drive(m: dict[str, Array], u: Array) -> Array:
        return np.asarray(m["B"][:, [0, 2]] @ (u - rest)[[0, 2]])

    deviation = 0.0
    for _ in range(200):
        now = matrices(parameter_set, rows[0, 1] + kappa * deviation)
        x = np.linalg.solve(np.eye(networks.STATES) - now["A"], drive(now, rows[0]))
        deviation = float((now["C"] @ x)[2])
    found = [at_rest(rows[0, 1]) + now["C"] @ x]
    last = rows[0, 1]
    for u, _ in pairwise(rows):
        before, now = now, matrices(parameter_set, u[1] + kappa * deviation)
        x = x - 0.5 * (now["g"] + before["g"]) * (u[1] - last)
        x = now["A"] @ x + drive(now, u)
        deviation, last = float((now["C"] @ x)[2]), u[1]
        found.append(at_rest(last) + now["C"] @ x)
    return np.array(found)


@pytest.mark.parametrize("seed", range(3))
def test_matrix_products_agree_with_the_kernel(seed: int) -> None:
    parameter_set, rows = scheduled(seed, 0.02, feedthrough=False), calm(seed)
    expected, found = by_matrices(parameter_set, rows), simulate(parameter_set, rows)[:, :3]
    size = np.abs(expected).max(axis=0)
    assert (np.abs(found - expected).max(axis=0) <= tolerances.DEVIATION_SCHEDULE * size).all()


@pytest.mark.parametrize("seed", range(4))
def test_constant_inputs_leave_the_network_at_rest(seed: int) -> None:
    """The start finds the schedule that its own steady state asks for."""
    network, row = Network(scheduled(seed, 0.02)), np.array([1.1, 1.4, 1.55])
    network.start(row)
    before, outputs = network.states.copy(), network.outputs(row)
    for _ in range(50):
        network.tick(row)
    scale = np.abs(before).max() + np.abs(outputs[:3]).max() + 1.0
    assert np.abs(network.states - before).max() <= tolerances.STAYS_AT_REST * scale
    assert np.abs(network.outputs(row) - outputs)[:3].max() <= tolerances.STAYS_AT_REST * scale


def test_the_header_carries_gain_and_output() -> None:
    header = tables_header(tables_of(scheduled(1, 0.1 + 0.2)))
    assert ".deviation_gain = 0.30000000000000004," in header and ".deviation_output = 2," in header


@pytest.mark.parametrize("validity", ["gaussian", "hat"])
def test_tables_with_another_validity_are_those_of_the_other_network(validity: str) -> None:
    """What a search hands to the kernel is, byte by byte, what the parameter set would give."""
    one = networks.network(3, "scheduled_equilibrium", "parameter", validity)
    content: dict[str, Any] = networks.network(4, "scheduled_equilibrium", "parameter", validity).model_dump()
    content |= {name: getattr(one, name) for name in ("inputs", "outputs", "offsets", "derived_outputs")}
    if validity == "gaussian":
        content["local_models"] = one.local_models
    else:
        content["partition"] |= {"deviation_output": "y_0", "deviation_gain": 0.0}
        content["local_models"] = one.local_models
    other = ParameterSet(**content)
    table = other.node_table
    models = None if table is None else {
        name: np.array([getattr(model, name) for model in table.models]) for name in ("A", "B", "C", "D", "g")
    }  # fmt: skip
    weights = None if table is None else np.array(table.weights)
    found, expected = with_validity(tables_of(one), other.partition, weights, models), tables_of(other)
    assert found.numbers == expected.numbers and found.sizes == expected.sizes
    for name, array in expected.arrays.items():
        assert found.arrays[name].tobytes() == array.tobytes(), name

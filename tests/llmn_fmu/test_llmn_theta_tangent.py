"""In initialisation mode: how rest follows physical parameters, against complex steps through scipy."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import scipy.linalg
from llmn_fmu.test_llmn_theta import OUTPUTS, Opened, opened, other_theta
from theta_networks import HEAD, theta_network

import tolerances
from fmi.raw import OK, Slave
from fmu_builder.kernel import CHAINS
from fmu_builder.parameter_set import ParameterSet

STEP = 1e-30  # of a complex step: far below the last digit of anything
INPUTS = np.array([1.43, 1400.0])
SOFT = 7e4
PASSES = 8  # each is a hundredth of what the last one left
UNKNOWNS = (*OUTPUTS, *(f"validity_{k}" for k in range(1, 5)))


@pytest.fixture(scope="module", params=["chain7", "chain9", "chain10"])
def fmu(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Opened]:
    network = theta_network(request.param, gain=0.3 if request.param == "chain10" else 0.0)
    yield from opened(network, tmp_path_factory.mktemp("theta"))


def rates(given: dict[str, Any]) -> np.ndarray:
    """[A_c B_c; 0 0] of three masses, from mass, damping and stiffness matrices."""
    c = {"b_H": 0.0, "c_H": 0.0, **given}
    lever = c["b_M"] if "b_M" in c else 1.0 / c["r_M"]
    stiff = [[c["k_E"] + c["k_C"], -c["k_C"], 0], [-c["k_C"], c["k_C"] + c["k_L"], -c["k_L"]]]
    damping = [[c["c_C"], -c["c_C"], 0], [-c["c_C"], c["c_C"] + c["c_L"] + c["c_H"], -c["c_L"]]]
    stiff.append([0, -c["k_L"], c["k_L"] + c["k_W"]])
    damping.append([0, -c["c_L"], c["c_L"] + c["c_W"]])
    drive = [[c["k_E"], 0], [0, c["b_H"]], [0, lever]]
    masses = np.array([[c["m_C"]], [c["m_H"]], [c["m_M"]]])
    found = np.zeros((8, 8), complex)
    found[[0, 2, 4], [1, 3, 5]] = 1.0
    found[1:6:2, 0:6:2], found[1:6:2, 1:6:2] = -np.array(stiff) / masses, -np.array(damping) / masses
    found[1:6:2, 6:] = np.array(drive) / masses
    return found


def at_rest(network: ParameterSet, theta: np.ndarray, stiffness: complex) -> np.ndarray:
    """Outputs and validities in the steady state, for complex parameters."""
    table, partition, offsets = network.node_table, network.partition, network.offsets
    assert table is not None and offsets.static_map is not None
    positions, shares = np.array(table.positions), np.array(table.weights)
    parameters = CHAINS[network.surrogate.structure]  # type: ignore[union-attr]
    logarithmic = np.array([one.scaling == "log" for one in parameters])
    deviation: Any = 0.0
    for _ in range(PASSES if partition.deviation_gain else 1):
        r = INPUTS[0] + partition.deviation_gain * deviation
        cell = int(np.searchsorted(positions, r.real, side="right") - 1)
        f = (r - positions[cell]) / (positions[cell + 1] - positions[cell])
        A, B = np.zeros((6, 6), complex), np.zeros((6, 2), complex)
        for weight, row in ((1.0 - f, shares[cell]), (f, shares[cell + 1])):
            blended = np.where(logarithmic, np.exp(row @ np.log(theta)), row @ theta)
            named = {one.name: value for one, value in zip(parameters, blended, strict=True)}
            step = scipy.linalg.expm(rates({**HEAD, "k_E": stiffness, **named}) * network.sample_time)
            A, B = A + weight * step[:6, :6], B + weight * step[:6, 6:]
        x = np.linalg.solve(np.eye(6) - A, B[:, 1] * (INPUTS[1] - network.inputs[1].operating_point))
        deviation = x[2]
    heights, rows = np.array(offsets.static_map.positions), np.array(offsets.static_map.values)
    moved = rows[:, 0] - (rows[:, 0] - heights) * (HEAD["k_E"] / stiffness)
    k = int(np.searchsorted(moved.real, INPUTS[0], side="right") - 1)
    xi, xi_dot, zeta, zeta_dot = (
        rows[k] + (rows[k + 1] - rows[k]) * ((INPUTS[0] - moved[k]) / (moved[k + 1] - moved[k])) + x[:4]
    )
    head_force = HEAD["k_C"] * (zeta - xi) + HEAD["c_C"] * (zeta_dot - xi_dot)
    contact = stiffness * (xi - INPUTS[0])
    return np.array(
        [xi, xi_dot, zeta, zeta_dot, head_force, contact, *((1.0 - f) * shares[cell] + f * shares[cell + 1])]
    )


def column(fmu: Opened, slave: Slave, **along: float) -> np.ndarray:
    """Derivative of all unknowns along a direction."""
    count = len(UNKNOWNS)
    unknowns = (ctypes.c_uint * count)(*(fmu.references[name] for name in UNKNOWNS))
    knowns = (ctypes.c_uint * len(along))(*(fmu.references[name] for name in along))
    seed, found = (ctypes.c_double * len(along))(*along.values()), (ctypes.c_double * count)()
    sizes = ctypes.c_size_t(count), ctypes.c_size_t(len(along))
    assert slave.GetDirectionalDerivative(unknowns, sizes[0], knowns, sizes[1], seed, found) == OK
    return np.array(found)


@pytest.mark.parametrize("is_changed", [False, True], ids=["as identified", "changed"])
def test_every_parameter_has_its_exact_derivative(fmu: Opened, is_changed: bool) -> None:
    network, slave = fmu.network, fmu.new()
    names = [one.name for one in CHAINS[network.surrogate.structure]]
    theta = np.array([[row[name] for name in names] for row in network.surrogate.tuned])
    stiffness = HEAD["k_E"]
    if is_changed:
        theta, stiffness = other_theta(network), SOFT
        fmu.set_theta(slave, theta)
        fmu.set(slave, k_E=stiffness)
    fmu.set(slave, eta=INPUTS[0], M_pa=INPUTS[1])
    assert slave.EnterInitializationMode() == OK
    shown = np.array(fmu.get(slave, *UNKNOWNS))
    rest = at_rest(network, theta.astype(complex), complex(stiffness)).real
    assert np.abs(shown - rest).max() <= tolerances.STEADY_GAIN * np.abs(rest).max()
    found = [column(fmu, slave, k_E=1.0)]
    expected = [at_rest(network, theta.astype(complex), stiffness + 1j * STEP).imag / STEP]
    for model in range(len(theta)):
        for place, name in enumerate(names):
            moved = theta.astype(complex)
            moved[model, place] += 1j * STEP
            found.append(column(fmu, slave, **{f"theta_{name}_{model + 1}": 1.0}))
            expected.append(at_rest(network, moved, complex(stiffness)).imag / STEP)
    sizes = np.array([stiffness, *theta.ravel()])
    mine, exact = np.array(found).T * sizes, np.array(expected).T * sizes
    rows = np.abs(exact).max(axis=1)
    assert (rows[[0, 2, 4, 5]] > 0.0).all()
    assert (rows[6:] > 0.0).all() == (network.partition.deviation_gain > 0.0)
    # Velocities at rest change by what rounding leaves between two nodes: they are held against positions.
    error = np.abs(mine - exact).max(axis=1)
    assert (error <= tolerances.STEADY_GAIN * np.maximum(rows, rows[0])).all()
    mixed = column(fmu, slave, eta=0.4, k_E=-300.0, **{f"theta_{names[2]}_2": 7.0})
    parts = (0.4 * column(fmu, slave, eta=1.0), -300.0 * found[0], 7.0 * found[1 + len(names) + 2])
    assert np.abs(mixed - sum(parts)).max() <= tolerances.STEADY_GAIN * np.abs(parts).max()


def test_saved_and_read_values_are_left_alone(fmu: Opened) -> None:
    slave = fmu.new()
    assert slave.EnterInitializationMode() == OK
    before = fmu.get(slave), slave.to_bytes(slave.save())
    column(fmu, slave, theta_k_L_3=1.0, k_E=2.0)
    assert (fmu.get(slave), slave.to_bytes(slave.save())) == before

"""Unilateral contact: the pan-head leaves the wire, flies and touches again; nothing pulls."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from reference.motion import motion

import tolerances
from fmu_builder.errors import FmuError
from fmus.wbm import PhysicalParameters, native, parameter_sets

F_P, XI = native.OUTPUTS.index("F_p"), native.OUTPUTS.index("xi")
STATE_COLUMNS = [native.OUTPUTS.index(name) for name in native.STATES]
START = (1.5, 1310.9)
RAISED, DROPPED = (1.52, 1310.9), (1.48, 1310.9)
SAMPLE_TIME = 1e-3


def lifting(name: str, **changes: float) -> PhysicalParameters:
    return parameter_sets()[name].changed(unilateral=1.0, **changes)


def held(inputs: tuple[float, float], count: int = 301) -> np.ndarray:
    return np.tile(inputs, (count, 1))


def swing(
    parameters: PhysicalParameters, inputs: tuple[float, float], inner_step: float = 5e-4
) -> np.ndarray:
    """Rows of 0.3 s from rest on the wire at the start height, the wire having jumped to `inputs`."""
    start = native.equilibrium(parameters, START)
    return native.simulate(parameters, held(inputs), SAMPLE_TIME, inner_step, start)


def test_a_raised_wire_is_let_go_at_once_and_touched_again_soon() -> None:
    force = swing(lifting("Blow"), RAISED)[:, F_P]
    lost = force[:200] == 0.0
    assert lost[0] and not lost.all()
    touched = int(np.argmin(lost))
    assert lost[:touched].all()
    assert touched * SAMPLE_TIME == 0.067
    assert swing(parameter_sets()["Blow"], RAISED)[0, F_P] < -1900.0


def test_a_dropped_wire_throws_the_head_off_and_it_bounces() -> None:
    start = native.equilibrium(lifting("Blow"), START)
    force = native.simulate(lifting("Blow"), held(DROPPED, 2000), SAMPLE_TIME, state=start)[:, F_P]
    assert force[0] == pytest.approx(2070.0, abs=1.0)
    assert (np.diff(force > 0.0) != 0).sum() >= 5


@pytest.mark.parametrize("name", ["A", "Blow"])
@pytest.mark.parametrize("inputs", [RAISED, DROPPED])
def test_bounces_agree_with_lagrange_and_another_integrator(name: str, inputs: tuple[float, float]) -> None:
    parameters = lifting(name)
    start = native.equilibrium(parameters, START)
    expected = motion(start, inputs, parameters.vector(), np.arange(301) * SAMPLE_TIME)
    found = swing(parameters, inputs, 1e-4)[:, STATE_COLUMNS]
    gap = np.abs(found - expected).max(axis=0) / np.ptp(expected, axis=0)
    assert gap.max() <= tolerances.WBM_BOUNCE


@pytest.mark.parametrize("name", ["A", "Blow"])
@pytest.mark.parametrize("inputs", [RAISED, DROPPED])
def test_order_four_is_kept_through_lost_and_regained_contact(name: str, inputs: tuple[float, float]) -> None:
    parameters = lifting(name)
    rows = [swing(parameters, inputs, step)[:, STATE_COLUMNS] for step in (1e-3, 5e-4, 2.5e-4, 1e-5)]
    assert (np.diff(swing(parameters, inputs)[:, F_P] > 0.0) != 0).any()
    errors = [np.abs(row - rows[-1]).max() for row in rows[:-1]]
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert (np.abs(orders - 4.0) < tolerances.WBM_ORDER).all(), (errors, orders)


@settings(max_examples=100, deadline=None)
@given(
    name=st.sampled_from(tuple(parameter_sets())),
    moves=st.lists(
        st.tuples(st.floats(-0.05, 0.05), st.floats(1100.0, 1600.0), st.integers(1, 80)),
        min_size=1,
        max_size=8,
    ),
    inner_step=st.sampled_from([1e-3, 5e-4, 1e-4]),
)
def test_contact_force_is_never_negative(
    name: str, moves: list[tuple[float, float, int]], inner_step: float
) -> None:
    """And it is exactly k_E times what the pan-head presses into the wire."""
    parameters = lifting(name)
    rows = [(1.5 + rise, torque) for rise, torque, count in moves for _ in range(count)]
    inputs = np.array([START, *rows])
    found = native.simulate(parameters, inputs, SAMPLE_TIME, inner_step)
    pressed = np.maximum(found[:, XI] - inputs[:, 0], 0.0)
    assert found[:, F_P].min() >= 0.0
    assert found[:, F_P].tolist() == (parameters["k_E"] * pressed).tolist()


def test_without_loss_of_contact_not_a_bit_changes() -> None:
    random = np.random.default_rng(11)
    wire = 1.5 + 1e-4 * random.standard_normal(800)
    inputs = np.column_stack([wire, 1310.9 + random.uniform(-40.0, 40.0, wire.size)])
    expected = native.simulate(parameter_sets()["Blow"], inputs)
    assert expected[:, F_P].min() > 0.0
    assert native.simulate(lifting("Blow"), inputs).tolist() == expected.tolist()


@pytest.mark.parametrize("name", tuple(parameter_sets()))
def test_a_torque_below_the_critical_one_has_no_start(name: str) -> None:
    """The critical torque is where the bilateral contact's force at rest passes zero."""
    parameters, low, high = parameter_sets()[name], 900.0, 1310.9
    for _ in range(40):
        middle = 0.5 * (low + high)
        force = native.simulate(parameters, [[1.5, middle]])[0, F_P]
        low, high = (middle, high) if force < 0.0 else (low, middle)
    above = (1.5, high + 1e-6)
    assert native.equilibrium(lifting(name), above).tolist() == native.equilibrium(parameters, above).tolist()
    pulled = -native.simulate(parameters, [[1.5, 1000.0]])[0, F_P]
    for torque in (low - 1e-6, 1000.0):
        with pytest.raises(FmuError, match="a unilateral contact cannot; start with a larger torque"):
            native.equilibrium(lifting(name), (1.5, torque))
    with pytest.raises(FmuError, match=rf"eta = 1\.5 m: .* pull with {pulled:.6g} N"):
        native.equilibrium(lifting(name), (1.5, 1000.0))


def test_a_head_that_hangs_on_the_edge_does_not_stop_the_clock() -> None:
    """Start exactly at the edge of contact: one tick after the other, each of them a number."""
    parameters = lifting("Blow")
    state = native.equilibrium(parameters, START)
    state[native.STATES.index("xi")] = START[0]
    rows = native.simulate(parameters, held(START), SAMPLE_TIME, 5e-4, state)
    assert rows[0, F_P] == 0.0
    assert np.isfinite(rows).all()
    assert rows[-1, F_P] > 0.0

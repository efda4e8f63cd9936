"""Event indicators of model exchange: where they can be read, what they say, that a solver stops there."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from pathlib import Path

import fmpy
import numpy as np
import pytest

import tolerances
from fmi import lti
from fmi.lti import VR
from fmi.raw import ERROR, MODEL_EXCHANGE, OK, Slave
from fmu_builder.errors import BuildError
from fmu_builder.fmi2 import Interface

NewSlave = Callable[..., Slave]


def indicators(slave: Slave, count: int = 2) -> list[float] | None:
    return slave.states(count, "GetEventIndicators")


def expected(state: list[float], drive: float, shift: float = 0.0) -> list[float]:
    return [state[0] - (2.0 + shift), drive - state[1]]


def test_indicators_are_those_of_the_present_states_and_inputs(new_slave: NewSlave) -> None:
    slave = new_slave(kind=MODEL_EXCHANGE)
    assert slave.EnterInitializationMode() == OK
    assert indicators(slave) == expected(lti.steady_state(lti.START), lti.START[0])
    slave.set([VR["drive"]], [0.5])
    assert indicators(slave) == expected(lti.steady_state((0.5, lti.START[1])), 0.5)
    slave.set([VR["shift"]], [-0.25])
    assert slave.ExitInitializationMode() == OK
    slave.run()
    for state in ([3.0, -4.0], [-1.0, 2.5], [60.0, 1.0]):  # the last one is outside the model's range
        slave.set_states(state)
        assert indicators(slave) == expected(state, 0.5, -0.25)
    slave.EnterEventMode()
    slave.set([VR["shift"]], [0.5])
    assert indicators(slave) == expected([60.0, 1.0], 0.5, 0.5)


def test_a_start_that_fails_has_no_indicators(new_slave: NewSlave) -> None:
    slave = new_slave(kind=MODEL_EXCHANGE)
    assert slave.EnterInitializationMode() == OK
    slave.set([VR["drive"]], [6.0])
    assert indicators(slave) is None
    assert slave.last_error() == "fmi2GetEventIndicators: no steady state for drive = 6"


def test_a_sampled_model_has_none(new_sampled: NewSlave) -> None:
    slave = new_sampled(kind=MODEL_EXCHANGE).start().run()
    assert indicators(slave, 0) == []
    assert slave.GetEventIndicators((ctypes.c_double * 1)(), ctypes.c_size_t(1)) == ERROR
    assert "there are 0 event indicators, not 1" in slave.last_error()


def test_the_description_says_how_many(lti_fmu: Path, sampled_fmu: Path) -> None:
    assert fmpy.read_model_description(str(lti_fmu)).numberOfEventIndicators == 2
    assert fmpy.read_model_description(str(sampled_fmu)).numberOfEventIndicators == 0


def test_a_solver_stops_where_an_indicator_changes_its_sign(lti_fmu: Path) -> None:
    """Rows that are not on the grid of 10 ms are events: there one of the indicators is zero."""
    times, load, drive = [0.0, 0.1, 0.1, 1.0], [-0.75, -0.75, -12.0, -12.0], [1.25] * 4
    signals = np.rec.fromarrays([times, drive, load], names=["time", "drive", "load"])
    rows = fmpy.simulate_fmu(
        str(lti_fmu),
        fmi_type="ModelExchange",
        stop_time=1.0,
        output_interval=0.01,
        relative_tolerance=1e-8,
        input=signals,
        output=["x_1", "x_2", "drive"],
    )
    steps = rows["time"] / 0.01
    on_grid = np.abs(steps - np.round(steps)) < 1e-6
    gaps = np.array([expected([row["x_1"], row["x_2"]], row["drive"]) for row in rows])
    changes = (np.diff(np.sign(gaps[on_grid]), axis=0) != 0).sum()
    assert changes > 8
    assert len(np.unique(rows["time"][~on_grid])) == changes
    assert np.abs(gaps[~on_grid]).min(axis=1).max() <= tolerances.STATE_EVENT


@pytest.mark.parametrize(("states", "count"), [(lti.INTERFACE.states, -1), ((), 1)])
def test_an_impossible_number_of_indicators_is_refused(states: tuple[str, ...], count: int) -> None:
    base = lti.INTERFACE if states else lti.SAMPLED
    with pytest.raises(BuildError, match=f"event_indicators is {count} with {len(states)} continuous states"):
        Interface(
            base.model_identifier,
            base.model_name,
            base.description,
            base.variables,
            states,
            event_indicators=count,
        )

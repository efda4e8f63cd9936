"""Model exchange: time, events and states belong to the importer."""

from __future__ import annotations

import ctypes
import math
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fmi import lti
from fmi.conftest import SAMPLED_GUID
from fmi.lti import VR
from fmi.raw import CO_SIMULATION, DISCARD, ERROR, MODEL_EXCHANGE, OK, WARNING, EventInfo, Slave, load
from fmu_builder.compiler import host_platform
from fmu_builder.fmi2 import C_FOLDER

NewSlave = Callable[..., Slave]
INPUTS = [VR["drive"], VR["load"]]
STATES = [VR["x_1"], VR["x_2"]]
RATES = [VR["der_x_1"], VR["der_x_2"]]
SHOWN = [*STATES, VR["scaled"], VR["mixed"]]


def wavy(k: int) -> list[float]:
    return [0.3 * (k % 7) - 0.5, 0.2 + 0.4 * (k % 5)]


def ticking(library: ctypes.CDLL, guid: str = SAMPLED_GUID, kind: int = MODEL_EXCHANGE) -> Slave:
    return Slave(library, guid, kind=kind).start()


# Sampled models


def check_events_are_ticks(library: ctypes.CDLL) -> None:
    """The same values after the same ticks as in co-simulation, bit for bit, whatever is set in between."""
    exchange, stepping = ticking(library), ticking(library, kind=CO_SIMULATION)
    info = exchange.update()
    assert exchange.EnterContinuousTimeMode() == OK
    for k in range(40):
        assert info is not None
        assert info.next_event_time == (k + 1) * lti.SAMPLE_TIME
        assert exchange.get(SHOWN[:3]) == stepping.get(SHOWN[:3])
        exchange.set_time((k + 0.37) * lti.SAMPLE_TIME)
        exchange.set(INPUTS, [2.9, -55.0 - k])  # an integrator's trial: no tick may see it
        exchange.get(SHOWN)
        info = exchange.event(info.next_event_time, INPUTS, wavy(k))
        stepping.step(k * lti.SAMPLE_TIME, lti.SAMPLE_TIME)
        stepping.set(INPUTS, wavy(k))
        assert exchange.get(SHOWN) == stepping.get(SHOWN)
    state = lti.steady_state(lti.START)
    for k in range(-1, 39):
        state = lti.tick(state, lti.START if k < 0 else wavy(k))
    assert exchange.get(STATES) == state
    exchange.free()
    stepping.free()


def check_events_off_the_grid(library: ctypes.CDLL) -> None:
    """Events between the ticks follow the rule of co-simulation: inputs count that stand at the tick."""
    times = [0.0004, 0.001, 0.0012, 0.00199999, 0.0027, 0.0030000001, 0.0049, 0.0095, 0.012]
    exchange = ticking(library).run()
    steps: list[tuple[float, float, Sequence[float], Sequence[float]]] = []
    inputs: Sequence[float] = lti.START
    last = 0.0
    for k, time in enumerate(times):
        steps.append((last, time - last, inputs, (0.0, 0.0)))
        exchange.event(time, INPUTS, inputs := wavy(k))
        assert exchange.get(STATES) == lti.run_by_definition(steps)[-1], time
        last = time
    exchange.free()


def test_sampled_model_has_an_event_at_every_tick(sampled_library: ctypes.CDLL) -> None:
    check_events_are_ticks(sampled_library)


def test_events_off_the_grid_follow_the_rule_of_co_simulation(sampled_library: ctypes.CDLL) -> None:
    check_events_off_the_grid(sampled_library)


FAULTS = {
    "ticks read the inputs of now": (
        "    while (slave_event_is_due(slave)) {\n",
        "    while (slave_event_is_due(slave)) {\n        slave_latch(slave, 0.0);\n",
    ),
    "inputs are latched at every event": (
        "slave_position(slave, slave->time) <= (double)slave->tick + TICK_TOLERANCE",
        "slave->time >= 0.0",
    ),
    "inputs are never latched": (
        "slave_position(slave, slave->time) <= (double)slave->tick + TICK_TOLERANCE",
        "slave->time < 0.0",
    ),
    "one tick per event": ("    while (slave_event_is_due(slave)) {", "    if (slave_event_is_due(slave)) {"),
    "next event one tick late": ("(double)(slave->tick + 1) * slave", "(double)(slave->tick + 2) * slave"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_planted_fault_is_caught(fault: str, tmp_path: Path) -> None:
    right, wrong = FAULTS[fault]
    folder = tmp_path / "c"
    shutil.copytree(C_FOLDER, folder)
    text = (folder / "slave_events.c").read_text()
    assert text.count(right) == 1
    (folder / "slave_events.c").write_text(text.replace(right, wrong))
    path = lti.build(tmp_path / "lti_sampled.fmu", [host_platform()], folder, lti.SAMPLED)
    library = load(path, tmp_path)
    with pytest.raises(AssertionError):
        check_events_are_ticks(library)
        check_events_off_the_grid(library)


@given(
    st.lists(st.tuples(st.floats(1e-5, 0.004), st.booleans()), min_size=1, max_size=25),
    st.integers(0, 1000),
)
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_events_give_what_the_same_communication_points_give(
    sampled_library: ctypes.CDLL, steps: list[tuple[float, bool]], seed: int
) -> None:
    """Whether the importer sets the inputs in event mode or just before it."""
    exchange, stepping = ticking(sampled_library).run(), ticking(sampled_library, kind=CO_SIMULATION)
    time = 0.0
    for k, (step, before) in enumerate(steps):
        assert stepping.step(time, step) == OK
        time += step
        stepping.set(INPUTS, wavy(seed + k))
        if before:
            assert exchange.set_time(time) == OK
            exchange.set(INPUTS, wavy(seed + k))
            exchange.event(time)
        else:
            exchange.event(time, INPUTS, wavy(seed + k))
        assert exchange.get(SHOWN) == stepping.get(SHOWN)
    exchange.free()
    stepping.free()


def test_an_event_a_little_late_still_starts_its_tick(new_sampled: NewSlave) -> None:
    """Some importers trigger a time event only once the time has passed it."""
    slave, stepping = new_sampled(kind=MODEL_EXCHANGE).start().run(), new_sampled().start()
    for k in range(20):
        slave.event((k + 1) * lti.SAMPLE_TIME + 3e-9, INPUTS, wavy(k))
        assert stepping.step(k * lti.SAMPLE_TIME, lti.SAMPLE_TIME) == OK
        stepping.set(INPUTS, wavy(k))
        assert slave.get(SHOWN) == stepping.get(SHOWN)


def test_event_information_of_a_sampled_model(new_sampled: NewSlave) -> None:
    slave = new_sampled(kind=MODEL_EXCHANGE)
    number = ctypes.c_double
    assert slave.SetupExperiment(0, number(0), number(7.0004), 0, number(0)) == OK
    assert slave.EnterInitializationMode() == OK
    assert slave.ExitInitializationMode() == OK
    info = slave.update()
    assert info is not None
    assert _flags(info) == (0, 0, 0, 0, 1)
    assert info.next_event_time == 7.0004 + lti.SAMPLE_TIME
    assert slave.states(0) == slave.states(0, "GetDerivatives") == []


def _flags(info: EventInfo) -> tuple[int, ...]:
    return (
        info.new_discrete_states_needed,
        info.terminate_simulation,
        info.nominals_changed,
        info.states_changed,
        info.next_event_time_defined,
    )


def test_asking_again_at_the_same_event_changes_nothing(new_sampled: NewSlave) -> None:
    slave = new_sampled(kind=MODEL_EXCHANGE).start().run()
    slave.set_time(0.001)
    slave.EnterEventMode()
    slave.update()
    before = slave.get(STATES)
    slave.set(INPUTS, [0.1, 0.2])
    again = slave.update()
    assert again is not None
    assert again.next_event_time == 0.002
    assert slave.get(STATES) == before == lti.tick(lti.steady_state(lti.START), lti.START)


def test_an_event_left_out_is_made_up_for_and_reported_once(new_sampled: NewSlave) -> None:
    slave, stepping = new_sampled(kind=MODEL_EXCHANGE).start().run(), new_sampled().start()
    for time in (0.003, 0.006):
        slave.set_time(time)
        assert slave.completed() == (1, 0)
        slave.EnterEventMode()
        assert slave.NewDiscreteStates(ctypes.byref(EventInfo())) == OK
        assert slave.EnterContinuousTimeMode() == OK
        stepping.step(time - 0.003, 0.003)
        assert slave.get(STATES) == stepping.get(STATES)
    text = "fmi2NewDiscreteStates: 2 time events were left out; their ticks were done now (reported once)"
    assert slave.log == [(WARNING, "logStatusWarning", text)]


def test_a_tick_that_is_due_cannot_be_skipped(new_sampled: NewSlave) -> None:
    slave = new_sampled(kind=MODEL_EXCHANGE).start().run()
    slave.set_time(0.001)
    slave.EnterEventMode()
    assert slave.EnterContinuousTimeMode() == ERROR
    assert "a tick is due: call fmi2NewDiscreteStates first" in slave.last_error()
    assert slave.update() is not None
    assert slave.EnterContinuousTimeMode() == OK


def test_saved_state_goes_on_with_the_events(new_sampled: NewSlave) -> None:
    slave = new_sampled(kind=MODEL_EXCHANGE).start().run()
    for k in range(5):
        slave.event((k + 1) * 0.001, INPUTS, wavy(k))
    slave.set_time(0.0054)
    content = slave.to_bytes(slave.save())
    ends = []
    for _ in range(2):
        for k in range(5, 12):
            slave.event((k + 1) * 0.001, INPUTS, wavy(k))
        ends.append(slave.get(SHOWN))
        assert slave.SetFMUstate(slave.from_bytes(content)) == OK
    assert ends[0] == ends[1]
    other = new_sampled(kind=CO_SIMULATION).start()
    assert other.SetFMUstate(other.from_bytes(content)) == ERROR
    assert other.last_error() == "fmi2SetFMUstate: the state comes from an instance for model exchange"


# Models with continuous states


def test_states_derivatives_and_nominals(new_slave: NewSlave) -> None:
    slave = new_slave(kind=MODEL_EXCHANGE)
    assert slave.states(function="GetNominalsOfContinuousStates") == [2.0, 1.0]
    assert slave.EnterInitializationMode() == OK
    start = lti.steady_state(lti.START)
    assert slave.states() == start
    assert slave.states(function="GetDerivatives") == slave.get(RATES)
    slave.set(INPUTS, [0.5, 0.25])
    assert slave.states() == lti.steady_state((0.5, 0.25))
    slave.set(INPUTS, lti.START)
    assert slave.ExitInitializationMode() == OK
    assert slave.states() == start
    info = slave.update()
    assert info is not None
    assert _flags(info) == (0, 0, 0, 0, 0)
    assert slave.EnterContinuousTimeMode() == OK
    assert slave.set_time(0.3) == OK
    assert slave.set_states([3.0, -4.0]) == OK
    assert slave.set(INPUTS, [1.0, 2.0]) == OK
    rates = [a[0] * 3.0 + a[1] * -4.0 + (b[0] * 1.0 + b[1] * 2.0) for a, b in zip(lti.A, lti.B, strict=True)]
    assert slave.states(function="GetDerivatives") == rates == slave.get(RATES)
    assert slave.states() == [3.0, -4.0] == slave.get(STATES)
    assert slave.get([VR["mixed"]]) == [4.0 * 3.0 - 5.0 * -4.0 + 0.5 * 2.0]
    assert slave.completed() == (0, 0)


def test_integrating_by_hand_is_the_co_simulation(new_slave: NewSlave) -> None:
    exchange, stepping = new_slave(kind=MODEL_EXCHANGE).start().run(), new_slave().start()
    for k in range(30):
        for one in (exchange, stepping):
            one.set(INPUTS, wavy(k))
        rates, x = exchange.states(function="GetDerivatives"), exchange.states()
        assert rates is not None
        assert x is not None
        exchange.set_time((k + 1) * 0.001)
        exchange.set_states([x[n] + lti.SAMPLE_TIME * rates[n] for n in (0, 1)])
        assert exchange.completed() == (0, 0)
        assert stepping.step(k * 0.001, 0.001) == OK
        assert exchange.get(SHOWN) == stepping.get(SHOWN)


def test_states_where_the_model_ends_ask_for_a_smaller_step(new_slave: NewSlave) -> None:
    slave = new_slave(kind=MODEL_EXCHANGE).start().run()
    assert slave.set_states([60.0, 1.0]) == OK
    assert slave.GetDerivatives((ctypes.c_double * 2)(), ctypes.c_size_t(2)) == DISCARD
    assert slave.log[-1] == (DISCARD, "logStatusDiscard", "fmi2GetDerivatives: x_1 is too large: 60")
    assert slave.get([VR["mixed"]]) is None
    assert slave.log[-1][:2] == (DISCARD, "logStatusDiscard")
    assert slave.states() == [60.0, 1.0]
    assert slave.set_states([6.0, 1.0]) == OK
    assert slave.states(function="GetDerivatives") is not None
    slave.set_states([60.0, 1.0])
    slave.EnterEventMode()
    assert slave.get([VR["mixed"]]) is None
    assert slave.log[-1][0] == ERROR


def test_discards_can_be_silenced(new_slave: NewSlave) -> None:
    slave = new_slave(kind=MODEL_EXCHANGE).start().run()
    names = (ctypes.c_char_p * 1)(b"logStatusDiscard")
    assert slave.SetDebugLogging(0, ctypes.c_size_t(1), names) == OK
    slave.set_states([60.0, 1.0])
    assert slave.get([VR["mixed"]]) is None
    assert slave.log == []


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (lambda s: s.set_time(math.nan), "fmi2SetTime: the time must be a finite number"),
        (lambda s: s.set_time(-0.25), "the time -0.25 s lies before the last event at 0 s"),
        (lambda s: s.set_states([1.0]), "fmi2SetContinuousStates: there are 2 continuous states, not 1"),
        (lambda s: s.set_states([1.0, math.inf]), "fmi2SetContinuousStates: x_2 must be a finite number"),
        (lambda s: s.SetContinuousStates(None, ctypes.c_size_t(2)), "an array is missing"),
        (lambda s: OK if s.states(3) else ERROR, "fmi2GetContinuousStates: there are 2 continuous states"),
        (lambda s: OK if s.states(1, "GetDerivatives") else ERROR, "fmi2GetDerivatives: there are 2"),
        (lambda s: s.GetNominalsOfContinuousStates(None, ctypes.c_size_t(2)), "an array is missing"),
        (lambda s: s.GetEventIndicators(None, ctypes.c_size_t(1)), "there are 2 event indicators, not 1"),
        (lambda s: s.GetEventIndicators(None, ctypes.c_size_t(2)), "an array is missing"),
        (lambda s: s.CompletedIntegratorStep(1, None, None), "no place for the answers"),
        (lambda s: s.NewDiscreteStates(None), "fmi2NewDiscreteStates: not allowed in continuous-time mode"),
        (lambda s: s.set([VR["scale"]], [1.0]), "scale is a fixed parameter"),
        (lambda s: s.set([VR["x_1"]], [1.0]), "x_1 is neither an input nor a parameter"),
        (lambda s: s.set_integer(VR["preset"], 1), "fmi2SetInteger: not allowed in continuous-time mode"),
        (lambda s: s.step(0.0, 0.001), "fmi2DoStep: not allowed on an instance for model exchange"),
    ],
)
def test_illegal_input_is_refused_and_changes_nothing(
    new_slave: NewSlave, act: Callable[[Slave], int], words: str
) -> None:
    slave = new_slave(kind=MODEL_EXCHANGE).start().run()
    before = slave.to_bytes(slave.save())
    assert act(slave) == ERROR
    assert words in slave.last_error()
    assert slave.to_bytes(slave.save()) == before
    assert slave.states(function="GetDerivatives") is not None


def test_no_place_for_event_information_is_refused(new_slave: NewSlave) -> None:
    slave = new_slave(kind=MODEL_EXCHANGE).start()
    assert slave.NewDiscreteStates(None) == ERROR
    assert "no place for the answer" in slave.last_error()


def test_time_may_go_back_to_the_last_event_but_not_further(new_slave: NewSlave) -> None:
    slave = new_slave(kind=MODEL_EXCHANGE).start().run()
    slave.event(0.5)
    assert slave.set_time(0.7) == OK
    assert slave.set_time(0.5) == OK
    assert slave.set_time(0.4) == ERROR
    assert "the time 0.4 s lies before the last event at 0.5 s" in slave.last_error()


def test_a_solver_may_look_behind_the_stop_time_but_not_stay_there(new_slave: NewSlave) -> None:
    slave = new_slave(kind=MODEL_EXCHANGE)
    number = ctypes.c_double
    assert slave.SetupExperiment(0, number(0), number(0), 1, number(0.5)) == OK
    slave.EnterInitializationMode()
    slave.ExitInitializationMode()
    slave.run()
    assert slave.set_time(0.6) == OK
    assert slave.states(function="GetDerivatives") is not None
    assert slave.completed() is None
    assert "the time 0.6 s lies beyond the stop time 0.5 s" in slave.last_error()
    assert slave.EnterEventMode() == ERROR
    assert slave.set_time(0.5) == OK
    assert slave.completed() == (0, 0)


def test_reset_keeps_what_the_instance_is_for(new_slave: NewSlave) -> None:
    slave, fresh = new_slave(kind=MODEL_EXCHANGE), new_slave(kind=MODEL_EXCHANGE)
    slave.start().run()
    slave.event(0.25, INPUTS, [0.5, 0.5])
    slave.set_states([1.0, 2.0])
    assert slave.Reset() == OK
    assert slave.to_bytes(slave.save()) == fresh.to_bytes(fresh.save())
    assert slave.start().run().states() == lti.steady_state(lti.START)

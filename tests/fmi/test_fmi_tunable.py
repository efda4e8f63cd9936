"""Tunable parameters: set before and while a model runs, refused as a whole, remarked on once, saved."""

from __future__ import annotations

from collections.abc import Callable

from fmi.lti import START, VR
from fmi.raw import ERROR, MODEL_EXCHANGE, OK, Slave

NewSlave = Callable[..., Slave]
WARNING = 1
SHIFT, SCALED, LOAD = VR["shift"], VR["scaled"], VR["load"]
REMARK = (WARNING, "logStatusWarning", "fmi2SetReal: the model is shifted")


def scaled(slave: Slave) -> float:
    values = slave.get([SCALED])
    assert values is not None
    return values[0]


def test_between_steps_it_acts_at_once_and_is_remarked_on_once(new_slave: NewSlave) -> None:
    slave, other = new_slave().start(), new_slave().start()
    before = scaled(slave)
    assert slave.set([SHIFT], [0.5]) == OK
    assert slave.set([SHIFT], [0.25]) == OK
    assert slave.log.count(REMARK) == 1
    assert scaled(slave) == before + 0.25
    assert slave.step(0.0, 0.001) == OK and other.step(0.0, 0.001) == OK
    assert scaled(slave) == scaled(other) + 0.25
    assert slave.get([SHIFT]) == [0.25] and other.get([SHIFT]) == [0.0]


def test_set_before_the_start_it_is_there_from_the_start(new_slave: NewSlave) -> None:
    slave, other = new_slave(), new_slave().start()
    assert slave.set([SHIFT], [-0.5]) == OK
    slave.start()
    assert scaled(slave) == scaled(other) - 0.5
    assert slave.log.count(REMARK) == 1


def test_what_the_model_refuses_leaves_every_value_of_the_call(new_slave: NewSlave) -> None:
    slave = new_slave().start()
    assert slave.set([SHIFT], [0.5]) == OK
    shown = scaled(slave)
    before = slave.to_bytes(slave.save())
    assert slave.set([LOAD, SHIFT], [3.0, 0.8]) == ERROR
    assert slave.last_error() == "fmi2SetReal: too large a shift: the values are those before"
    assert slave.get([LOAD, SHIFT]) == [START[1], 0.5] and scaled(slave) == shown
    assert slave.to_bytes(slave.save()) == before
    assert slave.set([SHIFT, LOAD], [1.5, 3.0]) == ERROR
    assert "shift = 1.5 is outside [-1, 1]" in slave.last_error()
    assert slave.get([LOAD, SHIFT]) == [START[1], 0.5]


def test_a_state_holds_it_and_reset_forgets_it(new_slave: NewSlave) -> None:
    slave, other = new_slave().start(), new_slave().start()
    start = scaled(slave)
    assert slave.set([SHIFT], [0.5]) == OK
    state = other.from_bytes(slave.to_bytes(slave.save()))
    assert other.SetFMUstate(state) == OK
    assert other.get([SHIFT]) == [0.5] and scaled(other) == scaled(slave)
    assert slave.Reset() == OK
    slave.start()
    assert slave.get([SHIFT]) == [0.0] and scaled(slave) == start
    assert slave.set([SHIFT], [0.5]) == OK
    assert slave.log.count(REMARK) == 2


def test_in_model_exchange_it_is_for_event_mode(new_slave: NewSlave) -> None:
    slave = new_slave(kind=MODEL_EXCHANGE).start()
    before = scaled(slave)
    assert slave.set([SHIFT], [0.5]) == OK
    assert scaled(slave) == before + 0.5
    slave.run()
    assert slave.set([SHIFT], [0.25]) == ERROR
    assert slave.last_error() == "fmi2SetReal: shift is a tunable parameter and can only be set in event mode"
    assert slave.EnterEventMode() == OK and slave.set([SHIFT], [0.25]) == OK
    slave.run()
    assert scaled(slave) == before + 0.25

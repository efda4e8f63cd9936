"""Which function may be called when: every pair of mode and function, against the tables of the standard."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import pytest

from fmi.lti import VR
from fmi.raw import CO_SIMULATION, ERROR, MODEL_EXCHANGE, OK, Slave

# FMI 2.0.4, sections 4.2.4 (co-simulation) and 3.2.3 (model exchange), rows as letters of the modes:
# instantiated, initialisation (n), step, event, continuous time, terminated, failed. Two rows are wider than
# the tables: fmi2GetDerivatives in initialisation mode, where derivatives are initial unknowns, and
# fmi2GetNominalsOfContinuousStates in every mode, because nominals never change.
IN_BOTH = {
    "SetDebugLogging": "insectf",
    "SetupExperiment": "i",
    "EnterInitializationMode": "i",
    "ExitInitializationMode": "n",
    "Terminate": "sec",
    "Reset": "insectf",
    "GetReal": "nsectf",
    "GetBoolean": "nsectf",
    "SetReal": "insec",
    "SetInteger": "inse",
    "SetString": "inse",
    "SetParameter": "in",
    "SetTunable": "inse",
    "GetFMUstate": "insectf",
    "GetDirectionalDerivative": "nsectf",
}
FOR_STEPS = {
    "SetRealInputDerivatives": "ins",
    "GetRealOutputDerivatives": "stf",
    "GetRealStatus": "stf",
    "DoStep": "s",
    "CancelStep": "",
}
FOR_INTEGRATORS = {
    "EnterEventMode": "ec",
    "NewDiscreteStates": "e",
    "EnterContinuousTimeMode": "e",
    "CompletedIntegratorStep": "c",
    "SetTime": "ec",
    "SetContinuousStates": "c",
    "GetContinuousStates": "nectf",
    "GetDerivatives": "nectf",
    "GetEventIndicators": "nectf",
    "GetNominalsOfContinuousStates": "inectf",
}
LEGAL = IN_BOTH | FOR_STEPS | FOR_INTEGRATORS
LETTERS = {
    CO_SIMULATION: {
        "instantiated": "i",
        "initialisation": "n",
        "step": "s",
        "terminated": "t",
        "failed": "f",
    },
    MODEL_EXCHANGE: {
        "instantiated": "i",
        "initialisation": "n",
        "event": "e",
        "continuous": "c",
        "terminated": "t",
        "failed": "f",
    },
}
PLACES = [(kind, mode) for kind, modes in LETTERS.items() for mode in modes]


def _real(slave: Slave) -> int:
    return OK if slave.get([VR["drive"]]) is not None else ERROR


def _state(slave: Slave) -> int:
    state = ctypes.c_void_p()
    status = slave.GetFMUstate(ctypes.byref(state))
    slave.FreeFMUstate(ctypes.byref(state))
    return status


_NONE = ctypes.c_size_t(0)
_ZERO = ctypes.c_double(0)
ACTS: dict[str, Callable[[Slave], int]] = {
    "SetDebugLogging": lambda s: s.SetDebugLogging(1, _NONE, None),
    "SetupExperiment": lambda s: s.SetupExperiment(0, _ZERO, _ZERO, 0, _ZERO),
    "EnterInitializationMode": lambda s: s.EnterInitializationMode(),
    "ExitInitializationMode": lambda s: s.ExitInitializationMode(),
    "Terminate": lambda s: s.Terminate(),
    "Reset": lambda s: s.Reset(),
    "GetReal": _real,
    "GetBoolean": lambda s: ERROR if s.get_integer(VR["in_range"], "GetBoolean") is None else OK,
    "SetReal": lambda s: s.set([VR["load"]], [0.5]),
    "SetInteger": lambda s: s.SetInteger(None, _NONE, None),
    "SetString": lambda s: s.SetString(None, _NONE, None),
    "SetParameter": lambda s: s.set([VR["scale"]], [0.75]),
    "SetTunable": lambda s: s.set([VR["shift"]], [0.0]),
    "GetFMUstate": _state,
    "GetDirectionalDerivative": lambda s: s.GetDirectionalDerivative(None, _NONE, None, _NONE, None, None),
    "SetRealInputDerivatives": lambda s: s.slope([VR["load"]], [0.5]),
    "GetRealOutputDerivatives": lambda s: s.GetRealOutputDerivatives(None, _NONE, None, None),
    "GetRealStatus": lambda s: s.GetRealStatus(2, ctypes.byref(ctypes.c_double())),
    "DoStep": lambda s: s.step(0.0, 0.001),
    "CancelStep": lambda s: s.CancelStep(),
    "EnterEventMode": lambda s: s.EnterEventMode(),
    "NewDiscreteStates": lambda s: ERROR if s.update() is None else OK,
    "EnterContinuousTimeMode": lambda s: s.EnterContinuousTimeMode(),
    "CompletedIntegratorStep": lambda s: ERROR if s.completed() is None else OK,
    "SetTime": lambda s: s.set_time(0.0),
    "SetContinuousStates": lambda s: s.set_states([]),
    "GetContinuousStates": lambda s: s.GetContinuousStates(None, _NONE),
    "GetDerivatives": lambda s: s.GetDerivatives(None, _NONE),
    "GetEventIndicators": lambda s: s.GetEventIndicators(None, _NONE),
    "GetNominalsOfContinuousStates": lambda s: s.GetNominalsOfContinuousStates(None, _NONE),
}


def _reach(slave: Slave, kind: int, mode: str) -> Slave:
    if mode == "instantiated":
        return slave
    assert slave.EnterInitializationMode() == OK
    if mode == "initialisation":
        return slave
    assert slave.ExitInitializationMode() == OK
    if mode == "continuous":
        slave.run()
    if mode == "terminated":
        assert slave.Terminate() == OK
    if mode == "failed":
        slave.set([VR["drive"]], [9.0])
        if kind == CO_SIMULATION:
            assert slave.step(0.0, 0.001) == ERROR
        else:
            assert slave.run().set_time(0.001) == OK
            assert slave.EnterEventMode() == OK
            assert slave.update() is None
            assert slave.last_error() == "fmi2NewDiscreteStates: drive hits the stop at 9"
    return slave


@pytest.mark.parametrize(("kind", "mode"), PLACES)
@pytest.mark.parametrize("function", LEGAL)
def test_call_order(new_sampled: Callable[..., Slave], kind: int, mode: str, function: str) -> None:
    slave = _reach(new_sampled(kind=kind), kind, mode)
    foreign = FOR_STEPS if kind == MODEL_EXCHANGE else FOR_INTEGRATORS
    legal = LETTERS[kind][mode] in LEGAL[function] and function not in foreign
    slave.log.clear()
    assert (ACTS[function](slave) == OK) is legal
    if not legal:
        assert len(slave.log) == 1
        name = "fmi2SetReal" if function in ("SetParameter", "SetTunable") else f"fmi2{function}"
        assert slave.log[0][2].startswith(name + ": ")
        if function in foreign:
            own = "model exchange" if kind == MODEL_EXCHANGE else "co-simulation"
            assert slave.log[0][2].endswith(f"not allowed on an instance for {own}")
    assert slave.Reset() == OK
    slave.start()

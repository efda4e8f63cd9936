"""Which function may be called when: every pair of mode and function, against the table of the standard."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import pytest

from fmi.lti import VR
from fmi.raw import ERROR, OK, Slave

MODES = "instantiated", "initialisation", "step", "terminated", "failed"
# FMI 2.0.4, section 4.2.4, rows as letters of the modes above (i, n, s, t, f).
LEGAL = {
    "SetDebugLogging": "instf",
    "SetupExperiment": "i",
    "EnterInitializationMode": "i",
    "ExitInitializationMode": "n",
    "Terminate": "s",
    "Reset": "instf",
    "GetReal": "nstf",
    "SetReal": "ins",
    "SetParameter": "in",
    "GetFMUstate": "instf",
    "SetRealInputDerivatives": "ins",
    "GetRealStatus": "stf",
    "DoStep": "s",
    "CancelStep": "",
}


def _real(slave: Slave) -> int:
    return OK if slave.get([VR["drive"]]) is not None else ERROR


def _state(slave: Slave) -> int:
    state = ctypes.c_void_p()
    status = slave.GetFMUstate(ctypes.byref(state))
    slave.FreeFMUstate(ctypes.byref(state))
    return status


ACTS: dict[str, Callable[[Slave], int]] = {
    "SetDebugLogging": lambda s: s.SetDebugLogging(1, ctypes.c_size_t(0), None),
    "SetupExperiment": lambda s: s.SetupExperiment(
        0, ctypes.c_double(0), ctypes.c_double(0), 0, ctypes.c_double(0)
    ),
    "EnterInitializationMode": lambda s: s.EnterInitializationMode(),
    "ExitInitializationMode": lambda s: s.ExitInitializationMode(),
    "Terminate": lambda s: s.Terminate(),
    "Reset": lambda s: s.Reset(),
    "GetReal": _real,
    "SetReal": lambda s: s.set([VR["load"]], [0.5]),
    "SetParameter": lambda s: s.set([VR["scale"]], [0.75]),
    "GetFMUstate": _state,
    "SetRealInputDerivatives": lambda s: s.slope([VR["load"]], [0.5]),
    "GetRealStatus": lambda s: s.GetRealStatus(2, ctypes.byref(ctypes.c_double())),
    "DoStep": lambda s: s.step(0.0, 0.001),
    "CancelStep": lambda s: s.CancelStep(),
}


def _reach(slave: Slave, mode: str) -> Slave:
    if mode == "instantiated":
        return slave
    assert slave.EnterInitializationMode() == OK
    if mode == "initialisation":
        return slave
    assert slave.ExitInitializationMode() == OK
    if mode == "terminated":
        assert slave.Terminate() == OK
    if mode == "failed":
        slave.set([VR["drive"]], [9.0])
        assert slave.step(0.0, 0.001) == ERROR
    return slave


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("function", LEGAL)
def test_call_order(new_slave: Callable[..., Slave], mode: str, function: str) -> None:
    slave = _reach(new_slave(), mode)
    letter = {"initialisation": "n"}.get(mode, mode[0])
    legal = letter in LEGAL[function]
    slave.log.clear()
    assert (ACTS[function](slave) == OK) is legal
    if not legal:
        assert len(slave.log) == 1
        name = "fmi2SetReal" if function == "SetParameter" else f"fmi2{function}"
        assert slave.log[0][2].startswith(name + ": ")
    assert slave.Reset() == OK
    slave.start()

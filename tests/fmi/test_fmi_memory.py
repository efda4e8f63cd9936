"""What an instance takes from the heap: itself and saved states, nothing while it runs."""

from __future__ import annotations

import ctypes
from pathlib import Path

import pytest

from fmi import lti
from fmi.conftest import GUID, SAMPLED_GUID
from fmi.lti import VR
from fmi.raw import CO_SIMULATION, MODEL_EXCHANGE, OK, Slave
from fmu_builder.compiler import load_native
from fmu_builder.fmi2 import C_FOLDER, Interface, fmi_headers, variables_header

INPUTS = [VR["drive"], VR["load"]]


def counting(folder: Path, interface: Interface, guid: str) -> ctypes.CDLL:
    (folder / "variables.h").write_text(variables_header(interface, guid))
    source = lti.C_FOLDER / "counting.c"
    library = load_native("counting", source, (folder, lti.C_FOLDER, C_FOLDER, fmi_headers()))
    library.fmi2Instantiate.restype = ctypes.c_void_p
    return library


def derivative(slave: Slave) -> int:
    one, number = (ctypes.c_uint * 1)(VR["mixed"]), (ctypes.c_double * 1)(1.0)
    known, count = (ctypes.c_uint * 1)(VR["load"]), ctypes.c_size_t(1)
    return slave.GetDirectionalDerivative(one, count, known, count, number, number)


def test_steps_take_no_memory(tmp_path: Path) -> None:
    library = counting(tmp_path, lti.INTERFACE, GUID)
    before = library.allocation_count()
    slave = Slave(library, GUID, kind=CO_SIMULATION)
    slave.start()
    for k in range(50):
        slave.set(INPUTS, [0.1 * k, -0.2])
        slave.slope(INPUTS, [1.0, 2.0])
        assert slave.step(k * 0.0007, 0.0007) == OK
        assert slave.get([VR["x_1"], VR["mixed"]]) is not None
        assert derivative(slave) == OK
    assert slave.step(0.0, -1.0) != OK
    slave.Reset()
    assert library.allocation_count() == before + 1
    slave.save()
    assert library.allocation_count() == before + 2


@pytest.mark.parametrize("interface", [lti.INTERFACE, lti.SAMPLED], ids=["continuous", "sampled"])
def test_events_and_evaluations_take_no_memory(tmp_path: Path, interface: Interface) -> None:
    guid = GUID if interface is lti.INTERFACE else SAMPLED_GUID
    library = counting(tmp_path, interface, guid)
    before = library.allocation_count()
    slave = Slave(library, guid, kind=MODEL_EXCHANGE)
    slave.start().run()
    for k in range(1, 50):
        slave.event(k * 0.001, INPUTS, [0.1 * k, -0.2])
        assert slave.completed() == (0, 0)
        assert slave.get([VR["x_1"], VR["mixed"]]) is not None
        assert derivative(slave) == OK
        if interface is lti.INTERFACE:
            assert slave.set_states([0.1 * k, 0.2]) == OK
            assert slave.states(function="GetDerivatives") is not None
    assert library.allocation_count() == before + 1

"""Saved states: copies, bytes, other processes, and bytes that are not a state."""

from __future__ import annotations

import ctypes
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fmi.conftest import GUID
from fmi.lti import VR
from fmi.raw import ERROR, OK, Slave

NewSlave = Callable[..., Slave]
OUTPUTS = [VR["x_1"], VR["x_2"], VR["scaled"], VR["mixed"]]


def go_on(slave: Slave, first: int, last: int) -> list[float] | None:
    """Take steps first..last of 0.7 ms with inputs that change."""
    for k in range(first, last):
        slave.set([VR["drive"], VR["load"]], [0.1 * (k % 9), 0.3 * (k % 4)])
        assert slave.step(k * 0.0007, 0.0007) == OK
    return slave.get(OUTPUTS)


def test_restored_state_goes_on_bit_for_bit(new_slave: NewSlave) -> None:
    slave = new_slave().start()
    at_seven = go_on(slave, 0, 7)
    state = slave.save()
    expected = go_on(slave, 7, 30)
    assert expected != at_seven
    assert slave.SetFMUstate(state) == OK
    assert slave.get(OUTPUTS) == at_seven
    assert go_on(slave, 7, 30) == expected
    other = new_slave().start()
    assert other.SetFMUstate(other.from_bytes(slave.to_bytes(state))) == OK
    assert go_on(other, 7, 30) == expected
    assert slave.FreeFMUstate(ctypes.byref(state)) == OK
    assert state.value is None
    assert slave.FreeFMUstate(ctypes.byref(state)) == OK


def test_saving_changes_nothing(new_slave: NewSlave) -> None:
    saved, plain = new_slave().start(), new_slave().start()
    for k in range(25):
        state = saved.save()
        assert saved.SetFMUstate(state) == OK
        saved.FreeFMUstate(ctypes.byref(state))
        assert go_on(saved, k, k + 1) == go_on(plain, k, k + 1)


def test_every_mode_is_saved(new_slave: NewSlave) -> None:
    slave = new_slave()
    before = slave.save()
    slave.start()
    running = slave.save()
    assert slave.Terminate() == OK
    assert slave.SetFMUstate(running) == OK
    assert slave.step(0.0, 0.001) == OK
    assert slave.SetFMUstate(before) == OK
    slave.start()


def test_memory_of_a_state_is_used_again(new_slave: NewSlave) -> None:
    slave = new_slave().start()
    state = slave.save()
    address = state.value
    expected = go_on(slave, 0, 3)
    assert slave.GetFMUstate(ctypes.byref(state)) == OK
    assert state.value == address
    slave.Reset()
    assert slave.SetFMUstate(state) == OK
    assert slave.get(OUTPUTS) == expected


_OTHER_PROCESS = """
import ctypes, sys
sys.path[:0] = {paths!r}
from fmi.raw import OK, Slave
from fmi.test_fmi_state import go_on
library = ctypes.CDLL(sys.argv[1])
library.fmi2Instantiate.restype = ctypes.c_void_p
slave = Slave(library, sys.argv[2])
assert slave.SetFMUstate(slave.from_bytes(open(sys.argv[3], "rb").read())) == OK
print(" ".join(value.hex() for value in go_on(slave, 7, 30)))
"""


def test_restored_in_another_process(new_slave: NewSlave, tmp_path: Path) -> None:
    slave = new_slave().start()
    go_on(slave, 0, 7)
    file = tmp_path / "state"
    file.write_bytes(slave.to_bytes(slave.save()))
    expected = " ".join(value.hex() for value in go_on(slave, 7, 30) or [])
    tests = Path(__file__).parents[1]
    code = _OTHER_PROCESS.format(paths=[str(tests.parent), str(tests)])
    command = [sys.executable, "-c", code, slave.library._name, GUID, str(file)]
    run = subprocess.run(command, capture_output=True, text=True, check=True)
    assert run.stdout.strip() == expected


def test_two_instances_share_nothing(new_slave: NewSlave) -> None:
    alone = go_on(new_slave().start(), 0, 20)
    one, two = new_slave().start(), new_slave()
    two.set_integer(VR["preset"], 2)
    two.start()
    for k in range(20):
        go_on(one, k, k + 1)
        go_on(two, k, k + 1)
    assert one.get(OUTPUTS) == alone
    assert two.get(OUTPUTS) != alone


def test_reset_is_a_fresh_start(new_slave: NewSlave) -> None:
    fresh = new_slave()
    slave = new_slave()
    slave.set_integer(VR["preset"], 2)
    go_on(slave.start(), 0, 12)
    assert slave.Reset() == OK
    assert slave.to_bytes(slave.save()) == fresh.to_bytes(fresh.save())
    assert go_on(slave.start(), 0, 12) == go_on(fresh.start(), 0, 12)


def _state_bytes(slave: Slave) -> bytes:
    slave.start()
    go_on(slave, 0, 4)
    return slave.to_bytes(slave.save())


def test_bytes_have_a_fixed_order_and_name_their_fmu(new_slave: NewSlave) -> None:
    content = _state_bytes(new_slave())
    mark, version, size = struct.unpack_from("<QQQ", content)
    assert (mark.to_bytes(8, "little"), version, size) == (b"FMUSTATE", 2, len(content))
    assert content[24:88].rstrip(b"\0").decode() == GUID
    # co-simulation; step mode; two ticks in four steps of 0.7 ms
    assert struct.unpack_from("<qqq", content, 88) == (0, 4, 2)


@pytest.mark.parametrize(
    ("harm", "words"),
    [
        (lambda b: b"", "not a saved state"),
        (lambda b: b[:50], "not a saved state"),
        (lambda b: b"x" * len(b), "not a saved state"),
        (lambda b: b[:-8], "right length"),
        (lambda b: b + b"\0" * 8, "right length"),
        (lambda b: b[:8] + b"\7" + b[9:], "another format version"),
        (lambda b: b[:30] + b"?" + b[31:], "another FMU"),
        (lambda b: b[:200] + bytes([b[200] ^ 1]) + b[201:], "damaged"),
    ],
)
def test_harmed_bytes_are_refused(new_slave: NewSlave, harm: Callable[[bytes], bytes], words: str) -> None:
    slave = new_slave()
    content = _state_bytes(slave)
    assert slave.from_bytes(harm(content)) is None
    assert words in slave.last_error()
    assert slave.from_bytes(content) is not None


@given(st.integers(0, 10**6), st.integers(1, 255))
@settings(max_examples=50, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_changed_byte_is_noticed(lti_library: ctypes.CDLL, position: int, change: int) -> None:
    slave = Slave(lti_library, GUID)
    content = bytearray(_state_bytes(slave))
    content[position % len(content)] ^= change
    assert slave.from_bytes(bytes(content)) is None
    slave.free()


def test_missing_pointers_are_refused(new_slave: NewSlave) -> None:
    slave = new_slave().start()
    state = slave.save()
    size = ctypes.c_size_t()
    assert slave.GetFMUstate(None) == ERROR
    assert slave.SetFMUstate(None) == ERROR
    assert slave.SerializedFMUstateSize(None, ctypes.byref(size)) == ERROR
    assert slave.SerializeFMUstate(state, None, ctypes.c_size_t(10**6)) == ERROR
    assert slave.SerializeFMUstate(state, ctypes.create_string_buffer(8), ctypes.c_size_t(8)) == ERROR
    assert slave.DeSerializeFMUstate(None, ctypes.c_size_t(8), ctypes.byref(ctypes.c_void_p())) == ERROR
    assert slave.FreeFMUstate(None) == OK

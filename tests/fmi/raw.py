"""An FMU's functions called one by one through ctypes, with every status and log message kept."""

from __future__ import annotations

import ctypes
import zipfile
from collections.abc import Sequence
from pathlib import Path

from fmu_builder.compiler import TARGETS, host_platform

OK, WARNING, DISCARD, ERROR = 0, 1, 2, 3
MODEL_EXCHANGE, CO_SIMULATION = 0, 1
_LOGGER = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p
)


class _Callbacks(ctypes.Structure):
    _fields_ = [
        ("logger", _LOGGER),
        ("allocate", ctypes.c_void_p),
        ("free", ctypes.c_void_p),
        ("step_finished", ctypes.c_void_p),
        ("environment", ctypes.c_void_p),
    ]


def load(fmu: Path, folder: Path) -> ctypes.CDLL:
    """Load the binary of an FMU for this machine, unpacked into `folder`."""
    platform = host_platform()
    suffix = TARGETS[platform].suffix
    with zipfile.ZipFile(fmu) as archive:
        name = next(
            n for n in archive.namelist() if n.startswith(f"binaries/{platform}/") and n.endswith(suffix)
        )
        library = ctypes.CDLL(archive.extract(name, folder))
    library.fmi2Instantiate.restype = ctypes.c_void_p
    library.fmi2GetVersion.restype = ctypes.c_char_p
    library.fmi2GetTypesPlatform.restype = ctypes.c_char_p
    return library


class EventInfo(ctypes.Structure):
    """fmi2EventInfo."""

    _fields_ = [
        ("new_discrete_states_needed", ctypes.c_int),
        ("terminate_simulation", ctypes.c_int),
        ("nominals_changed", ctypes.c_int),
        ("states_changed", ctypes.c_int),
        ("next_event_time_defined", ctypes.c_int),
        ("next_event_time", ctypes.c_double),
    ]


class Slave:
    """One instance; methods are FMI functions without the prefix and return the status."""

    def __init__(
        self,
        library: ctypes.CDLL,
        guid: str,
        *,
        logging: bool = False,
        callbacks: bool = True,
        kind: int = CO_SIMULATION,
    ) -> None:
        self.log: list[tuple[int, str, str]] = []
        self._logger = _LOGGER(
            lambda _env, _name, status, category, text: self.log.append(
                (status, category.decode(), text.decode())
            )
        )
        self._callbacks = _Callbacks(self._logger, None, None, None, None)
        self.library = library
        pointer = ctypes.byref(self._callbacks) if callbacks else None
        self.component = library.fmi2Instantiate(
            b"one", ctypes.c_int(kind), guid.encode(), b"", pointer, ctypes.c_int(0), ctypes.c_int(logging)
        )

    def __getattr__(self, name: str):
        function = getattr(self.library, "fmi2" + name)
        return lambda *arguments: function(ctypes.c_void_p(self.component), *arguments)

    def start(self, **reals: float) -> Slave:
        """Go to step or event mode with these real start values (by value reference as `vN`)."""
        assert self.SetupExperiment(0, ctypes.c_double(0), ctypes.c_double(0), 0, ctypes.c_double(0)) == OK
        assert self.EnterInitializationMode() == OK
        for key, value in reals.items():
            assert self.set([int(key[1:])], [value]) == OK
        assert self.ExitInitializationMode() == OK
        return self

    def set(self, references: Sequence[int], values: Sequence[float]) -> int:
        count = len(references)
        return self.SetReal(
            (ctypes.c_uint * count)(*references), ctypes.c_size_t(count), (ctypes.c_double * count)(*values)
        )

    def slope(self, references: Sequence[int], values: Sequence[float], order: int = 1) -> int:
        count = len(references)
        orders = (ctypes.c_int * count)(*([order] * count))
        vr = (ctypes.c_uint * count)(*references)
        return self.SetRealInputDerivatives(
            vr, ctypes.c_size_t(count), orders, (ctypes.c_double * count)(*values)
        )

    def get(self, references: Sequence[int]) -> list[float] | None:
        """Return the values, or None when the FMU refuses."""
        count = len(references)
        values = (ctypes.c_double * count)(*([-99.0] * count))
        status = self.GetReal((ctypes.c_uint * count)(*references), ctypes.c_size_t(count), values)
        return list(values) if status == OK else None

    def set_integer(self, reference: int, value: int) -> int:
        return self.SetInteger((ctypes.c_uint * 1)(reference), ctypes.c_size_t(1), (ctypes.c_int * 1)(value))

    def get_integer(self, reference: int, function: str = "GetInteger") -> int | None:
        value = (ctypes.c_int * 1)(-99)
        status = getattr(self, function)((ctypes.c_uint * 1)(reference), ctypes.c_size_t(1), value)
        return value[0] if status == OK else None

    def step(self, time: float, step: float) -> int:
        return self.DoStep(ctypes.c_double(time), ctypes.c_double(step), 1)

    def set_time(self, time: float) -> int:
        return self.SetTime(ctypes.c_double(time))

    def update(self) -> EventInfo | None:
        """Ask for new discrete states; None when the FMU refuses."""
        info = EventInfo(7, 7, 7, 7, 7, -99.0)
        return info if self.NewDiscreteStates(ctypes.byref(info)) == OK else None

    def event(self, time: float, references: Sequence[int] = (), values: Sequence[float] = ()) -> EventInfo:
        """Take one event at `time`, with these inputs set before it is left."""
        assert self.set_time(time) == OK
        assert self.EnterEventMode() == OK
        self.set(references, values)
        info = self.update()
        assert info is not None
        assert self.EnterContinuousTimeMode() == OK
        return info

    def run(self) -> Slave:
        """Go from event mode after initialisation to continuous-time mode."""
        assert self.update() is not None
        assert self.EnterContinuousTimeMode() == OK
        return self

    def states(self, count: int = 2, function: str = "GetContinuousStates") -> list[float] | None:
        values = (ctypes.c_double * max(count, 1))(*([-99.0] * max(count, 1)))
        status = getattr(self, function)(values, ctypes.c_size_t(count))
        return list(values)[:count] if status == OK else None

    def set_states(self, values: Sequence[float]) -> int:
        count = len(values)
        return self.SetContinuousStates((ctypes.c_double * max(count, 1))(*values), ctypes.c_size_t(count))

    def completed(self) -> tuple[int, int] | None:
        """Return (enter event mode, terminate), None when the FMU refuses."""
        enter, terminate = ctypes.c_int(7), ctypes.c_int(7)
        status = self.CompletedIntegratorStep(1, ctypes.byref(enter), ctypes.byref(terminate))
        return (enter.value, terminate.value) if status == OK else None

    def save(self) -> ctypes.c_void_p:
        state = ctypes.c_void_p()
        assert self.GetFMUstate(ctypes.byref(state)) == OK
        return state

    def to_bytes(self, state: ctypes.c_void_p) -> bytes:
        size = ctypes.c_size_t()
        assert self.SerializedFMUstateSize(state, ctypes.byref(size)) == OK
        buffer = ctypes.create_string_buffer(size.value)
        assert self.SerializeFMUstate(state, buffer, size) == OK
        return buffer.raw

    def from_bytes(self, content: bytes) -> ctypes.c_void_p | None:
        state = ctypes.c_void_p()
        status = self.DeSerializeFMUstate(content, ctypes.c_size_t(len(content)), ctypes.byref(state))
        return state if status == OK else None

    def last_error(self) -> str:
        return next((text for status, _, text in reversed(self.log) if status == ERROR), "")

    def free(self) -> None:
        self.library.fmi2FreeInstance(ctypes.c_void_p(self.component))

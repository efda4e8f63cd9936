"""An FMU's functions called one by one through ctypes, with every status and log message kept."""

from __future__ import annotations

import ctypes
import zipfile
from collections.abc import Sequence
from pathlib import Path

from fmu_builder.compiler import TARGETS, host_platform

OK, WARNING, DISCARD, ERROR = 0, 1, 2, 3
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


class Slave:
    """One instance; methods are FMI functions without the prefix and return the status."""

    def __init__(
        self, library: ctypes.CDLL, guid: str, *, logging: bool = False, callbacks: bool = True, kind: int = 1
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
        """Go to step mode with these real start values (by value reference as `vN`)."""
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

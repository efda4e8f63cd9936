"""An FMU's functions through ctypes, every status and message kept; runs in the process that may crash."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Sequence
from typing import Any

from fmu_builder.check.behaviour.plan import Plan, PlannedVariable

OK, WARNING, DISCARD, ERROR, FATAL, PENDING = range(6)
STATUS_NAMES = ("fmi2OK", "fmi2Warning", "fmi2Discard", "fmi2Error", "fmi2Fatal", "fmi2Pending")
_MOST_MESSAGES = 50

_Pointer, _Size, _Real, _Int, _Text = (
    ctypes.c_void_p, ctypes.c_size_t, ctypes.c_double, ctypes.c_int, ctypes.c_char_p,
)  # fmt: skip
_LOGGER = ctypes.CFUNCTYPE(None, _Pointer, _Text, _Int, _Text, _Text)
_ARGUMENTS: dict[str, tuple[Any, ...]] = {
    "GetTypesPlatform": (),
    "GetVersion": (),
    "Instantiate": (_Text, _Int, _Text, _Text, _Pointer, _Int, _Int),
    "FreeInstance": (_Pointer,),
    "SetupExperiment": (_Pointer, _Int, _Real, _Real, _Int, _Real),
    "EnterInitializationMode": (_Pointer,),
    "ExitInitializationMode": (_Pointer,),
    "Terminate": (_Pointer,),
    "Reset": (_Pointer,),
    **{
        f"{verb}{kind}": (_Pointer, _Pointer, _Size, _Pointer)
        for verb in ("Get", "Set")
        for kind in ("Real", "Integer", "Boolean", "String")
    },
    "GetFMUstate": (_Pointer, _Pointer),
    "SetFMUstate": (_Pointer, _Pointer),
    "FreeFMUstate": (_Pointer, _Pointer),
    "SerializedFMUstateSize": (_Pointer, _Pointer, _Pointer),
    "SerializeFMUstate": (_Pointer, _Pointer, _Pointer, _Size),
    "DeSerializeFMUstate": (_Pointer, _Pointer, _Size, _Pointer),
    "GetDirectionalDerivative": (_Pointer, _Pointer, _Size, _Pointer, _Size, _Pointer, _Pointer),
}
_OF_KIND: tuple[dict[str, tuple[Any, ...]], ...] = (
    {
        "NewDiscreteStates": (_Pointer, _Pointer),
        "EnterContinuousTimeMode": (_Pointer,),
        "SetContinuousStates": (_Pointer, _Pointer, _Size),
        "GetContinuousStates": (_Pointer, _Pointer, _Size),
        "GetDerivatives": (_Pointer, _Pointer, _Size),
        "GetEventIndicators": (_Pointer, _Pointer, _Size),
    },
    {
        "SetRealInputDerivatives": (_Pointer, _Pointer, _Size, _Pointer, _Pointer),
        "DoStep": (_Pointer, _Real, _Real, _Int),
    },
)  # fmt: skip
_RESULTS = {"GetTypesPlatform": _Text, "GetVersion": _Text, "Instantiate": _Pointer, "FreeInstance": None}
_CELLS: dict[str, Any] = {"Real": _Real, "Integer": _Int, "Enumeration": _Int, "Boolean": _Int}
_FUNCTION_TYPES = {"Enumeration": "Integer"}


class _Callbacks(ctypes.Structure):
    _fields_ = (
        ("logger", _LOGGER), ("allocate", _Pointer), ("free", _Pointer), ("finished", _Pointer),
        ("environment", _Pointer),
    )  # fmt: skip


def _heap() -> tuple[int | None, int | None]:
    """Return the addresses of calloc and free of the C library."""
    library: Any = ctypes.cdll.msvcrt if sys.platform == "win32" else ctypes.CDLL(None)
    return tuple(ctypes.cast(function, _Pointer).value for function in (library.calloc, library.free))  # type: ignore[return-value]


class Library:
    """The loaded binary.

    Raises:
        OSError: It does not load.
        AttributeError: A function is missing.
    """

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self._library = ctypes.CDLL(plan.library)
        for name, arguments in {**_ARGUMENTS, **_OF_KIND[plan.kind]}.items():
            function = getattr(self._library, "fmi2" + name)
            function.argtypes, function.restype = arguments, _RESULTS.get(name, _Int)
            setattr(self, name, function)

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(f"the FMU has no fmi2{name}")


class Instance:
    """One instance; a `component` of None means that it was not instantiated."""

    def __init__(self, library: Library, guid: str | None = None, **given: Any) -> None:
        self.library, self.plan = library, library.plan
        self.messages: list[str] = []
        self._logger = _LOGGER(self._receive)
        allocate, free = _heap()
        self._callbacks = _Callbacks(self._logger, allocate, free, None, None)
        plan = self.plan
        self.component = library.Instantiate(
            given.get("name", b"check"),
            given.get("kind", plan.kind),
            (plan.guid if guid is None else guid).encode(),
            given.get("resources", plan.resources.encode()),
            given.get("callbacks", ctypes.addressof(self._callbacks)),
            0,
            0,
        )
        self.outputs = references(plan.outputs)
        self.inputs = references(plan.inputs)
        self._cells = (_Real * max(len(plan.outputs), 1))()

    def _receive(
        self, _environment: Any, _name: Any, _status: int, _category: Any, text: bytes | None
    ) -> None:
        if len(self.messages) < _MOST_MESSAGES:
            self.messages.append((text or b"").decode("utf-8", errors="replace"))

    def begin(self, start_time: float = 0.0) -> int:
        """Go through initialisation with the start values; return the worst status."""
        found: list[int] = [self.library.SetupExperiment(self.component, 0, 0.0, start_time, 0, 0.0)]
        found.append(self.library.EnterInitializationMode(self.component))
        found.append(self.library.ExitInitializationMode(self.component))
        return max(found)

    def set_inputs(self, values: Sequence[float]) -> int:
        """Set all Real inputs."""
        cells = (_Real * max(len(values), 1))(*values)
        return int(self.library.SetReal(self.component, self.inputs, len(values), cells)) if values else OK

    def get_outputs(self) -> list[float] | None:
        """Return the observed outputs, None when they cannot be read."""
        count = len(self.plan.outputs)
        status = self.library.GetReal(self.component, self.outputs, count, self._cells) if count else OK
        return self._cells[:count] if status <= WARNING else None

    def get(self, variable: PlannedVariable) -> tuple[int, float]:
        """Return status and value of a variable that is a number."""
        cell = (_CELLS[variable.type] * 1)()
        function = getattr(self.library, "Get" + _FUNCTION_TYPES.get(variable.type, variable.type))
        status = function(self.component, references([variable]), 1, cell)
        return int(status), float(cell[0])

    def set(self, variable: PlannedVariable, value: float) -> int:
        """Set a variable that is a number."""
        kind = _CELLS[variable.type]
        cell = (kind * 1)(value if kind is _Real else int(value))
        function = getattr(self.library, "Set" + _FUNCTION_TYPES.get(variable.type, variable.type))
        return int(function(self.component, references([variable]), 1, cell))

    def step(self, time: float, step: float) -> int:
        """Do one communication step."""
        return int(self.library.DoStep(self.component, time, step, 1))

    def run(self, steps: int, step: float, first: int = 0) -> list[list[float]] | None:
        """Do equal steps with the inputs that stand; return the outputs after each, None on an error."""
        rows = []
        for k in range(first, first + steps):
            if self.step(k * step, step) > WARNING:
                return None
            values = self.get_outputs()
            if values is None:
                return None
            rows.append(values)
        return rows

    def save(self) -> ctypes.c_void_p | None:
        """Return a saved state, None when refused."""
        state = ctypes.c_void_p()
        status = self.library.GetFMUstate(self.component, ctypes.byref(state))
        return state if status <= WARNING else None

    def to_bytes(self, state: ctypes.c_void_p) -> bytes | None:
        """Return a saved state as bytes, None when refused."""
        size = _Size()
        if self.library.SerializedFMUstateSize(self.component, state, ctypes.byref(size)) > WARNING:
            return None
        buffer = ctypes.create_string_buffer(max(size.value, 1))
        status = self.library.SerializeFMUstate(self.component, state, buffer, size.value)
        return buffer.raw[: size.value] if status <= WARNING else None

    def from_bytes(self, content: bytes) -> tuple[int, ctypes.c_void_p]:
        """Return status and the state that bytes stand for."""
        state = ctypes.c_void_p()
        buffer = ctypes.create_string_buffer(content, max(len(content), 1))
        status = self.library.DeSerializeFMUstate(self.component, buffer, len(content), ctypes.byref(state))
        return int(status), state

    def free(self) -> None:
        """Free it."""
        if self.component:
            self.library.FreeInstance(self.component)
            self.component = None


def references(variables: Sequence[PlannedVariable]) -> Any:
    """Return value references as C wants them."""
    return (ctypes.c_uint * max(len(variables), 1))(*(variable.reference for variable in variables))

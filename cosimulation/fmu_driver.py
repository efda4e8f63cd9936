"""Driving a co-simulation FMU sample by sample, with the row rule of every DataSet.

Row k holds the inputs set at t_k and the outputs read at t_k after that set and before the next doStep.
"""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from fmpy.fmi2 import FMU2Slave

from cosimulation.fmu_file import OpenFmu
from cosimulation.fmu_log import STATUS_NAMES, callbacks_for, forget
from fmu_builder.compiler import load_native
from fmu_builder.errors import FmuError, Problem

FloatArray = npt.NDArray[np.float64]
StartValue = float | int | bool | str
FMI2_WARNING = 1
ROWS_AT_ONCE = 500


class _Drive(ctypes.Structure):
    """What c/drive.c needs to know of an FMU and its signals."""

    _fields_ = (
        *(
            (name, ctypes.c_void_p)
            for name in ("component", "set_real", "get_real", "get_boolean", "do_step")
        ),
        *((f"{name}_references", ctypes.c_void_p) for name in ("input", "output", "flag")),
        *((name, ctypes.c_void_p) for name in ("inputs", "outputs", "flags")),
        *((f"{name}_count", ctypes.c_size_t) for name in ("input", "output", "flag")),
        ("rows", ctypes.c_longlong),
        ("sample_time", ctypes.c_double),
    )


@functools.cache
def _drive_rows() -> Any:
    function = load_native("llmn_drive", Path(__file__).parent / "c" / "drive.c").drive_rows
    function.argtypes = (ctypes.c_void_p, ctypes.c_longlong, ctypes.c_longlong, ctypes.c_void_p)
    function.restype = ctypes.c_int
    return function


def converted_start(fmu: OpenFmu, name: str, value: StartValue) -> StartValue:
    """Return a start value as the type of its variable; text is read as a user would type it.

    Raises:
        FmuError: There is no such variable, or the value is none of its type.
    """
    variable = fmu.variable(name)
    if isinstance(value, str) and variable.type == "Enumeration":
        items = {item.name: int(item.value) for item in getattr(variable.declaredType, "items", None) or ()}
        if value not in items:
            mend = f"Choose of {', '.join(items)}"
            raise FmuError.of(fmu.path.name, f"{variable.name} has no item {value!r}", mend)
        return items[value]
    if variable.type == "String":
        return str(value)
    truth = {"true": True, "false": False, "1": True, "0": False}
    if variable.type == "Boolean" and (found := truth.get(str(value).lower().removesuffix(".0"))) is not None:
        return found
    try:
        number = float("nan" if isinstance(value, bool) else value)
    except (ValueError, OverflowError):
        number = float("nan")
    if variable.type in ("Enumeration", "Integer") and number.is_integer():
        return int(number)
    if variable.type == "Real" and np.isfinite(number):
        return number
    what = f"{variable.name} = {value!r} is no value of the type {variable.type}"
    raise FmuError.of(fmu.path.name, what, "Give a value of this type")


class FmuInstance:
    """One running instance of a co-simulation FMU; made by `running_fmu`."""

    def __init__(self, fmu: OpenFmu, instance_name: str) -> None:
        self.fmu = fmu
        self.messages: list[str] = []
        self.flags: npt.NDArray[np.int32] = np.empty((0, 0), dtype=np.int32)
        self._callbacks = callbacks_for(self, self.messages.append)
        description = fmu.description
        try:
            self.slave = FMU2Slave(
                guid=description.guid,
                unzipDirectory=str(fmu.folder),
                modelIdentifier=description.coSimulation.modelIdentifier,
                instanceName=instance_name,
            )
            self.slave.instantiate(callbacks=self._callbacks)
        except Exception as reason:
            forget(self)  # nobody closes what does not exist
            raise self._error(f"cannot be instantiated ({reason})") from reason
        self._references = {item.name: item.valueReference for item in description.modelVariables}

    def _error(self, what: str) -> FmuError:
        said = "; ".join(self.messages[-3:])
        mend = f"The FMU said: {said}" if said else "The FMU gave no message; run it alone to see why"
        return FmuError(Problem(self.fmu.path.name, what, mend))

    def _checked(self, status: int | None, doing: str) -> None:
        if status is not None and status > FMI2_WARNING:
            raise self._error(f"reported {STATUS_NAMES[status]} while {doing}")

    def _call(self, function: Callable[..., Any], doing: str, *arguments: Any) -> Any:
        try:
            result = function(*arguments)
        except Exception as reason:
            said = "" if self.messages else f" ({reason})"
            raise self._error(f"failed while {doing}{said}") from reason
        self._checked(result if isinstance(result, int) else None, doing)
        return result

    def initialise(self, start_values: Mapping[str, StartValue], start_time: float = 0.0) -> None:
        """Set start values and leave initialisation mode.

        Args:
            start_values: Value by variable name; an enumeration also takes the name of its item.
            start_time: [s].

        Raises:
            FmuError: A variable is unknown, a value does not fit its type, or the FMU refuses.
        """
        self.fmu.require(start_values, table="the start values")
        self._call(self.slave.setupExperiment, "setting up the experiment", None, start_time)
        for name, value in start_values.items():
            self._set_start(name, value)
        self._call(self.slave.enterInitializationMode, "entering initialisation")
        self._call(self.slave.exitInitializationMode, f"initialising at {_listing(start_values)}")

    def _set_start(self, name: str, value: StartValue) -> None:
        variable = self.fmu.variable(name)
        setters = {
            "Enumeration": self.slave.setInteger,
            "Integer": self.slave.setInteger,
            "Boolean": self.slave.setBoolean,
            "String": self.slave.setString,
        }
        setter = setters.get(variable.type, self.slave.setReal)
        converted = converted_start(self.fmu, name, value)
        self._call(setter, f"setting {name} = {value!r}", [variable.valueReference], [converted])

    def get(self, names: Sequence[str]) -> FloatArray:
        """Return the present values of Real variables, in the order of `names`."""
        values = self._call(self.slave.getReal, "reading outputs", [self._references[name] for name in names])
        return np.asarray(values, dtype=np.float64)

    def step(self, begin: float, duration: float) -> None:
        """Do one communication step from time `begin` [s] with the inputs that stand."""
        self._call(self.slave.doStep, f"stepping at t = {begin:.6g} s", begin, duration)

    def reset(self) -> None:
        """Return the instance to the state after instantiation; what it said before is forgotten."""
        self._call(self.slave.reset, "resetting")
        self.messages.clear()

    def directional_derivatives(self, unknowns: Sequence[str], knowns: Sequence[str]) -> FloatArray:
        """Return d unknown_i / d known_j [len(unknowns), len(knowns)] at the present point.

        Raises:
            FmuError: The FMU does not provide directional derivatives, or refuses these.
        """
        rows = [self._references[name] for name in unknowns]
        columns = [
            self._call(
                self.slave.getDirectionalDerivative, "differentiating", rows, [self._references[name]], [1.0]
            )
            for name in knowns
        ]
        return np.asarray(columns, dtype=np.float64).T

    def run(
        self,
        inputs: FloatArray,
        input_names: Sequence[str],
        output_names: Sequence[str],
        sample_time: float,
        start_values: Mapping[str, StartValue] | None = None,
        progress: Callable[[int], None] | None = None,
        flags: Sequence[str] = (),
        rows_at_once: int = ROWS_AT_ONCE,
    ) -> FloatArray:
        """Initialise at the first row of `inputs` and co-simulate all rows.

        Args:
            inputs: [N, len(input_names)], one row per sample.
            input_names: Real inputs of the FMU.
            output_names: Real variables to read.
            sample_time: Communication step [s].
            start_values: Start values of variables that `inputs` do not drive.
            progress: Called now and then with the number of rows done since the last call.
            flags: Boolean variables to read beside the outputs; they stand in `flags` afterwards.
            rows_at_once: Rows per call into C; between the calls progress and Ctrl-C have their turn.

        Returns:
            [N, len(output_names)] by the row rule of this module.

        Raises:
            FmuError: A variable is missing, a start value is of a driven input, or the FMU reports an error.
        """
        self.fmu.require(input_names, "input", "Real")
        self.fmu.require(output_names, kind="Real")
        self.fmu.require(flags, kind="Boolean")
        self.flags = np.empty((len(inputs), len(flags)), dtype=np.int32)
        self._refuse_driven(input_names, start_values or {})
        first = dict(zip(input_names, inputs[0].tolist(), strict=True))
        self.initialise({**(start_values or {}), **first})
        return self._loop(
            np.ascontiguousarray(inputs),
            input_names,
            output_names,
            sample_time,
            progress,
            flags,
            rows_at_once,
        )

    def _refuse_driven(self, input_names: Sequence[str], start_values: Mapping[str, StartValue]) -> None:
        what = "is an input that the data drive, so it starts with their first row"
        mend = "Leave it out of the start values"
        found = [
            Problem(f"{self.fmu.path.name}, start value {name} = {value}", what, mend)
            for name, value in start_values.items()
            if name in input_names
        ]
        if found:
            raise FmuError(found)

    def _loop(
        self,
        inputs: FloatArray,
        input_names: Sequence[str],
        output_names: Sequence[str],
        sample_time: float,
        progress: Callable[[int], None] | None,
        flags: Sequence[str],
        rows_at_once: int,
    ) -> FloatArray:
        """Step through all rows in C, `rows_at_once` of them per call."""
        rows = len(inputs)
        outputs = np.empty((rows, len(output_names)))
        references = [self._reference_array(names) for names in (input_names, output_names, flags)]
        drive = _Drive(
            self.slave.component,
            *(self._address(name) for name in ("SetReal", "GetReal", "GetBoolean", "DoStep")),
            *(ctypes.addressof(item) for item in references),
            *(item.ctypes.data for item in (inputs, outputs, self.flags)),
            *(len(names) for names in (input_names, output_names, flags)),
            rows,
            sample_time,
        )
        reached = ctypes.c_longlong()
        for first in range(0, rows, rows_at_once):
            count = min(rows_at_once, rows - first)
            status = _drive_rows()(ctypes.byref(drive), first, count, ctypes.byref(reached))
            self._checked(status, f"stepping at t = {reached.value * sample_time:.6g} s")
            if progress:
                progress(count)
        if not np.isfinite(outputs).all():
            bad = int(np.argmax(~np.isfinite(outputs).all(axis=1)))
            raise self._error(f"returned a value that is not finite at t = {bad * sample_time:.6g} s")
        return outputs

    def _address(self, name: str) -> int | None:
        return ctypes.cast(self.slave.dll[f"fmi2{name}"], ctypes.c_void_p).value

    def _reference_array(self, names: Sequence[str]) -> Any:
        return (ctypes.c_uint * len(names))(*(self._references[name] for name in names))

    def close(self) -> None:
        """Free the instance and unload the library."""
        forget(self)
        if self.slave.component:
            self.slave.freeInstance()


def _listing(values: Mapping[str, StartValue]) -> str:
    return ", ".join(f"{name} = {value}" for name, value in values.items()) or "its start values"


@contextmanager
def running_fmu(fmu: OpenFmu, instance_name: str = "llmn") -> Iterator[FmuInstance]:
    """Instantiate `fmu` for as long as the block lasts.

    Raises:
        FmuError: The FMU cannot be instantiated.
    """
    instance = FmuInstance(fmu, instance_name)
    try:
        yield instance
    finally:
        instance.close()

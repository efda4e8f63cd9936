"""A network as a slave of the package pythonfmu: variables and time; the equations stand in network.py.

An FMU holds this file in resources/, to be read and edited there. Value references count inputs, outputs,
derived outputs, validities and in_range, in this order; a new variable goes into modelDescription.xml, too.
"""

from __future__ import annotations

import ctypes
import hashlib
import json
import math
import weakref
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from pythonfmu import Fmi2Slave
from pythonfmu.enums import Fmi2Status

from fmu_builder.python_fmu.network import Network

_TICK_TOLERANCE = 0.01  # part of a tick within which a communication point lies on the grid
_TIME_TOLERANCE = 0.5  # part of a tick by which a step may begin beside the end of the last one
_LARGEST_TICK = 2.0**53


def _survived(method: Callable[..., Any]) -> Callable[..., Any]:
    """Let the slave live through an exception, which the importer sees as fmi2Fatal.

    The wrapper (pythonfmu 0.7.0) gives up its references to class, instance and log on an exception, goes on
    using them and gives them up again at the end: here they get what is taken away from them.
    """

    @wraps(method)
    def guarded(self: LlmnSlave, *arguments: Any) -> Any:
        try:
            return method(self, *arguments)
        except Exception:
            self._keep()
            raise

    return guarded


class LlmnSlave(Fmi2Slave):  # type: ignore[misc]  # pythonfmu has no types
    """The slave: value references, time and the tick rule of the native FMU.

    The wrapper of pythonfmu turns an exception into fmi2Fatal and drops the instance, so exceptions are left
    to calls that are plainly wrong; a step or a value that cannot be used gives fmi2Discard with a message.
    """

    living: ClassVar[weakref.WeakSet[LlmnSlave]] = weakref.WeakSet()

    def __init__(self, **arguments: Any) -> None:
        self.living.add(self)
        super().__init__(**arguments)
        # Not beside __file__: a second FMU in the process may have this module from the first one's folder.
        text = (Path(str(self.resources)) / "parameter_set.json").read_text(encoding="utf-8")
        content = json.loads(text)
        self.model = hashlib.sha256(text.encode("utf-8")).hexdigest()
        self.modelName = content["name"]
        self.network = Network(content)
        self.inputs = self.network.u_op.copy()
        self.latched = self.inputs.copy()
        self.refused = ""  # why the input values set last cannot be used
        self.mode = "start"
        self.ready = False  # the network stands in the steady state of the present inputs
        self.start_time, self.stop_time, self.time = 0.0, math.inf, 0.0
        self.tick = 0
        self.warned: set[int] = set()
        sizes = (
            len(self.inputs),
            len(self.network.y_op),
            len(self.network.derived),
            self.network.validity.size,
        )
        self.reals = sum(sizes)  # in_range, the one Boolean, follows behind them

    def _keep(self) -> None:
        for taken in (type(self), self, self.log_queue):
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(taken))

    def setup_experiment(self, start_time: float, stop_time: float | None, tolerance: float | None) -> None:
        """Take the time of the experiment [s]."""
        del tolerance
        self.start_time = self.time = start_time
        self.stop_time = math.inf if stop_time is None else stop_time

    @_survived
    def exit_initialization_mode(self) -> None:
        """Begin at tick 0 in the steady state of the start inputs."""
        self._prepare()
        self.latched = self.inputs.copy()
        self.mode = "steps"

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Go from `current_time` over `step_size` [s]; False: the step cannot be taken.

        Tick n uses the inputs in force in the last step that begins at or before t_n; it runs as soon as a
        step reaches t_n+1, both within a hundredth of a tick.
        """
        trouble = self._trouble(current_time, step_size)
        if trouble:
            self.log(trouble, Fmi2Status.discard)
            return False
        begin, end = self._position(current_time), self._position(current_time + step_size)
        if begin <= self.tick + _TICK_TOLERANCE:
            self.latched = self.inputs.copy()
        kept: list[bool] = []
        with np.errstate(all="ignore"):
            while end >= self.tick + 1 - _TICK_TOLERANCE:
                self.network.tick(self.latched)
                kept.append(self.network.in_range)
                if not np.isfinite(self.network.held).all():
                    self.mode = "failed"
                    self.log(
                        "the outputs leave the range of numbers; are the inputs right?", Fmi2Status.error
                    )
                    return False
                self.tick += 1
                self.latched = self.inputs.copy()
        if kept:  # in_range tells of all ticks of a step
            self.network.in_range = all(kept)
        self.time = current_time + step_size
        return True

    def terminate(self) -> None:
        """End the simulation; values can still be read."""
        self.mode = "terminated"

    @_survived
    def get_real(self, vrs: list[int]) -> list[float]:
        """Return values by value reference."""
        self._prepare()
        shown = [*self.inputs, *self.network.outputs(self.inputs), *self.network.validity]
        if any(not 0 <= vr < self.reals for vr in vrs):
            raise IndexError(f"among the value references {vrs} is one of no Real variable")
        return [float(shown[vr]) for vr in vrs]

    @_survived
    def get_boolean(self, vrs: list[int]) -> list[bool]:
        """Return in_range, the only Boolean."""
        self._prepare()
        if any(vr != self.reals for vr in vrs):
            raise IndexError(f"among the value references {vrs} is one of no Boolean variable")
        return [self.network.in_range for _ in vrs]

    @_survived
    def set_real(self, vrs: list[int], values: list[float]) -> None:
        """Set inputs; one that is no number is left as it was, and the next step is refused."""
        if any(not 0 <= vr < len(self.inputs) for vr in vrs):
            raise IndexError(f"among the value references {vrs} is one of no input")
        wrong = [
            self.network.input_names[vr]
            for vr, value in zip(vrs, values, strict=True)
            if not math.isfinite(value)
        ]
        self.refused = f"{', '.join(wrong)}: the value must be a finite number" if wrong else ""
        if self.refused:
            self.log(self.refused, Fmi2Status.discard)
            return
        for vr, value in zip(vrs, values, strict=True):
            self.inputs[vr] = value
            self._warn(vr, value)
        self.ready = self.ready and self.mode != "start"

    @_survived
    def _none_of(self, vrs: list[int], values: list[Any] | None = None) -> list[Any]:
        """Refuse value references of a type that no variable has, or that cannot be set."""
        del values
        if vrs:
            raise IndexError(f"the value references {vrs} are of no such variable")
        return []

    get_integer = get_string = set_integer = set_boolean = set_string = _none_of

    def _warn(self, vr: int, value: float) -> None:
        low, high = self.network.minimum[vr], self.network.maximum[vr]
        if vr not in self.warned and not low <= value <= high:
            self.warned.add(vr)
            name = self.network.input_names[vr]
            self.log(
                f"{name} = {value:g} lies outside {low:g} to {high:g}, served nevertheless",
                Fmi2Status.warning,
            )

    def _prepare(self) -> None:
        if not self.ready:
            self.network.start(self.inputs)
            self.ready = True

    def _position(self, time: float) -> float:
        return (time - self.start_time) / self.network.sample_time

    def _trouble(self, time: float, step: float) -> str:
        """Return why a step cannot be taken, or nothing."""
        slack = _TIME_TOLERANCE * self.network.sample_time
        if self.mode != "steps":
            return "steps are taken after initialisation and before the end, not after an error"
        if self.refused:
            return self.refused
        if not (math.isfinite(time) and math.isfinite(step) and step > 0.0):
            return "communication point and step size must be finite, the step size positive"
        if abs(time - self.time) > slack:
            return f"the communication point is {time:g} s, but the last step ended at {self.time:g} s"
        if time + step > self.stop_time + slack:
            return f"the step ends at {time + step:g} s, beyond the stop time {self.stop_time:g} s"
        return (
            "" if self._position(time + step) <= _LARGEST_TICK else "the step is too long to count its ticks"
        )

    @_survived
    def _get_fmu_state(self) -> dict[str, Any]:
        self._prepare()
        own = ("mode", "start_time", "time", "tick", "refused")
        stop = None if math.isinf(self.stop_time) else self.stop_time
        vectors = {"inputs": self.inputs.tolist(), "latched": self.latched.tolist(), "stop_time": stop}
        named = {"model": self.model, "network": self.network.state()}
        return {n: getattr(self, n) for n in own} | vectors | named

    @classmethod
    def _fmu_state_from_bytes(cls, state: bytes) -> dict[str, Any]:
        try:
            return dict(json.loads(state.decode("utf-8")))
        except (ValueError, TypeError) as reason:
            for slave in cls.living:  # whose call this is cannot be known
                slave._keep()
            raise ValueError("these bytes are no saved state") from reason

    @_survived
    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        if state.get("model") != self.model:
            raise ValueError("this is no saved state of this model")
        for name in ("mode", "start_time", "time", "tick", "refused"):
            setattr(self, name, state[name])
        self.stop_time = math.inf if state["stop_time"] is None else state["stop_time"]
        self.inputs, self.latched = np.array(state["inputs"]), np.array(state["latched"])
        self.network.restore(state["network"])
        self.ready = True

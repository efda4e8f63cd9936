"""The white-box model called directly from Python: the FMU's own C, whole records in one call."""

from __future__ import annotations

import ctypes
import functools
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

import fmu_builder
from fmu_builder.compiler import load_native
from fmu_builder.errors import FmuError, Problem
from fmus.wbm.parameters import PhysicalParameters
from fmus.wbm.variables import DEFAULT_INNER_STEP, INPUTS, OUTPUTS, STATES

__all__ = [
    "C_FOLDER",
    "INCLUDE",
    "INPUTS",
    "OUTPUTS",
    "STATES",
    "LinearModel",
    "Reach",
    "derivatives",
    "equilibrium",
    "linearise",
    "reach",
    "simulate",
    "tangent",
]
C_FOLDER = Path(__file__).parent / "c"
_ROOT = Path(fmu_builder.__file__).parent
INCLUDE = (C_FOLDER, _ROOT / "kernel" / "c", _ROOT / "fmi2" / "c")
Array = NDArray[np.float64]
_MESSAGE_SIZE = 513
_LONGEST_SAMPLE_TICKS = 2.0**31


@dataclass(frozen=True)
class LinearModel:
    """Continuous-time x' = A x + B u, y = C x + D u in deviations; orders as STATES, INPUTS, OUTPUTS."""

    A: Array
    B: Array
    C: Array
    D: Array


@dataclass(frozen=True)
class Reach:
    """What the linkage can reach with an unbent knee: arm angles (rad) and crossbar heights (m)."""

    angle_low: float
    angle_high: float
    height_low: float
    height_high: float


@functools.cache
def _library() -> ctypes.CDLL:
    library = load_native("wbm_host", C_FOLDER / "host.c", INCLUDE)
    library.wbm_simulate.restype = ctypes.c_longlong
    return library


def _pointer(values: Array) -> ctypes.c_void_p:
    return ctypes.c_void_p(values.ctypes.data)


def _vector(parameters: PhysicalParameters) -> Array:
    vector = parameters.vector()
    count = int(_library().wbm_parameter_count())
    if vector.size != count:
        what = f"{vector.size} parameters, but the compiled model reads {count}"
        raise FmuError.of("parameters.json", what, "Keep it in step with the structure Parameters in C")
    return vector


def _doubles(values: ArrayLike, size: int, name: str) -> Array:
    array = np.ascontiguousarray(values, dtype=np.float64)
    if array.shape != (size,):
        raise FmuError.of(name, f"has shape {array.shape}, expected ({size},)", "Pass one number each")
    return array


def _refusal(row: int, text: ctypes.Array[ctypes.c_char]) -> FmuError:
    mend = "Choose inputs, parameters and an inner step that the model can take"
    return FmuError(Problem(f"white-box model, row {row}", text.value.decode("ascii"), mend))


def simulate(
    parameters: PhysicalParameters,
    inputs: ArrayLike,
    sample_time: float = 1e-3,
    inner_step: float = DEFAULT_INNER_STEP,
    state: ArrayLike | None = None,
) -> Array:
    """Simulate one record; the same arithmetic, bit for bit, as the FMU.

    Args:
        parameters: The physical parameters.
        inputs: Shape (rows, 2), columns as INPUTS; row k is held from k to k + 1 sample times.
        sample_time: Time between rows, s; a whole multiple of `inner_step`.
        inner_step: Step of the integration, s.
        state: Start state, order as STATES; None starts in the static equilibrium of the first row.

    Returns:
        Shape (rows, 11), columns as OUTPUTS; row k is read after inputs row k were set, before the step.

    Raises:
        FmuError: Wrong shapes, sample time no multiple, inner step too long for the friction, inputs out of
            reach (with the row).
    """
    u = np.ascontiguousarray(inputs, dtype=np.float64)
    if u.ndim != 2 or u.shape[1] != len(INPUTS) or not u.shape[0]:
        raise FmuError.of("inputs", f"has shape {u.shape}, expected (rows, 2)", "Pass the columns eta, M_pa")
    possible = 0.0 < inner_step <= sample_time <= _LONGEST_SAMPLE_TICKS * inner_step
    ticks = round(sample_time / inner_step) if possible else 0
    if ticks < 1 or abs(ticks * inner_step - sample_time) > 1e-9 * sample_time:
        what = f"{sample_time} s is no whole multiple of the inner step {inner_step} s"
        raise FmuError.of("sample_time", what, "Choose a step that divides it")
    start = np.zeros(len(STATES)) if state is None else _doubles(state, len(STATES), "state").copy()
    outputs = np.empty((u.shape[0], len(OUTPUTS)))
    text = ctypes.create_string_buffer(_MESSAGE_SIZE)
    done = _library().wbm_simulate(
        *(_pointer(_vector(parameters)), ctypes.c_double(inner_step), ctypes.c_longlong(ticks)),
        *(ctypes.c_longlong(u.shape[0]), _pointer(u), _pointer(start), int(state is None)),
        *(_pointer(outputs), text),
    )
    if done != u.shape[0]:
        raise _refusal(max(int(done) - 1, 0), text)
    return outputs


def equilibrium(parameters: PhysicalParameters, inputs: ArrayLike) -> Array:
    """Return the static equilibrium (order as STATES) for one pair of inputs.

    Raises:
        FmuError: The height is out of reach, or no static equilibrium exists there (none with contact, where
            the contact is unilateral).
    """
    state, _, code, text = _settled(parameters, inputs)
    if code:
        raise _refusal(0, text)
    return state


def reach(parameters: PhysicalParameters) -> Reach:
    """Return the range of the linkage; it does not depend on the inputs."""
    _, limits, _, _ = _settled(parameters, (np.nan, 0.0))  # no height: only the limits are wanted
    return Reach(*(float(value) for value in limits))


def _settled(
    parameters: PhysicalParameters, inputs: ArrayLike
) -> tuple[Array, Array, int, ctypes.Array[ctypes.c_char]]:
    u = _doubles(inputs, len(INPUTS), "inputs")
    state, limits = np.zeros(len(STATES)), np.full(4, np.nan)
    text = ctypes.create_string_buffer(_MESSAGE_SIZE)
    vector = _vector(parameters)
    code = _library().wbm_settle(_pointer(vector), _pointer(u), _pointer(state), _pointer(limits), text)
    return state, limits, int(code), text


def derivatives(parameters: PhysicalParameters, state: ArrayLike, inputs: ArrayLike) -> Array:
    """Return the time derivatives of the six states (order as STATES)."""
    x, u = _doubles(state, len(STATES), "state"), _doubles(inputs, len(INPUTS), "inputs")
    rate = np.empty(len(STATES))
    _library().wbm_rates(_pointer(_vector(parameters)), _pointer(x), _pointer(u), _pointer(rate))
    return rate


def tangent(
    parameters: PhysicalParameters,
    state: ArrayLike,
    inputs: ArrayLike,
    state_change: ArrayLike,
    input_change: ArrayLike,
) -> tuple[Array, Array]:
    """Return the exact directional derivatives of the state derivatives (6) and of the outputs (11)."""
    x, u = _doubles(state, len(STATES), "state"), _doubles(inputs, len(INPUTS), "inputs")
    dx = _doubles(state_change, len(STATES), "state_change")
    du = _doubles(input_change, len(INPUTS), "input_change")
    d_rate, d_outputs = np.empty(len(STATES)), np.empty(len(OUTPUTS))
    pointers = (_pointer(values) for values in (_vector(parameters), x, u, dx, du, d_rate, d_outputs))
    _library().wbm_tangent(*pointers)
    return d_rate, d_outputs


def linearise(
    parameters: PhysicalParameters, inputs: ArrayLike, state: ArrayLike | None = None
) -> LinearModel:
    """Return the exact continuous-time linearisation, by default at the static equilibrium of the inputs.

    Raises:
        FmuError: No equilibrium for these inputs.
    """
    x = equilibrium(parameters, inputs) if state is None else np.asarray(state, dtype=np.float64)
    nx, nu, ny = len(STATES), len(INPUTS), len(OUTPUTS)
    model = LinearModel(np.empty((nx, nx)), np.empty((nx, nu)), np.empty((ny, nx)), np.empty((ny, nu)))
    for k, direction in enumerate(np.eye(nx)):
        model.A[:, k], model.C[:, k] = tangent(parameters, x, inputs, direction, np.zeros(nu))
    for k, direction in enumerate(np.eye(nu)):
        model.B[:, k], model.D[:, k] = tangent(parameters, x, inputs, np.zeros(nx), direction)
    return model

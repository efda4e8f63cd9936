"""The C kernel, compiled as in an FMU and loaded into Python."""

from __future__ import annotations

import ctypes
import functools
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fmu_builder.compiler import load_native
from fmu_builder.errors import ParameterSetError
from fmu_builder.kernel.contact import Contact, no_contact
from fmu_builder.kernel.tables import Tables, tables_of
from fmu_builder.parameter_set import ParameterSet

Array = NDArray[np.float64]
SOURCES = Path(__file__).parent / "c"
"""The folder of the kernel's C files: `#include "elementary.c"` and `"kernel.c"` from there."""


@functools.cache
def library() -> ctypes.CDLL:
    """Return the compiled kernel (c/host.c).

    Raises:
        BuildError: There is no compiler, or the kernel does not compile.
    """
    loaded = load_native("llmn_kernel", SOURCES / "host.c", include=(SOURCES,))
    loaded.llmn_feedthrough.restype = ctypes.c_double
    for name in ("llmn_outputs", "llmn_weights", "llmn_static_map", "llmn_nodes"):
        getattr(loaded, name).restype = None
    return loaded


def simulate(network: ParameterSet | Tables, inputs: ArrayLike, contact: Contact | None = None) -> Array:
    """Return the outputs and derived outputs [N, p + R] for the inputs [N, m], row k at t = k * sample_time.

    Row k is read after the inputs of row k were set and before the tick that uses them, so row 0 is the
    steady state of the inputs of row 0.

    Args:
        network: The network.
        inputs: One row per tick.
        contact: That of the network (`contact_of`), to let the pan-head leave the wire; without it pulls.

    Raises:
        ValueError: The inputs are not [N, m] with N >= 1, or not finite.
        ParameterSetError: The network has no steady state for the first inputs, or none with contact.
    """
    tables = network if isinstance(network, Tables) else tables_of(network)
    rows = _checked(inputs, tables.sizes["inputs"])
    outputs = np.empty((len(rows), tables.column_count))
    state = np.empty(tables.state_size)
    failed = library().llmn_simulate(
        ctypes.byref(tables.native()),
        _pointer(state),
        _pointer(rows),
        ctypes.c_longlong(len(rows)),
        _pointer(outputs),
        ctypes.byref(contact) if contact is not None else None,
        _pointer(np.empty(rows.shape[1])),
    )
    if failed == 2:
        raise no_contact()
    if failed:
        raise _no_steady_state()
    return outputs


def validities(network: ParameterSet | Tables, scheduling: ArrayLike) -> Array:
    """Return the weights [N, M] for values [N] of the scheduling variable (low_pass: the filtered one)."""
    return _over_positions(network, scheduling, "llmn_weights", "local_models")


def static_outputs(network: ParameterSet | Tables, scheduling: ArrayLike) -> Array:
    """Return the outputs at rest [N, p] over values [N] of the scheduling input; zero for affine offsets."""
    return _over_positions(network, scheduling, "llmn_static_map", "outputs")


class Network:
    """The kernel with its state, one tick at a time: for tests and for looking inside.

    Attributes:
        tables: What it computes with.
        state: The state array; parts as in `KernelView` of c/kernel.h.
    """

    def __init__(self, network: ParameterSet | Tables) -> None:
        self.tables = network if isinstance(network, Tables) else tables_of(network)
        self.state: Array = np.zeros(self.tables.state_size)
        self._native = self.tables.native()

    def start(self, inputs: ArrayLike) -> None:
        """Enter the steady state for the inputs [m].

        Raises:
            ParameterSetError: There is none.
        """
        row = self._row(inputs)
        if library().llmn_start(ctypes.byref(self._native), _pointer(self.state), _pointer(row)):
            raise _no_steady_state()

    def tick(self, inputs: ArrayLike) -> None:
        """Go from t_n to t_n+1 with the inputs [m] in force at t_n; none is limited."""
        row = self._row(inputs)
        library().llmn_tick(ctypes.byref(self._native), _pointer(self.state), _pointer(row))

    def outputs(self, inputs: ArrayLike) -> Array:
        """Return outputs and derived outputs [p + R] with the inputs [m] set last."""
        row, values = self._row(inputs), np.empty(self.tables.column_count)
        library().llmn_outputs(
            ctypes.byref(self._native), _pointer(self.state), _pointer(row), _pointer(values)
        )
        return values

    def feedthrough(self) -> Array:
        """Return the exact partial derivatives [p + R, m] of all outputs by the inputs set last."""
        shape = (self.tables.column_count, self.tables.sizes["inputs"])
        native, state, call = ctypes.byref(self._native), _pointer(self.state), library().llmn_feedthrough
        return np.array([[call(native, state, i, j) for j in range(shape[1])] for i in range(shape[0])])

    def steady_gain(self, inputs: ArrayLike) -> Array:
        """Return the exact derivatives [p + R + M, m] of outputs and validities at rest.

        Rows: outputs, derived outputs, validities; columns: inputs.

        The network must stand in the steady state of the inputs [m], where the derivatives are taken.

        Raises:
            ParameterSetError: There are none: I - A is singular.
        """
        row, size = self._row(inputs), self.tables.state_size
        columns = []
        for direction in np.eye(row.size):
            change = np.empty(self.tables.column_count + self.tables.sizes["local_models"])
            arrays = (self.state, row, direction, np.empty(size), np.empty(size), change)
            pointers = [_pointer(array) for array in arrays]
            if library().llmn_start_tangent(ctypes.byref(self._native), *pointers):
                raise _no_steady_state()
            columns.append(change)
        return np.array(columns).T

    @property
    def states(self) -> Array:
        """States x [n], or [M, n] with output blending; a view."""
        sizes = self.tables.sizes
        if sizes["blending"]:
            return self.state[: sizes["states"]]
        return self.state[: sizes["local_models"] * sizes["states"]].reshape(-1, sizes["states"])

    @property
    def weights(self) -> Array:
        """Validities [M] at the last tick; a view."""
        first = self.states.size
        return self.state[first : first + self.tables.sizes["local_models"]]

    @property
    def outside(self) -> bool:
        """Whether a tick has moved the scheduling variable further than is certified."""
        return bool(self.state[self.tables.carried_size - 1] != 0.0)

    @property
    def in_range(self) -> bool:
        """Whether the last tick lay in the trained region (c/region.c)."""
        return bool(self.state[self.tables.carried_size - 4] != 0.0)

    def _row(self, inputs: ArrayLike) -> Array:
        return _checked(np.atleast_2d(np.asarray(inputs, dtype=np.float64)), self.tables.sizes["inputs"])


def _over_positions(network: ParameterSet | Tables, positions: ArrayLike, function: str, width: str) -> Array:
    tables = network if isinstance(network, Tables) else tables_of(network)
    values = _checked(np.asarray(positions, dtype=np.float64).reshape(-1, 1), 1)
    result = np.empty((len(values), tables.sizes[width]))
    getattr(library(), function)(
        ctypes.byref(tables.native()),
        _pointer(np.zeros(tables.state_size)),
        _pointer(values),
        ctypes.c_longlong(len(values)),
        _pointer(result),
    )
    return result


def _checked(inputs: ArrayLike, width: int) -> Array:
    rows = np.ascontiguousarray(inputs, dtype=np.float64)
    if rows.ndim != 2 or rows.shape[1] != width or len(rows) == 0:
        raise ValueError(f"inputs have shape {rows.shape}, not [N, {width}] with N >= 1")
    if not np.isfinite(rows).all():
        first = np.argwhere(~np.isfinite(rows))[0][0]
        raise ValueError(f"inputs hold a number that is not finite, first in row {first}")
    return rows


def _pointer(array: Array) -> ctypes.Array[ctypes.c_double]:
    return array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))  # type: ignore[return-value]


def _no_steady_state() -> ParameterSetError:
    what = "the network has no steady state for the start inputs"
    return ParameterSetError.of("local_models", what, "Give models without eigenvalue 1")

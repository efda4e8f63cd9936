"""A parameter set as the flat arrays the C kernel reads (`Tables` in c/kernel.h)."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fmu_builder.kernel.specification import log_weight_coefficients, low_pass_gain, range_middle
from fmu_builder.parameter_set import LocalLinearModel, ParameterSet, Partition

Array = NDArray[np.float64]
_LARGEST = sys.float_info.max
_OFFSETS = ("none", "affine", "low_pass", "scheduled_equilibrium")  # OFFSETS_... of kernel.h

SIZES = (
    *("states", "inputs", "outputs", "derived", "local_models", "models", "output_models"),
    *("nodes", "map_points"),
    *("blending", "offsets", "scheduling", "feedthrough", "deviation_output", "watched"),
)
MODEL_ARRAYS = ("A", "B", "C", "D", "g", "x0", "u0", "y0")
"""One row per model; of C one row where it is the same in all."""

NUMBERS = (
    *("range_low", "range_high", "range_middle", "low_pass_gain", "node_scale", "map_scale"),
    *("deviation_gain", "certified_move", "trained_move"),
)
ARRAYS = (
    *("log_weights", "node_positions", "node_weights", "map_positions", "map_values"),
    *MODEL_ARRAYS,
    *("input_operating_point", "output_operating_point", "input_minimum", "input_maximum"),
    *("derived_minimum", "derived_maximum"),
    "term_coefficients",
)
INDICES = ("term_signals", "term_ends")


class NativeTables(ctypes.Structure):
    """`Tables` of c/kernel.h, field by field."""

    _fields_ = (
        *((name, ctypes.c_int) for name in SIZES),
        *((name, ctypes.c_double) for name in NUMBERS),
        *((name, ctypes.POINTER(ctypes.c_double)) for name in ARRAYS),
        *((name, ctypes.POINTER(ctypes.c_int)) for name in INDICES),
    )


@dataclass(frozen=True)
class Tables:
    """The fields of `Tables` in c/kernel.h, which documents them.

    Attributes:
        sample_time: s.
        sizes: Name to integer.
        numbers: Name to float.
        arrays: Name to float64 array, contiguous, matrices by columns: A[model][column][row]; empty when not
            needed.
        indices: Name to int32 array.
    """

    sample_time: float
    sizes: dict[str, int]
    numbers: dict[str, float]
    arrays: dict[str, Array]
    indices: dict[str, NDArray[np.int32]]

    @property
    def column_count(self) -> int:
        """Outputs and derived outputs."""
        return self.sizes["outputs"] + self.sizes["derived"]

    @property
    def state_size(self) -> int:
        """Doubles in the state array: `kernel_state_size` of c/kernel.c."""
        n, m, p = (self.sizes[name] for name in ("states", "inputs", "outputs"))
        return self.carried_size + 2 + 2 * m + 3 * n + max(n, p) + n * n

    @property
    def carried_size(self) -> int:
        """Doubles of it that carry something from tick to tick; the last of them is `outside`."""
        size = self.sizes
        n, m, p, M = size["states"], size["inputs"], size["outputs"], size["local_models"]
        return (n if size["blending"] else M * n) + M + p + m * p + n + 7

    def native(self) -> NativeTables:
        """Return the C structure; it points into the arrays, so keep `self` alive while it is used."""
        native = NativeTables(**self.sizes, **self.numbers)
        for name, array in self.arrays.items():
            pointer = array.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) if array.size else None
            setattr(native, name, pointer)
        for name, indices in self.indices.items():
            integers = indices.ctypes.data_as(ctypes.POINTER(ctypes.c_int)) if indices.size else None
            setattr(native, name, integers)
        return native


def tables_of(parameter_set: ParameterSet, certified_move: float = 0.0) -> Tables:
    """Return the tables of a parameter set: what costs time in a tick is worked out here.

    Args:
        parameter_set: The network.
        certified_move: Longest move per tick of the clipped scheduling variable for which stability has been
            proved; 0 where the proof does not depend on it, or without one.
    """
    partition, offsets, node_table = parameter_set.partition, parameter_set.offsets, parameter_set.node_table
    output_blending = parameter_set.blending == "output"
    models = parameter_set.local_models if node_table is None or output_blending else node_table.models
    nodes = () if node_table is None else node_table.positions
    points = () if offsets.static_map is None else offsets.static_map.positions
    arrays = {name: np.zeros(0) for name in ARRAYS} | model_arrays(models) | _limits(parameter_set)
    if node_table is None:
        arrays["log_weights"] = _flat(log_weight_coefficients(partition))
    else:
        arrays |= {"node_positions": _flat(nodes), "node_weights": _flat(node_table.weights)}
    if offsets.static_map is not None:
        arrays |= {"map_positions": _flat(points), "map_values": _flat(offsets.static_map.values)}
    output_sizes = _without_repetition(arrays, len(models))
    coefficients, indices = _terms(parameter_set)
    frequency = offsets.corner_frequency
    return Tables(
        sample_time=parameter_set.sample_time,
        sizes={
            "states": parameter_set.state_count,
            "inputs": len(parameter_set.inputs),
            "outputs": len(parameter_set.outputs),
            "derived": len(parameter_set.derived_outputs),
            "local_models": len(parameter_set.local_models),
            "models": len(models),
            **output_sizes,
            "nodes": len(nodes),
            "map_points": len(points),
            "blending": 0 if output_blending else 1,
            "offsets": _OFFSETS.index(offsets.kind),
            "scheduling": parameter_set.scheduling_index,
            "deviation_output": _deviation_index(parameter_set),
            "watched": int(arrays["derived_minimum"].size > 0),
        },
        numbers={
            "range_low": partition.range[0],
            "range_high": partition.range[1],
            "range_middle": range_middle(partition),
            "low_pass_gain": 0.0
            if frequency is None
            else low_pass_gain(frequency, parameter_set.sample_time),
            "node_scale": _scale(nodes),
            "map_scale": _scale(points),
            "deviation_gain": partition.deviation_gain,
            "certified_move": certified_move,
            "trained_move": trained_move(parameter_set),
        },
        arrays=arrays | {"term_coefficients": coefficients},
        indices=indices,
    )


def with_validity(
    tables: Tables,
    partition: Partition,
    node_weights: Array | None = None,
    node_models: Mapping[str, Array] | None = None,
) -> Tables:
    """Return the tables of the same network with other numbers of its validity: what a search changes.

    Nothing is checked: a result that is kept is built as a parameter set.

    Args:
        tables: Those of a network with the same kind of validity, centres and nodes.
        partition: The other partition.
        node_weights: Weights at the nodes, shape (K, M); without them the Gaussians are taken.
        node_models: Matrices and vectors by name, shape (models, ...); none of them for output blending.
    """
    if node_weights is None:
        arrays = {"log_weights": _flat(log_weight_coefficients(partition))}
    else:
        arrays = {"node_weights": np.ascontiguousarray(node_weights).ravel()}
    for name, values in (node_models or {}).items():
        columns = values.transpose(0, 2, 1) if values.ndim == 3 else values
        arrays[name] = np.ascontiguousarray(columns).ravel()
    numbers = {**tables.numbers, "deviation_gain": partition.deviation_gain}
    output_sizes = _without_repetition(arrays, tables.sizes["models"]) if node_models else {}
    return replace(
        tables, sizes={**tables.sizes, **output_sizes}, numbers=numbers, arrays={**tables.arrays, **arrays}
    )


def without_arrays(tables: Tables, names: Sequence[str]) -> Tables:
    """Return tables whose arrays of these names are empty: what an FMU makes itself."""
    return replace(tables, arrays={**tables.arrays, **{name: np.zeros(0) for name in names}})


def _deviation_index(parameter_set: ParameterSet) -> int:
    """Return the position of the output whose deviation also schedules; 0 when there is none."""
    output = parameter_set.partition.deviation_output
    return 0 if output is None else [signal.name for signal in parameter_set.outputs].index(output)


def _flat(rows: Sequence[float] | Sequence[Sequence[float]]) -> Array:
    return np.ascontiguousarray(np.array(rows, dtype=np.float64).ravel())


def _scale(positions: Sequence[float]) -> float:
    return (len(positions) - 1) / (positions[-1] - positions[0]) if positions else 0.0


def model_arrays(models: Sequence[LocalLinearModel]) -> dict[str, Array]:
    """Return the arrays of `MODEL_ARRAYS` that models have, matrices by columns: A[model][column][row]."""

    def by_columns(of: Callable[[LocalLinearModel], Sequence[Sequence[float]]]) -> Array:
        return np.ascontiguousarray(np.array([of(model) for model in models]).transpose(0, 2, 1).ravel())

    arrays = {
        "A": by_columns(lambda model: model.A),
        "B": by_columns(lambda model: model.B),
        "C": by_columns(lambda model: model.C),
        "D": by_columns(lambda model: model.D),
    }
    for name in ("g", "x0", "u0", "y0"):
        vectors = [getattr(model, name) for model in models]
        if None not in vectors:
            arrays[name] = _flat(vectors)
    return arrays


def _without_repetition(arrays: dict[str, Array], models: int) -> dict[str, int]:
    """Keep one C where all models have the same, and no D where all are zero; return the sizes that tell."""
    rows = np.ascontiguousarray(arrays["C"].reshape(models, -1))
    if all(row.tobytes() == rows[0].tobytes() for row in rows):
        rows = rows[:1]
    feedthrough = bool(arrays["D"].any())
    arrays["C"] = rows.ravel()
    if not feedthrough:
        arrays["D"] = np.zeros(0)
    return {"output_models": len(rows), "feedthrough": int(feedthrough)}


def trained_move(parameter_set: ParameterSet) -> float:
    """Return how far the scheduling input moved per tick in training; the largest number: nobody knows."""
    region = parameter_set.trained_region
    return _LARGEST if region is None else min(region.rate * parameter_set.sample_time, _LARGEST)


def input_limits(parameter_set: ParameterSet) -> list[tuple[float, float]]:
    """Return smallest and largest trained value of every input; of the scheduling input within the range."""
    limits = [(signal.minimum, signal.maximum) for signal in parameter_set.inputs]
    (low, high), index = parameter_set.partition.range, parameter_set.scheduling_index
    limits[index] = max(limits[index][0], low), min(limits[index][1], high)
    return limits


def _limits(parameter_set: ParameterSet) -> dict[str, Array]:
    """Return operating point and trained limits of the signals."""
    inputs, outputs, limits = parameter_set.inputs, parameter_set.outputs, input_limits(parameter_set)
    arrays = {
        "input_operating_point": _flat([signal.operating_point for signal in inputs]),
        "output_operating_point": _flat([signal.operating_point for signal in outputs]),
        "input_minimum": _flat([low for low, _ in limits]),
        "input_maximum": _flat([high for _, high in limits]),
    }
    known = {} if parameter_set.trained_region is None else parameter_set.trained_region.derived_outputs
    if known:
        spans = [known.get(one.name, (-_LARGEST, _LARGEST)) for one in parameter_set.derived_outputs]
        arrays["derived_minimum"] = _flat([low for low, _ in spans])
        arrays["derived_maximum"] = _flat([high for _, high in spans])
    return arrays


def _terms(parameter_set: ParameterSet) -> tuple[Array, dict[str, NDArray[np.int32]]]:
    signals = [*(signal.name for signal in parameter_set.outputs), *parameter_set.input_names]
    coefficients: list[float] = []
    positions: list[int] = []
    ends: list[int] = []
    for derived in parameter_set.derived_outputs:
        for term in derived.terms:
            coefficients.append(term.sign * derived.parameters[term.parameter].value)
            positions.append(signals.index(term.signal))
        ends.append(len(positions))
    signal_array, end_array = np.array(positions, dtype=np.int32), np.array(ends, dtype=np.int32)
    indices = {"term_signals": signal_array, "term_ends": end_array}
    return _flat(coefficients), indices

"""Networks whose models at the nodes an FMU makes of its local models: the same bits, fewer numbers."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fmu_builder.kernel.native import library
from fmu_builder.kernel.tables import MODEL_ARRAYS, Tables, model_arrays, tables_of
from fmu_builder.parameter_set import ParameterSet

Array = NDArray[np.float64]


@dataclass(frozen=True)
class BlendedNodes:
    """What the models at the nodes are made of.

    Attributes:
        tables: Those of the network with its M local models in the place of its models at K nodes; a C that
            is the same at all nodes stays.
        numbers: Name of `MODEL_ARRAYS` -> numbers per node that are made of the local models, else 0.
    """

    tables: Tables
    numbers: dict[str, int]


def blended_nodes(parameter_set: ParameterSet, certified_move: float = 0.0) -> BlendedNodes | None:
    """Return what the models at the nodes are sums of; None where they are not, or nothing is gained.

    They are when every number is sum_i w_i times that of local model i, added in this order, to the last bit.
    """
    tables = tables_of(parameter_set, certified_move)
    nodes, models = tables.sizes["nodes"], tables.sizes["local_models"]
    if parameter_set.blending == "output" or nodes <= models:
        return None
    local = model_arrays(parameter_set.local_models)
    numbers = dict.fromkeys(MODEL_ARRAYS, 0)
    for name in MODEL_ARRAYS:
        if tables.arrays[name].size and not (name == "C" and tables.sizes["output_models"] == 1):
            numbers[name] = local[name].size // models
            if _at_nodes(tables, local[name]).tobytes() != tables.arrays[name].tobytes():
                return None
    kept = {name: local[name] for name, count in numbers.items() if count}
    return BlendedNodes(replace(tables, arrays={**tables.arrays, **kept}), numbers)


def _at_nodes(tables: Tables, rows: Array) -> Array:
    """Return sum_i w_i row_i at every node, by the C that does it in the FMU."""
    length = rows.size // tables.sizes["local_models"]
    found = np.empty(tables.sizes["nodes"] * length)
    given, made = (array.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for array in (rows, found))
    library().llmn_nodes(ctypes.byref(tables.native()), given, ctypes.c_int(length), made)
    return found

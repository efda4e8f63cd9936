"""The baseline: one linear model of the whole range, from a continuous linearisation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import control
import numpy as np

from fmu_builder.errors import IdentificationError
from fmu_builder.parameter_set import DerivedOutput, InputSignal, OutputSignal, ParameterSet
from identification.arrays import Array
from identification.data_set import DataSet
from identification.local_model import LocalModel
from identification.network import NetworkSettings, assemble, partition_of
from identification.region import trained_region

_SETTINGS = NetworkSettings(validity="hat_clamped", blending="output", offsets="affine")


def discretised(
    matrices: tuple[Array, Array, Array, Array],
    sample_time: float,
    inputs: Sequence[str],
    outputs: Sequence[str],
    input_operating_point: Array,
    output_operating_point: Array,
) -> LocalModel:
    """Return the zero-order-hold equivalent of x' = A x + B u, y = C x + D u as a local model.

    Args:
        matrices: A, B, C, D of the continuous model, in deviations from the operating point.
        sample_time: Ts [s].
        inputs: Names of the m inputs.
        outputs: Names of the p outputs.
        input_operating_point: u_0, shape (m,).
        output_operating_point: y_0, shape (p,).

    Raises:
        IdentificationError: Shapes that do not fit or numbers that are not finite.
    """
    try:
        if not all(np.all(np.isfinite(matrix)) for matrix in matrices):
            raise ValueError("numbers that are not finite")
        discrete = control.c2d(control.ss(*matrices), sample_time, method="zoh")
    except (ValueError, control.ControlDimension, np.linalg.LinAlgError) as reason:
        mend = "Give A, B, C, D that fit together, of a model that can be linearised there"
        raise IdentificationError.of("linearisation", f"cannot be discretised ({reason})", mend) from reason
    return LocalModel(
        discrete.A,
        discrete.B,
        discrete.C,
        discrete.D,
        sample_time,
        tuple(inputs),
        tuple(outputs),
        np.asarray(input_operating_point, dtype=np.float64),
        np.asarray(output_operating_point, dtype=np.float64),
    )


def linear_parameter_set(
    name: str,
    model: LocalModel,
    scheduling: str,
    limits: tuple[float, float],
    signals: tuple[tuple[InputSignal, ...], tuple[OutputSignal, ...]],
    derived_outputs: Sequence[DerivedOutput] = (),
    provenance: Mapping[str, Any] | None = None,
    training: Sequence[DataSet] = (),
) -> ParameterSet:
    """Return a network of one local model with the affine offsets u_0, y_0 of its operating point.

    Args:
        name: C identifier; the FMU's default model identifier.
        model: The discrete model, from `discretised` or `subspace.estimate`.
        scheduling: Name of the scheduling input; it decides nothing here but `in_range`.
        limits: Range of the scheduling input.
        signals: Inputs and outputs.
        derived_outputs: Outputs computed from inputs and outputs.
        provenance: Where it comes from.
        training: The data that the limits of the signals come from.

    Raises:
        DataError: Columns are missing.
        ParameterSetError: Not a valid parameter set; every problem is named.
    """
    centre = model.input_operating_point[model.inputs.index(scheduling)]
    return assemble(
        name,
        [model],
        partition_of(_SETTINGS, scheduling, limits, [centre]),
        _SETTINGS,
        signals,
        derived_outputs=derived_outputs,
        kind="linear",
        provenance=dict(provenance or {}),
        trained_region=trained_region(training, model.inputs, scheduling, model.sample_time, derived_outputs),
    )

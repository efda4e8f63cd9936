"""Linearising any FMU that provides directional derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cosimulation.fmu_driver import FloatArray, StartValue, running_fmu
from cosimulation.fmu_file import OpenFmu
from fmu_builder.errors import FmuError


@dataclass(frozen=True)
class Linearisation:
    """A continuous-time linear model about an operating point: x' = A dx + B du, y = y_op + C dx + D du.

    Attributes:
        A: [n, n].
        B: [n, m].
        C: [p, n].
        D: [p, m].
        states: Names of the n states.
        inputs: Names of the m inputs.
        outputs: Names of the p outputs.
        input_operating_point: [m].
        output_operating_point: [p].
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    input_operating_point: FloatArray
    output_operating_point: FloatArray


def linearise(
    fmu: OpenFmu,
    operating_point: Mapping[str, float],
    outputs: Sequence[str],
    start_values: Mapping[str, StartValue] | None = None,
) -> Linearisation:
    """Linearise an FMU about the state it initialises to.

    Args:
        fmu: Has `providesDirectionalDerivative` and lists its states.
        operating_point: Value of every input, in order.
        outputs: Variables to linearise.
        start_values: Of parameters.

    Raises:
        FmuError: The FMU provides no directional derivatives or lists no states, a variable is missing, or
            it refuses the operating point.
    """
    provides = fmu.description.coSimulation.providesDirectionalDerivative
    derivatives = [item.variable for item in fmu.description.derivatives]
    if not provides or not derivatives:
        what = "provides no directional derivatives" if not provides else "lists no continuous states"
        raise FmuError.of(fmu.path.name, what, "Linearise another FMU, or identify a model from data instead")
    fmu.require(operating_point, "input")
    fmu.require(outputs)
    inputs = tuple(operating_point)
    states = tuple(item.derivative.name for item in derivatives)
    rates = [item.name for item in derivatives]
    with running_fmu(fmu, "linearise") as instance:
        instance.initialise({**(start_values or {}), **operating_point})
        values = instance.get(outputs)
        A = instance.directional_derivatives(rates, states)
        B = instance.directional_derivatives(rates, inputs)
        C = instance.directional_derivatives(outputs, states)
        D = instance.directional_derivatives(outputs, inputs)
    point = np.asarray(list(operating_point.values()), dtype=np.float64)
    return Linearisation(A, B, C, D, states, inputs, tuple(outputs), point, values)

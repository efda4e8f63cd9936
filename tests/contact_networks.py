"""Networks whose contact can open: random ones, and the linearised white-box model."""

from __future__ import annotations

import networks
import numpy as np

from fmu_builder.parameter_set import (
    DerivedOutput,
    DerivedTerm,
    InputSignal,
    NamedParameter,
    OutputSignal,
    ParameterSet,
)
from fmus.wbm import PhysicalParameters, native
from identification.linear import discretised, linear_parameter_set

OUTPUTS = ("xi", "xi_dot", "zeta", "zeta_dot")


def touching(variant: tuple[str, str, str], seed: int) -> ParameterSet:
    """A random network in which y_2 presses against u_1, and y_0 counts as the velocity of y_2."""
    text = networks.network(seed, *variant, feedthrough=False).canonical_json()
    return ParameterSet.model_validate_json(text.replace('"y_0"', '"y_2_dot"'))


def linearised(parameters: PhysicalParameters, point: tuple[float, float]) -> ParameterSet:
    """The white-box model's linearisation at an operating point as a network of one model, ticks of 1 ms."""
    rows = [native.OUTPUTS.index(name) for name in OUTPUTS]
    at = native.linearise(parameters, point)
    rest = native.simulate(parameters, [point])[0, rows]
    matrices = (at.A, at.B, at.C[rows], at.D[rows])
    model = discretised(matrices, 1e-3, native.INPUTS, OUTPUTS, np.array(point), rest)
    units = {"eta": "m", "M_pa": "N.m", "xi": "m", "xi_dot": "m/s", "zeta": "m", "zeta_dot": "m/s"}

    def signal(kind: type, name: str, value: float) -> InputSignal | OutputSignal:
        size = abs(value) + 1.0
        return kind(name=name, unit=units[name], operating_point=value, minimum=-size, maximum=2.0 * size)

    force = DerivedOutput(
        name="F_p",
        unit="N",
        terms=(
            DerivedTerm(signal="xi", parameter="k_E", sign=1),
            DerivedTerm(signal="eta", parameter="k_E", sign=-1),
        ),
        parameters={"k_E": NamedParameter(value=parameters["k_E"], unit="N/m")},
    )
    signals = (
        tuple(signal(InputSignal, *one) for one in zip(native.INPUTS, point, strict=True)),
        tuple(signal(OutputSignal, *one) for one in zip(OUTPUTS, rest.tolist(), strict=True)),
    )
    return linear_parameter_set("linearised", model, "eta", (0.5, 2.5), signals, (force,))

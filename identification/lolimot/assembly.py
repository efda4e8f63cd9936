"""From a LOLIMOT network to a parameter set, and so to an FMU."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fmu_builder.errors import IdentificationError
from fmu_builder.parameter_set import DerivedOutput, Offsets, ParameterSet, Partition, nested
from identification.data_set import DataSet
from identification.lolimot.network import ArxNetwork, identify
from identification.lolimot.settings import LolimotSettings
from identification.lolimot.state_space import local_systems
from identification.network import signals_of


def lolimot_parameter_set(
    name: str,
    data: Sequence[DataSet],
    inputs: Sequence[str],
    output: str,
    settings: LolimotSettings | None = None,
    derived_outputs: Sequence[DerivedOutput] = (),
) -> ParameterSet:
    """Identify a network with LOLIMOT and return it as a parameter set (Nelles 2001; thesis section 3.2.4).

    A baseline: one output per network, states without physical meaning, and no proof of stability.

    Args:
        name: C identifier; the FMU's default model identifier.
        data: Training data that go through the whole operating range, SI units.
        inputs: Names of the m inputs.
        output: Name of the output.
        settings: Orders, tree and state-space form; the defaults are the thesis's.
        derived_outputs: Outputs computed from inputs and output.

    Returns:
        Kind "lolimot", Gaussians, offsets "affine", sample time that of the data times `settings.every`;
        `declared_unstable` where a local model is unstable.

    Raises:
        DataError: The data do not fit; see `identify`.
        IdentificationError: The form does not exist, or more than one input schedules.
        ParameterSetError: Not a valid parameter set; every problem is named.
    """
    network = identify(data, inputs, output, settings or LolimotSettings())
    return as_parameter_set(name, network, data, derived_outputs)


def as_parameter_set(
    name: str,
    network: ArxNetwork,
    data: Sequence[DataSet],
    derived_outputs: Sequence[DerivedOutput] = (),
    **rest: Any,
) -> ParameterSet:
    """Return an identified network as a parameter set; see `lolimot_parameter_set`.

    Args:
        name: C identifier.
        network: The network.
        data: What it was identified from, for units and limits of the signals.
        derived_outputs: Outputs computed from inputs and output.
        rest: Further fields of the parameter set.
    """
    settings = network.settings
    if len(settings.scheduling) != 1:
        what = f"{', '.join(settings.scheduling)} schedule; a parameter set knows one scheduling input"
        raise IdentificationError.of("LOLIMOT, scheduling", what, "Name one input")
    ((scheduling, limits),) = settings.scheduling.items()
    parts = local_systems(network)
    point = {name: float(value) for name, value in zip(network.inputs, network.input_point, strict=True)}
    point[scheduling] = min(max(point[scheduling], limits[0]), limits[1])
    rest_output = network.at_rest(np.array([[point[one] for one in network.inputs]]))
    signals = signals_of(data, network.inputs, (network.output,), point, rest_output)
    radii = [float(np.abs(network.poles(index)).max()) for index in range(len(parts))]
    return ParameterSet(
        name=name,
        kind="lolimot",
        sample_time=network.sample_time,
        inputs=signals[0],
        outputs=signals[1],
        partition=Partition(
            scheduling=scheduling,
            range=limits,
            validity="gaussian",
            centres=nested(network.cells.centres[:, 0]),
            spreads=nested(network.cells.widths[:, 0]),
            k_sigma=settings.k_sigma,
        ),
        blending=settings.blending,
        local_models=parts,
        offsets=Offsets(kind="affine"),
        derived_outputs=tuple(derived_outputs),
        declared_unstable=max(radii) >= 1.0,
        **rest,
    )

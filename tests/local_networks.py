"""Local models with known equations as identification leaves them, and whole-range data of their networks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from linear_plants import CONTACT_STIFFNESS, THREE_MASS_OUTPUTS, THREE_MASS_UNITS, three_mass

from fmu_builder.kernel import simulate
from fmu_builder.parameter_set import DerivedOutput, DerivedTerm, NamedParameter, ParameterSet
from identification.arrays import Array
from identification.data_set import DataSet
from identification.excitation import ExcitationSettings, whole_range_inputs
from identification.local_model import LocalModel
from identification.n4sid import LocalModels, N4sidSettings
from identification.network import signals_of
from identification.static_map import StaticMap

HEIGHTS = (0.75, 1.25, 1.75, 2.25)
INPUTS = ("eta", "M_pa")
POINT = {"eta": 1.5, "M_pa": 1310.9}
OUTPUT_SCALE = np.array([0.0024, 0.05, 0.002, 0.05])
FORCE = DerivedOutput(
    name="F_p",
    unit="N",
    terms=(
        DerivedTerm(signal="xi", parameter="k_E", sign=1),
        DerivedTerm(signal="eta", parameter="k_E", sign=-1),
    ),
    parameters={"k_E": NamedParameter(value=CONTACT_STIFFNESS, unit="N/m")},
)


def straight_map(plant: LocalModel) -> StaticMap:
    positions = np.linspace(0.5, 2.5, 5)
    values = plant.output_operating_point + np.outer(positions - 1.5, plant.dc_gain[:, 0])
    return StaticMap(positions, values, plant.outputs)


def local_models(
    scales: Sequence[float], centres: Sequence[float] = HEIGHTS, transforms: Sequence[Array] | None = None
) -> LocalModels:
    """Three masses per centre, each with its own stiffness, in the coordinates T x."""
    models = [three_mass(scale) for scale in scales]
    if transforms is not None:
        models = [model.transformed(T) for model, T in zip(models, transforms, strict=True)]
    inputs = whole_range_inputs(1, duration=1.0)
    rest = models[0].output_operating_point
    data = inputs.with_columns(THREE_MASS_OUTPUTS, THREE_MASS_UNITS, np.tile(rest, (len(inputs), 1)))
    data = replace(
        data, values=data.values + np.linspace(-1.2, 1.2, len(data))[:, None] * [1, 90, 0, 0, 0, 0]
    )
    signals = signals_of([data], INPUTS, THREE_MASS_OUTPUTS, POINT, rest)
    settings = N4sidSettings(centres=tuple(centres))
    return LocalModels(
        settings, np.array(centres), tuple(models), signals, straight_map(three_mass()), OUTPUT_SCALE
    )


def recorded(network: ParameterSet, seed: int, duration: float = 12.0) -> DataSet:
    """Whole-range data of a network."""
    inputs = whole_range_inputs(seed, (1,), duration, settings=ExcitationSettings(noise_rms=0.0024))
    found = simulate(network, inputs.matrix(INPUTS))[:, :4]
    return inputs.with_columns(THREE_MASS_OUTPUTS, THREE_MASS_UNITS, found)

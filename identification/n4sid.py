"""The whole n4sid job: operating-point experiments -> local models -> networks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from fmu_builder.errors import DataError, IdentificationError, Problem
from fmu_builder.parameter_set import DerivedOutput, InputSignal, OutputSignal, ParameterSet
from identification import static_map as maps
from identification.arrays import Array
from identification.data_set import DataSet
from identification.local_model import LocalModel
from identification.network import NetworkSettings, assemble, partition_of, signals_of
from identification.static_map import StaticMap
from identification.subspace import SubspaceSettings, aligned, estimate
from identification.subspace.alignment import HORIZON
from identification.validity import equidistant_centres

_OFF_CENTRE = 0.1
"""How far an experiment may be from its centre, in cells."""


class N4sidSettings(BaseModel):
    """What is identified from which signals; the defaults are the pantograph's."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    inputs: tuple[str, ...] = ("eta", "M_pa")
    outputs: tuple[str, ...] = ("xi", "xi_dot", "zeta", "zeta_dot")
    scheduling: str = Field(default="eta", description="the input that schedules")
    low: float = Field(default=0.5, description="low end of the operating range")
    high: float = Field(default=2.5, description="high end of the operating range")
    local_models: int = Field(default=4, ge=1, description="number of local models, centres equidistant")
    operating_point: dict[str, float] = Field(
        default_factory=lambda: {"eta": 1.5, "M_pa": 1310.9}, description="start value of every input"
    )
    subspace: SubspaceSettings = SubspaceSettings()
    alignment_horizon: int = Field(default=HORIZON, ge=2, description="samples compared for alignment")


@dataclass(frozen=True, eq=False)
class LocalModels:
    """Everything configurations of a network share.

    Attributes:
        settings: The settings it was identified with.
        centres: Centres of the M local models, shape (M,).
        models: The M local models in common state coordinates.
        signals: Inputs and outputs with units, operating point and training limits.
        static_map: Outputs at rest over the scheduling input.
        provenance: Names and content hashes of the training data.
        output_scale: Mean standard deviation of each output in training, shape (p,).
    """

    settings: N4sidSettings
    centres: Array
    models: tuple[LocalModel, ...]
    signals: tuple[tuple[InputSignal, ...], tuple[OutputSignal, ...]]
    static_map: StaticMap
    output_scale: Array
    provenance: dict[str, Any] = field(default_factory=dict)


def identify(
    experiments: Sequence[DataSet],
    settings: N4sidSettings | None = None,
    static_map: StaticMap | None = None,
    descriptions: dict[str, str] | None = None,
) -> LocalModels:
    """Return aligned local models from operating-point experiments.

    Args:
        experiments: Data sets at the centres, in any order; several at one centre are used together.
        settings: Settings; default the pantograph's.
        static_map: Outputs at rest with the other inputs at their operating point; default: a smooth curve
            through the rest points of the local models.
        descriptions: One line per signal, for readers of the FMU.

    Raises:
        DataError: Columns are missing.
        IdentificationError: A centre without experiment, an experiment off its centre, or what the estimator
            refuses; all centres are looked at before it is raised.
    """
    chosen = settings or N4sidSettings()
    centres = equidistant_centres(chosen.local_models, chosen.low, chosen.high)
    _refuse_missing_columns(experiments, (*chosen.inputs, *chosen.outputs))
    groups = _grouped(experiments, centres, chosen)
    models, found = [], []
    for centre, group in zip(centres, groups, strict=True):
        try:
            models.append(estimate(group, chosen.inputs, chosen.outputs, chosen.subspace))
        except IdentificationError as refused:
            place = f"local model at {chosen.scheduling} = {centre:g}"
            found += [Problem(f"{place}, {one.place}", one.what, one.mend) for one in refused.problems]
    if found:
        raise IdentificationError(found)
    ordered = [data for group in groups for data in group]
    scale = np.mean([data.matrix(chosen.outputs).std(axis=0) for data in ordered], axis=0)
    common = aligned(models, scale, chosen.alignment_horizon)
    limits = (chosen.low, chosen.high)
    rest = static_map or maps.from_local_models(
        models, centres.tolist(), chosen.operating_point, chosen.scheduling, limits
    )
    start = rest.select(chosen.outputs).at(np.array([chosen.operating_point[chosen.scheduling]]))[0]
    signals = signals_of(ordered, chosen.inputs, chosen.outputs, chosen.operating_point, start, descriptions)
    data = [{"name": one.name, "content_hash": one.content_hash} for one in ordered]
    provenance = {"training": data, "settings": chosen.model_dump(mode="json")}
    return LocalModels(chosen, centres, tuple(common), signals, rest, scale, provenance)


def network(
    name: str,
    local: LocalModels,
    settings: NetworkSettings,
    derived_outputs: Sequence[DerivedOutput] = (),
    **rest: Any,
) -> ParameterSet:
    """Return one configuration of a network.

    Args:
        name: C identifier; the FMU's default model identifier.
        local: The local models.
        settings: Validity, blending and offsets (`network.RECOMMENDED`, `network.THESIS`, ...).
        derived_outputs: Outputs computed from inputs and outputs.
        rest: Further fields of the parameter set; `provenance` is added to that of the local models.

    Raises:
        ParameterSetError: Not a valid parameter set; every problem is named.
    """
    limits = (local.settings.low, local.settings.high)
    partition = partition_of(settings, local.settings.scheduling, limits, local.centres.tolist())
    provenance = {
        **local.provenance,
        "network": settings.model_dump(mode="json"),
        **rest.pop("provenance", {}),
    }
    return assemble(
        name,
        local.models,
        partition,
        settings,
        local.signals,
        local.static_map,
        derived_outputs,
        provenance=provenance,
        **rest,
    )


def _refuse_missing_columns(experiments: Sequence[DataSet], names: Sequence[str]) -> None:
    found: list[Problem] = []
    for data in experiments:
        try:
            data.matrix(names)
        except DataError as refused:
            found += refused.problems
    if found:
        raise DataError(found)


def _grouped(experiments: Sequence[DataSet], centres: Array, settings: N4sidSettings) -> list[list[DataSet]]:
    """Return the experiments of every centre, in the order of their content (not of the list)."""
    missing = [name for name in settings.inputs if name not in settings.operating_point]
    found = [
        Problem(f"operating_point.{name}", "is missing", f"Give the operating point of {name}")
        for name in missing
    ]
    if settings.scheduling not in settings.inputs:
        what = f"{settings.scheduling!r} is no input"
        found.append(Problem("scheduling", what, f"Name one of {', '.join(settings.inputs)}"))
    if not settings.low < settings.high:
        found.append(Problem("range", f"{settings.low} .. {settings.high} is empty", "Give low < high"))
    if found:
        raise IdentificationError(found)
    cell = (settings.high - settings.low) / len(centres)
    groups: list[list[DataSet]] = [[] for _ in centres]
    for data in experiments:
        middle = float(data.column(settings.scheduling).mean())
        index = int(np.argmin(np.abs(centres - middle)))
        if abs(centres[index] - middle) > _OFF_CENTRE * cell:
            what = f"lies at {settings.scheduling} = {middle:.4g}, the nearest centre is {centres[index]:.4g}"
            found.append(Problem(f"data set {data.name!r}", what, "Use operating-point data at the centres"))
        groups[index].append(data)
    for centre, group in zip(centres, groups, strict=True):
        if not group:
            what = "has no experiment"
            place = f"centre {settings.scheduling} = {centre:g}"
            found.append(Problem(place, what, "Give an operating-point data set there"))
    if found:
        raise IdentificationError(found)
    return [sorted(group, key=lambda data: data.content_hash) for group in groups]

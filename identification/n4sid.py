"""The whole n4sid job: operating-point experiments -> local models -> networks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from fmu_builder.errors import DataError, IdentificationError, Problem
from fmu_builder.parameter_set import (
    DerivedOutput,
    InputSignal,
    OutputSignal,
    ParameterSet,
    Partition,
    TrainedRegion,
)
from identification import static_map as maps
from identification.arrays import Array
from identification.choice import Choice
from identification.data_set import DataSet
from identification.local_model import LocalModel
from identification.network import NetworkSettings, assemble, partition_of, signals_of, widened
from identification.region import trained_region
from identification.static_map import StaticMap
from identification.subspace import SubspaceSettings, estimate
from identification.subspace.alignment import HORIZON, Alignment, in_common_coordinates
from identification.validity import cell_widths, equidistant_centres
from identification.warning import IdentificationWarning

_OFF_CENTRE = 0.1
"""How far an experiment may be from its centre, in cells."""

_PANTOGRAPH = {"eta": 1.5, "M_pa": 1310.9}
"""Operating point of the pantograph's inputs [m, N.m]."""

MOST_LOCAL_MODELS = 100
"""Every one needs an experiment of its own; the thesis has up to eight."""


class N4sidSettings(BaseModel):
    """What is identified from which signals; the defaults are the pantograph's."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    inputs: tuple[str, ...] = ("eta", "M_pa")
    outputs: tuple[str, ...] = ("xi", "xi_dot", "zeta", "zeta_dot")
    scheduling: str = Field(default="eta", description="the input that schedules")
    low: float = Field(default=0.5, description="low end of the operating range")
    high: float = Field(default=2.5, description="high end of the operating range")
    local_models: int = Field(
        default=4, ge=1, le=MOST_LOCAL_MODELS, description="number of local models, centres equidistant"
    )
    centres: tuple[float, ...] | None = Field(
        default=None,
        max_length=MOST_LOCAL_MODELS,
        description="centres that are not equidistant; their number overrides local_models",
    )
    operating_point: dict[str, float] = Field(
        default_factory=lambda: dict(_PANTOGRAPH),
        description="start value of every input; of one that is not given and whose default lies outside the"
        " training data, the middle of their means",
    )
    subspace: SubspaceSettings = SubspaceSettings()
    alignment: Alignment = Field(default="observability", description="way to common state coordinates")
    alignment_horizon: int = Field(
        default=HORIZON, ge=2, le=10_000, description="samples compared for alignment"
    )

    @property
    def positions(self) -> Array:
        """Centres of the local models, shape (M,)."""
        if self.centres is not None:
            return np.array(self.centres)
        return equidistant_centres(self.local_models, self.low, self.high)


@dataclass(frozen=True, eq=False)
class LocalModels:
    """Everything configurations of a network share.

    Attributes:
        settings: The settings it was identified with, the operating point complete.
        centres: Centres of the M local models, shape (M,).
        models: The M local models in common state coordinates.
        signals: Inputs and outputs with units, operating point and training limits.
        static_map: Outputs at rest over the scheduling input.
        provenance: Names and content hashes of the training data.
        output_scale: Mean standard deviation of each output in training, shape (p,).
        own_choices: What was chosen automatically for all local models together.
        training: All data that they and their network are trained on.
    """

    settings: N4sidSettings
    centres: Array
    models: tuple[LocalModel, ...]
    signals: tuple[tuple[InputSignal, ...], tuple[OutputSignal, ...]]
    static_map: StaticMap
    output_scale: Array
    provenance: dict[str, Any] = field(default_factory=dict)
    own_choices: tuple[Choice, ...] = ()
    training: tuple[DataSet, ...] = ()

    @property
    def choices(self) -> tuple[Choice, ...]:
        """What was chosen automatically, for every local model and for all, by keys of `N4sidSettings`."""
        each = tuple(
            Choice(f"subspace.{one['name']}", one["value"], one["reason"], self.place(index))
            for index, model in enumerate(self.models)
            for one in model.diagnostics.get("choices", ())
        )
        return (*each, *self.own_choices)

    @property
    def warnings(self) -> tuple[IdentificationWarning, ...]:
        """What makes local models doubtful."""
        return tuple(
            IdentificationWarning(
                f"local model at {self.place(index)}, {one['place']}", one["what"], one["mend"]
            )
            for index, model in enumerate(self.models)
            for one in model.diagnostics.get("warnings", ())
        )

    def place(self, index: int) -> str:
        """Return where a local model stands, as in "eta = 0.75"."""
        return f"{self.settings.scheduling} = {self.centres[index]:g}"

    def trained_on(self, whole_range: Sequence[DataSet]) -> LocalModels:
        """Return the same with whole-range training data, and limits of the signals that take them in.

        Raises:
            DataError: Columns are missing.
        """
        known = self.settings
        limits = (known.low, known.high)
        signals = widened(self.signals, whole_range, known.scheduling, limits)
        return replace(self, signals=signals, training=(*self.training, *whole_range))

    def region(self, derived_outputs: Sequence[DerivedOutput] = ()) -> TrainedRegion | None:
        """Return where the training data lie, None where they are not known.

        Raises:
            DataError: Columns are missing.
        """
        known, tick = self.settings, self.models[0].sample_time
        return trained_region(self.training, known.inputs, known.scheduling, tick, derived_outputs)

    def refuse_outside(self) -> None:
        """Refuse an operating point outside the limits of the training data.

        Raises:
            IdentificationError: Names the key of every such input.
        """
        mend = "Leave the key out, or give a value in between"
        found = [
            Problem(
                f"n4sid.operating_point.{one.name}",
                f"{one.operating_point:g} lies outside the training data, {one.minimum:g} .. {one.maximum:g}",
                mend,
            )
            for one in self.signals[0]
            if not one.minimum <= one.operating_point <= one.maximum
        ]
        if found:
            raise IdentificationError(found)

    def partition(self, settings: NetworkSettings) -> Partition:
        """Return the partition these local models get from the settings of a network.

        Raises:
            IdentificationError: A number of the settings is still to be chosen.
        """
        limits = (self.settings.low, self.settings.high)
        return partition_of(settings, self.settings.scheduling, limits, self.centres.tolist())


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
        DataError: Columns are missing, sample times or units differ.
        IdentificationError: A centre without experiment, an experiment off its centre, or what the estimator
            refuses; all centres are looked at before it is raised.
    """
    chosen = settings or N4sidSettings()
    centres = chosen.positions
    _refuse_unlike(experiments, (*chosen.inputs, *chosen.outputs))
    groups = by_centre(experiments, chosen)
    models, found = [], []
    for centre, group in zip(centres, groups, strict=True):
        try:
            models.append(estimate(group, chosen.inputs, chosen.outputs, chosen.subspace))
        except IdentificationError as refused:
            place = f"local model at {chosen.scheduling} = {centre:g}"
            found += [Problem(f"{place}, {one.place}", one.what, one.mend) for one in refused.problems]
    if found:
        raise IdentificationError(found)
    models = _of_one_order(models, groups, chosen)
    ordered = [data for group in groups for data in group]
    point, own_choices = _operating_point(ordered, chosen)
    chosen = chosen.model_copy(update={"operating_point": point})
    scale = np.mean([data.matrix(chosen.outputs).std(axis=0) for data in ordered], axis=0)
    common = in_common_coordinates(models, chosen.alignment, scale, chosen.alignment_horizon)
    limits = (chosen.low, chosen.high)
    rest = static_map or maps.from_local_models(
        models, centres.tolist(), chosen.operating_point, chosen.scheduling, limits
    )
    start = rest.select(chosen.outputs).at(np.array([chosen.operating_point[chosen.scheduling]]))[0]
    signals = signals_of(ordered, chosen.inputs, chosen.outputs, chosen.operating_point, start, descriptions)
    data = [{"name": one.name, "content_hash": one.content_hash} for one in ordered]
    provenance = {"training": data, "settings": chosen.model_dump(mode="json")}
    return LocalModels(
        chosen, centres, tuple(common), signals, rest, scale, provenance, own_choices, tuple(ordered)
    )


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
        IdentificationError: The operating point lies outside the training data.
        ParameterSetError: Not a valid parameter set; every problem is named.
    """
    local.refuse_outside()
    partition = local.partition(settings)
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
        trained_region=local.region(derived_outputs),
        **rest,
    )


def _operating_point(
    experiments: Sequence[DataSet], settings: N4sidSettings
) -> tuple[dict[str, float], tuple[Choice, ...]]:
    """Return the operating point of every input, and what of it was chosen from the data."""
    given = settings.operating_point if "operating_point" in settings.model_fields_set else {}
    point, found = {}, {}
    for name in settings.inputs:
        columns = [data.column(name) for data in experiments]
        usual = given.get(name, _PANTOGRAPH.get(name))
        inside = usual is not None and min(map(np.min, columns)) <= usual <= max(map(np.max, columns))
        if usual is not None and (name in given or inside):
            point[name] = usual
        else:
            means = [float(column.mean()) for column in columns]
            point[name] = found[name] = 0.5 * (min(means) + max(means))
    reason = (
        "the middle of the training data's means, for inputs that have no other operating point among them"
    )
    return point, (Choice("operating_point", found, reason),) if found else ()


def _of_one_order(
    models: list[LocalModel], groups: Sequence[Sequence[DataSet]], settings: N4sidSettings
) -> list[LocalModel]:
    """Return the models with one order, the middle of theirs (of two the larger); automatic ones may differ.

    States that one local model alone shows have no counterpart to be blended with; given to all, they make
    the blend worse than none, and may make it unstable.
    """
    common = sorted(model.order for model in models)[len(models) // 2]
    subspace = settings.subspace.model_copy(update={"order": common})
    result = []
    for model, group in zip(models, groups, strict=True):
        if model.order == common:
            result.append(model)
            continue
        why = f"the middle of the local models' orders, {model.order} by itself"
        again = estimate(group, settings.inputs, settings.outputs, subspace)
        again.diagnostics["choices"].insert(0, Choice("order", common, why).record())
        result.append(again)
    return result


def _refuse_unlike(experiments: Sequence[DataSet], names: Sequence[str]) -> None:
    """Refuse experiments that lack columns, or have another sample time or other units than the first."""
    found: list[Problem] = []
    for data in experiments:
        try:
            data.matrix(names)
        except DataError as refused:
            found += refused.problems
    if experiments and not found:
        first = experiments[0].select(names)
        for data in experiments[1:]:
            found += data.scale_problems(first.sample_time, first.names, first.units)
    if found:
        raise DataError(found)


def by_centre(experiments: Sequence[DataSet], settings: N4sidSettings) -> list[list[DataSet]]:
    """Return the experiments of every centre, in the order of their content (not of the list).

    Raises:
        DataError: No column of the scheduling input.
        IdentificationError: Settings that contradict each other, experiments away from every centre, centres
            without one; all at once.
    """
    centres = settings.positions
    given = settings.operating_point if "operating_point" in settings.model_fields_set else {}
    names = ", ".join(settings.inputs)
    found = [
        Problem(f"n4sid.operating_point.{name}", "is no input", f"Name one of {names}")
        for name in given
        if name not in settings.inputs
    ]
    if settings.scheduling not in settings.inputs:
        what = f"{settings.scheduling!r} is no input"
        found.append(Problem("scheduling", what, f"Name one of {names}"))
    if not settings.low < settings.high:
        found.append(Problem("range", f"{settings.low} .. {settings.high} is empty", "Give low < high"))
    outside = np.any((centres < settings.low) | (centres > settings.high))
    if settings.centres is not None and (not centres.size or outside or np.any(np.diff(centres) <= 0.0)):
        what = f"{', '.join(f'{centre:g}' for centre in centres)} do not ascend within the range"
        found.append(Problem("centres", what, "Give ascending centres inside low .. high"))
    if found:
        raise IdentificationError(found)
    cells = cell_widths(centres.tolist(), settings.low, settings.high)
    groups: list[list[DataSet]] = [[] for _ in centres]
    for data in experiments:
        middle = float(data.column(settings.scheduling).mean())
        index = int(np.argmin(np.abs(centres - middle)))
        if abs(centres[index] - middle) > _OFF_CENTRE * cells[index]:
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

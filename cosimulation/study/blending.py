"""Study: offsets x blending x validity of n4sid networks, over seeds, with and without measurement noise."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from cosimulation.candidates import head_forces
from cosimulation.data_folder import Experiment
from cosimulation.pantograph import INPUTS, OUTPUTS, SIGNALS
from cosimulation.settings import Section, Split
from cosimulation.study.data import NOISES, Noise, centres, operating_points, study_data, whole_range
from cosimulation.study.local_models import COARSE, LocalModelSource, Map, Origin, Placement
from cosimulation.study.order import NAMES, with_forces
from cosimulation.study.runner import StudySettings
from fmu_builder.errors import IdentificationError
from fmu_builder.kernel import simulate
from fmu_builder.parameter_set import ParameterSet
from identification.data_set import DataSet
from identification.network import NetworkSettings
from identification.scores import records
from identification.subspace import SubspaceSettings, estimate
from identification.subspace.alignment import Alignment
from identification.tuning import tuned_network

SPLITS: tuple[Split, ...] = ("train", "validation", "test")


class Configuration(Section):
    """One way to make a network of local models; a name may come again for other numbers or noises."""

    name: str
    tables: tuple[str, ...] = Field((), description="of the page that it stands in")
    network: NetworkSettings
    llms: tuple[int, ...] = (4,)
    models: Origin = "n4sid"
    placement: Placement = "equidistant"
    static_map: Map = "reference"
    alignment: Alignment = "observability"
    noises: tuple[Noise, ...] = ("none",)
    sets: tuple[str, ...] = ("A", "Blow")

    def cells(self) -> Iterator[tuple[str, str, int, Noise]]:
        """Return what identifies each of its networks on one seed: name, set, number of models, noise."""
        return ((self.name, wbm, n, noise) for wbm in self.sets for n in self.llms for noise in self.noises)


class OwnOperatingPoint(Section):
    """One local model at its own operating point: what the estimator alone reaches."""

    route: str
    models: Origin = "n4sid"
    subspace: SubspaceSettings = SubspaceSettings()
    noises: tuple[Noise, ...] = ("none",)


class TableSettings(Section):
    """One comparison of the page: which configurations stand side by side is up to them."""

    name: str
    title: str
    text: str
    llms: tuple[int, ...] | None = Field(None, description="numbers of local models; default all there are")
    every_noise: bool = Field(False, description="whether noise is compared; otherwise without noise only")
    figure: Literal["over_llms", "seeds"] | None = None


ALL = TableSettings(name="all", title="Networks on whole-range test data", text="", every_noise=True)


class BlendingSettings(StudySettings):
    """Tables of `blending.toml`."""

    duration: float = Field(42.0, gt=0, description="of operating-point data [s]")
    whole_range_duration: float = Field(120.0, gt=0, description="[s]")
    tables: tuple[TableSettings, ...] = (ALL,)
    configurations: tuple[Configuration, ...]
    own_operating_point: tuple[OwnOperatingPoint, ...] = ()
    subspace: SubspaceSettings = SubspaceSettings()

    @model_validator(mode="after")
    def _fit_together(self) -> BlendingSettings:
        cells = [cell for one in self.configurations for cell in one.cells()]
        if len(set(cells)) != len(cells):
            twice = next(cell for cell in cells if cells.count(cell) > 1)
            raise ValueError(f"configurations: the same network twice: {', '.join(map(str, twice))}")
        known = {table.name for table in self.tables}
        for one in self.configurations:
            if unknown := sorted(set(one.tables) - known):
                raise ValueError(f"configuration {one.name!r}: no table {', '.join(unknown)}")
            if self.tables != (ALL,) and not one.tables:
                raise ValueError(f"configuration {one.name!r}: stands in no table; name some of its tables")
        return self


@dataclass(frozen=True)
class BlendingTask:
    """One white-box set and one seed."""

    fmu: Path
    wbm: str
    seed: int
    settings: BlendingSettings


def tasks(settings: BlendingSettings, fmu: Path) -> list[BlendingTask]:
    """Return the independent tasks of the study."""
    return [BlendingTask(fmu, wbm, seed, settings) for wbm in settings.sets for seed in settings.seeds]


def run_task(task: BlendingTask) -> list[dict[str, Any]]:
    """Return score records of all configurations on validation and test data, and `cpu` records."""
    settings = task.settings
    mine = [one for one in settings.configurations if task.wbm in one.sets]
    source = _source(task, mine)
    found: list[dict[str, Any]] = []
    for noise in NOISES:
        for one in mine:
            if noise in one.noises:
                for count in one.llms:
                    found += _network_scores(task, source, one, count, noise)
        for own in settings.own_operating_point:
            if noise in own.noises:
                found += _own_scores(task, source, own, noise)
    return found


def _source(task: BlendingTask, configurations: list[Configuration]) -> LocalModelSource:
    """Drive the white-box FMU.

    What every configuration sees comes first, in the demo's order: it stays the same whatever else is in
    the settings, and the same as the demo's for the same seed.
    """
    settings = task.settings
    first = centres(COARSE)
    counts = {
        count
        for one in configurations
        if (one.models, one.placement) == ("n4sid", "equidistant")
        for count in one.llms
    }
    more = dict.fromkeys(height for count in sorted(counts) for height in centres(count))
    experiments = (
        *operating_points(first, "train", settings.duration),
        *(whole_range(split, settings.whole_range_duration) for split in SPLITS),
        *operating_points(first, "test", settings.duration),
        *operating_points([height for height in more if height not in first], "train", settings.duration),
    )
    data, _ = study_data(task.fmu, task.wbm, task.seed, experiments)
    return LocalModelSource(task.fmu, task.wbm, task.seed, data, settings.subspace, settings.duration)


def _network_scores(
    task: BlendingTask, source: LocalModelSource, one: Configuration, count: int, noise: Noise
) -> list[dict[str, Any]]:
    """Return the records of one network."""
    begin = time.process_time()
    local = source.local_models(one.models, one.placement, count, noise, one.alignment, one.static_map)
    middle = time.process_time()
    training = source.training("whole_range", noise)
    tuned = tuned_network("study", local, training, one.network, head_forces(task.wbm)).parameter_set
    seconds = {"identified": middle - begin, "tuned": time.process_time() - middle}
    found: list[dict[str, Any]] = []
    for split in SPLITS[1:]:
        (item,) = source.data.select("whole_range", split)
        found += _scored(tuned, item, _labels(task, one, tuned, noise))
    timing = {"cpu": one.name, "wbm": task.wbm, "seed": task.seed, "llms": count, "noise": noise}
    return [*found, timing | seconds]


def _labels(
    task: BlendingTask, one: Configuration, parameter_set: ParameterSet, noise: Noise
) -> dict[str, Any]:
    llms = len(parameter_set.local_models)
    partition = parameter_set.partition
    tuned = " tuned" if partition.validity == "gaussian" and one.network.k_sigma == "tuned" else ""
    return {
        "wbm": task.wbm,
        "model": one.models,
        "llms": llms,
        "blending": parameter_set.blending,
        "offsets": parameter_set.offsets.kind,
        "validity": partition.validity + tuned,
        "alignment": one.alignment if parameter_set.blending == "parameter" else None,
        "schedule": "eta" + (f" + {partition.deviation_output}" if partition.deviation_gain else ""),
        "route": one.name,
        "order": parameter_set.state_count,
        "noise": noise,
        "seed": task.seed,
        "recommended": False,
    }


def _scored(parameter_set: ParameterSet, item: Experiment, labels: dict[str, Any]) -> list[dict[str, Any]]:
    data: DataSet = item.data
    outputs = simulate(parameter_set, data.matrix(INPUTS))
    order = [parameter_set.output_names.index(name) for name in SIGNALS]
    where = {"data_set": item.name, "split": item.split}
    with np.errstate(over="ignore", invalid="ignore"):
        return records(data.matrix(SIGNALS), outputs[:, order], SIGNALS, labels | where)


def _own_scores(
    task: BlendingTask, source: LocalModelSource, own: OwnOperatingPoint, noise: Noise
) -> list[dict[str, Any]]:
    """Return the records of one local model per operating point, on fresh data of that point."""
    found = []
    for test in source.data.select("operating_point", "test"):
        height = test.height or 0.0
        order = own.subspace.order if own.models == "n4sid" else None
        labels = {
            "wbm": task.wbm, "model": own.models, "llms": 1, "offsets": "affine", "route": own.route,
            "order": order if isinstance(order, int) else None,
            "data_set": NAMES.get(height, f"{height:g} m"), "noise": noise, "seed": task.seed,
            "split": "test", "recommended": False,
        }  # fmt: skip
        reference = test.data.matrix(SIGNALS)
        try:
            if own.models == "linearisation":
                (model,) = source.linearised([height])
            else:
                training = source.training("operating_point", noise, [height])
                model = estimate(training, INPUTS, OUTPUTS, own.subspace)
            outputs = model.simulate(test.data.matrix(INPUTS))
            simulated = with_forces(task.wbm, outputs, test.data.column("eta"))
        except IdentificationError:
            simulated = np.full_like(reference, np.nan)
        found += records(reference, simulated, SIGNALS, labels)
    return found

"""Study: offsets x blending x validity of n4sid networks, over seeds, with and without measurement noise."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field

from cosimulation.candidates import head_forces
from cosimulation.data_folder import DataFolder
from cosimulation.pantograph import DESCRIPTIONS, INPUTS, OUTPUTS, SIGNALS
from cosimulation.settings import Section, Split
from cosimulation.study.data import centres, noisy, operating_points, study_data, whole_range
from cosimulation.study.order import NAMES, with_forces
from cosimulation.study.runner import StudySettings
from fmu_builder.errors import IdentificationError
from fmu_builder.kernel import simulate
from fmu_builder.parameter_set import ParameterSet
from identification import static_map as maps
from identification.data_set import DataSet
from identification.n4sid import LocalModels, N4sidSettings, identify
from identification.network import NetworkSettings
from identification.scores import records
from identification.subspace import SubspaceSettings, estimate
from identification.subspace.alignment import Alignment
from identification.tuning import tuned_network

SPLITS: tuple[Split, ...] = ("train", "validation", "test")


class Configuration(Section):
    """One way to make a network of local models."""

    name: str
    network: NetworkSettings
    llms: tuple[int, ...] = (4,)
    static_map: Literal["reference", "local_models", "regression"] = "reference"
    alignment: Alignment = "observability"
    noises: tuple[str, ...] = ("none",)
    sets: tuple[str, ...] = ("A", "Blow")


class OwnOperatingPoint(Section):
    """One local model at its own operating point: what the estimator alone reaches."""

    route: str
    subspace: SubspaceSettings
    noises: tuple[str, ...] = ("none",)


class BlendingSettings(StudySettings):
    """Tables of `blending.toml`."""

    duration: float = Field(42.0, gt=0, description="of operating-point data [s]")
    whole_range_duration: float = Field(120.0, gt=0, description="[s]")
    configurations: tuple[Configuration, ...]
    own_operating_point: tuple[OwnOperatingPoint, ...] = ()
    subspace: SubspaceSettings = SubspaceSettings()


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
    counts = sorted(
        {count for one in mine for count in one.llms} | ({4} if settings.own_operating_point else set())
    )
    heights = sorted({height for count in counts for height in centres(count)})
    experiments = (
        *operating_points(heights, "train", settings.duration),
        *operating_points(centres(4) if settings.own_operating_point else [], "test", settings.duration),
        *(whole_range(split, settings.whole_range_duration) for split in SPLITS),
    )
    data, _ = study_data(task.fmu, task.wbm, task.seed, experiments)
    found: list[dict[str, Any]] = []
    for noise in sorted({noise for one in mine for noise in one.noises}):
        local: dict[tuple[int, Alignment], LocalModels] = {}
        for one in mine:
            if noise in one.noises:
                for count in one.llms:
                    key = (count, one.alignment)
                    if key not in local:
                        local[key] = _local_models(task, data, count, noise, one.alignment)
                    found += _network_scores(task, data, local[key], one, noise)
    for own in settings.own_operating_point:
        for noise in own.noises:
            found += _own_scores(task, data, own, noise)
    return found


def _training(data: DataFolder, kind: str, heights: Iterable[float], noise: str, seed: int) -> list[DataSet]:
    """Return noisy training data of a kind, at `heights` for operating points."""
    wanted = set(heights)
    return [
        noisy(item.data, noise, seed, stream)
        for stream, item in enumerate(data.experiments)
        if (item.kind, item.split) == (kind, "train") and (not wanted or item.height in wanted)
    ]


def _local_models(
    task: BlendingTask, data: DataFolder, count: int, noise: str, alignment: Alignment
) -> LocalModels:
    training = _training(data, "operating_point", centres(count), noise, task.seed)
    chosen = N4sidSettings(local_models=count, subspace=task.settings.subspace, alignment=alignment)
    return identify(training, chosen, data.static_map, DESCRIPTIONS)


def _network_scores(
    task: BlendingTask, data: DataFolder, local: LocalModels, one: Configuration, noise: str
) -> list[dict[str, Any]]:
    """Return the records of one configuration."""
    training = _training(data, "whole_range", (), noise, task.seed)
    chosen = _with_map(local, one, training)
    begin = time.process_time()
    tuned = tuned_network("study", chosen, training, one.network, head_forces(task.wbm))
    seconds = time.process_time() - begin
    found = []
    for split in ("validation", "test"):
        (item,) = data.select("whole_range", split)
        found += _scored(
            tuned.parameter_set, item.data, _labels(task, one, tuned.parameter_set, noise, split)
        )
    return [*found, {"cpu": one.name, "wbm": task.wbm, "seed": task.seed, "seconds": seconds}]


def _with_map(local: LocalModels, one: Configuration, training: Sequence[DataSet]) -> LocalModels:
    """Return the local models with the static map and in the coordinates that the configuration asks for."""
    if one.static_map == "local_models":
        limits = (local.settings.low, local.settings.high)
        point = local.settings.operating_point
        table = maps.from_local_models(local.models, local.centres.tolist(), point, "eta", limits)
        local = replace(local, static_map=table)
    elif one.static_map == "regression":
        local = replace(
            local, static_map=maps.from_data(training, "eta", local.settings.operating_point, OUTPUTS)
        )
    return local


def _labels(
    task: BlendingTask, one: Configuration, parameter_set: ParameterSet, noise: str, split: str
) -> dict[str, Any]:
    llms = len(parameter_set.local_models)
    partition = parameter_set.partition
    tuned = " tuned" if partition.validity == "gaussian" and one.network.k_sigma == "tuned" else ""
    return {
        "wbm": task.wbm,
        "model": "n4sid",
        "llms": llms,
        "blending": parameter_set.blending,
        "offsets": parameter_set.offsets.kind,
        "validity": partition.validity + tuned,
        "alignment": one.alignment if parameter_set.blending == "parameter" else None,
        "schedule": "eta" + (f" + {partition.deviation_output}" if partition.deviation_gain else ""),
        "route": one.name,
        "order": parameter_set.state_count,
        "data_set": f"wr_{split}",
        "noise": noise,
        "seed": task.seed,
        "split": split,
        "recommended": False,
    }


def _scored(parameter_set: ParameterSet, data: DataSet, labels: dict[str, Any]) -> list[dict[str, Any]]:
    outputs = simulate(parameter_set, data.matrix(INPUTS))
    order = [parameter_set.output_names.index(name) for name in SIGNALS]
    with np.errstate(over="ignore", invalid="ignore"):
        return records(data.matrix(SIGNALS), outputs[:, order], SIGNALS, labels)


def _own_scores(
    task: BlendingTask, data: DataFolder, own: OwnOperatingPoint, noise: str
) -> list[dict[str, Any]]:
    """Return the records of one local model per operating point, on fresh data of that point."""
    found = []
    for test in data.select("operating_point", "test"):
        height = test.height or 0.0
        training = _training(data, "operating_point", (height,), noise, task.seed)
        labels = {
            "wbm": task.wbm, "model": "n4sid", "llms": 1, "offsets": "affine", "route": own.route,
            "order": own.subspace.order if isinstance(own.subspace.order, int) else None,
            "data_set": NAMES.get(height, f"{height:g} m"), "noise": noise, "seed": task.seed,
            "split": "test", "recommended": False,
        }  # fmt: skip
        reference = test.data.matrix(SIGNALS)
        try:
            model = estimate(training, INPUTS, OUTPUTS, own.subspace)
            outputs = model.simulate(test.data.matrix(INPUTS))
            simulated = with_forces(task.wbm, outputs, test.data.column("eta"))
        except IdentificationError:
            simulated = np.full_like(reference, np.nan)
        found += records(reference, simulated, SIGNALS, labels)
    return found

"""One white-box set and one seed: data, every surrogate, its scores, how it compares with the truth."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cosimulation.candidates import head_forces
from cosimulation.data_folder import Experiment
from cosimulation.pantograph import INPUTS, SIGNALS
from cosimulation.settings import Split
from cosimulation.study.data import NOISES, Noise, centres, operating_points, study_data, whole_range
from cosimulation.study.local_models import LocalModelSource
from cosimulation.study.surrogate.drawings import drawings
from cosimulation.study.surrogate.local_optima import OptimaTask, optima_tasks, run_optima
from cosimulation.study.surrogate.physics import (
    WHICH,
    exact_records,
    frequency_errors,
    head_of,
    information_records,
    linearisations,
    theta_records,
)
from cosimulation.study.surrogate.settings import RECOMMENDED, SurrogateConfiguration, SurrogateStudySettings
from fmu_builder.kernel import simulate
from fmu_builder.parameter_set import ParameterSet
from identification.n4sid import LocalModels
from identification.scores import records
from identification.surrogate import SurrogateResult, SurrogateSettings, identify, network
from identification.tuning import tuned_network

SPLITS: tuple[Split, ...] = ("train", "validation", "test")
POINTS = 4
"""Operating points at which theta and poles are compared with the truth: OP25, OP45, OP65, OP85."""
Record = dict[str, Any]


@dataclass(frozen=True)
class SurrogateTask:
    """One white-box set and one seed."""

    fmu: Path
    wbm: str
    seed: int
    settings: SurrogateStudySettings


def tasks(settings: SurrogateStudySettings, fmu: Path) -> list[SurrogateTask | OptimaTask]:
    """Return the independent tasks of the study."""
    own = [SurrogateTask(fmu, wbm, seed, settings) for wbm in settings.sets for seed in settings.seeds]
    return [*own, *optima_tasks(settings, fmu)]


def run_task(task: SurrogateTask | OptimaTask) -> list[Record]:
    """Return score records on validation and test data, and what else is found; see `sections`."""
    if isinstance(task, OptimaTask):
        wanted = task.settings.local_optima
        return [] if wanted is None else run_optima(task, wanted)
    source = _source(task)
    found: list[Record] = []
    for noise in NOISES:
        for one in task.settings.configurations:
            if task.wbm in one.sets and noise in one.noises:
                for count in one.llms:
                    found += _run(task, source, one, count, noise)
    return found


def _source(task: SurrogateTask) -> LocalModelSource:
    """Drive the white-box FMU, what the demo sees first and in its order."""
    settings, first = task.settings, centres(POINTS)
    counts = sorted({n for one in settings.configurations if one.models == "n4sid" for n in one.llms})
    more = dict.fromkeys(height for count in counts for height in centres(count))
    experiments = (
        *operating_points(first, "train", settings.duration),
        *(whole_range(split, settings.whole_range_duration) for split in SPLITS),
        *operating_points(first, "test", settings.duration),
        *operating_points([height for height in more if height not in first], "train", settings.duration),
    )
    data, _ = study_data(task.fmu, task.wbm, task.seed, experiments)
    return LocalModelSource(task.fmu, task.wbm, task.seed, data, settings.subspace, settings.duration)


def _run(
    task: SurrogateTask, source: LocalModelSource, one: SurrogateConfiguration, count: int, noise: Noise
) -> list[Record]:
    """Return the records of one model."""
    begin = time.process_time()
    local = source.local_models(one.models, "equidistant", count, noise, "observability", "reference")
    middle = time.process_time()
    labels = {"wbm": task.wbm, "seed": task.seed, "noise": noise}
    if one.surrogate is None:
        training = source.training("whole_range", noise)
        if one.network is None:
            raise ValueError("a configuration has a surrogate or a network")
        tuned = tuned_network("study", local, training, one.network, head_forces(task.wbm)).parameter_set
        found = _scored(source, tuned, labels | {"model": one.models, "llms": count, "route": one.name})
    else:
        found = _surrogate(task, source, one, local, labels)
    seconds = {"identified": middle - begin, "tuned": time.process_time() - middle}
    return [*found, {"cpu": one.name, "llms": count, **labels, **seconds}]


def _surrogate(
    task: SurrogateTask,
    source: LocalModelSource,
    one: SurrogateConfiguration,
    local: LocalModels,
    labels: Record,
) -> list[Record]:
    noise = labels["noise"]
    validation = [item.data for item in source.data.select("whole_range", "validation")]
    training = source.training("whole_range", noise)
    count = len(local.models)
    points = source.training("operating_point", noise, centres(count)) if one.models == "n4sid" else []
    wanted_errors = one.detailed and noise != "none"
    settings = (one.surrogate or SurrogateSettings()).model_copy(update={"standard_errors": wanted_errors})
    result = identify(local, training, head_of(task.wbm), settings, validation, points)
    exact = one.models != "n4sid"
    about = {"model": "linearisation" if exact else "surrogate", "llms": count,
             "structure": result.settings.structure}  # fmt: skip
    found: list[Record] = []
    for which in WHICH:
        wanted = [theta for theta in one.thetas if theta in (which, RECOMMENDED)]
        if wanted == [RECOMMENDED] and which != result.recommended:
            continue
        scores = _scored(source, network("study", result, head_forces(task.wbm), which), labels | about)
        for theta in wanted:
            if theta == which or which == result.recommended:
                route = one.name if exact else f"{one.name}, {theta}"
                found += [{**score, "route": route} for score in scores]
    if exact:
        return found
    found.append({"reason": one.name, **labels, "llms": count, **_reason(result)})
    if one.detailed:
        mine = labels | {"route": one.name, "llms": count}
        truth = linearisations(source.fmu, task.wbm, result.frame.centres)
        found += [*theta_records(result, truth, mine), *information_records(result, mine)]
        for which in WHICH:
            found += frequency_errors(result.local_models(which), truth, mine | {"which": which})
        shipped = result.local_models(result.recommended)
        found += frequency_errors(shipped, truth, mine | {"which": RECOMMENDED})
        if task.seed == task.settings.seeds[0] and noise == one.noises[-1]:
            found += drawings(source, result, local, truth)
            found += exact_records(source.fmu, task.wbm, result, mine)
    return found


def _reason(result: SurrogateResult) -> Record:
    """Return why the search stopped where it did."""
    tuning = result.tuning
    return {
        "recommended": result.recommended,
        "why": result.reason,
        "converged": None if tuning is None else tuning.converged,
        "steps": None if tuning is None else len(tuning.history) - 1,
        "starts": [fit.start for fit in result.responses],
        "bounds": [dict(row) for row in result.at_bound(result.recommended)],
        "correlated": list(result.correlated()),
        "remarks": [] if result.certainty is None else list(result.certainty.remarks),
    }


def _scored(source: LocalModelSource, parameter_set: ParameterSet, labels: Record) -> list[Record]:
    """Return score records on validation and test data."""
    partition, about = parameter_set.partition, dict(labels)
    about |= {
        "blending": parameter_set.blending,
        "offsets": parameter_set.offsets.kind,
        "validity": partition.validity,
        "schedule": "eta" + (f" + {partition.deviation_output}" if partition.deviation_gain else ""),
        "order": parameter_set.state_count,
        "recommended": False,
    }
    items: Sequence[Experiment] = [
        item for split in SPLITS[1:] for item in source.data.select("whole_range", split)
    ]
    order = [parameter_set.output_names.index(name) for name in SIGNALS]
    found: list[Record] = []
    for item in items:
        outputs = simulate(parameter_set, item.data.matrix(INPUTS))[:, order]
        where = {"data_set": item.name, "split": item.split}
        with np.errstate(over="ignore", invalid="ignore"):
            found += records(item.data.matrix(SIGNALS), outputs, SIGNALS, about | where)
    return found

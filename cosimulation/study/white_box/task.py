"""The independent tasks of the study: one white-box set at rest, stepped and linearised; records per seed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cosimulation.fmu_file import open_fmu
from cosimulation.study.data import RANGE, operating_points, study_data
from cosimulation.study.white_box import drawings
from cosimulation.study.white_box.height import deviation_curve, drawn_heights, height_records
from cosimulation.study.white_box.poles import (
    OPERATING_POINTS,
    ModePaths,
    linearised_over,
    mode_paths,
    pole_records,
)
from cosimulation.study.white_box.resonances import resonance_records, step_resonances
from cosimulation.study.white_box.settings import WhiteBoxSettings
from cosimulation.study.white_box.static import static_map, static_records

Record = dict[str, Any]


@dataclass(frozen=True)
class WhiteBoxTask:
    """One white-box set: its analysis, or the records of one seed.

    Attributes:
        fmu: The white-box FMU.
        wbm: The set.
        seed: Of the records; None for what nothing is drawn for.
        settings: The study's.
    """

    fmu: Path
    wbm: str
    seed: int | None
    settings: WhiteBoxSettings


def tasks(settings: WhiteBoxSettings, fmu: Path) -> list[WhiteBoxTask]:
    """Return the independent tasks of the study."""
    return [
        WhiteBoxTask(fmu, wbm, seed, settings) for wbm in settings.sets for seed in (None, *settings.seeds)
    ]


def run_task(task: WhiteBoxTask) -> list[Record]:
    """Return measures and drawings."""
    if task.seed is None:
        return _analysis(task)
    return _height(task, task.seed)


def _paths(task: WhiteBoxTask) -> ModePaths:
    heights = np.linspace(*RANGE, task.settings.linearisations)
    with open_fmu(task.fmu) as fmu:
        return mode_paths(linearised_over(fmu, task.wbm, heights))


def _analysis(task: WhiteBoxTask) -> list[Record]:
    settings = task.settings
    labels: Record = {"wbm": task.wbm, "seed": settings.seeds[0]}  # nothing is drawn: the same for all
    paths = _paths(task)
    with open_fmu(task.fmu) as fmu:
        steps = step_resonances(fmu, task.wbm, settings.steps)
        statics = static_map(fmu, task.wbm, settings.static, RANGE)
        at = mode_paths(linearised_over(fmu, task.wbm, np.array(OPERATING_POINTS)))
    return [
        *resonance_records(steps, labels),
        *static_records(statics, paths.linearisations, labels),
        *pole_records(paths, at, labels),
        deviation_curve(paths.table, settings.height, labels),
        drawings.surfaces(task.wbm, steps, paths.table),
        drawings.statics(task.wbm, statics, paths.linearisations),
        drawings.paths(task.wbm, paths, at),
    ]


def _height(task: WhiteBoxTask, seed: int) -> list[Record]:
    settings = task.settings.height
    heights = drawn_heights(settings, seed)
    experiments = operating_points(heights, "test", max(settings.durations))
    data, _ = study_data(task.fmu, task.wbm, seed, experiments)
    records = [
        (height, experiment.data) for height, experiment in zip(heights, data.experiments, strict=True)
    ]
    labels: Record = {"wbm": task.wbm, "seed": seed}
    return list(height_records(records, _paths(task).table, settings, labels))

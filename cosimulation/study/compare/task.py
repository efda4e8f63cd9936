"""One white-box set: training draws, all models as FMUs, their runs on every signal, what a step costs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cosimulation.data_folder import DataFolder, Experiment
from cosimulation.scoring import DECIDING_SIGNAL, ScoredRun, run_candidate
from cosimulation.settings import GenerateSettings
from cosimulation.study.compare.drawings import drawings
from cosimulation.study.compare.members import Member, members_of_draws, one_local_model
from cosimulation.study.compare.settings import POINTS, CompareSettings
from cosimulation.study.compare.timing import Start, batch_call, own_loop, real_time_factors
from cosimulation.study.data import centres, operating_points, study_data, whole_range
from identification.scores import scored_rows

Record = dict[str, Any]
RELATIVE_ERROR = "largest error of F_p over its largest value"
BATCH, LOOP = "real-time factor, one batch call", "real-time factor, fmpy's loop"
WHITE_BOX = "WBM"
SHOWN = ("M11", "M21", "M31", "M41")
"""The thesis's "previously examined" models: timed, drawn, and scored on their own training data."""
_ALSO_TIMED = ("L11", "T31")


@dataclass(frozen=True)
class CompareTask:
    """One white-box set; `fmu` is its FMU."""

    fmu: Path
    wbm: str
    settings: CompareSettings


def tasks(settings: CompareSettings, fmu: Path) -> list[CompareTask]:
    """Return the independent tasks of the study."""
    return [CompareTask(fmu, wbm, settings) for wbm in settings.sets]


def run_task(task: CompareTask) -> list[Record]:
    """Return score records, measures, drawings and timings of a white-box set; see `pages`."""
    settings, folder = task.settings, task.fmu.parents[1]
    draws = {seed: _draw(task, seed) for seed in settings.seeds}
    first = settings.seeds[0]
    own, _ = draws[first]
    signals, _ = study_data(task.fmu, task.wbm, settings.signal_seed, settings.signals())
    members = members_of_draws(task.wbm, draws, task.fmu, settings.linearised_at, folder)
    (validation,) = own.select("whole_range", "validation")
    tests = list(signals.experiments)  # in the order of the slew rates
    found: list[Record] = []
    runs: dict[str, dict[str, ScoredRun]] = {}
    for member in members:
        train = own.select("whole_range", "train") if member.label in SHOWN else ()
        for item in (*tests, validation, *train):
            run = run_candidate(member.candidate, member.path, item, member.seed)
            found += [*run.records, _relative_error(member, run)]
            runs.setdefault(member.label, {}).setdefault(item.split, run)
    one = one_local_model(task.wbm, first, own, settings.operating_point, folder)
    for member in one:
        for item in _at_operating_point(own, settings.operating_point):
            found += run_candidate(member.candidate, member.path, item, first).records
    found += drawings(task.fmu, own, [(each, runs[each.label]) for each in members if each.label in SHOWN])
    return [*found, *_timings(task, members, own)]


def _draw(task: CompareTask, seed: int) -> tuple[DataFolder, GenerateSettings]:
    """Drive the white-box FMU as the demo does, but for one validation record in place of four.

    Models of the demo's seed are the demo's, except that a surrogate may be taken as the frequency response
    gives it where four records would have it tuned, or the other way round. What only one local model is
    validated on comes last, so that nothing else changes.
    """
    settings = task.settings
    experiments = (
        *operating_points(centres(POINTS), "train", settings.duration),
        whole_range("train", settings.whole_range_duration),
        whole_range("validation", settings.whole_range_duration),
        *operating_points([settings.operating_point], "validation", settings.duration),
    )
    return study_data(task.fmu, task.wbm, seed, experiments)


def _at_operating_point(data: DataFolder, height: float) -> Sequence[Experiment]:
    """Return training and validation data of one height."""
    return [
        item
        for split in ("train", "validation")
        for item in data.select("operating_point", split)
        if item.height == height
    ]


def _relative_error(member: Member, run: ScoredRun) -> Record:
    """Return the largest error of F_p over the largest |F_p| of the reference, on the rows that count [%].

    The thesis gives "the maximum relative error" of F_p without saying what it is relative to; relative to
    the force of the same instant it would have no bound, as the force passes zero.
    """
    (worst,) = (item["max_error"] for item in run.records if item["signal"] == DECIDING_SIGNAL)
    force = run.experiment.data.column(DECIDING_SIGNAL)
    largest = float(np.max(np.abs(force[scored_rows(len(force))])))
    return {
        "measure": RELATIVE_ERROR,
        "wbm": member.candidate.labels["wbm"],
        "model": member.label,
        "data_set": run.experiment.name,
        "seed": member.seed,
        "value": None if worst is None else 100.0 * worst / largest,
        "unit": "%",
    }


def _timings(task: CompareTask, members: Sequence[Member], own: DataFolder) -> list[Record]:
    """Time the white-box FMU and one FMU per family, all in one run, on the records of Table 4.4."""
    settings = task.settings
    fmus: dict[str, tuple[Path, Start]] = {WHITE_BOX: (task.fmu, {"preset": task.wbm})}
    fmus |= {one.label: (one.path, {}) for one in members if one.label in (*SHOWN, *_ALSO_TIMED)}
    point = [item.data for item in _at_operating_point(own, settings.operating_point)]
    whole = [item.data for split in ("train", "validation") for item in own.select("whole_range", split)]
    found = [
        (BATCH, one) for one in real_time_factors(fmus, [*point, *whole], settings.timing_repeats, batch_call)
    ]
    found += [(LOOP, one) for one in real_time_factors(fmus, whole[-1:], settings.loop_repeats, own_loop)]
    return [
        {
            "cpu": what,
            "measure": what,
            "wbm": task.wbm,
            "model": one.fmu,
            "data_set": one.data_set,
            "seed": settings.seeds[0],
            "seconds": one.seconds,
            "value": one.factor,
            "unit": "",
        }
        for what, one in found
    ]

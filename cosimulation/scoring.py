"""Running identified models as FMUs beside the reference, and what they score."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cosimulation.candidates import Candidate
from cosimulation.data_folder import Experiment
from cosimulation.fmu_driver import FloatArray, FmuInstance, running_fmu
from cosimulation.fmu_file import open_fmu
from cosimulation.pantograph import SIGNALS
from cosimulation.validate import co_simulate
from identification.scores import records

DECIDING_SIGNAL = "F_p"
"""Which configuration of a model is recommended is decided by this signal, on validation data."""
TIMED_SECONDS = 4.0
"""Model time that a step time is measured over [s]."""
TIMED_REPEATS = 5
"""The shortest of so many measurements counts: whatever else the machine does only adds time."""


@dataclass(frozen=True)
class ScoredRun:
    """One FMU co-simulated on one experiment.

    Attributes:
        experiment: The reference.
        outputs: What the FMU gave after the candidate's correction, [N, those of SIGNALS that it has].
        records: One score record per signal.
        seconds: Wall time of the co-simulation.
        out_of_range: Share of the time out of the trained range, as the FMU tells it; None: it does not.
    """

    experiment: Experiment
    outputs: FloatArray
    records: tuple[dict[str, Any], ...]
    seconds: float
    out_of_range: float | None = None


def run_candidate(
    candidate: Candidate, fmu_path: Path, experiment: Experiment, seed: int, advance: Any = None
) -> ScoredRun:
    """Co-simulate a candidate's FMU on an experiment and score it.

    Raises:
        FmuError: The FMU cannot be opened or reports an error.
        DataError: The experiment does not fit the FMU.
    """
    with open_fmu(fmu_path) as fmu:
        run = co_simulate(fmu, experiment.data, advance=advance)
    signals = tuple(name for name in SIGNALS if name in run.signals)
    order = [run.signals.index(name) for name in signals]
    outputs, reference = run.outputs[:, order], run.reference[:, order]
    if candidate.offset_subtracted:
        outputs = outputs - (outputs - reference).mean(axis=0)
    labels = {
        **candidate.labels,
        "data_set": experiment.name,
        "split": experiment.split,
        "noise": "none",
        "seed": seed,
        "recommended": False,
    }
    scores = tuple(records(reference, outputs, signals, labels))
    return ScoredRun(experiment, outputs, scores, run.seconds, run.out_of_range)


def marked_recommended(found: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the records with exactly one recommended configuration per `RECOMMENDED_KEY`.

    Among the configurations of one model with the same number of local models and the same blending, the one
    with the best contact force on validation data, the mean over their records, is recommended, everywhere.
    """
    variable = ("offsets", "validity", "alignment", "schedule", "structure", "route", "order")
    fixed = ("wbm", "model", "llms", "blending", "noise", "seed")

    def values(record: Mapping[str, Any], names: Iterable[str]) -> tuple[Any, ...]:
        return tuple(record[name] for name in names)

    fits: dict[tuple[Any, ...], dict[tuple[Any, ...], list[float]]] = {}
    for record in found:
        if record["split"] == "validation" and record["signal"] == DECIDING_SIGNAL:
            fit = -np.inf if record["fit"] is None else float(record["fit"])
            group = fits.setdefault(values(record, fixed), {})
            group.setdefault(values(record, variable), []).append(fit)
    best = {key: max(group, key=lambda one: float(np.mean(group[one]))) for key, group in fits.items()}
    return [
        {**record, "recommended": best[values(record, fixed)] == values(record, variable)} for record in found
    ]


def _timed_span(instance: FmuInstance, start: float) -> tuple[float, float]:
    """Return ns per tick of one long step from `start` [s], and then of as many ticks from Python."""
    ticks = round(TIMED_SECONDS * 1000)
    begin = time.perf_counter()
    instance.step(start, TIMED_SECONDS)
    middle = time.perf_counter()
    for tick in range(ticks):
        instance.step(start + TIMED_SECONDS + tick * 0.001, 0.001)
    end = time.perf_counter()
    return (middle - begin) / ticks * 1e9, (end - middle) / ticks * 1e9


def step_times(folder: Path, white_box: Path) -> list[dict[str, Any]]:
    """Measure what a tick of 1 ms costs in every FMU of a folder, in one run.

    Args:
        folder: Holds .fmu files.
        white_box: The reference among them; the ratio of every other one is to it.

    Returns:
        One record per FMU: `fmu`, `own_ns` (one doStep call over the whole time: the FMU's own code),
        `python_ns` (one doStep call per tick, driven from Python), `real_time_factor` (own code),
        `speed_up` (against the white-box FMU).
    """
    found = []
    for path in sorted(folder.glob("*.fmu")):
        with open_fmu(path) as fmu, running_fmu(fmu, "timing") as instance:
            instance.initialise({})
            spans = [_timed_span(instance, index * 2.0 * TIMED_SECONDS) for index in range(TIMED_REPEATS)]
        own, python = np.min(spans, axis=0).tolist()
        found.append({"fmu": path.stem, "own_ns": round(own, 1), "python_ns": round(python, 1)})
    reference = next(item["own_ns"] for item in found if item["fmu"] == white_box.stem)
    for item in found:
        item["real_time_factor"] = item["own_ns"] * 1e-6
        item["speed_up"] = round(reference / item["own_ns"], 1)
    return found

"""Does the frequency-response fit find the global optimum every time, and what do random starts find?"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cosimulation.pantograph import INPUTS, OUTPUTS, operating_point_name
from cosimulation.study.data import centres, noisy, operating_points, study_data
from cosimulation.study.surrogate.physics import head_of
from cosimulation.study.surrogate.settings import LocalOptimaSettings, SurrogateStudySettings
from identification.subspace import estimate
from identification.surrogate import (
    STRUCTURES,
    FrequencyResponseSettings,
    fit_frequency_response,
    input_spectrum,
)

MISSED = "global optimum missed"
_OTHER_DATA = 10_000
"""Added to the seeds of the study when they are used up: nothing drawn before comes again."""


@dataclass(frozen=True)
class OptimaTask:
    """One white-box set, one seed of the data."""

    fmu: Path
    wbm: str
    seed: int
    settings: SurrogateStudySettings


def optima_tasks(settings: SurrogateStudySettings, fmu: Path) -> list[OptimaTask]:
    """Return the tasks of the search for local optima."""
    if settings.local_optima is None:
        return []
    known = len(settings.seeds)
    seeds = [
        settings.seeds[k % known] + _OTHER_DATA * (k // known)
        for k in range(settings.local_optima.data_seeds)
    ]
    return [OptimaTask(fmu, wbm, seed, settings) for wbm in settings.sets for seed in seeds]


def run_optima(task: OptimaTask, wanted: LocalOptimaSettings) -> list[dict[str, Any]]:
    """Return a record per operating point: final errors of the fit as it ships and of random starts."""
    heights, seed = centres(4), task.seed
    data, _ = study_data(task.fmu, task.wbm, seed, operating_points(heights, "train", task.settings.duration))
    structure, head = STRUCTURES[wanted.structure], head_of(task.wbm)
    usual = FrequencyResponseSettings()
    found: list[dict[str, Any]] = []
    for stream, (height, item) in enumerate(zip(heights, data.experiments, strict=True)):
        training = noisy(item.data, wanted.noise, seed, stream)
        model = estimate([training], INPUTS, OUTPUTS, task.settings.subspace)
        frequencies = usual.frequencies()
        spectrum = input_spectrum(training.matrix(INPUTS), training.sample_time, frequencies)
        shipped = fit_frequency_response(model, spectrum, structure, head, usual)
        blind = usual.model_copy(
            update={"start": "random", "random_starts": wanted.starts, "seed": 1000 * seed + stream}
        )
        random = fit_frequency_response(model, spectrum, structure, head, blind)
        size = min(random.costs.values()) / random.relative_error**2
        errors = [float(np.sqrt(cost / size)) for cost in random.costs.values()]
        lowest = min([shipped.relative_error, *errors])
        missed = shipped.relative_error**2 > lowest**2 * (1.0 + usual.agreement)
        labels = {"wbm": task.wbm, "seed": seed, "noise": wanted.noise}
        labels |= {"height": height, "point": operating_point_name(height)}
        found.append(
            {
                "optima": wanted.structure,
                **labels,
                "error": shipped.relative_error,
                "start": shipped.start,
                "fallback": shipped.fallback,
                "random": errors,
            }
        )
        found.append({"measure": MISSED, **labels, "value": float(missed), "unit": ""})
    return found

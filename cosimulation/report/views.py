"""The demo's results, arranged for a reader: one view per white-box set, in it one per model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from cosimulation.candidates import Candidate
from cosimulation.pantograph import SIGNALS
from cosimulation.report.thesis import PublishedFit, counterpart
from cosimulation.scoring import DECIDING_SIGNAL, ScoredRun
from fmu_builder.parameter_set import ParameterSet, ResidualBands
from identification.arrays import Array
from identification.scores import scored_rows

if TYPE_CHECKING:
    from cosimulation.demo import DemoResult, SetResult

# Okabe and Ito's colours: told apart with every common colour vision. The reference is black.
_STYLES = (
    ("#b0568f", (0, (1, 1.2))),
    ("#009e73", (0, (5, 1.5, 1, 1.5))),
    ("#d98200", (0, (4, 1.5))),
    ("#4aa5dd", (0, (7, 1.5))),
    ("#0061a8", "solid"),
    ("#d55e00", (0, (3, 1, 1, 1, 1, 1))),
    ("#6b6b6b", (0, (2, 1))),
)


@dataclass(frozen=True)
class ModelView:
    """One model on one white-box set.

    Attributes:
        candidate: The model.
        runs: Co-simulation by split, "validation" and "test".
        records: Score record by split and signal, as in scores.json.
        step_time: Its record of timings.json, None if it was not timed.
        colour: In every figure.
        dashes: Line style in every figure.
    """

    candidate: Candidate
    runs: Mapping[str, ScoredRun]
    records: Mapping[tuple[str, str], Mapping[str, Any]]
    step_time: Mapping[str, Any] | None
    colour: str
    dashes: Any

    @property
    def title(self) -> str:
        """Its name for a person."""
        return self.candidate.title

    @property
    def parameter_set(self) -> ParameterSet:
        """The network."""
        return self.candidate.parameter_set

    @property
    def bands(self) -> ResidualBands | None:
        """Error bands of the contact force as its runs have it; None where the mean error was subtracted."""
        if self.candidate.offset_subtracted:
            return None
        found = self.parameter_set.residual_bands
        return next((one for one in found if one.output == DECIDING_SIGNAL), None)

    @property
    def published(self) -> PublishedFit | None:
        """The thesis's column for such a model."""
        return counterpart(self.candidate.labels)

    @property
    def recommended(self) -> bool:
        """Whether its configuration is marked."""
        return bool(self.records["test", DECIDING_SIGNAL]["recommended"])

    def fit(self, signal: str, split: str = "test") -> float:
        """Return FIT [%], minus infinity where the simulation is not finite."""
        value = self.records[split, signal]["fit"]
        return -np.inf if value is None else float(value)

    def max_error(self, signal: str, split: str = "test") -> float:
        """Return the largest error in the signal's unit, infinity where the simulation is not finite."""
        value = self.records[split, signal]["max_error"]
        return np.inf if value is None else float(value)

    def meaning(self, signal: str) -> str:
        """Return what a signal is, e.g. "velocity of the crossbar"."""
        return self._described(signal)[0]

    def unit(self, signal: str) -> str:
        """Return the unit of a signal."""
        return self._described(signal)[1]

    def _described(self, signal: str) -> tuple[str, str]:
        """Return description and unit of an output."""
        found = {one.name: (one.description, one.unit) for one in self.parameter_set.outputs}
        found |= {one.name: (one.description, one.unit) for one in self.parameter_set.derived_outputs}
        return found[signal]

    def output(self, signal: str) -> Array:
        """Return a signal of the model on the test data, (rows,)."""
        return self.runs["test"].outputs[:, SIGNALS.index(signal)]

    def error(self, signal: str) -> Array:
        """Return model less reference on the test data, (rows,)."""
        return self.output(signal) - self.runs["test"].experiment.data.column(signal)


@dataclass(frozen=True)
class SetView:
    """Everything on one white-box set.

    Attributes:
        result: As the demo found it.
        models: In the demo's order.
    """

    result: SetResult
    models: tuple[ModelView, ...]

    @property
    def name(self) -> str:
        """The white-box set."""
        return self.result.wbm

    @property
    def best(self) -> ModelView:
        """The model with the best contact force on validation data."""
        return max(self.models, key=lambda model: model.fit(DECIDING_SIGNAL, "validation"))

    @property
    def surrogates(self) -> tuple[ModelView, ...]:
        """Models with physical parameters."""
        return tuple(model for model in self.models if model.candidate.surrogate is not None)

    @property
    def networks(self) -> tuple[ModelView, ...]:
        """Models whose local models differ: one per kind, the best of it on validation data."""
        found: dict[str, ModelView] = {}
        for model in self.models:
            kind = model.parameter_set.kind
            if len(model.parameter_set.local_models) > 1 and (
                kind not in found
                or model.fit(DECIDING_SIGNAL, "validation") > found[kind].fit(DECIDING_SIGNAL, "validation")
            ):
                found[kind] = model
        return tuple(found.values())

    @property
    def time(self) -> Array:
        """Time of the test data [s], (rows,)."""
        return self.models[0].runs["test"].experiment.data.time

    @property
    def sample_time(self) -> float:
        """Of the test data [s]."""
        return self.models[0].runs["test"].experiment.data.sample_time

    @property
    def scored(self) -> slice:
        """Rows of the test data that count."""
        return scored_rows(len(self.time))

    def reference(self, signal: str) -> Array:
        """Return a signal of the reference on the test data, (rows,)."""
        return self.models[0].runs["test"].experiment.data.column(signal)


def views(result: DemoResult) -> tuple[SetView, ...]:
    """Return one view per white-box set that was run."""
    step_times = {item["fmu"]: item for item in result.timings["steps"]}
    titles = list(dict.fromkeys(item.title for one in result.sets for item in one.candidates))
    found = []
    for one in result.sets:
        models = []
        for candidate in one.candidates:
            colour, dashes = _STYLES[titles.index(candidate.title) % len(_STYLES)]
            runs: dict[str, ScoredRun] = {}
            for run in one.runs[candidate.name]:
                runs.setdefault(run.experiment.split, run)
            records = _records(result, candidate, runs)
            step_time = step_times.get(candidate.name)
            models.append(ModelView(candidate, runs, records, step_time, colour, dashes))
        found.append(SetView(one, tuple(models)))
    return tuple(found)


def _records(
    result: DemoResult, candidate: Candidate, runs: Mapping[str, ScoredRun]
) -> dict[tuple[str, str], Mapping[str, Any]]:
    """Return the records of scores.json that belong to a candidate, by split and signal."""
    found: dict[tuple[str, str], Mapping[str, Any]] = {}
    for record in result.scores:
        run = runs.get(record["split"])
        if run is None or record["data_set"] != run.experiment.name:
            continue
        if all(record[name] == value for name, value in candidate.labels.items()):
            found[record["split"], record["signal"]] = record
    return found

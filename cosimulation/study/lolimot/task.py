"""One white-box set and one seed: identify, predict, run free, and look into the blends."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from cosimulation.data_folder import DataFolder
from cosimulation.pantograph import INPUTS, TORQUE
from cosimulation.settings import Signals
from cosimulation.study.data import RANGE, study_data, whole_range
from cosimulation.study.lolimot.drawings import soaring_figure
from cosimulation.study.lolimot.settings import (
    ALL_SIGNALS,
    ANGLE,
    FORMS,
    FREE_RUN,
    FROM_XI,
    ONE_STEP,
    Form,
    LolimotConfiguration,
    LolimotStudySettings,
    Record,
)
from fmu_builder.errors import IdentificationError, ParameterSetError
from fmu_builder.kernel import simulate, validities
from fmu_builder.parameter_set import ParameterSet
from fmus.wbm import parameter_sets
from identification.arrays import Array
from identification.data_set import DataSet
from identification.excitation import with_measurement_noise
from identification.lolimot import ArxNetwork, as_parameter_set, identify, with_settings
from identification.scores import max_error, records, scored_rows

LOCAL_RADIUS = "spectral radius of local models"
BLEND_RADIUS = "spectral radius of the blend"
LARGEST_ERROR = "largest error over range"
REST_ERROR = "error at rest over range"
STATES_ERROR = "error left by states in common"
_HEIGHTS = 201
_NOISE_STREAM = 2000


@dataclass(frozen=True)
class LolimotTask:
    """One white-box set, one seed."""

    fmu: Path
    wbm: str
    seed: int
    settings: LolimotStudySettings


def tasks(settings: LolimotStudySettings, fmu: Path) -> list[LolimotTask]:
    """Return the independent tasks of the study."""
    return [LolimotTask(fmu, wbm, seed, settings) for wbm in settings.sets for seed in settings.seeds]


def run_task(task: LolimotTask) -> list[Record]:
    """Return score records on test data and findings on the networks."""
    signals = Signals(outputs={name: name for name in ALL_SIGNALS}, units={ANGLE: "rad"})
    dense = task.settings.dense
    extra = whole_range("train", dense.duration).model_copy(
        update={"name": "wr_dense", "low": dense.low, "high": dense.high}
    )
    experiments = [
        whole_range("train", task.settings.training_duration),
        whole_range("test", task.settings.test_duration),
        *([extra] if any(one.dense for one in task.settings.configurations) else []),
    ]
    data, _ = study_data(task.fmu, task.wbm, task.seed, experiments, signals)
    found: list[Record] = []
    for one in task.settings.configurations:
        if task.wbm in one.sets:
            for output in one.outputs:
                found += _Case(task, one, output, data).findings()
    return found


@dataclass(frozen=True, eq=False)
class Blend:
    """One state-space form of a network, simulated on test data.

    Attributes:
        simulated: Its output, shape (rows,).
        heights: Where the blend is looked at, with `TORQUE`, shape (H,).
        radii: Largest |pole| of the blend held at each height, shape (H,).
        rest: Its output at rest at each height; NaN where there is none, shape (H,).
    """

    simulated: Array
    heights: Array
    radii: Array
    rest: Array


class _Case:
    """One output of one configuration, on the data of a seed."""

    def __init__(
        self, task: LolimotTask, configuration: LolimotConfiguration, output: str, data: DataFolder
    ) -> None:
        self.task = task
        self.configuration = configuration
        self.output = output
        self.data = data
        self.labels = {"wbm": task.wbm, "route": configuration.name, "seed": task.seed}
        (test,) = data.select("whole_range", "test")
        every = configuration.lolimot.every
        thinned = test.data.values[::every]
        self.test = replace(test.data, sample_time=test.data.sample_time * every, values=thinned)

    def findings(self) -> list[Record]:
        training = self._training()
        network = identify(training, INPUTS, self.output, self.configuration.lolimot)
        inputs, reference = self.test.matrix(INPUTS), self.test.column(self.output)
        runs = {
            ONE_STEP: network.predict(inputs, reference),
            FREE_RUN: network.free_run(inputs),
        }
        blends = {form: self._blend(network, form, training) for form in self.configuration.forms}
        nothing = np.full_like(reference, np.nan)
        for form, blend in blends.items():
            runs[form] = nothing if blend is None else blend.simulated
        found = self._scores(network, runs)
        found.append(self._growth(network, training))
        if self.configuration.detailed and self.output == ANGLE:
            found += self._measures(network, blends)
            if self.task.seed == self.task.settings.seeds[0]:
                found += [*self._poles(network), *self._drawing(network, blends)]
        return found

    def _training(self) -> list[DataSet]:
        wanted = ("wr_train", "wr_dense") if self.configuration.dense else ("wr_train",)
        found = [item.data for item in self.data.experiments if item.name in wanted]
        if self.configuration.noise == 0.0:
            return found
        deviations = {self.output: self.configuration.noise}
        return [
            with_measurement_noise(data, deviations, self.task.seed, (_NOISE_STREAM, k))
            for k, data in enumerate(found)
        ]

    def _blend(self, network: ArxNetwork, form: Form, training: list[DataSet]) -> Blend | None:
        """Return a form of the network; None where it does not exist."""
        changed = network.settings.model_copy(update=FORMS[form])
        try:
            built = as_parameter_set("lolimot", with_settings(network, changed), training)
            simulated = simulate(built, self.test.matrix(INPUTS))[:, 0]
        except (IdentificationError, ParameterSetError):
            return None
        heights = np.linspace(*RANGE, _HEIGHTS)
        A = np.array([model.A for model in built.local_models])
        if built.blending == "parameter":
            A = np.tensordot(validities(built, heights), A, 1)
        radii = np.abs(np.linalg.eigvals(A)).max(axis=-1)
        everywhere = np.full(_HEIGHTS, radii.max())  # outputs blended: every local model runs at every height
        return Blend(
            simulated,
            heights,
            radii if built.blending == "parameter" else everywhere,
            _rest(built, heights),
        )

    def _scores(self, network: ArxNetwork, runs: dict[str, Array]) -> list[Record]:
        found: list[Record] = []
        orders = network.orders
        for structure, simulated in runs.items():
            labels = {
                **self.labels, "model": "lolimot", "llms": len(network.parameters),
                "blending": "output" if structure == "outputs blended" else "parameter",
                "offsets": "affine", "validity": "gaussian", "structure": structure,
                "order": orders.past_outputs, "data_set": "wr_test",
                "noise": f"{self.configuration.noise:g}" if self.configuration.noise else "none",
                "split": "test", "recommended": structure == FREE_RUN,
            }  # fmt: skip
            reference = self.test.column(self.output)
            found += records(reference[:, None], simulated[:, None], [self.output], labels)
            if self.output == "xi" and structure in (ONE_STEP, FREE_RUN):
                stiffness = parameter_sets()[self.task.wbm]["k_E"]
                force = stiffness * (simulated - self.test.column("eta"))
                labels |= {"structure": structure + FROM_XI, "recommended": False}
                found += records(self.test.matrix(["F_p"]), force[:, None], ["F_p"], labels)
        return found

    def _growth(self, network: ArxNetwork, training: list[DataSet]) -> Record:
        """Return how the tree grew, and how many rows of the data lie in every cell."""
        eta = np.concatenate([one.column("eta")[:: network.settings.every] for one in training])
        inside = [int(network.cells.rows_in(eta[:, None], k).sum()) for k in range(len(network.parameters))]
        return {
            "growth": self.output,
            **self.labels,
            "edges": [float(network.cells.low[0, 0]), *map(float, network.cells.high[:, 0])],
            "rows": inside,
            "stages": [[one.models, one.place, one.loss**0.5] for one in network.growth],
        }

    def _measures(self, network: ArxNetwork, blends: dict[Form, Blend | None]) -> Iterator[Record]:
        """Yield spectral radii, and errors of every form over the range of the reference."""

        def measure(name: str, form: str, value: float, **rest: Any) -> Record:
            kept = float(value) if np.isfinite(value) else None
            return {"measure": name, **self.labels, "form": form, "value": kept, "unit": "1", **rest}

        local = max(float(np.abs(network.poles(k)).max()) for k in range(len(network.parameters)))
        yield measure(LOCAL_RADIUS, "all", local)
        reference = self.test.column(self.output)
        span, rows = float(np.ptp(reference)), scored_rows(len(reference))
        errors: dict[str, float] = {}
        for form, blend in blends.items():
            if blend is None:
                yield measure(LARGEST_ERROR, form, np.inf, time=None, eta=None)
                continue
            errors[form] = max_error(reference, blend.simulated) / span
            error = np.abs(blend.simulated - reference)[rows]
            worst = rows.start + int(np.argmax(np.where(np.isfinite(error), error, np.inf)))
            yield measure(
                LARGEST_ERROR,
                form,
                errors[form],
                time=round(worst * self.test.sample_time, 9),
                eta=float(self.test.column("eta")[worst]),
            )
            yield measure(BLEND_RADIUS, form, float(blend.radii.max()))
            off = np.abs(blend.rest - self._reference_at_rest(blend.heights)) / span
            at = int(np.argmax(np.where(np.isfinite(off), off, np.inf)))
            yield measure(REST_ERROR, form, float(off[at]), eta=float(blend.heights[at]))
        if {"regressors", "modal"} <= set(errors):
            yield measure(STATES_ERROR, "modal", errors["regressors"] / errors["modal"])

    def _reference_at_rest(self, heights: Array) -> Array:
        if self.data.static_map is None:
            raise ValueError("study data come with a static map")
        return self.data.static_map.select([self.output]).at(heights)[:, 0]

    def _poles(self, network: ArxNetwork) -> Iterator[Record]:
        """Yield the poles of every local model (thesis Figure 4.7), slow ones first."""
        for index, centre in enumerate(network.cells.centres[:, 0]):
            upper = [pole for pole in network.poles(index) if pole.imag >= 0.0]
            for pole in sorted(upper, key=lambda one: abs(np.log(one))):
                yield {
                    "poles": float(centre), **self.labels, "real": float(pole.real),
                    "imaginary": float(pole.imag), "sample_time": network.sample_time,
                }  # fmt: skip

    def _drawing(self, network: ArxNetwork, blends: dict[Form, Blend | None]) -> Iterator[Record]:
        shown = {form: blends.get(form) for form in ("regressors", "modal")}
        kept = {form: blend for form, blend in shown.items() if blend is not None}
        if not kept:
            return
        heights = next(iter(kept.values())).heights
        svg = soaring_figure(
            f"lolimot-{self.task.wbm}-{network.orders.past_outputs}-{network.orders.past_inputs}",
            self.test,
            network.weights(self.test.matrix(INPUTS)),
            self._reference_at_rest(heights),
            {form: (one.simulated, one.heights, one.radii, one.rest) for form, one in kept.items()},
        )
        caption = (
            f"Set {self.task.wbm}, seed {self.task.seed}, {self.configuration.name}: the angle of the lower "
            "arm on unseen data, white-box model and two blends of the same local models (thesis Figure "
            "4.6); below it the validities; then the blends held at a height: their outputs at rest, and the "
            "largest pole's distance from the unit circle."
        )
        yield {"drawing": "soaring", "svg": svg, "caption": caption}


def _rest(built: ParameterSet, heights: Array) -> Array:
    """Return the output at rest at `TORQUE` over the heights."""
    found = np.full(len(heights), np.nan)
    for k, height in enumerate(heights):
        try:
            found[k] = simulate(built, [[height, TORQUE]])[0, 0]
        except ParameterSetError:
            continue
    return found

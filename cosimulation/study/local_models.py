"""Local models of one white-box set and one seed, each kind made once: identified, or linearised."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np
import scipy.signal

from cosimulation.data_folder import DataFolder
from cosimulation.fmu_file import open_fmu
from cosimulation.linearise import linearise
from cosimulation.pantograph import DESCRIPTIONS, INPUTS, OUTPUTS, TORQUE
from cosimulation.study.data import RANGE, Noise, centres, noisy, operating_points, study_data
from identification import static_map as maps
from identification.arrays import Array
from identification.data_set import DataSet
from identification.linear import discretised
from identification.local_model import LocalModel
from identification.n4sid import LocalModels, N4sidSettings, identify
from identification.network import signals_of
from identification.placement import placed, response_distances
from identification.subspace import SubspaceSettings
from identification.subspace.alignment import Alignment, in_common_coordinates

Origin = Literal["n4sid", "linearisation"]
"""Identified from operating-point data, or the white-box model's own linearisations: the yardstick."""
Placement = Literal["equidistant", "placed"]
Map = Literal["reference", "operating_points", "regression"]

COARSE = 4
"""Equidistant heights of the coarse pass that heights are placed by."""
_SECOND_PASS = 1000
"""Added to the seed where data are recorded again at placed heights: nothing drawn before comes again."""
_SPECTRUM_ROWS = 2048
Made = TypeVar("Made")


@dataclass
class LocalModelSource:
    """Makes local models and keeps them.

    Attributes:
        fmu: The white-box FMU.
        wbm: Its parameter set.
        seed: Of the data.
        data: Training data at the heights of all equidistant models and of the coarse pass, and through the
            whole range.
        subspace: Settings of the estimator.
        duration: Of operating-point data that are recorded on top [s].
    """

    fmu: Path
    wbm: str
    seed: int
    data: DataFolder
    subspace: SubspaceSettings
    duration: float
    _kept: dict[Hashable, Any] = field(default_factory=dict)

    def training(self, kind: str, noise: Noise, heights: Iterable[float] = ()) -> list[DataSet]:
        """Return training data of a kind with measurement noise, for operating points at `heights`."""
        wanted = set(heights)
        return [
            noisy(item.data, noise, self.seed, stream)
            for stream, item in enumerate(self.data.experiments)
            if (item.kind, item.split) == (kind, "train") and (not wanted or item.height in wanted)
        ]

    def local_models(
        self,
        origin: Origin,
        placement: Placement,
        count: int,
        noise: Noise,
        alignment: Alignment,
        static_map: Map,
    ) -> LocalModels:
        """Return local models in common coordinates with their static map.

        Raises:
            LlmnError: They cannot be identified, or not be brought together that way.
        """
        key = (origin, placement, count, noise)
        local = self._once(key, lambda: self._in_own_coordinates(origin, placement, count, noise))
        common = self._once(
            (*key, alignment), lambda: in_common_coordinates(local.models, alignment, local.output_scale)
        )
        return replace(local, models=tuple(common), static_map=self._static_map(local, static_map, noise))

    def linearised(self, heights: Sequence[float]) -> list[LocalModel]:
        """Return the white-box model's exact linearisations at rest, sampled with zero-order hold."""
        models = []
        with open_fmu(self.fmu) as fmu:
            for height in heights:
                found = linearise(fmu, {"eta": height, "M_pa": TORQUE}, OUTPUTS, {"preset": self.wbm})
                models.append(
                    discretised(
                        (found.A, found.B, found.C, found.D),
                        self.data.experiments[0].data.sample_time,
                        INPUTS,
                        OUTPUTS,
                        found.input_operating_point,
                        found.output_operating_point,
                    )
                )
        return models

    def _once(self, key: Hashable, make: Callable[[], Made]) -> Made:
        if key not in self._kept:
            self._kept[key] = make()
        found: Made = self._kept[key]
        return found

    def _in_own_coordinates(
        self, origin: Origin, placement: Placement, count: int, noise: Noise
    ) -> LocalModels:
        heights = centres(count) if placement == "equidistant" else self._placed(count, noise)
        chosen = N4sidSettings(centres=tuple(heights), subspace=self.subspace, alignment="none")
        if origin == "linearisation":
            return self._linearised(heights, chosen)
        if placement == "equidistant":
            training = self.training("operating_point", noise, heights)
        else:
            seed = self.seed + _SECOND_PASS
            experiments = operating_points(heights, "train", self.duration)
            again, _ = study_data(self.fmu, self.wbm, seed, experiments)
            training = [noisy(item.data, noise, seed, k) for k, item in enumerate(again.experiments)]
        return identify(training, chosen, self.data.static_map, DESCRIPTIONS)

    def _linearised(self, heights: Sequence[float], chosen: N4sidSettings) -> LocalModels:
        training = self.training("operating_point", "none", centres(COARSE))
        scale = np.mean([data.matrix(OUTPUTS).std(axis=0) for data in training], axis=0)
        middle = {"eta": 0.5 * sum(RANGE), "M_pa": TORQUE}
        table = self._reference_map()
        rest = table.at(np.array([middle["eta"]]))[0]
        signals = signals_of(training, INPUTS, OUTPUTS, middle, rest, DESCRIPTIONS)
        return LocalModels(chosen, np.array(heights), tuple(self.linearised(heights)), signals, table, scale)

    def _placed(self, count: int, noise: Noise) -> list[float]:
        """Return heights to the millimetre where the models of the coarse pass differ most."""
        coarse = self.local_models("n4sid", "equidistant", COARSE, noise, "none", "reference")
        inputs = [data.matrix(INPUTS) for data in self.training("operating_point", noise, centres(COARSE))]
        rate = 1.0 / coarse.models[0].sample_time
        rows = min(_SPECTRUM_ROWS, *(len(one) for one in inputs))
        spectra = [scipy.signal.welch(one, rate, nperseg=rows, axis=0) for one in inputs]
        size: Array = np.sqrt(np.mean([power for _, power in spectra], axis=0))
        distances = response_distances(coarse.models, spectra[0][0], size, coarse.output_scale)
        return [round(float(height), 3) for height in placed(coarse.centres, distances, count, RANGE)]

    def _static_map(self, local: LocalModels, wanted: Map, noise: Noise) -> maps.StaticMap:
        point = local.settings.operating_point
        if wanted == "operating_points":
            return maps.from_local_models(local.models, local.centres.tolist(), point, "eta", RANGE)
        if wanted == "regression":
            return maps.from_data(self.training("whole_range", noise), "eta", point, OUTPUTS)
        return self._reference_map()

    def _reference_map(self) -> maps.StaticMap:
        if self.data.static_map is None:
            raise ValueError("study data come with a static map")
        return self.data.static_map.select(OUTPUTS)

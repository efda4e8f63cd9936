"""Whole-range data as output-error problems of a surrogate network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fmu_builder.errors import IdentificationError
from fmu_builder.parameter_set import Partition
from identification.arrays import Array
from identification.data_set import DataSet
from identification.n4sid import LocalModels
from identification.network import partition_of
from identification.scores import fit_percent
from identification.static_map import StaticMap
from identification.surrogate.chain import INPUT_NAMES, OUTPUT_NAMES, Head
from identification.surrogate.problem import (
    SIGNALS,
    NetworkParameters,
    OutputErrorProblem,
    ThetaBlend,
    criterion_weights,
    observation_matrix,
)
from identification.surrogate.recursion import Experiment, Observation
from identification.surrogate.settings import SurrogateSettings
from identification.surrogate.structure import STRUCTURES
from identification.validity import node_positions, weights


@dataclass(frozen=True)
class Frame:
    """What turns data into a problem: structure, head, partition, statics and the weights of the cost.

    Attributes:
        settings: Those of the surrogate.
        local: Local black-box models: range, operating point, static map, sample time.
        head: The collector head.
        centres: Centres of the local models of the surrogate.
        criterion: Weights of eq. 3.39, (6,), from the training data.
    """

    settings: SurrogateSettings
    local: LocalModels
    head: Head
    centres: tuple[float, ...]
    criterion: Array

    @property
    def partition(self) -> Partition:
        """Scheduling input, range, centres and validity functions, without a deviation."""
        known = self.local.settings
        return partition_of(self.settings.network(), "eta", (known.low, known.high), self.centres)

    @property
    def theta_blend(self) -> ThetaBlend | None:
        """Where and how theta is blended, None where matrices are."""
        if self.settings.blending != "theta":
            return None
        partition = self.partition
        return ThetaBlend(node_positions(partition, self.settings.nodes, curved=True), partition)

    def problem(self, data: Sequence[DataSet]) -> OutputErrorProblem:
        """Return the output-error problem of data.

        Raises:
            DataError: Columns are missing.
        """
        observation = observation_matrix(self.head)
        settings, several = self.settings, len(self.centres) > 1  # one model is the same at every height
        return OutputErrorProblem(
            STRUCTURES[settings.structure],
            self.head,
            self.local.models[0].sample_time,
            [self._experiment(one, observation) for one in data],
            Observation(observation, self.criterion),
            blend=self.theta_blend,
            affine=settings.offsets == "affine",
            warp_free=several and settings.chosen_validity == "cubic_warp" and settings.warp == "tuned",
            gain_free=several and settings.deviation_gain == "tuned",
        )

    def _experiment(self, data: DataSet, observation: Array) -> Experiment:
        eta = data.column("eta")
        if self.settings.offsets == "affine":
            inputs, rest = data.matrix(INPUT_NAMES), np.zeros((len(eta), len(SIGNALS)))
            rest[:, SIGNALS.index("F_p")] -= self.head.k_E * eta
        else:
            inputs = data.matrix(("M_pa",)) - self.local.settings.operating_point["M_pa"]
            rest = at_rest(self.local.static_map, eta, observation, self.head)
        blend = np.zeros((0, 0)) if self.settings.blending == "theta" else _weights(self, eta)
        return Experiment(eta, inputs, blend, data.matrix(SIGNALS) - rest)

    def fit(
        self, problem: OutputErrorProblem, parameters: NetworkParameters, data: Sequence[DataSet]
    ) -> dict[str, float]:
        """Return the FIT of every signal [%], mean over the data, with the outputs the kernel would give."""
        fits = []
        for one, experiment in zip(data, problem.experiments, strict=True):
            reference = one.matrix(SIGNALS)
            simulated = reference - experiment.target + problem.simulate(parameters, experiment)
            fits.append([fit_percent(reference[:, k], simulated[:, k]) for k in range(len(SIGNALS))])
        return dict(zip(SIGNALS, np.mean(fits, axis=0).tolist(), strict=True))


def _weights(frame: Frame, eta: Array) -> Array:
    """Return the weights (N, M) as the kernel has them: from the node table, unless they are Gaussians."""
    partition = frame.partition
    if partition.validity == "gaussian":
        return weights(partition, eta)
    positions = node_positions(partition, frame.settings.nodes)
    table = weights(partition, positions)
    return np.column_stack([np.interp(eta, positions, column) for column in table.T])


def criterion_of(
    data: Sequence[DataSet], static_map: StaticMap, head: Head, contact_force_weight: float
) -> Array:
    """Return the weights of eq. 3.39, (6,), from the deviations of training data from the static map."""
    observation = observation_matrix(head)
    deviations = [
        one.matrix(SIGNALS) - at_rest(static_map, one.column("eta"), observation, head) for one in data
    ]
    return criterion_weights(np.concatenate(deviations), contact_force_weight)


def at_rest(static_map: StaticMap, eta: Array, observation: Array, head: Head) -> Array:
    """Return `SIGNALS` of a state at rest: row k + 1 with eta of row k, as in the kernel.

    F_p uses the height set last, so its part -k_E eta is that of row k itself.
    """
    latched = np.concatenate([eta[:1], eta[:-1]])
    outputs = static_map.select(OUTPUT_NAMES).at(latched)
    rest: Array = outputs @ observation[:, : len(OUTPUT_NAMES)].T
    rest[:, SIGNALS.index("F_p")] -= head.k_E * eta
    return rest


def cut(data: Sequence[DataSet], rows: tuple[int, int] | None) -> list[DataSet]:
    """Return the data, or of each the rows from the first to the last, counted from 1.

    Raises:
        IdentificationError: A data set is shorter.
    """
    if rows is None:
        return list(data)
    first, last = rows
    short: Mapping[str, int] = {one.name: len(one) for one in data if len(one) < last}
    if short:
        what = ", ".join(f"{name!r} has {count} samples" for name, count in short.items())
        raise IdentificationError.of(
            "training_rows", f"end at {last}, but {what}", "Choose rows inside the data"
        )
    return [
        DataSet(one.name, one.sample_time, one.names, one.units, one.values[first - 1 : last]) for one in data
    ]

"""What the identification of a surrogate gives: two thetas, which one to use, and how each was found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

import numpy as np

from fmu_builder.parameter_set import Partition, Quantity, SurrogateCertainty, SurrogateParameters
from identification.arrays import Array
from identification.data_set import DataSet
from identification.local_model import LocalModel
from identification.n4sid import LocalModels
from identification.network import partition_of
from identification.surrogate.certainty import Certainty, held, unsure
from identification.surrogate.chain import INPUT_NAMES, OUTPUT_MATRIX, OUTPUT_NAMES, STATE_NAMES, Head
from identification.surrogate.frequency_response import FrequencyResponseFit
from identification.surrogate.output_error import OutputErrorFit
from identification.surrogate.problem import NetworkParameters, OutputErrorProblem
from identification.surrogate.settings import SurrogateSettings
from identification.surrogate.structure import STRUCTURES, Structure
from identification.surrogate.training import Frame

HEAD_UNITS = {"m_C": "kg", "k_C": "N/m", "c_C": "N.s/m", "k_E": "N/m"}
Which = Literal["physical", "tuned"]


@dataclass(frozen=True)
class Recommendation:
    """Which theta to use, and why.

    Attributes:
        which: `tuned` only if neither the cost nor the FIT of F_p is worse than at its start.
        reason: In a sentence.
        judged_on: `validation` data, or `training` data where there were none.
        cost: Cost of eq. 3.39 per sample on these data, of the start and of the tuned theta.
        contact_force: FIT of F_p on these data [%], of the start and of the tuned theta.
    """

    which: Which
    reason: str
    judged_on: Literal["validation", "training"]
    cost: tuple[float, float]
    contact_force: tuple[float, float]


@dataclass(frozen=True)
class SurrogateResult:
    """A surrogate: two thetas, kept apart because tuning buys fit with physics.

    Attributes:
        frame: Structure, head, partition, statics and cost weights: gives a problem for any data.
        physical_parameters: Theta of every local model from its frequency response, with what the network
            needs beside it.
        tuned_parameters: The same after output error; equal if that was not asked for.
        recommendation: Which of the two the network is made of unless said otherwise, and why.
        responses: The frequency-response fit of every local model.
        tuning: The output-error fit of the last stage, None if it was not asked for.
        fit_before: FIT on the training data [%] with `physical_parameters`, by signal.
        fit_after: The same with `tuned_parameters`.
        physical_errors: Standard errors of `physical`, (M, P), None if they were not asked for or the
            operating-point data were not given.
        certainty: How sure `tuned` is, None if that was not asked for.
        provenance: Names and content hashes of the training data, settings.
    """

    frame: Frame
    physical_parameters: NetworkParameters
    tuned_parameters: NetworkParameters
    recommendation: Recommendation
    responses: tuple[FrequencyResponseFit, ...]
    tuning: OutputErrorFit | None
    fit_before: Mapping[str, float]
    fit_after: Mapping[str, float]
    physical_errors: Array | None = None
    certainty: Certainty | None = None
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def settings(self) -> SurrogateSettings:
        """What was asked for."""
        return self.frame.settings

    @property
    def structure(self) -> Structure:
        """The chain."""
        return STRUCTURES[self.frame.settings.structure]

    @property
    def head(self) -> Head:
        """The collector head."""
        return self.frame.head

    @property
    def local(self) -> LocalModels:
        """The local black-box models."""
        return self.frame.local

    @property
    def fit(self) -> Mapping[str, float]:
        """FIT on the training data [%] with the recommended theta, by signal."""
        return self.fit_after if self.recommended == "tuned" else self.fit_before

    @property
    def recommended(self) -> Which:
        """Which theta the network is made of unless said otherwise."""
        return self.recommendation.which

    @property
    def reason(self) -> str:
        """Why."""
        return self.recommendation.reason

    @property
    def physical(self) -> Array:
        """Theta from the frequency responses, (M, P)."""
        return self.physical_parameters.theta

    @property
    def tuned(self) -> Array:
        """Theta after output error, (M, P)."""
        return self.tuned_parameters.theta

    def parameters_of(self, which: Which) -> NetworkParameters:
        """Return theta with offsets and kappa."""
        return self.physical_parameters if which == "physical" else self.tuned_parameters

    def theta(self, which: Which) -> Array:
        """Return one of the two thetas, (M, P)."""
        return self.parameters_of(which).theta

    def standard_errors(self, which: Which) -> Array:
        """Return the standard errors of one of the thetas, (M, P); NaN where there are none."""
        if which == "physical":
            found = self.physical_errors
        else:
            found = None if self.certainty is None else self.certainty.standard_errors
        return np.full(self.tuned.shape, np.nan) if found is None else found

    def correlated(self) -> tuple[str, ...]:
        """Return the pairs of tuned numbers that data hardly tell apart (`certainty.CLOSE`), in words."""
        return tuple(
            f"{one} and {other}: {'rise together' if value > 0.0 else 'one rises as the other falls'} "
            f"(correlation {value:.3f})"
            for one, other, value in (self.certainty.close if self.certainty else ())
        )

    def remarks(self, which: Which) -> tuple[str, ...]:
        """Return what data cannot tell of one of the thetas, in words; nothing if it was not asked for."""
        if self.certainty is None:
            return ()
        if which == "tuned":
            return self.certainty.remarks
        errors, theta = self.standard_errors(which), self.physical
        lost = () if self.physical_errors is None else np.flatnonzero(np.isnan(errors).all(axis=1))
        return (
            *held(self.structure, theta),
            *(
                f"local model {index + 1}: a tenth left out gives no model, so no standard errors"
                for index in lost
            ),
            *unsure(self.structure, theta, errors),
        )

    @property
    def tuned_from(self) -> str:
        """What output error started from, in words; empty if it was not asked for."""
        if self.tuning is None:
            return ""
        wanted = self.settings.output_error
        start = "physical theta" if wanted.single_start is None else "single start that was given"
        stages = f", {' -> '.join(map(str, wanted.stages))} local models" if wanted.stages else ""
        return start + stages

    def at_bound(self, which: Which) -> tuple[dict[str, str], ...]:
        """Return per local model the parameters that stand at a bound, with `lower` or `upper`."""
        return tuple(self.structure.at_bound(row) for row in self.theta(which))

    def partition(self, which: Which) -> Partition:
        """Return scheduling input, range, centres, validity functions and the deviation that schedules."""
        chosen = self.parameters_of(which)
        known = self.local.settings
        network = self.settings.network(chosen.warp, chosen.gain)
        return partition_of(network, "eta", (known.low, known.high), self.frame.centres)

    def problem(self, data: Sequence[DataSet]) -> OutputErrorProblem:
        """Return the output-error problem of data: cost, Jacobian and information at any parameters.

        Raises:
            DataError: Columns are missing.
        """
        return self.frame.problem(data)

    def local_models(self, which: Which) -> tuple[LocalModel, ...]:
        """Return the discrete local models of one of the thetas."""
        centres = np.asarray(self.frame.centres)
        rest = self.local.static_map.select(OUTPUT_NAMES).at(centres)
        torque = self.local.settings.operating_point["M_pa"]
        sample_time = self.local.models[0].sample_time
        dynamics = self.structure.discretise(self.theta(which), self.head, sample_time, derivatives=False)
        through = np.zeros((len(OUTPUT_NAMES), len(INPUT_NAMES)))
        return tuple(
            LocalModel(
                *(dynamics.A[k], dynamics.B[k], OUTPUT_MATRIX, through, sample_time),
                inputs=INPUT_NAMES,
                outputs=OUTPUT_NAMES,
                input_operating_point=np.array([centre, torque]),
                output_operating_point=rest[k],
            )
            for k, centre in enumerate(centres)
        )

    def parameters(self) -> SurrogateParameters:
        """Return both thetas as they stand in a parameter set."""
        names = self.structure.names
        tables = {
            which: tuple(dict(zip(names, row.tolist(), strict=True)) for row in self.theta(which))
            for which in ("physical", "tuned")
        }
        return SurrogateParameters(
            structure=self.settings.structure,
            head={
                name: Quantity(value=value, unit=HEAD_UNITS[name])
                for name, value in asdict(self.head).items()
            },
            **tables,
            units={parameter.name: parameter.unit for parameter in self.structure.parameters},
            at_bound=tuple(tuple(row) for row in self.at_bound("tuned")),
            physical_at_bound=tuple(tuple(row) for row in self.at_bound("physical")),
            starts=tuple(fit.account for fit in self.responses),
            tuned_from=self.tuned_from,
            recommended=self.recommended,
            reason=self.reason,
            certainty=self._certainty(),
        )

    def _certainty(self) -> SurrogateCertainty | None:
        told, names = self.certainty, self.structure.names

        def table(values: Array) -> tuple[dict[str, float], ...]:
            return tuple(
                {name: value for name, value in zip(names, row, strict=True) if np.isfinite(value)}
                for row in values.tolist()
            )

        if told is None:
            return None
        correlations = tuple(
            tuple(tuple(one if np.isfinite(one) else None for one in row) for row in table)
            for table in told.correlations.tolist()
        )
        return SurrogateCertainty(
            physical_errors=table(self.standard_errors("physical")),
            tuned_errors=table(told.standard_errors),
            correlations=correlations,
            condition=told.condition if np.isfinite(told.condition) else None,
            partial={name: table(rows) for name, rows in zip(STATE_NAMES, told.partial, strict=True)},
            coupled={name: table(rows) for name, rows in zip(STATE_NAMES, told.coupled, strict=True)},
            remarks=told.remarks,
            physical_remarks=self.remarks("physical"),
        )

"""The whole surrogate job: local black-box models, whole-range data -> physical, tuned theta -> network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from fmu_builder.errors import IdentificationError, Problem
from fmu_builder.parameter_set import DerivedOutput, ParameterSet, Partition, Quantity, SurrogateParameters
from identification.arrays import Array
from identification.data_set import DataSet
from identification.local_model import LocalModel
from identification.n4sid import LocalModels
from identification.network import NetworkSettings, assemble, partition_of
from identification.scores import fit_percent
from identification.static_map import StaticMap
from identification.surrogate.frequency_response import (
    FrequencyResponseFit,
    FrequencyResponseSettings,
    fit_frequency_response,
    input_spectrum,
    local_response,
    response_weights,
)
from identification.surrogate.output_error import (
    SIGNALS,
    OutputErrorFit,
    OutputErrorProblem,
    OutputErrorSettings,
    criterion_weights,
    fit_output_error,
    observation_matrix,
)
from identification.surrogate.recursion import Experiment, Observation
from identification.surrogate.structure import (
    INPUT_NAMES,
    OUTPUT_MATRIX,
    OUTPUT_NAMES,
    STRUCTURES,
    Head,
    Structure,
)
from identification.validity import weights

HEAD_UNITS = {"m_C": "kg", "k_C": "N/m", "c_C": "N.s/m", "k_E": "N/m"}


class SurrogateSettings(BaseModel):
    """What kind of surrogate is identified, and how.

    Attributes:
        structure: A key of `STRUCTURES`.
        validity: Validity functions. A structure that cannot follow the reference must not be extrapolated:
            the default holds the outer models beyond their centres.
        k_sigma: Gaussians only: the standard deviation is k_sigma times the spread.
        frequency_response: The fit that gives the physical theta and the start of the tuning.
        output_error: The tuning.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    structure: Literal["chain7", "chain10"] = "chain7"
    validity: Literal["gaussian", "hat_clamped", "hat"] = "hat_clamped"
    k_sigma: float = Field(1.0 / 3.0, gt=0.0)
    frequency_response: FrequencyResponseSettings = FrequencyResponseSettings()
    output_error: OutputErrorSettings = OutputErrorSettings()

    @property
    def network(self) -> NetworkSettings:
        """How the local models become a network."""
        return NetworkSettings(
            validity=self.validity,
            k_sigma=self.k_sigma,
            blending="parameter",
            offsets="scheduled_equilibrium",
        )


@dataclass(frozen=True)
class SurrogateResult:
    """A surrogate: two thetas, kept apart because tuning buys fit with physics.

    Attributes:
        structure: The chain.
        head: The collector head.
        settings: What was asked for.
        partition: Scheduling input, range, centres and validity functions.
        local: The local black-box models and what else the network needs.
        physical: Theta of every local model from its frequency response, (M, P).
        tuned: Theta after output error, (M, P); equal to `physical` if that was not better or not asked for.
        recommended: Which of the two the network is made of unless said otherwise.
        reason: Why, in a sentence.
        responses: The fit of every local model.
        tuning: The output-error fit, None if it was not asked for.
        fit_before: FIT on the training data with `physical`, by signal.
        fit_after: The same with `tuned`.
        provenance: Names and content hashes of the training data, settings.
    """

    structure: Structure
    head: Head
    settings: SurrogateSettings
    partition: Partition
    local: LocalModels
    physical: Array
    tuned: Array
    recommended: Literal["physical", "tuned"]
    reason: str
    responses: tuple[FrequencyResponseFit, ...]
    tuning: OutputErrorFit | None
    fit_before: Mapping[str, float]
    fit_after: Mapping[str, float]
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def theta(self, which: Literal["physical", "tuned"]) -> Array:
        """Return one of the two thetas, (M, P)."""
        return self.physical if which == "physical" else self.tuned

    def at_bound(self, which: Literal["physical", "tuned"]) -> tuple[dict[str, str], ...]:
        """Return per local model the parameters that stand at a bound, with `lower` or `upper`."""
        return tuple(self.structure.at_bound(row) for row in self.theta(which))

    def local_models(self, which: Literal["physical", "tuned"]) -> tuple[LocalModel, ...]:
        """Return the discrete local models of one of the thetas."""
        at_rest = self.local.static_map.select(OUTPUT_NAMES).at(np.asarray(self.partition.centres))
        torque = self.local.settings.operating_point["M_pa"]
        sample_time = self.local.models[0].sample_time
        found = []
        for row, centre, rest in zip(self.theta(which), self.partition.centres, at_rest, strict=True):
            dynamics = self.structure.discretise(row, self.head, sample_time, derivatives=False)
            found.append(
                LocalModel(
                    *(dynamics.A, dynamics.B, OUTPUT_MATRIX, np.zeros((len(OUTPUT_NAMES), len(INPUT_NAMES)))),
                    sample_time,
                    inputs=INPUT_NAMES,
                    outputs=OUTPUT_NAMES,
                    input_operating_point=np.array([centre, torque]),
                    output_operating_point=rest,
                )
            )
        return tuple(found)

    def parameters(self) -> SurrogateParameters:
        """Return both thetas as they stand in a parameter set; `at_bound` belongs to the tuned one."""
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
        )


def identify(
    local: LocalModels,
    training: Sequence[DataSet],
    head: Head,
    settings: SurrogateSettings | None = None,
) -> SurrogateResult:
    """Return a surrogate with the centres, range and static map of local black-box models.

    Theta is fitted to the frequency response of each local model, then tuned by output error on whole-range
    data. The tuned theta is used only if it does not make the training cost worse.

    Args:
        local: Local models with the pantograph's signals, in any state coordinates.
        training: Whole-range experiments with eta, M_pa and `SIGNALS`.
        head: The collector head, known.
        settings: What is asked for; default chain7, held beyond the outer centres.

    Raises:
        DataError: Columns are missing.
        IdentificationError: Other signals, other sample times, no data, or no theta with a finite cost.
        BuildError: The recursion cannot be compiled.
    """
    chosen = settings or SurrogateSettings()
    structure = STRUCTURES[chosen.structure]
    _check(local, training)
    for experiment in training:
        experiment.select((*INPUT_NAMES, *SIGNALS))
    identified = local.settings
    partition = partition_of(
        chosen.network, "eta", (identified.low, identified.high), [float(centre) for centre in local.centres]
    )
    responses = _responses(local, training, structure, head, chosen.frequency_response)
    physical = np.stack([fit.theta for fit in responses])
    problem = training_problem(local, training, partition, structure, head, chosen.output_error)
    tuning = fit_output_error(problem, physical, chosen.output_error) if chosen.output_error.enabled else None
    tuned, recommended, reason = _choose(physical, tuning)
    data = [{"name": one.name, "content_hash": one.content_hash} for one in training]
    return SurrogateResult(
        structure=structure,
        head=head,
        settings=chosen,
        partition=partition,
        local=local,
        physical=physical,
        tuned=tuned,
        recommended=recommended,
        reason=reason,
        responses=responses,
        tuning=tuning,
        fit_before=training_fit(problem, physical, local.static_map, training),
        fit_after=training_fit(problem, tuned, local.static_map, training),
        provenance={"surrogate": {"training": data, "settings": chosen.model_dump(mode="json")}},
    )


def network(
    name: str,
    result: SurrogateResult,
    derived_outputs: Sequence[DerivedOutput] = (),
    which: Literal["physical", "tuned"] | None = None,
    **rest: Any,
) -> ParameterSet:
    """Return the parameter set of a surrogate.

    Args:
        name: C identifier; the FMU's default model identifier.
        result: From `identify`.
        derived_outputs: F_H and F_p.
        which: Theta the local models are made of; default the recommended one.
        rest: Further fields of the parameter set; `provenance` is added to that of the identification.

    Raises:
        ParameterSetError: Not a valid parameter set; every problem is named.
    """
    theta = which or result.recommended
    inputs, outputs = result.local.signals
    provenance = {
        **result.local.provenance,
        **result.provenance,
        "theta": theta,
        **rest.pop("provenance", {}),
    }
    return assemble(
        name,
        result.local_models(theta),
        result.partition,
        result.settings.network,
        (
            tuple(next(one for one in inputs if one.name == wanted) for wanted in INPUT_NAMES),
            tuple(next(one for one in outputs if one.name == wanted) for wanted in OUTPUT_NAMES),
        ),
        result.local.static_map,
        derived_outputs,
        kind="surrogate",
        surrogate=result.parameters(),
        provenance=provenance,
        **rest,
    )


def training_problem(
    local: LocalModels,
    training: Sequence[DataSet],
    partition: Partition,
    structure: Structure,
    head: Head,
    settings: OutputErrorSettings,
) -> OutputErrorProblem:
    """Return the output-error problem of whole-range data, in deviations from the static map."""
    observation = observation_matrix(head)
    torque = local.settings.operating_point["M_pa"]
    experiments, deviations = [], []
    for data in training:
        eta = data.column("eta")
        target = data.matrix(SIGNALS) - _at_rest(local.static_map, eta, observation, head)
        inputs = data.matrix(("M_pa",)) - torque
        experiments.append(Experiment(eta, inputs, weights(partition, eta), target))
        deviations.append(target)
    weight = criterion_weights(np.concatenate(deviations), settings.contact_force_weight)
    return OutputErrorProblem(
        structure, head, local.models[0].sample_time, experiments, Observation(observation, weight)
    )


def training_fit(
    problem: OutputErrorProblem, theta: Array, static_map: StaticMap, training: Sequence[DataSet]
) -> dict[str, float]:
    """Return the FIT of every signal, mean over the experiments, with the outputs the kernel would give."""
    fits = []
    for data, experiment in zip(training, problem.experiments, strict=True):
        at_rest = _at_rest(static_map, experiment.scheduling, problem.observation.matrix, problem.head)
        simulated = at_rest + problem.simulate(theta, experiment)
        reference = data.matrix(SIGNALS)
        fits.append([fit_percent(reference[:, k], simulated[:, k]) for k in range(len(SIGNALS))])
    return dict(zip(SIGNALS, np.mean(fits, axis=0).tolist(), strict=True))


def _at_rest(static_map: StaticMap, eta: Array, observation: Array, head: Head) -> Array:
    """Return `SIGNALS` of a state at rest: row k + 1 with eta of row k, as in the kernel.

    F_p uses the height set last, so its part -k_E eta is that of row k itself.
    """
    latched = np.concatenate([eta[:1], eta[:-1]])
    outputs = static_map.select(OUTPUT_NAMES).at(latched)
    rest: Array = outputs @ observation[:, : len(OUTPUT_NAMES)].T
    rest[:, SIGNALS.index("F_p")] -= head.k_E * eta
    return rest


def _responses(
    local: LocalModels,
    training: Sequence[DataSet],
    structure: Structure,
    head: Head,
    settings: FrequencyResponseSettings,
) -> tuple[FrequencyResponseFit, ...]:
    """Fit every local model; the theta of the model below it is one more start: theta moves slowly."""
    frequencies = settings.frequencies()
    sample_time = local.models[0].sample_time
    spectra = [input_spectrum(data.matrix(INPUT_NAMES), sample_time, frequencies) for data in training]
    spectrum = np.mean(spectra, axis=0)
    found: list[FrequencyResponseFit] = []
    for model in local.models:
        response = local_response(model, frequencies)
        weight = response_weights(response, spectrum, frequencies)
        neighbour = {"neighbour": found[-1].theta} if found else None
        found.append(
            fit_frequency_response(response, weight, structure, head, sample_time, settings, neighbour)
        )
    return tuple(found)


def _choose(
    physical: Array, tuning: OutputErrorFit | None
) -> tuple[Array, Literal["physical", "tuned"], str]:
    """Return the tuned theta, the recommended one and why."""
    if tuning is None:
        return physical, "physical", "Output error was not asked for"
    before, after = tuning.cost_before, tuning.cost_after
    if not np.isfinite(after) and not np.isfinite(before):
        what = "the blended surrogate is unstable on the training data"
        raise IdentificationError.of("output error", what, "Use another structure or other local models")
    if not after <= before:
        return (
            physical,
            "physical",
            f"Output error would raise the training cost from {before:.6g} to {after:.6g}",
        )
    ended = "converged" if tuning.converged else "stopped at the iteration limit"
    return (
        tuning.theta,
        "tuned",
        f"Output error lowers the training cost from {before:.6g} to {after:.6g} ({ended})",
    )


def _check(local: LocalModels, training: Sequence[DataSet]) -> None:
    """Refuse what does not belong together, all problems at once."""
    found = []
    if not training:
        found.append(Problem("surrogate", "has no training data", "Give a whole-range experiment"))
    for data in training:
        if abs(data.sample_time - local.models[0].sample_time) > 1e-12:
            what = f"has the sample time {data.sample_time} s, the models {local.models[0].sample_time} s"
            found.append(Problem(f"data set {data.name!r}", what, "Use one sample time"))
    if local.settings.scheduling != "eta" or "M_pa" not in local.settings.operating_point:
        what = "is not scheduled on eta with an operating point of M_pa"
        found.append(Problem("surrogate", what, "Identify the local models with the pantograph's signals"))
    if found:
        raise IdentificationError(found)

"""The whole surrogate job: local black-box models, whole-range data -> physical, tuned theta."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fmu_builder.errors import IdentificationError, Problem
from identification.arrays import Array
from identification.data_set import DataSet
from identification.n4sid import LocalModels
from identification.surrogate.certainty import certainty
from identification.surrogate.chain import INPUT_NAMES, Head
from identification.surrogate.frequency_response import (
    FrequencyResponseFit,
    fit_frequency_response,
    input_spectrum,
)
from identification.surrogate.jackknife import physical_errors
from identification.surrogate.output_error import OutputErrorFit, fit_output_error
from identification.surrogate.problem import SIGNALS, NetworkParameters
from identification.surrogate.result import Recommendation, SurrogateResult
from identification.surrogate.settings import SurrogateSettings
from identification.surrogate.structure import STRUCTURES
from identification.surrogate.training import Frame, criterion_of, cut
from identification.validity import equidistant_centres

_ROWS_PER_NUMBER = 10
_SCHEDULE_TOLERANCE = 1e-3
"""Relative gain that ends the search for warp and kappa of a theta that does not move."""


def identify(
    local: LocalModels,
    training: Sequence[DataSet],
    head: Head,
    settings: SurrogateSettings | None = None,
    validation: Sequence[DataSet] = (),
    operating_points: Sequence[DataSet] = (),
) -> SurrogateResult:
    """Return a surrogate with the centres, range and static map of local black-box models.

    Theta is fitted to the frequency response of each local model, then tuned by output error on whole-range
    data. The tuned theta is recommended only if on validation data neither the cost of eq. 3.39 nor the FIT
    of F_p is worse than with the physical one.

    Args:
        local: Local models with the pantograph's signals, in any state coordinates.
        training: Whole-range experiments with eta, M_pa and `SIGNALS`.
        head: The collector head, known.
        settings: What is asked for; default chain8, theta blended.
        validation: Whole-range experiments that decide which theta is recommended; without them the training
            data do, and the result says so.
        operating_points: The data that the local models came from; without them the physical theta has no
            standard errors.

    Raises:
        DataError: Columns are missing.
        IdentificationError: Other signals, other sample times, too few data, stages that do not end with
            the local models, or no theta with a finite cost.
        BuildError: The recursion cannot be compiled.
    """
    chosen = settings or SurrogateSettings()
    _check(local, chosen, training, validation)
    for experiment in (*training, *validation):
        experiment.select((*INPUT_NAMES, *SIGNALS))
    criterion = criterion_of(training, local.static_map, head, chosen.output_error.contact_force_weight)
    frame = Frame(chosen, local, head, tuple(float(centre) for centre in local.centres), criterion)
    used = cut(training, chosen.training_rows)
    _enough(frame, used)
    spectrum = _spectrum(frame, training)
    responses = _responses(frame, spectrum)
    physical = _completed(frame, used, np.stack([fit.theta for fit in responses]))
    tuning = _tuned(frame, used, physical) if chosen.output_error.enabled else None
    tuned = physical if tuning is None else tuning.parameters
    problem = frame.problem(used)
    data = [{"name": one.name, "content_hash": one.content_hash} for one in training]
    judges = [{"name": one.name, "content_hash": one.content_hash} for one in validation]
    recommendation = _recommended(frame, physical, tuning, used, validation)  # refuses what runs away
    errors = certain = None
    if chosen.standard_errors:
        certain = certainty(problem, tuned)
        if operating_points:
            errors = physical_errors(
                local, operating_points, spectrum, problem.structure, head, chosen.frequency_response
            )
    known = {"training": data, "validation": judges, "settings": chosen.model_dump(mode="json")}
    return SurrogateResult(
        frame=frame,
        physical_parameters=physical,
        tuned_parameters=tuned,
        recommendation=recommendation,
        responses=responses,
        tuning=tuning,
        fit_before=frame.fit(problem, physical, used),
        fit_after=frame.fit(problem, tuned, used),
        physical_errors=errors,
        certainty=certain,
        provenance={"surrogate": known},
    )


def _spectrum(frame: Frame, training: Sequence[DataSet]) -> Array:
    """Return the excitation of the training data, by which frequency responses are weighted."""
    frequencies = frame.settings.frequency_response.frequencies()
    sample_time = frame.local.models[0].sample_time
    spectra = [input_spectrum(data.matrix(INPUT_NAMES), sample_time, frequencies) for data in training]
    return np.asarray(np.mean(spectra, axis=0))


def _responses(frame: Frame, spectrum: Array) -> tuple[FrequencyResponseFit, ...]:
    """Fit every local model to its frequency response."""
    settings = frame.settings.frequency_response
    structure = STRUCTURES[frame.settings.structure]
    return tuple(
        fit_frequency_response(model, spectrum, structure, frame.head, settings)
        for model in frame.local.models
    )


def _completed(frame: Frame, data: Sequence[DataSet], theta: Array) -> NetworkParameters:
    """Return what belongs to a theta that is not moved: its affine offsets, or its warp and kappa."""
    settings = frame.settings
    gain = 0.0 if settings.deviation_gain == "tuned" else settings.deviation_gain
    start = NetworkParameters(theta, warp=settings.first_warp, gain=gain)
    problem = frame.problem(data)
    if problem.affine:
        start = replace(start, offsets=_first_offsets(frame, len(theta)))
        found = fit_output_error(problem, start, settings.output_error, free="offsets").parameters
    elif problem.schedule_size:
        quick = settings.output_error.model_copy(update={"tolerance": _SCHEDULE_TOLERANCE})
        found = fit_output_error(problem, start, quick, free="schedule").parameters
    else:
        return start
    return replace(found, theta=theta)


def _first_offsets(frame: Frame, models: int) -> Array:
    """Return offsets to begin with: the torque counts from its operating point."""
    torque = frame.local.settings.operating_point["M_pa"]
    return np.tile([0.0, torque, 0.0, 0.0, 0.0, 0.0], (models, 1))


def _tuned(frame: Frame, data: Sequence[DataSet], physical: NetworkParameters) -> OutputErrorFit:
    """Tune stage by stage; a stage begins with the theta that the one before has at its places.

    As in the thesis (4.4), a local model takes over from the one of the stage before whose cell it lies in.
    """
    settings = frame.settings.output_error
    structure = STRUCTURES[frame.settings.structure]
    start = physical
    if settings.single_start is not None:
        theta = structure.from_coefficients(settings.single_start, frame.head)
        theta = structure.from_search(structure.to_search(theta))
        start = NetworkParameters(
            np.tile(theta, (len(frame.centres), 1)), warp=physical.warp, gain=physical.gain
        )
    stages = [frame]
    known = frame.local.settings
    for count in settings.stages[:-1]:
        centres = equidistant_centres(count, known.low, known.high)
        stages.insert(-1, replace(frame, centres=tuple(float(centre) for centre in centres)))
    fit = None
    for index, stage in enumerate(stages):
        if fit is not None or len(start.theta) != len(stage.centres):
            source = start if fit is None else fit.parameters
            before = frame.centres if fit is None else stages[index - 1].centres
            start = _taken_over(source, before, stage.centres)
        problem = stage.problem(data)
        if frame.settings.offsets == "affine" and not start.offsets.size:
            start = _completed(stage, data, start.theta)
        fit = fit_output_error(problem, start, settings)
    if fit is None:
        raise ValueError("there is at least one stage")
    return fit


def _taken_over(
    source: NetworkParameters, before: Sequence[float], centres: Sequence[float]
) -> NetworkParameters:
    """Return for every centre the parameters of the nearest one before, of two the lower."""
    distance = np.abs(np.asarray(centres)[:, None] - np.asarray(before)[None, :])
    nearest = np.argmin(np.round(distance, 9), axis=1)
    offsets = source.offsets[nearest] if source.offsets.size else source.offsets
    return replace(source, theta=source.theta[nearest], offsets=offsets)


def _recommended(
    frame: Frame,
    physical: NetworkParameters,
    tuning: OutputErrorFit | None,
    training: Sequence[DataSet],
    validation: Sequence[DataSet],
) -> Recommendation:
    """Return which theta is recommended: the tuned one only if it is in no respect worse."""
    judges = validation or training
    problem = frame.problem(judges)
    thetas = (physical, physical if tuning is None else tuning.parameters)
    cost = tuple(problem.cost(one) / problem.rows for one in thetas)
    if not any(map(np.isfinite, cost)):
        what = "the blended surrogate is unstable on whole-range data"
        raise IdentificationError.of("output error", what, "Use another structure or other local models")
    contact_force = tuple(frame.fit(problem, one, judges)["F_p"] for one in thetas)
    return judged(
        (cost[0], cost[1]), (contact_force[0], contact_force[1]), bool(validation), tuning is not None
    )


def judged(
    cost: tuple[float, float], contact_force: tuple[float, float], validated: bool, tuned: bool = True
) -> Recommendation:
    """Return the recommendation that follows from cost and FIT of F_p before and after the tuning.

    Args:
        cost: Of eq. 3.39 per sample, physical and tuned.
        contact_force: FIT of F_p [%], physical and tuned.
        validated: Whether they are of validation data.
        tuned: Whether output error was asked for.
    """
    data = "validation" if validated else "training"
    where = f"on {data} data" + ("" if validated else " (no validation data were given)")
    moves = (
        f"cost {cost[0]:.4g} -> {cost[1]:.4g}, FIT of F_p {contact_force[0]:.2f} -> {contact_force[1]:.2f} %"
    )
    better = tuned and cost[1] <= cost[0] and contact_force[1] >= contact_force[0]
    if not tuned:
        reason = "output error was not asked for"
    elif better:
        reason = f"output error makes neither cost nor contact force worse {where}: {moves}"
    else:
        worse = [
            name
            for name, bad in (
                ("the cost", not cost[1] <= cost[0]),
                ("the contact force", not contact_force[1] >= contact_force[0]),
            )
            if bad
        ]
        reason = f"output error makes {' and '.join(worse)} worse {where}: {moves}"
    return Recommendation("tuned" if better else "physical", reason, data, cost, contact_force)  # type: ignore[arg-type]


def _enough(frame: Frame, data: Sequence[DataSet]) -> None:
    """Refuse data that are too few to tune what is to be tuned.

    Raises:
        IdentificationError: Fewer than ten rows for every number.
    """
    problem = frame.problem(data)
    wanted = _ROWS_PER_NUMBER * len(problem.names)
    if frame.settings.output_error.enabled and problem.rows < wanted:
        what = f"{problem.rows} rows are too few for the {len(problem.names)} numbers of the surrogate"
        mend = f"Give at least {wanted} rows of whole-range data, and longer training_rows if they are given"
        raise IdentificationError.of("training data", what, mend)


def _check(
    local: LocalModels,
    settings: SurrogateSettings,
    training: Sequence[DataSet],
    validation: Sequence[DataSet],
) -> None:
    """Refuse what does not belong together, all problems at once."""
    found = []
    stages = settings.output_error.stages
    if stages and stages[-1] != len(local.models):
        what = f"end with {stages[-1]} local models, but there are {len(local.models)}"
        found.append(Problem("output_error.stages", what, f"End with {len(local.models)}"))
    if not training:
        found.append(Problem("surrogate", "has no training data", "Give a whole-range experiment"))
    for data in (*training, *validation):
        if abs(data.sample_time - local.models[0].sample_time) > 1e-12:
            what = f"has the sample time {data.sample_time} s, the models {local.models[0].sample_time} s"
            found.append(Problem(f"data set {data.name!r}", what, "Use one sample time"))
    if local.settings.scheduling != "eta" or "M_pa" not in local.settings.operating_point:
        what = "is not scheduled on eta with an operating point of M_pa"
        found.append(Problem("surrogate", what, "Identify the local models with the pantograph's signals"))
    if found:
        raise IdentificationError(found)

"""The models that are compared: every one a parameter set with the labels its scores carry."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from cosimulation.automatic import automatic_network, surrogate_warnings
from cosimulation.bands import banded
from cosimulation.data_folder import DataFolder
from cosimulation.fmu_file import OpenFmu
from cosimulation.linearise import linearise
from cosimulation.pantograph import (
    DESCRIPTIONS,
    INPUTS,
    OUTPUTS,
    TORQUE,
    force_outputs,
    operating_point_name,
)
from cosimulation.settings import GenerateSettings
from fmu_builder.parameter_set import DerivedOutput, ParameterSet
from fmus.wbm import parameter_sets
from identification import surrogate
from identification.choice import Choice
from identification.linear import discretised, linear_parameter_set
from identification.n4sid import LocalModels, N4sidSettings, identify
from identification.network import AUTOMATIC, THESIS, NetworkSettings, signals_of
from identification.warning import IdentificationWarning

LINEARISATION_HEIGHT = 1.25
"""Operating point OP45 of the demo's global linear model (thesis 4.8, M11) [m]."""


DEFAULT_SET = "A"
"""The white-box FMU's default preset; FMUs identified from it carry no suffix."""


NETWORKS = (
    ("n4sid_thesis", "n4sid, thesis configuration", THESIS),
    (
        "n4sid_output",
        "n4sid, scheduled equilibrium, output blending",
        AUTOMATIC.model_copy(update={"blending": "output"}),
    ),
    (
        "n4sid",
        "n4sid, scheduled equilibrium, parameter blending",
        AUTOMATIC.model_copy(update={"blending": "parameter"}),
    ),
)
"""Identifier, title and settings of the n4sid networks; AUTOMATIC would choose one of the blendings."""


@dataclass(frozen=True)
class Candidate:
    """One model to compare.

    Attributes:
        title: For a person.
        parameter_set: The model.
        labels: Fields of its score records.
        offset_subtracted: Whether the mean error is subtracted after the simulation, as the thesis does with
            the linearised model (Remark 4.8.1).
        surrogate: Physical parameters and how they were found, of a surrogate.
        local: The local models, of an n4sid network.
        choices: What was chosen automatically.
        warnings: What makes it doubtful.
    """

    title: str
    parameter_set: ParameterSet
    labels: dict[str, Any]
    offset_subtracted: bool = False
    surrogate: surrogate.SurrogateResult | None = None
    local: LocalModels | None = None
    choices: tuple[Choice, ...] = ()
    warnings: tuple[IdentificationWarning, ...] = ()

    @property
    def name(self) -> str:
        """The model identifier of its FMU."""
        return self.parameter_set.name


def head_forces(wbm: str) -> tuple[DerivedOutput, ...]:
    """Return F_H and F_p with the collector head of a white-box set; the head is known, not identified."""
    chosen = parameter_sets()[wbm]
    return force_outputs(chosen["k_E"], chosen["k_C"], chosen["c_C"])


def identifier(model: str, wbm: str) -> str:
    """Return the FMU's model identifier; the default white-box set has no suffix."""
    return f"pantograph_{model}" + ("" if wbm == DEFAULT_SET else f"_{wbm.lower()}")


def identify_candidates(
    wbm: str, data: DataFolder, fmu: OpenFmu, settings: GenerateSettings
) -> tuple[Candidate, ...]:
    """Identify everything the demo compares on one white-box set.

    Args:
        wbm: Name of the white-box set.
        data: Its reference data.
        fmu: The white-box FMU, for the linearised baseline.
        settings: Those of the data.

    Raises:
        LlmnError: A model cannot be identified.
    """
    training = [item.data for item in data.select("operating_point", "train")]
    local = identify(training, N4sidSettings(), data.static_map, DESCRIPTIONS)
    local = replace(local, provenance={**local.provenance, "origin": dict(data.origin)})
    forces = head_forces(wbm)
    found = (
        linearised(wbm, data, fmu, settings, forces),
        _surrogate(wbm, data, local, forces),
        *(_n4sid(wbm, *one, data, local, forces) for one in NETWORKS),
    )
    return tuple(replace(one, parameter_set=banded(one.parameter_set, data).parameter_set) for one in found)


def linearised(
    wbm: str,
    data: DataFolder,
    fmu: OpenFmu,
    settings: GenerateSettings,
    forces: tuple[DerivedOutput, ...],
    height: float = LINEARISATION_HEIGHT,
) -> Candidate:
    """Return the white-box model linearised at one height, as one global linear model (thesis 2.1.2, 4.8).

    The mean error is subtracted after the simulation (Remark 4.8.1), see `Candidate.offset_subtracted`.

    Args:
        wbm: Name of the white-box set.
        data: Its reference data.
        fmu: The white-box FMU.
        settings: Those of the data.
        forces: F_H and F_p, from `head_forces`.
        height: Of the operating point [m]. The model identifier is `pantograph_linear` at
            `LINEARISATION_HEIGHT`, else it tells the operating point, as in `pantograph_linear_op55`.

    Raises:
        FmuError: The FMU cannot be linearised there.
        IdentificationError: What it gives cannot be discretised.
    """
    point = {"eta": height, "M_pa": TORQUE}
    found = linearise(fmu, point, OUTPUTS, settings.reference.start_values)
    model = discretised(
        (found.A, found.B, found.C, found.D),
        settings.excitation.sample_time,
        INPUTS,
        OUTPUTS,
        found.input_operating_point,
        found.output_operating_point,
    )
    training = [item.data for item in data.select("whole_range", "train")]
    signals = signals_of(training, INPUTS, OUTPUTS, point, found.output_operating_point, DESCRIPTIONS)
    limits = (settings.static_map.low, settings.static_map.high)
    provenance = {"linearised_at": point, "origin": dict(data.origin)}
    place = operating_point_name(height)
    own = place.lower() if place.startswith("OP") else f"{round(1000 * height)}mm"
    name = "linear" if height == LINEARISATION_HEIGHT else f"linear_{own}"
    parameter_set = linear_parameter_set(
        identifier(name, wbm), model, "eta", limits, signals, forces, provenance, training
    )
    labels = _labels(
        wbm, parameter_set, offsets="subtracted after the simulation", route=f"linearised at {place}"
    )
    title = f"white-box model linearised at {place}"
    return Candidate(title, parameter_set, labels, offset_subtracted=True)


def n4sid_labels(wbm: str, parameter_set: ParameterSet, local: LocalModels) -> dict[str, Any]:
    """Return the fields of the score records of an n4sid network; `wbm` is the white-box set."""
    alignment = local.settings.alignment if parameter_set.blending == "parameter" else None
    return _labels(wbm, parameter_set, alignment=alignment)


def surrogate_labels(
    wbm: str, parameter_set: ParameterSet, result: surrogate.SurrogateResult
) -> dict[str, Any]:
    """Return the fields of the score records of a surrogate; `wbm` is the white-box set."""
    route = "frequency response" + (", output error" if result.recommended == "tuned" else "")
    return _labels(wbm, parameter_set, structure=result.settings.structure, route=route)


def _labels(wbm: str, parameter_set: ParameterSet, **more: Any) -> dict[str, Any]:
    llms = len(parameter_set.local_models)
    return {
        "wbm": wbm,
        "model": parameter_set.kind,
        "llms": llms,
        "blending": parameter_set.blending if llms > 1 else None,
        "offsets": parameter_set.offsets.kind,
        "validity": parameter_set.partition.validity if llms > 1 else None,
        "schedule": parameter_set.partition.scheduling if llms > 1 else None,
        "order": parameter_set.state_count,
        **more,
    }


def _n4sid(
    wbm: str,
    model: str,
    title: str,
    settings: NetworkSettings,
    data: DataFolder,
    local: LocalModels,
    forces: tuple[DerivedOutput, ...],
) -> Candidate:
    found = automatic_network(identifier(model, wbm), local, data, settings, forces)
    labels = n4sid_labels(wbm, found.parameter_set, local)
    return Candidate(
        title, found.parameter_set, labels, local=local, choices=found.choices, warnings=found.warnings
    )


def _surrogate(
    wbm: str, data: DataFolder, local: LocalModels, forces: tuple[DerivedOutput, ...]
) -> Candidate:
    chosen = parameter_sets()[wbm]
    head = surrogate.Head(m_C=chosen["mC"], k_C=chosen["k_C"], c_C=chosen["c_C"], k_E=chosen["k_E"])
    training = [item.data for item in data.select("whole_range", "train")]
    validation = [item.data for item in data.having("whole_range", "validation")]
    heights = [item.data for item in data.select("operating_point", "train")]
    result = surrogate.identify(
        local.trained_on(training), training, head, validation=validation, operating_points=heights
    )
    parameter_set = surrogate.network(identifier("surrogate", wbm), result, forces)
    labels = surrogate_labels(wbm, parameter_set, result)
    title = f"surrogate, three masses, {len(result.structure.parameters)} parameters"
    warnings = (*local.warnings, *surrogate_warnings(result, training))
    provenance = {**parameter_set.provenance, "warnings": [warning.record() for warning in warnings]}
    parameter_set = parameter_set.replaced(provenance=provenance)
    return Candidate(title, parameter_set, labels, surrogate=result, warnings=warnings)

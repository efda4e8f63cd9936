"""`llmn identify`: a data folder and a settings file give a parameter set."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from cosimulation.data_folder import DataFolder, load_data_folder
from cosimulation.pantograph import DESCRIPTIONS, force_outputs
from cosimulation.progress import SILENT, Reporter
from cosimulation.settings import Section
from fmu_builder.errors import SettingsError
from fmu_builder.parameter_set import DerivedOutput, DerivedTerm, NamedParameter, ParameterSet
from identification import surrogate as surrogates
from identification.n4sid import LocalModels, N4sidSettings, identify, network
from identification.network import RECOMMENDED, NetworkSettings


class HeadSettings(Section):
    """The collector head, which is known and not identified; gives F_H and F_p of a pantograph."""

    m_C: float = Field(gt=0, description="mass of the pan-head [kg]; the surrogate needs it")
    k_C: float = Field(gt=0, description="stiffness of its suspension [N/m]")
    c_C: float = Field(ge=0, description="damping of its suspension [N.s/m]")
    k_E: float = Field(1e5, gt=0, description="stiffness of the carbon contact [N/m]")


class TermSettings(Section):
    """`sign * parameter * signal`."""

    signal: str
    parameter: str
    sign: Literal[1, -1] = 1


class DerivedOutputSettings(Section):
    """An output computed from outputs and inputs, for models that are no pantograph."""

    name: str
    unit: str = ""
    description: str = ""
    terms: tuple[TermSettings, ...]
    parameters: dict[str, float]
    parameter_units: dict[str, str] = Field(default_factory=dict)


class IdentifySettings(Section):
    """`llmn identify`: method, data and what differs from the defaults."""

    method: Literal["n4sid", "surrogate"] = "n4sid"
    name: str = Field("pantograph_n4sid", pattern=r"^[A-Za-z_][A-Za-z0-9_]{0,54}$")
    data: Path = Path("data")
    output: Path | None = Field(None, description="parameter set to write; NAME.json by default")
    n4sid: N4sidSettings = N4sidSettings()
    network: NetworkSettings = RECOMMENDED
    surrogate: surrogates.SurrogateSettings = surrogates.SurrogateSettings()
    head: HeadSettings | None = Field(None, description="of a pantograph")
    derived_outputs: tuple[DerivedOutputSettings, ...] = ()
    descriptions: dict[str, str] = Field(default_factory=lambda: dict(DESCRIPTIONS))


@dataclass(frozen=True)
class Identified:
    """A parameter set that was written, and how it came about."""

    path: Path
    parameter_set: ParameterSet
    diagnostics: dict[str, Any]

    def summary(self) -> dict[str, object]:
        """Return the result for a machine."""
        return {
            "parameter_set": str(self.path),
            "model_hash": self.parameter_set.model_hash(),
            "diagnostics": self.diagnostics,
        }

    def text(self) -> str:
        """Return the result for a person."""
        chosen = self.parameter_set
        lines = [
            f"{chosen.name}: {chosen.kind}, {len(chosen.local_models)} local models of order "
            f"{chosen.state_count}, {chosen.blending} blending, "
            f"{chosen.partition.validity} validity, offsets {chosen.offsets.kind}"
        ]
        lines += [f"{key}: {_readable(value)}" for key, value in self.diagnostics.items()]
        return "\n".join([*lines, f"parameter set: {self.path}"])


def _readable(value: Any) -> str:
    """Return a diagnostic on one line: numbers in six digits, names and values of a table."""
    if isinstance(value, Mapping):
        return ", ".join(f"{name.replace('_', ' ')} {_readable(item)}" for name, item in value.items()) or "-"
    if isinstance(value, list | tuple):
        return " | ".join(map(_readable, value)) if value else "-"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def derived_outputs(settings: IdentifySettings) -> tuple[DerivedOutput, ...]:
    """Return the derived outputs of the settings: those of a pantograph's head, then the general ones."""
    head = settings.head
    forces = force_outputs(head.k_E, head.k_C, head.c_C) if head else ()
    general = tuple(
        DerivedOutput(
            name=item.name,
            unit=item.unit,
            description=item.description,
            terms=tuple(DerivedTerm(**term.model_dump()) for term in item.terms),
            parameters={
                name: NamedParameter(value=value, unit=item.parameter_units.get(name, ""))
                for name, value in item.parameters.items()
            },
        )
        for item in settings.derived_outputs
    )
    return (*forces, *general)


def identify_from_folder(settings: IdentifySettings, reporter: Reporter = SILENT) -> Identified:
    """Identify a model from a data folder and write its parameter set.

    Raises:
        DataError: The folder cannot be read or lacks an experiment.
        SettingsError: A surrogate without its head.
        IdentificationError: No model can be identified.
        ParameterSetError: The result is not a valid parameter set.
        OutputError: The parameter set cannot be written.
    """
    reporter.say(f"settings: {settings.model_dump_json()}")
    reporter.say(f"identifying {settings.name} by {settings.method}")
    data = load_data_folder(settings.data)
    training = [item.data for item in data.select("operating_point", "train")]
    local = identify(training, settings.n4sid, data.static_map, settings.descriptions)
    parameter_set, diagnostics = (
        _surrogate(settings, data, local) if settings.method == "surrogate" else _n4sid(settings, local)
    )
    provenance = {**parameter_set.provenance, "origin": dict(data.origin)}
    parameter_set = parameter_set.replaced(provenance=provenance)
    path = settings.output or Path(f"{settings.name}.json")
    return Identified(parameter_set.save(path), parameter_set, diagnostics)


def _n4sid(settings: IdentifySettings, local: LocalModels) -> tuple[ParameterSet, dict[str, Any]]:
    parameter_set = network(settings.name, local, settings.network, derived_outputs(settings))
    scheduling = local.settings.scheduling
    diagnostics = {
        f"local model at {scheduling} = {centre:g}": model.diagnostics
        for centre, model in zip(local.centres, local.models, strict=True)
    }
    return parameter_set, diagnostics


def _surrogate(
    settings: IdentifySettings, data: DataFolder, local: LocalModels
) -> tuple[ParameterSet, dict[str, Any]]:
    if settings.head is None:
        mend = "Add a table [head] with m_C, k_C, c_C, k_E"
        raise SettingsError.of("head", "a surrogate needs the collector head, which is not identified", mend)
    head = surrogates.Head(**settings.head.model_dump())
    training = [item.data for item in data.select("whole_range", "train")]
    result = surrogates.identify(local, training, head, settings.surrogate)
    parameter_set = surrogates.network(settings.name, result, derived_outputs(settings))
    diagnostics = {
        "theta": f"{result.recommended} ({result.reason})",
        "at a bound": [dict(row) for row in result.at_bound(result.recommended)],
        "FIT on training data [%]": dict(result.fit_after),
    }
    return parameter_set, diagnostics

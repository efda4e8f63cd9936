"""`llmn identify`: a data folder and a settings file give a parameter set."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from cosimulation.automatic import (
    automatic_network,
    choice_lines,
    local_choices,
    surrogate_warnings,
    warning_lines,
)
from cosimulation.bands import banded, bands_account
from cosimulation.data_folder import DataFolder, load_data_folder
from cosimulation.pantograph import DESCRIPTIONS, force_outputs
from cosimulation.progress import SILENT, Reporter
from cosimulation.settings import Section
from fmu_builder.errors import DataError, SettingsError
from fmu_builder.files import written_atomically
from fmu_builder.parameter_set import DerivedOutput, DerivedTerm, NamedParameter, ParameterSet
from identification import surrogate as surrogates
from identification.choice import Choice
from identification.n4sid import LocalModels, N4sidSettings, identify
from identification.network import AUTOMATIC, NetworkSettings
from identification.residuals import ResidualSettings
from identification.static_map import StaticMap
from identification.tuning import TuningSettings
from identification.warning import IdentificationWarning


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
    page: Path | bool = Field(True, description="page on it: a file, beside the parameter set, or false")
    static_map: Literal["automatic", "folder", "local_models"] = Field(
        "automatic", description="outputs at rest: the data folder's, or through the local models' means"
    )
    n4sid: N4sidSettings = N4sidSettings()
    network: NetworkSettings = Field(AUTOMATIC, description="what is not given stays automatic")
    tuning: TuningSettings = TuningSettings()
    surrogate: surrogates.SurrogateSettings = surrogates.SurrogateSettings()
    residuals: ResidualSettings = Field(
        ResidualSettings(), description="error bands from whole-range data of the split validation"
    )
    head: HeadSettings | None = Field(None, description="of a pantograph")
    derived_outputs: tuple[DerivedOutputSettings, ...] = ()
    descriptions: dict[str, str] = Field(default_factory=lambda: dict(DESCRIPTIONS))

    @field_validator("network", mode="before")
    @classmethod
    def _over_automatic(cls, given: Any) -> Any:
        """Let a table that gives some keys leave the others to the data."""
        return {**AUTOMATIC.model_dump(exclude_unset=True), **given} if isinstance(given, Mapping) else given

    @model_validator(mode="after")
    def _two_files(self) -> IdentifySettings:
        path, page = self.files
        if path == page:
            raise ValueError(f"page and parameter set cannot both be {path}")
        return self

    @model_validator(mode="after")
    def _known_residuals(self) -> IdentifySettings:
        known = (*self.n4sid.outputs, *(one.name for one in derived_outputs(self)))
        if unknown := [name for name in self.residuals.outputs or () if name not in known]:
            what = f"residuals.outputs: there is no {', '.join(unknown)}"
            raise ValueError(f"{what}; name some of {', '.join(known)}")
        return self

    @property
    def files(self) -> tuple[Path, Path | None]:
        """The parameter set and the page to write."""
        path = self.output or Path(f"{self.name}.json")
        if isinstance(self.page, Path):
            return path, self.page
        return path, path.with_suffix(".html") if self.page else None


@dataclass(frozen=True)
class Identified:
    """A model that was identified, and how it came about.

    Attributes:
        path: Its parameter set.
        page: The page on it, None if none was asked for.
        parameter_set: The network.
        local: The local models it was made of, or from whose frequency response.
        choices: What was chosen automatically.
        warnings: What makes it doubtful.
        diagnostics: More, by name.
        surrogate: Physical parameters and how they were found, of a surrogate.
        bands_remark: Why there are no error bands of its predictions, "" where there are.
    """

    path: Path
    page: Path | None
    parameter_set: ParameterSet
    local: LocalModels
    choices: tuple[Choice, ...]
    warnings: tuple[IdentificationWarning, ...]
    diagnostics: dict[str, Any]
    surrogate: surrogates.SurrogateResult | None = None
    bands_remark: str = ""

    def summary(self) -> dict[str, object]:
        """Return the result for a machine."""
        return {
            "parameter_set": str(self.path),
            "page": None if self.page is None else str(self.page),
            "model_hash": self.parameter_set.model_hash(),
            "choices": [choice.record() for choice in self.choices],
            "warnings": [warning.record() for warning in self.warnings],
            "residual_bands": [one.model_dump(mode="json") for one in self.parameter_set.residual_bands],
            "residual_bands_remark": self.bands_remark,
            "diagnostics": {
                **{
                    f"local model at {self.local.place(index)}": model.diagnostics
                    for index, model in enumerate(self.local.models)
                },
                **self.diagnostics,
            },
        }

    @property
    def headline(self) -> str:
        """One line on what the network is."""
        chosen = self.parameter_set
        count = len(chosen.local_models)
        return (
            f"{chosen.kind}, {count} local model{'s' if count > 1 else ''} of order "
            f"{chosen.state_count}, {chosen.blending} blending, {chosen.partition.validity} validity, "
            f"offsets {chosen.offsets.kind}"
        )

    def text(self) -> str:
        """Return the result for a person."""
        lines = [
            f"{self.parameter_set.name}: {self.headline}",
            *choice_lines(self.choices),
            "",
            *_local_model_lines(self.local),
            *warning_lines(self.warnings),
        ]
        lines += [f"{key}: {_readable(value)}" for key, value in self.diagnostics.items()]
        lines += bands_account(self.parameter_set, self.bands_remark)
        lines += ["", f"parameter set: {self.path}"]
        return "\n".join(
            lines if self.page is None else [*lines, f"singular values and choices: {self.page}"]
        )


def _local_model_lines(local: LocalModels) -> list[str]:
    """Return a table with a row per local model."""
    names = local.settings.outputs
    widths = [max(len(name), 7) + 2 for name in names]
    head = (
        f"{'local model at':<20}{'order':>7}{'block rows':>12}{'spectral radius':>17}  FIT on its data [%]:"
    )
    lines = [head + "".join(f"{name:>{width}}" for name, width in zip(names, widths, strict=True))]
    for index, model in enumerate(local.models):
        found = model.diagnostics
        row = f"{local.place(index):<20}{model.order:>7}{found['block_rows']:>12}"
        row += f"{model.spectral_radius:>17.6f}{'':>22}"
        fits = zip(found["training_fit"], widths, strict=True)
        cells = (f"{'at rest':>{width}}" if fit is None else f"{fit:>{width}.3f}" for fit, width in fits)
        lines.append(row + "".join(cells))
    return lines


def _readable(value: Any) -> str:
    """Return a diagnostic on one line: numbers in six digits, names and values of a table."""
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_readable(item)}" for name, item in value.items()) or "-"
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
    """Identify a model from a data folder; write its parameter set and, if asked for, a page on it.

    Raises:
        DataError: The folder cannot be read or lacks an experiment.
        SettingsError: A surrogate without its head.
        IdentificationError: No model can be identified.
        ParameterSetError: The result is not a valid parameter set.
        OutputError: A file cannot be written; then none is.
    """
    data = load_data_folder(settings.data)
    training = [item.data for item in data.select("operating_point", "train")]
    static_map, before = _static_map(settings, data)
    reporter.say(f"identifying the local models of {settings.name}")
    chosen = settings.n4sid
    if settings.method == "surrogate":
        chosen = surrogates.local_model_settings(chosen)
    local = identify(training, chosen, static_map, settings.descriptions)
    physical: surrogates.SurrogateResult | None = None
    if settings.method == "surrogate":
        reporter.say("fitting physical parameters")
        parameter_set, physical, against = _surrogate(settings, data, local)
        choices, warnings = (*before, *local_choices(local)), (*local.warnings, *against)
    else:
        reporter.say("blending them")
        parameter_set, choices, warnings = automatic_network(
            settings.name, local, data, settings.network, derived_outputs(settings), settings.tuning, before
        )
    provenance = {
        **parameter_set.provenance,
        "choices": [choice.record() for choice in choices],
        "warnings": [warning.record() for warning in warnings],
        "identify": _asked(settings),
        "origin": dict(data.origin),
    }
    parameter_set, remark = banded(parameter_set.replaced(provenance=provenance), data, settings.residuals)
    path, page = settings.files
    result = Identified(
        *(path, page, parameter_set, local, choices, warnings),
        {} if physical is None else _diagnostics(physical),
        physical,
        remark,
    )
    _write(result)
    return result


def _asked(settings: IdentifySettings) -> dict[str, Any]:
    """Return the settings but paths, and but what stands in the parameter set anyway."""
    elsewhere = {"data", "output", "page", "n4sid", "descriptions", "derived_outputs"}
    unused = {"network", "tuning"} if settings.method == "surrogate" else {"surrogate"}
    return settings.model_dump(mode="json", exclude=elsewhere | unused)


def _static_map(settings: IdentifySettings, data: DataFolder) -> tuple[StaticMap | None, tuple[Choice, ...]]:
    """Return the data folder's static map if it is to be used, and the choice if it was one.

    Raises:
        DataError: The folder's is asked for and there is none.
    """
    table = data.static_map
    if settings.static_map == "folder" and table is None:
        mend = "Use static_map = 'local_models', or generate the data with a static map"
        raise DataError.of(f"{settings.data}, static map", "there is none in the data folder", mend)
    if settings.static_map != "automatic":
        return (table if settings.static_map == "folder" else None), ()
    if table is None:
        why = "the data folder holds none; a smooth curve through the means at the operating points"
        return None, (Choice("static_map", "local_models", why),)
    why = f"the data folder holds one, of {table.positions.size} positions"
    return table, (Choice("static_map", "folder", why),)


def _write(result: Identified) -> None:
    """Write parameter set and page, both or neither."""
    with written_atomically(result.path) as parameter_file:
        parameter_file.write_text(result.parameter_set.canonical_json(), encoding="utf-8", newline="\n")
        if result.page is not None:
            from cosimulation.report import write_identification

            write_identification(result.page, result)


def _surrogate(
    settings: IdentifySettings, data: DataFolder, local: LocalModels
) -> tuple[ParameterSet, surrogates.SurrogateResult, tuple[IdentificationWarning, ...]]:
    if settings.head is None:
        mend = "Add a table [head] with m_C, k_C, c_C, k_E"
        raise SettingsError.of("head", "a surrogate needs the collector head, which is not identified", mend)
    head = surrogates.Head(**settings.head.model_dump())
    training = [item.data for item in data.select("whole_range", "train")]
    validation = [item.data for item in data.having("whole_range", "validation")]
    heights = [item.data for item in data.select("operating_point", "train")]
    local = local.trained_on(training)
    local.refuse_outside()
    result = surrogates.identify(local, training, head, settings.surrogate, validation, heights)
    parameter_set = surrogates.network(settings.name, result, derived_outputs(settings))
    return parameter_set, result, surrogate_warnings(result, training)


def _diagnostics(result: surrogates.SurrogateResult) -> dict[str, Any]:
    """Return what is told of a surrogate: theta with standard errors, how it was found, what is doubtful."""
    which, parameters = result.recommended, result.structure.parameters
    errors = result.standard_errors(which)
    thetas = {
        f"theta at {result.local.place(index)}": ", ".join(
            f"{parameter.name} = {_with_error(value, error, parameter.unit)}"
            for parameter, value, error in zip(parameters, row, errors[index], strict=True)
        )
        for index, row in enumerate(result.theta(which).tolist())
    }
    return {
        "theta": f"{which} ({result.reason})",
        "start of the frequency-response fits": [fit.account for fit in result.responses],
        "start of output error": result.tuned_from or "not asked for",
        **thetas,
        "at a bound": [dict(row) for row in result.at_bound(which)],
        "not told by the data": list(result.remarks(which)),
        "hardly told apart after output error": list(result.correlated()),
        "FIT on training data [%]": dict(result.fit),
    }


def _with_error(value: float, error: float, unit: str) -> str:
    return f"{value:.6g}" + (f" +- {error:.2g}" if np.isfinite(error) else "") + (f" {unit}" if unit else "")

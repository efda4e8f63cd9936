"""Networks with every open choice made on whole-range training data, and the account of all choices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from cosimulation.data_folder import DataFolder
from cosimulation.settings import toml_value
from fmu_builder.parameter_set import DerivedOutput, ParameterSet
from identification.choice import Choice
from identification.data_set import DataSet
from identification.n4sid import LocalModels
from identification.network import NetworkSettings
from identification.surrogate import SurrogateResult
from identification.tuning import TuningSettings, tuned_network
from identification.warning import IdentificationWarning, poor_fits, stray_data


class AutomaticNetwork(NamedTuple):
    """A network and how it came about.

    Attributes:
        parameter_set: The network; its provenance holds the choices and the data they were made on.
        choices: Of the network, after those of its local models, by keys of the file of `llmn identify`.
        warnings: What makes its local models, then the network, doubtful.
    """

    parameter_set: ParameterSet
    choices: tuple[Choice, ...]
    warnings: tuple[IdentificationWarning, ...]


def automatic_network(
    name: str,
    local: LocalModels,
    data: DataFolder,
    settings: NetworkSettings,
    derived_outputs: Sequence[DerivedOutput] = (),
    tuning: TuningSettings | None = None,
    before: Sequence[Choice] = (),
) -> AutomaticNetwork:
    """Return the network of local models, tuned on the folder's whole-range training data if there are any.

    Args:
        name: C identifier; the FMU's default model identifier.
        local: The local models.
        data: The folder.
        settings: What is left open and what is given.
        derived_outputs: Outputs computed from inputs and outputs.
        tuning: Signals that count and limits of the search.
        before: What else was chosen on the way, to be told with the rest.

    Raises:
        DataError: Columns are missing.
        IdentificationError: A signal that does not exist.
        ParameterSetError: Not a valid parameter set; every problem is named.
    """
    training = [item.data for item in data.having("whole_range", "train")]
    tuned = tuned_network(name, local, training, settings, derived_outputs, tuning)
    choices = (
        *before,
        *local_choices(local),
        *(replace(choice, name=f"network.{choice.name}") for choice in tuned.choices),
    )
    warnings = (*local.warnings, *tuned.warnings)
    provenance: dict[str, Any] = {
        **tuned.parameter_set.provenance,
        "choices": [choice.record() for choice in choices],
        "warnings": [warning.record() for warning in warnings],
    }
    if settings.open_choices:
        provenance["tuning"] = [{"name": one.name, "content_hash": one.content_hash} for one in training]
    return AutomaticNetwork(tuned.parameter_set.replaced(provenance=provenance), choices, warnings)


def local_choices(local: LocalModels) -> tuple[Choice, ...]:
    """Return what was chosen for the local models, by keys of the settings file of `llmn identify`."""
    return tuple(replace(choice, name=f"n4sid.{choice.name}") for choice in local.choices)


def choice_lines(choices: Sequence[Choice]) -> list[str]:
    """Return choices for a person: the key that overrides each, as a settings file writes it, and why."""
    if not choices:
        return ["nothing was chosen automatically"]
    lines = ["chosen automatically; the key in the settings file overrides it:"]
    return lines + [
        f"  {choice.name} = {toml_value(choice.value)}{f' ({choice.place})' if choice.place else ''}: "
        f"{choice.reason}"
        for choice in choices
    ]


def warning_lines(warnings: Sequence[IdentificationWarning]) -> list[str]:
    """Return warnings for a person, nothing where there are none."""
    return [f"warning: {warning}" for warning in warnings]


def surrogate_warnings(
    result: SurrogateResult, training: Sequence[DataSet]
) -> tuple[IdentificationWarning, ...]:
    """Return what whole-range training data say against a surrogate."""
    known = result.frame.local.settings
    mend = "Use another structure, or look whether the head is the right one"
    return (
        *stray_data(training, known.scheduling, (known.low, known.high)),
        *poor_fits("surrogate on whole-range data, ", result.fit, mend),
    )

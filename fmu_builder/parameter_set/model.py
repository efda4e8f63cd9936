"""The parameter set, format 3: reading, writing, identity."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import AfterValidator, ConfigDict, Field, JsonValue

from fmu_builder.errors import ParameterSetError, Problem
from fmu_builder.files import write_text
from fmu_builder.parameter_set.canonical import canonical_json, compact_json
from fmu_builder.parameter_set.checks import FORMAT, problems_of
from fmu_builder.parameter_set.components import (
    DerivedOutput,
    InputSignal,
    LocalLinearModel,
    NodeTable,
    Number,
    Offsets,
    OutputSignal,
    Part,
    Partition,
    ResidualBands,
    StabilityCertificate,
    SurrogateParameters,
    Text,
    TrainedRegion,
    by_name,
)


class ParameterSet(Part):
    """A local linear model network as numbers, names and units; valid by construction.

    With m inputs, p outputs, M local models of n states each, R derived outputs. `ParameterSet(...)` and
    `load` raise one `ParameterSetError` that names every problem. `model_copy` checks nothing: use
    `replaced`.

    Attributes:
        format: Version of the format; content of an earlier one is taken over into this one.
        name: C identifier, the default FMU model identifier.
        kind: Where the local models come from.
        sample_time: s, the tick.
        inputs: [m].
        outputs: [p].
        partition: Scheduling and validity.
        blending: "output" (thesis eq. 3.98), "parameter" (eq. 3.100-3.101) or "theta" (physical parameters
            blended, then discretised per node of the node table).
        local_models: [M].
        node_table: None for Gaussians.
        offsets: Offset handling.
        derived_outputs: [R].
        surrogate: Physical parameters of a surrogate, else None.
        declared_unstable: True lets unstable local models pass.
        certificate: Of stability; a claim until it is proved (`identification.stability`).
        trained_region: Where training data lie; None: nobody has told.
        residual_bands: Errors on held-out data; at most one per output.
        provenance: Hashes of data, settings and reference, seeds, versions; no clock, no path, no user name.
        scores: Score records as in scores.json.
        documentation: Free text for the model card.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    format: Literal[3] = 3
    name: Text
    kind: Literal["n4sid", "surrogate", "linear", "lolimot"]
    sample_time: Number
    inputs: tuple[InputSignal, ...]
    outputs: tuple[OutputSignal, ...]
    partition: Partition
    blending: Literal["output", "parameter", "theta"]
    local_models: tuple[LocalLinearModel, ...]
    node_table: NodeTable | None = None
    offsets: Offsets
    derived_outputs: tuple[DerivedOutput, ...] = ()
    surrogate: SurrogateParameters | None = None
    declared_unstable: bool = False
    certificate: StabilityCertificate | None = None
    trained_region: TrainedRegion | None = None
    residual_bands: tuple[ResidualBands, ...] = ()
    provenance: Annotated[dict[str, JsonValue], AfterValidator(by_name)] = Field(default_factory=dict)
    scores: tuple[dict[str, JsonValue], ...] = ()
    documentation: Text = ""

    if not TYPE_CHECKING:  # the type checker sees the fields

        def __init__(self, /, **content: Any) -> None:
            problems = problems_of(content, type(self).model_fields)
            if problems:
                raise ParameterSetError(problems)
            super().__init__(**{**content, "format": FORMAT})
            if foreign := _foreign_bands(self):
                raise ParameterSetError(foreign)

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the inputs, in order."""
        return tuple(signal.name for signal in self.inputs)

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names of the outputs and then of the derived outputs: the columns of a simulation."""
        return (*(signal.name for signal in self.outputs), *(signal.name for signal in self.derived_outputs))

    @property
    def scheduling_index(self) -> int:
        """Position of the scheduling input among the inputs."""
        return self.input_names.index(self.partition.scheduling)

    @property
    def state_count(self) -> int:
        """States n of one local model."""
        return len(self.local_models[0].A)

    def replaced(self, **changes: Any) -> ParameterSet:
        """Return a copy with some fields replaced, checked like a new one.

        Residual bands are those of one model: where the changes make another one, they are left out unless
        they are among the changes.

        Raises:
            ParameterSetError: The result is not valid; every problem is named.
        """
        content = {name: getattr(self, name) for name in type(self).model_fields} | changes
        if not self.residual_bands or "residual_bands" in changes:
            return ParameterSet(**content)
        changed = ParameterSet(**{**content, "residual_bands": ()})
        return changed if _foreign_bands(changed, self.residual_bands) else ParameterSet(**content)

    def canonical_json(self) -> str:
        """Return the text of the file: canonical JSON, exact to the last bit."""
        return canonical_json(self.model_dump(mode="python"))

    def compact_json(self) -> str:
        """Return the same content in one line, for where every kilobyte counts."""
        return compact_json(self.model_dump(mode="python"))

    def model_hash(self) -> str:
        """Return the SHA-256 (hex) over what the FMU computes with; see `model_hash`."""
        return model_hash(self)

    def save(self, path: Path) -> Path:
        """Write the file at once or not at all; see `save`."""
        return save(self, path)


def _foreign_bands(
    parameter_set: ParameterSet, bands: Sequence[ResidualBands] | None = None
) -> list[Problem]:
    """Return why residual bands, by default its own, are not those of a model."""
    found = parameter_set.residual_bands if bands is None else bands
    own = model_hash(parameter_set) if found else ""
    mend = "Identify the model anew with held-out data, or leave the bands out"
    return [
        Problem(f"residual_bands[{index}].model_hash", "is that of another model", mend)
        for index, one in enumerate(found)
        if one.model_hash != own
    ]


_SIGNAL_IDENTITY = {"name", "unit", "operating_point"}
_IDENTITY_FORMAT = 1
"""The format in which the model hash sees a model: later ones added nothing that an FMU computes with."""
_IDENTITY: dict[str, Any] = {
    "name": True,
    "sample_time": True,
    "inputs": {"__all__": _SIGNAL_IDENTITY | {"minimum", "maximum"}},  # in_range is computed from the limits
    "outputs": {"__all__": _SIGNAL_IDENTITY},
    "partition": True,
    "blending": True,
    "local_models": True,
    "node_table": True,
    "offsets": True,
    "derived_outputs": {
        "__all__": {"name": True, "unit": True, "terms": True, "parameters": {"__all__": {"value", "unit"}}}
    },
}


def model_hash(parameter_set: ParameterSet) -> str:
    """Return the SHA-256 (hex) of what the FMU computes with: numbers, names, units, node table.

    Descriptions, limits of the outputs, kind, surrogate parameters, certificate, trained region, residual
    bands, provenance, scores and documentation stand outside it.
    """
    content = parameter_set.model_dump(mode="python", include=_IDENTITY) | {"format": _IDENTITY_FORMAT}
    return hashlib.sha256(canonical_json(content).encode("utf-8")).hexdigest()


def save(parameter_set: ParameterSet, path: Path) -> Path:
    """Write `parameter_set` to `path` as canonical JSON, at once or not at all.

    Raises:
        OutputError: The file cannot be written.
    """
    return write_text(path, parameter_set.canonical_json())


def _with_keys_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return a JSON object; readers disagree which of two values with the same key counts."""
    found: dict[str, Any] = {}
    for key, value in pairs:
        if key in found:
            raise ValueError(f"the key {key!a} is there twice in one object")
        found[key] = value
    return found


def load(path: Path) -> ParameterSet:
    """Read a parameter set.

    Raises:
        ParameterSetError: The file cannot be read, is not JSON, or is not a valid parameter set; every
            problem is named.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, ValueError) as reason:
        raise _unreadable(str(path), reason) from reason
    return loads(text, str(path))


def loads(text: str, place: str) -> ParameterSet:
    """Read a parameter set from the text of a file.

    Args:
        text: JSON.
        place: Where it comes from, for messages.

    Raises:
        ParameterSetError: It is not JSON, or not a valid parameter set; every problem is named.
    """
    try:
        content = json.loads(text, object_pairs_hook=_with_keys_once)
    except (ValueError, RecursionError) as reason:  # syntax, digits; nesting
        raise _unreadable(place, reason) from reason
    if not isinstance(content, dict):
        raise ParameterSetError.of(
            place, "is not a JSON object", "Give a parameter set of format " + str(FORMAT)
        )
    return ParameterSet(**content)


def _unreadable(place: str, reason: Exception) -> ParameterSetError:
    mend = "Give the path of a parameter set written by this program"
    return ParameterSetError.of(place, f"cannot be read as JSON ({reason})", mend)

"""`llmn region`: where a network was trained, worked out from its training data and stored."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cosimulation.data_folder import load_data_folder
from fmu_builder.errors import DataError, ParameterSetError, Problem
from fmu_builder.parameter_set import ParameterSet, TrainedRegion, load
from identification.data_set import DataSet
from identification.region import trained_region

_PLACES = (("training",), ("tuning",), ("surrogate", "training"))
"""Where the provenance keeps name and content hash of training data."""


@dataclass(frozen=True)
class RegionResult:
    """Where one network was trained.

    Attributes:
        file: The parameter set.
        parameter_set: The network with its region.
        region: That region.
        data: Names of the training data.
        stored: Whether it stands in the file now.
    """

    file: Path
    parameter_set: ParameterSet
    region: TrainedRegion
    data: tuple[str, ...]
    stored: bool

    def summary(self) -> dict[str, object]:
        """Return the result for a machine."""
        return {
            "file": str(self.file),
            "name": self.parameter_set.name,
            "model_hash": self.parameter_set.model_hash(),
            "data": list(self.data),
            "trained_region": self.region.model_dump(mode="json"),
            "stored": self.stored,
        }

    def text(self) -> str:
        """Return the result for a person."""
        network, region = self.parameter_set, self.region
        units = {one.name: one.unit for one in network.inputs}
        units |= {one.name: one.unit for one in network.derived_outputs}
        scheduling = network.partition.scheduling
        lines = [
            f"{network.name}, trained on {', '.join(self.data)}:",
            f"  {scheduling} moves by at most {region.rate:.6g} {units[scheduling]}/s",
        ]
        spans, bands = region.derived_outputs.items(), region.frequency_bands.items()
        lines += [f"  {name} from {low:.6g} to {high:.6g} {units[name]}" for name, (low, high) in spans]
        lines += [f"  {name} moves from {low:.3g} to {high:.3g} Hz" for name, (low, high) in bands]
        if not self.stored:
            lines.append("The region is not stored; --store writes it into the parameter set.")
        return "\n".join(lines)


def region_of_file(path: Path, folder: Path, *, store: bool = False) -> RegionResult:
    """Work out the trained region of a parameter set; nothing else in it changes.

    Args:
        path: The parameter set (.json). Its provenance says by hash which data it was trained on.
        folder: Data folder that holds these data.
        store: Write the region into the parameter set.

    Raises:
        ParameterSetError: The parameter set is not valid, or names no training data.
        DataError: The folder cannot be read, or lacks some of the data; all of them are named.
        OutputError: The file cannot be written.
    """
    parameter_set = load(path)
    training = _training(path, parameter_set, folder)
    region = trained_region(
        training,
        parameter_set.input_names,
        parameter_set.partition.scheduling,
        parameter_set.sample_time,
        parameter_set.derived_outputs,
    )
    if region is None:
        raise ValueError("there are training data")
    found = parameter_set.replaced(trained_region=region)
    if store:
        found.save(path)
    return RegionResult(path, found, region, tuple(data.name for data in training), store)


def _training(path: Path, parameter_set: ParameterSet, folder: Path) -> list[DataSet]:
    """Return the data that the provenance names, in its order."""
    wanted = dict(_named(parameter_set.provenance))
    if not wanted:
        mend = "Identify it with this version, which stores the region"
        raise ParameterSetError.of(f"{path}, provenance", "names no training data", mend)
    known = {one.data.content_hash: one.data for one in load_data_folder(folder).experiments}
    missing = [name for content_hash, name in wanted.items() if content_hash not in known]
    if missing:
        mend = "Give the folder that the network was identified from"
        raise DataError(Problem(f"{folder}, {name}", "is not there as it was", mend) for name in missing)
    return [known[content_hash] for content_hash in wanted]


def _named(provenance: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield (content hash, name) of the training data."""
    for place in _PLACES:
        found: Any = provenance
        for key in place:
            found = found.get(key) if isinstance(found, dict) else None
        for one in found if isinstance(found, list) else []:
            if isinstance(one, dict) and "content_hash" in one:
                yield str(one["content_hash"]), str(one.get("name", ""))

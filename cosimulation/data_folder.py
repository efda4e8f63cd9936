"""A folder of reference data: one file per experiment, and data.json that says what they are."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fmu_builder.errors import DataError, Problem
from fmu_builder.files import write_text
from identification.data_set import DataSet
from identification.static_map import StaticMap

INDEX = "data.json"
FORMAT = "llmn data folder 1"


@dataclass(frozen=True)
class Experiment:
    """One experiment of a data folder.

    Attributes:
        name: Unique in the folder.
        kind: "operating_point" or "whole_range".
        split: "train", "validation" or "test".
        height: Operating point of eta [m]; None for whole_range.
        data: The recorded signals, in our names.
    """

    name: str
    kind: str
    split: str
    height: float | None
    data: DataSet


@dataclass(frozen=True)
class DataFolder:
    """Reference data with everything identification needs to know about them.

    Attributes:
        inputs: Names of the inputs.
        outputs: Names of the outputs.
        experiments: In the order of the settings.
        static_map: Steady-state outputs over the height, or None.
        origin: Settings, seed, and hash of the reference.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    experiments: tuple[Experiment, ...]
    static_map: StaticMap | None
    origin: Mapping[str, Any]

    def select(self, kind: str, split: str) -> tuple[Experiment, ...]:
        """Return the experiments of one kind and split, operating points by ascending height.

        Raises:
            DataError: There is none.
        """
        found = self.having(kind, split)
        if not found:
            what = f"there is no experiment of kind {kind!r} in the split {split!r}"
            raise DataError.of("data folder", what, "Add one to [[experiments]] and generate the data again")
        return found

    def having(self, kind: str, split: str) -> tuple[Experiment, ...]:
        """Return the experiments of one kind and split like `select`, nothing where there is none."""
        found = [item for item in self.experiments if item.kind == kind and item.split == split]
        return tuple(sorted(found, key=lambda item: item.height or 0.0))

    def save(self, folder: Path) -> None:
        """Write all files into `folder`, which exists."""
        entries = []
        for item in self.experiments:
            file = f"{item.name}.npz"
            item.data.save(folder / file)
            entry = {"name": item.name, "kind": item.kind, "split": item.split, "height": item.height}
            entries.append({**entry, "file": file, "content_hash": item.data.content_hash})
        index: dict[str, Any] = {
            "format": FORMAT,
            "inputs": list(self.inputs),
            "outputs": list(self.outputs),
            "experiments": entries,
            "static_map": None,
            "origin": dict(self.origin),
        }
        if self.static_map is not None:
            index["static_map"] = {
                "outputs": list(self.static_map.names),
                "positions": self.static_map.positions.tolist(),
                "values": self.static_map.values.tolist(),
            }
        write_text(folder / INDEX, json.dumps(index, indent=1, sort_keys=True) + "\n")


def load_data_folder(folder: Path) -> DataFolder:
    """Read a data folder written by `llmn generate`.

    Raises:
        DataError: The index or a file is missing, damaged, or not what the index says.
    """
    place = folder / INDEX
    try:
        index = json.loads(place.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as reason:
        mend = "Give a folder written by llmn generate"
        raise DataError.of(str(place), f"cannot be read ({reason})", mend) from reason
    try:
        return _from_index(folder, index)
    except DataError:
        raise
    except (KeyError, TypeError, IndexError, ValueError, AttributeError) as reason:
        mend = "Generate the data again"
        raise DataError.of(str(place), f"is incomplete ({reason!r})", mend) from reason


def _from_index(folder: Path, index: Mapping[str, Any]) -> DataFolder:
    if index["format"] != FORMAT:
        raise DataError.of(
            str(folder / INDEX), f"has the format {index['format']!r}", f"This reads {FORMAT!r}"
        )
    problems: list[Problem] = []
    experiments = []
    for entry in index["experiments"]:
        try:
            data = DataSet.load(folder / entry["file"])
        except DataError as error:
            problems += error.problems
            continue
        if data.content_hash != entry["content_hash"]:
            what = "is not the data that data.json names (another content hash)"
            problems.append(Problem(str(folder / entry["file"]), what, "Generate the data again"))
        height = entry["height"] if entry["height"] is None else float(entry["height"])
        experiments.append(Experiment(entry["name"], entry["kind"], entry["split"], height, data))
    if problems:
        raise DataError(problems)
    table = index["static_map"]
    static_map = table and StaticMap(
        np.asarray(table["positions"], dtype=np.float64),
        np.asarray(table["values"], dtype=np.float64),
        tuple(table["outputs"]),
    )
    return DataFolder(
        tuple(index["inputs"]),
        tuple(index["outputs"]),
        tuple(experiments),
        static_map or None,
        dict(index["origin"]),
    )

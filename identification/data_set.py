"""A data set: uniformly sampled named signals with units, checked when it is made, saved as .npz or CSV.

Row k holds the inputs set at t_k and the outputs read at t_k after that set and before the next step.
"""

from __future__ import annotations

import difflib
import hashlib
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from fmu_builder.errors import DataError, Problem
from identification import data_file
from identification.arrays import Array, read_only

_SAME_TIME = 1e-6
"""Relative difference of sample times that comes from writing them down."""


def _shape_problems(place: str, data: DataSet) -> list[Problem]:
    found = []
    count = data.values.shape[1]
    if data.values.shape[0] == 0 or count == 0:
        found.append(Problem(place, "is empty", "Give at least one row and one column"))
    if len(data.names) != count:
        what = f"has {len(data.names)} names for {count} columns"
        found.append(Problem(place, what, "Give one name per column"))
    if len(data.units) != len(data.names):
        what = f"has {len(data.units)} units for {len(data.names)} names"
        found.append(Problem(place, what, 'Give one unit per name ("" where none is known)'))
    if not (math.isfinite(data.sample_time) and data.sample_time > 0):
        what = f"has the sample time {data.sample_time!r}"
        found.append(Problem(place, what, "Give a sample time above 0 s"))
    return found


def _name_problems(place: str, names: Sequence[str]) -> list[Problem]:
    found = []
    for name in sorted({name for name in names if names.count(name) > 1}):
        what = f"has the column {name!r} {names.count(name)} times"
        found.append(Problem(place, what, "Give every column a name of its own"))
    for name in names:
        if not data_file.usable_name(name):
            what = f"has a column named {name!r}"
            found.append(Problem(place, what, "Use names without brackets, commas, quotes and line ends"))
    return found


def _value_problems(place: str, data: DataSet) -> list[Problem]:
    found = []
    for index, name in enumerate(data.names[: data.values.shape[1]]):
        rows = np.flatnonzero(~np.isfinite(data.values[:, index]))
        if rows.size:
            what = f"column {name!r} is not finite in {data_file.listed(rows)}"
            found.append(Problem(place, what, "Fill or cut these rows; a model needs every sample"))
    return found


@dataclass(frozen=True, eq=False)
class DataSet:
    """Uniformly sampled signals.

    Attributes:
        name: What it is called in messages, scores and provenance.
        sample_time: Time between two rows [s].
        names: One name per column, all different.
        units: One unit per column ("" where none is known).
        values: The signals, shape (rows, columns), read-only.
        header: Where it comes from (settings, seed, hashes): anything JSON can hold.

    Raises:
        DataError: Empty, not finite, names or units that do not fit, ...; all problems at once.
    """

    name: str
    sample_time: float
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    header: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        place = f"data set {self.name!r}"
        try:
            object.__setattr__(self, "values", read_only(self.values, 2))
            object.__setattr__(self, "sample_time", float(self.sample_time))
        except (TypeError, ValueError) as reason:
            mend = "Give numbers in rows and columns"
            raise DataError.of(place, f"is not a table of numbers ({reason})", mend) from reason
        object.__setattr__(self, "names", tuple(self.names))
        object.__setattr__(self, "units", tuple(self.units))
        found = _shape_problems(place, self) + _name_problems(place, self.names)
        found += _value_problems(place, self)
        try:
            copy = json.loads(json.dumps(dict(self.header), sort_keys=True, allow_nan=False))
            object.__setattr__(self, "header", copy)
        except (TypeError, ValueError) as reason:
            mend = "Put only text, finite numbers, lists and tables into it"
            found.append(Problem(place, f"has a header that JSON cannot hold ({reason})", mend))
        if found:
            raise DataError(found)

    def __len__(self) -> int:
        """Return the number of rows."""
        return int(self.values.shape[0])

    @property
    def time(self) -> Array:
        """Time of every row [s], from 0, shape (rows,)."""
        return np.arange(len(self), dtype=np.float64) * self.sample_time

    @property
    def content_hash(self) -> str:
        """SHA-256 over sample time, names, units and numbers: not over name, header or file format."""
        signals = json.dumps([self.sample_time, self.names, self.units, list(self.values.shape)])
        return hashlib.sha256(signals.encode() + self.values.astype("<f8").tobytes()).hexdigest()

    def column(self, name: str) -> Array:
        """Return one signal, shape (rows,).

        Raises:
            DataError: There is no such column.
        """
        return self.matrix((name,))[:, 0]

    def matrix(self, names: Iterable[str]) -> Array:
        """Return the named signals as columns in the order asked for, shape (rows, names).

        Raises:
            DataError: Columns are missing; all of them are named.
        """
        wanted = tuple(names)
        found = _missing(f"data set {self.name!r}", self.names, wanted)
        if found:
            raise DataError(found)
        return np.ascontiguousarray(self.values[:, [self.names.index(name) for name in wanted]])

    def select(self, names: Iterable[str]) -> DataSet:
        """Return the data set with only the named columns, in that order.

        Raises:
            DataError: Columns are missing; all of them are named.
        """
        wanted = tuple(names)
        units = dict(zip(self.names, self.units, strict=True))
        values = self.matrix(wanted)
        return replace(self, names=wanted, units=tuple(units[name] for name in wanted), values=values)

    def scale_problems(self, sample_time: float, names: Sequence[str], units: Sequence[str]) -> list[Problem]:
        """Return why the data set cannot be used together with signals of other origin.

        Args:
            sample_time: Their sample time [s].
            names: Their names; those the data set does not have are not looked at.
            units: Their units ("" where none is known).
        """
        place = f"data set {self.name!r}"
        found = []
        if not math.isclose(self.sample_time, sample_time, rel_tol=_SAME_TIME):
            what = f"has the sample time {self.sample_time:g} s, not {sample_time:g} s like the others"
            found.append(Problem(place, what, "Resample it"))
        own = dict(zip(self.names, self.units, strict=True))
        for name, unit in zip(names, units, strict=True):
            if unit and own.get(name) and own[name] != unit:
                what = f"has {name!r} in {own[name]!r}, the others in {unit!r}"
                found.append(Problem(place, what, "Convert it, or write all its units alike"))
        return found

    def rows(self, first: int, stop: int) -> DataSet:
        """Return rows first .. stop - 1 (counted from 0) as a data set whose time starts at 0 again."""
        return replace(self, values=self.values[first:stop])

    def with_columns(self, names: Sequence[str], units: Sequence[str], values: Array) -> DataSet:
        """Return the data set with more columns on the right.

        Args:
            names: Their names.
            units: Their units.
            values: Their numbers, shape (rows, names).

        Raises:
            DataError: Another number of rows, or what the constructor refuses.
        """
        if np.shape(values)[:1] != (len(self),):
            what = f"has {len(self)} rows, the new columns have the shape {np.shape(values)}"
            raise DataError.of(f"data set {self.name!r}", what, "Give one value per row")
        joined = np.column_stack([self.values, values])
        return replace(self, names=(*self.names, *names), units=(*self.units, *units), values=joined)

    def save(self, path: Path) -> Path:
        """Write it to `path`: the same bytes for the same data set, at once or not at all.

        Args:
            path: Ends in .npz (values and header.json) or .csv (`# {header}`, `time [s],eta [m],...`).

        Raises:
            DataError: Another suffix.
            OutputError: The file cannot be written.
        """
        header = {
            "format": data_file.FORMAT,
            "name": self.name,
            "sample_time": self.sample_time,
            "names": list(self.names),
            "units": list(self.units),
            "rows": len(self),
            "content_hash": self.content_hash,
            "header": dict(self.header),
        }
        return data_file.write(Path(path), header, self.time, self.values)

    @classmethod
    def load(cls, path: Path, required: Iterable[str] = ()) -> DataSet:
        """Read a data set from .npz or CSV; files of other origin need a `time [s]` column.

        Args:
            path: The file.
            required: Columns that must be there.

        Raises:
            DataError: Not readable, corrupt or truncated, missing or duplicate columns, cells that are no
                finite numbers, rows that are not uniform in time; all problems of the file at once.
        """
        table = data_file.read(Path(path))
        found = [*table.problems, *_missing(str(path), table.names, tuple(required))]
        if found:
            raise DataError(found)
        data = cls(table.name, table.sample_time, table.names, table.units, table.values, table.header)
        if table.content_hash not in (None, data.content_hash):
            mend = "Fetch it again; if the change is meant, delete its JSON header"
            raise DataError.of(str(path), "does not hold the numbers its header was made for", mend)
        return data


def _missing(place: str, present: Sequence[str], wanted: Sequence[str]) -> list[Problem]:
    found = []
    for name in dict.fromkeys(wanted):
        if name in present:
            continue
        close = difflib.get_close_matches(name, present, n=1)
        hint = f"Did you mean {close[0]!r}?" if close else f"It has {', '.join(present) or 'no columns'}"
        found.append(Problem(place, f"has no column {name!r}", hint.rstrip(".")))
    return found


def load_all(paths: Iterable[Path]) -> list[DataSet]:
    """Read data sets: see `DataSet.load`.

    Raises:
        DataError: All problems of all files.
    """
    loaded: list[DataSet] = []
    found: list[Problem] = []
    for path in paths:
        try:
            loaded.append(DataSet.load(path))
        except DataError as refused:
            found += refused.problems
    if found:
        raise DataError(found)
    return loaded


def load(path: Path, required: Iterable[str] = ()) -> DataSet:
    """Read a data set: see `DataSet.load`."""
    return DataSet.load(path, required)

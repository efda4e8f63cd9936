"""The two files a data set can be, .npz and CSV: written reproducibly, read with every problem at once."""

from __future__ import annotations

import io
import json
import re
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmu_builder.errors import DataError, Problem
from fmu_builder.files import write_bytes
from identification.arrays import Array

FORMAT = "llmn data set 1"
UNIFORM_TOLERANCE = 0.01
"""How far a step may be from the sample time, in samples (the tolerance of the tick rule)."""

_TIME = "time"
_HEADER_MEMBER = "header.json"
_VALUES_MEMBER = "values.npy"
_FIXED_DATE = (1980, 1, 1, 0, 0, 0)
_SHOWN = 5
_COLUMN = re.compile(r"^\s*(?P<name>[^\[\]]*?)\s*(?:\[(?P<unit>[^\[\]]*)\])?\s*$")


@dataclass
class Table:
    """What stands in a file, with everything that is wrong with it."""

    name: str
    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    values: Array = field(default_factory=lambda: np.empty((0, 0)))
    sample_time: float = float("nan")
    header: Mapping[str, Any] = field(default_factory=dict)
    content_hash: str | None = None
    problems: list[Problem] = field(default_factory=list)


def usable_name(name: str) -> bool:
    """Return whether a column of this name can be written to every format and read back."""
    return bool(name) and name == name.strip() and name != _TIME and not re.search(r'[\[\],"\r\n#]', name)


def listed(rows: NDArray[np.intp], lines: Sequence[int] | None = None) -> str:
    """Return row numbers for a message (counted from 0), with lines of the file where there are some."""
    shown = [f"{row} (line {lines[row]})" if lines is not None else str(row) for row in rows[:_SHOWN]]
    more = f" and {len(rows) - _SHOWN} more" if len(rows) > _SHOWN else ""
    return f"row{'s' if len(rows) > 1 else ''} {', '.join(shown)}{more}"


def write(path: Path, header: Mapping[str, Any], time: Array, values: Array) -> Path:
    """Write a data set; the suffix of `path` chooses the format.

    Raises:
        DataError: Another suffix than .npz and .csv.
        OutputError: The file cannot be written.
    """
    text = json.dumps(header, sort_keys=True, allow_nan=False)
    kind = _kind(path)
    return write_bytes(path, _npz(text, values) if kind == ".npz" else _csv(text, header, time, values))


def read(path: Path) -> Table:
    """Read a data set file; what is wrong inside stands in the table's `problems`.

    Raises:
        DataError: The file cannot be opened or is not of its format at all.
    """
    kind = _kind(path)
    try:
        content = path.read_bytes()
    except OSError as reason:
        what = f"cannot be read ({reason.strerror or reason})"
        raise DataError.of(str(path), what, "Give the path of a readable .npz or .csv file") from reason
    if not content:
        raise DataError.of(str(path), "is empty", "Write or fetch the file again")
    return _read_npz(path, content) if kind == ".npz" else _read_csv(path, content)


def _kind(path: Path) -> str:
    kind = path.suffix.lower()
    if kind not in (".npz", ".csv"):
        raise DataError.of(str(path), f"has the suffix {path.suffix!r}", "Name a data set .npz or .csv")
    return kind


def _npz(header: str, values: Array) -> bytes:
    """np.savez leaves the host system and member order open; the bytes here depend on the data alone."""
    numbers = io.BytesIO()
    np.lib.format.write_array(numbers, values.astype("<f8"), allow_pickle=False)
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_STORED) as members:
        for name, content in ((_HEADER_MEMBER, header.encode()), (_VALUES_MEMBER, numbers.getvalue())):
            entry = zipfile.ZipInfo(name, _FIXED_DATE)
            entry.create_system = 3
            entry.external_attr = 0o644 << 16
            members.writestr(entry, content)
    return archive.getvalue()


def _csv(text: str, header: Mapping[str, Any], time: Array, values: Array) -> bytes:
    pairs = [(_TIME, "s"), *zip(header["names"], header["units"], strict=True)]
    lines = [f"# {text}", ",".join(f"{name} [{unit}]" for name, unit in pairs)]
    lines += [",".join(map(repr, row)) for row in np.column_stack([time, values]).tolist()]
    return ("\n".join(lines) + "\n").encode()


def _take_header(table: Table, place: str, text: str) -> list[str]:
    """Put a header of ours into the table and return the names it promises; a foreign one is ignored."""
    try:
        header = json.loads(text)
    except ValueError:
        return []
    if not isinstance(header, dict) or not str(header.get("format", "")).startswith("llmn data set"):
        return []
    if header["format"] != FORMAT:
        what = f"has the format {header['format']!r}"
        table.problems.append(Problem(place, what, f"This version reads {FORMAT!r}; use a newer one"))
        return []
    try:
        table.name, table.content_hash = str(header["name"]), str(header["content_hash"])
        table.header, table.sample_time = dict(header["header"]), float(header["sample_time"])
        names = [str(name) for name in header["names"]]
        table.units = tuple(str(unit) for unit in header["units"])
    except (KeyError, TypeError, ValueError) as reason:
        mend = "Write or fetch the file again"
        table.problems.append(Problem(place, f"has an incomplete header ({reason!r})", mend))
        return []
    return names


def _read_npz(path: Path, content: bytes) -> Table:
    table = Table(path.stem)
    arrays: dict[str, NDArray[Any]] = {}
    names: list[str] = []
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            for member in archive.namelist():
                if member == _HEADER_MEMBER:
                    names = _take_header(table, str(path), archive.read(member).decode())
                else:
                    stream = io.BytesIO(archive.read(member))
                    arrays[member.removesuffix(".npy")] = np.lib.format.read_array(stream)
    except (zipfile.BadZipFile, zlib.error, OSError, EOFError, ValueError, NotImplementedError) as reason:
        mend = "Write or fetch the file again; it must hold plain number arrays"
        raise DataError.of(str(path), f"is not a readable .npz file ({reason})", mend) from reason
    if names and "values" in arrays:
        table.names, values = tuple(names), arrays["values"]
        if values.ndim != 2 or values.shape[1] != len(names) or values.dtype.kind not in "fiu":
            what = f"holds values of the shape {values.shape} for {len(names)} names"
            raise DataError.of(str(path), what, "Write or fetch the file again")
        table.values = values.astype(np.float64)
        table.problems += _finite_problems(str(path), table.names, table.values, None)
        return table
    return _from_arrays(path, table, arrays)


def _from_arrays(path: Path, table: Table, arrays: Mapping[str, NDArray[Any]]) -> Table:
    """Columns saved by somebody else: one array of one axis each, all of one length, `time` among them."""
    lengths = {array.shape for array in arrays.values()}
    numeric = all(array.dtype.kind in "fiub" and array.ndim == 1 for array in arrays.values())
    if not arrays or len(lengths) > 1 or not numeric:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items()) or "nothing"
        mend = "Save one array of numbers per signal, all of one length, and one named time"
        raise DataError.of(str(path), f"holds {shapes}", mend)
    values = np.column_stack([array.astype(np.float64) for array in arrays.values()])
    return _with_time(table, str(path), list(arrays), values, None)


def _read_csv(path: Path, content: bytes) -> Table:
    table = Table(path.stem)
    try:
        lines = content.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError as reason:
        raise DataError.of(str(path), f"is not a text file ({reason})", "Save it as UTF-8 CSV") from reason
    rows = [(number, line) for number, line in enumerate(lines, 1) if line.strip()]
    while rows and rows[0][1].lstrip().startswith("#"):
        _take_header(table, str(path), rows.pop(0)[1].lstrip()[1:])
    if len(rows) < 2:
        mend = "Give a line of names (time [s],eta [m],...) and at least one row of numbers"
        raise DataError.of(str(path), "is empty: no row of numbers", mend)
    titles = rows[0][1].split(",")
    values, problems = _parse(str(path), titles, rows[1:])
    table.problems += problems
    return _with_time(table, str(path), titles, values, [number for number, _ in rows[1:]])


def _parse(place: str, titles: list[str], rows: list[tuple[int, str]]) -> tuple[Array, list[Problem]]:
    """Return the numbers (NaN where there is none) and the cells that are not numbers."""
    wrong: list[str] = []
    parsed = []
    for index, (number, line) in enumerate(rows):
        cells = line.split(",")
        try:
            row = [float(cell) for cell in cells]
        except ValueError:
            row = [_number(cell) for cell in cells]
            bad = [j for j, cell in enumerate(cells) if _number(cell) != _number(cell) and not _is_nan(cell)]
            names = [titles[j].strip() if j < len(titles) else f"column {j + 1}" for j in bad]
            wrong += [
                f"row {index} (line {number}), {name}: {cells[j]!r}"
                for j, name in zip(bad, names, strict=True)
            ]
        if len(row) != len(titles):
            wrong.append(f"row {index} (line {number}): {len(row)} cells for {len(titles)} columns")
            row = (row + [0.0] * len(titles))[: len(titles)]
        parsed.append(row)
    problems = []
    if wrong:
        more = f" and {len(wrong) - _SHOWN} more" if len(wrong) > _SHOWN else ""
        what = f"has cells that are missing or not a number: {'; '.join(wrong[:_SHOWN])}{more}"
        mend = "Write one number per column, with a decimal point, separated by commas"
        problems.append(Problem(place, what, mend))
    return np.array(parsed, dtype=np.float64), problems


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return float("nan")


def _is_nan(cell: str) -> bool:
    return cell.strip().lower().lstrip("+-") == "nan"


def _with_time(
    table: Table, place: str, titles: list[str], values: Array, lines: Sequence[int] | None
) -> Table:
    """Split the time column off, check it, and put names, units and numbers into the table."""
    parts = [_COLUMN.match(title) for title in titles]
    for title, part in zip(titles, parts, strict=True):
        if part is None or not part["name"]:
            mend = "Write columns as name [unit]"
            table.problems.append(Problem(place, f"has a column titled {title!r}", mend))
    names = [part["name"] if part else title for title, part in zip(titles, parts, strict=True)]
    units = [(part["unit"] or "").strip() if part else "" for part in parts]
    for name in sorted({name for name in names if names.count(name) > 1}):
        what = f"has the column {name!r} {names.count(name)} times"
        table.problems.append(Problem(place, what, "Give every column a name of its own"))
    others = [index for index, name in enumerate(names) if name != _TIME]
    table.problems += _finite_problems(place, names, values, lines)
    if _TIME in names:
        _check_time(table, place, values[:, names.index(_TIME)], lines)
    else:
        table.problems.append(Problem(place, "has no column 'time'", "Add a column time [s]"))
    table.names = tuple(names[index] for index in others)
    table.units = tuple(units[index] for index in others)
    table.values = values[:, others]
    return table


def _finite_problems(
    place: str, names: Sequence[str], values: Array, lines: Sequence[int] | None
) -> list[Problem]:
    found = []
    for index, name in enumerate(names):
        rows = np.flatnonzero(~np.isfinite(values[:, index]))
        if rows.size:
            what = f"column {name!r} is NaN or infinite in {listed(rows, lines)}"
            found.append(Problem(place, what, "Fill or cut these rows; a model needs every sample"))
    return found


def _check_time(table: Table, place: str, time: Array, lines: Sequence[int] | None) -> None:
    steps = np.diff(time)
    usable = steps[np.isfinite(steps)]
    if usable.size == 0:
        if not np.isfinite(table.sample_time):
            mend = "Give at least two rows"
            table.problems.append(Problem(place, "has too few rows to tell the sample time", mend))
        return
    expected = table.sample_time if np.isfinite(table.sample_time) else float(np.median(usable))
    wrong = np.flatnonzero(np.isfinite(steps) & ~(np.abs(steps - expected) <= UNIFORM_TOLERANCE * expected))
    if expected <= 0 or wrong.size:
        first = f", the first is {steps[wrong[0]]:.9g} s" if wrong.size else ""
        what = f"is not uniformly sampled: {listed(wrong + 1, lines)} do not follow {expected:.9g} s"
        table.problems.append(Problem(place, what + first, "Resample it to one step, or cut it there"))
    elif not np.isfinite(table.sample_time):
        # printed times carry rounding of about 1e-11 samples per step: nine digits are the clock's
        table.sample_time = float(f"{(time[-1] - time[0]) / (len(time) - 1):.9g}")

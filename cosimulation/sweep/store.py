"""Results on disk: part files that appear whole or not at all, one sorted table at the end."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from cosimulation.sweep.plan import FORMAT, Bench, Run
from cosimulation.sweep.worker import Row
from fmu_builder.errors import DataError, OutputError
from fmu_builder.files import write_text, written_atomically

RESULTS = "results.parquet"
_PARTS, _LABEL, _LOCK = "parts", "sweep.json", "lock"
_NUMBERS = pa.map_(pa.string(), pa.float64())
_SCHEMA = pa.schema(
    [
        pa.field("task", pa.string(), nullable=False),
        ("model", pa.string()),
        ("signal", pa.string()),
        ("parameters", pa.string()),
        ("seed", pa.int64()),
        ("status", pa.string()),
        ("message", pa.string()),
        ("in_range", pa.float64()),
        ("fit", _NUMBERS),
        ("max_error", _NUMBERS),
    ]
)


class Store:
    """The folder of a sweep; made by `opened_store`, which keeps it from a second sweep.

    Attributes:
        folder: The folder.
        rows: Every row recorded, by the hash of its task.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._parts = folder / _PARTS
        self._parts.mkdir(exist_ok=True)
        for leftover in self._parts.glob(".part-*"):  # of a write that was killed
            leftover.unlink()
        self.rows: dict[str, Row] = {}
        parts = sorted(self._parts.glob("part-*.parquet"))
        for path in parts:
            self.rows |= {row["key"]: row for row in _read(path)}
        self._next = 1 + max((int(path.stem.removeprefix("part-")) for path in parts), default=0)

    def append(self, rows: Sequence[Row], runs: Mapping[str, Run], bench: Bench) -> None:
        """Write one part file with these rows.

        Raises:
            OutputError: It cannot be written.
        """
        table = pa.Table.from_pylist([_record(row, runs[row["key"]], bench) for row in rows], _SCHEMA)
        self._write(table)
        self.rows |= {row["key"]: row for row in rows}

    def _write(self, table: pa.Table) -> None:
        _write(self._parts / f"part-{self._next:08d}.parquet", table)
        self._next += 1

    def merge_parts(self) -> None:
        """Put all parts into one; a kill in between leaves rows twice, and the same ones."""
        paths = sorted(self._parts.glob("part-*.parquet"))
        if len(paths) < 2:
            return
        latest: dict[str, Any] = {}
        for path in paths:
            latest |= {row["task"]: row for row in pq.read_table(path, schema=_SCHEMA).to_pylist()}
        self._write(pa.Table.from_pylist([latest[key] for key in sorted(latest)], _SCHEMA))
        for path in paths:
            path.unlink()

    def finish(self, runs: Sequence[Run], bench: Bench) -> Path:
        """Write the table of all runs in the order given, with a column per output and parameter."""
        path = self.folder / RESULTS
        _write(path, _wide([_record(self.rows[run.key], run, bench) for run in runs], runs))
        self.merge_parts()
        return path


def _record(row: Row, run: Run, bench: Bench) -> dict[str, Any]:
    told = {
        "task": run.key,
        "model": bench.models[run.model].settings.label,
        "signal": bench.signals[run.signal].settings.name,
        "parameters": json.dumps(dict(run.parameters), sort_keys=True),
        "seed": run.seed,
    }
    numbers = {name: list(row[name].items()) for name in ("fit", "max_error")}
    return {
        **told,
        "status": row["status"],
        "message": row["message"],
        "in_range": row["in_range"],
        **numbers,
    }


def _wide(records: Sequence[dict[str, Any]], runs: Sequence[Run]) -> pa.Table:
    """Return the table that people read: maps become columns, and so do parameters."""
    columns: dict[str, Any] = {
        name: pa.array([item[name] for item in records], _SCHEMA.field(name).type)
        for name in ("task", "model", "signal", "seed", "status", "message", "in_range")
    }
    for name in dict.fromkeys(name for run in runs for name in run.parameters):
        columns[f"parameter.{name}"] = _parameter([run.parameters.get(name) for run in runs])
    for kind in ("fit", "max_error"):
        found = [dict(item[kind]) for item in records]
        for name in dict.fromkeys(name for run in runs for name in run.outputs):
            columns[f"{kind}.{name}"] = pa.array([one.get(name) for one in found], pa.float64())
    return pa.table(columns)


def _parameter(values: Sequence[Any]) -> Any:
    """Return a column of numbers, truth values or text, whichever holds all values."""
    present = [value for value in values if value is not None]
    if all(isinstance(value, bool) for value in present):
        return pa.array(values, pa.bool_())
    if not any(isinstance(value, bool | str) for value in present):
        return pa.array([None if value is None else float(value) for value in values], pa.float64())
    return pa.array([None if value is None else str(value) for value in values], pa.string())


def _write(path: Path, table: pa.Table) -> None:
    with written_atomically(path) as temporary:
        pq.write_table(table, temporary, compression="zstd")


def _read(path: Path) -> list[Row]:
    try:
        found = pq.read_table(path, schema=_SCHEMA).to_pylist()
    except (OSError, pa.ArrowException) as reason:
        what = f"cannot be read ({' '.join(str(reason).split())})"
        raise DataError.of(str(path), what, "Delete it; its runs are then done again") from reason
    return [
        {
            "key": item["task"],
            **{name: item[name] for name in ("status", "message", "in_range")},
            **{name: dict(item[name]) for name in ("fit", "max_error")},
        }
        for item in found
    ]


@contextmanager
def opened_store(folder: Path) -> Iterator[Store]:
    """Yield the store in a folder, a new one or that of an earlier sweep, as long as the block lasts.

    Raises:
        OutputError: The folder holds something else, cannot be written, or another sweep writes to it.
        DataError: A part file is damaged.
    """
    label = folder / _LABEL
    with ExitStack() as stack:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            if any(item.name != _LOCK for item in folder.iterdir()) and not _is_ours(label):
                what = f"holds files that no sweep wrote (no {_LABEL} of one)"
                raise OutputError.of(str(folder), what, "Choose a folder that does not exist yet")
            stack.enter_context(_locked(folder / _LOCK))
            write_text(label, json.dumps({"format": FORMAT}) + "\n")
            store = Store(folder)
        except (FileExistsError, NotADirectoryError, PermissionError) as reason:
            what = f"cannot be used ({reason.strerror or reason})"
            raise OutputError.of(str(folder), what, "Choose another folder") from reason
        yield store


def _is_ours(label: Path) -> bool:
    with suppress(OSError, ValueError, AttributeError):
        return bool(json.loads(label.read_text(encoding="utf-8")).get("format") == FORMAT)
    return False


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Hold a lock that goes with the process, however it ends."""
    with path.open("ab") as stream:
        try:
            _lock(stream.fileno())
        except OSError as reason:
            mend = "Wait for it, or choose another output"
            raise OutputError.of(str(path.parent), "is in use by another sweep", mend) from reason
        yield


def _lock(handle: int) -> None:
    try:
        import fcntl
    except ImportError:
        import msvcrt

        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
    else:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)

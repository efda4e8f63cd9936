"""From the settings of a sweep to its table: what is recorded already is not run again."""

from __future__ import annotations

import hashlib
import os
import shutil
import statistics
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from cosimulation.progress import SILENT, Reporter
from cosimulation.sweep.bench import open_bench
from cosimulation.sweep.local import LocalPool
from cosimulation.sweep.plan import Bench, Run, chunks_of, runs_of
from cosimulation.sweep.settings import SweepSettings
from cosimulation.sweep.store import RESULTS, Store, opened_store
from cosimulation.sweep.worker import Row
from fmu_builder.errors import SettingsError

STATUSES = ("ok", "failed", "crashed", "timeout")
PATIENCE = 60.0
"""Seconds that a cluster may be without workers."""
_WRITE_EVERY = 0.5
"""Seconds of results that a kill may cost at most, beside the runs under way."""
_SHOWN = 5


@dataclass(frozen=True)
class SweepResult:
    """What a sweep found.

    Attributes:
        folder: Its folder.
        results: The sorted table (Parquet).
        runs: All runs, in the table's order.
        rows: One per run.
        bench: What the runs have in common.
        recorded: How many runs an earlier sweep had recorded.
    """

    folder: Path
    results: Path
    runs: tuple[Run, ...]
    rows: tuple[Row, ...]
    bench: Bench
    recorded: int

    @property
    def counts(self) -> dict[str, int]:
        """Number of runs by status."""
        return {name: sum(row["status"] == name for row in self.rows) for name in STATUSES}

    @property
    def passed(self) -> bool:
        """Whether every run has a result."""
        return self.counts["ok"] == len(self.rows)

    def summary(self) -> dict[str, object]:
        """Return the result for a machine."""
        told: dict[str, object] = {"results": str(self.results), "runs": len(self.rows)}
        return {**told, "recorded_before": self.recorded, **self.counts, "passed": self.passed}

    def text(self) -> str:
        """Return the result for a person."""
        lines = [f"{'model':<24}{'output':<12}{'runs':>8}{'median FIT %':>14}{'worst':>10}"]
        fits: dict[tuple[str, str], list[float]] = {}
        for run, row in zip(self.runs, self.rows, strict=True):
            for output, fit in row["fit"].items():
                if fit is not None:
                    fits.setdefault((self._model(run), output), []).append(fit)
        for (model, output), values in fits.items():
            middle = statistics.median(values)
            lines.append(f"{model:<24}{output:<12}{len(values):>8}{middle:>14.2f}{min(values):>10.2f}")
        lost = [(run, row) for run, row in zip(self.runs, self.rows, strict=True) if row["status"] != "ok"]
        for run, row in lost[:_SHOWN]:
            lines.append(f"{row['status']}: {self._model(run)}, task {run.key[:12]}: {row['message']}")
        if len(lost) > _SHOWN:
            lines.append(f"and {len(lost) - _SHOWN} more; see the column message")
        told = ", ".join(f"{count} {name}" for name, count in self.counts.items() if count)
        lines.append(f"{len(self.rows)} runs ({told}), {self.recorded} recorded before: {self.results}")
        return "\n".join(lines if fits else lines[1:])

    def _model(self, run: Run) -> str:
        return self.bench.models[run.model].settings.label


def run_sweep(
    settings: SweepSettings,
    scheduler: str | None = None,
    retry: bool = False,
    reporter: Reporter = SILENT,
) -> SweepResult:
    """Do what a sweep has not done yet, and write the table of all its runs.

    Args:
        settings: What to run; its folder may hold an earlier sweep, whose runs are kept.
        scheduler: Address of a Dask scheduler; this machine's processes without one.
        retry: Run again what failed, crashed or took too long earlier.
        reporter: Told how far it is.

    Raises:
        SettingsError: The settings do not fit what they name, or the scheduler does not answer.
        SweepError: Workers cannot be had.
        OutputError: The folder cannot be used.
        DataError: Something recorded earlier is damaged.
    """
    settings, bench = open_bench(settings)
    runs = {run.key: run for run in runs_of(settings, bench)}
    with opened_store(settings.output) as store:
        again = {key for key, row in store.rows.items() if retry and row["status"] != "ok"}
        open_runs = [run for key, run in runs.items() if key not in store.rows or key in again]
        recorded = len(runs) - len(open_runs)
        if open_runs:
            (store.folder / RESULTS).unlink(missing_ok=True)  # of fewer runs than there will be
            reporter.say(f"sweep: {len(runs)} runs, {recorded} of them recorded")
            with _source(settings, bench, open_runs, scheduler, store.folder, reporter) as source:
                _collect(source, store, runs, bench, len(open_runs), reporter)
        path = store.finish(list(runs.values()), bench)
        rows = tuple(store.rows[key] for key in runs)
    return SweepResult(settings.output, path, tuple(runs.values()), rows, bench, recorded)


@contextmanager
def _source(
    settings: SweepSettings,
    bench: Bench,
    runs: Sequence[Run],
    scheduler: str | None,
    folder: Path,
    reporter: Reporter,
) -> Iterator[Iterator[list[Row]]]:
    """Yield where rows come from."""
    if scheduler is not None:
        name = hashlib.sha256("".join(run.key for run in runs).encode()).hexdigest()[:16]
        cluster = _cluster()(bench, scheduler, name, PATIENCE, reporter.say)
        yield cluster.rows(chunks_of(runs, bench, settings.chunk_rows, cluster.width()))
        return
    work = folder.resolve() / "work"
    shutil.rmtree(work, ignore_errors=True)  # of a sweep that was killed
    work.mkdir()
    processes = settings.processes or os.cpu_count() or 1
    try:
        pool = LocalPool(bench, processes, settings.time_limit, work, reporter.say)
        yield pool.rows(chunks_of(runs, bench, settings.chunk_rows, processes))
    finally:
        shutil.rmtree(work, ignore_errors=True)


def _cluster() -> type:
    try:
        from cosimulation.sweep.cluster import ClusterPool
    except ImportError as reason:
        mend = "Install it: pip install 'pantograph-llmn[dask]'"
        raise SettingsError.of("--scheduler", f"needs Dask ({reason})", mend) from reason
    return ClusterPool


def _collect(
    source: Iterator[list[Row]],
    store: Store,
    runs: Mapping[str, Run],
    bench: Bench,
    total: int,
    reporter: Reporter,
) -> None:
    """Write rows as they come, whatever ends the sweep."""
    waiting: list[Row] = []
    written = time.monotonic()
    try:
        with reporter.bar("sweep", total) as advance:
            for rows in source:
                waiting += rows
                advance(len(rows))
                if waiting and time.monotonic() - written > _WRITE_EVERY:
                    store.append(waiting, runs, bench)
                    waiting, written = [], time.monotonic()
    except KeyboardInterrupt:
        done = len({row["key"] for row in waiting} | (store.rows.keys() & runs.keys()))
        reporter.say(f"stopped: {done} of {len(runs)} runs are recorded, and the same command goes on")
        raise
    finally:
        source.close()  # type: ignore[attr-defined]
        if waiting:
            store.append(waiting, runs, bench)

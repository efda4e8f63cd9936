"""The same sweep on a Dask cluster: workers are given FMUs and records as bytes, and see no file of ours."""

from __future__ import annotations

import queue
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from distributed import Client, KilledWorker, WorkerPlugin

from cosimulation.sweep.local import CRASHED
from cosimulation.sweep.plan import Bench, Model, Run
from cosimulation.sweep.worker import Row, Workbench, failed_row
from fmu_builder.errors import SettingsError, SweepError

_TICK = 1.0
CONNECT = 20.0
"""Seconds that the scheduler has to answer."""

_workbenches: dict[str, Workbench] = {}
"""Of this worker process, by sweep."""


class BenchPlugin(WorkerPlugin):  # type: ignore[misc]
    """Gives every worker, also one that joins later, what runs have in common."""

    idempotent = True

    def __init__(self, name: str, bench: Bench) -> None:
        self.name = name
        self._bench = bench

    def setup(self, worker: Any) -> None:
        """Begin a sweep in this worker."""
        _workbenches.setdefault(self.name, Workbench(self._bench))

    def teardown(self, worker: Any) -> None:
        """End it."""
        known = _workbenches.pop(self.name, None)
        if known is not None:
            known.close()


def run_chunk(name: str, runs: Sequence[Run]) -> list[Row]:
    """Do runs in a worker of the cluster."""
    return [_workbenches[name].row(run) for run in runs]


def portable(bench: Bench) -> Bench:
    """Return a bench that holds the archives themselves."""

    def packed(model: Model) -> Model:
        return replace(
            model,
            archive=model.archive.read_bytes() if isinstance(model.archive, Path) else model.archive,
        )

    reference = None if bench.reference is None else packed(bench.reference)
    return replace(bench, models=tuple(map(packed, bench.models)), reference=reference)


class ClusterPool:
    """A Dask cluster for one sweep.

    Args:
        bench: What workers are given.
        address: Of the scheduler.
        name: Of the sweep, different from sweep to sweep.
        patience: Seconds to wait while there is no worker.
        say: Told of every run that is not to be had.
    """

    def __init__(
        self, bench: Bench, address: str, name: str, patience: float, say: Callable[[str], None]
    ) -> None:
        self._bench, self._name, self._patience, self._say = bench, f"llmn-sweep-{name}", patience, say
        try:
            self._client = Client(address, timeout=CONNECT, set_as_default=False)
        except (OSError, ValueError) as reason:
            mend = "Give the address that dask scheduler prints, such as tcp://127.0.0.1:8786"
            raise SettingsError.of(f"--scheduler {address}", f"does not answer ({reason})", mend) from reason
        self._answers: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._seen = time.monotonic()

    def width(self) -> int:
        """Return how many workers there are, at least 1."""
        return max(1, len(self._client.scheduler_info(n_workers=-1)["workers"]))

    def rows(self, chunks: Sequence[Sequence[Run]]) -> Iterator[list[Row]]:
        """Yield rows as they come.

        Runs of a chunk whose workers died too often go one by one, with nothing beside them: what then still
        ends its workers is recorded as crashed.

        Raises:
            SweepError: There is no worker for too long, or the cluster gives up.
        """
        suspects: list[Run] = []
        with self._client:
            self._client.register_plugin(BenchPlugin(self._name, portable(self._bench)), name=self._name)
            try:
                for runs, rows in self._answered(chunks):
                    if rows is None:
                        suspects += runs
                    else:
                        yield rows
                for run in suspects:
                    for _, rows in self._answered([[run]]):
                        if rows is None:
                            self._say(f"task {run.key[:12]}: {CRASHED}, again and again")
                        yield [failed_row(run, "crashed", CRASHED)] if rows is None else rows
            finally:
                self._forget()

    def _answered(self, chunks: Sequence[Sequence[Run]]) -> Iterator[tuple[Sequence[Run], list[Row] | None]]:
        """Yield chunks with their rows, None where it ended its workers."""
        futures = {}
        for chunk in chunks:
            future = self._client.submit(run_chunk, self._name, chunk, pure=False)
            futures[future.key] = (future, chunk)
            future.add_done_callback(self._answers.put)
        while futures:
            try:
                done = self._answers.get(timeout=_TICK)
            except queue.Empty:
                self._require_workers()
                continue
            self._seen = time.monotonic()
            future, chunk = futures.pop(done.key)
            try:
                yield chunk, future.result()
            except KilledWorker:
                yield chunk, None
            except Exception as reason:
                what = f"gave a chunk of runs up ({type(reason).__name__}: {reason})"
                mend = "Mend the cluster; the same command goes on where this one ended"
                raise SweepError.of("Dask cluster", what, mend) from reason

    def _require_workers(self) -> None:
        if self._client.scheduler_info(n_workers=-1)["workers"]:
            self._seen = time.monotonic()
        elif time.monotonic() - self._seen > self._patience:
            what = f"has had no worker for {self._patience:g} s"
            mend = "Start workers (dask worker ADDRESS --nthreads 1); the same command then goes on"
            raise SweepError.of("Dask cluster", what, mend)

    def _forget(self) -> None:
        try:
            self._client.unregister_worker_plugin(self._name)
        except Exception as reason:  # the cluster is gone, and the plugin with it
            self._say(f"the cluster was not tidied up ({type(reason).__name__})")

"""A sweep on this machine: worker processes that an FMU may crash or hang without ending the sweep.

Every worker has a pipe of its own and tells each result as it comes, so that it is known which run a process
died in. That run is repeated as the first of a new process; if that dies too, it is the run's own doing.
Somebody else may have ended one process, and an earlier run may have damaged its memory.
"""

from __future__ import annotations

import contextlib
import math
import multiprocessing
import os
import signal
import sys
import tempfile
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

from cosimulation.sweep.plan import Bench, Run
from cosimulation.sweep.worker import Row, Workbench, failed_row
from cosimulation.threads import one_thread_each
from fmu_builder.errors import SweepError

CRASHED = "the FMU ended the process that it ran in"
_TICK = 1.0
"""Seconds after which a caller hears from us even where nothing has happened."""
_STILLBORN = 3
"""Processes that may end at their start, one after the other."""
_GRACE = 5.0
"""Seconds that a worker has to end by itself."""


def _serve(pipe: Connection, bench: Bench, work: str) -> None:
    """Run what comes through the pipe, and send one row per run, in order."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C goes to all; the parent decides
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    tempfile.tempdir = work
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):  # what FMUs print is not our answer
        os.dup2(nowhere, stream)
    workbench = Workbench(bench)
    try:
        pipe.send(None)
        while runs := pipe.recv():
            for run in runs:
                pipe.send(workbench.row(run))
    except (EOFError, OSError):  # nobody listens any more
        return
    workbench.close()


def _end_with(parent: Any) -> None:
    parent.join()
    os._exit(1)


class _Worker:
    """One process; `pending` are the runs it has not answered, the first is the one it is at."""

    def __init__(self, context: Any, bench: Bench, work: Path) -> None:
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=_serve, args=(theirs, bench, str(work)), daemon=True)
        self.process.start()
        theirs.close()
        self.ready = False
        self.answered = 0
        self.pending: deque[Run] = deque()
        self.deadline = math.inf

    def give(self, runs: Sequence[Run]) -> None:
        self.pending.extend(runs)
        with contextlib.suppress(OSError):  # it has died; the next reading of its pipe finds out
            self.pipe.send(list(runs))

    def end(self, at_once: bool) -> None:
        if not at_once:
            with contextlib.suppress(OSError):
                self.pipe.send([])
                self.process.join(_GRACE)
        if self.process.is_alive():
            self.process.kill()
        self.process.join()
        self.pipe.close()


class LocalPool:
    """Worker processes for one sweep.

    Args:
        bench: What they are given.
        processes: How many.
        time_limit: Of one run [s].
        work: Folder for what they unpack; the caller deletes it.
        say: Told of every process that died.
    """

    def __init__(
        self,
        bench: Bench,
        processes: int,
        time_limit: float,
        work: Path,
        say: Callable[[str], None],
    ) -> None:
        one_thread_each()
        quick = sys.platform != "win32"  # a server that has loaded everything forks workers in no time
        self._context: Any = multiprocessing.get_context("forkserver" if quick else "spawn")
        if quick:
            self._context.set_forkserver_preload([__name__])
        self._bench, self._processes, self._limit, self._work = bench, processes, time_limit, work
        self._say = say
        self._workers: list[_Worker] = []
        self._chunks: deque[Sequence[Run]] = deque()
        self._suspects: deque[Run] = deque()
        self._deaths: Counter[str] = Counter()
        self._stillborn = 0

    def rows(self, chunks: Sequence[Sequence[Run]]) -> Iterator[list[Row]]:
        """Yield rows as they come, and nothing now and then; ends all processes at the end.

        Raises:
            SweepError: Worker processes die before they do anything.
        """
        self._chunks.extend(chunks)
        finished = False
        try:
            while self._employ():
                yield self._heard()
            finished = True
        finally:
            for worker in self._workers:
                worker.end(at_once=not finished)
            self._workers.clear()

    def _employ(self) -> bool:
        """Give every idle worker something to do; return whether anybody is at work."""
        for worker in [one for one in self._workers if not one.pending and one.ready]:
            if self._suspects and worker.answered:  # suspects are for new processes
                self._workers.remove(worker)
                worker.end(at_once=False)
            else:
                self._feed(worker)
        while len(self._workers) < self._processes and (self._suspects or self._chunks):
            worker = _Worker(self._context, self._bench, self._work)
            self._workers.append(worker)
            self._feed(worker)
        return any(worker.pending for worker in self._workers)

    def _feed(self, worker: _Worker) -> None:
        if self._suspects:
            worker.give([self._suspects.popleft()])
        elif self._chunks:
            worker.give(self._chunks.popleft())
        worker.deadline = time.monotonic() + self._limit if worker.ready else math.inf

    def _heard(self) -> list[Row]:
        """Return what workers have told; see to those that died or take too long."""
        busy = {worker.pipe: worker for worker in self._workers}
        nearest = min(worker.deadline for worker in self._workers) - time.monotonic()
        rows: list[Row] = []
        for pipe in wait(list(busy), max(0.0, min(_TICK, nearest))):
            worker = busy[pipe]
            try:
                while worker.pipe.poll():
                    self._take(worker, worker.pipe.recv(), rows)
            except (EOFError, OSError):
                self._bury(worker, rows)
        for worker in [one for one in self._workers if one.pending and time.monotonic() > one.deadline]:
            self._stop(worker, rows)
        return rows

    def _take(self, worker: _Worker, row: Row | None, rows: list[Row]) -> None:
        worker.deadline = time.monotonic() + self._limit
        if row is None:
            worker.ready = True
            self._stillborn = 0
            return
        worker.pending.popleft()
        worker.answered += 1
        rows.append(row)

    def _bury(self, worker: _Worker, rows: list[Row]) -> None:
        """Find out whose doing the death of a process was, and save the rest of its runs."""
        self._workers.remove(worker)
        worker.end(at_once=True)
        cause = worker.process.exitcode
        if not worker.ready:
            self._stillborn += 1
            self._chunks.appendleft(list(worker.pending))
            if self._stillborn == _STILLBORN:
                what = f"worker processes end before they do anything (exit status {cause})"
                raise SweepError.of("sweep", what, "See whether Python can start processes here, and memory")
            return
        if not worker.pending:
            return
        run = worker.pending.popleft()
        self._deaths[run.key] += 1
        if worker.answered or self._deaths[run.key] == 1:  # somebody else may have ended it
            self._suspects.append(run)
        else:
            self._say(f"{self._name(run)}: {CRASHED} (exit status {cause})")
            rows.append(failed_row(run, "crashed", CRASHED))
        if worker.pending:
            self._chunks.appendleft(list(worker.pending))

    def _stop(self, worker: _Worker, rows: list[Row]) -> None:
        self._workers.remove(worker)
        worker.end(at_once=True)
        run = worker.pending.popleft()
        rows.append(failed_row(run, "timeout", f"took longer than the time limit of {self._limit:g} s"))
        self._say(f"{self._name(run)}: {rows[-1]['message']}")
        if worker.pending:
            self._chunks.appendleft(list(worker.pending))

    def _name(self, run: Run) -> str:
        return f"{self._bench.models[run.model].settings.label}, task {run.key[:12]}"

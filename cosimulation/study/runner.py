"""Running a study: many independent tasks over processes, one folder of results."""

from __future__ import annotations

import json
import multiprocessing
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

from pydantic import Field, field_validator

from cosimulation.progress import Reporter
from cosimulation.settings import Section
from cosimulation.study.limits import Limit, Verdict
from cosimulation.threads import one_thread_each
from fmus.wbm import parameter_sets

Task = TypeVar("Task")


class StudySettings(Section):
    """What every study's TOML file holds; each study adds its own tables."""

    title: str
    sets: tuple[str, ...] = Field(("A", "Blow"), min_length=1)
    seeds: tuple[int, ...] = Field((1, 2, 3, 4, 5, 6, 7, 8), min_length=1)
    limits: tuple[Limit, ...] = ()
    processes: int | None = Field(None, ge=1, description="all cores by default")

    @field_validator("sets", "seeds")
    @classmethod
    def _differ(cls, values: tuple[Any, ...]) -> tuple[Any, ...]:
        """Refuse what stands there twice: it would be done twice, and counted twice."""
        if twice := sorted({value for value in values if values.count(value) > 1}):
            raise ValueError(f"twice: {', '.join(map(str, twice))}")
        return values

    @field_validator("sets")
    @classmethod
    def _are_known(cls, sets: tuple[str, ...]) -> tuple[str, ...]:
        known = parameter_sets()
        if unknown := sorted(set(sets) - set(known)):
            raise ValueError(f"no white-box set {', '.join(unknown)}; there are {', '.join(known)}")
        return sets

    @field_validator("seeds")
    @classmethod
    def _are_seeds(cls, seeds: tuple[int, ...]) -> tuple[int, ...]:
        if min(seeds) < 0:
            raise ValueError("seeds are whole numbers from 0 on")
        return seeds


@dataclass(frozen=True)
class StudyResult:
    """What a study found.

    Attributes:
        folder: Where the results are.
        records: Score records.
        verdicts: One per limit.
        seconds: CPU seconds by step, as far as the study measures them.
        lines: What is told a person before the verdicts.
    """

    folder: Path
    records: list[dict[str, Any]]
    verdicts: list[Verdict]
    seconds: dict[str, float]
    lines: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether no limit failed."""
        return all(verdict.passed is not False for verdict in self.verdicts)

    def summary(self) -> dict[str, object]:
        """Return the result for a machine."""
        limits = [
            {
                "label": item.limit.label,
                "median": item.median,
                "worst": item.worst,
                "seeds": item.seeds,
                "passed": item.passed,
            }
            for item in self.verdicts
        ]
        return {"folder": str(self.folder), "limits": limits, "passed": self.passed}

    def text(self) -> str:
        """Return the result for a person."""
        verdicts = [verdict.line() for verdict in self.verdicts]
        return "\n".join([*self.lines, *verdicts, f"report: {self.folder / 'report.html'}"])


class Pool(Generic[Task]):
    """Runs tasks over processes of one thread each; the results come in the order of the tasks.

    Args:
        processes: How many; all cores if None.
    """

    def __init__(self, processes: int | None) -> None:
        self.processes = processes or os.cpu_count() or 1

    def run(
        self, function: Callable[[Task], Any], tasks: Sequence[Task], reporter: Reporter, title: str
    ) -> list[Any]:
        """Return function(task) for all tasks.

        A task that fails ends the run: what is not started is not started any more.
        """
        results: list[Any] = [None] * len(tasks)
        if self.processes == 1:
            with reporter.bar(title, len(tasks)) as advance:
                for index, task in enumerate(tasks):
                    results[index] = function(task)
                    advance(1)
            return results
        one_thread_each()
        context = multiprocessing.get_context("spawn")
        with (
            ProcessPoolExecutor(self.processes, mp_context=context) as pool,
            reporter.bar(title, len(tasks)) as advance,
        ):
            futures = {pool.submit(function, task): index for index, task in enumerate(tasks)}
            try:
                for future in as_completed(futures):
                    results[futures[future]] = future.result()
                    advance(1)
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise
        return results


def as_json(value: Any) -> str:
    """Return a result file's text."""
    return json.dumps(value, indent=1) + "\n"

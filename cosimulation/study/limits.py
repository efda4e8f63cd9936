"""Acceptance limits of a study: which scores, which statistic over the seeds, how good they must be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from cosimulation.settings import Section
from identification.scores import FIELDS

Where = dict[str, str | int | float | bool | tuple[int, ...] | None]
"""Fields of score records and what they hold; of several numbers any."""


class Limit(Section):
    """One line of an acceptance table; the statistics are over seeds, of FIT on test data or a measure."""

    label: str
    measure: str | None = Field(
        None,
        description="name of a measured quantity in place of the FIT: then the limits are largest values",
    )
    where: Where = Field(description="fields of a score record, or of a measure")
    combine: Literal["best", "worst"] = Field(
        "best",
        description="of several matching records of one seed: the better of alternatives, or the worst; of a "
        "measure always the worst",
    )
    less: Where | None = Field(
        None, description="fields of records whose FIT is subtracted, for limits on a difference"
    )
    median: float | None = Field(None, description="smallest median that passes, of a measure the largest")
    worst: float | None = Field(
        None, description="smallest worst value that passes, of a measure the largest"
    )
    total: float | None = Field(
        None, description="largest sum over all matching records that passes, of a measure that counts"
    )
    stretch: float | None = Field(None, description="a median to strive for; never fails [%]")
    thesis: float | None = Field(None, description="the thesis's figure, for comparison [%]")
    yardstick: Where | None = Field(
        None, description="fields of records that say what exact linearisations reach in the same place"
    )

    @model_validator(mode="after")
    def _counts_a_measure(self) -> Limit:
        if self.total is not None and self.measure is None:
            raise ValueError(f"limit {self.label!r}: total is of a measure")
        return self

    @property
    def asked(self) -> tuple[tuple[str, float | None], ...]:
        """What decides, with its bound."""
        return ("median", self.median), ("worst", self.worst), ("total", self.total)


@dataclass(frozen=True)
class Verdict:
    """A limit and what was measured.

    Attributes:
        limit: The limit.
        median: Over the seeds [%, or the measure's unit]; NaN without data.
        worst: Over the seeds.
        seeds: How many seeds there were.
        yardstick: Median of the limit's yardstick [%]; None without one.
        passed: None for a limit that only prints.
        unit: Of a measure, empty where it has none; % for a FIT.
        total: Sum over all matching records of a measure.
        records: How many they are.
    """

    limit: Limit
    median: float
    worst: float
    seeds: int
    yardstick: float | None
    passed: bool | None
    unit: str = "%"
    total: float = float("nan")
    records: int = 0

    @property
    def counted(self) -> str:
        """The sum and of how many records it is, as text."""
        return f"{self.total:g} of {self.records}"

    def line(self) -> str:
        """Return one line of text."""
        sign = "<=" if self.limit.measure else ">="
        asked = [f"{name} {sign} {value:g}" for name, value in self.limit.asked if value is not None]
        word = {True: "pass", False: "FAIL", None: "printed"}[self.passed]
        if self.limit.stretch is not None:
            asked.append(f"stretch {self.limit.stretch:g}")
        thesis = f" [thesis {self.limit.thesis:g}]" if self.limit.thesis is not None else ""
        failed = self.passed is False and self.yardstick is not None
        bound = f" (exact linearisations {self.yardstick:.3f})" if failed else ""
        seeds = plural(self.seeds, "seed")
        measured = f"median {self.median:7.3f}  worst {self.worst:7.3f}  ({seeds})"
        if self.limit.total is not None:
            measured = self.counted
        return f"{word:<8}{self.limit.label:<61} {measured}  {', '.join(asked)}{thesis}{bound}"


def plural(count: int, noun: str) -> str:
    """Return a number of things as text."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def judge(
    limit: Limit, records: Sequence[Mapping[str, Any]], measures: Sequence[Mapping[str, Any]] = ()
) -> Verdict:
    """Compare the FIT of the matching test records, or the matching measures, with a limit.

    Raises:
        KeyError: The limit names a field that a record does not have.
    """
    if limit.measure is not None:
        return _judge_measure(limit, measures)
    named = set(limit.where) | set(limit.less or {}) | set(limit.yardstick or {})
    unknown = sorted(named - set(FIELDS))
    if unknown:
        raise KeyError(f"limit {limit.label!r}: no such field {', '.join(unknown)}")
    by_seed = _by_seed(limit.where, limit, records)
    if limit.less is not None:
        other = _by_seed(limit.less, limit, records)
        by_seed = {
            seed: fit - other[seed] if np.isfinite(other[seed]) else float("nan")
            for seed, fit in by_seed.items()
            if seed in other
        }
    values = list(by_seed.values())
    reached = list(_by_seed(limit.yardstick, limit, records).values()) if limit.yardstick else []
    median = float(np.median(values)) if values else float("nan")
    worst = float(np.min(values)) if values else float("nan")  # NaN stays NaN: nothing to compare with
    bounds = [(median, limit.median), (worst, limit.worst)]
    asked = [value >= bound for value, bound in bounds if bound is not None]
    yardstick = float(np.median(reached)) if reached else None
    return Verdict(limit, median, worst, len(values), yardstick, all(asked) if asked else None)


def _judge_measure(limit: Limit, measures: Sequence[Mapping[str, Any]]) -> Verdict:
    """Compare the largest matching measure of every seed with a limit."""
    named = [one for one in measures if one["measure"] == limit.measure]
    if unknown := sorted({key for one in named for key in limit.where if key not in one}):
        raise KeyError(f"limit {limit.label!r}: no such field {', '.join(unknown)}")
    by_seed: dict[int, float] = {}
    found: list[float] = []
    units: list[str] = []
    for one in named:
        if all(_matches(one[key], value) for key, value in limit.where.items()):
            value = np.inf if one["value"] is None else float(one["value"])
            by_seed[one["seed"]] = max(value, by_seed.get(one["seed"], -np.inf))
            found.append(value)
            units.append(one["unit"])
    values = list(by_seed.values())
    median = float(np.median(values)) if values else float("nan")
    worst = float(np.max(values)) if values else float("nan")
    total = float(np.sum(found)) if found else float("nan")
    bounds = ((median, limit.median), (worst, limit.worst), (total, limit.total))
    asked = [value <= bound for value, bound in bounds if bound is not None]
    unit = units[0] if units and units[0] != "1" else ""
    passed = all(asked) if asked else None
    return Verdict(limit, median, worst, len(values), None, passed, unit, total, len(found))


def _matches(held: Any, wanted: Any) -> bool:
    return held in wanted if isinstance(wanted, tuple) else bool(held == wanted)


def _by_seed(
    where: Mapping[str, Any], limit: Limit, records: Sequence[Mapping[str, Any]]
) -> dict[int, float]:
    """Return the FIT by seed of the matching test records."""
    chosen = max if limit.combine == "best" else min
    found: dict[int, float] = {}
    for record in records:
        if record["split"] == "test" and all(_matches(record[key], value) for key, value in where.items()):
            fit = -np.inf if record["fit"] is None else float(record["fit"])
            seed = record["seed"]
            found[seed] = chosen(fit, found[seed]) if seed in found else fit
    return found

"""When two runs count as the same."""

from __future__ import annotations

from collections.abc import Sequence

from fmu_builder.check.behaviour.plan import PlannedVariable

Rows = Sequence[Sequence[float]]
ROUNDING = 1e-9
"""Of an output's movement: differences below are rounding in another order."""


def spans(variables: Sequence[PlannedVariable], *runs: Rows) -> list[float]:
    """Return how far each output moves in the runs; where it does not move, a rounding of its size."""
    found = []
    for column, variable in enumerate(variables):
        values = [row[column] for rows in runs for row in rows]
        largest = max((abs(value) for value in values), default=0.0)
        moved = (max(values) - min(values)) if values else 0.0
        found.append(max(moved, 1e-9 * max(largest, variable.size), 1e-300))
    return found


def difference(
    one: Rows, other: Rows, variables: Sequence[PlannedVariable], spans_of: Sequence[float]
) -> tuple[float, str]:
    """Return the largest difference as part of the output's movement, and the output that has it."""
    worst, name = 0.0, ""
    for left, right in zip(one, other, strict=True):
        for column, variable in enumerate(variables):
            a, b = left[column], right[column]
            gap = 0.0 if a == b else abs(a - b) / spans_of[column]
            if not gap <= worst:  # not a number counts as a difference
                worst, name = (gap if gap == gap else float("inf")), variable.name
    return worst, name


def all_finite(rows: Rows) -> bool:
    """Whether every value is a finite number."""
    return all(value - value == 0.0 for row in rows for value in row)

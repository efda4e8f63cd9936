"""Sums, products and solutions for the specification, one number at a time in the order of the C code."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from fmu_builder.parameter_set import LocalLinearModel

Row = Sequence[float]
Blend = list[tuple[LocalLinearModel, float]]
_SINGULAR = 1e-14  # a pivot this small against the largest entry means: no steady state


def times(matrix: Sequence[Row], vector: Row, result: list[float]) -> None:
    """Add `matrix` times `vector` to `result`, summing over the columns in order."""
    for row, entries in enumerate(matrix):
        for entry, value in zip(entries, vector, strict=True):
            result[row] += entry * value


def blended(blend: Blend, of: Callable[[LocalLinearModel], Row]) -> list[float]:
    """Return sum_a w_a v_a of a vector v of the models."""
    result = [0.0] * len(of(blend[0][0]))
    for model, weight in blend:
        for index, value in enumerate(of(model)):
            result[index] += weight * value
    return result


def blended_matrix(blend: Blend, of: Callable[[LocalLinearModel], Sequence[Row]]) -> list[list[float]]:
    """Return sum_a w_a M_a of a matrix M of the models, row by row."""
    rows = len(of(blend[0][0]))

    def row_of(index: int) -> Callable[[LocalLinearModel], Row]:
        return lambda model: of(model)[index]

    return [blended(blend, row_of(index)) for index in range(rows)]


def between(positions: Row, rows: Sequence[Row], value: float) -> list[float]:
    """Return the linear interpolation of `rows`, continued by the end segments."""
    cell = cell_of(positions, value)
    f = fraction_of(positions, cell, value)
    return [(1.0 - f) * left + f * right for left, right in zip(rows[cell], rows[cell + 1], strict=True)]


def cell_of(positions: Row, value: float) -> int:
    """Return the last cell that begins at or before `value`; 0 before all."""
    return max([0, *(k for k in range(len(positions) - 1) if positions[k] <= value)])


def fraction_of(positions: Row, cell: int, value: float) -> float:
    """Return where in its cell `value` lies, 0 at the left end, 1 at the right."""
    return (value - positions[cell]) / (positions[cell + 1] - positions[cell])


def solve(matrix: list[list[float]], x: list[float]) -> bool:
    """Replace x by the solution of matrix * solution = x; False when the matrix is singular."""
    n = len(x)
    largest = max(abs(entry) for row in matrix for entry in row)
    for k in range(n):
        pivot = max(range(k, n), key=lambda row: (abs(matrix[row][k]), -row))
        if not abs(matrix[pivot][k]) > _SINGULAR * largest:
            return False
        matrix[k], matrix[pivot] = matrix[pivot], matrix[k]
        x[k], x[pivot] = x[pivot], x[k]
        for i in range(k + 1, n):
            factor = matrix[i][k] / matrix[k][k]
            for j in range(k + 1, n):
                matrix[i][j] -= factor * matrix[k][j]
            x[i] -= factor * x[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            x[k] -= matrix[k][j] * x[j]
        x[k] /= matrix[k][k]
    return True

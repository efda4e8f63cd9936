"""ARX regressors and local weighted least squares."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from identification.arrays import Array

_UNDETERMINED = 1e-13
"""Singular values of the scaled regressors below this share of the largest are rounding."""


@dataclass(frozen=True)
class Orders:
    """What a row of regressors holds: y(k-1) .. y(k-na), then nb values of every input, then 1.

    The newest value of an input is u(k - delay).

    Attributes:
        past_outputs: na.
        past_inputs: nb.
        inputs: m.
        delay: 0 or 1.
    """

    past_outputs: int
    past_inputs: int
    inputs: int
    delay: int = 1

    @property
    def before(self) -> int:
        """Rows that must be known before the first one that can be predicted."""
        return max(self.past_outputs, self.past_inputs + self.delay - 1, 1)

    @property
    def size(self) -> int:
        """Number of regressors r."""
        return self.past_outputs + self.inputs * self.past_inputs + 1

    def of_input(self, index: int) -> slice:
        """Return where the values of an input stand."""
        first = self.past_outputs + index * self.past_inputs
        return slice(first, first + self.past_inputs)


def regressors(inputs: Array, output: Array, orders: Orders) -> Array:
    """Return the regressors of the rows k = orders.before .. N - 1 (thesis eq. 3.9 with a constant term).

    Args:
        inputs: u, shape (N, m).
        output: y, shape (N,).
        orders: What they are.

    Returns:
        Shape (N - orders.before, r).
    """
    rows = len(output) - orders.before

    def lagged(signal: Array, lag: int) -> Array:
        return signal[orders.before - lag : orders.before - lag + rows]

    columns = [lagged(output, lag) for lag in range(1, orders.past_outputs + 1)]
    for one in inputs.T:
        columns += [lagged(one, lag) for lag in range(orders.delay, orders.delay + orders.past_inputs)]
    return np.column_stack([*columns, np.ones(rows)])


def differences(orders: Orders) -> Array:
    """Return the matrix that turns a row of `regressors` into backward differences, shape (r, r).

    Samples close in time are almost equal, their differences are not: least squares lose no digits there.
    """
    matrix = np.eye(orders.size)
    cells = [slice(0, orders.past_outputs), *map(orders.of_input, range(orders.inputs))]
    for cell in cells:
        count = cell.stop - cell.start
        signed = [[(-1.0) ** lag * math.comb(row, lag) for lag in range(count)] for row in range(count)]
        matrix[cell, cell] = signed
    return matrix


def weighted_least_squares(columns: Array, target: Array, shares: Array) -> Array:
    """Return the theta that makes sum_k w_k (y_k - x_k theta)^2 smallest, shape (r,).

    By QR of the weighted columns, scaled to one length, never by normal equations; directions that the data
    do not determine stay zero in the scaled columns.

    Args:
        columns: x, shape (N, r).
        target: y, shape (N,).
        shares: w >= 0, shape (N,).
    """
    root = np.sqrt(shares)[:, None]
    weighted = columns * root
    length = np.linalg.norm(weighted, axis=0)
    length[length == 0.0] = 1.0
    both = np.column_stack([weighted / length, target[:, None] * root])
    triangle = np.asarray(np.linalg.qr(both, mode="r"))
    r = columns.shape[1]
    scaled = np.linalg.lstsq(triangle[:r, :r], triangle[:r, r], rcond=_UNDETERMINED)[0]
    return np.asarray(scaled / length)

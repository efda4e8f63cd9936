"""Affine offsets of the local models (eq. 3.30-3.34): which of the fourteen can be identified.

x+ = A (x - x0) + B (u - u0), y = C (x - x0) + y0, all blended. The outputs are linear in x0 (6),
u0 (2) and y0 (6), so their Jacobian does not depend on their values, and its rank says what is redundant:

* y0 of delta_M and its rate act on nothing that is compared (Remark 4.4.1);
* u0 of eta is a combination of the others: moving wire, head and masses by one length changes
  nothing but the force of the wall;
* of x0 and u0, two directions per local model are combinations of the rest, and six more, common to all
  local models, only move the origin of the state. What remains of x0 are forces on all six states, three of
  which would act on a position without a mass; they are fixed at zero.

What is estimated, therefore: y0 of the four outputs and u0 of the torque, which is one force on m_M; the
latter only where there are several local models, because for one alone y0 does the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.arrays import Array
from identification.surrogate.chain import INPUT_NAMES, OUTPUT_NAMES, STATE_NAMES


@dataclass(frozen=True)
class Offset:
    """One affine offset.

    Attributes:
        name: `u0_` or `y0_` and the signal.
        unit: SI unit.
        bounds: Table 4.2; equal where it is fixed.
        size: Unit of its search coordinate.
    """

    name: str
    unit: str
    bounds: tuple[float, float]
    size: float


OFFSETS = (
    Offset("u0_eta", "m", (0.0, 0.0), 1.0),
    Offset("u0_M_pa", "N.m", (-2000.0, 2000.0), 1000.0),
    Offset("y0_xi", "m", (-2000.0, 2000.0), 0.1),
    Offset("y0_xi_dot", "m/s", (-2000.0, 2000.0), 0.1),
    Offset("y0_zeta", "m", (-2000.0, 2000.0), 0.1),
    Offset("y0_zeta_dot", "m/s", (-2000.0, 2000.0), 0.1),
)
"""The offsets that the recursion knows, in its order; all others are fixed at zero."""

ALL_NAMES = (
    *(f"y0_{name}" for name in OUTPUT_NAMES),
    *(f"u0_{name}" for name in reversed(INPUT_NAMES)),
    *(f"x0_{name}" for name in STATE_NAMES),
    *(f"y0_{name}" for name in STATE_NAMES[len(OUTPUT_NAMES) :]),
)
"""All fourteen, those first that are kept rather than the others."""

_RANK = 1e-9
"""Singular values below this, of columns of unit length, count as zero: there is a gap of many decades."""


@dataclass(frozen=True)
class OffsetAnalysis:
    """What data can say about the offsets of M local models.

    Attributes:
        rank: Number of identifiable directions of all 14 M offsets.
        silent: Offsets that act on nothing.
        independent: Offsets that are not combinations of the ones before them in `ALL_NAMES` (all local
            models of a name before the next name), by name: in how many local models.
        singular_values: Of the Jacobian with columns of unit length, descending.
    """

    rank: int
    silent: tuple[str, ...]
    independent: dict[str, int]
    singular_values: Array


def analyse_offsets(A: Array, B: Array, weights: Array) -> OffsetAnalysis:
    """Return which affine offsets can be told apart, from a dense Jacobian.

    Args:
        A: System matrices of the local models, (M, n, n).
        B: Input matrices, (M, n, m).
        weights: Weight of every local model at every row, (N, M).
    """
    jacobian = _jacobian(A, B, weights)
    flat = jacobian.reshape(-1, jacobian.shape[-1])
    length = np.linalg.norm(flat, axis=0)
    scaled = flat / np.where(length > 0.0, length, 1.0)
    triangle: Array = np.asarray(np.linalg.qr(scaled, mode="r"))
    values: Array = np.asarray(np.linalg.svd(triangle, compute_uv=False), dtype=np.float64)
    models = len(A)
    basis = np.zeros((triangle.shape[0], 0))
    independent: dict[str, int] = dict.fromkeys(ALL_NAMES, 0)
    for column in range(triangle.shape[1]):
        rest = triangle[:, column] - basis @ (basis.T @ triangle[:, column])
        rest = rest - basis @ (basis.T @ rest)
        size = float(np.linalg.norm(rest))
        if size > _RANK:
            basis = np.column_stack([basis, rest / size])
            independent[ALL_NAMES[column // models]] += 1
    silent = tuple(
        name for k, name in enumerate(ALL_NAMES) if not length[k * models : (k + 1) * models].any()
    )
    return OffsetAnalysis(int(np.sum(values > _RANK * values[0])), silent, independent, values)


def _jacobian(A: Array, B: Array, weights: Array) -> Array:
    """Return d y / d offsets, (N, 4, 14 M), columns as `ALL_NAMES` and in each the local models."""
    rows, models = weights.shape
    n, m, p = A.shape[1], B.shape[2], len(OUTPUT_NAMES)
    first = {"u0": p * models, "x0": (p + m) * models}
    columns = len(ALL_NAMES) * models
    unit_u = np.zeros((m, columns))
    unit_x, unit_y = np.zeros((n, columns)), np.zeros((p, columns))
    owner = np.tile(np.arange(models), len(ALL_NAMES))
    for k in range(p):
        unit_y[k, k * models : (k + 1) * models] = 1.0
    for k in range(m):  # torque before height
        unit_u[m - 1 - k, first["u0"] + k * models : first["u0"] + (k + 1) * models] = 1.0
    for k in range(n):
        unit_x[k, first["x0"] + k * models : first["x0"] + (k + 1) * models] = 1.0
    held = weights[0]
    mixed = np.tensordot(held, A, 1), np.tensordot(held, B, 1)
    forcing = -(mixed[0] @ (unit_x * held[owner]) + mixed[1] @ (unit_u * held[owner]))
    slope = np.linalg.solve(np.eye(n) - mixed[0], forcing)
    result = np.empty((rows, p, columns))
    for k in range(rows):
        result[k] = slope[:p] + (unit_y - unit_x[:p]) * held[owner]
        held = weights[k]
        mixed = np.tensordot(held, A, 1), np.tensordot(held, B, 1)
        own = held[owner]
        slope = mixed[0] @ (slope - unit_x * own) - mixed[1] @ (unit_u * own)
    return result

"""Affine offsets of the local models (eq. 3.30-3.34): which of the fourteen can be identified.

x+ = A (x - x0) + B (u - u0), y = C (x - x0) + y0, all blended. The outputs are linear in x0 (6), u0 (2)
and y0 (6), so their Jacobian does not depend on their values, and its condition says what is redundant:

* y0 of delta_M and its rate act on nothing that is compared (Remark 4.4.1);
* for one local model all of x0 and u0 are combinations of the four other y0;
* for several, y0 of the four outputs and u0 of the torque, one force on m_M, are well determined; u0 of eta
  and x0 are nearly combinations of them (moving wire, head and masses by one length changes nothing but the
  force of the wall; the origin of the state may lie anywhere), and with all of them the Jacobian is singular
  in double precision.

What is estimated, therefore: y0 of the four outputs, and u0 of the torque where there are several models.
Everything else is fixed at zero.
"""

from __future__ import annotations

from collections.abc import Mapping
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

_ROUNDING = 1e-14
"""Singular values below this fraction of the largest count as zero."""


@dataclass(frozen=True)
class OffsetAnalysis:
    """What data can say about the offsets of M local models.

    Attributes:
        silent: Offsets that act on nothing.
        conditions: Name to condition number of the Jacobian, columns of unit length, of this offset and those
            before it in `ALL_NAMES` of all local models; infinite where a column is a combination of others.
    """

    silent: tuple[str, ...]
    conditions: Mapping[str, float]


def analyse_offsets(A: Array, B: Array, weights: Array) -> OffsetAnalysis:
    """Return which affine offsets can be told apart, from a dense Jacobian.

    Args:
        A: System matrices of the local models, (M, n, n).
        B: Input matrices, (M, n, m).
        weights: Weight of every local model at every row, (N, M).
    """
    models = len(A)
    jacobian = _jacobian(A, B, weights).reshape(-1, len(ALL_NAMES) * models)
    length = np.linalg.norm(jacobian, axis=0)
    triangle = np.asarray(np.linalg.qr(jacobian / np.where(length > 0.0, length, 1.0), mode="r"))
    silent, conditions = [], {}
    for index, name in enumerate(ALL_NAMES, start=1):
        if not length[(index - 1) * models : index * models].any():
            silent.append(name)
            continue
        values = np.linalg.svd(triangle[:, : index * models], compute_uv=False)
        conditions[name] = (
            float(values[0] / values[-1]) if values[-1] > _ROUNDING * values[0] else float("inf")
        )
    return OffsetAnalysis(tuple(silent), conditions)


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

"""Validity functions: how much each local model counts at a value of the scheduling input (thesis 3.3)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline

from fmu_builder.parameter_set import Partition
from identification.arrays import Array


def equidistant_centres(count: int, low: float, high: float) -> Array:
    """Return the centres of `count` equal cells of [low, high] (thesis Table 3.3), shape (count,)."""
    return low + (high - low) * (np.arange(count) + 0.5) / count


def equidistant_spreads(count: int, low: float, high: float) -> Array:
    """Return the widths of `count` equal cells of [low, high] (thesis Table 3.3), shape (count,)."""
    return np.full(count, (high - low) / count)


def cell_widths(centres: Sequence[float], low: float, high: float) -> Array:
    """Return the widths of the cells of [low, high] around centres, bounded half-way between two, shape (M,).

    Equidistant centres have the equal widths of `equidistant_spreads`.
    """
    c = np.asarray(centres, dtype=np.float64)
    if np.allclose(c, equidistant_centres(c.size, low, high), rtol=0.0, atol=1e-12 * (high - low)):
        return equidistant_spreads(c.size, low, high)
    return np.diff(np.array([low, *(0.5 * (c[:-1] + c[1:])), high]))


def gaussian_weights(
    positions: Array, centres: Sequence[float], spreads: Sequence[float], k_sigma: float
) -> Array:
    """Return normalised Gaussians (thesis eq. 3.10-3.11), shape (positions, M); rows sum to 1.

    Computed from the logarithms less their maximum, so that no row can become 0 / 0 far from all centres.

    Args:
        positions: Values of the scheduling input, shape (positions,).
        centres: M centres, in the same unit.
        spreads: M spreads; the standard deviation is k_sigma times the spread.
        k_sigma: See spreads.
    """
    distance = (np.asarray(positions)[:, None] - np.asarray(centres)) / (k_sigma * np.asarray(spreads))
    logarithm = -0.5 * distance**2
    bell = np.exp(logarithm - logarithm.max(axis=1, keepdims=True))
    return np.asarray(bell / bell.sum(axis=1, keepdims=True))


def hat_weights(positions: Array, centres: Sequence[float], clamped: bool) -> Array:
    """Return linear interpolation weights between the centres, shape (positions, M); rows sum to 1.

    Args:
        positions: Values of the scheduling input, shape (positions,).
        centres: M ascending centres, in the same unit.
        clamped: Whether the outer model alone counts beyond its centre; otherwise the outer lines go on, with
            weights below 0 and above 1.
    """
    x, c = np.asarray(positions, dtype=np.float64), np.asarray(centres, dtype=np.float64)
    weights = np.zeros((x.size, c.size))
    if c.size == 1:
        return weights + 1.0
    if clamped:
        x = np.clip(x, c[0], c[-1])
    cell = np.clip(np.searchsorted(c, x, side="right") - 1, 0, c.size - 2)
    share = (x - c[cell]) / (c[cell + 1] - c[cell])
    rows = np.arange(x.size)
    weights[rows, cell] = 1.0 - share
    weights[rows, cell + 1] = share
    return weights


def cubic_weights(positions: Array, centres: Sequence[float]) -> Array:
    """Return cubic interpolation weights between the centres, shape (positions, M); rows sum to 1.

    Up to four centres determine one polynomial (Lagrange: constant, line, parabola, cubic); more carry the
    cardinal functions of the not-a-knot cubic spline. The outer pieces go on beyond the outer centres.
    Weights may be negative and above 1.

    Args:
        positions: Values of the scheduling variable, shape (positions,).
        centres: M ascending centres, in the same unit.
    """
    x, c = np.asarray(positions, dtype=np.float64), np.asarray(centres, dtype=np.float64)
    if c.size == 1:
        return np.ones((x.size, 1))
    result = np.asarray(CubicSpline(c, np.eye(c.size), bc_type="not-a-knot")(x), dtype=np.float64)
    exact = x[:, None] == c
    at_centre = exact.any(axis=1)
    result[at_centre] = exact[at_centre]  # not even a rounding is left of the other models there
    return result


def warped(positions: Array, middle: float, warp: tuple[float, float]) -> Array:
    """Return e + v0 (e - middle)^2 + v1 (e - middle)^3: stretches where the local models change fast.

    Args:
        positions: e, any shape.
        middle: Middle of the range; it stays where it is.
        warp: v0 and v1.
    """
    x = np.asarray(positions, dtype=np.float64)
    d = x - middle
    return np.asarray(x + (warp[0] + warp[1] * d) * d * d)


def weights(partition: Partition, positions: Array) -> Array:
    """Return the validity of every local model at `positions`, clipped to the range, shape (positions, M)."""
    clipped = np.clip(np.asarray(positions, dtype=np.float64), *partition.range)
    if partition.validity == "gaussian":
        if partition.spreads is None or partition.k_sigma is None:
            raise ValueError("Gaussians need spreads and k_sigma")
        return gaussian_weights(clipped, partition.centres, partition.spreads, partition.k_sigma)
    if partition.validity == "cubic":
        return cubic_weights(clipped, partition.centres)
    if partition.validity == "cubic_warp":
        if partition.warp is None:
            raise ValueError("a cubic with warp needs the warp")
        middle = 0.5 * (partition.range[0] + partition.range[1])
        centres = warped(np.array(partition.centres), middle, partition.warp)
        return cubic_weights(warped(clipped, middle, partition.warp), centres.tolist())
    return hat_weights(clipped, partition.centres, clamped=partition.validity == "hat_clamped")


LARGEST_NODE_COUNT = 10_001
"""More would cost memory only: straight lines between so many nodes are off by 1e-6 of a weight."""

NODES = 81
"""Nodes of a cubic: 1/80 of the range between two of them costs 0.005 points of FIT on the pantograph's
contact force at most (61 nodes: 0.008, 41 nodes: 0.018)."""


def node_positions(partition: Partition, count: int = NODES, curved: bool = False) -> Array:
    """Return the nodes of a partition, ascending: range ends, centres, and for cubics what lies between.

    Hats are straight between the centres, so they need no more. Cubics get nodes of equal distance within
    each cell between two centres, at most range / (count - 1) apart.

    Args:
        partition: Range, centres and validity.
        count: Nodes of a cubic over the whole range, if the centres fall on them.
        curved: Whether what the weights blend is no straight line even where they are.
    """
    low, high = partition.range
    inside = [centre for centre in partition.centres if low < centre < high]
    corners = np.array([low, *inside, high])
    if not curved and partition.validity not in ("cubic", "cubic_warp"):
        return corners
    step = (high - low) / (count - 1)
    pieces = [
        np.linspace(left, right, max(1, math.ceil((right - left) / step - 1e-9)), endpoint=False)
        for left, right in pairwise(corners)
    ]
    return np.array([*np.concatenate(pieces), high])

"""Validity functions: how much each local model counts at a value of the scheduling input (thesis 3.3)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fmu_builder.parameter_set import Partition
from identification.arrays import Array


def equidistant_centres(count: int, low: float, high: float) -> Array:
    """Return the centres of `count` equal cells of [low, high] (thesis Table 3.3), shape (count,)."""
    return low + (high - low) * (np.arange(count) + 0.5) / count


def equidistant_spreads(count: int, low: float, high: float) -> Array:
    """Return the widths of `count` equal cells of [low, high] (thesis Table 3.3), shape (count,)."""
    return np.full(count, (high - low) / count)


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


def weights(partition: Partition, positions: Array) -> Array:
    """Return the validity of every local model at `positions`, clipped to the range, shape (positions, M)."""
    clipped = np.clip(np.asarray(positions, dtype=np.float64), *partition.range)
    if partition.validity == "gaussian":
        if partition.spreads is None or partition.k_sigma is None:
            raise ValueError("Gaussians need spreads and k_sigma")
        return gaussian_weights(clipped, partition.centres, partition.spreads, partition.k_sigma)
    return hat_weights(clipped, partition.centres, clamped=partition.validity == "hat_clamped")


def node_positions(partition: Partition) -> Array:
    """Return the nodes between which a partition's hats are straight: range ends and centres, ascending."""
    low, high = partition.range
    inside = [centre for centre in partition.centres if low < centre < high]
    return np.array([low, *inside, high])

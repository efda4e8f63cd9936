"""Sample covariance of stacked windows, from as few passes over the data as its shift structure allows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.linalg

from identification.arrays import Array

_CHUNK = 4096
"""Samples per matrix product: a window of them stays in the cache."""

_EIGENVALUE_FLOOR = 1e-15
"""Smallest eigenvalue of a unit-diagonal covariance that double precision can tell from zero."""


def stacked_covariance(experiments: Sequence[Array], depth: int) -> Array:
    """Return the covariance of all windows v = [w_k; w_(k+1); ...; w_(k+depth-1)] inside one experiment.

    The mean of the windows is taken off (which projects constants out), not that of the whole record.

    Only the first block row G[0, j] is summed over the data, depth products of K x K; the others follow by
    G[i+1, j+1] = G[i, j] - w_i w_j' + w_(i+N) w_(j+N)', N being the number of windows.

    Args:
        experiments: Signals w, shape (K, samples) each, samples >= depth.
        depth: Samples per window.

    Returns:
        The covariance, shape (depth * K, depth * K), symmetric; index = lag * K + channel.
    """
    channels = experiments[0].shape[0]
    total = np.zeros((depth, depth, channels, channels))
    mean = np.zeros(depth * channels)
    windows = 0
    for signals in experiments:
        count = signals.shape[1] - depth + 1
        total += _one_experiment(signals, depth, count)
        sums = np.cumsum(np.pad(signals, ((0, 0), (1, 0))), axis=1)
        mean += (sums[:, count : count + depth] - sums[:, :depth]).T.ravel()
        windows += count
    lower = np.tril_indices(depth, -1)
    total[lower] = total.transpose(1, 0, 3, 2)[lower]
    size = depth * channels
    mean /= windows
    covariance = total.transpose(0, 2, 1, 3).reshape(size, size) / windows - np.outer(mean, mean)
    return np.asarray(0.5 * (covariance + covariance.T))


def _one_experiment(signals: Array, depth: int, count: int) -> Array:
    """Return the sums G[i, j] for i <= j; the blocks below the diagonal stay zero."""
    channels = signals.shape[0]
    blocks = np.zeros((depth, depth, channels, channels))
    for first in range(0, count, _CHUNK):
        stop = min(count, first + _CHUNK)
        left = signals[:, first:stop]
        for lag in range(depth):
            blocks[0, lag] += left @ signals[:, first + lag : stop + lag].T
    leaving = np.ascontiguousarray(signals[:, :depth].T)
    entering = np.ascontiguousarray(signals[:, count : count + depth - 1].T)
    for i in range(depth - 1):
        rest = depth - 1 - i
        gone = leaving[i, :, None] * leaving[i : i + rest, None, :]
        come = entering[i, :, None] * entering[i : i + rest, None, :]
        blocks[i + 1, i + 1 :] = blocks[i, i : i + rest] - gone + come
    return blocks


def factor(covariance: Array) -> Array:
    """Return a lower triangular L with L L' = covariance, also where rounding has made it indefinite.

    Cholesky on the unit-diagonal matrix; where that fails, its eigenvalues are lifted to 1e-15 and L comes
    from a QR factorisation of the square root.

    Args:
        covariance: Symmetric, positive semi-definite up to rounding, positive diagonal, shape (n, n).
    """
    scale = np.sqrt(np.diag(covariance))
    unit = covariance / np.outer(scale, scale)
    try:
        lower = scipy.linalg.cholesky(unit, lower=True, check_finite=False)
    except scipy.linalg.LinAlgError:
        values, vectors = scipy.linalg.eigh(unit)
        root = np.sqrt(np.maximum(values, _EIGENVALUE_FLOOR))[:, None] * vectors.T
        upper = scipy.linalg.qr(root, mode="r")[0][: unit.shape[0]]
        lower = upper.T * np.where(np.diag(upper) < 0.0, -1.0, 1.0)
    return np.asarray(scale[:, None] * lower)

"""Sample covariance of stacked windows, from one pass over the data thanks to its shift structure."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.fft
import scipy.linalg

from identification.arrays import Array

_CHUNK = 4096
"""Windows per QR factorisation: few enough to stay in the cache."""

_EIGENVALUE_FLOOR = 1e-15
"""Smallest eigenvalue of a unit-diagonal covariance that double precision can tell from zero."""


class LaggedSums:
    """Sums over k of w_k w_(k+j)' of experiments, from which the covariance of any shorter window follows.

    The covariance of windows v = [w_k; w_(k+1); ...; w_(k+depth-1)] needs only its first block row G[0, j]
    from the data; the others follow by G[i+1, j+1] = G[i, j] - w_i w_j' + w_(i+N) w_(j+N)', N being the
    number of windows. The sums for all lags at once are products of discrete Fourier transforms.

    Args:
        experiments: Signals w, shape (K, samples) each.
        deepest: Samples of the longest window that will be asked for.
    """

    def __init__(self, experiments: Sequence[Array], deepest: int) -> None:
        self.experiments = experiments
        self.deepest = deepest
        self._sums = [_lagged(signals, deepest) for signals in experiments]

    def covariance(self, depth: int) -> Array:
        """Return the covariance of all windows of `depth` samples inside one experiment.

        The mean of the windows is taken off, of every experiment its own (which projects a constant per
        experiment out), not that of the whole record.

        Args:
            depth: Samples per window, at most `deepest` and the samples of the longest experiment; shorter
                experiments hold none.

        Returns:
            The covariance, shape (depth * K, depth * K), symmetric; index = lag * K + channel.
        """
        channels = self.experiments[0].shape[0]
        total = np.zeros((depth, depth, channels, channels))
        means: list[tuple[int, Array]] = []
        for signals, sums in zip(self.experiments, self._sums, strict=True):
            count = signals.shape[1] - depth + 1
            if count < 1:
                continue
            total += _blocks(signals, sums, depth)
            ends = np.cumsum(signals[:, count:], axis=1)
            starts = np.cumsum(signals[:, : depth - 1], axis=1)
            window_sums = np.repeat(signals[:, :count].sum(axis=1)[:, None], depth, axis=1)
            window_sums[:, 1:] += ends - starts
            means.append((count, window_sums.T.ravel() / count))
        lower = np.tril_indices(depth, -1)
        total[lower] = total.transpose(1, 0, 3, 2)[lower]
        size = depth * channels
        windows = sum(count for count, _ in means)
        covariance = total.transpose(0, 2, 1, 3).reshape(size, size) / windows
        for count, mean in means:
            covariance -= (count / windows) * np.outer(mean, mean)
        return np.asarray(0.5 * (covariance + covariance.T))


def stacked_covariance(experiments: Sequence[Array], depth: int) -> Array:
    """Return the covariance of all windows of `depth` samples, see `LaggedSums`."""
    return LaggedSums(experiments, depth).covariance(depth)


def _lagged(signals: Array, lags: int) -> Array:
    """Return the sums of w_k w_(k+j)' over all k for j < lags, shape (lags, K, K)."""
    channels, samples = signals.shape
    length = scipy.fft.next_fast_len(samples + lags, real=True)
    spectra = scipy.fft.rfft(signals, length, axis=1)
    result = np.empty((lags, channels, channels))
    for i in range(channels):
        products = scipy.fft.irfft(spectra[i].conj() * spectra, length, axis=1)
        result[:, i, :] = products[:, :lags].T
    return result


def _blocks(signals: Array, sums: Array, depth: int) -> Array:
    """Return the sums G[i, j] for i <= j of one experiment; the blocks below the diagonal stay zero."""
    channels, samples = signals.shape
    count = samples - depth + 1
    blocks = np.zeros((depth, depth, channels, channels))
    blocks[0] = sums[:depth]
    if depth > 1:
        blocks[0, : depth - 1] -= _lagged(signals[:, count:], depth - 1)
    leaving = np.ascontiguousarray(signals[:, :depth].T)
    entering = np.ascontiguousarray(signals[:, count:].T)
    for i in range(depth - 1):
        rest = depth - 1 - i
        row = blocks[i + 1, i + 1 :]
        np.subtract(blocks[i, i : i + rest], leaving[i, :, None] * leaving[i : i + rest, None, :], out=row)
        row += entering[i, :, None] * entering[i : i + rest, None, :]
    return blocks


def factor(covariance: Array) -> Array:
    """Return a lower triangular L with L L' = covariance, also where rounding has made it indefinite.

    Cholesky on the unit-diagonal matrix; where that fails, its eigenvalues are lifted to 1e-15 and L comes
    from a QR factorisation of the square root.

    Args:
        covariance: Symmetric, positive semi-definite up to rounding, positive diagonal, shape (n, n).
    """
    scale = np.sqrt(np.diag(covariance))
    unit = covariance / scale
    unit /= scale[:, None]
    try:
        lower = scipy.linalg.cholesky(unit, lower=True, check_finite=False)
    except scipy.linalg.LinAlgError:
        values, vectors = scipy.linalg.eigh(unit)
        root = np.sqrt(np.maximum(values, _EIGENVALUE_FLOOR))[:, None] * vectors.T
        lower = _from_upper(scipy.linalg.qr(root, mode="r")[0][: unit.shape[0]])
    return np.asarray(scale[:, None] * lower)


def factor_by_qr(experiments: Sequence[Array], depth: int, order: Array, floors: Array) -> Array:
    """Return the lower triangular L of the windows' covariance without forming it: a QR per chunk of windows.

    Twenty times slower than the covariance, without squaring its condition number.

    Args:
        experiments: Signals w, shape (K, samples) each.
        depth: Samples per window.
        order: Which entries of the window, in which order, shape (n,).
        floors: Standard deviation of white noise to be added to each of them, shape (n,).

    Returns:
        L, shape (n, n), with L L' = covariance of the chosen entries + diag(floors^2).
    """
    used = [signals for signals in experiments if signals.shape[1] >= depth]
    upper = np.zeros((0, order.size + len(used)))
    windows = 0
    for number, signals in enumerate(used):
        count = signals.shape[1] - depth + 1
        view = np.lib.stride_tricks.sliding_window_view(signals, depth, axis=1)
        for first in range(0, count, _CHUNK):
            chunk = view[:, first : first + _CHUNK].transpose(1, 2, 0).reshape(-1, depth * signals.shape[0])
            ones = np.zeros((len(chunk), len(used)))
            ones[:, number] = 1.0
            rows = np.column_stack([ones, chunk[:, order]])
            upper = scipy.linalg.qr(np.vstack([upper, rows]), mode="r", overwrite_a=True)[0]
            upper = upper[: order.size + len(used)]
        windows += count
    # a column of ones per experiment comes first: below their rows the means are gone
    kept = upper[len(used) :, len(used) :] / np.sqrt(windows)
    noise = np.diag(floors)[floors > 0.0]
    if noise.size:
        kept = scipy.linalg.qr(np.vstack([kept, noise]), mode="r")[0][: order.size]
    square = np.zeros((order.size, order.size))
    square[: len(kept)] = kept
    return _from_upper(square)


def _from_upper(upper: Array) -> Array:
    return np.asarray(upper.T * np.where(np.diag(upper) < 0.0, -1.0, 1.0))

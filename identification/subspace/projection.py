"""From windows of data to the extended observability matrix: instruments, weights, singular values.

Thesis 3.5.2, Tables 3.7 to 3.9; Van Overschee and De Moor 1996; Verhaegen and Verdult 2007, chapter 9.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from fmu_builder.errors import IdentificationError
from identification.arrays import Array
from identification.subspace.covariance import LaggedSums, factor, factor_by_qr
from identification.subspace.preparation import ScaledData, excitation, refuse_unexcited
from identification.subspace.settings import Instrument, SubspaceSettings, Weighting

_LEAST_SHOWN = 24
"""Singular values kept at least, for the rule and for a figure."""

_TINY = 1e-12
"""Smallest strength (CVA), or squared singular value over the largest, that is more than rounding ..."""

_TINY_DIFFERENCE = 1e-8
"""... and without instruments, where all of them hold the noise, over its mean."""

_NOISE_MARGIN = 2.0
"""Windows that overlap and finite data let noise reach a little beyond the edge of its spectrum."""

_CLEAR_DROP = 0.5
"""Of the largest drop: what still counts as one."""


@dataclass(frozen=True, eq=False)
class Projection:
    """Future outputs explained by the instruments, weighted and decomposed.

    Attributes:
        block_rows: s.
        outputs: p.
        singular_values: The first of them, decreasing; canonical correlations for CVA.
        strengths: Size of each direction against noise: explained over unexplained variance for CVA,
            otherwise squared singular value over the mean of those not shown.
        noise_level: Strength that white noise alone would show in so many samples (edge of the spectrum of
            independent data, with a margin).
        least_strength: Strength below which a direction is rounding.
        excitation: Smallest eigenvalue of the unit-diagonal covariance of the stacked inputs.
        directions: Columns that span the extended observability matrix, shape (s p, shown).
    """

    block_rows: int
    outputs: int
    singular_values: Array
    strengths: Array
    noise_level: float
    least_strength: float
    excitation: float
    directions: Array

    @property
    def supported(self) -> int:
        """Number of states that are more than rounding."""
        return int(np.sum(self.strengths > self.least_strength))

    def state_and_output_matrix(self, order: int) -> tuple[Array, Array]:
        """Return A with O[first rows] A = O[last rows], and C, the first block row.

        Raises:
            IdentificationError: The data do not support so many states.
        """
        if self.supported < order:
            what = f"is {order}, but the data support {self.supported} states only"
            mend = f"Lower it to {max(self.supported, 1)} or excite more"
            raise IdentificationError.of("order", what, mend)
        O = self.directions[:, :order]  # noqa: E741
        A = scipy.linalg.lstsq(O[: -self.outputs], O[self.outputs :])[0]
        return np.asarray(A), O[: self.outputs].copy()


def clear_order(strengths: Array, noise_level: float) -> tuple[int, str]:
    """Return the order that the singular values show, and why.

    Rule: strengths on a logarithmic scale, none counted below the noise level; the order is where the last
    drop ends that is at least half as high as the largest. The half keeps weak but clear states that follow a
    larger drop; the noise level keeps what only looks like a drop out.

    Args:
        strengths: Decreasing, shape (shown,).
        noise_level: Strength of pure noise.

    Raises:
        IdentificationError: Nothing is above the noise level.
    """
    levels = np.log10(np.append(np.maximum(strengths, noise_level), noise_level))
    drops = levels[:-1] - levels[1:]
    if levels[0] <= levels[-1]:
        mend = "Excite more, record longer, or give the order"
        raise IdentificationError.of("order", "is not to be seen: no singular value exceeds the noise", mend)
    order = int(np.flatnonzero(drops >= _CLEAR_DROP * drops.max())[-1]) + 1
    reason = (
        f"the last clear drop of the singular values follows it (strength {10.0 ** levels[order - 1]:.3g}, "
        f"the next {10.0 ** levels[order]:.2g}; noise alone {noise_level:.2g})"
    )
    return order, reason


def project(data: ScaledData, sums: LaggedSums, block_rows: int, settings: SubspaceSettings) -> Projection:
    """Return the decomposition for windows of s block rows.

    With the triangular factor of [U_f; Z; Y_f] (future inputs, instruments, future outputs),

        L = [L11 0 0; L21 L22 0; L31 L32 L33],

    L32 is Y_f projected on Z with U_f projected out, times (Z Pi Z')^(1/2): PI- and PO-MOESP take its left
    singular vectors; N4SID those of L32 L22^-1 [L21 L22]; CVA those of W1 L32 with
    W1^-2 = L32 L32' + L33 L33'. Without instruments (MOESP) it is [L32 L33], of windows half as long.

    Raises:
        IdentificationError: The inputs do not excite the windows.
    """
    instrument, weighting = settings.combination
    m, p = data.shape
    depth = block_rows if instrument == "none" else 2 * block_rows
    index = np.arange(depth * (m + p)).reshape(depth, m + p)
    start = depth - block_rows
    future_inputs, future_outputs = index[start:, :m].ravel(), index[start:, m:].ravel()
    past = {"none": index[:0], "past_inputs": index[:start, :m], "past": index[:start]}[instrument].ravel()
    covariance = sums.covariance(depth)
    smallest = excitation(covariance[np.ix_(index[:, :m].ravel(), index[:, :m].ravel())])
    refuse_unexcited(smallest, depth)
    order = np.concatenate([future_inputs, past, future_outputs])
    floors = np.where(order % (m + p) >= m, settings.noise_floor, 0.0)
    if settings.factorisation == "qr":
        lower = factor_by_qr(data.stacked, depth, order, floors)
    else:
        chosen = covariance[np.ix_(order, order)]
        chosen[np.diag_indices(order.size)] += floors**2
        lower = factor(chosen)
    ends = (future_inputs.size, future_inputs.size + past.size)
    weighted, row_weight = _weighted(lower, ends, instrument, weighting)
    shown = min(block_rows * p, max(_LEAST_SHOWN, 2 * _known(settings) + 4))
    squares, vectors = _strongest(weighted, shown)
    samples = data.windows(depth) - future_inputs.size
    strengths, edge, least = (
        _correlation_strengths(squares, past.size, block_rows * p, samples)
        if weighting == "cva"
        else _plain_strengths(squares, weighted, past.size, samples, settings.noise_floor)
    )
    directions = vectors * squares**0.25
    return Projection(
        block_rows,
        p,
        np.sqrt(squares),
        strengths,
        edge,
        least,
        smallest,
        directions if row_weight is None else row_weight @ directions,
    )


def _correlation_strengths(
    squares: Array, instruments: int, outputs: int, samples: int
) -> tuple[Array, float, float]:
    """Return strengths, noise level and least strength of squared canonical correlations.

    Independent variables, a N and b N of them, show squared correlations up to
    (sqrt(a (1 - b)) + sqrt(b (1 - a)))^2 (Wachter 1980).
    """
    a, b = outputs / samples, instruments / samples
    rounding = np.finfo(float).eps
    edge = (math.sqrt(a * (1.0 - b)) + math.sqrt(b * (1.0 - a))) ** 2 if a + b < 1.0 else 1.0
    level = _NOISE_MARGIN * edge / max(1.0 - edge, rounding)
    return squares / np.maximum(1.0 - squares, rounding), level, _TINY


def _plain_strengths(
    squares: Array, weighted: Array, instruments: int, samples: int, noise_floor: float
) -> tuple[Array, float, float]:
    """Return strengths, noise level and least strength of squared singular values that hold noise.

    White noise of mean 1 shows values up to (1 + sqrt(rows / columns))^2 (Marchenko and Pastur 1967).
    """
    columns = instruments or samples
    level = _NOISE_MARGIN * (1.0 + math.sqrt(len(weighted) / columns)) ** 2
    noise = max(
        _mean_of_noise(weighted, squares, level),
        noise_floor**2 * columns / samples,
        np.finfo(float).eps * float(squares[0]),
    )
    least = _TINY * float(squares[0]) / noise if instruments else 1.0 + _TINY_DIFFERENCE
    return squares / noise, level, least


def _known(settings: SubspaceSettings) -> int:
    order = settings.identified_order
    return 0 if order == "auto" else order


def _weighted(
    lower: Array, ends: tuple[int, int], instrument: Instrument, weighting: Weighting
) -> tuple[Array, Array | None]:
    """Return the matrix to decompose, and W1^-1 (None for the identity)."""
    a, b = ends
    explained, rest = lower[b:, a:b], lower[b:, b:]
    if instrument == "none":
        return rest, None
    if weighting == "moesp":
        return explained, None
    if weighting == "n4sid":
        through = scipy.linalg.solve_triangular(lower[a:b, a:b], lower[a:b, :a], lower=True)
        return np.hstack([explained @ through, explained]), None
    row_weight = factor(explained @ explained.T + rest @ rest.T)
    return scipy.linalg.solve_triangular(row_weight, explained, lower=True), row_weight


def _strongest(weighted: Array, shown: int) -> tuple[Array, Array]:
    """Return the largest squared singular values, decreasing, and their left singular vectors."""
    size = len(weighted)
    squares, vectors = scipy.linalg.eigh(weighted @ weighted.T, subset_by_index=(size - shown, size - 1))
    return np.clip(squares[::-1], 0.0, None), vectors[:, ::-1]


def _mean_of_noise(weighted: Array, squares: Array, level: float) -> float:
    """Return the mean of the squared singular values that are noise: all up to `level` times this mean.

    It starts from those beyond the strongest, from the median where these are few; without those of the
    strongest that are noise, too, it would be too small.
    """
    rows, total = len(weighted), float(np.einsum("ij,ij->", weighted, weighted))
    above = len(squares)
    mean = float(np.median(squares)) if rows - above < above else _mean_beyond(total, squares, rows)
    while above and squares[above - 1] <= level * mean:
        above = int(np.sum(squares > level * mean))
        mean = _mean_beyond(total, squares[:above], rows)
    return mean


def _mean_beyond(total: float, strongest: Array, rows: int) -> float:
    return max(total - float(strongest.sum()), 0.0) / (rows - len(strongest))

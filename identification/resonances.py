"""Resonances of a record by the discrete Fourier transform, and how they scatter over many records."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import find_peaks

from identification.arrays import Array

PROMINENCE = 0.003
"""Least prominence of a peak, of the largest entry of the whole spectrum (the mean included)."""
_DIGITS = 9


def amplitudes(values: Array) -> Array:
    """Return |DFT| of a signal at k / (N Ts), k = 0 .. N/2: no window, mean not removed.

    Args:
        values: The signal, shape (N,).
    """
    return np.abs(np.fft.rfft(values))


def highest_peak(
    spectrum: Array, bin_width: float, band: tuple[float, float], prominence: float = PROMINENCE
) -> float | None:
    """Return the frequency of the highest peak in a band, None without one of sufficient prominence.

    Args:
        spectrum: From `amplitudes`.
        bin_width: 1 / (N Ts) [Hz].
        band: Lowest and highest frequency [Hz].
        prominence: Least height above the higher of the two saddles beside it, of the largest entry.
    """
    found, _ = find_peaks(spectrum, prominence=prominence * spectrum.max())
    inside = [int(k) for k in found if band[0] <= k * bin_width <= band[1]]
    return max(inside, key=lambda k: float(spectrum[k])) * bin_width if inside else None


@dataclass(frozen=True)
class Spread:
    """Statistics of resonances over an operating range (the rows of thesis Table 2.1) [Hz].

    Attributes:
        min: The lowest.
        max: The highest.
        mean: Arithmetic mean.
        median: Half are below it.
        mode: The one found most often, the lowest of several; None where none is found twice.
    """

    min: float
    max: float
    mean: float
    median: float
    mode: float | None


def spread(frequencies: Sequence[float]) -> Spread | None:
    """Return the statistics of some frequencies [Hz], None of none."""
    if not frequencies:
        return None
    values = np.array(frequencies)
    counts = Counter(np.round(values, _DIGITS).tolist())
    most = max(counts.values())
    often = min(value for value, count in counts.items() if count == most) if most > 1 else None
    lowest, highest = float(values.min()), float(values.max())
    return Spread(lowest, highest, float(values.mean()), float(np.median(values)), often)

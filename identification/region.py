"""Where training data lie: what the limits of inputs and outputs do not say (`TrainedRegion`)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import scipy.signal

from fmu_builder.parameter_set import DerivedOutput, TrainedRegion
from identification.arrays import Array
from identification.data_set import DataSet

SHARE = 0.01
"""Of the largest spectral density: a tenth of the amplitude. Below it an input counts as not excited."""
_SEGMENTS_LOW, _SEGMENTS_HIGH = 16, 64
_FEWEST_ROWS = 16
"""Of a segment; shorter data tell no frequencies."""
_ROUNDING = 1e-9
"""Of a signal's size: what a straight line leaves behind when it is subtracted."""


def trained_region(
    training: Sequence[DataSet],
    inputs: Sequence[str],
    scheduling: str,
    sample_time: float,
    derived_outputs: Sequence[DerivedOutput] = (),
) -> TrainedRegion | None:
    """Return where data lie, None without data.

    The rate is the largest move of the scheduling input from row to row, over the sample time; derived
    outputs are worked out from inputs and outputs, with what noise these have; a band of frequencies reaches
    from the lowest to the highest of all data (`frequency_band`).

    Args:
        training: All data that a network was trained on.
        inputs: Names of its inputs.
        scheduling: Name of the scheduling input, one of them.
        sample_time: Of the network [s].
        derived_outputs: Its derived outputs.

    Raises:
        DataError: Columns are missing.
    """
    if not training:
        return None
    heights = [data.column(scheduling) for data in training]
    move = max(float(np.abs(np.diff(one)).max(initial=0.0)) for one in heights)
    spans = {one.name: _span([_derived(data, one) for data in training]) for one in derived_outputs}
    bands = {
        name: found
        for name in inputs
        if (found := _widest([frequency_band(data.column(name), data.sample_time) for data in training]))
    }
    return TrainedRegion(rate=_rate(move, sample_time), derived_outputs=spans, frequency_bands=bands)


def frequency_band(values: Array, sample_time: float) -> tuple[float, float] | None:
    """Return the lowest and highest frequency at which a signal moves, None where it does not.

    A frequency counts where the spectral density is at least `SHARE` of its largest value. The density is
    Welch's, with Hann windows over segments that overlap by half, a straight line subtracted from each, and
    the median over the segments: a slow ramp and its few turning points do not hide the small movements on
    top of it. Sixteen segments give the lowest frequency, no lower than 8.5 / (length of the data), which is
    the width of their lines; sixty-four give the highest, with less scatter and lines four times as wide.

    Args:
        values: The signal, shape (rows,).
        sample_time: Of its rows [s].
    """
    low, high = (_moved(values, sample_time, count) for count in (_SEGMENTS_LOW, _SEGMENTS_HIGH))
    if low is None:
        return None
    return float(low[0]), float(low[-1] if high is None else max(low[0], high[-1]))


def _moved(values: Array, sample_time: float, segments: int) -> Array | None:
    """Return the frequencies that count, ascending; None where there are none or the data are too short."""
    rows = 2 * len(values) // (segments + 1)
    if rows < _FEWEST_ROWS:
        return None
    frequencies, density = scipy.signal.welch(
        values, 1.0 / sample_time, nperseg=rows, detrend="linear", average="median"
    )
    frequencies, density = frequencies[1:], density[1:]
    variance, size = float(density.sum() * frequencies[0]), float(np.abs(values).max())
    if variance <= (_ROUNDING * size) ** 2:
        return None
    return np.asarray(frequencies[density >= SHARE * density.max()])


def _derived(data: DataSet, output: DerivedOutput) -> Array:
    """Return what the terms of a derived output give; a column of its name is not looked at."""
    parts = [
        term.sign * output.parameters[term.parameter].value * data.column(term.signal)
        for term in output.terms
    ]
    return np.asarray(np.sum(parts, axis=0))


def _span(columns: Sequence[Array]) -> tuple[float, float]:
    return min(float(one.min()) for one in columns), max(float(one.max()) for one in columns)


def _widest(bands: Sequence[tuple[float, float] | None]) -> tuple[float, float] | None:
    found = [band for band in bands if band is not None]
    return (min(low for low, _ in found), max(high for _, high in found)) if found else None


def _rate(move: float, sample_time: float) -> float:
    """Return the least rate that, times the sample time, is no less than the move, however it is rounded."""
    rate = move / sample_time
    while rate * sample_time < move:
        rate = math.nextafter(rate, math.inf)
    return rate

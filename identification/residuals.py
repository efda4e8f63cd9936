"""Error bands of predictions: how far a network is off on data held out of training.

By height (ranges of the scheduling input) and by frequency. The residual, model less reference, is split by
zero-phase low-passes into bands that add up to it: a band is the difference of the residual below its upper
and below its lower edge. How the model answers in amplitude and phase comes from cross spectra over short
segments, each of which stays near one height: H = S_ry / S_rr, reference r and model y, summed over the
segments and lines of a band, so that a line counts by the power of the reference in it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_HALF_EVEN, Context
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view
from pydantic import BaseModel, ConfigDict, Field, field_validator
from scipy.signal import butter, detrend, sosfiltfilt
from scipy.signal.windows import hann

from fmu_builder.errors import DataError, IdentificationError, SettingsError
from fmu_builder.kernel import simulate
from fmu_builder.parameter_set import LOWEST_BAND_EDGE, ParameterSet, ResidualBands
from identification.arrays import Array
from identification.data_set import DataSet
from identification.objective import outputs_of, refuse_other_scales
from identification.scores import AT_REST, SCORED_FRACTION

SPECIFIED = 15.0
"""The specification asks for amplitude and phase up to here [Hz]; an edge of the default bands."""
CONTACT_FORCE = "F_p"

_START_SECONDS = 5.0
"""What the start of a record leaves in a model has died out by then [s]."""
_LEAST_SECONDS = 2.0
"""Data of a height that are shorter tell nothing about it [s]."""
_SLOPE = 4
"""Order of the low-passes, which are run forwards and backwards: 6 dB down at an edge, 48 dB per octave."""
_SETTLING = 3.0
"""Periods of an edge by which a record is continued at its ends before it is filtered."""
_HOPS = 4
"""Segments begin every so-manieth of their length: Hann windows then weigh all samples alike."""
_DIGITS = 4
_PHASE_DECIMALS = 5

Ranges = npt.NDArray[np.int64]


class ResidualSettings(BaseModel):
    """How residuals on held-out data are told."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    outputs: tuple[str, ...] | None = Field(
        None, description="F_p; where there is none, the derived outputs; where there are none, the outputs"
    )
    heights: int = Field(4, ge=1, le=100, description="equal ranges of the scheduling input")
    frequencies: tuple[float, ...] = Field(
        (1.0, 5.0, SPECIFIED), description="edges between the bands [Hz]; those beyond Nyquist are left out"
    )
    coverage: float = Field(0.95, gt=0.0, lt=1.0, description="share of residuals inside a bound")
    segment: float = Field(4.0, gt=0.0, description="length of the segments of cross spectra [s]")

    @field_validator("frequencies")
    @classmethod
    def _ascend(cls, given: tuple[float, ...]) -> tuple[float, ...]:
        if any(right <= left for left, right in pairwise((0.0, *given))):
            raise ValueError("edges are positive and ascend")
        if given and given[0] < LOWEST_BAND_EDGE:
            raise ValueError(
                f"an edge below {LOWEST_BAND_EDGE:g} Hz needs records of many minutes; give higher ones"
            )
        return given


@dataclass(frozen=True)
class Inside:
    """Share of residuals inside their bounds; nan where there are no data, or no bound.

    Attributes:
        whole: Of all residuals at heights with a bound, inside that height's bound.
        total: [H] of the residuals at every height.
        bands: [H, F] of the residuals in every band.
        seconds: [H] how long the data were at every height [s].
    """

    whole: float
    total: Array
    bands: Array
    seconds: Array


def residual_bands(
    parameter_set: ParameterSet, held_out: Sequence[DataSet], settings: ResidualSettings | None = None
) -> tuple[ResidualBands, ...]:
    """Return how far a network is off on whole-range data that it was not trained on.

    The first five seconds of every record do not count, or its first quarter where that is shorter. A FIT
    leaves out the first quarter always; on a record that goes up and down once that would halve what is known
    of the heights it begins with. Bounds are rounded up to four digits.

    Args:
        parameter_set: The network; the kernel simulates it.
        held_out: Data with its inputs, and its outputs or what is wanted of them.
        settings: Outputs, heights, bands of frequency.

    Returns:
        One per output, in the order of the settings.

    Raises:
        DataError: No data, missing columns, another sample time or other units.
        SettingsError: An output that the network does not have.
        IdentificationError: A network that runs away.
    """
    chosen = settings or ResidualSettings()
    if not held_out:
        raise DataError.of("held-out data", "there are none", "Give whole-range data of the split validation")
    names = _wanted(parameter_set, chosen)
    refuse_other_scales(parameter_set, held_out)
    columns = [parameter_set.output_names.index(name) for name in names]
    heights, found = [], []
    for data in held_out:
        inputs = data.matrix(parameter_set.input_names)
        model = simulate(parameter_set, inputs)[:, columns]
        if not np.isfinite(model).all():
            mend = "Look at its warnings, or identify it from other data"
            raise IdentificationError.of(f"{parameter_set.name} on {data.name!r}", "runs away", mend)
        heights.append(inputs[:, parameter_set.scheduling_index])
        found.append((_references(parameter_set, data, names), model))
    told = [data.name for data in held_out]
    return tuple(
        _bands(parameter_set, name, heights, [(r[:, k], y[:, k]) for r, y in found], told, chosen)
        for k, name in enumerate(names)
    )


def split(signal: Array, frequencies: Sequence[float], sample_time: float) -> Array:
    """Return a signal split into bands of frequency without shifting it in time.

    Between two bands stands a Butterworth low-pass of fourth order, run forwards and backwards over the
    record, which is continued beyond its ends by its mirror image: reflected in the end points, noise on
    them would lift the whole continuation.

    Args:
        signal: Shape (rows,).
        frequencies: [F + 1] edges of the bands [Hz]; the first and the last are not looked at.
        sample_time: s.

    Returns:
        Shape (rows, F); the bands add up to the signal.
    """
    parts, below = [], np.zeros_like(signal)
    for edge in frequencies[1:-1]:
        sections = butter(_SLOPE, edge, fs=1.0 / sample_time, output="sos")
        padding = min(len(signal) - 1, round(_SETTLING / (edge * sample_time)))
        low = sosfiltfilt(sections, signal, padtype="even", padlen=padding)
        parts.append(low - below)
        below = low
    return np.column_stack([*parts, signal - below])


def counted_rows(count: int, sample_time: float) -> slice:
    """Return the rows that count, of `count` rows every `sample_time` [s]; see `residual_bands`."""
    return slice(min(round(_START_SECONDS / sample_time), int((1.0 - SCORED_FRACTION) * count)), count)


def inside(
    bands: ResidualBands, sample_time: float, scheduling: Array, reference: Array, model: Array
) -> Inside:
    """Return which share of the residuals on data lies inside the bounds, by the rules of `residual_bands`.

    Data may be sampled more slowly than the model ticks; bands that begin beyond what they can show are not
    judged.

    Args:
        bands: Bounds.
        sample_time: s.
        scheduling: The scheduling input, shape (rows,).
        reference: What the output should be, shape (rows,).
        model: What it is, shape (rows,).
    """
    rows = counted_rows(len(reference), sample_time)
    shown = sum(low < 0.5 / sample_time for low in bands.frequencies[:-1])
    parts = split(model - reference, bands.frequencies[: shown + 1], sample_time)[rows]
    where = _range_of(scheduling[rows], bands.positions)
    limits, total = _numbers(bands.bound), _numbers(bands.total)
    kept = np.abs(parts) <= limits[where, :shown]
    whole = np.abs((model - reference)[rows]) <= total[where]
    shares, totals = np.full(limits.shape, np.nan), np.full(total.shape, np.nan)
    for index in range(len(total)):
        here = where == index
        if here.any() and np.isfinite(total[index]):
            shares[index, :shown], totals[index] = kept[here].mean(axis=0), whole[here].mean()
    judged = (where >= 0) & np.isfinite(total[where])
    seconds = _seconds(where, len(total), sample_time)
    return Inside(float(whole[judged].mean()) if judged.any() else np.nan, totals, shares, seconds)


def total_bound(bands: ResidualBands, scheduling: Array) -> Array:
    """Return the bound of the whole residual at heights, nan where there is none.

    Args:
        bands: Bounds.
        scheduling: The scheduling input, shape (rows,).
    """
    where = _range_of(scheduling, bands.positions)
    return np.where(where >= 0, _numbers(bands.total)[where], np.nan)


def _wanted(parameter_set: ParameterSet, settings: ResidualSettings) -> tuple[str, ...]:
    known = parameter_set.output_names
    if settings.outputs is None:
        derived = tuple(one.name for one in parameter_set.derived_outputs)
        return (CONTACT_FORCE,) if CONTACT_FORCE in known else derived or known
    names = tuple(dict.fromkeys(settings.outputs))
    if unknown := [name for name in names if name not in known]:
        what = f"{', '.join(unknown)}: the network has no such output"
        raise SettingsError.of("residuals.outputs", what, f"Name some of {', '.join(known)}")
    return names


def _references(parameter_set: ParameterSet, data: DataSet, names: Sequence[str]) -> Array:
    """Return what outputs should be: as recorded, or computed from what is."""
    if all(name in data.names for name in names):
        return data.matrix(names)
    computed = dict(zip(parameter_set.output_names, outputs_of(parameter_set, data).T, strict=True))
    return np.column_stack([data.column(name) if name in data.names else computed[name] for name in names])


def _bands(
    parameter_set: ParameterSet,
    output: str,
    heights: Sequence[Array],
    signals: Sequence[tuple[Array, Array]],
    held_out: Sequence[str],
    settings: ResidualSettings,
) -> ResidualBands:
    """Return the bands of one output from reference and model over every record."""
    sample_time = parameter_set.sample_time
    nyquist = 0.5 / sample_time
    frequencies = (0.0, *(edge for edge in settings.frequencies if edge < nyquist), nyquist)
    positions = np.linspace(*parameter_set.partition.range, settings.heights + 1)
    rows = [counted_rows(len(height), sample_time) for height in heights]
    parts = np.concatenate(
        [split(y - r, frequencies, sample_time)[k] for (r, y), k in zip(signals, rows, strict=True)]
    )
    where = _range_of(np.concatenate([s[k] for s, k in zip(heights, rows, strict=True)]), positions)
    seconds = _seconds(where, settings.heights, sample_time)
    sizes = np.full((3, settings.heights, len(frequencies)), np.nan)  # the last column: all bands together
    for index in np.flatnonzero(seconds >= _LEAST_SECONDS):
        here = parts[where == index]
        here = np.abs(np.column_stack([here, here.sum(axis=1)]))
        sizes[0, index] = np.sqrt(np.mean(here**2, axis=0))
        sizes[1, index] = np.quantile(here, settings.coverage, axis=0, method="higher")
    response = _responses(
        [(r[k], y[k], s[k]) for (r, y), s, k in zip(signals, heights, rows, strict=True)],
        (positions, frequencies, sample_time),
        settings.segment,
    )
    response[seconds < _LEAST_SECONDS] = np.nan
    return ResidualBands(
        model_hash=parameter_set.model_hash(),
        output=output,
        positions=tuple(positions.tolist()),
        frequencies=frequencies,
        coverage=settings.coverage,
        rms=_rounded(sizes[0, :, :-1]),
        bound=_rounded(sizes[1, :, :-1], up=True),
        total=_rounded(sizes[1, :, -1:].T, up=True)[0],
        amplitude=_rounded(np.abs(response)),
        phase=_rounded(np.round(np.angle(response), _PHASE_DECIMALS) + 0.0),
        seconds=tuple(float(f"{value:.{_DIGITS}g}") for value in seconds),
        held_out=tuple(held_out),
    )


def _range_of(scheduling: Array, positions: Sequence[float] | Array) -> Ranges:
    """Return the number of the range that every height lies in, -1 outside all of them."""
    edges = np.asarray(positions, dtype=np.float64)
    found = np.searchsorted(edges, scheduling, side="right") - 1
    found[scheduling == edges[-1]] = len(edges) - 2
    found[found == len(edges) - 1] = -1
    return found.astype(np.int64)


def _seconds(where: Ranges, count: int, sample_time: float) -> Array:
    """Return how long the data are in every range [s], shape (count,)."""
    return np.bincount(where[where >= 0], minlength=count).astype(np.float64) * sample_time


def _responses(
    records: Sequence[tuple[Array, Array, Array]],
    grid: tuple[Array, Sequence[float], float],
    length: float,
) -> npt.NDArray[np.complex128]:
    """Return S_ry / S_rr by height and band, nan where no segment tells.

    Args:
        records: Reference, model and scheduling input of every record, (rows,) each.
        grid: Edges of the ranges, edges of the bands [Hz], sample time [s].
        length: Of a segment [s]. One that moves further than a range is wide belongs to no height. A straight
            line is taken off every segment: means are no matter of amplitude and phase.
    """
    positions, frequencies, sample_time = grid
    size = max(round(length / sample_time), 2)
    count = len(positions) - 1, len(frequencies) - 1
    cross, power = np.zeros(count, dtype=np.complex128), np.zeros(count)
    floor = np.zeros(count[0])
    found = np.full(count, np.nan + 0j)
    long_enough = [record for record in records if len(record[0]) >= size]
    if not long_enough:  # a segment may be of any length: nothing of its size is made before
        return found
    lines = np.fft.rfftfreq(size, sample_time)
    band_of = np.clip(np.searchsorted(frequencies, lines, side="right") - 1, 0, count[1] - 1)
    for record in long_enough:
        reference, model, height = (
            sliding_window_view(one, size)[:: max(size // _HOPS, 1)] for one in record
        )
        where = _range_of(height[:, size // 2], positions)
        where[np.ptp(height, axis=1) > positions[1] - positions[0]] = -1
        used = where >= 0
        if not used.any():
            continue
        transforms = [
            np.fft.rfft(detrend(one[used], axis=1) * hann(size, sym=False))[:, 1:]
            for one in (reference, model)
        ]
        starts = np.flatnonzero(np.diff(band_of[1:], prepend=-1))
        filled = band_of[1:][starts]
        index = where[used]
        for total, product in (
            (cross, np.conj(transforms[0]) * transforms[1]),
            (power, np.abs(transforms[0]) ** 2),
        ):
            np.add.at(total, (index[:, None], filled[None, :]), np.add.reduceat(product, starts, axis=1))
        np.add.at(floor, index, size * (AT_REST**2) * np.sum(reference[used] ** 2, axis=1))
    told = power > floor[:, None]
    found[told] = cross[told] / power[told]
    return found


def _numbers(entries: Sequence[float | None] | Sequence[Sequence[float | None]]) -> Array:
    """Return entries as numbers, nan for None."""
    return np.array(entries, dtype=np.float64)


def _rounded(values: Array, up: bool = False) -> tuple[tuple[float | None, ...], ...]:
    """Return numbers with `_DIGITS` digits, None for nan; upwards: a bound stays one."""
    context = Context(prec=_DIGITS, rounding=ROUND_CEILING if up else ROUND_HALF_EVEN)
    return tuple(
        tuple(
            float(context.create_decimal_from_float(value)) if np.isfinite(value) else None for value in row
        )
        for row in values.tolist()
    )

"""Excitation of thesis 4.2: filtered noise on the height, APRBS on the torque, two shapes of data set."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator
from scipy.signal import lfilter

from fmu_builder.errors import DataError
from identification.arrays import Array
from identification.data_set import DataSet

_NOISE_STREAM = 0
_APRBS_STREAM = 1
_MEASUREMENT_STREAM = 2
_SETTLING_TIME_CONSTANTS = 20.0


class ExcitationSettings(BaseModel):
    """The acceptance recipe: the small signals that ride on the operating point (SI units)."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    sample_time: float = Field(default=0.001, gt=0.0, description="time between two samples [s]")
    noise_rms: float = Field(
        default=0.0012, ge=0.0, description="rms of the height noise after the filter [m]"
    )
    corner_frequency: float = Field(default=10.0, gt=0.0, description="of the first-order low-pass [Hz]")
    torque: float = Field(default=1310.9, description="operating point of the torque [N.m]")
    torque_amplitude: float = Field(
        default=75.0, ge=0.0, description="APRBS levels are uniform in +- this [N.m]"
    )
    hold_minimum: float = Field(default=0.05, gt=0.0, description="shortest hold time of the APRBS [s]")
    hold_maximum: float = Field(default=0.2, gt=0.0, description="longest hold time of the APRBS [s]")

    @model_validator(mode="after")
    def _fits_together(self) -> ExcitationSettings:
        if self.hold_maximum < self.hold_minimum:
            raise ValueError("hold_maximum must not be below hold_minimum")
        if self.corner_frequency >= 0.5 / self.sample_time:
            raise ValueError("corner_frequency must be below half the sampling frequency")
        return self


ACCEPTANCE = ExcitationSettings()
"""The one recipe every quoted figure uses (noise of 1.2 mm rms, APRBS +-75 N.m held 50..200 ms)."""


def random_stream(seed: int, *key: int) -> np.random.Generator:
    """Return an independent random stream per seed and key (SeedSequence spawn keys)."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))


def filtered_noise(
    random: np.random.Generator, count: int, sample_time: float, corner_frequency: float, rms: float
) -> Array:
    """Return white Gaussian noise through a first-order low-pass, scaled to exactly `rms` after the filter.

    The filter is the zero-order-hold equivalent of 1 / (1 + s / (2 pi f)): x+ = x + a (w - x) with
    a = 1 - exp(-2 pi f Ts). It has settled before the first sample.

    Args:
        random: Where the white noise comes from.
        count: Number of samples.
        sample_time: Ts [s].
        corner_frequency: f [Hz]: the power is halved there.
        rms: Root mean square of the result, in its unit.

    Returns:
        The noise, shape (count,).
    """
    gain = -math.expm1(-2.0 * math.pi * corner_frequency * sample_time)
    settling = math.ceil(_SETTLING_TIME_CONSTANTS / gain)
    white = random.standard_normal(settling + count)
    noise: Array = lfilter([gain], [1.0, gain - 1.0], white)[settling:]
    scale = float(np.sqrt(np.mean(noise**2)))
    return noise * (rms / scale) if rms > 0.0 and count > 0 else np.zeros(count)


def aprbs(
    random: np.random.Generator,
    count: int,
    sample_time: float,
    amplitude: float,
    hold_minimum: float,
    hold_maximum: float,
) -> Array:
    """Return an amplitude-modulated pseudo-random binary sequence (thesis 4.2.1).

    Args:
        random: Where levels and hold times come from.
        count: Number of samples.
        sample_time: Ts [s].
        amplitude: Levels are uniform in [-amplitude, amplitude].
        hold_minimum: Hold times are uniform from here [s], in whole samples, at least one ...
        hold_maximum: ... to here [s]; only the last one may be cut short.

    Returns:
        The sequence, shape (count,).
    """
    shortest = max(1, round(hold_minimum / sample_time))
    longest = max(shortest, round(hold_maximum / sample_time))
    pieces = -(-count // shortest)
    holds = random.integers(shortest, longest, size=pieces, endpoint=True)
    levels = random.uniform(-amplitude, amplitude, size=pieces)
    return np.repeat(levels, holds)[:count]


def operating_point_inputs(
    height: float,
    seed: int,
    stream: tuple[int, ...] = (),
    duration: float = 42.0,
    settings: ExcitationSettings = ACCEPTANCE,
    name: str = "",
) -> DataSet:
    """Return the inputs of an operating-point (OP) data set (thesis 4.2.2, Figure 4.2).

    Args:
        height: Height of the contact wire [m].
        seed: Seed of the run.
        stream: Numbers that tell this experiment from the others of the run (split, experiment, ...).
        duration: Length [s].
        settings: Amplitudes and frequencies.
        name: Name of the data set; default from the height.

    Returns:
        A data set with the columns eta [m] and M_pa [N.m].
    """
    count = _samples(duration, settings)
    path = np.full(count, height)
    return _inputs(path, seed, stream, settings, name or f"OP {height:g} m", {"height": height})


def whole_range_inputs(
    seed: int,
    stream: tuple[int, ...] = (),
    duration: float = 120.0,
    low: float = 0.6,
    high: float = 2.4,
    settings: ExcitationSettings = ACCEPTANCE,
    name: str = "",
    slew_rate: float | None = None,
) -> DataSet:
    """Return the inputs of a whole-range (WR) data set (thesis 4.2.2, Figure 4.4).

    The height goes on one straight ramp from `low` to `high` in the first half and back in the second
    (0.03 m/s with the defaults): no steps, with clearance to the ends of the operating range; the noise rides
    on it. With a slew rate it goes up and down at that speed for as long as the data last.

    Args:
        seed: Seed of the run.
        stream: Numbers that tell this experiment from the others of the run.
        duration: Length [s].
        low: Height at start and end [m].
        high: Height in the middle [m].
        settings: Amplitudes and frequencies.
        name: Name of the data set.
        slew_rate: Speed of the ramps without the noise [m/s]; default: one way up and one down.

    Returns:
        A data set with the columns eta [m] and M_pa [N.m].

    Raises:
        DataError: The slew rate is not positive and finite, or passes the range within a sample.
    """
    count = _samples(duration, settings)
    shape = {"low": low, "high": high}
    phase: Array = np.arange(count) / count
    if slew_rate is not None:
        _refuse_slew_rate(slew_rate, high - low, settings.sample_time)
        laps = np.arange(count) * (settings.sample_time * slew_rate / (2.0 * (high - low)))
        phase = laps - np.floor(laps)
        shape["slew_rate"] = slew_rate
    path = low + (high - low) * (1.0 - np.abs(2.0 * phase - 1.0))
    return _inputs(path, seed, stream, settings, name or "WR", shape)


def _refuse_slew_rate(slew_rate: float, span: float, sample_time: float) -> None:
    fastest = span / sample_time
    if not 0.0 < slew_rate < fastest:
        mend = f"Give more than 0 m/s and less than {fastest:g} m/s, the range of heights in one sample"
        raise DataError.of("excitation", f"the slew rate {slew_rate!r} m/s", mend)


def _samples(duration: float, settings: ExcitationSettings) -> int:
    count = round(duration / settings.sample_time) if math.isfinite(duration) else 0
    if count < 1:
        raise DataError.of("excitation", f"the duration {duration!r} s", "Give at least one sample time")
    return count


def _inputs(
    path: Array,
    seed: int,
    stream: tuple[int, ...],
    settings: ExcitationSettings,
    name: str,
    shape: dict[str, Any],
) -> DataSet:
    count, step = len(path), settings.sample_time
    noise = filtered_noise(
        random_stream(seed, *stream, _NOISE_STREAM),
        count,
        step,
        settings.corner_frequency,
        settings.noise_rms,
    )
    steps = aprbs(
        random_stream(seed, *stream, _APRBS_STREAM),
        count,
        step,
        settings.torque_amplitude,
        settings.hold_minimum,
        settings.hold_maximum,
    )
    header = {"excitation": settings.model_dump(), "seed": seed, "stream": list(stream), **shape}
    values = np.column_stack([path + noise, settings.torque + steps])
    return DataSet(name, step, ("eta", "M_pa"), ("m", "N.m"), values, header)


def with_measurement_noise(
    data: DataSet, deviations: dict[str, float], seed: int, stream: tuple[int, ...] = ()
) -> DataSet:
    """Return the data set with white Gaussian noise on some columns.

    Args:
        data: What was measured without noise.
        deviations: Standard deviation per column name, in its unit.
        seed: Seed of the run.
        stream: Numbers that tell this experiment from the others of the run.

    Raises:
        DataError: A column is missing.
    """
    data.matrix(deviations)
    random = random_stream(seed, *stream, _MEASUREMENT_STREAM)
    values = data.values.copy()
    for name in data.names:
        if name in deviations:
            values[:, data.names.index(name)] += deviations[name] * random.standard_normal(len(data))
    header = {**data.header, "measurement_noise": {"seed": seed, "stream": list(stream), **deviations}}
    return DataSet(data.name, data.sample_time, data.names, data.units, values, header)

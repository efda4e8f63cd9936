"""Contact-force statistics as railway practice uses them, lost contacts one by one, and hysteresis.

Current collection is judged by few numbers (EN 50317 for measurements, EN 50318 for simulations, EN 50367 for
what is accepted): mean and standard deviation of the contact force up to 20 Hz, the two together as
statistical maximum and minimum three standard deviations away from the mean, the actual extremes, and the
share of time without contact; of lost contacts those count that last long enough to draw an arc, 5 ms.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.signal import butter, sosfiltfilt

from fmu_builder.errors import DataError
from identification.arrays import Array

BAND_LIMIT = 20.0
"""Contact forces are compared up to here [Hz]."""
SHORTEST_ARC = 0.005
"""Lost contacts from this length on count as such [s]."""
_FILTER_ORDER = 4
_LEAST_ROWS = 32


@dataclass(frozen=True)
class Loss:
    """One lost contact.

    Attributes:
        begin: First sample without contact [s].
        duration: Until the first sample with contact, or the end of the record [s].
    """

    begin: float
    duration: float

    @property
    def end(self) -> float:
        """When the contact is there again [s]."""
        return self.begin + self.duration


@dataclass(frozen=True)
class ContactStatistics:
    """What a record of the contact force comes to.

    Attributes:
        mean: [N].
        standard_deviation: [N].
        maximum: [N].
        minimum: [N].
        banded_standard_deviation: Of the force up to `BAND_LIMIT` [N].
        statistical_maximum: Mean plus three of these [N].
        statistical_minimum: Mean less three of these [N].
        loss: Share of the samples without contact [%].
        losses: How many lost contacts there are.
        long_losses: How many of them last `SHORTEST_ARC` or longer.
        mean_loss: Their mean length, all of them [s]; 0 without one.
        longest_loss: [s]; 0 without one.
    """

    mean: float
    standard_deviation: float
    maximum: float
    minimum: float
    banded_standard_deviation: float
    statistical_maximum: float
    statistical_minimum: float
    loss: float
    losses: int
    long_losses: int
    mean_loss: float
    longest_loss: float


def lost(force: Array) -> npt.NDArray[np.bool_]:
    """Return where there is no contact: nothing presses, or a bilateral contact pulls.

    Args:
        force: Contact force [N], shape (rows,).
    """
    return np.asarray(force, dtype=np.float64) <= 0.0


def contact_losses(force: Array, sample_time: float) -> tuple[Loss, ...]:
    """Return every lost contact of a record; one that is shorter than a sample may be missed.

    Args:
        force: Contact force [N], shape (rows,).
        sample_time: [s].
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[0], lost(force).view(np.int8), [0]])))
    return tuple(
        Loss(float(begin * sample_time), float((end - begin) * sample_time))
        for begin, end in zip(edges[::2], edges[1::2], strict=True)
    )


def band_limited(force: Array, sample_time: float, limit: float = BAND_LIMIT) -> Array:
    """Return a force without what is faster than `limit` [Hz], by a Butterworth filter run both ways.

    Args:
        force: Contact force [N], shape (rows,).
        sample_time: [s].
        limit: Half the power is left there after each of the two runs [Hz].

    Raises:
        DataError: The record is too short, or sampled too slowly for this limit.
    """
    if limit >= 0.5 / sample_time or len(force) < _LEAST_ROWS:
        what = f"{len(force)} samples of {sample_time:g} s cannot be filtered at {limit:g} Hz"
        raise DataError.of("contact force", what, f"Give {_LEAST_ROWS} samples or more, of a shorter time")
    sections = butter(_FILTER_ORDER, limit, fs=1.0 / sample_time, output="sos")
    filtered: Array = sosfiltfilt(sections, np.asarray(force, dtype=np.float64))
    return filtered


def contact_statistics(force: Array, sample_time: float) -> ContactStatistics:
    """Return the statistics of a record.

    Args:
        force: Contact force [N], shape (rows,).
        sample_time: [s].

    Raises:
        DataError: See `band_limited`.
    """
    mean = float(np.mean(force))
    banded = float(np.std(band_limited(force, sample_time)))
    durations = [loss.duration for loss in contact_losses(force, sample_time)]
    return ContactStatistics(
        mean=mean,
        standard_deviation=float(np.std(force)),
        maximum=float(np.max(force)),
        minimum=float(np.min(force)),
        banded_standard_deviation=banded,
        statistical_maximum=mean + 3.0 * banded,
        statistical_minimum=mean - 3.0 * banded,
        loss=100.0 * float(np.mean(lost(force))),
        losses=len(durations),
        long_losses=sum(_lasts(duration, SHORTEST_ARC) for duration in durations),
        mean_loss=float(np.mean(durations)) if durations else 0.0,
        longest_loss=max(durations, default=0.0),
    )


def _lasts(duration: float, least: float) -> bool:
    return duration >= least * (1.0 - 1e-9)  # whole samples, counted in doubles


def agreement_of_losses(reference: Array, simulated: Array) -> float:
    """Return of the time in which either is without contact the share in which both are [%].

    Args:
        reference: Contact force [N], shape (rows,).
        simulated: The same of a model.

    Returns:
        100 where the same samples are without contact, or none of either; 0 where none in common.
    """
    either = int(np.sum(lost(reference) | lost(simulated)))
    return 100.0 * float(np.sum(lost(reference) & lost(simulated))) / either if either else 100.0


def first_loss(losses: Sequence[Loss], least: float = SHORTEST_ARC) -> Loss | None:
    """Return the first lost contact that lasts `least` [s] or longer, None without one."""
    return next((loss for loss in losses if _lasts(loss.duration, least)), None)


def hysteresis_width(height: Array, force: Array, low: float, high: float) -> float:
    """Return the mean force on a falling less that on a rising wire [N].

    Args:
        height: Of the wire [m], shape (rows,): up on one straight ramp and back down in the same rows.
        force: Contact force [N], shape (rows,).
        low: Between this height ...
        high: ... and this one it counts [m].

    Raises:
        DataError: The wire does not come back the way it went, or is never between the heights.
    """
    half = len(height) // 2
    rising, falling = height[:half], height[len(height) - half :][::-1]
    middle = (rising > low) & (rising < high)
    if not middle.any() or np.abs(rising - falling).max() > 1e-9:
        what = f"the wire does not rise and fall alike through {low:g} to {high:g} m"
        raise DataError.of("hysteresis", what, "Give a ramp up and the same one back")
    gap = force[len(force) - half :][::-1] - force[:half]
    return float(np.mean(gap[middle]))

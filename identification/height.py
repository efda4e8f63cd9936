"""The current height of a pantograph from the frequencies of its modes (thesis 2.1.3).

The modes of a pantograph move with its height. Turned round, a table of modes over the height, from
linearisations or from local models, tells the height that identified modes belong to: the one whose modes
differ least from them, each difference measured by how uncertain that frequency is. A mode that hardly moves
says little and counts little by itself, since a given difference in height changes it hardly.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from fmu_builder.errors import DataError, IdentificationError, Problem
from identification.arrays import Array, read_only

_POSITIONS = 2001
_WIDER = 1.25
"""An identified frequency may lie outside a mode's range by this factor."""
_REAL = 1e-9
AMBIGUOUS = 9.0
"""Another height is possible if its cost is above the least by less than this (three standard deviations)."""


@dataclass(frozen=True, eq=False)
class ModeTable:
    """Modes of one pantograph over the height; a cubic spline in between.

    Attributes:
        heights: Ascending, shape (L,), L >= 4 [m].
        frequencies: |s| / 2 pi of every mode, rising from mode to mode, shape (L, modes) [Hz].
        dampings: -Re(s) / |s|, shape (L, modes).

    Raises:
        DataError: Shapes that do not fit, numbers that are not finite, heights or modes out of order; all at
            once.
    """

    heights: Array
    frequencies: Array
    dampings: Array

    def __post_init__(self) -> None:
        for name, axes in (("heights", 1), ("frequencies", 2), ("dampings", 2)):
            object.__setattr__(self, name, read_only(getattr(self, name), axes))
        found = []
        heights, frequencies, dampings = self.heights, self.frequencies, self.dampings
        rising = heights.size >= 4 and bool(np.all(np.diff(heights) > 0.0))
        if not rising or not np.all(np.isfinite(heights)):
            found.append(Problem("heights", "are fewer than four or not ascending", "Give ascending heights"))
        if frequencies.shape != dampings.shape or len(frequencies) != heights.size:
            what = f"have the shapes {frequencies.shape} and {dampings.shape}"
            found.append(Problem("modes", what, f"Give one row for each of the {heights.size} heights"))
        elif not (np.all(frequencies > 0.0) and np.all(dampings > 0.0) and np.all(dampings < 1.0)):
            what = "have frequencies that are not above 0 Hz or dampings that are not between 0 and 1"
            found.append(Problem("modes", what, "Give modes that oscillate and decay"))
        elif np.any(np.diff(frequencies, axis=1) <= 0.0) or not np.all(np.isfinite(frequencies)):
            what = "are not in the order of their frequencies at every height"
            found.append(Problem("modes", what, "Give modes that keep their order over the range"))
        if found:
            raise DataError(found)

    @cached_property
    def _frequency(self) -> CubicSpline:
        return CubicSpline(self.heights, self.frequencies)

    @cached_property
    def _damping(self) -> CubicSpline:
        return CubicSpline(self.heights, self.dampings)

    @property
    def modes(self) -> int:
        """Number of modes."""
        return int(self.frequencies.shape[1])

    def frequencies_at(self, heights: Array) -> Array:
        """Return the frequencies [Hz], shape (heights, modes)."""
        return np.asarray(self._frequency(heights), dtype=np.float64)

    def slopes_at(self, heights: Array) -> Array:
        """Return the sensitivities df/dh [Hz/m], shape (heights, modes)."""
        return np.asarray(self._frequency(heights, 1), dtype=np.float64)

    def deviations_at(self, heights: Array, duration: float) -> Array:
        """Return the standard deviations to expect of frequencies identified from a record.

        sigma = sqrt(zeta f / (2 pi T)): a lightly damped mode driven by noise that is not measured, from the
        asymptotic covariance of a second-order autoregression (Box and Jenkins, Time Series Analysis, 7.2),
        var(arg z) = (1 - |z|) / N as |z| approaches 1. Measured inputs make them smaller.

        Args:
            heights: Shape (heights,) [m].
            duration: T of the record [s].

        Returns:
            [Hz], shape (heights, modes).
        """
        damping = np.asarray(self._damping(heights), dtype=np.float64)
        deviation: Array = np.sqrt(damping * self.frequencies_at(heights) / (2.0 * np.pi * duration))
        return deviation

    def height_deviations(
        self, heights: Array, duration: float, modes: NDArray[np.bool_] | None = None
    ) -> Array:
        """Return the standard deviation to expect of a height, 1 / sqrt(sum ((df/dh) / sigma)^2) [m].

        It is infinite where no mode moves: there the height cannot be told.

        Args:
            heights: Shape (heights,) [m].
            duration: T of the record [s].
            modes: Which modes are used, shape (modes,); default all.
        """
        share = (self.slopes_at(heights) / self.deviations_at(heights, duration)) ** 2
        used = np.ones(self.modes, dtype=np.bool_) if modes is None else modes
        with np.errstate(divide="ignore"):
            return np.asarray(1.0 / np.sqrt(share[:, used].sum(axis=1)))

    def named(self, poles: NDArray[np.complex128], sample_time: float) -> Array:
        """Return the frequency of every mode of the table in an identified model, NaN where it has none.

        The least damped pole of a mode's range, widened, is the mode; the ranges of two modes meet at the
        geometric mean of their ends.

        Args:
            poles: Of the model in the z plane, any number.
            sample_time: Ts [s].

        Returns:
            [Hz], shape (modes,).
        """
        s = np.log(poles[poles.imag > _REAL]) / sample_time
        frequency, damping = np.abs(s) / (2.0 * np.pi), -s.real / np.abs(s)
        low, high = self.frequencies.min(axis=0), self.frequencies.max(axis=0)
        middle = np.sqrt(np.maximum(high[:-1], low[1:]) * np.minimum(high[:-1], low[1:]))
        lower = np.maximum(low / _WIDER, np.r_[0.0, middle])
        upper = np.minimum(high * _WIDER, np.r_[middle, np.inf])
        found = np.full(self.modes, np.nan)
        for mode in range(self.modes):
            inside = np.flatnonzero((frequency >= lower[mode]) & (frequency < upper[mode]))
            if inside.size:
                found[mode] = frequency[inside[np.argmin(damping[inside])]]
        return found


@dataclass(frozen=True)
class HeightEstimate:
    """What the modes say of the height.

    Attributes:
        height: The most likely [m].
        deviation: Its standard deviation if the frequencies have those expected [m]; infinite where no mode
            moves.
        cost: Sum of the squared differences of the frequencies over their standard deviations.
        others: Further heights that explain the frequencies nearly as well, best first [m].
        at_end: Whether it is an end of the table: the height may lie beyond.
    """

    height: float
    deviation: float
    cost: float
    others: tuple[float, ...]
    at_end: bool


def height_from_modes(table: ModeTable, frequencies: Array, duration: float) -> HeightEstimate:
    """Return the height in the table whose modes are nearest to identified ones.

    The cost sum ((f - f(h)) / sigma(h))^2, sigma by `ModeTable.deviations_at`, is looked at over the whole
    table, so paths that turn round are allowed; every minimum of it is refined.

    Args:
        table: Modes over the height.
        frequencies: Identified ones, NaN for a mode that was not found, shape (modes,) [Hz].
        duration: Length of the record they are from [s].

    Raises:
        IdentificationError: Another number of modes, none found, or a duration that is not above zero.
    """
    given = np.asarray(frequencies, dtype=np.float64)
    seen = np.isfinite(given)
    if given.shape != (table.modes,) or not seen.any() or not duration > 0.0:
        what = f"{int(seen.sum())} finite of {given.shape} frequencies, from {duration} s"
        mend = f"Give {table.modes} frequencies, one of them finite, and a duration above zero"
        raise IdentificationError.of("height from modes", what, mend)

    def cost(heights: Array) -> Array:
        away = (given - table.frequencies_at(heights)) / table.deviations_at(heights, duration)
        return np.asarray((away[:, seen] ** 2).sum(axis=1))

    grid = np.linspace(table.heights[0], table.heights[-1], _POSITIONS)
    costs = cost(grid)
    padded = np.r_[np.inf, costs, np.inf]
    least = np.flatnonzero((costs <= padded[:-2]) & (costs < padded[2:]))
    minima = []
    for k in least.tolist():
        bounds = (grid[max(k - 1, 0)], grid[min(k + 1, _POSITIONS - 1)])
        result = minimize_scalar(
            lambda h: float(cost(np.array([h]))[0]), bounds=bounds, method="bounded", options={"xatol": 1e-9}
        )
        minima.append(min((float(result.fun), float(result.x)), (float(costs[k]), float(grid[k]))))
    minima.sort()
    (lowest, height), others = minima[0], minima[1:]
    deviation = float(table.height_deviations(np.array([height]), duration, seen)[0])
    possible = tuple(other for value, other in others if value < lowest + AMBIGUOUS)
    return HeightEstimate(height, deviation, lowest, possible, height in (grid[0], grid[-1]))

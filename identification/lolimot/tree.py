"""The local linear model tree: cells of the partition space, halved where the network errs most."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from identification.arrays import Array
from identification.lolimot.regression import weighted_least_squares


@dataclass(frozen=True, eq=False)
class Cells:
    """Hyper-rectangles that fill the partition space.

    Attributes:
        low: Lower corners, shape (M, d).
        high: Upper corners, shape (M, d).
    """

    low: Array
    high: Array

    @property
    def centres(self) -> Array:
        """Middles of the cells, shape (M, d)."""
        return np.asarray(0.5 * (self.low + self.high))

    @property
    def widths(self) -> Array:
        """Widths of the cells, shape (M, d)."""
        return self.high - self.low

    def weights(self, places: Array, k_sigma: float) -> Array:
        """Return normalised Gaussians, shape (N, M); rows sum to 1 (thesis eq. 3.10-3.11).

        From the logarithms less their maximum, so that no row can become 0 / 0 far from all centres.

        Args:
            places: Points of the partition space; what lies outside is clipped to it, shape (N, d).
            k_sigma: Standard deviation over width.
        """
        inside = np.clip(places, self.low.min(axis=0), self.high.max(axis=0))
        logarithm = np.zeros((len(inside), len(self.low)))
        for centre, width, z in zip(self.centres.T, self.widths.T, inside.T, strict=True):
            logarithm -= 0.5 * ((z[:, None] - centre) / (k_sigma * width)) ** 2
        bell = np.exp(logarithm - logarithm.max(axis=1, keepdims=True))
        return np.asarray(bell / bell.sum(axis=1, keepdims=True))

    def rows_in(self, places: Array, index: int) -> npt.NDArray[np.bool_]:
        """Return which places lie in a cell, those on an edge in both, shape (N,)."""
        return np.asarray(((places >= self.low[index]) & (places <= self.high[index])).all(axis=1))

    def halved(self, index: int, axis: int) -> Cells:
        """Return the cells with one of them halved across an axis: the upper half comes last."""
        low, high = np.vstack([self.low, self.low[index]]), np.vstack([self.high, self.high[index]])
        high[index, axis] = low[-1, axis] = self.centres[index, axis]
        return Cells(low, high)


@dataclass(frozen=True)
class Growth:
    """One stage of the tree.

    Attributes:
        models: Number of local models.
        loss: Mean squared error of the one-step prediction of training data.
        axis: Which axis was halved to get here; None for the first model.
        place: Where on that axis.
    """

    models: int
    loss: float
    axis: int | None = None
    place: float | None = None


@dataclass(frozen=True, eq=False)
class _Stage:
    """Cells with their local models, fitted one by one.

    Attributes:
        cells: M cells.
        parameters: Their models, shape (M, r).
        predictions: Of the local models, shape (N, M).
        losses: Sum of weighted squared errors of the network by local model, shape (M,).
    """

    cells: Cells
    parameters: Array
    predictions: Array
    losses: Array

    @property
    def loss(self) -> float:
        """Sum of squared errors."""
        return float(self.losses.sum())


@dataclass(frozen=True, eq=False)
class Grower:
    """Grows a tree on fixed data.

    Attributes:
        columns: Regressors, shape (N, r).
        target: What they shall predict, shape (N,).
        places: Where each row lies in the partition space, shape (N, d).
        k_sigma: Standard deviation over width.
    """

    columns: Array
    target: Array
    places: Array
    k_sigma: float

    def grow(
        self, low: Array, high: Array, most_models: int, least_gain: float
    ) -> tuple[Cells, Array, tuple[Growth, ...]]:
        """Return cells, their models (M, r), and how the tree grew (Nelles 2001, section 13.3.1).

        From one model on, the cell with the largest share in the error is halved across the axis where that
        helps most; the other local models stay as they are. A half needs as many rows as there are
        regressors; where a half has fewer, the cell with the next largest share is halved.

        Args:
            low: Lower corner of the partition space, shape (d,).
            high: Upper corner, shape (d,).
            most_models: Where to stop.
            least_gain: Share of the error that a split must save.
        """
        stage = self._fitted(Cells(low[None, :], high[None, :]), None, ())
        history = [Growth(1, stage.loss / len(self.target))]
        while len(stage.parameters) < most_models:
            best: tuple[_Stage, Growth] | None = None
            for index in np.argsort(-stage.losses, kind="stable"):
                for axis in self._axes(stage.cells, int(index)):
                    tried = self._split(stage, int(index), axis)
                    if best is None or tried.loss < best[0].loss:
                        middle = float(stage.cells.centres[index, axis])
                        loss = tried.loss / len(self.target)
                        best = tried, Growth(len(tried.parameters), loss, axis, middle)
                if best is not None:
                    break
            if best is None or best[0].loss > (1.0 - least_gain) * stage.loss:
                break
            stage = best[0]
            history.append(best[1])
        order = np.lexsort(stage.cells.centres.T[::-1])
        cells = Cells(stage.cells.low[order], stage.cells.high[order])
        return cells, stage.parameters[order], tuple(history)

    def _axes(self, cells: Cells, index: int) -> Iterator[int]:
        """Yield the axes across which a cell can be halved."""
        for axis in range(self.places.shape[1]):
            halves = cells.halved(index, axis)
            counts = [int(halves.rows_in(self.places, one).sum()) for one in (index, -1)]
            if min(counts) >= self.columns.shape[1]:
                yield axis

    def _split(self, stage: _Stage, index: int, axis: int) -> _Stage:
        cells = stage.cells.halved(index, axis)
        return self._fitted(cells, stage, (index, len(stage.parameters)))

    def _fitted(self, cells: Cells, before: _Stage | None, anew: tuple[int, ...]) -> _Stage:
        """Return the stage of some cells: the models of `anew`, or all, by local weighted least squares."""
        shares = cells.weights(self.places, self.k_sigma)
        count = shares.shape[1]
        parameters = np.empty((count, self.columns.shape[1]))
        predictions = np.empty((len(self.target), count))
        if before is not None:
            parameters[:-1], predictions[:, :-1] = before.parameters, before.predictions
        for index in anew if before is not None else range(count):
            parameters[index] = weighted_least_squares(self.columns, self.target, shares[:, index])
            predictions[:, index] = self.columns @ parameters[index]
        error = self.target - np.einsum("ki,ki->k", shares, predictions)
        return _Stage(cells, parameters, predictions, error**2 @ shares)

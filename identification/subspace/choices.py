"""Order and block rows from the data, each with the reason."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from fmu_builder.errors import IdentificationError
from identification.choice import Choice
from identification.subspace.covariance import LaggedSums
from identification.subspace.preparation import ScaledData, least_block_rows
from identification.subspace.projection import Projection, clear_order, project
from identification.subspace.regression import Regression, fit_inputs
from identification.subspace.settings import SubspaceSettings
from identification.subspace.stability import refuse_unstable

LADDER = (5, 7, 10, 14, 20, 28, 35, 50, 70, 100, 140)
"""Block rows compared: steps of about 1.4."""

PILOT = 50
"""Block rows at which the order is read and the search begins, if the data allow."""

_GAIN = 1e-3
"""Relative fall of the error for which the search goes on."""

_LARGEST_MATRIX = 1300
"""Rows of the matrix to factorise beyond which a window is not looked at: a tenth of a second."""

_UNUSABLE = math.inf


@dataclass(frozen=True, eq=False)
class Chosen:
    """What is identified from, and why.

    Attributes:
        projection: The decomposition at the chosen block rows.
        seen: The decomposition that the order was read from; `projection` where the order was given.
        order: States of the model.
        search: Pairs of block rows and simulation error (infinite: no usable model), as they were compared.
        choices: The automatic ones, by the settings that override them.
    """

    projection: Projection
    seen: Projection
    order: int
    search: tuple[tuple[int, float], ...]
    choices: tuple[Choice, ...]


def choose(data: ScaledData, settings: SubspaceSettings) -> Chosen:
    """Return order and block rows, from the settings or else from the data.

    Order: `projection.clear_order` at the given block rows, or at 50 (fewer where the data do not hold twice
    as many, or the inputs do not excite them).

    Block rows: for that order, models from windows of increasing length (50, 70, 100, ... rows) are simulated
    over the training data until the error no longer falls by 0.1 %; the smallest error wins. All models have
    equally many parameters, so that no second data set is needed.

    Raises:
        IdentificationError: Not exciting, no order to be seen, or no usable model at any length.
    """
    known = settings.least_order if settings.order == "auto" else settings.order
    given = settings.block_rows
    lengths = candidates(data, known, settings) if given == "auto" else [given]
    windows = _Windows(data, settings, max(lengths))
    made: list[Choice] = []
    seen = None
    if settings.order == "auto":
        order, reason, seen = _automatic_order(windows, lengths, settings)
        made.append(Choice("order", order, reason))
    else:
        order = settings.order
    if given != "auto":
        projection = windows.at(given)
        return Chosen(projection, seen or projection, order, (), tuple(made))
    least = least_block_rows(max(order, settings.high_order or 0), data.shape[1])
    projection, search = _search(windows, [s for s in lengths if s >= least] or [least], order)
    made.append(Choice("block_rows", projection.block_rows, _reason(search)))
    return Chosen(projection, seen or projection, order, tuple(search), tuple(made))


def candidates(data: ScaledData, order: int, settings: SubspaceSettings) -> list[int]:
    """Return the block rows that the data, the order and the time to compute allow, increasing."""
    m, p = data.shape
    least = least_block_rows(max(order, settings.high_order or 0), p)
    largest = min(data.most_block_rows, max(_LARGEST_MATRIX // (2 * (m + p)), least))
    return [s for s in LADDER if least <= s <= largest] or [max(least, min(largest, PILOT))]


def simulation_error(data: ScaledData, result: Regression) -> float:
    """Return the rms of all simulated outputs' errors over their standard deviation."""
    pairs = zip(data.outputs, result.simulated, strict=True)
    total = sum(float(np.sum((y - yhat) ** 2)) for y, yhat in pairs)
    return math.sqrt(total / (data.rows * data.shape[1]))


class _Windows:
    """Decompositions for windows of any length up to a longest one; each is computed once."""

    def __init__(self, data: ScaledData, settings: SubspaceSettings, longest: int) -> None:
        self.data = data
        self.settings = settings
        self._sums = LaggedSums(data.stacked, 2 * longest)
        self._known: dict[int, Projection] = {}

    def at(self, block_rows: int) -> Projection:
        """Return the decomposition; raises IdentificationError where the inputs do not excite so many."""
        if block_rows not in self._known:
            self._known[block_rows] = project(self.data, self._sums, block_rows, self.settings)
        return self._known[block_rows]

    def error(self, block_rows: int, order: int) -> float:
        """Return the simulation error; raises IdentificationError where there is no stable model."""
        A, C = self.at(block_rows).state_and_output_matrix(order)
        refuse_unstable(A)
        data = self.data
        return simulation_error(data, fit_inputs(A, C, data.inputs, data.outputs, self.settings.feed_through))


def _automatic_order(
    windows: _Windows, lengths: list[int], settings: SubspaceSettings
) -> tuple[int, str, Projection]:
    """Return order, reason, and the decomposition it was read from."""
    refusals: list[_Refusal] = []
    # windows that fill the data leave nothing to tell states from noise
    roomy = min(PILOT, windows.data.most_block_rows // 2)
    for block_rows in [s for s in lengths if s <= roomy][::-1] or lengths[:1]:
        try:
            seen = windows.at(block_rows)
        except IdentificationError as refused:
            refusals.append((block_rows, refused))
            continue
        order, why = clear_order(seen.strengths, seen.noise_level)
        most = (block_rows - 1) * seen.outputs
        if settings.high_order is not None:
            most = min(most, settings.high_order - 1)
        if order < settings.least_order:
            why = f"not below least_order; the singular values show {order}: {why}"
            order = settings.least_order
        if order > most:
            return most, f"as many as high_order and {block_rows} block rows leave of {order}", seen
        return order, why, seen
    raise _all_refused(refusals[-1], refusals)  # the shortest windows ask least of the data


def _search(windows: _Windows, lengths: list[int], order: int) -> tuple[Projection, list[tuple[int, float]]]:
    """Return the best decomposition: from 50 block rows up; shorter ones only where those give no model."""
    longer, shorter = [s for s in lengths if s >= PILOT], [s for s in lengths if s < PILOT][::-1]
    search: list[tuple[int, float]] = []
    smallest = _UNUSABLE
    refusals: list[_Refusal] = []
    for s in [*longer, *shorter]:
        if s < PILOT and smallest < _UNUSABLE and longer:
            break
        try:
            error = windows.error(s, order)
        except IdentificationError as refused:
            error = _UNUSABLE
            refusals.append((s, refused))
        search.append((s, error))
        enough = smallest < _UNUSABLE and error >= (1.0 - _GAIN) * smallest
        smallest = min(smallest, error)
        if enough:
            break
    if smallest == _UNUSABLE:
        raise _all_refused(refusals[0], refusals)
    return windows.at(min(search, key=lambda item: item[1])[0]), search


_Refusal = tuple[int, IdentificationError]
"""Block rows and why they were refused."""


def _all_refused(shown: _Refusal, refusals: list[_Refusal]) -> IdentificationError:
    """Return why one of the windows was refused, and which others were no better."""
    block_rows, refused = shown
    others = sorted({other for other, _ in refusals} - {block_rows})
    tried = f" with {block_rows} block rows"
    tried += f", nor better with {', '.join(map(str, others))}" if others else ""
    return IdentificationError([replace(one, what=one.what + tried) for one in refused.problems])


def _reason(search: list[tuple[int, float]]) -> str:
    if len(search) == 1:
        return "the only length that the data and the order allow"
    compared = ", ".join(
        f"{s}: {100.0 * error:.4g} %" if error < _UNUSABLE else f"{s}: no stable model" for s, error in search
    )
    return f"smallest simulation error on the training data ({compared})"

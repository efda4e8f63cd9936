"""How good a simulated signal is, and the records that scores.json holds."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from fmu_builder.errors import DataError, Problem
from identification.arrays import Array

SCORED_FRACTION = 0.75
"""The last 75 % of the samples count: the start says more about initial values than about the model."""

AT_REST = 1e-12
"""Variation of a signal over its size that is rounding only: such a signal has no FIT."""

FIELDS = (
    "wbm", "model", "llms", "blending", "offsets", "validity", "alignment", "schedule", "structure", "route",
    "order", "data_set", "noise", "seed", "split", "signal", "fit", "max_error", "recommended",
)  # fmt: skip
"""The fields of a record, in this order; those that do not apply are None."""

RECOMMENDED_KEY = ("wbm", "model", "llms", "blending", "data_set", "noise", "seed", "split", "signal")
"""Exactly one record per value of these fields is the recommended one."""


def scored_rows(count: int) -> slice:
    """Return the rows that count, of `count` (thesis Remark 4.6.6)."""
    return slice(count - math.ceil(SCORED_FRACTION * count), count)


def fit_percent(reference: Array, simulated: Array) -> float:
    """Return FIT = 100 (1 - |y - yhat|_2 / |y - mean(y)|_2) [%] on the last 75 % of the samples (thesis 4.6).

    Args:
        reference: y, shape (rows,).
        simulated: yhat, shape (rows,).

    Returns:
        100 for equal signals, minus infinity where the simulation is not finite.

    Raises:
        DataError: Other shapes, or a reference that is constant (FIT is not defined).
    """
    y, yhat = _scored(reference, simulated)
    spread = float(np.linalg.norm(y - y.mean()))
    if not moves(y):
        raise DataError.of("FIT", "the reference signal is constant", "Score signals that move")
    with np.errstate(over="ignore", invalid="ignore"):
        value = 100.0 * (1.0 - float(np.linalg.norm(y - yhat)) / spread)
    return value if math.isfinite(value) else -math.inf


def moves(signals: Array) -> npt.NDArray[np.bool_]:
    """Return whether signals vary by more than rounding.

    Args:
        signals: One column per signal, shape (rows, signals), or one signal, shape (rows,).

    Returns:
        Shape (signals,), or () for one signal.
    """
    y = np.asarray(signals, dtype=np.float64)
    spread = np.linalg.norm(y - y.mean(axis=0), axis=0)
    return np.asarray(spread > AT_REST * np.linalg.norm(y, axis=0))


def max_error(reference: Array, simulated: Array) -> float:
    """Return max |y - yhat| on the last 75 % of the samples, in the unit of the signal.

    Raises:
        DataError: Other shapes.
    """
    y, yhat = _scored(reference, simulated)
    with np.errstate(over="ignore", invalid="ignore"):
        value = float(np.max(np.abs(y - yhat)))
    return value if math.isfinite(value) else math.inf


def _scored(reference: Array, simulated: Array) -> tuple[Array, Array]:
    y, yhat = np.asarray(reference, dtype=np.float64), np.asarray(simulated, dtype=np.float64)
    if y.ndim != 1 or y.shape != yhat.shape or y.size == 0:
        what = f"signals of the shapes {y.shape} and {yhat.shape}"
        raise DataError.of("FIT", what, "Give two signals of one length")
    rows = scored_rows(y.size)
    return y[rows], yhat[rows]


def records(
    reference: Array, simulated: Array, signals: Sequence[str], labels: Mapping[str, Any]
) -> list[dict[str, Any]]:
    """Return one record per signal.

    Args:
        reference: What it should be, shape (rows, signals).
        simulated: What the model says, same shape.
        signals: Their names.
        labels: Values of the other fields; those not given are None.

    Raises:
        DataError: Labels that are no field of a record, or other shapes.
    """
    unknown = sorted(set(labels) - set(FIELDS) | ({"signal", "fit", "max_error"} & set(labels)))
    if unknown:
        raise DataError.of("scores", f"unknown labels {', '.join(unknown)}", f"Use {', '.join(FIELDS)}")
    if np.shape(reference) != np.shape(simulated) or np.shape(reference)[1:] != (len(signals),):
        what = f"shapes {np.shape(reference)} and {np.shape(simulated)} for {len(signals)} signals"
        raise DataError.of("scores", what, "Give one column per signal")
    found = []
    for index, signal in enumerate(signals):
        y, yhat = reference[:, index], simulated[:, index]
        fit = fit_percent(y, yhat) if moves(y[scored_rows(y.size)]) else -math.inf
        entry = {**dict.fromkeys(FIELDS), **labels, "signal": signal}
        entry["fit"] = fit if math.isfinite(fit) else None
        worst = max_error(y, yhat)
        entry["max_error"] = worst if math.isfinite(worst) else None
        entry["recommended"] = bool(entry["recommended"])
        found.append(entry)
    return found


def recommendation_problems(scored: Iterable[Mapping[str, Any]]) -> list[Problem]:
    """Return a problem for every group of records without exactly one recommended record."""
    counts: dict[tuple[Any, ...], int] = {}
    for entry in scored:
        key = tuple(entry[name] for name in RECOMMENDED_KEY)
        counts[key] = counts.get(key, 0) + bool(entry["recommended"])
    mend = "Mark exactly one record of them"
    return [
        Problem("scores " + ", ".join(map(str, key)), f"{count} recommended records", mend)
        for key, count in counts.items()
        if count != 1
    ]

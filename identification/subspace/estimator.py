"""Subspace identification with CVA weighting (thesis 3.5; Van Overschee and De Moor 1996, Larimore 1990)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg
from pydantic import BaseModel, ConfigDict, Field

from fmu_builder.errors import IdentificationError, Problem
from identification.arrays import Array
from identification.data_set import DataSet
from identification.local_model import LocalModel
from identification.scores import scored_rows
from identification.subspace.covariance import factor, stacked_covariance
from identification.subspace.regression import Regression, fit_inputs

_EXCITED = 1e-13
"""Smallest eigenvalue of the unit-diagonal covariance of stacked inputs that still counts as exciting."""

_IDENTIFIABLE = 1e-6
"""Smallest canonical correlation that double precision can tell from zero."""


class SubspaceSettings(BaseModel):
    """Settings of the estimator."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    order: int = Field(default=6, ge=1, description="number of states n")
    block_rows: int = Field(default=50, ge=2, description="length s of past and future windows [samples]")
    noise_floor: float = Field(
        default=1e-3,
        ge=0.0,
        le=1.0,
        description="white output noise the windows are assumed to hold, relative to each signal's std",
    )
    # it leaves the model of a linear plant unchanged and keeps the weighting defined on noise-free data
    feed_through: bool = Field(default=False, description="whether D is estimated; zero otherwise")


@dataclass(frozen=True)
class _Scaled:
    """Experiments as deviations from their common mean, in units of their standard deviation."""

    inputs: list[Array]
    outputs: list[Array]
    input_mean: Array
    output_mean: Array
    input_scale: Array
    output_scale: Array


def estimate(
    experiments: Sequence[DataSet],
    inputs: Sequence[str],
    outputs: Sequence[str],
    settings: SubspaceSettings | None = None,
) -> LocalModel:
    """Return the local linear model of one operating point.

    1. Means removed (they are the operating point), signals scaled by their standard deviation.
    2. Covariance of stacked past and future windows; future outputs are projected on the past, the future
       inputs projected out, and weighted to canonical correlations (CVA): the strongest n directions span the
       extended observability matrix.
    3. C is its first block row, A solves its shift invariance.
    4. B (and D), the initial states and what the means leave of the output operating point by least squares
       on the simulated output.

    Args:
        experiments: Data sets of the same signals at the same operating point.
        inputs: Names of the m inputs.
        outputs: Names of the p outputs.
        settings: Settings; default `SubspaceSettings()`.

    Returns:
        The model. Its diagnostics: `canonical_correlations` (the first of them), `training_fit` [%] per
        output, `spectral_radius`, `rows`.

    Raises:
        DataError: Columns are missing.
        IdentificationError: Data too short, constant or not exciting, order not identifiable, unstable
            result.
    """
    chosen = settings or SubspaceSettings()
    scaled = _scaled(experiments, inputs, outputs, chosen)
    observability, correlations = _observability(scaled, chosen)
    A, C = _shift_invariance(observability, len(outputs))
    _refuse_unstable(A, chosen)
    result = fit_inputs(A, C, scaled.inputs, scaled.outputs, chosen.feed_through)
    diagnostics = {
        "canonical_correlations": correlations.tolist(),
        "training_fit": _training_fit(scaled, result),
        "rows": sum(len(data) for data in experiments),
    }
    return _unscaled(
        A, C, result, scaled, experiments[0].sample_time, tuple(inputs), tuple(outputs), diagnostics
    )


def _scaled(
    experiments: Sequence[DataSet], inputs: Sequence[str], outputs: Sequence[str], settings: SubspaceSettings
) -> _Scaled:
    found = _usable(experiments, inputs, outputs, settings)
    if found:
        raise IdentificationError(found)
    u = [data.matrix(inputs) for data in experiments]
    y = [data.matrix(outputs) for data in experiments]
    u_all, y_all = np.concatenate(u), np.concatenate(y)
    u_mean, y_mean = u_all.mean(axis=0), y_all.mean(axis=0)
    u_scale, y_scale = u_all.std(axis=0), y_all.std(axis=0)
    names, means, scales = (*inputs, *outputs), (*u_mean, *y_mean), (*u_scale, *y_scale)
    for name, mean, scale in zip(names, means, scales, strict=True):
        if not scale > 1e-12 * abs(mean):
            mend = "Excite it, or leave it out of the model"
            found.append(Problem(f"signal {name!r}", "is constant in the training data", mend))
    if found:
        raise IdentificationError(found)
    return _Scaled(
        [np.ascontiguousarray(((one - u_mean) / u_scale).T) for one in u],
        [np.ascontiguousarray(((one - y_mean) / y_scale).T) for one in y],
        u_mean,
        y_mean,
        u_scale,
        y_scale,
    )


def _usable(
    experiments: Sequence[DataSet], inputs: Sequence[str], outputs: Sequence[str], settings: SubspaceSettings
) -> list[Problem]:
    found = []
    if not experiments or not inputs or not outputs:
        what = f"{len(experiments)} experiments, {len(inputs)} inputs, {len(outputs)} outputs"
        return [Problem("subspace identification", what, "Give at least one of each")]
    steps = {data.sample_time for data in experiments}
    if len(steps) > 1:
        what = f"the experiments have the sample times {', '.join(f'{step:g} s' for step in sorted(steps))}"
        found.append(Problem("subspace identification", what, "Resample them to one"))
    channels, depth = len(inputs) + len(outputs), 2 * settings.block_rows
    needed = depth * (channels + 1)
    for data in experiments:
        if len(data) < needed:
            what = f"has {len(data)} rows, {needed} are needed for {settings.block_rows} block rows"
            found.append(Problem(f"data set {data.name!r}", what, "Record longer, or lower block_rows"))
    limit = (settings.block_rows - 1) * len(outputs)
    if settings.order > limit:
        what = f"is {settings.order}, at most {limit} can be told from {settings.block_rows} block rows"
        found.append(Problem("order", what, "Lower the order, or raise block_rows"))
    return found


def _observability(scaled: _Scaled, settings: SubspaceSettings) -> tuple[Array, Array]:
    """Return the extended observability matrix, shape (s p, n), and the canonical correlations."""
    s, m, p = settings.block_rows, len(scaled.input_mean), len(scaled.output_mean)
    stacked = [np.vstack(pair) for pair in zip(scaled.inputs, scaled.outputs, strict=True)]
    covariance = stacked_covariance(stacked, 2 * s)
    index = np.arange(2 * s * (m + p)).reshape(2 * s, m + p)
    future_inputs, past = index[s:, :m].ravel(), index[:s].ravel()
    future_outputs, all_outputs = index[s:, m:].ravel(), index[:, m:].ravel()
    _refuse_unexcited(covariance[np.ix_(index[:, :m].ravel(), index[:, :m].ravel())], settings)
    covariance[all_outputs, all_outputs] += settings.noise_floor**2
    order = np.concatenate([future_inputs, past, future_outputs])
    lower = factor(covariance[np.ix_(order, order)])
    a, b = s * m, s * m + s * (m + p)
    on_past, rest = lower[b:, a:b], lower[b:, b:]
    weight = factor(on_past @ on_past.T + rest @ rest.T)
    weighted = scipy.linalg.solve_triangular(weight, on_past, lower=True)
    size = s * p
    shown = min(size, 2 * settings.order + 4)
    squares, vectors = scipy.linalg.eigh(weighted @ weighted.T, subset_by_index=(size - shown, size - 1))
    correlations = np.sqrt(np.clip(squares[::-1], 0.0, None))
    supported = int(np.sum(correlations > _IDENTIFIABLE))
    if supported < settings.order:
        what = f"is {settings.order}, but the data support {supported} states only"
        raise IdentificationError.of("order", what, f"Lower it to {max(supported, 1)} or excite more")
    chosen = slice(0, settings.order)
    directions = vectors[:, ::-1][:, chosen] * np.sqrt(correlations[chosen])
    return weight @ directions, correlations


def _refuse_unexcited(inputs: Array, settings: SubspaceSettings) -> None:
    scale = np.sqrt(np.diag(inputs))
    smallest = float(scipy.linalg.eigvalsh(inputs / np.outer(scale, scale), subset_by_index=(0, 0))[0])
    if smallest < _EXCITED:
        what = (
            f"do not excite {2 * settings.block_rows} samples in a row (smallest eigenvalue {smallest:.1e})"
        )
        mend = "Use inputs with noise or steps at random times, independent of each other"
        raise IdentificationError.of("inputs", what, mend)


def _shift_invariance(observability: Array, outputs: int) -> tuple[Array, Array]:
    """Return A with O[first rows] A = O[last rows], and C, the first block row."""
    A = scipy.linalg.lstsq(observability[:-outputs], observability[outputs:])[0]
    return np.asarray(A), observability[:outputs].copy()


def _refuse_unstable(A: Array, settings: SubspaceSettings) -> None:
    radius = float(np.max(np.abs(np.linalg.eigvals(A))))
    if not radius < 1.0:
        what = f"comes out unstable at order {settings.order} (largest |pole| {radius:.6f})"
        mend = "Record longer, raise block_rows or change the order"
        raise IdentificationError.of("identified model", what, mend)


def _training_fit(scaled: _Scaled, result: Regression) -> list[float]:
    """Return FIT [%] per output on the last 75 % of every training experiment, initial states fitted."""
    rows = [scored_rows(y.shape[1]) for y in scaled.outputs]
    y = np.concatenate([one[:, row] for one, row in zip(scaled.outputs, rows, strict=True)], axis=1)
    yhat = np.concatenate([one[:, row] for one, row in zip(result.simulated, rows, strict=True)], axis=1)
    spread = np.linalg.norm(y - y.mean(axis=1, keepdims=True), axis=1)
    fits: list[float] = (100.0 * (1.0 - np.linalg.norm(y - yhat, axis=1) / spread)).tolist()
    return fits


def _unscaled(
    A: Array,
    C: Array,
    result: Regression,
    scaled: _Scaled,
    sample_time: float,
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    diagnostics: dict[str, Any],
) -> LocalModel:
    size = scaled.output_scale[:, None]
    model = LocalModel(
        A,
        result.B / scaled.input_scale,
        C * size,
        result.D * size / scaled.input_scale,
        sample_time,
        inputs,
        outputs,
        scaled.input_mean,
        scaled.output_mean + result.offset * scaled.output_scale,
        diagnostics,
    )
    diagnostics["spectral_radius"] = model.spectral_radius
    return model

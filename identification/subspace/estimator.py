"""Subspace identification of a local linear model (thesis 3.5; Van Overschee and De Moor 1996)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fmu_builder.errors import IdentificationError, Problem
from identification.arrays import Array
from identification.choice import Choice
from identification.data_set import DataSet
from identification.local_model import LocalModel
from identification.scores import moves, scored_rows
from identification.subspace.choices import Chosen, choose, simulation_error
from identification.subspace.preparation import ScaledData, prepared
from identification.subspace.reduction import balanced_reduction
from identification.subspace.regression import Regression, fit_inputs
from identification.subspace.settings import SubspaceSettings
from identification.subspace.stability import reflected, refuse_unstable
from identification.warning import IdentificationWarning, poor_fits

UNCERTAIN_INPUT, UNKNOWN_INPUT = 0.1, 1.0
"""Of the outputs' standard deviation: what an uncertain input may add to the error before a warning is due,
and from where on, if other inputs are to blame, the model would say nothing about that input."""

ENTANGLED = 3.0
"""How much larger standard errors have to be than without the other inputs for these to be to blame (the root
of a variance inflation factor of about 10)."""


def estimate(
    experiments: Sequence[DataSet],
    inputs: Sequence[str],
    outputs: Sequence[str],
    settings: SubspaceSettings | None = None,
) -> LocalModel:
    """Return the local linear model of one operating point.

    1. Means removed, of every experiment its own (all together they are the operating point); signals scaled
       by their standard deviation.
    2. Future outputs explained by instruments from the past, future inputs projected out, weighted: the
       strongest n directions span the extended observability matrix (`projection`). Window length and order
       are chosen from the data unless given (`choices`).
    3. C is its first block row, A solves its shift invariance.
    4. If asked for, poles are reflected into the unit circle, and a model of high order is reduced in
       balanced coordinates; only A and C of the reduced model are used.
    5. B (and D), the initial states and what the means leave of the output operating point, a constant per
       experiment, by least squares on the simulated output.

    Args:
        experiments: Data sets of the same signals at the same operating point.
        inputs: Names of the m inputs.
        outputs: Names of the p outputs.
        settings: Settings; default `SubspaceSettings()`.

    Returns:
        The model. Its diagnostics: `choices` (the automatic ones: `Choice.record`),
        `method`, `instrument`, `weighting`, `order`, `block_rows`, `singular_values` (the first of those that
        the order was read from; for CVA canonical correlations), `strengths` (of each, against noise; see
        `projection`), `noise_level` (what noise alone would show) and `seen_block_rows` (of these windows),
        `excitation` (eq. 3.71), `block_row_search` (block rows and simulation errors compared),
        `warnings` (what makes the model doubtful: `IdentificationWarning.record`), `input_errors` (of the
        outputs' std, from the standard errors of each input's B: `Regression.input_errors`),
        `hankel_singular_values` (after a reduction), `training_fit` [%] per output, `simulation_error` (rms
        over the std of the outputs), `spectral_radius`, `rows`, `input_scale`, `output_scale`.

    Raises:
        DataError: Columns are missing.
        IdentificationError: Data too short, constant or not exciting, order not identifiable, unstable
            result, inputs that moved too much together for the noise.
    """
    wanted = settings or SubspaceSettings()
    data = prepared(experiments, inputs, outputs, wanted)
    chosen = choose(data, wanted)
    A, C, found = _matrices(data, chosen, wanted)
    result = fit_inputs(A, C, data.inputs, data.outputs, wanted.feed_through)
    _refuse_unknown_inputs(inputs, result)
    diagnostics = _diagnostics(data, chosen, wanted, result) | found
    return _unscaled(A, C, result, data, len(inputs), diagnostics)


def _uncertain_inputs(
    inputs: Sequence[str], result: Regression, limit: float, entangled: bool
) -> list[Problem]:
    """Return a problem per input whose effect is uncertain, because of other inputs or for another reason."""
    found = []
    errors = zip(inputs, result.input_errors.tolist(), result.untangled_errors.tolist(), strict=True)
    for name, error, untangled in errors:
        if error > limit and (error > ENTANGLED * untangled) == entangled:
            what = (
                f"what it does alone is uncertain by {100.0 * error:.3g} % of the outputs' standard "
                f"deviation (standard errors of B), above {100.0 * limit:g} %"
            )
            mend = "Move the inputs independently of each other, or leave one out"
            other = "Record longer, with less noise, or look for an integrator or a nonlinear plant"
            found.append(Problem(f"input {name!r}", what, mend if entangled else other))
    return found


def _refuse_unknown_inputs(inputs: Sequence[str], result: Regression) -> None:
    """Refuse inputs that cannot be told from others.

    Raises:
        IdentificationError: Names every such input.
    """
    if found := _uncertain_inputs(inputs, result, UNKNOWN_INPUT, entangled=True):
        raise IdentificationError(found)


def _warnings(
    inputs: Sequence[str], result: Regression, fits: Mapping[str, float | None]
) -> list[IdentificationWarning]:
    """Return what makes a local model doubtful."""
    found = [
        IdentificationWarning(one.place, one.what, one.mend)
        for entangled in (True, False)
        for one in _uncertain_inputs(inputs, result, UNCERTAIN_INPUT, entangled)
    ]
    mend = "Look for noise, drift, an integrator or a plant that is not linear here, or change the order"
    return found + poor_fits("", fits, mend)


def _matrices(
    data: ScaledData, chosen: Chosen, settings: SubspaceSettings
) -> tuple[Array, Array, dict[str, Any]]:
    """Return A and C, and what reduction and stabilisation add to the diagnostics."""
    choices = list(chosen.choices)
    found: dict[str, Any] = {}
    # a pole that decays by less than 1 / e over all rows cannot be told from one on the circle
    largest = 1.0 - 1.0 / data.rows
    A, C = chosen.projection.state_and_output_matrix(settings.high_order or chosen.order)
    if settings.high_order is not None:
        A, moved = reflected(A, largest)
        if moved:
            reason = (
                f"{moved} of {settings.high_order} poles reflected into the unit circle "
                "before the reduction, which needs a stable model"
            )
            choices.append(Choice("high_order", settings.high_order, reason))
        high = fit_inputs(A, C, data.inputs, data.outputs, settings.feed_through)
        reduced = balanced_reduction(A, high.B, C, high.D, chosen.order, settings.reduction)
        A, C = reduced.A, reduced.C
        values = reduced.hankel_singular_values
        found["hankel_singular_values"] = values.tolist()
        found["high_order_simulation_error"] = simulation_error(data, high)
    if settings.stabilisation == "reflect":
        A, moved = reflected(A, largest)
        if moved:
            reason = f"{moved} of {len(A)} poles reflected into the unit circle, as asked for"
            choices.append(Choice("stabilisation", "reflect", reason))
    refuse_unstable(A)
    found["choices"] = [choice.record() for choice in choices]
    return A, C, found


def _diagnostics(
    data: ScaledData, chosen: Chosen, settings: SubspaceSettings, result: Regression
) -> dict[str, Any]:
    projection, seen = chosen.projection, chosen.seen
    instrument, weighting = settings.combination
    m, fits = data.shape[0], _training_fit(data, result)
    warnings = _warnings(data.names[:m], result, dict(zip(data.names[m:], fits, strict=True)))
    depth = projection.block_rows * (1 if instrument == "none" else 2)
    return {
        "method": settings.method,
        "instrument": instrument,
        "weighting": weighting,
        "order": chosen.order,
        "block_rows": projection.block_rows,
        "block_row_search": [list(item) for item in chosen.search],
        "singular_values": seen.singular_values.tolist(),
        "strengths": seen.strengths.tolist(),
        "noise_level": seen.noise_level,
        "seen_block_rows": seen.block_rows,
        "excitation": {
            "smallest_eigenvalue": projection.excitation,
            "samples_in_a_row": depth,
            "rank": chosen.order + projection.block_rows * m,
        },
        "training_fit": fits,
        "warnings": [one.record() for one in warnings],
        "input_errors": result.input_errors.tolist(),
        "simulation_error": simulation_error(data, result),
        "rows": data.rows,
        "input_scale": data.input_scale.tolist(),
        "output_scale": data.output_scale.tolist(),
    }


def _training_fit(data: ScaledData, result: Regression) -> list[float | None]:
    """Return FIT [%] per output on the last 75 % of every training experiment, initial states fitted.

    It is None where an output has come to rest by then.
    """
    rows = [scored_rows(y.shape[1]) for y in data.outputs]
    y = np.concatenate([one[:, row] for one, row in zip(data.outputs, rows, strict=True)], axis=1)
    yhat = np.concatenate([one[:, row] for one, row in zip(result.simulated, rows, strict=True)], axis=1)
    spread = np.linalg.norm(y - y.mean(axis=1, keepdims=True), axis=1)
    errors = np.linalg.norm(y - yhat, axis=1)
    return [
        100.0 * (1.0 - float(error / size)) if move else None
        for error, size, move in zip(errors, spread, moves(y.T), strict=True)
    ]


def _unscaled(
    A: Array, C: Array, result: Regression, data: ScaledData, inputs: int, diagnostics: dict[str, Any]
) -> LocalModel:
    size = data.output_scale[:, None]
    model = LocalModel(
        A,
        result.B / data.input_scale,
        C * size,
        result.D * size / data.input_scale,
        data.sample_time,
        data.names[:inputs],
        data.names[inputs:],
        data.input_mean,
        data.output_mean + data.shares @ result.offsets * data.output_scale,
        diagnostics,
    )
    diagnostics["spectral_radius"] = model.spectral_radius
    return model

"""One set of state coordinates for all local models, so that their matrices can be blended."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.linalg

from fmu_builder.errors import IdentificationError, Problem
from identification.arrays import Array
from identification.local_model import LocalModel

HORIZON = 50
"""Samples over which outputs are compared: 50 ms at 1 kHz, best of 10, 50, 100 and 300 on a 3 Hz plant."""


def observability(model: LocalModel, horizon: int, output_scale: Array) -> Array:
    """Return O = [C; C A; ...; C A^(horizon-1)] rows divided by the output scale, shape (horizon p, n)."""
    row = model.C / output_scale[:, None]
    rows = []
    for _ in range(horizon):
        rows.append(row)
        row = row @ model.A
    return np.concatenate(rows)


def aligned(
    models: Sequence[LocalModel],
    output_scale: Array,
    horizon: int = HORIZON,
    reference: int | None = None,
) -> list[LocalModel]:
    """Return the models in the state coordinates of one of them.

    The states of model i become T_i x with T_i = pinv(O_ref) O_i: the state of the reference model whose free
    outputs over the horizon are nearest, in the least-squares sense, to those of x in model i. Nothing is
    matched by hand: no modes, no signs, and only the coordinates of the reference have an influence. It makes
    blending of matrices meaningful only where zero states mean the same physical situation (offsets
    "scheduled_equilibrium").

    Args:
        models: Local models of one order and the same outputs.
        output_scale: Size of each output (standard deviation), shape (p,).
        horizon: Samples compared.
        reference: Index of the model that keeps its coordinates; default the middle one.

    Raises:
        IdentificationError: Orders or outputs differ, states that outputs do not show.
    """
    chosen = len(models) // 2 if reference is None else reference
    base = models[chosen]
    found = []
    for index, model in enumerate(models):
        if (model.order, model.outputs) != (base.order, base.outputs):
            what = f"has {model.order} states and outputs {', '.join(model.outputs)}"
            mend = f"Identify all with {base.order} states and outputs {', '.join(base.outputs)}"
            found.append(Problem(f"local model {index + 1}", what, mend))
    if found:
        raise IdentificationError(found)
    target = observability(base, horizon, output_scale)
    result = []
    for index, model in enumerate(models):
        if index == chosen:
            result.append(model)
            continue
        transform = scipy.linalg.lstsq(target, observability(model, horizon, output_scale))[0]
        if not np.linalg.cond(transform) < 1.0 / np.finfo(float).eps:
            what = f"has states that the outputs do not show within {horizon} samples"
            mend = "Lower the order or raise the alignment horizon"
            raise IdentificationError.of(f"local model {index + 1}", what, mend)
        result.append(model.transformed(transform))
    return result

"""One set of state coordinates for all local models, so that their matrices can be blended."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

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
    _refuse_differences(models, base)
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


def modal_aligned(
    models: Sequence[LocalModel], output_scale: Array, reference: int | None = None
) -> list[LocalModel]:
    """Return the models in real modal form, mode by mode matched to one of them (thesis 4.5, automated).

    Modes are ordered: complex pairs by frequency, then real poles by size. A mode's eigenvector is defined up
    to a complex factor (a real one for a real pole); it is chosen so that the mode's row of C, over all
    outputs, is nearest to that of the same mode of the reference, which takes out sign, phase and scale.

    Args:
        models: Local models of one order and the same outputs.
        output_scale: Size of each output (standard deviation), shape (p,).
        reference: Index of the model whose modal form the others follow; default the middle one.

    Raises:
        IdentificationError: Orders, outputs or the number of real poles differ; poles that coincide.
    """
    chosen = len(models) // 2 if reference is None else reference
    _refuse_differences(models, models[chosen])
    modes = [_modes(model, output_scale) for model in models]
    base = modes[chosen]
    found = []
    for index, mode in enumerate(modes):
        if mode.pairs != base.pairs:
            what = f"has {mode.pairs} complex pairs of poles, the reference {base.pairs}"
            mend = "Use the alignment 'observability', which needs no modes"
            found.append(Problem(f"local model {index + 1}", what, mend))
    if found:
        raise IdentificationError(found)
    result = []
    for model, mode in zip(models, modes, strict=True):
        seen = np.sum(np.conj(mode.rows) * base.rows, axis=0) / np.sum(np.abs(mode.rows) ** 2, axis=0)
        seen[mode.pairs :] = seen[mode.pairs :].real
        vectors = mode.vectors * seen
        columns = [part for v in vectors.T[: mode.pairs] for part in (v.real, v.imag)]
        columns += [v.real for v in vectors.T[mode.pairs :]]
        basis = np.column_stack(columns)
        if not np.linalg.cond(basis) < 1.0 / np.finfo(float).eps:
            what = "has modes that the outputs do not show, or poles that coincide"
            raise IdentificationError.of("modal alignment", what, "Use the alignment 'observability'")
        result.append(model.transformed(np.linalg.inv(basis)))
    return result


Alignment = Literal["observability", "modal", "none"]
"""Ways to common state coordinates; "modal" and "none" are for comparison."""


def in_common_coordinates(
    models: Sequence[LocalModel], method: Alignment, output_scale: Array, horizon: int = HORIZON
) -> list[LocalModel]:
    """Return the models in common coordinates by a method, "none" leaving them as they are.

    Args:
        models: Local models of one order and the same outputs.
        method: See `aligned` and `modal_aligned`.
        output_scale: Size of each output (standard deviation), shape (p,).
        horizon: Samples compared; "observability" only.

    Raises:
        IdentificationError: Models that cannot be brought together that way.
    """
    if method == "none":
        return list(models)
    if method == "modal":
        return modal_aligned(models, output_scale)
    return aligned(models, output_scale, horizon)


class _Modes(NamedTuple):
    """Ordered eigenvectors, one per complex pair and real pole, and what the scaled outputs see of them."""

    vectors: NDArray[np.complex128]
    rows: NDArray[np.complex128]
    pairs: int


def _modes(model: LocalModel, output_scale: Array) -> _Modes:
    poles, vectors = np.linalg.eig(model.A)
    upper, real = np.flatnonzero(poles.imag > 0.0), np.flatnonzero(poles.imag == 0.0)
    order = [*upper[np.argsort(np.abs(np.log(poles[upper])))], *real[np.argsort(poles[real].real)]]
    chosen = vectors[:, order].astype(np.complex128)
    return _Modes(chosen, (model.C / output_scale[:, None]) @ chosen, upper.size)


def _refuse_differences(models: Sequence[LocalModel], base: LocalModel) -> None:
    found = []
    for index, model in enumerate(models):
        if (model.order, model.outputs) != (base.order, base.outputs):
            what = f"has {model.order} states and outputs {', '.join(model.outputs)}"
            mend = f"Identify all with {base.order} states and outputs {', '.join(base.outputs)}"
            found.append(Problem(f"local model {index + 1}", what, mend))
    if found:
        raise IdentificationError(found)

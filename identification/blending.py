"""Blends of local models: every matrix and vector as the weighted sum over the models."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fmu_builder.parameter_set import LocalLinearModel, nested
from identification.arrays import Array


def stacked(parts: Sequence[LocalLinearModel]) -> dict[str, Array]:
    """Return matrices and vectors of M local models by name, shape (M, ...), without those they do not have.

    Args:
        parts: M local models of one size.
    """
    entries = {name: [getattr(part, name) for part in parts] for name in LocalLinearModel.model_fields}
    return {
        name: np.array(values, dtype=np.float64) for name, values in entries.items() if None not in values
    }


def blended(stack: Mapping[str, Array], shares: Array) -> dict[str, Array]:
    """Return sum_i w_i of every matrix and vector, shape (rows, ...), summed in the order of the models.

    Args:
        stack: Local models as `stacked` returns them.
        shares: Weights w, shape (rows, M).
    """
    result = {}
    for name, entries in stack.items():
        total = np.zeros((len(shares), *entries.shape[1:]))
        for column, entry in zip(shares.T, entries, strict=True):
            total += column.reshape(-1, *(1,) * entry.ndim) * entry
        result[name] = total
    return result


def as_parts(models: Mapping[str, Array]) -> tuple[LocalLinearModel, ...]:
    """Return stacked models one by one, as a parameter set holds them."""
    count = len(models["A"])
    fields: list[dict[str, Any]] = [{name: nested(a[k]) for name, a in models.items()} for k in range(count)]
    return tuple(LocalLinearModel(**one) for one in fields)


def in_coordinates(stack: Mapping[str, Array], transforms: Array) -> dict[str, Array]:
    """Return local models in the state coordinates T_i x, each with its own T_i.

    Args:
        stack: Local models about a state at rest of zero, that is without affine vectors.
        transforms: T, shape (M, n, n), invertible.
    """
    inverse = np.linalg.inv(transforms)
    result = dict(stack)
    result["A"] = transforms @ stack["A"] @ inverse
    result["B"] = transforms @ stack["B"]
    result["C"] = stack["C"] @ inverse
    if "g" in stack:
        result["g"] = (transforms @ stack["g"][:, :, None])[:, :, 0]
    return result

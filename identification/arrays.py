"""The one array type of this room."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]


def read_only(values: object, dimensions: int) -> Array:
    """Return a C-ordered float64 copy of `values` that nobody can write to.

    Args:
        values: Anything numpy turns into numbers.
        dimensions: The number of axes it must have.

    Raises:
        ValueError: Not numbers, or another number of axes.
    """
    array = np.array(values, dtype=np.float64, order="C")
    if array.ndim != dimensions:
        raise ValueError(f"{dimensions} axes are needed, not {array.ndim}")
    array.setflags(write=False)
    return array

"""Unstable poles of an identified model: refused, or reflected into the unit circle."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from fmu_builder.errors import IdentificationError
from identification.arrays import Array


def spectral_radius(A: Array) -> float:
    """Return the largest |pole|."""
    return float(np.max(np.abs(np.linalg.eigvals(A))))


def refuse_unstable(A: Array) -> None:
    """Refuse a state matrix with poles on or outside the unit circle.

    Raises:
        IdentificationError: It has.
    """
    radius = spectral_radius(A)
    if not radius < 1.0:
        what = f"comes out unstable at order {len(A)} (largest |pole| {radius:.6f})"
        mend = 'Record longer, raise block_rows, change the order, or set stabilisation = "reflect"'
        raise IdentificationError.of("identified model", what, mend)


def reflected(A: Array, largest: float) -> tuple[Array, int]:
    """Return A with every pole p of |p| > largest moved to p / |p|^2, or to `largest` where that is smaller.

    The diagonal blocks of the real Schur form are scaled, so that nothing depends on eigenvectors and all
    other poles stay where they are.

    Args:
        A: State matrix, shape (n, n).
        largest: Largest |pole| allowed, below 1.

    Returns:
        The matrix, and how many poles were moved.
    """
    form, basis = scipy.linalg.schur(A, output="real")
    moved, i, n = 0, 0, len(A)
    while i < n:
        size = 2 if i + 1 < n and form[i + 1, i] != 0.0 else 1
        block = slice(i, i + size)
        radius = float(np.sqrt(abs(np.linalg.det(form[block, block])))) if size == 2 else abs(form[i, i])
        if radius > largest:
            form[block, block] *= min(1.0 / radius, largest) / radius
            moved += size
        i += size
    return (basis @ form @ basis.T if moved else A), moved

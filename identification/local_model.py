"""A local linear model (LLM): discrete state space about an operating point."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmu_builder.errors import IdentificationError, Problem
from identification.arrays import Array, read_only

_BLOCK = 64


@dataclass(frozen=True, eq=False)
class LocalModel:
    """x+ = A x + B (u - u_op), y = y_op + C x + D (u - u_op).

    Attributes:
        A: State matrix, shape (n, n).
        B: Input matrix, shape (n, m).
        C: Output matrix, shape (p, n).
        D: Feed-through, shape (p, m).
        sample_time: Ts [s].
        inputs: Names of the m inputs.
        outputs: Names of the p outputs.
        input_operating_point: u_op, shape (m,).
        output_operating_point: y_op, shape (p,).
        diagnostics: What the estimator says about it (anything JSON can hold).

    Raises:
        IdentificationError: Shapes that do not fit or numbers that are not finite; all at once.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    sample_time: float
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    input_operating_point: Array
    output_operating_point: Array
    diagnostics: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n, m, p = np.shape(self.A)[0], len(self.inputs), len(self.outputs)
        shapes: dict[str, tuple[int, ...]] = {"A": (n, n), "B": (n, m), "C": (p, n), "D": (p, m)}
        shapes |= {"input_operating_point": (m,), "output_operating_point": (p,)}
        found = []
        for name, shape in shapes.items():
            given = np.asarray(getattr(self, name), dtype=np.float64)
            if given.shape != shape:
                what = f"has the shape {given.shape}, not {shape}"
                found.append(Problem(f"local model, {name}", what, "Give matrices that fit together"))
            elif not np.all(np.isfinite(given)):
                found.append(Problem(f"local model, {name}", "is not finite", "Give finite numbers"))
            else:
                object.__setattr__(self, name, read_only(given, len(shape)))
        if found:
            raise IdentificationError(found)

    @property
    def order(self) -> int:
        """Number of states n."""
        return int(self.A.shape[0])

    @cached_property
    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of A in the z plane, shape (n,)."""
        return np.linalg.eigvals(self.A).astype(np.complex128)

    @property
    def spectral_radius(self) -> float:
        """Largest |pole|; below 1 the model is stable."""
        return float(np.max(np.abs(self.poles))) if self.order else 0.0

    @property
    def dc_gain(self) -> Array:
        """Static gain C (I - A)^-1 B + D, shape (p, m)."""
        gain: Array = self.C @ np.linalg.solve(np.eye(self.order) - self.A, self.B) + self.D
        return gain

    def frequency_response(self, frequencies: Array) -> NDArray[np.complex128]:
        """Return G(e^(j 2 pi f Ts)), shape (frequencies, p, m).

        Args:
            frequencies: f [Hz], shape (frequencies,).
        """
        z = np.exp(2j * np.pi * np.asarray(frequencies) * self.sample_time)
        resolvent = z[:, None, None] * np.eye(self.order) - self.A
        right = np.broadcast_to(self.B, (z.size, *self.B.shape)).astype(np.complex128)
        return np.asarray(self.C @ np.linalg.solve(resolvent, right) + self.D, dtype=np.complex128)

    def transformed(self, transform: Array) -> LocalModel:
        """Return the same model in the coordinates T x: A <- T A T^-1, B <- T B, C <- C T^-1.

        Args:
            transform: T, shape (n, n), invertible.
        """
        inverse = np.linalg.inv(transform)
        return replace(self, A=transform @ self.A @ inverse, B=transform @ self.B, C=self.C @ inverse)

    def simulate(self, inputs: Array, initial_state: Array | None = None) -> Array:
        """Return the outputs for a whole input sequence; row k is read after inputs row k is set.

        Args:
            inputs: u, absolute (the operating point is subtracted here), shape (rows, m).
            initial_state: x of row 0, shape (n,); default zero, the operating point.

        Returns:
            The outputs, absolute, shape (rows, p).
        """
        deviation = np.asarray(inputs, dtype=np.float64) - self.input_operating_point
        start = np.zeros(self.order) if initial_state is None else np.asarray(initial_state)
        states = simulated_states(self.A, deviation @ self.B.T, start)
        return self.output_operating_point + states @ self.C.T + deviation @ self.D.T


def simulated_states(A: Array, drive: Array, start: Array) -> Array:
    """Return x_0 .. x_(N-1) of x_(k+1) = A x_k + v_k.

    The recursion runs over blocks of rows (a few matrix products per block) instead of over rows.

    Args:
        A: State matrix, shape (n, n).
        drive: v, shape (N, n).
        start: x_0, shape (n,).
    """
    rows, n = drive.shape
    count = -(-rows // _BLOCK)
    # work[b, k] ends as x of row b * _BLOCK + k: first the response of every block from rest ...
    work = np.zeros((count, _BLOCK + 1, n))
    padded = np.zeros((count * _BLOCK, n))
    padded[:rows] = drive
    blocks = padded.reshape(count, _BLOCK, n)
    powers = np.empty((_BLOCK + 1, n, n))
    powers[0] = np.eye(n)
    for k in range(_BLOCK):
        work[:, k + 1] = work[:, k] @ A.T + blocks[:, k]
        powers[k + 1] = A @ powers[k]
    # ... then the free response of the state each block starts from
    starts = np.empty((count, n))
    state = start
    for b in range(count):
        starts[b] = state
        state = powers[_BLOCK] @ state + work[b, _BLOCK]
    free = (starts @ powers[:_BLOCK].transpose(2, 0, 1).reshape(n, -1)).reshape(count, _BLOCK, n)
    result: Array = (work[:, :_BLOCK] + free).reshape(-1, n)[:rows]
    return result

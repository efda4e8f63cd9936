"""Responses of a linear model in modal coordinates: their Gram matrix costs one pass over the data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from identification.arrays import Array

Complex = NDArray[np.complex128]

_WORST_EIGENVECTORS = 1e7
"""Condition number of the eigenvectors beyond which A counts as defective."""

_GONE = 1e-30
"""A decay this small is zero: what is left of it would only be slow, denormal numbers."""


@dataclass(frozen=True, eq=False)
class ModalForm:
    """Modes of Im p >= 0: x = basis z, z = (Re g, -Im g) or, for real poles, g, of g+ = p g + b u.

    Attributes:
        poles: p, shape (modes,).
        readings: What output o reads of mode k: y_o = sum_k Re(c_ok g_k), shape (p, modes).
        parts: Which mode each of the n real coordinates belongs to, shape (n,).
        imaginary: Which coordinates are those of imaginary parts, shape (n,).
        basis: State coordinates, shape (n, n).
    """

    poles: Complex
    readings: Complex
    parts: NDArray[np.intp]
    imaginary: NDArray[np.bool_]
    basis: Array


def modal_form(A: Array, C: Array) -> ModalForm | None:
    """Return the modes of A, or None where its eigenvectors are (nearly) dependent."""
    poles, vectors = np.linalg.eig(A)
    if not np.linalg.cond(vectors) < _WORST_EIGENVECTORS:
        return None
    upper = np.flatnonzero(poles.imag >= 0.0)
    parts: list[int] = []
    imaginary: list[bool] = []
    columns: list[Array] = []
    for mode, index in enumerate(upper):
        vector = vectors[:, index]
        real = poles[index].imag == 0.0
        # x = Re(v g): the coordinate of the imaginary part of g counts -Im v
        columns += [vector.real] if real else [vector.real, -vector.imag]
        parts += [mode] if real else [mode, mode]
        imaginary += [False] if real else [False, True]
    readings = (C @ vectors[:, upper]).astype(np.complex128)
    return ModalForm(
        poles[upper].astype(np.complex128),
        readings,
        np.array(parts, dtype=np.intp),
        np.array(imaginary),
        np.column_stack(columns),
    )


class ModalResponses:
    """Responses to the numbers in B and x_0 (`regression.Responses`), for one experiment.

    Mode k filters input d to g_kd(t+1) = p_k g_kd(t) + u_d(t); the initial state is an impulse before the
    start. Output o responds to the coordinate (b, b') of B with Re(c_ok g_kd) b - Im(c_ok g_kd) b'. The sums

        S = sum_t g_i(t) conj(g_j(t)),  (1 - p_i conj(p_j)) S = p_i sum g_i u_j + conj(p_j sum g_j u_i)
            + sum u_i u_j + g_i(0) conj(g_j(0)) - g_i(N) conj(g_j(N))

    and likewise without conjugates, follow from products of responses and inputs alone.

    Args:
        form: The modes.
        inputs: u, shape (m, samples).
    """

    def __init__(self, form: ModalForm, inputs: Array) -> None:
        self._form = form
        self._inputs = inputs
        modes, samples, drives = len(form.poles), inputs.shape[1], len(inputs) + 1
        # column t is the response before sample t is fed in, the last one g(N); real above imaginary parts
        self._parts = np.zeros((2, drives, modes, samples + 1))
        for d, drive in enumerate(inputs):
            for k, pole in enumerate(form.poles):
                response = lfilter([1.0], [1.0, -pole], drive)
                self._parts[0, d, k, 1:], self._parts[1, d, k, 1:] = response.real, response.imag
        decays = _powers(form.poles, samples + 1)
        self._parts[0, -1], self._parts[1, -1] = decays.real, decays.imag
        self._parts = self._parts.reshape(2 * drives * modes, samples + 1)
        self._drives = drives
        # which response, and which part of it, each of the n (m + 1) numbers belongs to
        self._at = (np.arange(drives)[:, None] * modes + form.parts).ravel()
        self._imaginary = np.tile(form.imaginary, drives)
        self._readings = np.tile(form.readings, (1, drives))

    def normal(self) -> Array:
        """Return the Gram matrix of the responses summed over outputs, shape (n (m + 1), n (m + 1))."""
        form, modes = self._form, len(self._form.poles)
        inputs = np.vstack([self._inputs, np.zeros((1, self._inputs.shape[1]))])
        poles = np.tile(form.poles, self._drives)
        filtered = np.repeat(poles[:, None] * self._sums(inputs), modes, axis=1)
        energy = np.kron(inputs @ inputs.T, np.ones((modes, modes)))
        first, last = self._column(0), self._column(-1)
        plain = filtered + filtered.T + energy + np.outer(first, first) - np.outer(last, last)
        plain /= 1.0 - np.outer(poles, poles)
        mixed = filtered + filtered.conj().T + energy + np.outer(first, first.conj())
        mixed -= np.outer(last, last.conj())
        mixed /= 1.0 - np.outer(poles, poles.conj())
        read = self._readings
        return self._real_parts((read.T @ read.conj()) * mixed, (read.T @ read) * plain)

    def _real_parts(self, P: Complex, Q: Complex) -> Array:
        """Return products of real and negative imaginary parts from the sums of h h* (P) and of h h (Q)."""
        P, Q = 0.5 * P[np.ix_(self._at, self._at)], 0.5 * Q[np.ix_(self._at, self._at)]
        left, right = self._imaginary[:, None], self._imaginary
        equal = np.where(left & right, (P - Q).real, (P + Q).real)
        # Re h_i Im h_j = Im(Q - P) / 2, Im h_i Re h_j = Im(Q + P) / 2; imaginary parts count negative
        return np.asarray(np.where(left == right, equal, np.where(left, -(P + Q).imag, (P - Q).imag)))

    def moments(self, signals: Array) -> Array:
        """Return sum_t response_o(t) s(t) for every output o, shape (p, n (m + 1), signals)."""
        read = (self._readings[:, :, None] * self._sums(signals))[:, self._at]
        return np.asarray(np.where(self._imaginary[:, None], -read.imag, read.real))

    def outputs(self, states: Array) -> Array:
        """Return the response to the numbers, shape (n (m + 1),), as outputs of shape (p, samples)."""
        weights = np.zeros(self._readings.shape[1], dtype=np.complex128)
        np.add.at(weights, self._at, np.where(self._imaginary, 1j, 1.0) * states)
        read = self._readings * weights
        return np.asarray(np.hstack([read.real, -read.imag]) @ self._parts[:, :-1])

    def _sums(self, signals: Array) -> Complex:
        """Return sum_t g(t) s(t) of all responses, shape (responses, signals)."""
        real, imaginary = np.split(self._parts[:, :-1] @ signals.T, 2)
        return np.asarray(real + 1j * imaginary)

    def _column(self, sample: int) -> Complex:
        real, imaginary = np.split(self._parts[:, sample], 2)
        return np.asarray(real + 1j * imaginary)


def _powers(poles: Complex, count: int) -> Complex:
    """Return p^t for t < count, shape (poles, count); what has decayed to nothing is zero."""
    result = np.zeros((len(poles), count), dtype=np.complex128)
    result[:, 0] = 1.0
    done, factor = 1, poles.copy()
    while done < count:
        size = min(done, count - done)
        block = result[:, :size] * factor[:, None]
        block[np.abs(block) < _GONE] = 0.0
        result[:, done : done + size] = block
        factor = np.where(np.abs(factor) < _GONE, 0.0, factor * factor)
        done += size
    return result

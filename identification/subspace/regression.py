"""B, D, initial states and rest values, given A and C: least squares on the simulated output."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from scipy.signal import lfilter

from identification.arrays import Array
from identification.local_model import simulated_states

_WORST_EIGENVECTORS = 1e7
"""Condition number of the eigenvectors beyond which A counts as defective."""


@dataclass(frozen=True)
class Regression:
    """What the data say about B, D, initial states and rest values.

    Attributes:
        B: Input matrix, shape (n, m).
        D: Feed-through, shape (p, m); zero unless asked for.
        initial_states: One per experiment, shape (experiments, n).
        offset: Constant on each output: what the mean leaves of the rest value, shape (p,).
        simulated: Outputs of the fitted model, one (p, samples) array per experiment.
    """

    B: Array
    D: Array
    initial_states: Array
    offset: Array
    simulated: list[Array]


class _Responses:
    """Signals that span the response of x+ = A x + e_i u to any one input, and how outputs read them.

    With distinct poles n signals per input do: real and imaginary part of u filtered by 1 / (z - pole). In
    the real modal coordinates of A, one pair of states (a, b) per complex pole, the response to a drive of a
    is (g, -h), to a drive of b (h, g), g + jh being the filtered input. A defective A is simulated state by
    state.
    """

    def __init__(self, A: Array, C: Array) -> None:
        poles, vectors = np.linalg.eig(A)
        self.order = A.shape[0]
        self.modal = bool(np.linalg.cond(vectors) < _WORST_EIGENVECTORS)
        if not self.modal:
            self.basis, self.A = np.eye(self.order), A
            self.signals = self.order**2
            # signal i * n + s is state s driven through state i
            self.reading = np.stack([np.kron(np.eye(self.order), row[:, None]) for row in C])
            return
        upper = np.flatnonzero(poles.imag >= 0.0)
        self.poles = poles[upper]
        self.signals = self.order
        columns: list[Array] = []
        for index in upper:
            vector = vectors[:, index]
            columns += [vector.real] if poles[index].imag == 0.0 else [vector.real, vector.imag]
        self.basis = np.column_stack(columns)
        self.reading = np.stack([self._modal_reading(row) for row in C @ self.basis])

    def _modal_reading(self, row: Array) -> Array:
        block = np.zeros((self.order, self.order))
        at = 0
        for pole in self.poles:
            if pole.imag == 0.0:
                block[at, at] = row[at]
                at += 1
            else:
                a, b = row[at], row[at + 1]
                block[at : at + 2, at : at + 2] = [[a, b], [-b, a]]
                at += 2
        return block

    def to(self, drive: Array, direct: bool) -> Array:
        """Return the signals for a drive, shape (signals, samples).

        Args:
            drive: The input u, shape (samples,).
            direct: True where the drive acts on the state of its own row (an impulse then sets the state),
                False where it acts on the next one.
        """
        delayed = drive if direct else np.concatenate([[0.0], drive[:-1]])
        if not self.modal:
            shifted = np.concatenate([delayed[1:], [0.0]])
            rows = []
            for unit in np.eye(self.order):
                states = simulated_states(self.A, shifted[:, None] * unit, delayed[0] * unit)
                rows.append(states.T)
            return np.vstack(rows)
        rows = []
        for pole in self.poles:
            if pole.imag == 0.0:
                rows.append(lfilter([1.0], [1.0, -pole.real], delayed))
            else:
                filtered = lfilter([1.0], [1.0, -pole], delayed)
                rows += [filtered.real, filtered.imag]
        return np.array(rows)


def fit_inputs(
    A: Array, C: Array, inputs: Sequence[Array], outputs: Sequence[Array], feed_through: bool
) -> Regression:
    """Return B, D, x_0 and a constant per output that minimise |y - yhat|^2 over all experiments.

    All outputs weigh the same, so they come scaled. The normal equations need the Gram matrix of the
    responses only: y_o = F K_o beta with one F for all outputs.

    Args:
        A: State matrix, stable, shape (n, n).
        C: Output matrix, shape (p, n).
        inputs: One (m, samples) array per experiment.
        outputs: One (p, samples) array per experiment.
        feed_through: Whether D is fitted, too.
    """
    responses = _Responses(A, C)
    m, p, experiments = inputs[0].shape[0], C.shape[0], len(inputs)
    signals = [_signals(responses, u, index, experiments, feed_through) for index, u in enumerate(inputs)]
    gram = np.sum([f @ f.T for f in signals], axis=0)
    cross = np.sum([f @ y.T for f, y in zip(signals, outputs, strict=True)], axis=0)
    blocks = [_reading(responses, o, m, p, experiments, feed_through) for o in range(p)]
    normal = np.sum([K.T @ gram @ K for K in blocks], axis=0)
    right = np.sum([K.T @ cross[:, o] for o, K in enumerate(blocks)], axis=0)
    scale = 1.0 / np.sqrt(np.maximum(np.diag(normal), np.finfo(float).tiny))
    beta = scale * _solved(normal * np.outer(scale, scale), right * scale)
    simulated = [np.stack([(K @ beta) @ f for K in blocks]) for f in signals]
    n = responses.order
    states = beta[: (m + experiments) * n].reshape(m + experiments, n) @ responses.basis.T
    rest = beta[(m + experiments) * n :]
    D = rest[p:].reshape(p, m) if feed_through else np.zeros((p, m))
    return Regression(states[:m].T.copy(), D, states[m:], rest[:p], simulated)


def _signals(
    responses: _Responses, inputs: Array, experiment: int, experiments: int, feed_through: bool
) -> Array:
    """Return F': responses to the inputs, to an impulse in this experiment's start, then 1 and the inputs."""
    rows = [responses.to(u, direct=False) for u in inputs]
    impulse = np.zeros(inputs.shape[1])
    for index in range(experiments):
        impulse[0] = 1.0 if index == experiment else 0.0
        rows.append(responses.to(impulse, direct=True))
    rows.append(np.ones((1, inputs.shape[1])))
    return np.vstack([*rows, inputs] if feed_through else rows)


def _reading(
    responses: _Responses, output: int, inputs: int, outputs: int, experiments: int, feed_through: bool
) -> Array:
    """Return K_o: how output o reads the signals, for beta = [columns of B; x_0; offsets; D row by row]."""
    states = np.kron(np.eye(inputs + experiments), responses.reading[output])
    constant = np.eye(outputs)[output : output + 1]
    if not feed_through:
        return np.asarray(scipy.linalg.block_diag(states, constant))
    direct = np.zeros((inputs, outputs * inputs))
    direct[:, output * inputs : (output + 1) * inputs] = np.eye(inputs)
    return np.asarray(scipy.linalg.block_diag(states, constant, direct))


def _solved(normal: Array, right: Array) -> Array:
    try:
        return np.asarray(scipy.linalg.solve(normal, right, assume_a="pos"))
    except scipy.linalg.LinAlgError:
        return np.asarray(scipy.linalg.lstsq(normal, right)[0])

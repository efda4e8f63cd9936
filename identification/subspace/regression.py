"""B, D, initial states and rest values, given A and C: least squares on the simulated output."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from identification.arrays import Array
from identification.local_model import simulated_states
from identification.subspace.modal import ModalResponses, modal_form

Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Regression:
    """What the data say about B, D, initial states and rest values.

    Attributes:
        B: Input matrix, shape (n, m).
        D: Feed-through, shape (p, m); zero unless asked for.
        initial_states: One per experiment, shape (experiments, n).
        offsets: Constant on each output in each experiment: what its mean leaves of the rest value, shape
            (experiments, p).
        simulated: Outputs of the fitted model, one (p, samples) array per experiment.
        input_errors: Root mean square error over all outputs that the standard errors of B (and D) lead to,
            if this input alone moved as in the data, shape (m,). Standard errors as of white errors.
        untangled_errors: The same had the other inputs' numbers been known. Inputs that moved together have
            much smaller ones, however well they explain the outputs together.
    """

    B: Array
    D: Array
    initial_states: Array
    offsets: Array
    simulated: list[Array]
    input_errors: Array
    untangled_errors: Array


class Responses(Protocol):
    """How outputs respond in one experiment to the n (m + 1) numbers in B and x_0, columns of B first."""

    def normal(self) -> Array:
        """Return the Gram matrix of the responses summed over outputs, shape (n (m + 1), n (m + 1))."""

    def moments(self, signals: Array) -> Array:
        """Return sum_k response_o(k) s(k) for every output o, shape (p, n (m + 1), signals)."""

    def outputs(self, states: Array) -> Array:
        """Return the response to numbers, shape (n (m + 1),), as outputs of shape (p, samples)."""


def fit_inputs(
    A: Array, C: Array, inputs: Sequence[Array], outputs: Sequence[Array], feed_through: bool
) -> Regression:
    """Return B, D, x_0 and constants that minimise |y - yhat|^2 over all experiments.

    Every experiment has its own x_0 and its own constant on each output. All outputs weigh the same, so they
    come scaled.

    Args:
        A: State matrix, stable, shape (n, n).
        C: Output matrix, shape (p, n).
        inputs: One (m, samples) array per experiment.
        outputs: One (p, samples) array per experiment.
        feed_through: Whether D is fitted, too.
    """
    form = modal_form(A, C)
    responses: list[Responses]
    if form is None:
        basis = np.eye(len(A))
        responses = [_StateResponses(A, C, u) for u in inputs]
    else:
        basis = form.basis
        responses = [ModalResponses(form, u) for u in inputs]
    n, m, p, experiments = len(A), inputs[0].shape[0], C.shape[0], len(inputs)
    fixed_numbers = experiments + m * feed_through  # of each output: constants, then its row of D
    states, direct = (m + experiments) * n, p * fixed_numbers
    normal, right = np.zeros((states + direct, states + direct)), np.zeros(states + direct)
    for number, (response, u, y) in enumerate(zip(responses, inputs, outputs, strict=True)):
        shared = np.arange(m * n)
        own = np.concatenate([shared, (m + number) * n + np.arange(n)])
        fixed = np.vstack([np.ones((1, u.shape[1])), u]) if feed_through else np.ones((1, u.shape[1]))
        normal[np.ix_(own, own)] += response.normal()
        places = np.array([number, *range(experiments, fixed_numbers)])
        moments = response.moments(np.vstack([fixed, y]))
        gram, cross = fixed @ fixed.T, fixed @ y.T
        for o in range(p):
            at = states + o * fixed_numbers + places
            mixed = moments[o, :, : len(fixed)]
            normal[np.ix_(own, at)] += mixed
            normal[np.ix_(at, own)] += mixed.T
            normal[np.ix_(at, at)] += gram
            right[own] += moments[o, :, len(fixed) + o]
            right[at] += cross[:, o]
    beta = _solved(normal, right)
    constants = beta[states:].reshape(p, -1)
    offsets, D = (
        constants[:, :experiments].T,
        constants[:, experiments:] if feed_through else np.zeros((p, m)),
    )
    simulated = []
    for number, (response, u) in enumerate(zip(responses, inputs, strict=True)):
        own_states = np.concatenate([beta[: m * n], beta[(m + number) * n :][:n]])
        direct_part = D @ u if feed_through else 0.0
        simulated.append(response.outputs(own_states) + offsets[number][:, None] + direct_part)
    columns = beta[:states].reshape(m + experiments, n) @ basis.T
    of_D = [
        range(states + experiments + j, len(beta), fixed_numbers) if feed_through else () for j in range(m)
    ]
    numbers = [[*range(j * n, (j + 1) * n), *of_D[j]] for j in range(m)]
    residuals = [float(np.sum((y - yhat) ** 2)) for y, yhat in zip(outputs, simulated, strict=True)]
    equations = p * sum(u.shape[1] for u in inputs)
    variance = sum(residuals) / max(equations - len(beta), 1) / equations
    errors = _input_errors(normal, numbers, variance)
    return Regression(columns[:m].T.copy(), D, columns[m:], offsets, simulated, *errors)


def _input_errors(normal: Array, numbers: list[list[int]], variance: float) -> tuple[Array, Array]:
    """Return the rms error from each input's uncertain numbers, and had the other inputs' been known.

    With the covariance S = variance normal^-1 of all numbers, those of one input alone, J, give outputs whose
    squared errors sum to trace(S[J, J] normal[J, J]).
    """
    scale = 1.0 / np.sqrt(np.maximum(np.diag(normal), np.finfo(float).tiny))
    scaled = normal * np.outer(scale, scale)
    inverse = _inverse(scaled)
    joint, apart = [], []
    for own in numbers:
        gram = scaled[np.ix_(own, own)]
        joint.append(float(np.sum(inverse[np.ix_(own, own)] * gram)))
        others = {number for one in numbers if one is not own for number in one}
        kept = [*own, *(number for number in range(len(normal)) if number not in {*own, *others})]
        without = _inverse(scaled[np.ix_(kept, kept)])[: len(own), : len(own)]
        apart.append(float(np.sum(without * gram)))
    return np.sqrt(variance * np.array(joint)), np.sqrt(variance * np.array(apart))


def _inverse(matrix: Array) -> Array:
    """Return the inverse of a Gram matrix; what rounding hides is as uncertain as rounding allows."""
    values, vectors = scipy.linalg.eigh(matrix)
    values = np.maximum(values, len(values) * np.finfo(float).eps * values[-1])
    return np.asarray((vectors / values) @ vectors.T)


class _StateResponses:
    """Responses for any A, one simulation per number: for matrices without a basis of eigenvectors."""

    def __init__(self, A: Array, C: Array, inputs: Array) -> None:
        samples = inputs.shape[1]
        drives = [*inputs, np.zeros(samples)]
        rows = np.empty((len(drives), len(A), C.shape[0], samples))
        for d, drive in enumerate(drives):
            for i, unit in enumerate(np.eye(len(A))):
                start = unit * (d == len(drives) - 1)
                rows[d, i] = C @ simulated_states(A, drive[:, None] * unit, start).T
        self._rows = rows.reshape(-1, *rows.shape[2:])

    def normal(self) -> Array:
        flat = self._rows.reshape(len(self._rows), -1)
        return np.asarray(flat @ flat.T)

    def moments(self, signals: Array) -> Array:
        return np.asarray(self._rows.transpose(1, 0, 2) @ signals.T)

    def outputs(self, states: Array) -> Array:
        return np.asarray(np.tensordot(states, self._rows, axes=1))


def _solved(normal: Array, right: Array) -> Array:
    scale = 1.0 / np.sqrt(np.maximum(np.diag(normal), np.finfo(float).tiny))
    scaled = normal * np.outer(scale, scale)
    try:
        found = scipy.linalg.solve(scaled, right * scale, assume_a="pos")
    except scipy.linalg.LinAlgError:
        found = scipy.linalg.lstsq(scaled, right * scale)[0]
    return np.asarray(scale * found)

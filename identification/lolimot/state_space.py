"""Local ARX models as state-space systems whose matrices are blended.

Blending matrices means something only where a state means the same in every local model:

- "regressors": x = [y(k) .. y(k-na+1), u_1(k-1) .. u_1(k-nb+1), u_2(k-1) ..], the non-minimal state space
  (NMSS) in which states are measured signals. About a common point the blend is the ARX network, exactly.
- "observer": observer canonical form, n = max(na, nb) states. States are sums of past signals weighted by the
  coefficients valid then: the blend uses a coefficient j rows later than the ARX network does.
- "controller": one controller canonical form per input, as conversion of numerators and denominator gives it,
  m n states; the state at rest depends on the local model's static gain.
- "modal": each model in its own modal coordinates, slow modes first, every mode showing fully in the output.
  Where the slowest mode is a real pole in one local model and a pair of poles in the next, states of
  different modes are blended.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg

from fmu_builder.errors import IdentificationError
from fmu_builder.parameter_set import LocalLinearModel, nested
from identification.arrays import Array
from identification.lolimot.network import ArxNetwork, companion
from identification.lolimot.settings import StateSpaceForm

_REAL = 1e-12
"""Imaginary parts below this share are rounding."""
_LARGEST_CONDITION = 1e14
"""Eigenvectors further from independent than this are those of a multiple pole."""

Triple = tuple[Array, Array, Array]


def local_systems(network: ArxNetwork) -> tuple[LocalLinearModel, ...]:
    """Return the local models in the form and about the origin of the network's settings, with x0, u0, y0.

    Constants c_i: about a common point, the forms with y(k) among their states carry one more state, always
    zero, with the offset x0 = -c_i: it adds sum_i phi_i c_i, exactly, because its column of A is the same in
    all local models. Otherwise y0 is the output at rest at u0.

    Raises:
        IdentificationError: The form does not exist: inputs that act at once, more past inputs than outputs
            (modal), multiple poles (modal).
    """
    if network.orders.delay == 0:
        what = "inputs act at once, which a blend of states cannot express"
        mend = "Identify with delay = 1; take a force from the motion"
        raise IdentificationError.of("LOLIMOT, state space", what, mend)
    form, common = network.settings.form, network.settings.origin == "common"
    build = _FORMS[form]
    found = []
    for index, parameters in enumerate(network.parameters):
        A, B, C = build(network, index)
        n, constant = len(A), float(parameters[-1])
        if common and form in ("regressors", "observer"):
            A = np.pad(A, ((0, 1), (0, 1)))
            A[0, n] = 1.0
            B, C = np.pad(B, ((0, 1), (0, 0))), np.pad(C, ((0, 0), (0, 1)))
            x0 = np.zeros(n + 1)
            x0[n] = -constant
            u0, y0 = network.input_point, network.output_point
        else:
            x0 = np.zeros(n)
            u0 = network.input_point if common else _own_point(network, index)
            y0 = _at_rest(network, index, u0)
        one = LocalLinearModel(
            A=nested(A), B=nested(B), C=nested(C), D=nested(np.zeros((1, B.shape[1]))),
            x0=nested(x0), u0=nested(u0), y0=(float(y0),),
        )  # fmt: skip
        found.append(one)
    return tuple(found)


def _own_point(network: ArxNetwork, index: int) -> Array:
    """Return the common point moved to the centre of a cell, shape (m,)."""
    point = network.input_point.copy()
    for axis, name in enumerate(network.settings.scheduling):
        point[network.inputs.index(name)] = network.cells.centres[index, axis]
    return point


def _at_rest(network: ArxNetwork, index: int, inputs: Array) -> float:
    """Return the output of one local model at rest at inputs of shape (m,)."""
    orders, theta = network.orders, network.parameters[index]
    total = theta[-1]
    for place, deviation in enumerate(inputs - network.input_point):
        total += theta[orders.of_input(place)].sum() * deviation
    return float(network.output_point + total / (1.0 - theta[: orders.past_outputs].sum()))


def _coefficients(network: ArxNetwork, index: int) -> tuple[Array, Array]:
    """Return a (n,) and b (m, n) of a local model, filled up with zeros to n = max(na, nb)."""
    orders, theta = network.orders, network.parameters[index]
    n = max(orders.past_outputs, orders.past_inputs)
    a, b = np.zeros(n), np.zeros((orders.inputs, n))
    a[: orders.past_outputs] = theta[: orders.past_outputs]
    for place in range(orders.inputs):
        b[place, : orders.past_inputs] = theta[orders.of_input(place)]
    return a, b


def _regressors(network: ArxNetwork, index: int) -> Triple:
    orders, theta = network.orders, network.parameters[index]
    na, kept = orders.past_outputs, orders.past_inputs - 1
    n = na + orders.inputs * kept
    A, B, C = np.zeros((n, n)), np.zeros((n, orders.inputs)), np.zeros((1, n))
    A[0, :na], C[0, 0] = theta[:na], 1.0
    A[1:na, : na - 1] = np.eye(na - 1)
    for place in range(orders.inputs):
        b, first = theta[orders.of_input(place)], na + place * kept
        B[0, place] = b[0]
        if kept:
            A[0, first : first + kept] = b[1:]
            B[first, place] = 1.0
            A[first + 1 : first + kept, first : first + kept - 1] = np.eye(kept - 1)
    return A, B, C


def _observer(network: ArxNetwork, index: int) -> Triple:
    a, b = _coefficients(network, index)
    return companion(a).T, b.T, np.eye(1, len(a))


def _controller(network: ArxNetwork, index: int) -> Triple:
    a, b = _coefficients(network, index)
    n, m = len(a), len(b)
    B = np.zeros((n * m, m))
    B[np.arange(m) * n, np.arange(m)] = 1.0
    return scipy.linalg.block_diag(*[companion(a)] * m), B, b.reshape(1, -1)


def _modal(network: ArxNetwork, index: int) -> Triple:
    if network.orders.past_inputs > network.orders.past_outputs:
        raise _no_modes(index, "has more past inputs than past outputs")
    A, B, C = _observer(network, index)
    poles, vectors = np.linalg.eig(A)
    upper = [k for k in range(len(poles)) if poles[k].imag >= -_REAL * abs(poles[k])]
    with np.errstate(divide="ignore"):  # a pole of zero is the fastest mode there is
        size = np.abs(np.log(poles.astype(np.complex128)))
    columns: list[Array] = []
    for k in sorted(upper, key=lambda k: (size[k], poles[k].real)):
        vector = vectors[:, k] / (C[0] @ vectors[:, k])
        columns.append(vector.real)
        if poles[k].imag > _REAL * abs(poles[k]):
            columns.append(vector.imag)
    T: Array = np.array(columns, dtype=np.float64).T
    if T.shape != A.shape or not np.linalg.cond(T / np.linalg.norm(T, axis=0)) < _LARGEST_CONDITION:
        raise _no_modes(index, "has a multiple pole")
    inverse = np.linalg.inv(T)
    return np.asarray(inverse @ A @ T), np.asarray(inverse @ B), C @ T


def _no_modes(index: int, what: str) -> IdentificationError:
    mend = "Choose the form 'regressors', or other orders"
    return IdentificationError.of("LOLIMOT, modal form", f"local model {index + 1} {what}", mend)


_FORMS: dict[StateSpaceForm, Callable[[ArxNetwork, int], Triple]] = {
    "regressors": _regressors,
    "observer": _observer,
    "controller": _controller,
    "modal": _modal,
}

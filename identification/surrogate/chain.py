"""The chain of three masses between the contact wire and a wall: equations, discretisation, derivatives.

    wire --k_E-- m_C --k_C,c_C-- m_H --k_L,c_L-- m_M --k_W,c_W-- wall
                                  |               |
                       b_H M_pa, c_H to ground    b_M M_pa

    m_C xi''      = k_C (zeta - xi) + c_C (zeta' - xi') - k_E (xi - eta)                          (eq. 3.18)
    m_H zeta''    = k_L (delta_M - zeta) + c_L (delta_M' - zeta') - k_C (zeta - xi) - c_C (zeta' - xi')
                    - c_H zeta' + b_H M_pa                                        (eq. 3.19; c_H, b_H added)
    m_M delta_M'' = -k_W delta_M - c_W delta_M' - k_L (delta_M - zeta) - c_L (delta_M' - zeta')
                    + b_M M_pa,  b_M = 1/r_M                                                      (eq. 3.20)

States, eq. 3.21: xi, xi_dot, zeta, zeta_dot, delta_M, delta_M_dot. Inputs: eta, M_pa. Outputs: the first
four.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from fmu_builder.errors import Problem, SettingsError
from fmu_builder.kernel import CHAIN_INPUTS, CHAIN_OUTPUTS, CHAIN_STATES
from identification.arrays import Array

STATE_NAMES, OUTPUT_NAMES, INPUT_NAMES = CHAIN_STATES, CHAIN_OUTPUTS, CHAIN_INPUTS
OUTPUT_MATRIX: Array = np.eye(len(OUTPUT_NAMES), len(STATE_NAMES))
"""C of eq. 3.24 without the two rows of delta_M, which has no counterpart in the reference (Remark 4.4.1)."""

SCALE: Array = np.array([1.0, 128.0, 1.0, 128.0, 1.0, 128.0, 1.0, 1.0])
"""Size of states and inputs in the exponential, rad/s between positions and rates."""

_COMPLEX_STEP = 1e-40  # exact for rational entries: nothing is subtracted


@dataclass(frozen=True)
class Head:
    """The collector head, a known linear one-mass oscillator (eq. 3.14-3.15).

    Attributes:
        m_C: Mass, kg.
        k_C: Stiffness between head and lower framework, N/m.
        c_C: Damping between head and lower framework, N.s/m.
        k_E: Contact stiffness between wire and head, N/m.
    """

    m_C: float
    k_C: float
    c_C: float
    k_E: float

    def __post_init__(self) -> None:
        problems = [
            Problem(f"collector head {name}", f"is {value!r}", "Give a finite number greater than zero")
            for name, value in asdict(self).items()
            if not (np.isfinite(value) and value > 0.0)
        ]
        if problems:
            raise SettingsError(problems)


@dataclass(frozen=True)
class LocalDynamics:
    """Discretised chains and their exact derivatives to the P free parameters; "..." are several chains.

    Attributes:
        A, B: System and input matrix in discrete time, (..., 6, 6) and (..., 6, 2).
        g: State per unit of eta at rest, (I - A)^-1 B_eta, (..., 6).
        dA, dB, dg: Their derivatives, parameter before the matrix: (..., P, 6, 6), (..., P, 6, 2),
            (..., P, 6).
    """

    A: Array
    B: Array
    g: Array
    dA: Array
    dB: Array
    dg: Array


def chain_matrices(
    v: Mapping[str, Any], shape: tuple[int, ...], dtype: npt.DTypeLike
) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Return A and B of the chain, eq. 3.22 and 3.23, with the extensions b_H and c_H.

    Args:
        v: Every coefficient by name, each of the shape `shape` or a number.
        shape: Leading shape of the result.
        dtype: Real or complex.
    """
    A, B = np.zeros((*shape, 6, 6), dtype), np.zeros((*shape, 6, 2), dtype)
    for position in (0, 2, 4):
        A[..., position, position + 1] = 1.0
    m_C, m_H, m_M = v["m_C"], v["m_H"], v["m_M"]
    A[..., 1, 0], A[..., 1, 1] = -(v["k_E"] + v["k_C"]) / m_C, -v["c_C"] / m_C
    A[..., 1, 2], A[..., 1, 3] = v["k_C"] / m_C, v["c_C"] / m_C
    A[..., 3, 0], A[..., 3, 1] = v["k_C"] / m_H, v["c_C"] / m_H
    A[..., 3, 2], A[..., 3, 3] = -(v["k_C"] + v["k_L"]) / m_H, -(v["c_C"] + v["c_L"] + v["c_H"]) / m_H
    A[..., 3, 4], A[..., 3, 5] = v["k_L"] / m_H, v["c_L"] / m_H
    A[..., 5, 2], A[..., 5, 3] = v["k_L"] / m_M, v["c_L"] / m_M
    A[..., 5, 4], A[..., 5, 5] = -(v["k_L"] + v["k_W"]) / m_M, -(v["c_L"] + v["c_W"]) / m_M
    B[..., 1, 0] = v["k_E"] / m_C
    B[..., 3, 1], B[..., 5, 1] = v["b_H"] / m_H, v["b_M"] / m_M
    return A, B


def slopes_by_complex_step(
    function: Any, theta: Array, count: int
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return the derivatives of two matrices to the first `count` parameters, parameter before the matrix.

    Args:
        function: theta (..., P), complex, to two matrices; rational in theta, so that the step is exact.
        theta: Parameters, (..., P).
        count: How many derivatives.
    """
    steps = theta[..., None, :] + 1j * _COMPLEX_STEP * np.eye(count, theta.shape[-1])
    first, second = function(steps)
    return first.imag / _COMPLEX_STEP, second.imag / _COMPLEX_STEP


def discretised(
    continuous: tuple[Array, Array], slopes: tuple[Array, Array], sample_time: float
) -> LocalDynamics:
    """Return the zero-order-hold discretisation (eq. 3.28) with exact derivatives.

    Args:
        continuous: A (..., 6, 6) and B (..., 6, 2).
        slopes: Their derivatives, (..., P, 6, 6) and (..., P, 6, 2); P may be 0.
        sample_time: Ts, s.
    """
    (A, B), (dA, dB) = continuous, slopes
    n, shape, count = A.shape[-1], A.shape[:-2], dA.shape[-3]
    # At rest continuous and discrete time agree, and I - A_discrete would cancel digits.
    inverse = np.linalg.inv(-A)
    g = (inverse @ B[..., :1])[..., 0]
    dg = (inverse[..., None, :, :] @ (dA @ g[..., None, :, None] + dB[..., :1]))[..., 0]
    size = n + B.shape[-1]
    augmented, directions = np.zeros((*shape, size, size)), np.zeros((*shape, count, size, size))
    augmented[..., :n, :n], augmented[..., :n, n:] = A, B
    directions[..., :n, :n], directions[..., :n, n:] = dA, dB
    held, moved = exponential(augmented * sample_time, directions * sample_time, SCALE)
    return LocalDynamics(
        *(held[..., :n, :n], held[..., :n, n:], g, moved[..., :n, :n], moved[..., :n, n:], dg)
    )


def exponential(matrix: Array, directions: Array, scale: Array) -> tuple[Array, Array]:
    """Return exp(X) and its derivatives L_p = d/ds exp(X + s E_p) at s = 0.

    Scaling and squaring of the Taylor series and, term by term, of its derivative: T_k = T_{k-1} X / k,
    L_k = (L_{k-1} X + T_{k-1} E) / k; doubling: L <- T L + L T, T <- T T.

    Args:
        matrix: X, (..., n, n).
        directions: E, (..., P, n, n); P may be 0.
        scale: Size of each state, (n,), powers of two (then scaling is exact): it keeps the norm, and with
            it the number of doublings, small.
    """
    n = matrix.shape[-1]
    ratio = scale[None, :] / scale[:, None]
    norm = float(np.abs(matrix * ratio).sum(axis=-1).max(initial=0.0))
    doublings = max(0, int(np.ceil(np.log2(max(norm, 1e-300) / 0.5)))) if np.isfinite(norm) else 0
    X, E = matrix * ratio * 0.5**doublings, directions * ratio * 0.5**doublings
    term, total = np.broadcast_to(np.eye(n), X.shape), np.broadcast_to(np.eye(n), X.shape).copy()
    slope_term, slope_total = np.zeros_like(E), np.zeros_like(E)
    several = E.shape[-3] > 0
    for k in range(1, 19):  # 0.5^19 / 19! is far below rounding
        if several:
            slope_term = (slope_term @ X[..., None, :, :] + term[..., None, :, :] @ E) / k
            slope_total = slope_total + slope_term
        term = term @ X / k
        total = total + term
    for _ in range(doublings):
        if several:
            wide = total[..., None, :, :]
            slope_total = wide @ slope_total + slope_total @ wide
        total = total @ total
    return total / ratio, slope_total / ratio

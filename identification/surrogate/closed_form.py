"""A start of theta without iteration over theta and without random numbers, from a local black-box model.

What hangs on the head is one dynamic stiffness, Z = (k_C + c_C s) (G_xi - G_zeta) / G_zeta of the eta column,
a rational function of order 4/2 whose coefficients give the chain's one after the other; the forces of the
torque then follow by linear least squares.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import scipy.linalg

from identification.arrays import Array
from identification.local_model import LocalModel
from identification.surrogate.chain import INPUT_NAMES, OUTPUT_NAMES, Head

ComplexArray = npt.NDArray[np.complex128]

_UNIT = 100.0
"""p = s / 100: the coefficients of the rational function come to one size."""
_PASSES = 12
"""Passes of Sanathanan and Koerner (1963): each weights by the denominator of the one before."""


def continuous_response(model: LocalModel, frequencies: Array) -> ComplexArray | None:
    """Return the response (F, 4, 2) of the continuous-time model with held inputs behind a discrete one.

    G(j 2 pi f) from eta, M_pa to xi, xi_dot, zeta, zeta_dot by the logarithm of the system matrix.

    Args:
        model: Local model with these signals by name.
        frequencies: f, Hz, (F,).

    Returns:
        The response, None where a pole is not positive enough to have a logarithm (there is no such model).
    """
    poles, vectors = np.linalg.eig(model.A)
    if np.any(np.abs(poles) < 1e-6) or np.any((poles.real <= 0.0) & (np.abs(poles.imag) < 1e-9)):
        return None
    rates = np.log(poles) / model.sample_time
    with np.errstate(divide="ignore", invalid="ignore"):
        held = np.where(np.abs(poles - 1.0) > 1e-13, rates / (poles - 1.0), 1.0 / model.sample_time)
    rows = [model.outputs.index(name) for name in OUTPUT_NAMES]
    columns = [model.inputs.index(name) for name in INPUT_NAMES]
    try:
        modal_input = held[:, None] * np.linalg.solve(vectors, model.B[:, columns].astype(complex))
    except np.linalg.LinAlgError:
        return None
    modal_output = model.C[rows] @ vectors
    s = 2j * np.pi * frequencies
    resolvent = 1.0 / (s[:, None] - rates[None, :])
    response: ComplexArray = np.einsum("im,fm,mj->fij", modal_output, resolvent, modal_input)
    return response + model.D[rows][:, columns]


def closed_form(
    response: ComplexArray, frequencies: Array, head: Head, weights: Array | None = None
) -> dict[str, float] | None:
    """Return the coefficients of chain9 by name, SI units, from a continuous-time frequency response.

    Args:
        response: G from eta, M_pa to `OUTPUT_NAMES`, (F, 4, 2).
        frequencies: f, Hz, (F,).
        head: The collector head.
        weights: Weight of each entry in the torque's least squares, (F, 4, 2); default equal.

    Returns:
        The coefficients, None where the response is not that of a chain: a mass, or the stiffness between the
        masses, would not be positive.
    """
    s: ComplexArray = np.asarray(2j * np.pi * frequencies)
    suspension = head.k_C + s * head.c_C
    xi, zeta = response[:, 0, 0], response[:, 2, 0]
    with np.errstate(all="ignore"):
        stiffness = suspension * (xi - zeta) / zeta
        fitted = _rational(stiffness, s / _UNIT, np.abs(zeta))
        if fitted is None:
            return None
        values = _coefficients(*fitted)
    if values is None:
        return None
    levers = _levers(values, response[:, :, 1], s, head, None if weights is None else weights[:, :, 1])
    return {**values, **levers} if all(map(np.isfinite, levers.values())) else None


def _rational(values: ComplexArray, p: ComplexArray, weight: Array) -> tuple[Array, Array] | None:
    """Return n (5,) and d (2,), ascending in s, of (n4 s^4 + ... + n0) / (s^2 + d1 s + d0).

    Args:
        values: What the function should be, (F,).
        p: s over its unit, (F,).
        weight: Relative weight of each value, (F,).
    """
    if not np.all(np.isfinite(values)):
        return None
    numerator, denominator = p[:, None] ** np.arange(5), p[:, None] ** np.arange(2)
    matrix = np.hstack([numerator, -values[:, None] * denominator])
    right, scale = values * p**2, np.ones(len(p))
    solution = np.zeros(7)
    for _ in range(_PASSES):
        rows, aim = matrix * (weight * scale)[:, None], right * weight * scale
        stacked = np.vstack([rows.real, rows.imag])
        size = np.linalg.norm(stacked, axis=0)
        if not np.all(np.isfinite(size)) or not np.all(size > 0.0):
            return None
        found = scipy.linalg.lstsq(stacked / size, np.concatenate([aim.real, aim.imag]))[0]
        solution = found / size
        scale = 1.0 / np.abs(p**2 + solution[6] * p + solution[5])
    unit = _UNIT ** -np.arange(5.0) * _UNIT**2
    return solution[:5] * unit, solution[5:] * np.array([_UNIT**2, _UNIT])


def _coefficients(n: Array, d: Array) -> dict[str, float] | None:
    """Return the chain's coefficients from Z = n(s) / d(s), None where they are not those of a chain.

    With m_H = n4 the other coefficients leave one quadratic equation for k_L. Two chains may have the same Z;
    the one that needs the smaller damper to ground is taken.
    """
    m_H = n[4]
    total = n[3] - m_H * d[1]  # c_H + c_L
    stiffness = n[2] - m_H * d[0] - total * d[1]  # k_L - c_L^2 / m_M
    mixed = n[1] - total * d[0]  # k_L (d1 - 2 c_L / m_M)
    quadratic = np.array(
        [
            4.0 * d[0] - d[1] ** 2,
            2.0 * d[1] * mixed - 4.0 * n[0] - 4.0 * stiffness * d[0],
            4.0 * stiffness * n[0] - mixed**2,
        ]
    )
    found = []
    for k_L in _real_roots(quadratic):
        m_M = k_L / (d[0] - n[0] / k_L)
        c_L = 0.5 * (d[1] - mixed / k_L) * m_M
        values = {
            **{"m_H": m_H, "m_M": m_M, "k_L": k_L, "c_L": c_L, "k_W": d[0] * m_M - k_L},
            **{"c_W": d[1] * m_M - c_L, "c_H": total - c_L},
        }
        if all(map(np.isfinite, values.values())) and min(m_H, m_M, k_L) > 0.0:
            found.append({name: float(value) for name, value in values.items()})
    return min(found, key=lambda one: abs(one["c_H"]), default=None)


def _real_roots(quadratic: Array) -> tuple[float, ...]:
    """Return the real roots other than zero; the real part of a complex pair, a double root with noise."""
    if not np.all(np.isfinite(quadratic)):
        return ()
    return tuple(float(root) for root in set(np.roots(quadratic).real) if root != 0.0)


def _levers(
    v: dict[str, float], column: ComplexArray, s: ComplexArray, head: Head, weights: Array | None
) -> dict[str, float]:
    """Return b_M and b_H by linear least squares on the response to the torque, (F, 4)."""
    suspension, spring = head.k_C + s * head.c_C, v["k_L"] + s * v["c_L"]
    dynamic = np.zeros((len(s), 3, 3), dtype=complex)
    dynamic[:, 0, 0] = head.m_C * s**2 + suspension + head.k_E
    dynamic[:, 1, 1] = v["m_H"] * s**2 + v["c_H"] * s + suspension + spring
    dynamic[:, 2, 2] = v["m_M"] * s**2 + v["c_W"] * s + v["k_W"] + spring
    dynamic[:, 0, 1] = dynamic[:, 1, 0] = -suspension
    dynamic[:, 1, 2] = dynamic[:, 2, 1] = -spring
    moved = np.linalg.inv(dynamic)[:, :2, :][:, :, [2, 1]]  # xi, zeta per force on m_M, on m_H
    parts = np.stack([moved[:, 0], s[:, None] * moved[:, 0], moved[:, 1], s[:, None] * moved[:, 1]], axis=1)
    factor = np.ones(column.shape) if weights is None else weights
    matrix, aim = (parts * factor[:, :, None]).reshape(-1, 2), (column * factor).ravel()
    b_M, b_H = scipy.linalg.lstsq(
        np.vstack([matrix.real, matrix.imag]), np.concatenate([aim.real, aim.imag])
    )[0]
    return {"b_M": float(b_M), "b_H": float(b_H)}

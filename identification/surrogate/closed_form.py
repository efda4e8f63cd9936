"""Starts of theta without iteration over theta and without random numbers, from a local black-box model.

What hangs on the head is one dynamic stiffness Z = n(s) / d(s) of order 4/2, moved by what the torque does to
it, q(s) / d(s): with the force of the head spring F = (k_C + c_C s) (G_xi - G_zeta),

    eta column: d F = n G_zeta,    torque column: d F = n G_zeta - q,

linear in the coefficients of n, d and q, which give the chain's one after the other.
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
_MASSES = np.geomspace(0.5, 150.0, 10)
"""m_M [kg] to begin with where the lower mass hardly reacts upon the upper one."""
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


def closed_forms(
    response: ComplexArray, frequencies: Array, head: Head, weights: Array | None = None
) -> tuple[dict[str, float], ...]:
    """Return coefficients of chain9 by name, SI units, from a continuous-time frequency response.

    The first ones have n and d exactly. What the lower mass does to the upper one may be too small to be told
    from errors of the response; m_M is nothing then. The others therefore take m_M as given, one of several,
    and c_H as zero, and have everything else that shows.

    Args:
        response: G from eta, M_pa to `OUTPUT_NAMES`, (F, 4, 2).
        frequencies: f, Hz, (F,).
        head: The collector head.
        weights: Weight of each entry, (F, 4, 2); of zeta's, the torque's against eta's is used. Default:
            both columns count the same.

    Returns:
        The coefficients, none where the response is not that of a chain: a mass, or the stiffness between the
        masses, would not be positive.
    """
    s: ComplexArray = np.asarray(2j * np.pi * frequencies)
    zeta = response[:, 2]
    force = (head.k_C + s * head.c_C)[:, None] * (response[:, 0] - zeta)
    with np.errstate(all="ignore"):
        if weights is None:
            share = np.full(len(s), np.linalg.norm(zeta[:, 0]) / np.linalg.norm(zeta[:, 1]))
        else:
            share = weights[:, 2, 1] / weights[:, 2, 0]
        fitted = _rational(force, zeta, s / _UNIT, share)
        if fitted is None or not fitted[0][4] > 0.0:
            return ()
        found = (*_exact(*fitted), *_with_given_mass(*fitted))
    return tuple(one for one in found if all(map(np.isfinite, one.values())))


def _rational(
    force: ComplexArray, zeta: ComplexArray, p: ComplexArray, share: Array
) -> tuple[Array, Array, Array] | None:
    """Return n (5,), d (2,) and q (3,), ascending in s; d has a one at s^2.

    Args:
        force: F, (F, 2).
        zeta: G_zeta, (F, 2).
        p: s over its unit, (F,).
        share: Weight of the torque column against the eta column, (F,).
    """
    powers, none = p[:, None] ** np.arange(5), np.zeros((len(p), 3))
    columns = [
        np.hstack([powers * zeta[:, [k]], -powers[:, :2] * force[:, [k]], -powers[:, :3] if k else none])
        for k in (0, 1)
    ]
    matrix = np.vstack([columns[0], columns[1] * share[:, None]])
    right = np.concatenate([force[:, 0] * p**2, force[:, 1] * p**2 * share])
    if not np.all(np.isfinite(matrix)) or not np.all(np.isfinite(right)):
        return None
    solution, scale = np.zeros(10), np.ones(len(right))
    for _ in range(_PASSES):
        rows, aim = matrix * scale[:, None], right * scale
        stacked = np.vstack([rows.real, rows.imag])
        size = np.linalg.norm(stacked, axis=0)
        if not np.all(np.isfinite(size)) or not np.all(size > 0.0):
            return None
        found = scipy.linalg.lstsq(stacked / size, np.concatenate([aim.real, aim.imag]))[0]
        solution = found / size
        scale = np.tile(1.0 / np.abs(p**2 + solution[6] * p + solution[5]), 2)
    unit = _UNIT ** -np.arange(5.0) * _UNIT**2
    return solution[:5] * unit, solution[5:7] * np.array([_UNIT**2, _UNIT]), solution[7:] * unit[:3]


def _exact(n: Array, d: Array, q: Array) -> list[dict[str, float]]:
    """Return the chains with n and d, none where there are none.

    With m_H = n4 the other coefficients leave one quadratic equation for k_L. Two chains may have the same Z;
    the one that needs the smaller damper to ground comes first.
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
        if min(m_M, k_L) > 0.0:
            found.append(_chain(m_H, m_M, k_L, c_L, d, q) | {"c_H": float(total - c_L)})
    return sorted(found, key=lambda one: abs(one["c_H"]))


def _with_given_mass(n: Array, d: Array, q: Array) -> list[dict[str, float]]:
    """Return chains without a damper to ground, one for each of `_MASSES`."""
    m_H = n[4]
    c_L = n[3] - m_H * d[1]
    stiffness = n[2] - m_H * d[0] - c_L * d[1]  # k_L - c_L^2 / m_M
    found = [(m_M, stiffness + c_L**2 / m_M) for m_M in _MASSES]
    return [_chain(m_H, m_M, k_L, c_L, d, q) | {"c_H": 0.0} for m_M, k_L in found if k_L > 0.0]


def _chain(m_H: float, m_M: float, k_L: float, c_L: float, d: Array, q: Array) -> dict[str, float]:
    """Return all coefficients but c_H: the wall's from d, those of the torque from q."""
    values = {
        "m_H": m_H,
        "m_M": m_M,
        "k_L": k_L,
        "c_L": c_L,
        "k_W": d[0] * m_M - k_L,
        "c_W": d[1] * m_M - c_L,
    }
    values |= {"b_M": (q[0] - q[2] * d[0]) * m_M / k_L, "b_H": q[2]}
    return {name: float(value) for name, value in values.items()}


def _real_roots(quadratic: Array) -> tuple[float, ...]:
    """Return the real roots other than zero; the real part of a complex pair, a double root with noise."""
    if not np.all(np.isfinite(quadratic)):
        return ()
    return tuple(float(root) for root in set(np.roots(quadratic).real) if root != 0.0)

"""Exact chain9 parameters of a lower framework with two degrees of freedom: a change of coordinates.

With M q'' + C q' + K q = F_H' z + b M_pa without the head spring, z = d zeta / d q:
t1 = M^-1 z / (z' M^-1 z) moves the head spring's point alone (z' t1 = 1), t2 moves everything but that point
(z' t2 = 0), so T = [t1 t2] makes the mass matrix diagonal and zeta the first coordinate; t2 is scaled so that
the first mass has no spring to the wall.
"""

from __future__ import annotations

import numpy as np

from fmu_builder.errors import IdentificationError
from identification.arrays import Array


def exact_chain9(
    mass: Array, damping: Array, stiffness: Array, head_point: Array, torque: Array
) -> dict[str, float]:
    """Return the coefficients of chain9 by name, SI units, of a linear lower framework.

    Args:
        mass: M, (2, 2), symmetric.
        damping: C without the head suspension, (2, 2), symmetric.
        stiffness: K without the head suspension, (2, 2), symmetric.
        head_point: z = d zeta / d q, (2,).
        torque: Generalised force per M_pa, (2,).

    Raises:
        IdentificationError: The framework has no such form: no spring acts between its two masses.
    """
    along = np.linalg.solve(mass, head_point)
    first = along / (head_point @ along)
    second = np.array([head_point[1], -head_point[0]])
    coupling = float(first @ stiffness @ second)
    if coupling == 0.0:
        what = "no spring acts between the head's point and the rest"
        raise IdentificationError.of("lower framework", what, "There is no chain with this behaviour")
    T = np.column_stack([first, second * (-float(first @ stiffness @ first) / coupling)])
    m, c, k, b = T.T @ mass @ T, T.T @ damping @ T, T.T @ stiffness @ T, T.T @ torque
    return {
        **{"m_H": float(m[0, 0]), "m_M": float(m[1, 1])},
        **{"k_L": float(-k[0, 1]), "k_W": float(k[1, 1] + k[0, 1])},
        **{"c_L": float(-c[0, 1]), "c_W": float(c[1, 1] + c[0, 1]), "c_H": float(c[0, 0] + c[0, 1])},
        **{"b_M": float(b[1]), "b_H": float(b[0])},
    }


def lower_framework(
    A: Array, B: Array, head_point: Array, k_C: float, c_C: float
) -> tuple[Array, Array, Array, Array, Array]:
    """Return mass, damping, stiffness, head point and torque for `exact_chain9` from a linearised model.

    The torque drives the first coordinate only, and the head spring tells what M^-1 makes of z; together they
    give M^-1.

    Args:
        A: Continuous-time system matrix, states q1, q2, xi and their rates in this order, (6, 6).
        B: Column of M_pa, (6,).
        head_point: z, (2,), both entries other than zero.
        k_C: Stiffness of the head suspension, N/m.
        c_C: Damping of the head suspension, N.s/m.
    """
    along = A[3:5, 2] / k_C
    inverse = np.empty((2, 2))
    inverse[:, 0] = B[3:5]
    inverse[0, 1] = inverse[1, 0]
    inverse[1, 1] = (along[1] - inverse[1, 0] * head_point[0]) / head_point[1]
    mass: Array = np.asarray(np.linalg.inv(inverse), dtype=np.float64)
    suspension = np.outer(head_point, head_point)
    stiffness = -mass @ A[3:5, :2] - k_C * suspension
    damping = -mass @ A[3:5, 3:5] - c_C * suspension
    return mass, damping, stiffness, head_point, np.array([1.0, 0.0])

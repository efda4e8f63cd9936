"""Mechanical surrogate structures: chains of three masses between the contact wire and a wall (thesis 3.4).

    wire --k_E-- m_C --k_C,c_C-- m_H --k_L,c_L-- m_M --k_W,c_W-- wall;  torque M_pa on m_M by a lever r_M

States, eq. 3.21: xi, xi_dot, zeta, zeta_dot, delta_M, delta_M_dot. Inputs: eta, M_pa. Outputs: the first
four.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from fmu_builder.errors import Problem, SettingsError
from identification.arrays import Array

STATE_NAMES = ("xi", "xi_dot", "zeta", "zeta_dot", "delta_M", "delta_M_dot")
OUTPUT_NAMES = STATE_NAMES[:4]
INPUT_NAMES = ("eta", "M_pa")
OUTPUT_MATRIX: Array = np.eye(len(OUTPUT_NAMES), len(STATE_NAMES))
"""C of eq. 3.24 without the two rows of delta_M, which has no counterpart in the reference (Remark 4.4.1)."""

_SCALE: Array = np.array([1.0, 128.0, 1.0, 128.0, 1.0, 128.0, 1.0, 1.0])  # rad/s between positions and rates
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
class Parameter:
    """One free parameter of a structure.

    Attributes:
        name: The thesis's letter.
        unit: SI unit.
        description: What it is.
        lower: Lower bound (Table 4.2).
        upper: Upper bound (Table 4.2).
        scaling: Coordinate of the search: `log` for parameters that cannot be negative, else `linear`.
        size: A small value. `log`: takes the place of a lower bound of zero, and has no visible effect.
            `linear`: the unit of the search coordinate.
    """

    name: str
    unit: str
    description: str
    lower: float
    upper: float
    scaling: Literal["log", "linear"] = "log"
    size: float = 1.0

    @property
    def search_bounds(self) -> tuple[float, float]:
        """Lower and upper bound in the coordinate of the search."""
        if self.scaling == "log":
            return float(np.log(self.lower if self.lower > 0.0 else self.size)), float(np.log(self.upper))
        return self.lower / self.size, self.upper / self.size


_M_H = Parameter("m_H", "kg", "mass of the upper part of the lower framework, at the head spring", 5.0, 50.0)
_M_M = Parameter(
    "m_M", "kg", "mass of the lower part of the lower framework, driven by the torque", 5.0, 50.0
)
_K_L = Parameter("k_L", "N/m", "stiffness between m_H and m_M", 0.0, 1e7, size=0.1)
_C_L = Parameter("c_L", "N.s/m", "damping between m_H and m_M", 1e-3, 2e5)
_R_M = Parameter("r_M", "m", "lever arm of the torque on m_M", 1e-3, 0.6)
_K_W = Parameter("k_W", "N/m", "stiffness between m_M and the wall", 0.0, 1e7, size=0.1)
_C_W = Parameter("c_W", "N.s/m", "damping between m_M and the wall", 0.0, 2e5, size=1e-2)
_M_C = Parameter("m_C", "kg", "mass of the collector head", 1.0, 30.0)
_K_C = Parameter("k_C", "N/m", "stiffness of the collector head suspension", 1e-7, 1e7)
_C_C = Parameter("c_C", "N.s/m", "damping of the collector head suspension", 1e-3, 2e5)


@dataclass(frozen=True)
class LocalDynamics:
    """A discretised chain and its exact derivatives to the P free parameters.

    Attributes:
        A, B: System and input matrix in discrete time, (6, 6) and (6, 2).
        g: State per unit of eta at rest, (I - A)^-1 B_eta, (6,).
        dA, dB, dg: Their derivatives, parameter first: (P, 6, 6), (P, 6, 2), (P, 6).
    """

    A: Array
    B: Array
    g: Array
    dA: Array
    dB: Array
    dg: Array


@dataclass(frozen=True)
class Structure:
    """A named chain: which of its coefficients are free, within which bounds.

    A parameter is a coefficient of eq. 3.18-3.20 (m_C, k_C, c_C, m_H, m_M, k_L, c_L, k_W, c_W), or r_M or
    b_M = 1/r_M (1/m; force b_M M_pa on m_M), b_H (1/m; force b_H M_pa on m_H) or c_H (damping between m_H
    and ground). The last two are zero where they are not free. A coefficient of the head that is not free
    comes from the head.
    """

    name: str
    description: str
    parameters: tuple[Parameter, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the free parameters, in order."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds in search coordinates, each (P,)."""
        pairs = np.array([parameter.search_bounds for parameter in self.parameters])
        return pairs[:, 0].copy(), pairs[:, 1].copy()

    def to_search(self, theta: Array) -> Array:
        """Return the search coordinates (..., P) of parameters (..., P), moved into the bounds."""
        lower, upper = self.bounds
        columns = []
        for index, parameter in enumerate(self.parameters):
            value = theta[..., index]
            if parameter.scaling == "log":
                columns.append(np.log(np.maximum(value, np.exp(lower[index]))))
            else:
                columns.append(value / parameter.size)
        inside: Array = np.clip(np.stack(columns, axis=-1), lower, upper)
        return inside

    def from_search(self, search: Array) -> Array:
        """Return the parameters (..., P) of search coordinates (..., P), never outside the bounds."""
        upper = self.bounds[1]
        columns = []
        for index, parameter in enumerate(self.parameters):
            value = search[..., index]
            value = np.exp(value) if parameter.scaling == "log" else value * parameter.size
            value = np.where(
                search[..., index] >= upper[index], parameter.upper, value
            )  # exp(log(x)) may miss x
            columns.append(np.clip(value, parameter.lower, parameter.upper))
        return np.stack(columns, axis=-1)

    def slope(self, theta: Array) -> Array:
        """Return d theta / d search coordinate, (P,): theta itself for `log`."""
        sizes = np.array([parameter.size for parameter in self.parameters])
        log = np.array([parameter.scaling == "log" for parameter in self.parameters])
        slope: Array = np.where(log, theta, sizes)
        return slope

    def at_bound(self, theta: Array) -> dict[str, str]:
        """Return the parameters of one theta (P,) that stand at a bound, with `lower` or `upper`."""
        found: dict[str, str] = {}
        search = self.to_search(theta)
        for index, (low, high) in enumerate(zip(*self.bounds, strict=True)):
            near = 1e-6 * (high - low)
            if search[index] <= low + near:
                found[self.parameters[index].name] = "lower"
            elif search[index] >= high - near:
                found[self.parameters[index].name] = "upper"
        return found

    def coefficients(self, theta: npt.NDArray[Any], head: Head) -> dict[str, Any]:
        """Return every coefficient of the equations of motion for theta (..., P), real or complex."""
        values: dict[str, Any] = {"b_H": 0.0, "c_H": 0.0, **asdict(head)}
        values |= {name: theta[..., index] for index, name in enumerate(self.names)}
        if "r_M" in values:
            values["b_M"] = 1.0 / values.pop("r_M")
        return values

    def continuous(self, theta: npt.NDArray[Any], head: Head) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
        """Return A (..., 6, 6) and B (..., 6, 2) of eq. 3.22-3.23 for theta (..., P), real or complex."""
        return _chain(self.coefficients(theta, head), theta.shape[:-1], theta.dtype)

    def discretise(
        self, theta: Array, head: Head, sample_time: float, derivatives: bool = True
    ) -> LocalDynamics:
        """Return the zero-order-hold discretisation (eq. 3.28) of one theta (P,) with exact derivatives.

        Args:
            theta: Parameters, (P,).
            head: The collector head.
            sample_time: Ts, s.
            derivatives: False leaves the derivatives empty (parameter axis of length 0).
        """
        n, count = len(STATE_NAMES), len(self.parameters) if derivatives else 0
        steps = theta + 1j * _COMPLEX_STEP * np.eye(count, len(theta))
        A, B = self.continuous(theta, head)
        dA, dB = (matrix.imag / _COMPLEX_STEP for matrix in self.continuous(steps, head))
        # At rest continuous and discrete time agree, and I - A_discrete would cancel digits.
        g = np.linalg.solve(-A, B[:, 0])
        dg = np.linalg.solve(-A, (dA @ g + dB[:, :, 0]).T).T
        size = n + len(INPUT_NAMES)
        augmented, directions = np.zeros((size, size)), np.zeros((count, size, size))
        augmented[:n, :n], augmented[:n, n:] = A, B
        directions[:, :n, :n], directions[:, :n, n:] = dA, dB
        held, slopes = exponential(augmented * sample_time, directions * sample_time, _SCALE)
        A, B, dA, dB = held[:n, :n], held[:n, n:], slopes[:, :n, :n], slopes[:, :n, n:]
        return LocalDynamics(A, B, g, dA, dB, dg)


def _chain(
    v: Mapping[str, Any], shape: tuple[int, ...], dtype: npt.DTypeLike
) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Return A and B of the chain, eq. 3.22 and 3.23, with the extensions b_H and c_H."""
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


def exponential(matrix: Array, directions: Array, scale: Array) -> tuple[Array, Array]:
    """Return exp(X) and its derivatives L_p = d/ds exp(X + s E_p) at s = 0.

    Scaling and squaring of the Taylor series and, term by term, of its derivative: T_k = T_{k-1} X / k,
    L_k = (L_{k-1} X + T_{k-1} E) / k; doubling: L <- T L + L T, T <- T T.

    Args:
        matrix: X, (n, n).
        directions: E, (P, n, n); P may be 0.
        scale: Size of each state, (n,), powers of two (then scaling is exact): it keeps the norm, and with
            it the number of doublings, small.
    """
    n = matrix.shape[0]
    ratio = scale[None, :] / scale[:, None]
    norm = np.abs(matrix * ratio).sum(axis=1).max()
    doublings = max(0, int(np.ceil(np.log2(max(norm, 1e-300) / 0.5))))
    X, E = matrix * ratio * 0.5**doublings, directions * ratio * 0.5**doublings
    term, total = np.eye(n), np.eye(n)
    slope_term, slope_total = np.zeros_like(E), np.zeros_like(E)
    for k in range(1, 19):  # 0.5^19 / 19! is far below rounding
        slope_term = (slope_term @ X + term @ E) / k
        term = term @ X / k
        slope_total, total = slope_total + slope_term, total + term
    for _ in range(doublings):
        slope_total = total @ slope_total + slope_total @ total
        total = total @ total
    return total / ratio, slope_total / ratio


STRUCTURES: Mapping[str, Structure] = {
    structure.name: structure
    for structure in (
        Structure(
            "chain7",
            "three-mass oscillator with known collector head (eq. 3.35)",
            (_M_H, _M_M, _K_L, _C_L, _R_M, _K_W, _C_W),
        ),
        Structure(
            "chain10",
            "three-mass oscillator with free collector head (eq. 3.37)",
            (_M_H, _M_M, _K_L, _C_L, _R_M, _K_W, _C_W, _M_C, _K_C, _C_C),
        ),
    )
}
"""Every structure by name."""

"""The named surrogate structures: which coefficients of the chain of masses are free, within which bounds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from fmu_builder.kernel import CHAINS, ChainParameter
from identification.arrays import Array
from identification.surrogate.chain import (
    INPUT_NAMES,
    OUTPUT_MATRIX,
    OUTPUT_NAMES,
    STATE_NAMES,
    Head,
    LocalDynamics,
    chain_matrices,
    discretised,
    slopes_by_complex_step,
)

__all__ = [
    "INPUT_NAMES",
    "OUTPUT_MATRIX",
    "OUTPUT_NAMES",
    "STATE_NAMES",
    "STRUCTURES",
    "Head",
    "LocalDynamics",
    "Parameter",
    "Structure",
]


@dataclass(frozen=True)
class Parameter(ChainParameter):
    """One free parameter of a structure, as it is searched for.

    Attributes:
        usual: Where a pantograph's value may be looked for when nothing is known: random starts.
    """

    usual: tuple[float, float] | None = None

    def searched(self, value: float) -> float:
        """Return the coordinate of the search of one value."""
        return float(np.log(max(value, self.size * 1e-300))) if self.scaling == "log" else value / self.size

    @property
    def search_bounds(self) -> tuple[float, float]:
        """Lower and upper bound in the coordinate of the search."""
        return self.searched(self.least), self.searched(self.upper)

    @property
    def start_bounds(self) -> tuple[float, float]:
        """Ends of the random starts in the coordinate of the search."""
        low, high = self.search_bounds
        if self.usual is None:
            return low, high
        return max(low, self.searched(self.usual[0])), min(high, self.searched(self.usual[1]))


_USUAL = {
    **{"k_L": (300.0, 3e5), "c_L": (0.3, 1000.0), "r_M": (0.03, 0.6), "k_W": (1.0, 2e4), "c_W": (0.1, 3e3)},
    **{"k_C": (1e3, 1e5), "c_C": (1.0, 300.0)},
}
_USUAL_LIGHT = {
    **{"m_H": (0.5, 30.0), "m_M": (1.0, 50.0), "k_L": (300.0, 3e5), "c_L": (0.3, 1000.0)},
    **{"b_M": (0.05, 10.0), "b_H": (-0.5, 0.5), "k_W": (-300.0, 300.0), "c_W": (-10.0, 30.0)},
    "c_H": (-10.0, 10.0),
}


def _searched(chain: str, usual: Mapping[str, tuple[float, float]]) -> tuple[Parameter, ...]:
    """Return the parameters of a chain with where to look for them."""
    return tuple(Parameter(**asdict(one), usual=usual.get(one.name)) for one in CHAINS[chain])


@dataclass(frozen=True)
class Structure:
    """A named chain: which of its coefficients are free, within which bounds.

    A parameter is a coefficient of the equations of motion (`chain`): m_C, k_C, c_C, m_H, m_M, k_L, c_L, k_W,
    c_W, b_M (1/m), b_H (1/m), c_H; or r_M instead of b_M = 1/r_M. b_H and c_H are zero where they are not
    free. A coefficient of the head that is not free comes from the head.

    Attributes:
        name: Key of `STRUCTURES`.
        description: What distinguishes it, for a person.
        parameters: The free parameters, in order.
        diagram: The chain in one line, beneath it what acts on the masses.
    """

    name: str
    description: str
    parameters: tuple[Parameter, ...]
    diagram: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the free parameters, in order."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds in search coordinates, each (P,)."""
        pairs = np.array([parameter.search_bounds for parameter in self.parameters])
        return pairs[:, 0].copy(), pairs[:, 1].copy()

    @property
    def start_bounds(self) -> tuple[Array, Array]:
        """Ends of the random starts in search coordinates, each (P,)."""
        pairs = np.array([parameter.start_bounds for parameter in self.parameters])
        return pairs[:, 0].copy(), pairs[:, 1].copy()

    @property
    def linear(self) -> Array:
        """One for the parameters searched without a logarithm, else zero, (P,)."""
        return np.array([float(parameter.scaling == "linear") for parameter in self.parameters])

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

    def blended(self, theta: Array, shares: Array) -> Array:
        """Return theta (K, P) blended over the search coordinates: log where a parameter cannot be negative.

        Args:
            theta: Parameters of the local models, (M, P).
            shares: Weight of each at K places, (K, M); rows sum to 1 but may be negative.
        """
        return self.from_search(shares @ self.to_search(theta))

    def moved(self, search: Array, step: Array) -> Array:
        """Return search coordinates (..., P) moved by a step, along the curve on which little changes.

        Of a lower mass that hardly reacts upon the upper one, only (k_L + k_W) / m_M, (c_L + c_W) / m_M and
        k_L b_M / m_M are to be seen. Where k_W and c_W are searched without a logarithm, the valley in which
        the first two stay as they are is curved; a straight step would leave it. Bounds are left to the
        caller.

        Args:
            search: Where, inside the bounds.
            step: Tangent to the curve, (..., P).
        """
        ends = np.asarray(search + step)
        at = {name: index for index, name in enumerate(self.names)}
        for wall, link in (("k_W", "k_L"), ("c_W", "c_L")):
            parameter = self.parameters[at[wall]]
            if parameter.scaling != "linear":
                continue
            mass, upper = np.exp(search[..., at["m_M"]]), np.exp(search[..., at[link]])
            rate = (upper + search[..., at[wall]] * parameter.size) / mass
            change = (upper * step[..., at[link]] + step[..., at[wall]] * parameter.size) / mass
            rate = rate + change - rate * step[..., at["m_M"]]
            with np.errstate(over="ignore"):
                total = np.exp(ends[..., at["m_M"]]) * rate - np.exp(ends[..., at[link]])
            ends[..., at[wall]] = total / parameter.size
        return ends

    def slope(self, theta: Array) -> Array:
        """Return d theta / d search coordinate, (..., P): theta itself for `log`."""
        sizes = np.array([parameter.size for parameter in self.parameters])
        log = np.array([parameter.scaling == "log" for parameter in self.parameters])
        slope: Array = np.where(log, theta, sizes)
        return slope

    def at_bound(self, theta: Array) -> dict[str, str]:
        """Return the parameters of one theta (P,) that stand at a bound, with `lower` or `upper`."""
        found: dict[str, str] = {}
        search = self.to_search(theta)
        for index, (low, high) in enumerate(zip(*self.bounds, strict=True)):
            near = 1e-6 * min(high - low, 10.0)
            if search[index] <= low + near:
                found[self.parameters[index].name] = "lower"
            elif search[index] >= high - near:
                found[self.parameters[index].name] = "upper"
        return found

    def from_coefficients(self, values: Mapping[str, float], head: Head) -> Array:
        """Return theta (P,) of coefficients by name, b_M = 1/r_M included; those of the head from the head.

        Coefficients that this structure does not have are left out, those not given are zero.
        """
        given = {**asdict(head), **values}
        if "b_M" in given and "r_M" not in given:
            given["r_M"] = 1.0 / given["b_M"] if given["b_M"] != 0.0 else float("inf")
        if "r_M" in given and "b_M" not in given:
            given["b_M"] = 1.0 / given["r_M"]
        return np.array([given.get(name, 0.0) for name in self.names])

    def coefficients(self, theta: npt.NDArray[Any], head: Head) -> dict[str, Any]:
        """Return every coefficient of the equations of motion for theta (..., P), real or complex."""
        values: dict[str, Any] = {"b_H": 0.0, "c_H": 0.0, **asdict(head)}
        values |= {name: theta[..., index] for index, name in enumerate(self.names)}
        if "r_M" in values:
            values["b_M"] = 1.0 / values.pop("r_M")
        return values

    def continuous(self, theta: npt.NDArray[Any], head: Head) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
        """Return A (..., 6, 6) and B (..., 6, 2) of eq. 3.22-3.23 for theta (..., P), real or complex."""
        return chain_matrices(self.coefficients(theta, head), theta.shape[:-1], theta.dtype)

    def continuous_slopes(self, theta: Array, head: Head) -> tuple[Array, Array]:
        """Return dA (..., P, 6, 6) and dB (..., P, 6, 2), exact."""
        return slopes_by_complex_step(lambda moved: self.continuous(moved, head), theta, len(self.parameters))

    def discretise(
        self, theta: Array, head: Head, sample_time: float, derivatives: bool = True
    ) -> LocalDynamics:
        """Return the zero-order-hold discretisation (eq. 3.28) of theta (..., P) with exact derivatives.

        Args:
            theta: Parameters, (..., P).
            head: The collector head.
            sample_time: Ts, s.
            derivatives: False leaves the derivatives empty (parameter axis of length 0).
        """
        count = len(self.parameters) if derivatives else 0
        slopes = slopes_by_complex_step(lambda moved: self.continuous(moved, head), theta, count)
        return discretised(self.continuous(theta, head), slopes, sample_time)


_CHAIN = "wire --k_E-- m_C --k_C,c_C-- m_H --k_L,c_L-- m_M --k_W,c_W-- wall"
STRUCTURES: Mapping[str, Structure] = {
    structure.name: structure
    for structure in (
        Structure(
            "chain7",
            "three-mass oscillator with known collector head (eq. 3.35)",
            _searched("chain7", _USUAL),
            f"{_CHAIN};  m_M: M_pa / r_M",
        ),
        Structure(
            "chain8",
            "three-mass oscillator whose torque also acts on the upper mass, frame in balance",
            _searched("chain8", _USUAL_LIGHT),
            f"{_CHAIN};  m_M: b_M M_pa;  m_H: b_H M_pa",
        ),
        Structure(
            "chain9",
            "chain8 with a damper from the upper mass to ground: any framework of two degrees of freedom",
            _searched("chain9", _USUAL_LIGHT),
            f"{_CHAIN};  m_M: b_M M_pa;  m_H: b_H M_pa, c_H to ground",
        ),
        Structure(
            "chain10",
            "three-mass oscillator with free collector head (eq. 3.37)",
            _searched("chain10", _USUAL),
            f"{_CHAIN};  m_M: M_pa / r_M;  m_C, k_C, c_C free",
        ),
    )
}
"""Every structure by name."""

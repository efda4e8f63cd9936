"""The parameters of the surrogates: names, units, limits, how they are blended over the height."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal


@dataclass(frozen=True)
class ChainParameter:
    """One free parameter of a structure.

    Attributes:
        name: The thesis's letter; a coefficient of c/chain.c.
        unit: SI unit.
        description: What it is.
        lower: Lower bound (Table 4.2).
        upper: Upper bound (Table 4.2).
        scaling: Coordinate of the search and of the blend over the height: `log` for parameters that cannot
            be negative, else `linear`.
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
    def least(self) -> float:
        """The smallest value that is computed with."""
        return self.size if self.scaling == "log" and self.lower <= 0.0 else self.lower


_M_H = ChainParameter(
    "m_H", "kg", "mass of the upper part of the lower framework, at the head spring", 5.0, 50.0
)
_M_M = ChainParameter(
    "m_M", "kg", "mass of the lower part of the lower framework, driven by the torque", 5.0, 50.0
)
_K_L = ChainParameter("k_L", "N/m", "stiffness between m_H and m_M", 0.0, 1e7, size=0.1)
_C_L = ChainParameter("c_L", "N.s/m", "damping between m_H and m_M", 1e-3, 2e5)
_R_M = ChainParameter("r_M", "m", "lever arm of the torque on m_M", 1e-3, 0.6)
_K_W = ChainParameter("k_W", "N/m", "stiffness between m_M and the wall", 0.0, 1e7, size=0.1)
_C_W = ChainParameter("c_W", "N.s/m", "damping between m_M and the wall", 0.0, 2e5, size=1e-2)
_M_C = ChainParameter("m_C", "kg", "mass of the collector head", 1.0, 30.0)
_K_C = ChainParameter("k_C", "N/m", "stiffness of the collector head suspension", 1e-7, 1e7)
_C_C = ChainParameter("c_C", "N.s/m", "damping of the collector head suspension", 1e-3, 2e5)
_B_M = ChainParameter("b_M", "1/m", "force per torque on m_M, 1/r_M", 1e-3, 1e3)
_B_H = ChainParameter("b_H", "1/m", "force per torque on m_H", -1e3, 1e3, "linear", 0.1)
_C_H = ChainParameter("c_H", "N.s/m", "damping between m_H and ground", -2e5, 2e5, "linear", 10.0)

# The crossbar alone may be light; the torque acts through the linkage, not by a lever below 0.6 m; and
# a frame in neutral balance has stiffness and damping to the wall of either sign.
_LIGHT = (
    *(replace(_M_H, lower=0.3), replace(_M_M, lower=0.3, upper=150.0), _K_L, _C_L, _B_M, _B_H),
    replace(_K_W, lower=-1e7, scaling="linear", size=100.0),
    replace(_C_W, lower=-2e5, scaling="linear", size=10.0),
)

CHAINS: Mapping[str, tuple[ChainParameter, ...]] = {
    "chain7": (_M_H, _M_M, _K_L, _C_L, _R_M, _K_W, _C_W),
    "chain8": _LIGHT,
    "chain9": (*_LIGHT, _C_H),
    "chain10": (_M_H, _M_M, _K_L, _C_L, _R_M, _K_W, _C_W, _M_C, _K_C, _C_C),
}
"""The free parameters of every structure, in order."""

COEFFICIENTS = (
    *("m_C", "k_C", "c_C", "k_E"),
    *("m_H", "m_M", "k_L", "c_L", "k_W", "c_W", "b_M", "b_H", "c_H", "r_M"),
)
"""Order of `CHAIN_...` in c/chain.c; the first four are the collector head."""

HEAD = COEFFICIENTS[:4]
CHAIN_STATES = ("xi", "xi_dot", "zeta", "zeta_dot", "delta_M", "delta_M_dot")
CHAIN_INPUTS = ("eta", "M_pa")
CHAIN_OUTPUTS = CHAIN_STATES[:4]

CONTACT_STIFFNESS = "k_E"
LEAST_CONTACT_STIFFNESS = 1e3
"""N/m; softer than any contact wire."""
LARGEST_CONTACT_STIFFNESS = 1e7
"""N/m; the head swings at 300 Hz on it."""

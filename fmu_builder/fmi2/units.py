"""The one table of units: what a name means in SI base units."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Unit:
    """A coherent SI unit as a product of powers of base units.

    Attributes:
        kg, m, s, rad: Exponents of the base units.
        display: Other units to show values in: (name, factor), shown value = factor * value.
    """

    kg: int = 0
    m: int = 0
    s: int = 0
    rad: int = 0
    display: tuple[tuple[str, float], ...] = ()

    def exponents(self) -> dict[str, int]:
        """Return the exponents that are not zero, in the order of the FMI schema."""
        found = {"kg": self.kg, "m": self.m, "s": self.s, "rad": self.rad}
        return {base: exponent for base, exponent in found.items() if exponent != 0}


_DEGREES = 180.0 / math.pi

UNITS: Mapping[str, Unit] = {
    "1": Unit(),
    "m": Unit(m=1, display=(("mm", 1000.0),)),
    "m/s": Unit(m=1, s=-1, display=(("km/h", 3.6),)),
    "m/s2": Unit(m=1, s=-2),
    "1/m": Unit(m=-1),
    "rad": Unit(rad=1, display=(("deg", _DEGREES),)),
    "rad/s": Unit(rad=1, s=-1, display=(("deg/s", _DEGREES),)),
    "rad/s2": Unit(rad=1, s=-2),
    "s": Unit(s=1, display=(("ms", 1000.0),)),
    "Hz": Unit(s=-1),
    "1/s": Unit(s=-1),
    "kg": Unit(kg=1),
    "kg.m": Unit(kg=1, m=1),
    "kg.m2": Unit(kg=1, m=2),
    "N": Unit(kg=1, m=1, s=-2, display=(("kN", 0.001),)),
    "N/m": Unit(kg=1, s=-2),
    "N.s/m": Unit(kg=1, s=-1),
    "N.m": Unit(kg=1, m=2, s=-2),
    "N.m/rad": Unit(kg=1, m=2, s=-2, rad=-1),
    "N.m.s/rad": Unit(kg=1, m=2, s=-1, rad=-1),
    "J": Unit(kg=1, m=2, s=-2),
}
"""Name in an FMU -> its meaning. The empty name means: no unit (Boolean, Integer, Enumeration, counts)."""

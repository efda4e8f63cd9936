"""One variable of an FMU, as the modelDescription.xml and the C code both see it."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import KW_ONLY, dataclass

from fmu_builder.errors import Problem
from fmu_builder.files import unwritable_character
from fmu_builder.fmi2.units import UNITS

NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
STRUCTURED_NAME = re.compile(rf"(der\()?{NAME.pattern}(\[\d+\])?(\.{NAME.pattern}(\[\d+\])?)*(?(1)\))")
LONGEST_NAME = 55
"""Simulink cuts names of bus elements and ports beyond this."""

TYPES = ("Real", "Integer", "Boolean", "Enumeration")
_INTEGER_LIMIT = 2**31
_DEFAULT_VARIABILITY = {"parameter": "fixed"}
_DEFAULT_INITIAL = {"parameter": "exact", "input": "exact", "output": "calculated", "local": "calculated"}
_LEGAL = {
    "parameter": ({"fixed", "tunable"}, {"exact"}),
    "input": ({"continuous", "discrete"}, {"exact"}),
    "output": ({"continuous", "discrete"}, {"calculated"}),
    "local": ({"continuous", "discrete", "fixed", "constant"}, {"calculated", "exact"}),
}


@dataclass(frozen=True)
class Variable:
    """One scalar variable. Its value reference is its position in the interface's list.

    Attributes:
        name: C identifier of at most 55 characters.
        type: "Real", "Integer", "Boolean" or "Enumeration".
        causality: "input", "parameter", "output" or "local".
        variability: Empty: "fixed" for parameters, else "continuous" for Real and "discrete" for other types.
            A "tunable" parameter may also be set between communication steps and in event mode.
        initial: Empty: "exact" for inputs and parameters, "calculated" for outputs and locals.
        unit: A name in `UNITS`, or empty for none.
        description: What it is, for a reader.
        start: Value before initialisation: inputs, parameters and constants have one, calculated ones do not.
        minimum, maximum: Trained or physical range. An input outside is served with one warning, a parameter
            outside is refused.
        nominal: Typical size, positive.
        derivative_of: For a state derivative, the name of the state.
        dependencies: For outputs and state derivatives, the inputs and states that act at once; empty:
            none (the importer sees no algebraic loop); None: unknown, all of them.
        enumeration: The items of an Enumeration, whose values are 1, 2, ...
        structured: Name with dots and indices, for an interface with structured names; empty: `name`.
    """

    name: str
    _: KW_ONLY
    type: str = "Real"
    causality: str = "local"
    variability: str = ""
    initial: str = ""
    unit: str = ""
    description: str = ""
    start: float | int | bool | None = None
    minimum: float | None = None
    maximum: float | None = None
    nominal: float | None = None
    derivative_of: str | None = None
    dependencies: tuple[str, ...] | None = ()
    enumeration: tuple[str, ...] = ()
    structured: str = ""

    def __post_init__(self) -> None:
        continuous = "continuous" if self.type == "Real" else "discrete"
        variability = self.variability or _DEFAULT_VARIABILITY.get(self.causality, continuous)
        object.__setattr__(self, "variability", variability)
        object.__setattr__(
            self, "initial", self.initial or _DEFAULT_INITIAL.get(self.causality, "calculated")
        )
        if self.type == "Enumeration":
            object.__setattr__(self, "minimum", 1 if self.minimum is None else self.minimum)
            object.__setattr__(
                self, "maximum", len(self.enumeration) if self.maximum is None else self.maximum
            )

    @property
    def is_known_at_start(self) -> bool:
        """Whether the importer gives its value: inputs and whatever is exact."""
        return self.initial == "exact"

    def problems(self) -> Iterator[Problem]:
        """Yield everything that is wrong with this variable alone."""
        for what, mend in (*self._wrong_words(), *self._wrong_numbers(), *self._wrong_start()):
            yield Problem(f"variable {self.name!r}", what, mend)

    def _wrong_words(self) -> Iterator[tuple[str, str]]:
        if not NAME.fullmatch(self.name):
            yield "is not a C identifier", "Use letters, digits and underscores, no digit first"
        if len(self.name) > LONGEST_NAME:
            yield f"has {len(self.name)} characters", f"Use at most {LONGEST_NAME}"
        if self.structured and not STRUCTURED_NAME.fullmatch(self.structured):
            yield (
                f"has the structured name {self.structured!r}",
                "Use names, indices in brackets, dots, der()",
            )
        for text in (self.description, *self.enumeration):
            found = unwritable_character(text)
            if found is not None:
                yield f"has a text with {found}, which XML cannot carry", "Leave it out"
        if self.type not in TYPES:
            yield f"has the unknown type {self.type!r}", f"Use one of {', '.join(TYPES)}"
        if self.causality not in _LEGAL:
            yield f"has the unknown causality {self.causality!r}", f"Use one of {', '.join(_LEGAL)}"
            return
        variabilities, initials = _LEGAL[self.causality]
        if self.variability not in variabilities:
            mend = f"Use one of {', '.join(sorted(variabilities))}"
            yield f"has variability {self.variability!r}, not possible for {self.causality}", mend
        if self.initial not in initials:
            mend = f"Use one of {', '.join(sorted(initials))}"
            yield f"has initial {self.initial!r}, not possible for {self.causality}", mend
        if self.type != "Real" and self.variability == "continuous":
            yield "is continuous but not Real", "Make it discrete"
        if self.variability == "constant" and self.initial != "exact":
            yield "is constant but has to be calculated", "Make it exact and give its start"
        if self.unit and self.unit not in UNITS:
            yield f"has the unknown unit {self.unit!r}", "Use one of fmu_builder.fmi2.units or add it there"
        if self.unit and self.type != "Real":
            yield f"has a unit but the type {self.type}", "Leave the unit out"

    def _wrong_numbers(self) -> Iterator[tuple[str, str]]:
        numbers = {"minimum": self.minimum, "maximum": self.maximum, "nominal": self.nominal}
        for key, value in numbers.items():
            if value is not None and not math.isfinite(value):
                yield f"has a {key} that is not finite", "Leave it out when there is none"
        if self.minimum is not None and self.maximum is not None and not self.minimum <= self.maximum:
            yield f"has minimum {self.minimum} above maximum {self.maximum}", "Swap them"
        if self.nominal is not None and not self.nominal > 0.0:
            yield f"has nominal {self.nominal}", "Give a positive size"
        if self.type == "Boolean" and (self.minimum, self.maximum, self.nominal) != (None, None, None):
            yield "is Boolean but has limits or a nominal size", "Leave them out"
        if self.type == "Enumeration":
            items = self.enumeration
            if not items or len(set(items)) != len(items) or not all(item.strip() for item in items):
                yield "is an Enumeration without items, or with empty or repeated ones", "Name each item once"
            if (self.minimum, self.maximum) != (1, len(items)):
                yield "is an Enumeration with other limits than its items", "Leave minimum and maximum out"
        elif self.enumeration:
            yield f"has items but the type {self.type}", "Make it an Enumeration"

    def _wrong_start(self) -> Iterator[tuple[str, str]]:
        if self.start is None:
            if self.initial == "exact":
                yield "has no start value", "Give one: inputs, parameters and constants need it"
            return
        if self.initial == "calculated":
            yield "has a start value although it is calculated", "Leave the start value out"
        if isinstance(self.start, bool) != (self.type == "Boolean"):
            yield f"has the start value {self.start!r}, not of type {self.type}", "Give a value of its type"
        elif self.type in ("Integer", "Enumeration") and (
            not isinstance(self.start, int) or not -_INTEGER_LIMIT <= self.start < _INTEGER_LIMIT
        ):
            yield f"has the start value {self.start!r}, not a 32-bit integer", "Give an integer"
        elif not math.isfinite(self.start):
            yield f"has the start value {self.start}", "Give a finite number"
        else:
            below = self.minimum is not None and self.start < self.minimum
            if below or (self.maximum is not None and self.start > self.maximum):
                what = f"has the start value {self.start} outside [{self.minimum}, {self.maximum}]"
                yield what, "Start inside the limits"

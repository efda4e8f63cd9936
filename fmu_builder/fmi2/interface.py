"""What an FMU shows to the outside: its name, its variables and how to run it."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

from fmu_builder.errors import BuildError, Problem
from fmu_builder.files import unwritable_character
from fmu_builder.fmi2.variable import LONGEST_NAME, NAME, Variable

NAMINGS = ("flat", "structured")
_ORDER = {"input": 0}


@dataclass(frozen=True)
class Interface:
    """The interface of one FMU, refused with all its problems at once when something is wrong.

    Attributes:
        model_identifier: C identifier: name of the binary and prefix of the functions in a static build.
        model_name: Name for a reader.
        description: What the model is, one or two sentences.
        variables: Inputs first; the position is the value reference.
        states: Names of the continuous states, each with exactly one variable that is `derivative_of` it; in
            the order of those variables, which is the order of the state vector in model exchange. A model
            without any is sampled: in model exchange it has a time event at every tick.
        default_step: Proposed communication step, s.
        stop_time: Proposed end of a simulation from 0, s.
        licence: Licence of the model, short ("MIT").
        author: Who made it.
        tool: Name and version of the generating tool.
        version: Version of the model.
        copyright: Whose it is.
        directional_derivatives: Whether the model provides exact partial derivatives.
        event_indicators: How many numbers tell an integrator by a change of their sign that the equations
            have a kink there (model exchange); only for a model with continuous states.
        naming: "flat", which every importer takes, or "structured": `theta[2].m_H`, `der(xi)` where variables
            have such a name.

    Raises:
        BuildError: Names every problem of the interface and of its variables.
    """

    model_identifier: str
    model_name: str
    description: str
    variables: tuple[Variable, ...]
    states: tuple[str, ...] = ()
    default_step: float = 0.001
    stop_time: float = 10.0
    licence: str = "MIT"
    author: str = ""
    tool: str = "pantograph-llmn"
    version: str = "1.0.0"
    copyright: str = ""
    directional_derivatives: bool = True
    event_indicators: int = 0
    naming: str = "flat"

    def __post_init__(self) -> None:
        object.__setattr__(self, "variables", tuple(self.variables))
        object.__setattr__(self, "states", tuple(self.states))
        own = (problem for variable in self.variables for problem in variable.problems())
        problems = [*self._problems(), *own, *self._wrong_names(), *self._wrong_states()]
        if problems:
            raise BuildError(problems)

    @property
    def inputs(self) -> tuple[Variable, ...]:
        """The variables with causality "input"; their value references are 0, 1, ..."""
        return self.of_causality("input")

    def of_causality(self, causality: str) -> tuple[Variable, ...]:
        """Return the variables with this causality in order."""
        return tuple(variable for variable in self.variables if variable.causality == causality)

    def shown_name(self, variable: Variable) -> str:
        """Return the name of one of the variables in the naming of this interface."""
        return variable.structured if self.naming == "structured" and variable.structured else variable.name

    def value_reference(self, name: str) -> int:
        """Return the value reference of a variable.

        Raises:
            KeyError: There is no such variable.
        """
        for position, variable in enumerate(self.variables):
            if variable.name == name:
                return position
        raise KeyError(name)

    def guid(self, model_hash: str) -> str:
        """Return the GUID of this interface with a model of that hash, as "{8-4-4-4-12}"."""
        content = {"model": model_hash, "interface": dataclasses.asdict(self)}
        text = json.dumps(content, sort_keys=True, ensure_ascii=True, separators=(",", ":"))
        digest = hashlib.sha256(text.encode("ascii")).hexdigest()
        parts = (digest[:8], digest[8:12], digest[12:16], digest[16:20], digest[20:32])
        return "{" + "-".join(parts) + "}"

    def _problems(self) -> Iterator[Problem]:
        place = f"interface {self.model_identifier!r}"
        if not NAME.fullmatch(self.model_identifier) or len(self.model_identifier) > LONGEST_NAME:
            mend = f"Use letters, digits and underscores, no digit first, at most {LONGEST_NAME}"
            yield Problem(place, "the model identifier is not a short C identifier", mend)
        if not self.variables:
            yield Problem(place, "there are no variables", "List at least one")
        if not (math.isfinite(self.default_step) and self.default_step > 0.0):
            yield Problem(place, f"default_step is {self.default_step}", "Give a positive time in s")
        if not (math.isfinite(self.stop_time) and self.stop_time > 0.0):
            yield Problem(place, f"stop_time is {self.stop_time}", "Give a positive time in s")
        if self.event_indicators < 0 or (self.event_indicators and not self.states):
            what = f"event_indicators is {self.event_indicators} with {len(self.states)} continuous states"
            yield Problem(place, what, "Give 0, or a positive number for a model with continuous states")
        texts = ("model_name", "description", "licence", "author", "tool", "version", "copyright")
        for name in texts:
            found = unwritable_character(getattr(self, name))
            if found is not None:
                yield Problem(place, f"{name} holds {found}, which XML cannot carry", "Leave it out")
        ranks = [_ORDER.get(variable.causality, 1) for variable in self.variables]
        if ranks != sorted(ranks):
            yield Problem(place, "an input stands behind another variable", "List the inputs first")

    def _wrong_names(self) -> Iterator[Problem]:
        if self.naming not in NAMINGS:
            what = f"has the naming {self.naming!r}"
            yield Problem(f"interface {self.model_identifier!r}", what, f"Use one of: {', '.join(NAMINGS)}")
        names = Counter(variable.name for variable in self.variables)
        shown = Counter(self.shown_name(variable) for variable in self.variables)
        names |= {name: count for name, count in shown.items() if count > 1}
        for name, count in names.items():
            if count > 1:
                yield Problem(f"variable {name!r}", f"is there {count} times", "Use each name once")
        causality = {variable.name: variable.causality for variable in self.variables}
        for variable in self.variables:
            for name in variable.dependencies or ():
                place = f"variable {variable.name!r}"
                if name not in causality:
                    yield Problem(place, f"depends on {name!r}, which does not exist", "Name a variable")
                elif causality[name] != "input" and name not in self.states:
                    what = f"depends on {name!r}, neither an input nor a state"
                    yield Problem(place, what, "Name the inputs and states that act on it")

    def _wrong_states(self) -> Iterator[Problem]:
        by_name = {variable.name: variable for variable in self.variables}
        derivatives = Counter(v.derivative_of for v in self.variables if v.derivative_of is not None)
        for state in dict.fromkeys((*self.states, *derivatives)):
            place = f"state {state!r}"
            variable = by_name.get(state)
            if variable is None:
                yield Problem(place, "is not a variable", "Add it to the variables")
            elif (variable.type, variable.variability) != (
                "Real",
                "continuous",
            ) or variable.causality not in (
                "output",
                "local",
            ):
                yield Problem(place, "is not a continuous Real output or local", "Make it one")
            if derivatives[state] != 1:
                what = f"has {derivatives[state]} derivatives"
                yield Problem(place, what, "Give exactly one variable derivative_of=" + repr(state))
            if self.states.count(state) != 1:
                yield Problem(place, "does not stand in `states` exactly once", "List every state once")
        if sorted(derivatives) == sorted(self.states) and tuple(derivatives) != self.states:
            what = "the states stand in another order than their derivatives"
            mend = "List both in the same order: it is that of the state vector in model exchange"
            yield Problem(f"interface {self.model_identifier!r}", what, mend)

"""ModelVariables: kinds, start values, limits, value references."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping

from fmu_builder.check.description import Description, ScalarVariable, number
from fmu_builder.check.finding import Finding, Severity, standard

_SECTION = standard("2.2.7")
_SOMETIMES = {"calculated", "exact", "approx"}
_LEGAL: Mapping[tuple[str, str], set[str]] = {
    ("parameter", "fixed"): {"exact"},
    ("parameter", "tunable"): {"exact"},
    ("calculatedParameter", "fixed"): {"calculated", "approx"},
    ("calculatedParameter", "tunable"): {"calculated", "approx"},
    ("input", "discrete"): {""},
    ("input", "continuous"): {""},
    ("output", "constant"): {"exact"},
    ("output", "discrete"): _SOMETIMES,
    ("output", "continuous"): _SOMETIMES,
    ("local", "constant"): {"exact"},
    ("local", "fixed"): {"calculated", "approx"},
    ("local", "tunable"): {"calculated", "approx"},
    ("local", "discrete"): _SOMETIMES,
    ("local", "continuous"): _SOMETIMES,
    ("independent", "continuous"): {""},
}
_Trouble = tuple[str, str, str]
"""Rule, what is wrong, mend."""


def _kind_troubles(variable: ScalarVariable) -> Iterator[_Trouble]:
    if not variable.name:
        yield "variable-name", "has no name", "Name it"
    if not variable.type:
        yield "variable-type", "has no type", "Say what it is: Real, Integer, Boolean, String or Enumeration"
    if variable.value_reference is None:
        yield "value-reference", "has no value reference", "Give one"
    if variable.type not in ("", "Real") and variable.variability == "continuous":
        yield "variability", f"is continuous but {variable.type}", "Make it discrete"
        return
    initials = _LEGAL.get((variable.causality, variable.variability))
    if initials is None:
        what = f"is a {variable.causality} with variability {variable.variability!r}, which cannot be"
        legal = [kind for causality, kind in _LEGAL if causality == variable.causality]
        yield "causality", what, f"Use one of {', '.join(legal)}" if legal else "Use a known causality"
    elif variable.initial not in initials:
        what = f"is a {variable.variability} {variable.causality} with initial={variable.initial!r}"
        mend = "Leave initial out" if initials == {""} else f"Use one of {', '.join(sorted(initials))}"
        yield "initial", what, mend
    if variable.causality == "independent" and variable.type != "Real":
        yield "causality", "is the independent variable but not Real", "Make it Real"


def _start_troubles(variable: ScalarVariable) -> Iterator[_Trouble]:
    needs = variable.initial in ("exact", "approx") or variable.causality == "input"
    if needs and variable.start is None:
        yield "start-missing", "has no start value", "Give one, at an operating point"
    if variable.start is not None and variable.initial == "calculated":
        yield "start-calculated", "has a start value although it is calculated", "Leave the start value out"
    if variable.start is not None and variable.causality == "independent":
        yield "start-calculated", "is the independent variable and has a start value", "Leave it out"


def _limit_troubles(variable: ScalarVariable, attributes: Mapping[str, str]) -> Iterator[_Trouble]:
    low, high = number(attributes.get("min")), number(attributes.get("max"))
    if low is not None and high is not None and low > high:
        yield "limits", f"has min {low:g} above max {high:g}", "Swap them"
    nominal = number(attributes.get("nominal"))
    if nominal is not None and not nominal > 0.0:
        yield "nominal", f"has nominal {nominal:g}", "Give a positive size"
    if variable.start is None or variable.type not in ("Real", "Integer", "Enumeration"):
        return
    start = number(variable.start)
    if start is None or start - start != 0.0:
        yield "start-value", f"has the start value {variable.start!r}", "Give a finite number"
    elif (low is not None and start < low) or (high is not None and start > high):
        inside = f"[{attributes.get('min', '-inf')}, {attributes.get('max', 'inf')}]"
        yield "start-limits", f"has the start value {variable.start} outside {inside}", "Start inside"


def _item_troubles(variable: ScalarVariable, description: Description) -> Iterator[_Trouble]:
    declared = description.types.get(variable.own.get("declaredType", ""))
    if variable.type == "Enumeration" and variable.start is not None and declared is not None:
        items = {number(item) for item in declared[2]}
        if number(variable.start) not in items:
            yield "start-limits", f"starts at {variable.start}, which is no item of its type", "Name an item"


def _derivative_troubles(variable: ScalarVariable, description: Description) -> Iterator[_Trouble]:
    text = variable.own.get("derivative")
    if text is None:
        return
    state = description.at(variable.state)
    if state is None:
        yield "derivative", f"is the derivative of variable {text}, which does not exist", "Count from 1"
    elif state.type != "Real" or state.variability != "continuous" or state is variable:
        yield (
            "derivative",
            f"is the derivative of {state.name!r}, which is no continuous Real",
            "Name the state by its position in ModelVariables, counted from 1",
        )


def _name_findings(variables: tuple[ScalarVariable, ...]) -> Iterator[Finding]:
    seen: dict[str, ScalarVariable] = {}
    for variable in variables:
        first = seen.setdefault(variable.name, variable)
        if first is not variable:
            what = f"has the name of the variable in line {first.line}"
            yield Finding(
                Severity.ERROR, "duplicate-name", variable.place, what, _SECTION, "Use each name once"
            )
    times = [variable for variable in variables if variable.causality == "independent"]
    for variable in times[1:]:
        what = "is a second independent variable"
        yield Finding(Severity.ERROR, "causality", variable.place, what, _SECTION, "Keep one")


def _is_set_from_outside(variable: ScalarVariable) -> bool:
    if variable.variability == "constant":
        return False
    return variable.causality in ("input", "parameter") or variable.initial in ("exact", "approx")


def _alias_findings(variables: tuple[ScalarVariable, ...]) -> Iterator[Finding]:
    """Variables of one type with one value reference are one variable: only one of them may be set."""
    groups: dict[tuple[str, int | None], list[ScalarVariable]] = defaultdict(list)
    for variable in variables:
        if variable.value_reference is not None:
            groups[variable.base_type, variable.value_reference].append(variable)
    for (_, reference), members in groups.items():
        settable = [variable for variable in members if _is_set_from_outside(variable)]
        for variable in settable[1:]:
            what = f"shares the value reference {reference} with {settable[0].name!r}, and both are set"
            inputs = variable.causality == settable[0].causality == "input"
            rule = "input-value-reference" if inputs else "value-reference"
            mend = "Give each its own value reference"
            yield Finding(Severity.ERROR, rule, variable.place, what, _SECTION, mend)
        units = {variable.own.get("unit") for variable in members if variable.type == "Real"} - {None}
        if len(units) > 1:
            what = f"shares the value reference {reference} with variables of other units"
            mend = "Give aliases the same unit"
            yield Finding(Severity.ERROR, "alias-unit", members[0].place, what, _SECTION, mend)


def variable_findings(description: Description) -> Iterator[Finding]:
    """Yield what is wrong with the variables, each alone and together."""
    for variable in description.variables:
        attributes = description.with_type(variable)
        for rule, what, mend in (
            *_kind_troubles(variable),
            *_start_troubles(variable),
            *_limit_troubles(variable, attributes),
            *_item_troubles(variable, description),
            *_derivative_troubles(variable, description),
        ):
            yield Finding(Severity.ERROR, rule, variable.place, what, _SECTION, mend)
    yield from _name_findings(description.variables)
    yield from _alias_findings(description.variables)

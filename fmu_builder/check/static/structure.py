"""ModelStructure: every unknown listed once, by positions that exist."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from fmu_builder.check.description import Description, ScalarVariable, Unknown, place_of
from fmu_builder.check.finding import Finding, Severity, standard

_SECTION = standard("2.2.8")
_COUNT = "Give the position in ModelVariables, counted from 1"


def _finding(rule: str, place: str, what: str, mend: str, severity: Severity = Severity.ERROR) -> Finding:
    return Finding(severity, rule, place, what, _SECTION, mend)


def _place(tag: str, unknown: Unknown) -> str:
    return f"{place_of(unknown.line)}, {tag}"


def _names(variables: list[ScalarVariable]) -> str:
    shown = ", ".join(repr(variable.name) for variable in variables[:8])
    return shown + (f" and {len(variables) - 8} more" if len(variables) > 8 else "")


def _index_findings(description: Description, tag: str) -> Iterator[Finding]:
    count = len(description.variables)
    unknowns = description.structure[tag]
    for unknown in unknowns:
        if description.at(unknown.index) is None:
            what = f"has index {unknown.index}, but positions run from 1 to {count}"
            yield _finding("structure-index", _place(tag, unknown), what, _COUNT)
    for index, number in Counter(unknown.index for unknown in unknowns).items():
        variable = description.at(index)
        if number > 1 and variable is not None:
            place = _place(tag, next(u for u in unknowns if u.index == index))
            what = f"lists {variable.name!r} {number} times"
            yield _finding("structure-duplicate", place, what, "List each unknown once")


def _is_known(tag: str, variable: ScalarVariable, states: set[int | None]) -> bool:
    """Whether a variable may stand in the dependencies of an entry of this list."""
    if variable.causality in ("input", "independent"):
        return True
    if tag == "InitialUnknowns":
        return variable.initial in ("exact", "approx") or variable.variability == "constant"
    return variable.position in states


def _dependency_findings(description: Description, tag: str) -> Iterator[Finding]:
    states = {variable.state for variable in description.variables}
    for unknown in description.structure[tag]:
        place, named = _place(tag, unknown), unknown.dependencies
        if unknown.kinds is not None and (named is None or len(named) != len(unknown.kinds)):
            what = "has dependenciesKind that do not pair with dependencies"
            yield _finding("dependency-kinds", place, what, "Give one kind per dependency")
        for position in named or ():
            variable = description.at(position)
            if variable is None:
                what = f"depends on position {position}, which does not exist"
                yield _finding("dependency", place, what, _COUNT)
            elif not _is_known(tag, variable, states):
                what = f"depends on {variable.name!r}, a {variable.variability} {variable.causality}"
                mend = "Name inputs and continuous states (and in InitialUnknowns what is exact)"
                yield _finding("dependency-known", place, what, mend, Severity.WARNING)
        if len(set(named or ())) != len(named or ()):
            yield _finding("dependency", place, "names a dependency twice", "Name each once")


def _output_findings(description: Description) -> Iterator[Finding]:
    listed = {unknown.index for unknown in description.structure["Outputs"]}
    missing = [v for v in description.variables if v.causality == "output" and v.position not in listed]
    wrong = [
        v
        for index in sorted(index for index in listed if index is not None)
        if (v := description.at(index)) is not None and v.causality != "output"
    ]
    if missing:
        what = f"lacks {_names(missing)}"
        yield _finding("outputs-missing", "ModelStructure, Outputs", what, "List every output")
    if wrong:
        what = f"lists {_names(wrong)}, not of causality output"
        mend = "List outputs only, by their position counted from 1"
        yield _finding("outputs-wrong", "ModelStructure, Outputs", what, mend)


def _derivative_findings(description: Description) -> Iterator[Finding]:
    listed = [description.at(unknown.index) for unknown in description.structure["Derivatives"]]
    wrong = [v for v in listed if v is not None and "derivative" not in v.own]
    if wrong:
        what = f"lists {_names(wrong)}, which do not say whose derivative they are"
        mend = "Give them the attribute derivative"
        yield _finding("derivatives-wrong", "ModelStructure, Derivatives", what, mend)
    there = {v.position for v in listed if v is not None}
    missing = [v for v in description.variables if "derivative" in v.own and v.position not in there]
    if missing and "ModelExchange" in description.interfaces:
        what = f"lacks {_names(missing)}, which have the attribute derivative"
        mend = "List them if their states are continuous states of the model"
        yield _finding("derivatives-missing", "ModelStructure, Derivatives", what, mend, Severity.NOTE)


def _expected_initially(description: Description) -> dict[int, ScalarVariable]:
    """Return what InitialUnknowns must list, by position."""
    exposed = [v for v in description.variables if v.causality == "output"]
    for unknown in description.structure["Derivatives"]:
        derivative = description.at(unknown.index)
        if derivative is None:
            continue
        state = description.at(derivative.state)
        exposed.extend(v for v in (derivative, state) if v is not None)
    expected = {v.position: v for v in exposed if v.initial in ("approx", "calculated")}
    calculated = {v.position: v for v in description.variables if v.causality == "calculatedParameter"}
    return {**expected, **calculated}


def _initial_findings(description: Description) -> Iterator[Finding]:
    place = "ModelStructure, InitialUnknowns"
    unknowns = description.structure["InitialUnknowns"]
    expected = _expected_initially(description)
    listed = [unknown.index for unknown in unknowns]
    missing = [expected[position] for position in sorted(set(expected) - set(listed))]
    wrong = [
        v for v in map(description.at, dict.fromkeys(listed)) if v is not None and v.position not in expected
    ]
    if missing:
        mend = "List outputs, states and derivatives that are calculated, and calculated parameters"
        yield _finding("initial-unknowns-missing", place, f"lacks {_names(missing)}", mend)
    if wrong:
        what = f"lists {_names(wrong)}, which are not unknown at the start"
        mend = "List calculated outputs, states, derivatives and parameters only, by position counted from 1"
        yield _finding("initial-unknowns-wrong", place, what, mend)
    order = [index for index in listed if index is not None]
    if order != sorted(order):
        what = "is not in ascending order"
        yield _finding("initial-unknowns-order", place, what, "Sort it by index")


def _shift_finding(description: Description) -> Iterator[Finding]:
    """Everything wrong by one is one mistake: say so."""
    outputs = {v.position for v in description.variables if v.causality == "output"}
    listed = {unknown.index for unknown in description.structure["Outputs"]}
    if outputs and listed != outputs and listed == {position - 1 for position in outputs}:
        what = "counts positions from 0"
        yield _finding("structure-zero-based", "ModelStructure", what, _COUNT)


def structure_findings(description: Description) -> Iterator[Finding]:
    """Yield what is wrong with ModelStructure."""
    yield from _shift_finding(description)
    for tag in description.structure:
        yield from _index_findings(description, tag)
        yield from _dependency_findings(description, tag)
    yield from _output_findings(description)
    yield from _derivative_findings(description)
    yield from _initial_findings(description)

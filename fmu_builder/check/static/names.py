"""Names of variables: the standard's conventions, and what importers make of them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

from fmu_builder.check.archive import DESCRIPTION
from fmu_builder.check.description import Description, ScalarVariable
from fmu_builder.check.finding import Finding, Severity, practice, standard

_QUOTED = r"""'(?:[A-Za-z0-9_!#$%&()*+,\-./:;<>=?@\[\]^{}|~ ]|\\['"?\\abfnrtv])+'"""
_NAME = rf"(?:[A-Za-z_][A-Za-z0-9_]*|{_QUOTED})"
_INDICES = r"(?:\[\d+(?:,\d+)*\])?"
_PATH = rf"{_NAME}{_INDICES}(?:\.{_NAME}{_INDICES})*"
_STRUCTURED = re.compile(rf"{_PATH}|der\({_PATH}(?:,\d+)?\)", re.ASCII)
_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_]*", re.ASCII)
_LONGEST_IN_SIMULINK = 55
_SHOWN = 5
# The reserved words of the Modelica language specification 3.6, section 2.3.3.
_MODELICA = frozenset(
    """
    algorithm and annotation assert block break class connect connector constant constrainedby der discrete
    each else elseif elsewhen encapsulated end enumeration equation expandable extends external false final
    flow for function if import impure in initial inner input loop model not operator or outer output package
    parameter partial protected public pure record redeclare replaceable return stream then true type when
    while within
    """.split()  # noqa: SIM905 - forty names read better as text
)
_SEEN = ("input", "output", "parameter", "calculatedParameter")


def _standard_findings(description: Description) -> Iterator[Finding]:
    structured = description.attributes.get("variableNamingConvention", "flat") == "structured"
    for variable in description.variables:
        if structured and not _STRUCTURED.fullmatch(variable.name):
            what = "is no name of the convention 'structured'"
            mend = "Write a path of identifiers with indices, a.b[1].c or der(a.b), or quote with '...'"
        elif any(letter in variable.name for letter in "\r\n\t"):
            what, mend = "has a line feed, carriage return or tab in its name", "Leave it out"
        else:
            continue
        yield Finding(Severity.ERROR, "variable-name", variable.place, what, standard("2.2.9"), mend)


def _group(
    variables: list[ScalarVariable],
    holds: Callable[[str], bool],
    rule: str,
    importer: str,
    what: str,
    mend: str,
    severity: Severity = Severity.WARNING,
) -> Iterator[Finding]:
    """One finding for all names that an importer dislikes in the same way."""
    found = [variable.name for variable in variables if holds(variable.name)]
    if found:
        shown = ", ".join(map(repr, found[:_SHOWN])) + (
            f" and {len(found) - _SHOWN} more" * (len(found) > _SHOWN)
        )
        yield Finding(severity, rule, f"{DESCRIPTION}, variables {shown}", what, practice(importer), mend)


def name_findings(description: Description) -> Iterator[Finding]:
    """Yield names that break the declared convention, and per importer the names it changes or refuses."""
    yield from _standard_findings(description)
    shown = [variable for variable in description.variables if variable.causality in _SEEN]
    use_flat = "Use letters, digits and underscores"
    yield from _group(
        shown, lambda name: len(name) > _LONGEST_IN_SIMULINK, "name-simulink", "Simulink",
        f"have more than {_LONGEST_IN_SIMULINK} characters, which ports and bus elements cut",
        f"Use at most {_LONGEST_IN_SIMULINK} characters",
    )  # fmt: skip
    yield from _group(
        shown, lambda name: bool({".", "["} & set(name)), "name-simulink", "Simulink",
        "have dots or brackets, of which the FMU block makes buses", use_flat, Severity.NOTE,
    )  # fmt: skip
    yield from _group(
        shown, lambda name: bool({".", "[", "]"} & set(name)), "name-twin-builder", "Ansys Twin Builder",
        "have dots or brackets, which it does not support", use_flat,
    )  # fmt: skip
    yield from _group(
        shown, lambda name: name in _MODELICA, "name-modelica", "Modelica tools",
        "are reserved words of Modelica", "Use another name",
    )  # fmt: skip
    yield from _group(
        shown,
        lambda name: not _PLAIN.fullmatch(name) and not _STRUCTURED.fullmatch(name),
        "name-modelica", "Modelica tools",
        "are no identifiers; importers change or quote them", use_flat,
    )  # fmt: skip
    folded: dict[str, str] = {}
    clashes = {v.name for v in shown if folded.setdefault(v.name.lower(), v.name) != v.name}
    yield from _group(
        shown, clashes.__contains__, "name-case", "Ansys Twin Builder and other tools that fold case",
        "differ from another name in upper and lower case only", "Rename one", Severity.NOTE,
    )  # fmt: skip

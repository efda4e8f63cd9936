"""Reading anybody's modelDescription.xml: leniently, so that everything wrong with it can be said at once."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from lxml import etree

from fmu_builder.check.archive import DESCRIPTION
from fmu_builder.check.finding import Finding, Severity, practice, standard

TYPES = ("Real", "Integer", "Boolean", "String", "Enumeration")
_LARGEST_DESCRIPTION = 256 << 20
_MOST_SCHEMA_ERRORS = 50
_LONGEST_FILE_NAME = 200
IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*", re.ASCII)
"""Of C."""

_FIXED_OR_TUNABLE = ("fixed", "tunable")


def place_of(line: int) -> str:
    """Return how a line of the description is named in a finding."""
    return f"{DESCRIPTION}, line {line}"


def number(text: str | None) -> float | None:
    """Return a text as a number, or None where it is none."""
    try:
        value = None if text is None else float(text)
    except ValueError:
        return None
    return value


def integer(text: str | None) -> int | None:
    """Return a text as an integer, or None where it is none."""
    try:
        return None if text is None else int(text)
    except ValueError:
        return None


@dataclass(frozen=True)
class ScalarVariable:
    """One variable as the file gives it, with the defaults of the standard filled in.

    Attributes:
        position: 1-based position in ModelVariables, which ModelStructure counts by.
        line: Line of the file.
        type: "Real", ...; empty when there is none.
        initial: Empty for inputs and the independent variable, which have none.
        own: Attributes of the type element (start, min, max, unit, ...).
    """

    position: int
    line: int
    name: str
    value_reference: int | None
    causality: str
    variability: str
    initial: str
    type: str
    own: Mapping[str, str]

    @property
    def place(self) -> str:
        """Where it stands, for a finding."""
        return f"{place_of(self.line)}, variable {self.name!r}"

    @property
    def state(self) -> int | None:
        """Position of the state whose derivative it is, None when it is none or says nonsense."""
        return integer(self.own.get("derivative"))

    @property
    def base_type(self) -> str:
        """The type whose value references it shares: enumerations are integers to the functions."""
        return "Integer" if self.type == "Enumeration" else self.type

    @property
    def start(self) -> str | None:
        """The start value as text."""
        return self.own.get("start")


@dataclass(frozen=True)
class Unknown:
    """One entry of ModelStructure; `dependencies` is None where the attribute is absent."""

    line: int
    index: int | None
    dependencies: tuple[int | None, ...] | None
    kinds: tuple[str, ...] | None


@dataclass(frozen=True)
class Description:
    """A modelDescription.xml.

    Attributes:
        attributes: Of the root element.
        interfaces: "CoSimulation" and "ModelExchange" -> attributes, those that are there.
        sources: The same -> names of the source files to compile.
        units: Name -> names of its display units.
        types: Name -> (type, attributes, values of its items).
        structure: "Outputs", "Derivatives", "InitialUnknowns" -> entries.
        root: The element, for what is looked at once only.
    """

    attributes: Mapping[str, str]
    interfaces: Mapping[str, Mapping[str, str]]
    sources: Mapping[str, tuple[str, ...]]
    units: Mapping[str, frozenset[str]]
    types: Mapping[str, tuple[str, Mapping[str, str], tuple[str, ...]]]
    variables: tuple[ScalarVariable, ...]
    structure: Mapping[str, tuple[Unknown, ...]]
    root: Any

    def at(self, position: int | None) -> ScalarVariable | None:
        """Return the variable at a 1-based position, or None."""
        inside = position is not None and 1 <= position <= len(self.variables)
        return self.variables[position - 1] if inside and position is not None else None

    def with_type(self, variable: ScalarVariable) -> Mapping[str, str]:
        """Return a variable's attributes with those of its declared type filled in."""
        declared = self.types.get(variable.own.get("declaredType", ""))
        return {**(declared[1] if declared else {}), **variable.own}

    def identifier(self, kind: str) -> str:
        """Return the modelIdentifier of an interface, empty where it is none: it names files."""
        name = self.interfaces[kind].get("modelIdentifier", "")
        return name if IDENTIFIER.fullmatch(name) and len(name) <= _LONGEST_FILE_NAME else ""

    def default_step(self) -> float | None:
        """Return the proposed communication step in s, where there is a usable one."""
        element = self.root.find("DefaultExperiment")
        step = number(element.get("stepSize")) if element is not None else None
        return step if step is not None and math.isfinite(step) and step > 0.0 else None


def default_initial(causality: str, variability: str) -> str:
    """Return the value of `initial` where it is not given; empty where there is none."""
    if causality in ("input", "independent"):
        return ""
    if variability == "constant" or (causality == "parameter" and variability in _FIXED_OR_TUNABLE):
        return "exact"
    return "calculated"


def _variable(position: int, element: Any) -> ScalarVariable:
    kind = next((child for child in element if child.tag in TYPES), None)
    causality = element.get("causality", "local")
    variability = element.get("variability", "continuous")
    return ScalarVariable(
        position=position,
        line=element.sourceline,
        name=element.get("name", ""),
        value_reference=integer(element.get("valueReference")),
        causality=causality,
        variability=variability,
        initial=element.get("initial", default_initial(causality, variability)),
        type="" if kind is None else kind.tag,
        own={} if kind is None else dict(kind.attrib),
    )


def _unknown(element: Any) -> Unknown:
    dependencies, kinds = element.get("dependencies"), element.get("dependenciesKind")
    return Unknown(
        line=element.sourceline,
        index=integer(element.get("index")),
        dependencies=None if dependencies is None else tuple(map(integer, dependencies.split())),
        kinds=None if kinds is None else tuple(kinds.split()),
    )


def _types(root: Any) -> dict[str, tuple[str, Mapping[str, str], tuple[str, ...]]]:
    found: dict[str, tuple[str, Mapping[str, str], tuple[str, ...]]] = {}
    for simple in root.iterfind("TypeDefinitions/SimpleType"):
        kind = next((child for child in simple if child.tag in TYPES), None)
        if kind is not None:
            items = tuple(item.get("value", "") for item in kind.iterfind("Item"))
            found[simple.get("name", "")] = (kind.tag, dict(kind.attrib), items)
    return found


def _description(root: Any) -> Description:
    kinds = ("CoSimulation", "ModelExchange")
    elements = {name: element for name in kinds if (element := root.find(name)) is not None}
    listed = root.iterfind("ModelVariables/ScalarVariable")
    return Description(
        attributes=dict(root.attrib),
        interfaces={name: dict(element.attrib) for name, element in elements.items()},
        sources={
            name: tuple(file.get("name", "") for file in element.iterfind("SourceFiles/File"))
            for name, element in elements.items()
        },
        units={
            unit.get("name", ""): frozenset(d.get("name", "") for d in unit.iterfind("DisplayUnit"))
            for unit in root.iterfind("UnitDefinitions/Unit")
        },
        types=_types(root),
        variables=tuple(_variable(position, item) for position, item in enumerate(listed, start=1)),
        structure={
            tag: tuple(map(_unknown, root.iterfind(f"ModelStructure/{tag}/Unknown")))
            for tag in ("Outputs", "Derivatives", "InitialUnknowns")
        },
        root=root,
    )


def _schema_findings(tree: Any) -> list[Finding]:
    """Compare with the XML schema of FMI 2.0, which comes with fmpy."""
    spec = find_spec("fmpy")
    if spec is None or spec.origin is None:
        return []
    file = Path(spec.origin).parent / "schema" / "fmi2" / "fmi2ModelDescription.xsd"
    schema = etree.XMLSchema(file=str(file))
    schema.validate(tree)
    mend = "Write what the schema asks for"
    return [
        Finding(Severity.ERROR, "schema", place_of(error.line), error.message, standard("2.2"), mend)
        for error in list(schema.error_log)[:_MOST_SCHEMA_ERRORS]
    ]


def _refusal(rule: str, what: str, mend: str, paragraph: str = standard("2.2.1")) -> Finding:
    return Finding(Severity.ERROR, rule, DESCRIPTION, what, paragraph, mend)


def read_description(folder: Path) -> tuple[Description | None, list[Finding]]:
    """Read modelDescription.xml of an unpacked FMU.

    No entity is expanded and nothing is fetched.

    Args:
        folder: Where the FMU is unpacked.

    Returns:
        The description, None when it cannot be read or is not FMI 2.0; and what is wrong with it as XML.
    """
    file = folder / DESCRIPTION
    if not file.is_file():
        return None, []
    if file.stat().st_size > _LARGEST_DESCRIPTION:
        return None, [_refusal("xml", "is larger than 256 MiB", "Expose fewer variables", practice("safety"))]
    parser = etree.XMLParser(
        resolve_entities=False, no_network=True, load_dtd=False, remove_comments=True, remove_pis=True
    )
    try:
        tree = etree.parse(str(file), parser)
    except (etree.XMLSyntaxError, OSError, ValueError) as reason:
        return None, [_refusal("xml", f"is not well-formed XML ({reason})", "Export it again")]
    findings = []
    if tree.docinfo.doctype:
        mend = "Leave the DOCTYPE out: importers refuse it, or expand what it defines"
        findings.append(_refusal("xml-doctype", "has a DOCTYPE", mend, practice("safety")))
    root = tree.getroot()
    version = root.get("fmiVersion")
    if root.tag != "fmiModelDescription" or version is None:
        mend = "Check that this is an FMU"
        return None, [*findings, _refusal("xml", "is no description of an FMU", mend)]
    if version != "2.0":
        what = f"is FMI {version}; this check knows FMI 2.0 only, and looked at nothing else"
        return None, [*findings, _refusal("fmi-version", what, "Export it as FMI 2.0")]
    if tree.docinfo.encoding and tree.docinfo.encoding.upper() != "UTF-8":
        what = f"is encoded as {tree.docinfo.encoding}, not as UTF-8"
        findings.append(_refusal("xml-encoding", what, "Write it as UTF-8", standard("2.2")))
    return _description(root), [*findings, *_schema_findings(tree)]

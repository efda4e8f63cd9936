"""modelDescription.xml."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable

from fmu_builder.fmi2.interface import Interface
from fmu_builder.fmi2.units import UNITS
from fmu_builder.fmi2.variable import Variable

UNITY_NAME = "all.c"
"""The only file of `sources/` that is compiled; it includes the others."""

_FIXED_DATE = "2000-01-01T00:00:00Z"  # the same model gives the same bytes, whenever it is built
_LOG_CATEGORIES = {
    "logAll": "Everything",
    "logEvents": "What happens to the instance: the end of initialisation",
    "logStatusError": "Errors: what was refused and why",
    "logStatusDiscard": "Model exchange: states or inputs outside the range where the model is defined",
    "logStatusWarning": "Warnings, for example inputs outside their range, once each",
}


def _text(value: float | int | bool) -> str:
    return str(value).lower() if isinstance(value, bool) else repr(value)


def _real(value: float | int, kind: str) -> str:
    return repr(float(value)) if kind == "Real" else repr(int(value))


def _attributes(**values: str | float | int | bool | None) -> dict[str, str]:
    """Return the attributes that have a value, as text."""
    given = {key: value for key, value in values.items() if value is not None and value != ""}
    return {key: value if isinstance(value, str) else _text(value) for key, value in given.items()}


def _enumeration_name(variable: Variable) -> str:
    return f"{variable.name}_items"


def _add_interfaces(root: ET.Element, interface: Interface) -> None:
    """Add both interfaces: one binary and one list of sources serve model exchange and co-simulation."""
    common = _attributes(
        modelIdentifier=interface.model_identifier,
        needsExecutionTool=False,
        canBeInstantiatedOnlyOncePerProcess=False,
        canNotUseMemoryManagementFunctions=True,
        canGetAndSetFMUstate=True,
        canSerializeFMUstate=True,
        providesDirectionalDerivative=interface.directional_derivatives,
    )
    exchange = _attributes(completedIntegratorStepNotNeeded=True)
    stepping = _attributes(
        canHandleVariableCommunicationStepSize=True,
        canInterpolateInputs=any(variable.type == "Real" for variable in interface.inputs),
        maxOutputDerivativeOrder=0,
        canRunAsynchronuously=False,
    )
    for tag, own in (("ModelExchange", exchange), ("CoSimulation", stepping)):
        element = ET.SubElement(root, tag, {**common, **own})
        ET.SubElement(ET.SubElement(element, "SourceFiles"), "File", name=UNITY_NAME)


def _add_units(root: ET.Element, interface: Interface) -> None:
    used = [name for name in UNITS if any(variable.unit == name for variable in interface.variables)]
    if not used:
        return
    definitions = ET.SubElement(root, "UnitDefinitions")
    for name in used:
        unit = ET.SubElement(definitions, "Unit", name=name)
        exponents = {base: str(exponent) for base, exponent in UNITS[name].exponents().items()}
        ET.SubElement(unit, "BaseUnit", exponents)
        for display, factor in UNITS[name].display:
            ET.SubElement(unit, "DisplayUnit", name=display, factor=repr(factor))


def _add_enumerations(root: ET.Element, interface: Interface) -> None:
    enumerations = [variable for variable in interface.variables if variable.type == "Enumeration"]
    if not enumerations:
        return
    definitions = ET.SubElement(root, "TypeDefinitions")
    for variable in enumerations:
        simple = ET.SubElement(definitions, "SimpleType", name=_enumeration_name(variable))
        items = ET.SubElement(simple, "Enumeration")
        for value, item in enumerate(variable.enumeration, start=1):
            ET.SubElement(items, "Item", name=item, value=str(value))


def _add_experiment(root: ET.Element, interface: Interface) -> None:
    categories = ET.SubElement(root, "LogCategories")
    for name, description in _LOG_CATEGORIES.items():
        ET.SubElement(categories, "Category", name=name, description=description)
    times = _attributes(
        startTime=0.0, stopTime=float(interface.stop_time), stepSize=float(interface.default_step)
    )
    ET.SubElement(root, "DefaultExperiment", times)


def _add_variables(root: ET.Element, interface: Interface) -> None:
    listed = ET.SubElement(root, "ModelVariables")
    for position, variable in enumerate(interface.variables):
        attributes = _attributes(
            name=interface.shown_name(variable),
            valueReference=position,
            description=variable.description,
            causality=variable.causality,
            variability=variable.variability,
            initial=None if variable.causality == "input" else variable.initial,
        )
        scalar = ET.SubElement(listed, "ScalarVariable", attributes)
        kind = variable.type
        state = variable.derivative_of
        limits = {"min": variable.minimum, "max": variable.maximum, "nominal": variable.nominal}
        numbers = {key: _real(value, kind) for key, value in limits.items() if value is not None}
        typed = _attributes(
            declaredType=_enumeration_name(variable) if kind == "Enumeration" else None,
            unit=variable.unit,
            **numbers,
            start=None
            if variable.start is None
            else _text(variable.start)
            if kind == "Boolean"
            else _real(variable.start, kind),
            derivative=None if state is None else interface.value_reference(state) + 1,
        )
        ET.SubElement(scalar, kind, typed)


def _add_unknowns(
    root: ET.Element,
    tag: str,
    interface: Interface,
    unknowns: Iterable[tuple[Variable, Iterable[str] | None]],
) -> None:
    """Add one list of (unknown, names of the knowns that act on it); None: not known which."""
    entries = list(unknowns)
    if not entries:
        return
    listed = ET.SubElement(root, tag)
    for variable, names in entries:
        attributes = {"index": str(interface.value_reference(variable.name) + 1)}
        if names is not None:
            indices = sorted(interface.value_reference(name) + 1 for name in set(names))
            attributes["dependencies"] = " ".join(map(str, indices))
        ET.SubElement(listed, "Unknown", attributes)


def _add_structure(root: ET.Element, interface: Interface) -> None:
    outputs = interface.of_causality("output")
    derivatives = [variable for variable in interface.variables if variable.derivative_of is not None]
    exposed = {*outputs, *derivatives, *(v for v in interface.variables if v.name in interface.states)}
    initial = [v for v in interface.variables if v in exposed and not v.is_known_at_start]
    # The start is the steady state of the inputs under the parameters: every unknown depends on all of them.
    knowns = [v.name for v in interface.variables if v.causality in ("input", "parameter")]
    structure = ET.SubElement(root, "ModelStructure")
    _add_unknowns(structure, "Outputs", interface, ((v, v.dependencies) for v in outputs))
    _add_unknowns(structure, "Derivatives", interface, ((v, v.dependencies) for v in derivatives))
    _add_unknowns(structure, "InitialUnknowns", interface, ((v, knowns) for v in initial))


def model_description(interface: Interface, guid: str) -> str:
    """Return the text of modelDescription.xml (FMI 2.0, model exchange and co-simulation).

    Args:
        interface: The interface.
        guid: The GUID that `interface.guid` gives for the model.
    """
    root = ET.Element(
        "fmiModelDescription",
        _attributes(
            fmiVersion="2.0",
            modelName=interface.model_name,
            guid=guid,
            description=interface.description,
            author=interface.author,
            version=interface.version,
            copyright=interface.copyright,
            license=interface.licence,
            generationTool=interface.tool,
            generationDateAndTime=_FIXED_DATE,
            numberOfEventIndicators=interface.event_indicators,
            variableNamingConvention=interface.naming,
        ),
    )
    _add_interfaces(root, interface)
    _add_units(root, interface)
    _add_enumerations(root, interface)
    _add_experiment(root, interface)
    _add_variables(root, interface)
    _add_structure(root, interface)
    ET.indent(root, space="  ")
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"

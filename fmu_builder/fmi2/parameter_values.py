"""Values of parameters as SSV, the parameter sets of SSP 1.0 (System Structure and Parameterization)."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping

from fmu_builder.fmi2.interface import Interface
from fmu_builder.fmi2.units import UNITS

_VALUES = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
_COMMON = "http://ssp-standard.org/SSP1/SystemStructureCommon"


def parameter_values(name: str, interface: Interface, values: Mapping[str, float]) -> bytes:
    """Return an SSV document that sets Real and Boolean parameters of an FMU.

    Args:
        name: What the set is called.
        interface: The FMU's; units come from it.
        values: By variable name, in the variable's unit, 0 and 1 of Booleans. All digits are kept.

    Raises:
        KeyError: There is no such variable.
    """
    root = ET.Element("ssv:ParameterSet", {"xmlns:ssv": _VALUES, "xmlns:ssc": _COMMON, "version": "1.0"})
    root.set("name", name)
    listed = ET.SubElement(root, "ssv:Parameters")
    variables = [interface.variables[interface.value_reference(key)] for key in values]
    for variable, value in zip(variables, values.values(), strict=True):
        entry = ET.SubElement(listed, "ssv:Parameter", name=interface.shown_name(variable))
        if variable.type == "Boolean":
            ET.SubElement(entry, "ssv:Boolean", value="true" if value else "false")
            continue
        number = ET.SubElement(entry, "ssv:Real", value=repr(float(value)))
        if variable.unit:
            number.set("unit", variable.unit)
    used = [unit for unit in UNITS if any(variable.unit == unit for variable in variables)]
    if used:
        definitions = ET.SubElement(root, "ssv:Units")
        for unit in used:
            exponents = {base: str(exponent) for base, exponent in UNITS[unit].exponents().items()}
            ET.SubElement(ET.SubElement(definitions, "ssc:Unit", name=unit), "ssc:BaseUnit", exponents)
    ET.indent(root, space="  ")
    text = '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"
    return text.encode("utf-8")

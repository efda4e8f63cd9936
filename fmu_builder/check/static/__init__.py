"""What can be seen in a description without running the FMU."""

from fmu_builder.check.static.header import header_findings
from fmu_builder.check.static.names import name_findings
from fmu_builder.check.static.second_opinion import second_opinion
from fmu_builder.check.static.structure import structure_findings
from fmu_builder.check.static.units import unit_findings
from fmu_builder.check.static.variables import variable_findings

__all__ = [
    "header_findings",
    "name_findings",
    "second_opinion",
    "structure_findings",
    "unit_findings",
    "variable_findings",
]

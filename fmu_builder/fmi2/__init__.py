"""FMI 2.0 for model exchange and co-simulation: from variables and C code to an FMU."""

from fmu_builder.fmi2.description import model_description
from fmu_builder.fmi2.documentation import index_page, licence_page
from fmu_builder.fmi2.header import variables_header
from fmu_builder.fmi2.interface import Interface
from fmu_builder.fmi2.package import C_FOLDER, DEFAULT_PLATFORMS, build_fmu, fmi_headers, write_archive
from fmu_builder.fmi2.parameter_values import parameter_values
from fmu_builder.fmi2.units import UNITS, Unit
from fmu_builder.fmi2.variable import Variable

__all__ = [
    "C_FOLDER",
    "DEFAULT_PLATFORMS",
    "UNITS",
    "Interface",
    "Unit",
    "Variable",
    "build_fmu",
    "fmi_headers",
    "index_page",
    "licence_page",
    "model_description",
    "parameter_values",
    "variables_header",
    "write_archive",
]

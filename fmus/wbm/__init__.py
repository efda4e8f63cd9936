"""The white-box pantograph model: equations in C, parameter sets, its FMU, and a direct door from Python."""

from __future__ import annotations

from fmus.wbm.build import build_wbm
from fmus.wbm.parameters import PhysicalParameters, operating_point, parameter_sets
from fmus.wbm.variables import interface

__all__ = ["PhysicalParameters", "build_wbm", "interface", "operating_point", "parameter_sets"]

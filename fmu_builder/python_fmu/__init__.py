"""A parameter set as an FMU that computes in Python (pythonfmu): to check the native one by, and to edit."""

from fmu_builder.python_fmu.build import PLATFORMS, build_python_fmu

__all__ = ["PLATFORMS", "build_python_fmu"]

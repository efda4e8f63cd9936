"""A parameter set as an FMI 2.0 FMU: the kernel, the tables, a model card."""

from fmu_builder.llmn_fmu.build import build_llmn
from fmu_builder.llmn_fmu.card import model_card
from fmu_builder.llmn_fmu.variables import identity, interface

__all__ = ["build_llmn", "identity", "interface", "model_card"]

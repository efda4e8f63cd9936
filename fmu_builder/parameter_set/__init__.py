"""The narrow waist: the versioned, self-validating file format of a local linear model network (LLMN).

Everything that identification finds out goes into a `ParameterSet`; everything that an FMU computes with
comes out of it.
"""

from fmu_builder.parameter_set.canonical import canonical_json
from fmu_builder.parameter_set.checks import FORMAT
from fmu_builder.parameter_set.components import (
    CommonExclusion,
    DerivedOutput,
    DerivedTerm,
    InputSignal,
    LocalLinearModel,
    NamedParameter,
    NodeTable,
    Offsets,
    OutputSignal,
    Partition,
    Quantity,
    ResidualBands,
    StabilityCertificate,
    StabilityProof,
    StaticMap,
    SurrogateCertainty,
    SurrogateParameters,
    TrainedRegion,
    Validity,
    nested,
)
from fmu_builder.parameter_set.consistency import warp_rises
from fmu_builder.parameter_set.evidence import LOWEST_BAND_EDGE
from fmu_builder.parameter_set.model import ParameterSet, load, loads, model_hash, save

__all__ = [
    "FORMAT",
    "LOWEST_BAND_EDGE",
    "CommonExclusion",
    "DerivedOutput",
    "DerivedTerm",
    "InputSignal",
    "LocalLinearModel",
    "NamedParameter",
    "NodeTable",
    "Offsets",
    "OutputSignal",
    "ParameterSet",
    "Partition",
    "Quantity",
    "ResidualBands",
    "StabilityCertificate",
    "StabilityProof",
    "StaticMap",
    "SurrogateCertainty",
    "SurrogateParameters",
    "TrainedRegion",
    "Validity",
    "canonical_json",
    "load",
    "loads",
    "model_hash",
    "nested",
    "save",
    "warp_rises",
]

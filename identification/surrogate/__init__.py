"""Mechanical surrogates of the pantograph: physical parameters, tuned by output error."""

from identification.surrogate.frequency_response import FrequencyResponseFit, FrequencyResponseSettings
from identification.surrogate.job import SurrogateResult, SurrogateSettings, identify, network
from identification.surrogate.output_error import OutputErrorFit, OutputErrorSettings
from identification.surrogate.structure import STRUCTURES, Head, Structure

__all__ = [
    "STRUCTURES",
    "FrequencyResponseFit",
    "FrequencyResponseSettings",
    "Head",
    "OutputErrorFit",
    "OutputErrorSettings",
    "Structure",
    "SurrogateResult",
    "SurrogateSettings",
    "identify",
    "network",
]
